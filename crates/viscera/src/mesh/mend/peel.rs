//! Slivers on the boundary.
//!
//! A flat tetrahedron with two faces on the boundary is a skin on the two faces behind it: no vertex inside can give it a volume,
//! and without it the boundary is where it was, to its thickness.

use std::collections::BTreeMap;

use super::smooth::worth;
use crate::mesh::corners::TET_FACES;
use crate::mesh::verdict::POOR_ANGLE;
use crate::scalar::Vec3;

type Face = [u32; 3];

/// Which tetrahedra stay: all but slivers, taken off from the outside inwards. None is taken off where its edge behind is on the
/// boundary already: four faces would meet there.
pub fn peel(places: &[Vec3<f64>], tets: &[[u32; 4]]) -> Vec<bool> {
    let is_sliver = |tet: &[u32; 4]| {
        worth(tet.map(|v| places[v as usize]), 1.0).to_degrees() < POOR_ANGLE as f64
    };
    let mut stays = vec![true; tets.len()];
    let slivers: Vec<usize> = (0..tets.len()).filter(|&tet| is_sliver(&tets[tet])).collect();
    if slivers.is_empty() {
        return stays;
    }
    let mut uses: BTreeMap<Face, u32> = BTreeMap::new();
    tets.iter().flat_map(faces).for_each(|face| *uses.entry(face).or_default() += 1);
    // How many faces of the boundary have an edge.
    let mut edges: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    for face in uses.iter().filter(|(_, count)| **count == 1).map(|(face, _)| face) {
        ends(face).for_each(|edge| *edges.entry(edge).or_default() += 1);
    }
    loop {
        let before = stays.iter().filter(|stays| **stays).count();
        for &tet in &slivers {
            let all = faces(&tets[tet]);
            let outer = all.map(|face| uses.get(&face) == Some(&1));
            if !stays[tet] || outer.iter().filter(|outer| **outer).count() != 2 {
                continue;
            }
            // The faces behind share the edge of the two corners that the outer faces are opposite to.
            let mut behind = [0, 1, 2, 3].into_iter().filter(|&i| outer[i]).map(|i| tets[tet][i]);
            let (Some(a), Some(b)) = (behind.next(), behind.next()) else { continue };
            if edges.get(&[a.min(b), a.max(b)]).is_some_and(|count| *count > 0) {
                continue;
            }
            stays[tet] = false;
            for (face, outer) in all.iter().zip(outer) {
                uses.entry(*face).and_modify(|count| *count -= 1);
                for edge in ends(face) {
                    let count = edges.entry(edge).or_default();
                    *count = if outer { count.saturating_sub(1) } else { *count + 1 };
                }
            }
        }
        if stays.iter().filter(|stays| **stays).count() == before {
            return stays;
        }
    }
}

/// With ascending vertices; face i is opposite to corner i.
fn faces(tet: &[u32; 4]) -> [Face; 4] {
    TET_FACES.map(|face| {
        let mut key = face.map(|corner| tet[corner]);
        key.sort_unstable();
        key
    })
}

/// Edges of a face with ascending vertices.
fn ends(&[a, b, c]: &Face) -> impl Iterator<Item = [u32; 2]> {
    [[a, b], [b, c], [a, c]].into_iter()
}
