//! Tetrahedra in pieces, without colours: what adds up forces, and solves no constraints.
//!
//! A piece is a row of blocks of one law and one connected part, in the order of their lowest vertices. A thread does
//! all of it, tetrahedron by tetrahedron, so that tetrahedra of a piece may share vertices. Where two pieces meet, each
//! has a copy of the vertex to add to. So the order of additions is that of the tetrahedra, whatever the number of
//! threads.

use crate::coloring::{Coloring, ConstraintGraph};
use crate::elements::law::ALL_LAWS;
use crate::model::{Model, Numbering};
use crate::scalar::Real;
use crate::scalar::lanes::LANES;
use crate::sorting;

/// Blocks of a piece: large enough that few vertices have copies. Part of the result's bits.
pub(crate) const PIECE_BLOCKS: usize = 512;

/// One colour, and a copy of each vertex for each piece that touches it. Elements that are no tetrahedra add to the
/// first copies of their vertices.
pub(super) fn in_pieces<S: Real>(
    model: &Model<S>,
    graph: &ConstraintGraph,
    numbering: &Numbering,
) -> Coloring {
    let corner_count: usize =
        (0..graph.constraint_count()).map(|c| graph.corner_range(c).len()).sum();
    let mut local_copy = vec![0; corner_count];
    let mut copies = vec![0u32; model.vertex_count()];
    let mut last_piece = vec![u32::MAX; model.vertex_count()];
    let mut piece = 0;
    for law in ALL_LAWS {
        let of_law = |&tet: &u32| model.laws[model.tet_materials[tet as usize] as usize] == law;
        let lowest = |tet: u32| {
            let vertices = model.tet_vertices[tet as usize].map(|v| numbering.of(v) as u64);
            [vertices.into_iter().fold(u64::MAX, u64::min), 0]
        };
        let tets = sorting::by_key((0..model.tet_count() as u32).filter(of_law), lowest);
        let part = |tet: u32| model.part_of(model.tet_vertices[tet as usize][0]);
        for of_part in tets.chunk_by(|&a, &b| part(a) == part(b)) {
            for chosen in of_part.chunks(LANES * PIECE_BLOCKS) {
                for tet in chosen.iter().map(|&tet| tet as usize) {
                    let corners = graph.corner_range(tet);
                    for (corner, &v) in corners.zip(graph.vertices(tet)) {
                        let v = v as usize;
                        if last_piece[v] != piece {
                            last_piece[v] = piece;
                            copies[v] += 1;
                        }
                        local_copy[corner] = copies[v] - 1;
                    }
                }
                piece += 1;
            }
        }
    }
    let mut copy_offsets = Vec::with_capacity(copies.len() + 1);
    let mut next = 0;
    copy_offsets.push(next);
    for &count in &copies {
        next += count.max(1);
        copy_offsets.push(next);
    }
    let mut copy_of = local_copy;
    for constraint in 0..graph.constraint_count() {
        let corners = graph.corner_range(constraint);
        for (corner, &v) in corners.zip(graph.vertices(constraint)) {
            copy_of[corner] += copy_offsets[v as usize];
        }
    }
    let mut valence = vec![0u32; copies.len()];
    for constraint in 0..graph.constraint_count() {
        graph.vertices(constraint).iter().for_each(|&v| valence[v as usize] += 1);
    }
    Coloring {
        color_count: 1,
        color_of: vec![0; graph.constraint_count()],
        copy_of,
        copy_offsets,
        largest_clique: valence.into_iter().max().unwrap_or(0),
    }
}
