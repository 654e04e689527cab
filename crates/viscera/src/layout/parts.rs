//! Connected parts of a model: what elements connect.
//!
//! Nothing that happens in one part may change another's bits: each has the layout that it would have in a
//! model of its own. So a part has a range of the solver's vertices, numbered by its own extent; within a
//! colour its blocks of tetrahedra, springs and attachments stand in a row, and no block holds tetrahedra of
//! two parts; colours are balanced part by part.

use std::ops::Range;

use super::tets::TetSet;
use crate::elements::law::LAWS;
use crate::elements::list::{ARE_ANCHORED, KIND_SIZES, KINDS};
use crate::scalar::Real;

/// One connected part.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Part {
    /// In the solver's numbering.
    pub vertices: Range<usize>,
    /// Its copies.
    pub copies: Range<usize>,
    /// Its constraints, colour by colour; fewer colours than the model's where it needs fewer.
    pub colors: Vec<PartColor>,
    /// Its multipliers, in the order that they have in a model of this part alone: ranges of the model's.
    pub multipliers: Vec<Range<usize>>,
}

/// What a part has of one colour.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct PartColor {
    /// Blocks of tetrahedra of each law.
    pub blocks: [Range<u32>; LAWS],
    /// Other elements of each kind.
    pub elements: [Range<u32>; KINDS],
}

impl Part {
    /// Whether one of its vertices has more than one copy.
    pub fn is_split(&self) -> bool {
        self.copies.len() > self.vertices.len()
    }

    /// Its blocks of one set, in order; ranges that touch are one.
    pub fn blocks(&self, law: usize) -> impl Iterator<Item = Range<usize>> {
        joined(self.colors.iter().map(move |color| widened(&color.blocks[law])))
    }

    /// How many blocks of one set it has.
    pub fn block_count(&self, law: usize) -> usize {
        self.colors.iter().map(|color| color.blocks[law].len()).sum()
    }

    /// Its elements of one kind, in order.
    pub fn elements(&self, kind: usize) -> impl Iterator<Item = usize> {
        self.colors.iter().flat_map(move |color| widened(&color.elements[kind]))
    }

    /// Whether anchors hold it.
    pub fn is_anchored(&self) -> bool {
        (0..KINDS).any(|kind| ARE_ANCHORED[kind] && self.elements(kind).next().is_some())
    }

    /// How many multipliers it has, those of padding lanes included.
    pub fn multiplier_count(&self) -> usize {
        self.multipliers.iter().map(Range::len).sum()
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.colors[..]) + size_of_val(&self.multipliers[..])
    }

    /// What it has of a colour, which is made if it is not there.
    fn color(&mut self, color: usize) -> &mut PartColor {
        if self.colors.len() <= color {
            self.colors.resize(color + 1, PartColor::default());
        }
        &mut self.colors[color]
    }
}

/// What the parts of a model are found from; vertices in the solver's numbering.
pub(super) struct Laid<'a, S> {
    /// The part of each vertex, parts in a row.
    pub part_of: &'a [u32],
    pub copy_offsets: &'a [u32],
    pub sets: &'a [TetSet<S>; LAWS],
    pub elements: [LaidElements<'a>; KINDS],
    pub color_count: usize,
}

/// The elements of one kind.
pub(super) struct LaidElements<'a> {
    /// The first vertex of each.
    pub vertices: Vec<u32>,
    pub color_offsets: &'a [u32],
    pub multiplier_offset: usize,
}

impl<S: Real> Laid<'_, S> {
    /// The parts, in the order of their vertices.
    pub fn parts(&self) -> Vec<Part> {
        let mut parts: Vec<Part> = Vec::new();
        let mut first = 0;
        for vertices in self.part_of.chunk_by(|a, b| a == b) {
            let vertices = first..first + vertices.len();
            first = vertices.end;
            let copies = [vertices.start, vertices.end].map(|v| self.copy_offsets[v] as usize);
            parts.push(Part { vertices, copies: copies[0]..copies[1], ..Part::default() });
        }
        let of = |vertex: u32| self.part_of[vertex as usize] as usize;
        for color in 0..self.color_count {
            for (law, set) in self.sets.iter().enumerate() {
                for block in set.color(color) {
                    let part = &mut parts[of(set.blocks[block].vertices[0][0])];
                    extend(&mut part.color(color).blocks[law], block);
                }
            }
            for (kind, set) in self.elements.iter().enumerate() {
                for i in set.color_offsets[color]..set.color_offsets[color + 1] {
                    let part = &mut parts[of(set.vertices[i as usize])];
                    extend(&mut part.color(color).elements[kind], i as usize);
                }
            }
        }
        for part in &mut parts {
            part.multipliers = self.multipliers(part);
            part.colors.shrink_to_fit();
        }
        parts
    }

    /// Ranges of the multipliers of a part.
    fn multipliers(&self, part: &Part) -> Vec<Range<usize>> {
        let mut ranges = Vec::new();
        for (law, set) in self.sets.iter().enumerate() {
            let [elastic, viscous] = set.multipliers_per_block();
            let mut add = |offset: usize, count: usize| {
                let of = |blocks: Range<usize>| {
                    offset + count * blocks.start..offset + count * blocks.end
                };
                ranges.extend(part.blocks(law).map(of));
            };
            add(set.multiplier_offset, elastic);
            if part.blocks(law).next().is_some_and(|blocks| set.is_viscous(blocks.start)) {
                add(set.viscous_offset, viscous);
            }
        }
        for (kind, (set, [_, count])) in self.elements.iter().zip(KIND_SIZES).enumerate() {
            for color in &part.colors {
                let Range { start, end } = widened(&color.elements[kind]);
                let first = set.multiplier_offset;
                ranges.push(first + count * start..first + count * end);
            }
        }
        let mut ranges: Vec<_> = joined(ranges.into_iter()).collect();
        ranges.shrink_to_fit();
        ranges
    }
}

fn widened(range: &Range<u32>) -> Range<usize> {
    range.start as usize..range.end as usize
}

/// Takes in the next number.
fn extend(range: &mut Range<u32>, next: usize) {
    let next = next as u32;
    if range.start == range.end {
        range.start = next;
    } else {
        debug_assert_eq!(range.end, next, "a colour's are not in a row");
    }
    range.end = next + 1;
}

/// Ranges without the empty ones; those that touch are one.
fn joined(ranges: impl Iterator<Item = Range<usize>>) -> impl Iterator<Item = Range<usize>> {
    let mut ranges = ranges.filter(|range| !range.is_empty()).peekable();
    std::iter::from_fn(move || {
        let mut range = ranges.next()?;
        while let Some(next) = ranges.next_if(|next| next.start == range.end) {
            range.end = next.end;
        }
        Some(range)
    })
}

#[cfg(test)]
mod tests {
    use crate::layout::Layout;
    use crate::material::{Material, MaterialModel};
    use crate::mesh::TetMesh;
    use crate::mesh::shapes::Block;
    use crate::model::ModelBuilder;
    use crate::scalar::{Vec3, vec3};
    use crate::settings::{Colors, SolverSettings};

    /// Positions by part, blocks and multipliers in their order: what a step of the part reads.
    fn laid_out(layout: &Layout<f64>, part: usize) -> (Vec<Vec3<f64>>, Vec<Vec<f64>>, usize) {
        let part = &layout.parts[part];
        let numbers = &layout.numbering.order[part.vertices.clone()];
        let places = numbers.iter().map(|&v| layout.rest_positions[v as usize]).collect();
        let mut blocks = Vec::new();
        for (law, set) in layout.tet_sets.iter().enumerate() {
            for block in part.blocks(law).flatten() {
                let constants = &set.blocks[block];
                let vertices = constants.vertices.as_flattened().iter();
                let mut numbers = vec![f64::from(set.filled[block])];
                numbers.extend(vertices.map(|&v| (v as usize - part.vertices.start) as f64));
                let copies = set.copies_of(block).as_flattened().iter();
                let first = if part.is_split() { part.copies.start } else { usize::MAX };
                numbers.extend(copies.map(|&c| (c as usize).saturating_sub(first) as f64));
                numbers.extend(constants.inverse_rest_shape.as_flattened());
                numbers.push(f64::from(u8::from(set.is_viscous(block))));
                blocks.push(numbers);
            }
        }
        (places, blocks, part.multiplier_count())
    }

    /// A neighbour far away, larger, viscous, more crowded, before or behind: the layout is that of the part
    /// alone.
    #[test]
    fn a_part_lies_as_it_does_alone() {
        let bar = Block::new(vec3(0.06, 0.03, 0.03), [4, 2, 2]).mesh().expect("a bar");
        let cube = Block::new(vec3(0.3, 0.3, 0.3), [3, 3, 3]).mesh().expect("a cube");
        let away = cube.vertices().iter().map(|x| *x + vec3(1.0, -3.0, 0.2)).collect();
        let cube = TetMesh::new(away, cube.tets().to_vec(), cube.regions().to_vec());
        let cube = cube.expect("a cube").0;
        let tissue = |model| Material::new(model, 1e4, 0.4, 1000.0).expect("legal");
        for (law, colors) in [
            (MaterialModel::SaintVenantKirchhoff, Colors::Unlimited),
            (MaterialModel::StableNeoHookean, Colors::Limited(5)),
            (MaterialModel::StableNeoHookean, Colors::Limited(1)),
        ] {
            let settings = SolverSettings { colors, ..SolverSettings::xpbd() };
            let viscous =
                tissue(MaterialModel::StableNeoHookean).with_viscosity(0.1).expect("legal");
            let bodies = [(&bar, tissue(law)), (&cube, viscous)];
            let build = |order: &[usize]| {
                let mut builder = ModelBuilder::new();
                for &body in order {
                    let (mesh, tissue) = &bodies[body];
                    let number = builder.add_body(mesh, tissue).expect("a body");
                    let first = builder.body(number).expect("a body").vertices.start as u32;
                    builder.add_spring([first, first + 7], 10.0, None).expect("a spring");
                    builder.add_attachment(first, Vec3::ZERO, 10.0).expect("an attachment");
                }
                Layout::new(&builder.build::<f64>().expect("a model"), &settings)
            };
            for order in [[0, 1], [1, 0]] {
                let both = build(&order);
                assert_eq!(both.part_count(), 2);
                for (part, body) in order.into_iter().enumerate() {
                    let alone = build(&[body]);
                    assert_eq!(laid_out(&both, part), laid_out(&alone, 0), "{colors:?} {order:?}");
                    // One part's multipliers are all there are, in one range.
                    assert_eq!(alone.parts[0].multipliers, vec![0..alone.multiplier_count]);
                }
                let counted = both.parts.iter().map(|part| part.multiplier_count()).sum::<usize>();
                assert!(counted <= both.multiplier_count);
                for (law, set) in both.tet_sets.iter().enumerate() {
                    let count: usize = both.parts.iter().map(|part| part.block_count(law)).sum();
                    assert_eq!(count, set.block_count());
                }
            }
        }
    }
}
