//! The tree of tables and values that a scene file is, every node with the place it was written at.
//!
//! Overrides (`solver.iterations=20`) are laid over the tree before anything is read from it, so
//! they obey the same rules and give the same errors as the file.

use super::SettingError;
use crate::units::shorten;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;
use toml::de::{DeTable, DeValue};

/// Where a key or value was written; printed at the front of an error.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// In a file. Lines and columns count from 1, columns in characters.
    File {
        /// The name the file was given.
        name: Arc<str>,
        /// The line.
        line: usize,
        /// The column.
        column: usize,
    },
    /// In an override.
    Override {
        /// The override's key.
        key: Arc<str>,
    },
}

impl fmt::Display for Place {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File { name, line, column } => {
                write!(formatter, "{name}, line {line}, column {column}")
            }
            Self::Override { key } => write!(formatter, "override of {}", shorten(key)),
        }
    }
}

/// A value and its place.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Node {
    /// Where it was written: for a table its header, otherwise its key.
    pub place: Place,
    /// What was written.
    pub value: Value,
}

impl Node {
    /// Takes an entry out of a table.
    pub fn remove(&mut self, key: &str) -> Option<Self> {
        match &mut self.value {
            Value::Table(entries) => entries.remove(key),
            _ => None,
        }
    }
}

/// A value: the right side of an equals sign.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    Text(String),
    /// Beyond 64 bits a whole number becomes a `Number`.
    Whole(i64),
    Number(f64),
    Truth(bool),
    /// A TOML date or time; no setting takes one.
    Date(String),
    List(Vec<Node>),
    Table(BTreeMap<String, Node>),
}

impl Value {
    /// The value as a person would recognise it, in one short line.
    pub fn written(&self) -> String {
        match self {
            Self::Text(text) => format!("\"{}\"", shorten(text)),
            Self::Whole(number) => number.to_string(),
            Self::Number(number) => number.to_string(),
            Self::Truth(truth) => truth.to_string(),
            Self::Date(text) => text.clone(),
            Self::List(_) => "[...]".to_owned(),
            Self::Table(_) => "{...}".to_owned(),
        }
    }
}

/// A value as it stands in a scene file, without its place.
#[derive(Clone, Debug, PartialEq)]
pub enum SettingValue {
    /// Text, a quantity with its unit among it.
    Text(String),
    /// A whole number.
    Whole(i64),
    /// Another number, in the SI unit of its key.
    Number(f64),
    /// True or false.
    Truth(bool),
    /// A list.
    List(Vec<Self>),
    /// A table by its keys.
    Table(BTreeMap<String, Self>),
}

impl From<&Node> for SettingValue {
    fn from(node: &Node) -> Self {
        match &node.value {
            Value::Text(text) | Value::Date(text) => Self::Text(text.clone()),
            Value::Whole(number) => Self::Whole(*number),
            Value::Number(number) => Self::Number(*number),
            Value::Truth(truth) => Self::Truth(*truth),
            Value::List(items) => Self::List(items.iter().map(Self::from).collect()),
            Value::Table(entries) => {
                let entry = |(key, node): (&String, &Node)| (key.clone(), Self::from(node));
                Self::Table(entries.iter().map(entry).collect())
            }
        }
    }
}

/// What stands at a key, which is as an override has it; nothing where nothing was written there.
pub(crate) fn find_node<'a>(root: &'a Node, key: &str) -> Option<&'a Node> {
    key.split('.').map(str::trim).try_fold(root, |node, step| match &node.value {
        Value::Table(entries) => entries.get(step),
        Value::List(items) => match step.parse::<usize>() {
            Ok(position) => items.get(position),
            Err(_) => items.get(item_names(items).iter().position(|name| name == step)?),
        },
        _ => None,
    })
}

/// Reads TOML.
pub(crate) fn parse_tree(name: &str, text: &str) -> Result<Node, SettingError> {
    let lines = LineIndex::new(name, text);
    let table = DeTable::parse(text).map_err(|error| SettingError::Syntax {
        place: lines.place(error.span().map_or(0, |span| span.start)),
        // The parser's messages may span lines; an error of ours is one.
        message: error.message().trim().replace('\n', "; "),
    })?;
    let place = |offset| lines.place(offset);
    Ok(Node { place: lines.place(0), value: table_value(table.into_inner(), &place) })
}

/// Reads the right-hand side of an override. What is not TOML is text, so that quotes, which a
/// shell would eat, may be left out: `material.young=5 kPa`.
pub(crate) fn parse_override(key: &str, text: &str) -> Node {
    let place = Place::Override { key: key.into() };
    let document = format!("value = {text}");
    let value = match DeTable::parse(&document) {
        Ok(table) if table.get_ref().len() == 1 => {
            match table_value(table.into_inner(), &|_| place.clone()) {
                Value::Table(mut entries) => entries.remove("value").map(|node| node.value),
                _ => None,
            }
        }
        _ => None,
    };
    Node { place, value: value.unwrap_or_else(|| Value::Text(text.trim().to_owned())) }
}

fn table_value(table: DeTable<'_>, place: &dyn Fn(usize) -> Place) -> Value {
    let entries = table.into_iter().map(|(key, value)| {
        let place_of_key = place(key.span().start);
        let node = Node { place: place_of_key, value: value_of(value.into_inner(), place) };
        (key.into_inner().into_owned(), node)
    });
    Value::Table(entries.collect())
}

fn value_of(value: DeValue<'_>, place: &dyn Fn(usize) -> Place) -> Value {
    match value {
        DeValue::String(text) => Value::Text(text.into_owned()),
        DeValue::Integer(number) => match i64::from_str_radix(number.as_str(), number.radix()) {
            Ok(whole) => Value::Whole(whole),
            Err(_) => Value::Number(number.as_str().parse().unwrap_or(f64::NAN)),
        },
        DeValue::Float(number) => Value::Number(number.as_str().parse().unwrap_or(f64::NAN)),
        DeValue::Boolean(truth) => Value::Truth(truth),
        DeValue::Datetime(date) => Value::Date(date.to_string()),
        DeValue::Array(array) => Value::List(
            array
                .into_iter()
                .map(|item| Node {
                    place: place(item.span().start),
                    value: value_of(item.into_inner(), place),
                })
                .collect(),
        ),
        DeValue::Table(table) => table_value(table, place),
    }
}

/// More steps than any key of a scene has. Without a bound a long path of dots would nest tables
/// until walking them overflows the stack.
const MOST_STEPS: usize = 16;

/// Lays one override over the tree. `key` is a path of names; into a list of tables the step is a
/// position from 0 or the table's `name`.
pub(crate) fn apply_override(root: &mut Node, key: &str, text: &str) -> Result<(), SettingError> {
    let place = Place::Override { key: key.into() };
    let mut node = root;
    let mut walked = String::new();
    let is_too_long = key.split('.').count() > MOST_STEPS;
    for step in key.split('.').map(str::trim) {
        if is_too_long || step.is_empty() {
            return Err(SettingError::OverrideKey { key: shorten(key) });
        }
        node = match &mut node.value {
            Value::Table(entries) => entries.entry(step.to_owned()).or_insert_with(|| Node {
                place: place.clone(),
                value: Value::Table(BTreeMap::new()),
            }),
            Value::List(items) => {
                let known = item_names(items);
                let position = match step.parse::<usize>() {
                    Ok(position) => Some(position),
                    Err(_) => known.iter().position(|name| name == step),
                };
                match position.and_then(|position| items.get_mut(position)) {
                    Some(item) => item,
                    None => {
                        return Err(SettingError::OverrideItem {
                            key: shorten(key),
                            list: walked,
                            step: shorten(step),
                            known: known.join(", "),
                        });
                    }
                }
            }
            _ => return Err(SettingError::OverridePath { key: shorten(key), value: walked }),
        };
        if !walked.is_empty() {
            walked.push('.');
        }
        walked.push_str(&shorten(step));
    }
    *node = parse_override(key, text);
    Ok(())
}

/// The names of the tables in a list, or their positions where they have none.
pub(crate) fn item_names(items: &[Node]) -> Vec<String> {
    let name = |(position, item): (usize, &Node)| match &item.value {
        Value::Table(entries) => match entries.get("name").map(|node| &node.value) {
            Some(Value::Text(name)) => name.clone(),
            _ => position.to_string(),
        },
        _ => position.to_string(),
    };
    items.iter().enumerate().map(name).collect()
}

/// Finds lines and columns from byte offsets.
struct LineIndex<'a> {
    name: Arc<str>,
    text: &'a str,
    /// Byte offset of the start of each line.
    starts: Vec<usize>,
}

impl<'a> LineIndex<'a> {
    fn new(name: &str, text: &'a str) -> Self {
        let newlines = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n');
        let starts = std::iter::once(0).chain(newlines.map(|(offset, _)| offset + 1)).collect();
        Self { name: name.into(), text, starts }
    }

    fn place(&self, offset: usize) -> Place {
        // Beyond this many bytes columns count bytes: counting characters for every value of one
        // enormous line would take time with the square of its length.
        const COUNTED_BYTES: usize = 4096;
        let line = self.starts.partition_point(|start| *start <= offset).max(1);
        let start = self.starts.get(line - 1).copied().unwrap_or(0);
        let bytes = offset.saturating_sub(start);
        let counted = match self.text.get(start..offset) {
            Some(before) if bytes <= COUNTED_BYTES => before.chars().count(),
            _ => bytes,
        };
        Place::File { name: self.name.clone(), line, column: counted + 1 }
    }
}
