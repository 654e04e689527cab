//! Every setting, declared once.
//!
//! A table of settings is written with [`settings_table!`](self): name, Rust type, default, kind
//! (type, unit and allowed range) and documentation. From that one declaration come the struct, its
//! `Default`, reading it from TOML with errors that name line, column and the nearest valid name,
//! overrides, and the descriptions that `viscera scene describe` prints.

mod accuracy;
mod compound;
mod device;
mod elements;
mod foreseen;
mod kind;
mod solver;
mod tree;

pub use accuracy::{Accuracy, FINEST, ROUGHEST};
pub use device::DeviceRequest;
pub use elements::Elements;
pub(crate) use foreseen::HAS_MEETINGS;
pub use solver::{
    Acceleration, AndersonGuard, AndersonOn, Clusters, Colors, Count, Integrator, MOST_HISTORY,
    MOST_THREADS, Method, NeoHookean, Precision, RelaxationForm, SolverSettings, Start, Threads,
};
pub use tree::{Place, SettingValue};

pub(crate) use compound::*;
pub(crate) use kind::*;
pub(crate) use tree::{
    Node, Value, apply_override, find_node, item_names, parse_override, parse_tree,
};

use crate::units::{UnitError, shorten};

/// Why a setting could not be read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SettingError {
    /// The text is not TOML.
    #[error("{place}: {message}")]
    Syntax {
        /// Where reading stopped.
        place: Place,
        /// The parser's expectation.
        message: String,
    },
    /// A key that does not exist.
    #[error("{place}: unknown key `{key}` in {table}; {hint}")]
    UnknownKey {
        /// Where it was written.
        place: Place,
        /// The key.
        key: String,
        /// The table it was written in.
        table: String,
        /// The nearest valid name, or all of them.
        hint: String,
    },
    /// A key without which the table means nothing.
    #[error("{place}: {table} needs the key `{key}`, {wanted}")]
    MissingKey {
        /// Where the table was written.
        place: Place,
        /// The table.
        table: String,
        /// The key.
        key: &'static str,
        /// What it would hold.
        wanted: String,
    },
    /// A value that its key cannot take.
    #[error("{place}: {key} = {written}: {problem}")]
    Value {
        /// Where it was written.
        place: Place,
        /// The key.
        key: String,
        /// The value.
        written: String,
        /// Why not.
        problem: Box<ValueError>,
    },
    /// An override's key is not a path of names.
    #[error("override of {key}: a key is names joined by dots, for example solver.iterations")]
    OverrideKey {
        /// The key.
        key: String,
    },
    /// An override reaches into something that has no keys.
    #[error("override of {key}: {value} is a value and has no keys; shorten the override's key")]
    OverridePath {
        /// The override's key.
        key: String,
        /// The part of it that is a value.
        value: String,
    },
    /// An override names an item that a list does not have.
    #[error("override of {key}: {list} has no item `{step}`; it has: {known}")]
    OverrideItem {
        /// The override's key.
        key: String,
        /// The list.
        list: String,
        /// The position or name.
        step: String,
        /// The names there are.
        known: String,
    },
}

/// Why a key cannot take a value.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ValueError {
    /// Text where a number should be, and the like.
    #[error("this must be {wanted}")]
    Type {
        /// What the key takes.
        wanted: String,
    },
    /// Outside the allowed range.
    #[error("out of range; it must be {range}")]
    Range {
        /// What is allowed.
        range: String,
    },
    /// Not among the names that the key takes.
    #[error("{hint}")]
    Choice {
        /// The nearest valid name, and all of them.
        hint: String,
    },
    /// Not a quantity of the right dimension.
    #[error(transparent)]
    Quantity(#[from] UnitError),
    /// Impossible for a reason of its own.
    #[error("{0}")]
    Impossible(String),
}

/// The description of one key.
#[derive(Clone, Debug, PartialEq)]
pub struct KeyDescription {
    /// The key.
    pub name: &'static str,
    /// Its type, with its unit.
    pub type_text: String,
    /// The SI unit of its numbers; empty where they have none.
    pub unit: &'static str,
    /// The allowed range; empty where everything of the type is allowed.
    pub range: String,
    /// The default as one would write it; `required` or `unset` where there is none.
    pub default: String,
    /// Its effect.
    pub doc: String,
}

/// The description of one table.
#[derive(Clone, Debug, PartialEq)]
pub struct TableDescription {
    /// The table's path, for example `body.material`.
    pub path: String,
    /// Whether there may be any number of it: `[[body]]`.
    pub repeated: bool,
    /// What it says.
    pub doc: String,
    /// Its keys.
    pub keys: Vec<KeyDescription>,
}

/// A group of settings; implemented by [`settings_table!`](self) only.
pub(crate) trait Table: Sized {
    /// What the table says.
    const DOC: &'static str;
    /// Adds the names of all keys.
    fn names(names: &mut Vec<&'static str>);
    /// Reads the fields.
    fn read(entries: &Entries<'_>) -> Result<Self, SettingError>;
    /// Adds each key and its value as one would write it.
    fn values(&self, values: &mut Vec<(&'static str, String)>);
    /// Adds a description of each key, and of each table below.
    fn describe(path: &str, keys: &mut Vec<KeyDescription>, below: &mut Vec<TableDescription>);
}

/// The content of a table in the file, while its fields are being read.
pub(crate) struct Entries<'a> {
    /// The table's key, or its name where it has one.
    pub table: String,
    /// Where the table was written.
    pub place: &'a Place,
    entries: &'a std::collections::BTreeMap<String, Node>,
}

impl Entries<'_> {
    /// Reads one key; `None` where it is absent.
    pub fn get<K: Kind>(&self, key: &str, kind: K) -> Result<Option<K::Value>, SettingError> {
        self.entries.get(key).map(|node| kind.read(key, node)).transpose()
    }

    /// Reads one key that must be there.
    pub fn require<K: Kind>(&self, key: &'static str, kind: K) -> Result<K::Value, SettingError> {
        let wanted = kind.type_text();
        self.get(key, kind)?.ok_or_else(|| SettingError::MissingKey {
            place: self.place.clone(),
            table: self.table.clone(),
            key,
            wanted,
        })
    }
}

/// Reads a table of settings: no key but those declared, every value in its range.
pub(crate) fn read_table<T: Table>(key: &str, node: &Node) -> Result<T, SettingError> {
    let Value::Table(entries) = &node.value else {
        return Err(value_error(key, node, ValueError::Type { wanted: "a table".to_owned() }));
    };
    let mut names = Vec::new();
    T::names(&mut names);
    let table = if key.is_empty() { "the scene".to_owned() } else { format!("`{key}`") };
    for (written, unknown) in entries {
        if !names.contains(&written.as_str()) {
            return Err(SettingError::UnknownKey {
                place: unknown.place.clone(),
                key: shorten(written),
                table,
                hint: suggest(written, &names),
            });
        }
    }
    T::read(&Entries { table, place: &node.place, entries })
}

/// Describes a table and all below it, in the order of their declaration.
pub(crate) fn describe_table<T: Table>(path: &str, repeated: bool) -> Vec<TableDescription> {
    let (mut keys, mut below) = (Vec::new(), Vec::new());
    T::describe(path, &mut keys, &mut below);
    let doc = tidy_doc(T::DOC);
    let mut tables = vec![TableDescription { path: path.to_owned(), repeated, doc, keys }];
    tables.append(&mut below);
    tables
}

/// An error about the value of one key.
pub(crate) fn value_error(key: &str, node: &Node, problem: ValueError) -> SettingError {
    let (place, written) = (node.place.clone(), node.value.written());
    SettingError::Value { place, key: shorten(key), written, problem: Box::new(problem) }
}

/// The nearest valid name where one is near, otherwise all of them.
pub fn suggest(written: &str, names: &[&str]) -> String {
    let lower = shorten(&written.to_lowercase());
    let distance = |name: &str| strsim::damerau_levenshtein(&lower, &name.to_lowercase());
    let nearest = names.iter().min_by_key(|name| distance(name));
    let near = |name: &&&str| {
        // A third of the letters wrong is a slip of the hand; more is another word.
        let length = name.chars().count().max(lower.chars().count());
        distance(name) * 3 <= length + 1
            || (lower.len() > 2 && name.to_lowercase().contains(&lower))
    };
    match nearest.filter(near) {
        Some(name) => format!("did you mean `{name}`?"),
        None => format!("valid: {}", names.join(", ")),
    }
}

/// A documentation comment as running text: paragraphs joined, leading spaces gone.
pub(crate) fn tidy_doc(doc: &str) -> String {
    doc.lines().map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join(" ")
}

/// `r#box` is the key `box`.
pub(crate) fn key_name(field: &'static str) -> &'static str {
    // Some words of the language can be no field's name: `r#move` is "move", `self_` is "self".
    field.trim_start_matches("r#").trim_end_matches('_')
}

/// Reads a field, falling back on its declared default.
macro_rules! read_field {
    ($entries:ident, $name:expr, required, $kind:expr) => {
        $entries.require($name, $kind)?
    };
    ($entries:ident, $name:expr, ($($default:tt)+), $kind:expr) => {
        match $entries.get($name, $kind)? {
            Some(value) => value,
            None => $($default)+,
        }
    };
    ($entries:ident, $name:expr, $default:tt, $kind:expr) => {
        $crate::settings::read_field!($entries, $name, ($default), $kind)
    };
}

/// The text of a field's default.
macro_rules! default_text {
    (required, $kind:expr) => {
        "required".to_owned()
    };
    (($($default:tt)+), $kind:expr) => {
        $crate::settings::value_text_of(&$kind, $($default)+)
    };
    ($default:tt, $kind:expr) => {
        $crate::settings::default_text!(($default), $kind)
    };
}

/// A field's default itself, for tables that have no required key.
macro_rules! default_value {
    (($($default:tt)+)) => {
        $($default)+
    };
    ($default:tt) => {
        $default
    };
}

/// Declares a table of settings.
///
/// `field: Type = default, kind;` where `default` is `required`, one token, or an expression in
/// parentheses; `with FieldType as field` takes in the keys of another table. `#[default]` in front
/// also gives the struct a `Default`.
macro_rules! settings_table {
    (
        #[default]
        $(#[doc = $table_doc:literal])+
        $vis:vis struct $table:ident {
            $( $(#[doc = $doc:literal])+ $field:ident: $type:ty = $default:tt, $kind:expr; )+
        }
    ) => {
        $crate::settings::settings_table! {
            $(#[doc = $table_doc])+
            $vis struct $table {
                $( $(#[doc = $doc])+ $field: $type = $default, $kind; )+
            }
        }

        impl Default for $table {
            fn default() -> Self {
                Self { $( $field: $crate::settings::default_value!($default) ),+ }
            }
        }
    };
    (
        $(#[doc = $table_doc:literal])+
        $vis:vis struct $table:ident {
            $( $(#[doc = $doc:literal])+ $field:ident: $type:ty = $default:tt, $kind:expr; )+
            $( with $taken:ty as $taken_field:ident; )?
        }
    ) => {
        $(#[doc = $table_doc])+
        #[derive(Clone, Debug, PartialEq)]
        $vis struct $table {
            $(
                $(#[doc = $doc])+
                #[doc = concat!(
                    "\n\nDeclared: `", stringify!($default), "`, `", stringify!($kind), "`."
                )]
                pub $field: $type,
            )*
            $(
                /// Keys shared with other tables.
                pub $taken_field: $taken,
            )?
        }

        impl $crate::settings::Table for $table {
            const DOC: &'static str = concat!($($table_doc, "\n"),+);

            fn names(names: &mut Vec<&'static str>) {
                $( names.push($crate::settings::key_name(stringify!($field))); )*
                $( <$taken as $crate::settings::Table>::names(names); )?
            }

            fn read(
                entries: &$crate::settings::Entries<'_>,
            ) -> Result<Self, $crate::settings::SettingError> {
                Ok(Self {
                    $(
                        $field: $crate::settings::read_field!(
                            entries,
                            $crate::settings::key_name(stringify!($field)),
                            $default,
                            $kind
                        ),
                    )*
                    $( $taken_field: <$taken as $crate::settings::Table>::read(entries)?, )?
                })
            }

            fn values(&self, values: &mut Vec<(&'static str, String)>) {
                $(
                    values.push((
                        $crate::settings::key_name(stringify!($field)),
                        $crate::settings::Kind::value_text(&$kind, &self.$field),
                    ));
                )*
                $( $crate::settings::Table::values(&self.$taken_field, values); )?
            }

            fn describe(
                path: &str,
                keys: &mut Vec<$crate::settings::KeyDescription>,
                below: &mut Vec<$crate::settings::TableDescription>,
            ) {
                $(
                    let name = $crate::settings::key_name(stringify!($field));
                    keys.push($crate::settings::describe_key(
                        name,
                        &$kind,
                        $crate::settings::default_text!($default, $kind),
                        concat!($($doc, "\n"),+),
                    ));
                    $crate::settings::describe_below(path, name, &$kind, below);
                )*
                $( <$taken as $crate::settings::Table>::describe(path, keys, below); )?
            }
        }
    };
}

/// Declares an enum whose variants have names in a scene file.
macro_rules! choices {
    (
        $(#[doc = $enum_doc:literal])+
        $vis:vis enum $choice:ident {
            $( $(#[doc = $doc:literal])+ $variant:ident = $name:literal, )+
        }
    ) => {
        $(#[doc = $enum_doc])+
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        $vis enum $choice {
            $( $(#[doc = $doc])+ $variant, )+
        }

        impl $crate::settings::Choice for $choice {
            const ALL: &'static [(Self, &'static str, &'static str)] =
                &[$( (Self::$variant, $name, concat!($($doc, "\n"),+)) ),+];
        }

        impl std::fmt::Display for $choice {
            fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                formatter.write_str(match self { $( Self::$variant => $name ),+ })
            }
        }
    };
}

pub(crate) use {choices, default_text, default_value, read_field, settings_table};

/// A default as one would write it.
pub(crate) fn value_text_of<K: Kind>(kind: &K, value: K::Value) -> String {
    kind.value_text(&value)
}

/// Describes one key of a table.
pub(crate) fn describe_key<K: Kind>(
    name: &'static str,
    kind: &K,
    default: String,
    doc: &str,
) -> KeyDescription {
    let mut doc = tidy_doc(doc);
    let choices = kind.choices_text();
    if !choices.is_empty() {
        doc = format!("{doc} {choices}");
    }
    let (type_text, unit, range) = (kind.type_text(), kind.unit(), kind.range_text());
    KeyDescription { name, type_text, unit, range, default, doc }
}

/// Describes the tables below one key of a table.
pub(crate) fn describe_below<K: Kind>(
    path: &str,
    name: &str,
    kind: &K,
    below: &mut Vec<TableDescription>,
) {
    let path = if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
    kind.describe_tables(&path, below);
}
