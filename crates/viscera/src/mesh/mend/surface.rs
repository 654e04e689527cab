//! Repairs of triangle surfaces.

use std::collections::{BTreeMap, HashSet};

use super::{weld, wind};
use crate::mesh::{MeshError, SurfaceMesh, check_vertex};

/// What a surface was before it was mended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct SurfaceMending {
    /// Vertices that lay in the place of others.
    pub merged_vertices: usize,
    /// Triangles left out that name a vertex twice or one that there is not, or have no area.
    pub broken_triangles: usize,
    /// Triangles left out whose vertices are those of others.
    pub repeated_triangles: usize,
    /// Triangles that were wound otherwise than their neighbours, or with all others inwards.
    pub rewound_triangles: usize,
    /// Vertices left out because no triangle uses them.
    pub unused_vertices: usize,
}

impl SurfaceMending {
    /// What was done, a line each.
    pub fn texts(&self) -> Vec<String> {
        let counted = [
            (self.merged_vertices, "vertices in the place of others made one with them"),
            (
                self.broken_triangles,
                "triangles left out that name a vertex twice, or none, or have no area",
            ),
            (self.repeated_triangles, "triangles left out that repeat others"),
            (self.rewound_triangles, "triangles rewound"),
            (self.unused_vertices, "vertices left out that no triangle uses"),
        ];
        let some = counted.into_iter().filter(|(count, _)| *count > 0);
        some.map(|(count, what)| format!("{count} {what}")).collect()
    }
}

/// Mends a surface: vertices no farther apart than `weld` [m] become one, triangles that are no such thing or repeat others are
/// left out, all are wound as most of their part are, and outwards. Holes stay; `winding::fill` closes them.
pub fn mend_surface(
    surface: &SurfaceMesh,
    weld: Option<f64>,
) -> Result<(SurfaceMesh, SurfaceMending), MeshError> {
    let vertices = &surface.vertices;
    let has_place: Vec<bool> = vertices.iter().map(|&x| check_vertex(0, x).is_ok()).collect();
    let reach = weld.unwrap_or_else(|| weld::reach(vertices, &has_place));
    let first = weld::first_in_place(vertices, &has_place, reach);
    let mut mending = SurfaceMending {
        merged_vertices: (0..vertices.len()).filter(|&v| first[v] as usize != v).count(),
        ..SurfaceMending::default()
    };
    let has_area = |&[a, b, c]: &[u32; 3]| {
        let place =
            |v: u32| has_place.get(v as usize).filter(|has| **has).map(|_| vertices[v as usize]);
        let places = (place(a), place(b), place(c));
        matches!(places, (Some(a), Some(b), Some(c)) if (b - a).cross(c - a).length_squared() > 0.0)
    };
    let mut known = HashSet::with_capacity(surface.triangles.len());
    let mut triangles: Vec<[u32; 3]> = Vec::with_capacity(surface.triangles.len());
    for triangle in &surface.triangles {
        let triangle = triangle.map(|v| first.get(v as usize).copied().unwrap_or(v));
        let mut key = triangle;
        key.sort_unstable();
        if !has_area(&triangle) {
            mending.broken_triangles += 1;
        } else if !known.insert(key) {
            mending.repeated_triangles += 1;
        } else {
            triangles.push(triangle);
        }
    }
    if triangles.is_empty() {
        return Err(MeshError::Empty);
    }
    let given = triangles.clone();
    wind_alike(&mut triangles);
    let mut all = SurfaceMesh { vertices: vertices.clone(), triangles };
    if all.enclosed_volume() < 0.0 {
        all.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    }
    let both = all.triangles.iter().zip(&given);
    mending.rewound_triangles = both.filter(|(now, then)| now != then).count();
    let before = all.vertices.len();
    let (all, _) = all.without_unused();
    mending.unused_vertices = before - all.vertices.len() - mending.merged_vertices;
    Ok((all, mending))
}

/// Winds triangles as those beside them, and each part as most of it was.
fn wind_alike(triangles: &mut [[u32; 3]]) {
    // By edge: its triangles, and whether they have it from its lower to its higher vertex.
    let mut edges: BTreeMap<[u32; 2], Vec<(u32, bool)>> = BTreeMap::new();
    for (index, &[a, b, c]) in triangles.iter().enumerate() {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            let key = [from.min(to), from.max(to)];
            edges.entry(key).or_default().push((index as u32, from < to));
        }
    }
    let mut neighbors = Vec::new();
    for uses in edges.values() {
        if let &[(a, rises), (b, also)] = &uses[..] {
            neighbors.push(([a, b], rises != also));
        }
    }
    for part in wind::parts(triangles.len(), &neighbors) {
        let turned = part.iter().filter(|(_, is_turned)| *is_turned).count();
        let most = 2 * turned > part.len();
        for (triangle, _) in part.into_iter().filter(|(_, is_turned)| *is_turned != most) {
            triangles[triangle as usize].swap(1, 2);
        }
    }
}
