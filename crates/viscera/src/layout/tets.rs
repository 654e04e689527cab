//! Tetrahedra in blocks of eight, sorted by colour.
//!
//! A block holds the constants of eight tetrahedra of one colour component by component, so that a
//! kernel loads each component of all eight at once. The last block that a connected part has of a colour is
//! filled up with copies of its last tetrahedron; what a kernel makes of these is not stored.

use std::ops::Range;

use super::clusters::SetClusters;
use super::order::Order;
use crate::elements::TetForm;
use crate::material::MaterialModel;
use crate::model::{Model, Numbering};
use crate::scalar::lanes::{Eight, LANES};
use crate::scalar::{Mat3, Real, Vec3, vec3};

/// Constants of eight tetrahedra.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub(crate) struct TetBlock<S> {
    /// Vertices in the solver's numbering, per corner.
    pub vertices: [Eight<u32>; 4],
    /// `Dm^-1` [1/m] by columns.
    pub inverse_rest_shape: [Eight<S>; 9],
    /// Rest volume [m^3].
    pub rest_volume: Eight<S>,
    /// Index into [`crate::model::Model::materials`].
    pub material: Eight<u32>,
}

/// Tetrahedra of one material model, in blocks of eight sorted by colour.
#[derive(Clone, Debug, PartialEq)]
pub struct TetSet<S> {
    /// The elastic energy of the whole set.
    pub model: MaterialModel,
    /// Its constraints.
    pub form: TetForm,
    /// Whether any of its materials is viscous: there are viscous multipliers then.
    pub viscous: bool,
    pub(crate) blocks: Vec<TetBlock<S>>,
    /// How many tetrahedra of each block count: eight, or fewer in the last of a part and colour.
    pub(crate) filled: Vec<u8>,
    /// Whether a block is of one material.
    pub(crate) uniform: Vec<bool>,
    /// Whether any tetrahedron of the block's part in this set is viscous: those of other parts have no viscous
    /// constraints; empty where none is.
    pub(crate) viscous_blocks: Vec<bool>,
    /// The copies that a sweep works on, per corner; empty where nothing is split: the vertices.
    pub(crate) copies: Vec<[Eight<u32>; 4]>,
    /// The user's number of each tetrahedron, shape [tet_count]; without padding lanes.
    pub(crate) order: Vec<u32>,
    /// Blocks of colour `c` are `color_offsets[c] .. color_offsets[c + 1]`.
    pub(crate) color_offsets: Vec<u32>,
    /// Where colours have two levels: tetrahedra of a colour may share vertices within a cluster.
    pub(crate) clusters: Option<SetClusters>,
    /// First multiplier of the elastic constraints.
    pub(crate) multiplier_offset: usize,
    /// First multiplier of the viscous constraints.
    pub(crate) viscous_offset: usize,
    /// Above all vertices, and all copies, of the blocks: passes rely on it.
    pub(crate) bounds: [usize; 2],
}

/// One tetrahedron as [`super::Layout::tets`] shows it.
#[derive(Clone, Debug, PartialEq)]
pub struct LaidTet<S> {
    /// The user's number.
    pub number: usize,
    /// The user's vertices.
    pub vertices: [u32; 4],
    /// The copies that a sweep works on.
    pub copies: [u32; 4],
    /// `Dm^-1` [1/m].
    pub inverse_rest_shape: Mat3<S>,
    /// Rest volume [m^3].
    pub rest_volume: S,
    /// Index into [`crate::model::Model::materials`].
    pub material: usize,
    /// Its colour, or that of its cluster.
    pub color: usize,
    /// Its cluster in the set, and its colour there, where colours have two levels.
    pub cluster: Option<[usize; 2]>,
    /// Where its first elastic multiplier stands in [`crate::state::State::multipliers`].
    pub(super) first_multiplier: usize,
}

impl<S> LaidTet<S> {
    /// Where one of its elastic multipliers stands in [`crate::state::State::multipliers`].
    pub fn multiplier(&self, p: usize) -> usize {
        self.first_multiplier + LANES * p
    }
}

impl<S: Real> TetSet<S> {
    /// The tetrahedra of a law, sorted and in blocks.
    pub(super) fn new(
        model: &Model<S>,
        law: MaterialModel,
        form: TetForm,
        sorted: &mut Order<'_>,
    ) -> Self {
        let of_law = |&tet: &u32| model.laws[model.tet_materials[tet as usize] as usize] == law;
        let (order, colors) = sorted.sort((0..model.tet_count() as u32).filter(of_law));
        let viscous_parts = viscous_parts(model, sorted, &order);
        let is_viscous = viscous_parts.contains(&true);
        let in_blocks = |color: &[u32]| sorted.blocks(&order, color).count();
        let count = colors.windows(2).map(in_blocks).sum();
        let mut set = Self {
            model: law,
            form,
            viscous: is_viscous,
            blocks: Vec::with_capacity(count),
            filled: Vec::with_capacity(count),
            uniform: Vec::with_capacity(count),
            viscous_blocks: Vec::with_capacity(if is_viscous { count } else { 0 }),
            copies: Vec::with_capacity(if sorted.is_split() { count } else { 0 }),
            color_offsets: vec![0],
            clusters: sorted.clusters.map(|_| SetClusters::default()),
            multiplier_offset: 0,
            viscous_offset: 0,
            bounds: [model.vertex_count(), sorted.copy_count()],
            order,
        };
        for color in colors.windows(2) {
            for chosen in sorted.blocks(&set.order, color) {
                set.filled.push(chosen.len() as u8);
                let block = TetBlock::new(model, sorted.numbering, chosen);
                set.uniform.push(block.material.iter().all(|&m| m == block.material[0]));
                set.blocks.push(block);
                if let Some(clusters) = &mut set.clusters {
                    clusters.push(sorted.cluster(chosen[0]));
                }
                if is_viscous {
                    set.viscous_blocks.push(viscous_parts[sorted.part(chosen[0])]);
                }
                if sorted.is_split() {
                    set.copies.push(sorted.block_copies(chosen));
                }
            }
            set.color_offsets.push(set.blocks.len() as u32);
            if let Some(clusters) = &mut set.clusters {
                clusters.end_color();
            }
        }
        [set.multiplier_offset, set.viscous_offset] =
            set.multiplier_counts().map(|count| sorted.take_multipliers(count));
        set
    }

    /// Number of tetrahedra.
    pub fn len(&self) -> usize {
        self.order.len()
    }

    /// True without tetrahedra.
    pub fn is_empty(&self) -> bool {
        self.order.is_empty()
    }

    /// Number of blocks, padding lanes included.
    pub fn block_count(&self) -> usize {
        self.blocks.len()
    }

    /// The blocks of a colour.
    pub(crate) fn color(&self, color: usize) -> Range<usize> {
        self.color_offsets[color] as usize..self.color_offsets[color + 1] as usize
    }

    /// The copies that a sweep of this block works on.
    #[inline(always)]
    pub(crate) fn copies_of(&self, block: usize) -> &[Eight<u32>; 4] {
        if self.copies.is_empty() { &self.blocks[block].vertices } else { &self.copies[block] }
    }

    /// Whether a block has viscous constraints.
    #[inline(always)]
    pub(crate) fn is_viscous(&self, block: usize) -> bool {
        self.viscous && self.viscous_blocks[block]
    }

    /// Elastic and viscous multipliers of a block, padding lanes included.
    pub(crate) fn multipliers_per_block(&self) -> [usize; 2] {
        [LANES * self.form.multiplier_count(), if self.viscous { LANES * 6 } else { 0 }]
    }

    /// Elastic and viscous multipliers, padding lanes included.
    pub(crate) fn multiplier_counts(&self) -> [usize; 2] {
        self.multipliers_per_block().map(|count| count * self.blocks.len())
    }

    /// Every tetrahedron with block and lane, in the order of blocks.
    pub(crate) fn places(&self) -> impl Iterator<Item = (usize, usize)> {
        let lanes = |(block, &filled): (usize, &u8)| (0..filled as usize).map(move |l| (block, l));
        self.filled.iter().enumerate().flat_map(lanes)
    }

    /// Bytes of its arrays.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&self.blocks[..])
            + size_of_val(&self.filled[..])
            + size_of_val(&self.uniform[..])
            + size_of_val(&self.viscous_blocks[..])
            + size_of_val(&self.copies[..])
            + size_of_val(&self.order[..])
            + self.clusters.as_ref().map_or(0, SetClusters::bytes)
    }
}

impl<S: Real> TetBlock<S> {
    /// Of up to eight tetrahedra; the last fills the block up.
    fn new(model: &Model<S>, numbering: &Numbering, tets: &[u32]) -> Self {
        let mut block = Self {
            vertices: [[0; LANES]; 4],
            inverse_rest_shape: [[S::ZERO; LANES]; 9],
            rest_volume: [S::ZERO; LANES],
            material: [0; LANES],
        };
        for lane in 0..LANES {
            let tet = model.tet(tets[lane.min(tets.len() - 1)] as usize);
            block.set_shape(lane, &tet.inverse_rest_shape);
            block.rest_volume[lane] = tet.rest_volume;
            block.material[lane] = tet.material;
            for (corner, v) in tet.vertices.into_iter().enumerate() {
                block.vertices[corner][lane] = numbering.of(v) as u32;
            }
        }
        block
    }

    /// `Dm^-1` [1/m] of one lane.
    pub fn shape(&self, lane: usize) -> Mat3<S> {
        let column = |c: usize| -> Vec3<S> {
            let entry = |row: usize| self.inverse_rest_shape[3 * c + row][lane];
            vec3(entry(0), entry(1), entry(2))
        };
        Mat3::from_columns(column(0), column(1), column(2))
    }

    /// Sets `Dm^-1` [1/m] of one lane.
    fn set_shape(&mut self, lane: usize, shape: &Mat3<S>) {
        for (c, column) in shape.columns.iter().enumerate() {
            for (row, value) in column.to_array().into_iter().enumerate() {
                self.inverse_rest_shape[3 * c + row][lane] = value;
            }
        }
    }
}

/// Whether any of some tetrahedra in each part is viscous.
fn viscous_parts<S: Real>(model: &Model<S>, sorted: &Order<'_>, tets: &[u32]) -> Vec<bool> {
    let mut viscous = vec![false; model.part_count];
    for &tet in tets {
        let material = &model.materials[model.tet_materials[tet as usize] as usize];
        viscous[sorted.part(tet)] |= material.viscosity > S::ZERO;
    }
    viscous
}
