//! Repairs of meshes that cannot be simulated, or badly.
//!
//! Vertices in one place become one; tetrahedra that are no such thing, that repeat others, or that are the third on a face are
//! left out. Those that remain are wound alike, as their common faces say, so that what is inside out shows as a negative volume.
//! Then vertices inside move to where the worst tetrahedron around them is best (`smooth`), which turns most of what is inside
//! out or flat into tissue. Slivers on the boundary are taken off (`peel`), and what is flat still is left out. The boundary, and
//! that between regions, stays where it is.

mod peel;
mod smooth;
mod surface;
mod weld;
mod wind;

use super::corners::{shape_quality, sorted_face_sides};
use super::topology::BoundingBox;
use super::{MIN_SHAPE_QUALITY, MeshError, TetMesh, check_counts, check_vertex, tet_volume};
use crate::scalar::Vec3;
pub use surface::{SurfaceMending, mend_surface};

/// What a mesh was before it was mended. Tetrahedra and vertices by their numbers of old are in no report: what is left out is gone.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Mending {
    /// Vertices that lay in the place of others.
    pub merged_vertices: usize,
    /// Tetrahedra left out that name a vertex twice or one that there is not, or one without a place.
    pub broken_tets: usize,
    /// Tetrahedra left out whose vertices are those of others.
    pub repeated_tets: usize,
    /// Tetrahedra left out that were the third or a later one on a face.
    pub crowded_tets: usize,
    /// Tetrahedra that were wound otherwise than their neighbours, or with them inwards.
    pub rewound_tets: usize,
    /// Tetrahedra that were inside out or flat, and are not any more.
    pub unfolded_tets: usize,
    /// Tetrahedra left out that were so still.
    pub flat_tets: usize,
    /// Slivers that were taken off the boundary.
    pub peeled_tets: usize,
    /// Vertices left out because no tetrahedron uses them.
    pub unused_vertices: usize,
    /// Vertices that were moved.
    pub moved_vertices: usize,
    /// How far at most, as a share of the diagonal of the box around the mesh.
    pub moved: f64,
}

impl Mending {
    /// What was done, a line each.
    pub fn texts(&self) -> Vec<String> {
        let counted = [
            (self.merged_vertices, "vertices in the place of others made one with them"),
            (self.broken_tets, "tetrahedra left out that name a vertex twice, or none"),
            (self.repeated_tets, "tetrahedra left out that repeat others"),
            (self.crowded_tets, "tetrahedra left out that were the third on a face"),
            (self.rewound_tets, "tetrahedra rewound"),
            (self.unfolded_tets, "tetrahedra that were inside out or flat given a volume"),
            (self.peeled_tets, "slivers taken off the boundary"),
            (self.flat_tets, "tetrahedra left out that stayed inside out or flat"),
            (self.unused_vertices, "vertices left out that no tetrahedron uses"),
        ];
        let some = counted.into_iter().filter(|(count, _)| *count > 0);
        let mut texts: Vec<String> = some.map(|(count, what)| format!("{count} {what}")).collect();
        if self.moved_vertices > 0 {
            let (count, far) = (self.moved_vertices, 100.0 * self.moved);
            texts.push(format!("{count} vertices inside moved, by up to {far:.2} % of its size"));
        }
        texts
    }
}

/// A mended mesh.
#[derive(Clone, Debug)]
pub struct Mended {
    /// The mesh.
    pub mesh: TetMesh,
    /// What was done.
    pub mending: Mending,
    /// The vertex that each given one became, shape \[given vertex_count\]; none of those that are left out.
    pub vertices: Vec<Option<u32>>,
}

/// Mends tetrahedra, see the head of this module. `vertices` [m], shape `[vertex_count]`; `tets` and `regions`, shape `[tet_count]`;
/// vertices no farther apart than `weld` [m] become one. Fails where nothing is left, and where there is too much of it.
pub fn mend(
    vertices: &[Vec3<f64>],
    tets: &[[u32; 4]],
    regions: &[u32],
    weld: Option<f64>,
) -> Result<Mended, MeshError> {
    check_counts(vertices, tets, regions)?;
    let has_place: Vec<bool> = vertices.iter().map(|&x| check_vertex(0, x).is_ok()).collect();
    let first = weld::first_in_place(
        vertices,
        &has_place,
        weld.unwrap_or_else(|| weld::reach(vertices, &has_place)),
    );
    let merged_vertices = (0..vertices.len()).filter(|&v| first[v] as usize != v).count();
    let mut mending = Mending { merged_vertices, ..Mending::default() };
    let is_whole = |tet: &[u32; 4]| {
        let all = tet.iter().all(|&v| has_place.get(v as usize) == Some(&true));
        all && (1..4).all(|i| !tet[..i].contains(&tet[i]))
    };
    let mut kept: Vec<([u32; 4], u32)> = Vec::with_capacity(tets.len());
    for (tet, &region) in tets.iter().zip(regions) {
        let tet = tet.map(|v| first.get(v as usize).copied().unwrap_or(v));
        match is_whole(&tet) {
            true => kept.push((tet, region)),
            false => mending.broken_tets += 1,
        }
    }
    mending.repeated_tets = leave_out_repeated(&mut kept);
    mending.crowded_tets = leave_out_crowded(&mut kept, vertices);
    let (mut tets, mut regions): (Vec<[u32; 4]>, Vec<u32>) = kept.into_iter().unzip();
    mending.rewound_tets = wind_alike(&mut tets, vertices);
    let mut places = vertices.to_vec();
    let quality =
        |tet: &[u32; 4], places: &[Vec3<f64>]| shape_quality(tet.map(|v| places[v as usize]));
    let is_flat = |tet: &[u32; 4], places: &[Vec3<f64>]| quality(tet, places) < MIN_SHAPE_QUALITY;
    let flat = tets.iter().filter(|tet| is_flat(tet, &places)).count();
    smooth::smooth(&mut places, &tets, &regions);
    let moved = places.iter().zip(vertices).map(|(now, then)| (*now - *then).length());
    let moved = moved.filter(|far| *far > 0.0);
    let (count, far) = moved.fold((0, 0.0), |(count, most), far| (count + 1, far.max(most)));
    let still = tets.iter().filter(|tet| is_flat(tet, &places)).count();
    mending.unfolded_tets = flat.saturating_sub(still);
    let stays = peel::peel(&places, &tets);
    keep(&mut regions, &stays);
    mending.peeled_tets = keep(&mut tets, &stays);
    let whole: Vec<bool> = tets.iter().map(|tet| !is_flat(tet, &places)).collect();
    keep(&mut regions, &whole);
    mending.flat_tets = keep(&mut tets, &whole);
    let lost = places.iter_mut().zip(&has_place).filter(|(_, has_place)| !**has_place);
    lost.for_each(|(place, _)| *place = Vec3::ZERO);
    let (mesh, repairs) = TetMesh::new(places, tets, regions)?;
    let size = BoundingBox::around(mesh.vertices()).size().length();
    (mending.moved_vertices, mending.moved) = (count, far / size);
    let after = |v: &u32| repairs.vertex_after(*v);
    mending.unused_vertices = repairs.removed_vertices.len() - mending.merged_vertices;
    Ok(Mended { mesh, mending, vertices: first.iter().map(after).collect() })
}

/// Leaves out what does not stay; how many.
fn keep<T>(list: &mut Vec<T>, stays: &[bool]) -> usize {
    let before = list.len();
    let mut stay = stays.iter();
    list.retain(|_| stay.next() == Some(&true));
    before - list.len()
}

/// Of tetrahedra with the same vertices the first stays.
fn leave_out_repeated(tets: &mut Vec<([u32; 4], u32)>) -> usize {
    let mut known = std::collections::HashSet::with_capacity(tets.len());
    let before = tets.len();
    tets.retain(|(tet, _)| {
        let mut key = *tet;
        key.sort_unstable();
        known.insert(key)
    });
    before - tets.len()
}

/// On a face with more than two tetrahedra the two of the best shape stay.
fn leave_out_crowded(tets: &mut Vec<([u32; 4], u32)>, vertices: &[Vec3<f64>]) -> usize {
    let only: Vec<[u32; 4]> = tets.iter().map(|(tet, _)| *tet).collect();
    let quality = |tet: u32| shape_quality(only[tet as usize].map(|v| vertices[v as usize])).abs();
    let mut stays = vec![true; tets.len()];
    for sides in sorted_face_sides(&only).chunk_by(|a, b| a.key == b.key) {
        let mut present: Vec<u32> =
            sides.iter().map(|side| side.tet).filter(|&tet| stays[tet as usize]).collect();
        present.sort_by(|&a, &b| quality(b).total_cmp(&quality(a)));
        present.iter().skip(2).for_each(|&tet| stays[tet as usize] = false);
    }
    keep(tets, &stays)
}

/// Winds tetrahedra as their common faces say, each connected part so that its volume is above zero. Returns how many it
/// rewound.
fn wind_alike(tets: &mut [[u32; 4]], vertices: &[Vec3<f64>]) -> usize {
    let mut neighbors = Vec::new();
    for pair in sorted_face_sides(tets).chunk_by(|a, b| a.key == b.key) {
        if let [a, b] = pair {
            neighbors.push(([a.tet, b.tet], a.even != b.even));
        }
    }
    let mut count = 0;
    for part in wind::parts(tets.len(), &neighbors) {
        let signed = |&(tet, is_turned): &(u32, bool)| {
            let volume = tet_volume(tets[tet as usize].map(|v| vertices[v as usize]));
            if is_turned { -volume } else { volume }
        };
        let is_inwards = part.iter().map(signed).sum::<f64>() < 0.0;
        for (tet, _) in part.into_iter().filter(|(_, is_turned)| *is_turned != is_inwards) {
            tets[tet as usize].swap(2, 3);
            count += 1;
        }
    }
    count
}
