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
    /// Gmsh version 2.x, binary.
    Gmsh2Binary,
    /// Gmsh version 4.0 or 4.1, ASCII.
    Gmsh4,
    /// Gmsh version 4.0 or 4.1, binary.
    Gmsh4Binary,
    /// VTK XML unstructured grid.
    Vtu,
    /// VTK XML polygonal data.
    Vtp,
    /// Legacy VTK, ASCII.
    Vtk,
    /// Legacy VTK, binary.
    VtkBinary,
    /// TetGen, two files.
    TetGen,
    /// Medit, ASCII.
    Medit,
    /// Abaqus input.
    Abaqus,
    /// Wavefront OBJ.
    Obj,
    /// STL, ASCII.
    Stl,
    /// STL, binary.
    StlBinary,
    /// PLY, ASCII.
    Ply,
    /// PLY, binary.
    PlyBinary,
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Gmsh1 => "Gmsh 1 ASCII",
            Self::Gmsh2 => "Gmsh 2 ASCII",
            Self::Gmsh2Binary => "Gmsh 2 binary",
            Self::Gmsh4 => "Gmsh 4 ASCII",
            Self::Gmsh4Binary => "Gmsh 4 binary",
            Self::Vtu => "VTK XML unstructured grid",
            Self::Vtp => "VTK XML polygonal data",
            Self::Vtk => "VTK legacy ASCII",
            Self::VtkBinary => "VTK legacy binary",
            Self::TetGen => "TetGen",
            Self::Medit => "Medit",
            Self::Abaqus => "Abaqus",
            Self::Obj => "Wavefront OBJ",
            Self::Stl => "STL ASCII",
            Self::StlBinary => "STL binary",
            Self::Ply => "PLY ASCII",
            Self::PlyBinary => "PLY binary",
        })
    }
}

/// So many elements of a kind.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct CountedElements {
    /// What they are: "triangle", "line".
    pub kind: String,
    /// How many there are.
    pub count: usize,
}

impl CountedElements {
    /// Counts one more element; kinds keep the order in which they first come.
    pub(super) fn count(list: &mut Vec<Self>, kind: &str) {
        // A damaged file may have as many kinds as elements; each is compared with all before it, and all are listed.
        const MOST_KINDS: usize = 20;
        let at = list.iter().position(|counted| counted.kind == kind);
        match at.or((list.len() == MOST_KINDS).then_some(MOST_KINDS - 1)) {
            Some(at) => list[at].count += 1,
            None => {
                let is_last = list.len() + 1 == MOST_KINDS;
                let kind = if is_last { "element of other types" } else { kind };
                list.push(Self { kind: kind.into(), count: 1 });
            }
        }
    }

    /// "12 x triangle, 3 x line"
    pub(in crate::mesh) fn list(counted: &[Self]) -> String {
        if counted.is_empty() {
            return "no elements".into();
        }
        let each = counted.iter().map(|s| format!("{} x {}", s.count, s.kind));
        each.collect::<Vec<_>>().join(", ")
    }
}

/// Vertices that a file has a name for: a physical group, a node set.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Patch {
    /// Its name in the file, or one made of the group's number.
    pub name: String,
    /// Vertices of the mesh, ascending.
    pub vertices: Vec<u32>,
}

/// The report of reading a file, beside the mesh. The default says "not from a file".
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadReport {
    /// The format found; `None` for a mesh that was built, not read.
    pub format: Option<Format>,
    /// Repairs that were made.
    pub repairs: MeshRepairs,
    /// Elements that are not part of the mesh.
    pub skipped: Vec<CountedElements>,
    /// Elements that were cut into several tetrahedra.
    pub split: Vec<CountedElements>,
    /// How many second-order elements were taken by their corners.
    pub curved: usize,
    /// How far edges of those are from straight, at most [m].
    pub bulge: f64,
    /// Named sets of vertices.
    pub patches: Vec<Patch>,
    /// Regions that have a name.
    pub region_names: Vec<(u32, String)>,
}
