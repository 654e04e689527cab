//! Every key a scene file can have, from the declarations of the settings themselves.

use super::tables::{SceneTable, WorldSettings};
use crate::material::{PRESET_CAUTION, PRESETS};
use crate::settings::{KeyDescription, SolverSettings, TableDescription, describe_table};
use std::fmt::Write;

/// Every table of a scene file and its keys, the scene itself first.
pub fn describe() -> Vec<TableDescription> {
    describe_table::<SceneTable>("", false)
}

/// Those of solver and world, which can be set while a scene runs.
pub fn describe_settings() -> Vec<TableDescription> {
    let mut tables = describe_table::<WorldSettings>("world", false);
    tables.extend(describe_table::<SolverSettings>("solver", false));
    tables
}

/// The tables of [`describe`] for printing: what several have in common (a selector of a fixing, of
/// a motion, of a force) is said once, under all their headers.
fn printed_tables() -> Vec<(String, TableDescription)> {
    let mut printed: Vec<(String, TableDescription)> = Vec::new();
    for table in describe() {
        let header = header(&table);
        let same = |(_, other): &&mut (String, TableDescription)| {
            other.doc == table.doc && other.keys == table.keys
        };
        match printed.iter_mut().find(same) {
            Some((headers, _)) => {
                headers.push(' ');
                headers.push_str(&header);
            }
            None => printed.push((header, table)),
        }
    }
    printed
}

/// The header under which a table is written: `[solver]`, `[[body]]`.
fn header(table: &TableDescription) -> String {
    match (table.path.is_empty(), table.repeated) {
        (true, _) => "scene".to_owned(),
        (false, true) => format!("[[{}]]", table.path),
        (false, false) => format!("[{}]", table.path),
    }
}

/// Type, range and default in one line.
fn facts(key: &KeyDescription) -> String {
    let range = match key.range.is_empty() {
        true => String::new(),
        false => format!("; {}", key.range),
    };
    let default = match key.default.as_str() {
        "required" => "required".to_owned(),
        "unset" => "optional".to_owned(),
        default => format!("default {default}"),
    };
    format!("{}{range}; {default}", key.type_text)
}

/// Every key, as plain text for a terminal.
pub fn describe_text() -> String {
    let mut text = String::new();
    for (headers, table) in printed_tables() {
        push_wrapped(&mut text, "", &headers);
        push_wrapped(&mut text, "    ", &table.doc);
        for key in &table.keys {
            push_line(&mut text, format_args!("\n    {}", key.name));
            push_wrapped(&mut text, "        ", &facts(key));
            push_wrapped(&mut text, "        ", &key.doc);
        }
        text.push('\n');
    }
    text.push_str("presets of material.preset\n");
    push_wrapped(&mut text, "    ", PRESET_CAUTION);
    for preset in PRESETS {
        push_line(&mut text, format_args!("\n    {}", preset.name));
        push_wrapped(&mut text, "        ", &preset.description());
    }
    text
}

/// Every key, as Markdown.
pub fn describe_markdown() -> String {
    let mut text = String::from("# Scene files\n");
    for (headers, table) in printed_tables() {
        let headers = headers.replace(' ', "` `");
        push_line(&mut text, format_args!("\n## `{headers}`\n\n{}\n", table.doc));
        text.push_str("| key | takes | what it does |\n|---|---|---|\n");
        for key in &table.keys {
            let cell = |content: &str| content.replace('|', "\\|");
            let (facts, doc) = (cell(&facts(key)), cell(&key.doc));
            push_line(&mut text, format_args!("| `{}` | {facts} | {doc} |", key.name));
        }
    }
    push_line(&mut text, format_args!("\n## Presets of `material.preset`\n\n{PRESET_CAUTION}\n"));
    text.push_str("| preset | what it is |\n|---|---|\n");
    for preset in PRESETS {
        push_line(&mut text, format_args!("| `{}` | {} |", preset.name, preset.description()));
    }
    text
}

fn push_line(text: &mut String, line: std::fmt::Arguments<'_>) {
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{line}");
}

/// Breaks running text into lines of at most 88 characters.
fn push_wrapped(text: &mut String, indent: &str, content: &str) {
    const WIDTH: usize = 88;
    let mut length = 0;
    for word in content.split_whitespace() {
        let word_length = word.chars().count();
        if length > 0 && length + 1 + word_length > WIDTH - indent.len() {
            text.push('\n');
            length = 0;
        }
        if length == 0 {
            text.push_str(indent);
            length = word_length;
        } else {
            text.push(' ');
            length += 1 + word_length;
        }
        text.push_str(word);
    }
    text.push('\n');
}
