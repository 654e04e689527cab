//! Passes over tetrahedra, eight at a time: what a kernel loads and stores.
#![allow(unsafe_code)]

use std::ops::Range;

use super::threads::{Shared, Workers};
use crate::layout::{Layout, SetClusters, TetBlock, TetSet};
use crate::material::Compliance;
use crate::material::MaterialConstants;
use crate::scalar::lanes::{self, Eight, LANES, Lanes, Point};
use crate::scalar::{Mat3, Real, Scalar, Vec3, vec3};

/// Blocks that a thread does at a time: about the five microseconds that hide what a fork costs.
const GRAIN: usize = 32;

/// One pass: what to do with a block, or with some lanes of it at a time.
pub trait TetPass<S: Real> {
    /// `#[inline(always)]`, or it is not compiled for the instructions chosen.
    fn block<L: Lanes<Real = S>>(&self, tets: &Block<'_, S>);
}

/// The block that is worked on.
pub struct Block<'a, S> {
    pub set: &'a TetSet<S>,
    pub index: usize,
    /// The first lane of the block that is worked on.
    pub lane: usize,
    constants: &'a TetBlock<S>,
    materials: &'a [MaterialConstants<S>],
}

/// Positions [m] of a block's corners, and what travels along.
pub struct Corners<L> {
    pub x: [Vec3<L>; 4],
    pub w: [L; 4],
}

impl<'a, S: Real> Block<'a, S> {
    #[inline(always)]
    pub fn new(layout: &'a Layout<S>, set: &'a TetSet<S>, index: usize, lane: usize) -> Self {
        Self { set, index, lane, constants: &set.blocks[index], materials: &layout.materials }
    }

    /// How many tetrahedra of the block count.
    #[inline(always)]
    pub fn filled(&self) -> usize {
        self.set.filled[self.index] as usize
    }

    /// Whether its tetrahedra have viscous constraints.
    #[inline(always)]
    pub fn is_viscous(&self) -> bool {
        self.set.is_viscous(self.index)
    }

    /// Whether all lanes that are worked on count.
    #[inline(always)]
    fn whole<L: Lanes>(&self) -> bool {
        self.lane + L::WIDTH <= self.filled()
    }

    /// `Dm^-1` [1/m].
    #[inline(always)]
    pub fn shape<L: Lanes<Real = S>>(&self) -> Mat3<L> {
        let (c, at) = (&self.constants.inverse_rest_shape, self.lane);
        Mat3::from_columns(
            vec3(L::load(&c[0], at), L::load(&c[1], at), L::load(&c[2], at)),
            vec3(L::load(&c[3], at), L::load(&c[4], at), L::load(&c[5], at)),
            vec3(L::load(&c[6], at), L::load(&c[7], at), L::load(&c[8], at)),
        )
    }

    /// Rest volume [m^3].
    #[inline(always)]
    pub fn volume<L: Lanes<Real = S>>(&self) -> L {
        L::load(&self.constants.rest_volume, self.lane)
    }

    /// The materials' constants. Most blocks are of one material.
    #[inline(always)]
    pub fn material<L: Lanes<Real = S>>(&self) -> MaterialConstants<L> {
        let indices = &self.constants.material;
        let uniform = self.set.uniform[self.index];
        let first = &self.materials[indices[0] as usize];
        macro_rules! fetch {
            ($($field:ident).+) => {
                if uniform {
                    L::splat(first.$($field).+)
                } else {
                    let mut values = [S::ZERO; LANES];
                    for lane in 0..LANES {
                        values[lane] = self.materials[indices[lane] as usize].$($field).+;
                    }
                    L::load(&values, self.lane)
                }
            };
        }
        MaterialConstants {
            lame_lambda: fetch!(lame_lambda),
            lame_mu: fetch!(lame_mu),
            compliance: Compliance {
                normal: fetch!(compliance.normal),
                cross: fetch!(compliance.cross),
                shear: fetch!(compliance.shear),
            },
            viscosity: fetch!(viscosity),
        }
    }

    /// Corners among the positions of vertices.
    #[inline(always)]
    pub fn corners<L: Lanes<Real = S>>(&self, points: &[Point<S>]) -> Corners<L> {
        assert!(points.len() >= self.set.bounds[0]);
        // SAFETY: checked above; the layout that the block is of was made with its vertices in bounds, nobody can
        // change it since, and no thread writes the slice.
        unsafe { gather(points.as_ptr(), &self.constants.vertices, self.lane) }
    }

    /// Corners among copies.
    ///
    /// # Safety
    /// No other block of the pass has a copy of this one.
    #[inline(always)]
    pub unsafe fn copies<L: Lanes<Real = S>>(&self, points: &Shared<'_, Point<S>>) -> Corners<L> {
        // SAFETY: within bounds as above; alone there by the caller's promise.
        unsafe { gather(points.pointer(), self.set.copies_of(self.index), self.lane) }
    }

    /// Writes copies.
    ///
    /// # Safety
    /// As [`Block::copies`].
    #[inline(always)]
    pub unsafe fn store<L: Lanes<Real = S>>(
        &self,
        points: &Shared<'_, Point<S>>,
        x: &[Vec3<L>; 4],
        w: &[L; 4],
    ) {
        let copies = self.set.copies_of(self.index);
        for corner in 0..4 {
            let value = Point::new(x[corner], w[corner]);
            // SAFETY: within bounds as above; alone there by the caller's promise.
            unsafe {
                if self.whole::<L>() {
                    L::scatter(points.pointer(), &copies[corner], self.lane, value);
                } else {
                    let rows = rows(value, self.lane);
                    for lane in self.lane..self.filled() {
                        *points.at(copies[corner][lane] as usize) = rows[lane];
                    }
                }
            }
        }
    }

    /// Adds to copies.
    ///
    /// # Safety
    /// As [`Block::copies`].
    #[inline(always)]
    pub unsafe fn add<L: Lanes<Real = S>>(
        &self,
        points: &Shared<'_, Point<S>>,
        values: &[Point<L>; 4],
    ) {
        let copies = self.set.copies_of(self.index);
        for corner in 0..4 {
            // SAFETY: within bounds as above; alone there by the caller's promise.
            unsafe {
                if self.whole::<L>() {
                    L::scatter_add(points.pointer(), &copies[corner], self.lane, values[corner]);
                } else {
                    let rows = rows(values[corner], self.lane);
                    for lane in self.lane..self.filled() {
                        points.at(copies[corner][lane] as usize).add(rows[lane]);
                    }
                }
            }
        }
    }

    /// Adds to copies tetrahedron by tetrahedron, corner by corner: the lanes may share copies, and the order does not
    /// depend on how many are worked on at a time.
    ///
    /// # Safety
    /// No other thread has copies of the block meanwhile.
    #[inline(always)]
    pub unsafe fn add_in_order<L: Lanes<Real = S>>(
        &self,
        points: &Shared<'_, Point<S>>,
        values: &[Vec3<L>; 4],
    ) {
        // SAFETY: the caller's promise.
        unsafe { self.add_bound_in_order(points, values, L::ZERO) };
    }

    /// As [`Block::add_in_order`], and the same bound to each corner.
    ///
    /// # Safety
    /// As [`Block::add_in_order`].
    #[inline(always)]
    pub unsafe fn add_bound_in_order<L: Lanes<Real = S>>(
        &self,
        points: &Shared<'_, Point<S>>,
        values: &[Vec3<L>; 4],
        bound: L,
    ) {
        let copies = self.set.copies_of(self.index);
        assert!(points.len() >= self.set.bounds[1]);
        let values = values.map(|value| Point::new(value, bound));
        // SAFETY: below the bound, which is checked above; alone there by the caller's promise.
        unsafe { self.add_rows_in_order(points, 0, copies, values) };
    }

    /// As [`Block::add_bound_in_order`], to points of other indices, each so many further on.
    ///
    /// # Safety
    /// There are points of all these indices, and no other thread uses them meanwhile.
    #[inline(always)]
    pub unsafe fn add_rows_in_order<L: Lanes<Real = S>>(
        &self,
        points: &Shared<'_, Point<S>>,
        further: usize,
        indices: &[Eight<u32>; 4],
        values: [Point<L>; 4],
    ) {
        // SAFETY: the caller's promise.
        let points = unsafe { points.pointer().add(further) };
        if self.whole::<L>() {
            // SAFETY: the caller's promise.
            unsafe { L::add_in_order(points, indices, self.lane, values) };
            return;
        }
        let [a, b, c, d] = values;
        let (a, b) = (rows(a, self.lane), rows(b, self.lane));
        let (c, d) = (rows(c, self.lane), rows(d, self.lane));
        for lane in self.lane..self.filled() {
            let values = [a[lane], b[lane], c[lane], d[lane]];
            // SAFETY: the caller's promise.
            unsafe { S::add_in_order(points, indices, lane, values) };
        }
    }

    /// Where the block's `N` multipliers per tetrahedron stand.
    #[inline(always)]
    fn multipliers_at(&self, offset: usize, count: usize) -> Range<usize> {
        let first = offset + LANES * count * self.index;
        first..first + LANES * count
    }

    /// Multipliers of the block; `offset` is that of the set.
    #[inline(always)]
    pub fn multipliers<L: Lanes<Real = S>, const N: usize>(
        &self,
        offset: usize,
        values: &[S],
    ) -> [L; N] {
        load_rows(&values[self.multipliers_at(offset, N)], self.lane)
    }

    /// Replaces multipliers; those of padding lanes stay zero.
    ///
    /// # Safety
    /// No other thread uses the block's multipliers meanwhile.
    #[inline(always)]
    pub unsafe fn store_multipliers<L: Lanes<Real = S>, const N: usize>(
        &self,
        offset: usize,
        values: &Shared<'_, S>,
        multipliers: [L; N],
    ) {
        // SAFETY: alone there by the caller's promise.
        let places = unsafe { values.range(self.multipliers_at(offset, N)) };
        for (row, eight) in multipliers.into_iter().zip(places.as_chunks_mut().0) {
            if self.whole::<L>() {
                row.store(eight, self.lane);
            } else {
                let mut lanes = [S::ZERO; LANES];
                row.store(&mut lanes, self.lane);
                let counts = self.lane..self.filled();
                eight[counts.clone()].copy_from_slice(&lanes[counts]);
            }
        }
    }

    /// As [`Block::multipliers`], while they are shared.
    ///
    /// # Safety
    /// As [`Block::store_multipliers`].
    #[inline(always)]
    pub unsafe fn shared_multipliers<L: Lanes<Real = S>, const N: usize>(
        &self,
        offset: usize,
        values: &Shared<'_, S>,
    ) -> [L; N] {
        // SAFETY: alone there by the caller's promise.
        load_rows(unsafe { values.range(self.multipliers_at(offset, N)) }, self.lane)
    }
}

/// Lanes of `N` rows of eight, from one lane on.
#[inline(always)]
pub fn load_rows<L: Lanes, const N: usize>(values: &[L::Real], lane: usize) -> [L; N] {
    let mut rows = [L::ZERO; N];
    for (row, eight) in rows.iter_mut().zip(values.as_chunks().0) {
        *row = L::load(eight, lane);
    }
    rows
}

/// The lanes one by one, in their places. All of a page's module is compiled for its registers, and has no room for copies.
#[cfg_attr(not(target_arch = "wasm32"), inline(always))]
fn rows<L: Lanes>(values: Point<L>, lane: usize) -> [Point<L::Real>; LANES] {
    let mut columns = [[L::Real::ZERO; LANES]; 4];
    for (column, value) in columns.iter_mut().zip([values.x, values.y, values.z, values.w]) {
        value.store(column, lane);
    }
    let [x, y, z, w] = columns;
    let mut rows = [Point::default(); LANES];
    for (lane, row) in rows.iter_mut().enumerate() {
        *row = Point { x: x[lane], y: y[lane], z: z[lane], w: w[lane] };
    }
    rows
}

#[inline(always)]
unsafe fn gather<L: Lanes>(
    points: *const Point<L::Real>,
    indices: &[Eight<u32>; 4],
    lane: usize,
) -> Corners<L> {
    let mut corners = Corners { x: [Vec3::ZERO; 4], w: [L::ZERO; 4] };
    for corner in 0..4 {
        // SAFETY: the caller's promise.
        let point = unsafe { L::gather(points, &indices[corner], lane) };
        corners.x[corner] = point.vec3();
        corners.w[corner] = point.w;
    }
    corners
}

/// The blocks that a thread does at a time.
struct Piece<'a, S, P> {
    layout: &'a Layout<S>,
    set: &'a TetSet<S>,
    blocks: Range<usize>,
    pass: &'a P,
}

impl<S: Real, P: TetPass<S>> lanes::Kernel<S> for Piece<'_, S, P> {
    #[inline(always)]
    fn run<L: Lanes<Real = S>>(self) {
        for index in self.blocks {
            let (mut lane, filled) = (0, self.set.filled[index] as usize);
            while lane < filled {
                self.pass.block::<L>(&Block::new(self.layout, self.set, index, lane));
                lane += L::WIDTH;
            }
        }
    }
}

impl Workers {
    /// A pass over some blocks of a set, in no particular order.
    pub fn pass<S: Real>(
        &self,
        layout: &Layout<S>,
        set: &TetSet<S>,
        blocks: Range<usize>,
        pass: &(impl TetPass<S> + Sync),
    ) {
        self.each(blocks.len(), GRAIN, |piece| {
            let blocks = blocks.start + piece.start..blocks.start + piece.end;
            lanes::run(self.instructions, Piece { layout, set, blocks, pass });
        });
    }

    /// A pass over a colour of a set: block by block in no particular order or, where colours have two levels, cluster by
    /// cluster, in each block after block. Those of one cluster may share copies.
    pub fn color_pass<S: Real>(
        &self,
        layout: &Layout<S>,
        set: &TetSet<S>,
        color: usize,
        pass: &(impl TetPass<S> + Sync),
    ) {
        match &set.clusters {
            None => self.pass(layout, set, set.color(color), pass),
            Some(clusters) => self.each_cluster(clusters, color, |blocks| {
                self.piece(layout, set, blocks, pass);
            }),
        }
    }

    /// `work` on the blocks of each cluster of a colour, or of several in a row.
    pub fn each_cluster(
        &self,
        clusters: &SetClusters,
        color: usize,
        work: impl Fn(Range<usize>) + Sync,
    ) {
        let own = clusters.color(color);
        self.each(own.len(), 1, |piece| {
            work(clusters.blocks(own.start + piece.start..own.start + piece.end));
        });
    }

    /// A pass over a piece of a set by the thread that is here.
    pub fn piece<S: Real>(
        &self,
        layout: &Layout<S>,
        set: &TetSet<S>,
        blocks: Range<usize>,
        pass: &impl TetPass<S>,
    ) {
        lanes::run(self.instructions, Piece { layout, set, blocks, pass });
    }
}
