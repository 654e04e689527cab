//! Choosing vertices of a body by where they are at rest, or by what its mesh file calls them.

use super::SceneError;
use super::region::RegionLabel;
use super::tables::PatchTable;
use crate::mesh::TetMesh;
use crate::mesh::io::MeshNames;
use crate::scalar::Vec3;
use crate::settings::{Place, suggest};
use crate::units::shorten;
use std::fmt;

/// Which vertices are meant. Coordinates are of the world, at rest [m].
///
/// Recordings number the kinds: a new one comes last.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Selector {
    /// In an axis-aligned box.
    Box {
        /// The corner with the smallest coordinates [m].
        min: Vec3<f64>,
        /// The corner with the largest coordinates [m].
        max: Vec3<f64>,
    },
    /// In a ball.
    Sphere {
        /// Its centre [m].
        center: Vec3<f64>,
        /// Its radius [m].
        radius: f64,
    },
    /// On the side of a plane that its normal points to.
    HalfSpace {
        /// A point on the plane [m].
        point: Vec3<f64>,
        /// Of length 1.
        normal: Vec3<f64>,
    },
    /// The nearest to a point.
    Nearest {
        /// The point [m].
        point: Vec3<f64>,
        /// How many.
        count: u32,
    },
    /// Of tetrahedra with a label.
    Region(u32),
    /// Of tetrahedra whose label has this name in the mesh file.
    NamedRegion(String),
    /// That the mesh file has this name for: a physical group, a node set.
    Patch(String),
}

/// Why a selector finds nothing. Lengths in metres, printed in millimetres.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SelectError {
    /// The body has no vertices at all.
    #[error("the body has no vertices")]
    NoVertices,
    /// No vertex is inside.
    #[error(
        "the body reaches from {} to {}, and its nearest vertex {} is {} mm away; move or enlarge \
         the {selector}",
        Millimetres(*.min), Millimetres(*.max), Millimetres(*.nearest), millimetres(*.distance)
    )]
    Empty {
        /// The kind of selector.
        selector: &'static str,
        /// Smallest coordinates of the body [m].
        min: Vec3<f64>,
        /// Largest coordinates of the body [m].
        max: Vec3<f64>,
        /// The vertex nearest to the selector [m].
        nearest: Vec3<f64>,
        /// Its distance from the selector [m].
        distance: f64,
    },
    /// More vertices are wanted than there are.
    #[error("it wants the nearest {count} vertices; the body has {vertex_count}")]
    TooMany {
        /// How many are wanted.
        count: u32,
        /// How many there are.
        vertex_count: usize,
    },
    /// No tetrahedron carries the label.
    #[error("no tetrahedron has the label {label}; the body's labels are {known}")]
    NoRegion {
        /// The label, or the name.
        label: RegionLabel,
        /// The labels there are, with their names.
        known: String,
    },
    /// The mesh has no patch of this name.
    #[error("the body's mesh has no patch `{patch}`; its patches are {known}{hint}")]
    NoPatch {
        /// The name.
        patch: String,
        /// The names there are.
        known: String,
        /// The nearest of them, as a question.
        hint: String,
    },
    /// The mesh has no names of patches at all.
    #[error(
        "the body's mesh has no named patches: they come from physical groups of Gmsh files, node sets of Abaqus files, whole \
         numbers at points of VTK files, references of Medit and markers of TetGen files; choose vertices by box, sphere, \
         half_space, nearest or region"
    )]
    NoPatches,
}

/// A point for a message: "(12, -3.5, 100) mm".
struct Millimetres(Vec3<f64>);

impl fmt::Display for Millimetres {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.0.to_array().map(millimetres);
        write!(formatter, "({x}, {y}, {z}) mm")
    }
}

fn millimetres(metres: f64) -> String {
    // Rounded to micrometres; + 0.0 turns -0 into 0.
    crate::units::format_number((metres * 1e6).round() / 1e3 + 0.0)
}

impl Selector {
    /// The chosen vertices in ascending order, at least one.
    ///
    /// `mesh` is at rest, `names` are those of its vertices and labels. A vertex on the boundary counts as inside, to within
    /// 1e-9 of the body's size, so that rounding does not decide.
    pub fn select(&self, mesh: &TetMesh, names: &MeshNames) -> Result<Vec<u32>, SelectError> {
        let rest_positions = mesh.vertices();
        let Some((min, max)) = bounds(rest_positions) else { return Err(SelectError::NoVertices) };
        match self {
            Self::Nearest { point, count } => nearest(rest_positions, *point, *count),
            Self::Region(label) => in_region(mesh, names, RegionLabel::Number(*label)),
            Self::NamedRegion(name) => in_region(mesh, names, RegionLabel::Name(name.clone())),
            Self::Patch(name) => in_patch(mesh.vertices().len(), names, name),
            _ => {
                let slack = 1e-9 * (max - min).length();
                let inside = |(_, position): &(u32, &Vec3<f64>)| self.distance(**position) <= slack;
                let selected: Vec<u32> =
                    (0..).zip(rest_positions).filter(inside).map(|(vertex, _)| vertex).collect();
                if selected.is_empty() {
                    return Err(self.nothing(rest_positions, min, max));
                }
                Ok(selected)
            }
        }
    }

    /// Distance [m] of a point from the selector; 0 inside.
    fn distance(&self, position: Vec3<f64>) -> f64 {
        match *self {
            Self::Box { min, max } => position_outside(position, min, max).length(),
            Self::Sphere { center, radius } => ((position - center).length() - radius).max(0.0),
            Self::HalfSpace { point, normal } => normal.dot(point - position).max(0.0),
            Self::Nearest { point, .. } => (position - point).length(),
            Self::Region(_) | Self::NamedRegion(_) | Self::Patch(_) => 0.0,
        }
    }

    fn nothing(&self, positions: &[Vec3<f64>], min: Vec3<f64>, max: Vec3<f64>) -> SelectError {
        let by_distance =
            |a: &&Vec3<f64>, b: &&Vec3<f64>| self.distance(**a).total_cmp(&self.distance(**b));
        let selector = match self {
            Self::Box { .. } => "box",
            Self::Sphere { .. } => "sphere",
            Self::HalfSpace { .. } => "half-space",
            _ => "selector",
        };
        match positions.iter().min_by(by_distance) {
            Some(&nearest) => {
                let distance = self.distance(nearest);
                SelectError::Empty { selector, min, max, nearest, distance }
            }
            None => SelectError::NoVertices,
        }
    }
}

/// By how much a point lies outside a box along each axis [m].
fn position_outside(position: Vec3<f64>, min: Vec3<f64>, max: Vec3<f64>) -> Vec3<f64> {
    (min - position).max(position - max).max(Vec3::ZERO)
}

/// Smallest and largest coordinates [m]; `None` without positions.
fn bounds(positions: &[Vec3<f64>]) -> Option<(Vec3<f64>, Vec3<f64>)> {
    let first = *positions.first()?;
    Some(positions.iter().fold((first, first), |(min, max), &p| (min.min(p), max.max(p))))
}

fn nearest(positions: &[Vec3<f64>], point: Vec3<f64>, count: u32) -> Result<Vec<u32>, SelectError> {
    let vertex_count = positions.len();
    if count as usize > vertex_count {
        return Err(SelectError::TooMany { count, vertex_count });
    }
    let mut vertices: Vec<(f64, u32)> = (0..)
        .zip(positions)
        .map(|(vertex, position)| ((*position - point).length_squared(), vertex))
        .collect();
    // Equal distances are common on lattices: the vertex number decides.
    vertices.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut selected: Vec<u32> =
        vertices.into_iter().take(count as usize).map(|(_, vertex)| vertex).collect();
    selected.sort_unstable();
    Ok(selected)
}

fn in_region(
    mesh: &TetMesh,
    names: &MeshNames,
    label: RegionLabel,
) -> Result<Vec<u32>, SelectError> {
    let wanted = label.numbers(names);
    let labelled = mesh.tets().iter().zip(mesh.regions());
    let labelled = labelled.filter(|(_, region)| wanted.contains(region));
    let mut selected: Vec<u32> = labelled.flat_map(|(tet, _)| *tet).collect();
    selected.sort_unstable();
    selected.dedup();
    if selected.is_empty() {
        return Err(SelectError::NoRegion { label, known: names.list_regions(mesh.regions()) });
    }
    Ok(selected)
}

fn in_patch(vertex_count: usize, names: &MeshNames, name: &str) -> Result<Vec<u32>, SelectError> {
    if names.patches.is_empty() {
        return Err(SelectError::NoPatches);
    }
    let found = names.patches.iter().find(|patch| patch.name == name);
    let mut selected = found.map_or_else(Vec::new, |patch| patch.vertices.clone());
    selected.retain(|vertex| (*vertex as usize) < vertex_count);
    if selected.is_empty() {
        const SHOWN: usize = 20;
        let all: Vec<&str> = names.patches.iter().map(|patch| patch.name.as_str()).collect();
        let quoted = all.iter().take(SHOWN).map(|name| format!("`{name}`"));
        let mut known = quoted.collect::<Vec<_>>().join(", ");
        if all.len() > SHOWN {
            known.push_str(", ...");
        }
        let near = suggest(name, &all);
        let hint = if near.ends_with('?') { format!("; {near}") } else { String::new() };
        return Err(SelectError::NoPatch { patch: shorten(name), known, hint });
    }
    Ok(selected)
}

/// A selector on a body, and where the scene says so.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// Position of the body in [`super::Scene::bodies`].
    pub body: usize,
    /// Which of its vertices.
    pub selector: Selector,
    /// What the patch is for, in messages: "fixing `ligament`".
    pub purpose: String,
    /// Where the scene asks for it.
    pub place: Place,
}

impl Patch {
    /// As [`Selector::select`]; an error says where the scene asks for the patch.
    pub fn select(&self, mesh: &TetMesh, names: &MeshNames) -> Result<Vec<u32>, SceneError> {
        self.selector.select(mesh, names).map_err(|error| SceneError::Selection {
            place: self.place.clone(),
            purpose: self.purpose.clone(),
            error: Box::new(error),
        })
    }

    /// What is probably not meant: the vertices nearest to a point that is further from the body than that is large.
    pub fn doubt(&self, mesh: &TetMesh) -> Option<String> {
        let Selector::Nearest { point, .. } = self.selector else { return None };
        let (min, max) = bounds(mesh.vertices())?;
        let (away, size) = (position_outside(point, min, max).length(), (max - min).length());
        let (purpose, place) = (&self.purpose, &self.place);
        (away > size).then(|| {
            format!(
                "{place}: {purpose} takes the vertices nearest to a point that is {} mm from its body, which is {} mm large; check its unit",
                millimetres(away),
                millimetres(size)
            )
        })
    }
}

impl PatchTable {
    /// The one selector, or how many there are instead.
    pub(super) fn selector(&self) -> Result<Selector, usize> {
        let selectors = [
            self.r#box.as_ref().map(|table| Selector::Box { min: table.min, max: table.max }),
            self.sphere
                .as_ref()
                .map(|table| Selector::Sphere { center: table.center, radius: table.radius }),
            self.half_space
                .as_ref()
                .map(|table| Selector::HalfSpace { point: table.point, normal: table.normal }),
            self.nearest
                .as_ref()
                .map(|table| Selector::Nearest { point: table.point, count: table.count }),
            self.region.clone().map(|region| match region {
                RegionLabel::Number(label) => Selector::Region(label),
                RegionLabel::Name(name) => Selector::NamedRegion(name),
            }),
            self.patch.clone().map(Selector::Patch),
        ];
        let mut written = selectors.into_iter().flatten();
        match (written.next(), written.count()) {
            (Some(selector), 0) => Ok(selector),
            (Some(_), more) => Err(more + 1),
            (None, _) => Err(0),
        }
    }
}

/// The pair of vertices, one from each patch, nearest to each other: where a spring attaches.
/// Positions [m]. Equal distances are decided by order; `None` where no two positions are apart.
pub fn nearest_pair(from: &[Vec3<f64>], to: &[Vec3<f64>]) -> Option<(usize, usize)> {
    let mut best = None;
    let mut smallest = f64::INFINITY;
    for (i, a) in from.iter().enumerate() {
        for (j, b) in to.iter().enumerate() {
            let squared = (*b - *a).length_squared();
            // A spring from a vertex to itself has no direction.
            if squared > 0.0 && squared < smallest {
                (best, smallest) = (Some((i, j)), squared);
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::io;
    use crate::scalar::vec3;

    /// Corners of a cube of 100 mm in two tetrahedra's worth of labels.
    fn cube() -> TetMesh {
        let corner = |i: u32| [i & 1, (i >> 1) & 1, i >> 2].map(|bit| 0.1 * f64::from(bit));
        let positions = (0..8).map(|i| Vec3::from_f64(corner(i))).collect();
        TetMesh::new(positions, vec![[0, 1, 2, 4], [7, 6, 5, 3]], vec![5, 9]).expect("a mesh").0
    }

    fn names() -> MeshNames {
        let patch = |name: &str, vertices| io::Patch { name: name.into(), vertices };
        let patches = vec![patch("wall", vec![0, 2, 4]), patch("left wall", vec![1])];
        MeshNames { patches, regions: vec![(9, "tumour".into())] }
    }

    #[test]
    fn selectors_take_what_they_enclose() {
        let far = vec3(0.1, 0.1, 0.1);
        for (selector, expected) in [
            (
                Selector::Box { min: vec3(-1.0, -1.0, 0.1 + 1e-12), max: vec3(1.0, 1.0, 1.0) },
                vec![4, 5, 6, 7],
            ),
            (Selector::Sphere { center: far, radius: 0.1 }, vec![3, 5, 6, 7]),
            (
                Selector::HalfSpace { point: vec3(0.05, 0.0, 0.0), normal: vec3(-1.0, 0.0, 0.0) },
                vec![0, 2, 4, 6],
            ),
            (Selector::Nearest { point: far, count: 1 }, vec![7]),
            (Selector::Nearest { point: far, count: 3 }, vec![3, 5, 7]),
            (Selector::Region(9), vec![3, 5, 6, 7]),
            (Selector::NamedRegion("tumour".into()), vec![3, 5, 6, 7]),
            (Selector::Patch("wall".into()), vec![0, 2, 4]),
            (Selector::Patch("left wall".into()), vec![1]),
        ] {
            assert_eq!(selector.select(&cube(), &names()), Ok(expected), "{selector:?}");
        }
    }

    #[test]
    fn a_selector_that_finds_nothing_says_where_the_body_is() {
        let without = MeshNames::default();
        let message =
            |selector: Selector| selector.select(&cube(), &without).unwrap_err().to_string();
        assert_eq!(
            message(Selector::Sphere { center: vec3(0.1, 0.1, 0.13), radius: 0.01 }),
            "the body reaches from (0, 0, 0) mm to (100, 100, 100) mm, and its nearest vertex \
             (100, 100, 100) mm is 20 mm away; move or enlarge the sphere"
        );
        assert_eq!(
            message(Selector::Region(3)),
            "no tetrahedron has the label 3; the body's labels are 5, 9"
        );
        assert_eq!(
            message(Selector::Nearest { point: Vec3::ZERO, count: 9 }),
            "it wants the nearest 9 vertices; the body has 8"
        );
        let nothing = Selector::Region(5).select(&TetMesh::default(), &without);
        assert_eq!(nothing, Err(SelectError::NoVertices));
    }

    #[test]
    fn points_far_from_a_body_are_doubted() {
        let nearest = |x: f64| Patch {
            body: 0,
            selector: Selector::Nearest { point: vec3(x, 0.05, 0.05), count: 1 },
            purpose: "fixing `wall`".into(),
            place: Place::Override { key: "fixing.wall.nearest.point".into() },
        };
        // The cube's diagonal is 173 mm.
        assert_eq!(nearest(0.25).doubt(&cube()), None);
        let doubt = nearest(9.1).doubt(&cube()).expect("a doubt");
        assert!(doubt.contains("fixing `wall`") && doubt.contains("9000 mm"), "{doubt}");
        assert!(doubt.contains("173.205 mm large"), "{doubt}");
        let sphere = Selector::Sphere { center: vec3(9.0, 0.0, 0.0), radius: 9.0 };
        assert_eq!(Patch { selector: sphere, ..nearest(0.0) }.doubt(&cube()), None);
    }

    #[test]
    fn a_name_that_a_mesh_does_not_have_is_told_with_those_it_has() {
        let message =
            |selector: Selector| selector.select(&cube(), &names()).unwrap_err().to_string();
        assert_eq!(
            message(Selector::Patch("wal".into())),
            "the body's mesh has no patch `wal`; its patches are `wall`, `left wall`; did you mean `wall`?"
        );
        assert_eq!(
            message(Selector::Patch("ligament".into())),
            "the body's mesh has no patch `ligament`; its patches are `wall`, `left wall`"
        );
        assert_eq!(
            message(Selector::NamedRegion("tumor".into())),
            "no tetrahedron has the label `tumor`; the body's labels are 5, 9 `tumour`"
        );
        let none = Selector::Patch("wall".into()).select(&cube(), &MeshNames::default());
        let none = none.unwrap_err().to_string();
        assert!(none.contains("no named patches") && none.contains("Gmsh"), "{none}");
    }

    #[test]
    fn a_spring_joins_the_nearest_vertices_but_never_one_to_itself() {
        let a = [vec3(0.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0)];
        let b = [vec3(1.0, 0.0, 0.0), vec3(1.5, 0.0, 0.0)];
        assert_eq!(nearest_pair(&a, &b), Some((1, 1)));
        assert_eq!(nearest_pair(&a, &[]), None);
    }
}
