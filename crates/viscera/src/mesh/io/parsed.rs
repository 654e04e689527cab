//! The result of reading a file.

use std::fmt;

use crate::mesh::MeshRepairs;

/// The formats that can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// Gmsh version 1, ASCII.
    Gmsh1,
    /// Gmsh version 2.x, ASCII.
    Gmsh2,
    /// VTK XML unstructured grid, ASCII.
    Vtu,
    /// Wavefront OBJ.
    Obj,
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Gmsh1 => "Gmsh 1 ASCII",
            Self::Gmsh2 => "Gmsh 2 ASCII",
            Self::Vtu => "VTK XML unstructured grid",
            Self::Obj => "Wavefront OBJ",
        })
    }
}

/// Elements of a file that are not part of the mesh.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct SkippedElements {
    /// What they are: "triangle", "line".
    pub kind: String,
    /// How many there are.
    pub count: usize,
}

impl SkippedElements {
    /// Counts one more element; kinds keep the order in which they first come.
    pub(super) fn count(list: &mut Vec<Self>, kind: String) {
        match list.iter_mut().find(|skipped| skipped.kind == kind) {
            Some(skipped) => skipped.count += 1,
            None => list.push(Self { kind, count: 1 }),
        }
    }

    /// "12 x triangle, 3 x line"
    pub(in crate::mesh) fn list(skipped: &[Self]) -> String {
        if skipped.is_empty() {
            return "no elements".into();
        }
        let each = skipped.iter().map(|s| format!("{} x {}", s.count, s.kind));
        each.collect::<Vec<_>>().join(", ")
    }
}

/// The report of reading a file, beside the mesh. The default says "not from a file".
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadReport {
    /// The format found; `None` for a mesh that was built, not read.
    pub format: Option<Format>,
    /// Repairs that were made.
    pub repairs: MeshRepairs,
    /// Elements that are not part of the mesh.
    pub skipped: Vec<SkippedElements>,
}

/// The result of a format's reader, before checks that all formats share.
pub(super) struct Parsed<Mesh> {
    pub mesh: Mesh,
    pub repairs: MeshRepairs,
    pub format: Format,
    pub skipped: Vec<SkippedElements>,
}
