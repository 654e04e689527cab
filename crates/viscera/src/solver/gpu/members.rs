//! Which elements and vertices are summed together, and where elements that are no tetrahedra lie.

use super::parts::Piece;
use super::slots::Element;
use crate::elements::kinds::{Kind, MOST};
use crate::layout::{ElementSet, Layout};
use crate::model::for_each_kind;
use crate::scalar::lanes::LANES;
use crate::sorting;

/// Elements or vertices whose energies one workgroup sums.
const PIECE: usize = 512;

/// Elements that are no tetrahedra, sorted by colour, within a colour by kind; places of loads are not yet known.
pub(super) fn elements(layout: &Layout<f32>) -> Vec<Element> {
    let mut all: Vec<(usize, Element)> = Vec::new();
    for_each_kind!(layout, set => {
        for color in 0..layout.color_count {
            all.extend(set.color(color).map(|i| (color, element(set, i, layout))));
        }
    });
    let order = sorting::by_key(0..all.len() as u32, |i| [all[i as usize].0 as u64, 0]);
    order.into_iter().map(|i| all[i as usize].1).collect()
}

fn element<K: Kind<N, M>, const N: usize, const M: usize>(
    set: &ElementSet<f32, K, N, M>,
    i: usize,
    layout: &Layout<f32>,
) -> Element {
    let corner = |corner: usize| if corner < N { corner } else { 0 };
    let vertices = set.vertices[i].map(|v| layout.numbering.of(v) as u32);
    Element {
        kind: set.number as u32,
        part: layout.part_at(vertices[0] as usize) as u32,
        multiplier: set.multipliers(i).start as u32,
        anchor: set.anchors.get(i).copied().unwrap_or(0),
        vertices: std::array::from_fn(|c| vertices[corner(c)]),
        copies: std::array::from_fn(|c| set.copies[i][corner(c)]),
        slots: [0; MOST],
        constants: set.constants[i],
    }
}

/// Places of elements, kind by kind and in each in the order of its set.
pub(super) fn kind_by_kind(elements: &[Element]) -> Vec<usize> {
    let kind = |i: u32| [u64::from(elements[i as usize].kind), 0];
    sorting::by_key(0..elements.len() as u32, kind).into_iter().map(|i| i as usize).collect()
}

/// The first of the elements of a colour, or of all, and how many there are.
pub fn element_range(layout: &Layout<f32>, color: Option<usize>) -> [u32; 2] {
    let [mut first, mut count] = [0; 2];
    for_each_kind!(layout, set => {
        let range = color.map_or(0..set.len(), |color| set.color(color));
        first += range.start as u32;
        count += range.len() as u32;
    });
    [first, count]
}

/// The part of each block.
pub(super) fn block_parts(layout: &Layout<f32>) -> Vec<u32> {
    let of_block = |vertices: &[[u32; LANES]; 4]| layout.part_at(vertices[0][0] as usize) as u32;
    let sets = layout.tet_sets.iter();
    sets.flat_map(|set| set.blocks.iter().map(|b| of_block(&b.vertices))).collect()
}

/// Elements of each part in pieces, behind them samples of the surface and what meets other tissue where there `are` any; then
/// vertices.
pub(super) fn pieces(
    layout: &Layout<f32>,
    others: &[Element],
    by_kind: &[usize],
    are: [bool; 2],
) -> (Vec<u32>, Vec<Piece>) {
    let mut elements = Vec::new();
    let mut first = 0;
    for set in &layout.tet_sets {
        for (block, lane) in set.places() {
            let part = layout.part_at(set.blocks[block].vertices[0][lane] as usize) as u32;
            elements.push((part, (LANES * (first + block) + lane) as u32));
        }
        first += set.block_count();
    }
    // Elements that are no tetrahedra are numbered behind the lanes of all blocks, padding included, so that a kernel
    // finds block and lane of a tetrahedron by division.
    let first = (LANES * first) as u32;
    elements.extend(by_kind.iter().map(|&i| (others[i].part, first + i as u32)));
    // Behind all of them samples of the surface.
    let samples = layout.samples.iter().filter(|_| are[0]).map(|sample| sample.part);
    let skin = layout.skin.as_ref().filter(|_| are[1]);
    let meetings = skin.into_iter().flat_map(|skin| {
        let part = |place: usize| skin.samples[place].part;
        let tied = skin.ties.iter().map(|(place, _)| *place as usize);
        (0..skin.samples.len()).chain(tied).map(part)
    });
    let first = first + others.len() as u32;
    elements.extend(samples.chain(meetings).zip(first..));
    // A part's elements keep the order of a model of their own.
    let part = |i: u32| elements[i as usize].0;
    let order = sorting::by_key(0..elements.len() as u32, |i| [u64::from(part(i)), 0]);

    let (mut members, mut pieces) = (Vec::new(), Vec::new());
    // A piece never reaches across parts: the sums of one must not depend on the size of the part before it.
    for of_part in order.chunk_by(|&a, &b| part(a) == part(b)) {
        for piece in of_part.chunks(PIECE) {
            let first = members.len() as u32;
            members.extend(piece.iter().map(|&i| elements[i as usize].1));
            let end = members.len() as u32;
            pieces.push(Piece { part: part(of_part[0]), first, end, are_vertices: 0 });
        }
    }
    // Vertices behind all elements: `limit_velocities` is dispatched for their pieces alone, which must be a range.
    for (part, own) in (0..).zip(layout.parts.iter()) {
        for first in own.vertices.clone().step_by(PIECE) {
            let end = own.vertices.end.min(first + PIECE) as u32;
            pieces.push(Piece { part, first: first as u32, end, are_vertices: 1 });
        }
    }
    (members, pieces)
}
