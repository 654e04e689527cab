//! Changes by hand to a scene, as text that a scene file takes.

use super::{
    Change, Hand, Instrument, Interpolation, JawKey, Motion, MotionKey, Patch, Scene, Selector,
};
use crate::scalar::Vec3;
use crate::settings::{Choice, Node, Value};
use std::collections::BTreeMap;
use std::fmt::Write;

impl Scene {
    /// The scene as a file: what was written, with all overrides and changes laid over it. Comments and the order of keys
    /// are gone; [`Scene::write`] may follow.
    pub fn text(&self) -> String {
        let Value::Table(entries) = &self.tree.0.value else { return String::new() };
        let mut text = String::new();
        let (tables, values): (Vec<_>, Vec<_>) =
            entries.iter().partition(|(_, node)| table_entries(node).is_some());
        for (key, node) in values {
            put(&mut text, format_args!("{} = {}\n", key_name(key), value_text(&node.value)));
        }
        for (key, node) in tables {
            let of_list = matches!(node.value, Value::List(_));
            let header = if of_list {
                format!("[[{}]]", key_name(key))
            } else {
                format!("[{}]", key_name(key))
            };
            for table in table_entries(node).unwrap_or_default() {
                put(&mut text, format_args!("\n{header}\n"));
                write_entries(table, &mut text);
            }
        }
        text
    }

    /// Motions and changes as a scene file has them, to be put behind its other tables; every number but
    /// rotations comes back with the same bits. The bodies are those of this scene.
    pub fn write(&self, motions: &[Motion], changes: &[Change]) -> String {
        let mut text = String::new();
        for motion in motions {
            self.write_motion(motion, &mut text);
        }
        for Change { time, settings } in changes {
            let quoted: Vec<String> =
                settings.iter().map(|(key, value)| quote(&format!("{key} = {value}"))).collect();
            let list = quoted.join(", ");
            put(&mut text, format_args!("\n[[change]]\ntime = \"{time} s\"\nset = [{list}]\n"));
        }
        text
    }

    /// Tools that were taken into the scene by hand, and hands with the tools that each has, in the same way.
    pub fn write_tools(&self, tools: &[Instrument], hands: &[(String, Hand)]) -> String {
        let mut text: String = tools.iter().map(Instrument::text).collect();
        for (tool, hand) in hands {
            write_hand(tool, hand, &mut text);
        }
        text
    }

    fn write_motion(&self, motion: &Motion, text: &mut String) {
        let Motion { name, patch, keys, interpolation, about, start, stiffness, release } = motion;
        let body = self.bodies.get(patch.body).map_or("", |body| &body.name);
        put(text, format_args!("\n[[motion]]\nname = {}\nbody = {}\n", quote(name), quote(body)));
        put(text, format_args!("{}\n", selector_text(patch)));
        let known = Interpolation::ALL.iter().find(|(value, ..)| value == interpolation);
        if let Some((_, name, _)) = known {
            put(text, format_args!("interpolation = \"{name}\"\n"));
        }
        if *about != Vec3::ZERO {
            put(text, format_args!("about = {}\n", lengths(*about)));
        }
        if *start > 0.0 {
            put(text, format_args!("start = \"{start} s\"\n"));
        }
        if let Some(stiffness) = stiffness {
            put(text, format_args!("stiffness = \"{stiffness} N/m\"\n"));
        }
        if let Some(release) = release {
            put(text, format_args!("release = \"{release} s\"\n"));
        }
        put(text, format_args!("keys = [\n"));
        for key in keys {
            put(text, format_args!("  {},\n", key_text(key)));
        }
        put(text, format_args!("]\n"));
    }
}

fn write_entries(table: &BTreeMap<String, Node>, text: &mut String) {
    for (key, node) in table {
        put(text, format_args!("{} = {}\n", key_name(key), value_text(&node.value)));
    }
}

fn write_hand(tool: &str, hand: &Hand, text: &mut String) {
    let Hand { from, keys, jaw, locks, end } = hand;
    put(text, format_args!("\n[[hand]]\ntool = {}\nfrom = \"{from} s\"\n", quote(tool)));
    if let Some(end) = end {
        put(text, format_args!("end = \"{end} s\"\n"));
    }
    let mut list = |name: &str, lines: Vec<String>| {
        if !lines.is_empty() {
            let lines: String = lines.iter().map(|line| format!("  {{ {line} }},\n")).collect();
            put(text, format_args!("{name} = [\n{lines}]\n"));
        }
    };
    let lock = |[from, to]: &[f64; 2]| match to.is_finite() {
        true => format!("from = \"{from} s\", to = \"{to} s\""),
        false => format!("from = \"{from} s\""),
    };
    list("lock", locks.iter().map(lock).collect());
    let angle = |key: &JawKey| format!("time = \"{} s\", angle = \"{} rad\"", key.time, key.value);
    list("jaw", jaw.iter().map(angle).collect());
    let pose = |key: &MotionKey| {
        let (place, turn) = (lengths(key.translation), radians(key.rotation));
        format!("time = \"{} s\", translation = {place}, rotation_vector = {turn}", key.time)
    };
    list("keys", keys.iter().map(pose).collect());
}

impl Instrument {
    /// What was written of it, as a scene file or a tray has it.
    pub fn text(&self) -> String {
        let mut text = String::from("\n[[tool]]\n");
        if let Value::Table(entries) = &self.table.0.value {
            write_entries(entries, &mut text);
        }
        text
    }
}

/// A table, or a list of tables, as tables with a header each; nothing of another value.
fn table_entries(node: &Node) -> Option<Vec<&BTreeMap<String, Node>>> {
    match &node.value {
        Value::Table(entries) => Some(vec![entries]),
        Value::List(nodes) if !nodes.is_empty() => nodes
            .iter()
            .map(|node| match &node.value {
                Value::Table(entries) => Some(entries),
                _ => None,
            })
            .collect(),
        _ => None,
    }
}

/// A value on one line.
fn value_text(value: &Value) -> String {
    match value {
        Value::Text(text) => quote(text),
        Value::Whole(number) => number.to_string(),
        Value::Number(number) => format!("{number:?}"),
        Value::Truth(truth) => truth.to_string(),
        Value::Date(text) => text.clone(),
        Value::List(nodes) => {
            let items: Vec<String> = nodes.iter().map(|node| value_text(&node.value)).collect();
            format!("[{}]", items.join(", "))
        }
        Value::Table(entries) => {
            let entry = |(key, node): (&String, &Node)| {
                format!("{} = {}", key_name(key), value_text(&node.value))
            };
            format!("{{ {} }}", entries.iter().map(entry).collect::<Vec<_>>().join(", "))
        }
    }
}

/// A key, in quotes where it needs them.
fn key_name(key: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if !key.is_empty() && key.chars().all(plain) { key.to_owned() } else { quote(key) }
}

fn key_text(key: &MotionKey) -> String {
    let MotionKey { time, translation, rotation } = key;
    let mut text = format!("{{ time = \"{time} s\", translation = {}", lengths(*translation));
    let angle = rotation.length();
    if angle > 0.0 {
        let axis = *rotation * (1.0 / angle);
        put(&mut text, format_args!(", rotation_axis = [{}, {}, {}]", axis.x, axis.y, axis.z));
        put(&mut text, format_args!(", rotation_angle = \"{angle} rad\""));
    }
    text + " }"
}

fn selector_text(patch: &Patch) -> String {
    match &patch.selector {
        Selector::Box { min, max } => {
            format!("box = {{ min = {}, max = {} }}", lengths(*min), lengths(*max))
        }
        Selector::Sphere { center, radius } => {
            format!("sphere = {{ center = {}, radius = \"{radius} m\" }}", lengths(*center))
        }
        Selector::HalfSpace { point, normal: n } => {
            let point = lengths(*point);
            format!("half_space = {{ point = {point}, normal = [{}, {}, {}] }}", n.x, n.y, n.z)
        }
        Selector::Nearest { point, count } => {
            format!("nearest = {{ point = {}, count = {count} }}", lengths(*point))
        }
        Selector::Region(label) => format!("region = {label}"),
        Selector::NamedRegion(name) => format!("region = {}", quote(name)),
        Selector::Patch(name) => format!("patch = {}", quote(name)),
    }
}

pub(super) fn lengths(v: Vec3<f64>) -> String {
    format!("[\"{} m\", \"{} m\", \"{} m\"]", v.x, v.y, v.z)
}

pub(super) fn radians(v: Vec3<f64>) -> String {
    format!("[\"{} rad\", \"{} rad\", \"{} rad\"]", v.x, v.y, v.z)
}

/// As TOML has text.
fn quote(text: &str) -> String {
    let mut quoted = String::from("\"");
    for letter in text.chars() {
        match letter {
            '"' | '\\' => quoted.extend(['\\', letter]),
            letter if letter.is_control() => {
                put(&mut quoted, format_args!("\\u{:04x}", letter as u32));
            }
            letter => quoted.push(letter),
        }
    }
    quoted.push('"');
    quoted
}

/// Writing to text does not fail.
fn put(text: &mut String, what: std::fmt::Arguments<'_>) {
    let _ = text.write_fmt(what);
}
