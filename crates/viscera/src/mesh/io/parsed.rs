//! The result of reading a file.

use std::fmt;

use crate::mesh::mend::{Mended, SurfaceMending};
use crate::mesh::{MeshRepairs, SurfaceMesh};

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
    /// What one module of the page hands to the other, see [`handover`](super::handover).
    Handover,
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
            Self::Handover => "page handover",
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

/// What a file holds, mended.
#[derive(Clone, Debug)]
pub enum MendedFile {
    /// Tetrahedra, and their names.
    Tets(Mended, MeshNames),
    /// Triangles alone.
    Surface(SurfaceMesh, SurfaceMending),
}

/// Vertices that a file has a name for: a physical group, a node set.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Patch {
    /// Its name in the file, or one made of the group's number.
    pub name: String,
    /// Vertices of the mesh, ascending.
    pub vertices: Vec<u32>,
}

/// What a mesh file has names for, by vertices and labels of the mesh.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MeshNames {
    /// Named sets of vertices.
    pub patches: Vec<Patch>,
    /// Regions that have a name.
    pub regions: Vec<(u32, String)>,
}

impl MeshNames {
    /// Names of a mended mesh in place of those of what it was made of.
    pub fn follow(&mut self, mended: &Mended) {
        for patch in &mut self.patches {
            let after = patch.vertices.iter().filter_map(|&v| *mended.vertices.get(v as usize)?);
            patch.vertices = after.collect();
            patch.vertices.sort_unstable();
            patch.vertices.dedup();
        }
        self.patches.retain(|patch| !patch.vertices.is_empty());
        self.regions.retain(|(region, _)| mended.mesh.regions().contains(region));
    }

    /// The regions of a mesh as messages list them: "3 `tumour`, 5".
    pub fn list_regions(&self, regions: &[u32]) -> String {
        const SHOWN: usize = 20;
        let mut known = regions.to_vec();
        known.sort_unstable();
        known.dedup();
        let text = |region: &u32| match self.regions.iter().find(|(number, _)| number == region) {
            Some((_, name)) => format!("{region} `{name}`"),
            None => region.to_string(),
        };
        let mut texts: Vec<String> = known.iter().take(SHOWN).map(text).collect();
        if known.len() > SHOWN {
            texts.push("...".to_owned());
        }
        texts.join(", ")
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
    /// Arrays of whole numbers, one for each cell, that were not taken as regions.
    pub unused_arrays: Vec<String>,
}

impl ReadReport {
    /// What the file has names for.
    pub fn names(&self) -> MeshNames {
        MeshNames { patches: self.patches.clone(), regions: self.region_names.clone() }
    }

    /// What is not part of the mesh, a text for each kind. Elements of surfaces, curves and points stand for names only.
    pub fn skipped_texts(&self) -> Vec<String> {
        let kept = match self.patches.len() {
            0 => "tetrahedra need none of them".to_owned(),
            1 => "those with a name are kept as a named patch".to_owned(),
            count => format!("those with names are kept as {count} named patches"),
        };
        let text = |CountedElements { kind, count }: &CountedElements| match kind.as_str() {
            "triangle" => format!("{count} x triangle on surfaces of the mesh: {kept}"),
            "line" => format!("{count} x line on edges of the mesh: {kept}"),
            "point" => format!("{count} x point at vertices of the mesh: {kept}"),
            _ => format!("left out {count} x {kind}"),
        };
        self.skipped.iter().map(text).collect()
    }

    /// Which arrays were not taken as regions, and which would be; nothing where all were.
    pub fn unused_text(&self) -> Option<String> {
        unused_text(&self.unused_arrays)
    }
}

/// Names that programs give to the array that says which part of a body a cell is of.
pub(super) const REGIONS: [&str; 12] = [
    "region",
    "regions",
    "RegionId",
    "gmsh:physical",
    "medit:ref",
    "cell_tags",
    "label",
    "labels",
    "material",
    "MaterialId",
    "MaterialIds",
    "CellEntityIds",
];

/// See [`ReadReport::unused_text`].
pub(in crate::mesh) fn unused_text(arrays: &[String]) -> Option<String> {
    const SHOWN: usize = 12;
    let mut texts: Vec<String> =
        arrays.iter().take(SHOWN).map(|name| format!("`{name}`")).collect();
    if arrays.len() > SHOWN {
        texts.push("...".to_owned());
    }
    let (which, known) = (texts.join(", "), REGIONS.join(", "));
    let (what, is) = if arrays.len() == 1 { ("cell array", "is") } else { ("cell arrays", "are") };
    let text = format!(
        "{what} {which} {is} not used: regions come from a cell array with one of the names {known}"
    );
    (!arrays.is_empty()).then_some(text)
}
