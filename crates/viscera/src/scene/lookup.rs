//! What a scene says at a key.

use super::{Scene, SceneError, describe};
use crate::settings::{
    KeyDescription, Node, Place, SettingError, SettingValue, TableDescription, Value, find_node,
    parse_override, suggest,
};
use crate::units::shorten;
use std::collections::BTreeMap;

impl Scene {
    /// What stands at a key of the scene, overrides and changes laid over it, the key being as an override has it; else
    /// the key's default, and nothing where it has none. A key that no scene has is an error that names the nearest.
    pub fn setting(&self, key: &str) -> Result<Option<SettingValue>, SceneError> {
        let root = &self.tree.0;
        if let Some(node) = find_node(root, key) {
            return Ok(Some(SettingValue::from(node)));
        }
        let Some(described) = self.described(key)? else {
            return Ok(Some(SettingValue::Table(BTreeMap::new())));
        };
        Ok(match described.default.as_str() {
            "required" | "unset" => None,
            default => Some(SettingValue::from(&parse_override(key, default))),
        })
    }

    /// The description of a key, as an override has it; nothing of a table. A key that no scene has is an error that names
    /// the nearest.
    pub fn described(&self, key: &str) -> Result<Option<KeyDescription>, SceneError> {
        Ok(described_key(&self.tree.0, key)?)
    }
}

/// The description of a key, or nothing of a table.
fn described_key(root: &Node, key: &str) -> Result<Option<KeyDescription>, SettingError> {
    let tables = describe();
    let find = |path: &str| tables.iter().find(|table| table.path == path);
    let steps: Vec<&str> = key.split('.').map(str::trim).collect();
    let mut table = find("").ok_or_else(|| unknown(key, key, "the scene", &[]))?;
    let mut walked = 0;
    while let [step, below @ ..] = &steps[walked..] {
        let path = if table.path.is_empty() {
            (*step).to_owned()
        } else {
            format!("{}.{step}", table.path)
        };
        let Some(next) = find(&path).filter(|_| !step.is_empty()) else {
            let names = names_in(table);
            let known = table.keys.iter().find(|known| known.name == *step);
            return match known {
                Some(known) if below.is_empty() => Ok(Some(known.clone())),
                _ => Err(unknown(key, step, &shown(table), &names)),
            };
        };
        // The name or the number of one of several.
        let items = if next.repeated { 1 } else { 0 };
        if next.repeated
            && let Some(item) = below.first()
        {
            check_item(root, key, &steps[..=walked], item)?;
        }
        walked += 1 + items;
        table = next;
    }
    Ok(None)
}

/// An error where a list has no such item.
fn check_item(root: &Node, key: &str, list: &[&str], item: &str) -> Result<(), SettingError> {
    let list = list.join(".");
    if find_node(root, &format!("{list}.{item}")).is_some() {
        return Ok(());
    }
    let known = match find_node(root, &list).map(|node| &node.value) {
        Some(Value::List(items)) => crate::settings::item_names(items).join(", "),
        _ => "none".to_owned(),
    };
    Err(SettingError::OverrideItem { key: shorten(key), list, step: shorten(item), known })
}

fn names_in(table: &TableDescription) -> Vec<&str> {
    table.keys.iter().map(|key| key.name).collect()
}

fn shown(table: &TableDescription) -> String {
    if table.path.is_empty() { "the scene".to_owned() } else { format!("`{}`", table.path) }
}

fn unknown(key: &str, step: &str, table: &str, names: &[&str]) -> SettingError {
    SettingError::UnknownKey {
        place: Place::Override { key: key.into() },
        key: shorten(step),
        table: table.to_owned(),
        hint: suggest(step, names),
    }
}
