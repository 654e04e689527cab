//! The model: everything that does not move. Meshes, rest shapes, materials, springs,
//! attachments, colours; flat arrays, sorted by colour, ready for any backend.
//!
//! Vertices and tetrahedra are numbered over all bodies in the order in which the bodies were
//! added; [`Body`] says which range belongs to which. Everything public is in that order, but for
//! constraints, which are sorted by colour: `order` maps back to the user's numbers. Within, vertices
//! are numbered along a curve through space, one connected part after the other; see `numbering` and
//! `parts`.

mod builder;
pub(crate) mod elements;
mod layout;
mod numbering;
mod parts;
mod tets;

use std::ops::Range;
use std::sync::Arc;

pub use builder::ModelBuilder;
pub use elements::{ElementSet, ElementSets};
pub(crate) use numbering::Numbering;
pub(crate) use parts::Part;
pub(crate) use tets::TetBlock;
pub use tets::{Tet, TetSet};

pub use crate::material::MaterialConstants;

use crate::elements::law::LAWS;
use crate::material::MaterialModel;
use crate::scalar::lanes::LANES;
use crate::scalar::{Real, Vec3};

/// Why a model cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// Nothing was added.
    #[error("the model has no body; add one with `ModelBuilder::add_body`")]
    Empty,
    /// An index names no body.
    #[error("body {body} does not exist; the model has {body_count}")]
    UnknownBody {
        /// The index given.
        body: usize,
        /// How many bodies there are.
        body_count: usize,
    },
    /// An index names no vertex.
    #[error("{what} refers to vertex {vertex}; the model has {vertex_count}")]
    UnknownVertex {
        /// The kind of element.
        what: &'static str,
        /// The index given.
        vertex: u32,
        /// How many vertices there are.
        vertex_count: usize,
    },
    /// A spring that connects nothing.
    #[error("a spring leads from vertex {vertex} to itself; give it two different ends")]
    SpringEnds {
        /// The vertex given twice.
        vertex: u32,
    },
    /// A stiffness or length that no spring has.
    #[error("{what} must be {range} and finite, not {value}")]
    BadValue {
        /// The quantity, with its unit.
        what: &'static str,
        /// The legal range in words.
        range: &'static str,
        /// The value given.
        value: f64,
    },
    /// More than 32-bit indices can number.
    #[error("{count} {what} are more than the {limit} that 32-bit indices can number")]
    TooLarge {
        /// What there is too much of.
        what: &'static str,
        /// How many.
        count: usize,
        /// How many would do.
        limit: usize,
    },
}

/// The ranges of one body in the user's numbering.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Body {
    /// Its vertices.
    pub vertices: Range<usize>,
    /// Its tetrahedra.
    pub tets: Range<usize>,
}

/// Everything that does not move.
#[derive(Clone, Debug, PartialEq)]
pub struct Model<S> {
    /// The bodies in the order in which they were added.
    pub bodies: Vec<Body>,
    /// Rest positions [m], shape [vertex_count].
    pub rest_positions: Vec<Vec3<S>>,
    /// Lumped masses [kg]: a quarter of each tetrahedron's, shape [vertex_count].
    pub masses: Vec<S>,
    /// Materials in use.
    pub materials: Vec<MaterialConstants<S>>,
    /// Tetrahedra of each law of tissue, in the order of [`MaterialModel::ALL`].
    pub tet_sets: [TetSet<S>; LAWS],
    /// Springs, attachments: all elements that are no tetrahedra.
    pub elements: ElementSets<S>,
    /// Anchors of the elements that have one where nothing moves them [m], in the order in which they were added.
    pub rest_anchors: Vec<Vec3<S>>,
    /// Number of colours.
    pub color_count: usize,
    /// The most constraints at one vertex.
    pub largest_clique: usize,
    /// Number of multipliers of all constraints, those of padding lanes included.
    pub multiplier_count: usize,
    pub(crate) numbering: Numbering,
    /// Connected parts, in the solver's numbering: the order of their first vertices in the user's.
    pub(crate) parts: Arc<[Part]>,
    /// Copies of vertex `v`, in the solver's numbering, are `copy_offsets[v] .. copy_offsets[v + 1]`.
    pub(crate) copy_offsets: Vec<u32>,
}

impl<S: Real> Model<S> {
    /// Number of vertices of all bodies.
    pub fn vertex_count(&self) -> usize {
        self.rest_positions.len()
    }

    /// Number of tetrahedra of all bodies.
    pub fn tet_count(&self) -> usize {
        self.tet_sets.iter().map(TetSet::len).sum()
    }

    /// Number of copies that a sweep works on.
    pub fn copy_count(&self) -> usize {
        self.copy_offsets.last().map_or(0, |&count| count as usize)
    }

    /// True where a vertex has more than one copy.
    pub fn is_split(&self) -> bool {
        self.copy_count() > self.vertex_count()
    }

    /// Number of connected parts: tetrahedra and springs connect vertices.
    pub fn part_count(&self) -> usize {
        self.parts.len()
    }

    /// The number of the part that one of the user's vertices belongs to.
    pub fn part_of(&self, vertex: u32) -> usize {
        self.part_at(self.numbering.of(vertex))
    }

    /// As [`Model::part_of`], of one of the solver's vertices.
    pub(crate) fn part_at(&self, v: usize) -> usize {
        self.parts.partition_point(|part| part.vertices.end <= v)
    }

    /// The tetrahedra of one law.
    pub fn tets_of(&self, law: MaterialModel) -> &TetSet<S> {
        &self.tet_sets[law as usize]
    }

    /// Whether any tetrahedron is viscous.
    pub fn is_viscous(&self) -> bool {
        self.tet_sets.iter().any(|set| set.viscous)
    }

    /// Blocks of all laws.
    pub(crate) fn block_count(&self) -> usize {
        self.tet_sets.iter().map(TetSet::block_count).sum()
    }

    /// The tetrahedra of a set one by one, sorted by colour, with the user's numbers.
    pub fn tets(&self, set: &TetSet<S>) -> impl Iterator<Item = Tet<S>> {
        set.places().zip(&set.order).map(|((block, lane), &number)| {
            let constants = &set.blocks[block];
            let user = |v: u32| self.numbering.order[v as usize];
            let count = set.form.multiplier_count();
            Tet {
                number: number as usize,
                vertices: constants.vertices.map(|corner| user(corner[lane])),
                copies: set.copies_of(block).map(|corner| corner[lane]),
                inverse_rest_shape: constants.shape(lane),
                rest_volume: constants.rest_volume[lane],
                material: constants.material[lane] as usize,
                color: set.color_offsets.partition_point(|&first| first as usize <= block) - 1,
                first_multiplier: set.multiplier_offset + LANES * count * block + lane,
            }
        })
    }

    /// The copies of one of the user's vertices.
    pub fn copies_of(&self, vertex: u32) -> Range<usize> {
        let v = self.numbering.of(vertex);
        self.copy_offsets[v] as usize..self.copy_offsets[v + 1] as usize
    }

    /// Bytes of the arrays that grow with meshes, springs and attachments.
    pub fn bytes(&self) -> usize {
        let sets: usize = self.tet_sets.iter().map(TetSet::bytes).sum();
        sets + self.elements.bytes()
            + size_of_val(&self.rest_anchors[..])
            + size_of_val(&self.rest_positions[..])
            + size_of_val(&self.masses[..])
            + size_of_val(&self.numbering.order[..])
            + size_of_val(&self.numbering.rank[..])
            + size_of_val(&self.parts[..])
            + self.parts.iter().map(Part::bytes).sum::<usize>()
            + size_of_val(&self.copy_offsets[..])
    }
}
