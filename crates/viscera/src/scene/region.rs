//! Parts of a body that are made of something else, and how a scene names them.

use std::fmt;

use crate::material::Material;
use crate::mesh::io::MeshNames;
use crate::scalar::Vec3;
use crate::settings::{Kind, Node, SettingError, Value, ValueError, value_error, whole};

/// A part of a body made of something else.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// The label its tetrahedra carry, or the name that the mesh file has for it.
    pub label: RegionLabel,
    /// The ball whose tetrahedra, by their middles, get the label; nothing where the mesh has it.
    pub ball: Option<Ball>,
    /// Its material.
    pub material: Material,
}

/// A ball in the world, at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// [m].
    pub center: Vec3<f64>,
    /// [m].
    pub radius: f64,
}

/// What a scene calls a region of a mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RegionLabel {
    /// The label of its tetrahedra.
    Number(u32),
    /// The name that the mesh file has for the label.
    Name(String),
}

impl RegionLabel {
    /// The labels that are meant: several where the file gives one name to several, none where it has no such name.
    pub fn numbers(&self, names: &MeshNames) -> Vec<u32> {
        match self {
            Self::Number(number) => vec![*number],
            Self::Name(wanted) => {
                let of_name = names.regions.iter().filter(|(_, name)| name == wanted);
                of_name.map(|(number, _)| *number).collect()
            }
        }
    }
}

impl From<u32> for RegionLabel {
    fn from(number: u32) -> Self {
        Self::Number(number)
    }
}

impl fmt::Display for RegionLabel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => write!(f, "{number}"),
            Self::Name(name) => write!(f, "`{name}`"),
        }
    }
}

/// Reads a label or a name.
pub(super) struct RegionKind;

impl Kind for RegionKind {
    type Value = RegionLabel;

    fn read(&self, key: &str, node: &Node) -> Result<RegionLabel, SettingError> {
        match &node.value {
            Value::Text(name) => Ok(RegionLabel::Name(name.clone())),
            Value::Whole(_) => whole(0, u32::MAX).read(key, node).map(RegionLabel::Number),
            _ => Err(value_error(key, node, ValueError::Type { wanted: self.type_text() })),
        }
    }

    fn type_text(&self) -> String {
        "a label (a whole number), or the name in quotes that the mesh file has for it".to_owned()
    }

    fn value_text(&self, value: &RegionLabel) -> String {
        match value {
            RegionLabel::Number(number) => number.to_string(),
            RegionLabel::Name(name) => format!("\"{name}\""),
        }
    }
}
