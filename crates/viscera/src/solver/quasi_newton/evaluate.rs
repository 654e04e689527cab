//! Gradient of the incremental potential at a trial, and its change on the way there, in passes without colours.
//!
//! ```text
//! grad_i Phi(y) = m_i (y_i - xt_i) - he^2 f_i(y),   slope at y: grad Phi(y).(y - x)
//! Phi(y) - Phi(x) = sum_i m_i (y - x).(x - xt + (y - x)/2) + he^2 sum_t V_t (W(F + D) - W(F)),   F + D at y
//! ```
//!
//! The change is computed only where the slope does not tell enough ([`super::parts::Progress::is_settled_by`]). Every tetrahedron gives the change of its energy, computed from the change of its deformation: round-off is that of
//! the change, not that of the energy. So single precision tells apart steps that lower the potential by a
//! ten-millionth of itself. Sums are in double precision and in a fixed order.

#![allow(unsafe_code)]

use std::cell::Cell;
use std::ops::Range;

use crate::elements::kinds::{Energy, Kind};
use crate::elements::law::{LAWS, Law};
use crate::elements::{deformation_gradient, internal_forces};
use crate::layout::{ElementSet, Layout, Moments, PIECE_BLOCKS, Part};
use crate::model::for_each_kind;
use crate::scalar::lanes::{Eight, LANES, Lanes, Point};
use crate::scalar::{Real, Vec3};
use crate::solver::cpu::tets::{Block, TetPass, load_rows};
use crate::solver::cpu::threads::Shared;
use crate::solver::step::contacts::Bound;
use crate::solver::step::data::{Step, StepConstants, gather};
use crate::solver::step::gradient::add_elements;
use crate::solver::step::law::{OfLaw, respond, with_tissue};
use crate::solver::step::recovered::{Along, Found, along_recovered, load_recovered};
use crate::solver::step::strain::is_recovered;
use crate::solver::step::tissue::Tissue;

/// Vertices whose sums are taken first. Part of the result's bits.
const VERTEX_PIECE: usize = 1024;

/// Copies of vertices that a thread clears at a time.
const COPY_GRAIN: usize = 4096;

/// A part's change of the potential.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Change {
    /// Of the incremental potential [J s^2].
    pub potential: f64,
    /// Sum of the magnitudes of all terms of it [J s^2]: what its round-off is a share of.
    pub size: f64,
}

impl Change {
    /// Of two parts, or two terms.
    pub fn plus(self, other: Self) -> Self {
        Self { potential: self.potential + other.potential, size: self.size + other.size }
    }

    fn of(term: f64) -> Self {
        Self { potential: term, size: term.abs() }
    }
}

/// Evaluates parts.
#[derive(Clone, Debug)]
pub struct Evaluation<S> {
    /// Of each part: the slope of the potential [J s^2] at its last trial, along the way from the iterate.
    pub slopes: Vec<f64>,
    /// Of each part the change on that way, as of its last evaluation.
    pub changes: Vec<Change>,
    /// Blocks of all parts, part by part.
    blocks: Vec<BlockPiece>,
    /// Vertices of all parts, part by part.
    vertices: Vec<VertexPiece>,
    block_sums: Vec<Change>,
    vertex_sums: Vec<Change>,
    /// Where the layout has recovered-gradient tetrahedra.
    along: Option<Along<S>>,
}

#[derive(Clone, Debug)]
struct BlockPiece {
    part: usize,
    law: usize,
    blocks: Range<usize>,
}

#[derive(Clone, Debug)]
struct VertexPiece {
    part: usize,
    vertices: Range<usize>,
}

/// The places between which the potential changes, and what acts there.
pub struct Way<'a, S> {
    /// `x` [m].
    pub from: &'a [Point<S>],
    /// `y` [m].
    pub to: &'a [Point<S>],
    /// What elements depend on.
    pub moments: Moments<'a, S>,
}

impl<S: Real> Evaluation<S> {
    /// For a layout in pieces.
    pub fn new(layout: &Layout<S>) -> Self {
        let (mut blocks, mut vertices) = (Vec::new(), Vec::new());
        for (number, part) in layout.parts.iter().enumerate() {
            let is_plain = |law: &usize| !is_recovered(layout, &layout.tet_sets[*law]);
            for law in (0..LAWS).filter(is_plain) {
                for range in part.blocks(law).flat_map(|range| cut(range, PIECE_BLOCKS)) {
                    blocks.push(BlockPiece { part: number, law, blocks: range });
                }
            }
            for range in cut(part.vertices.clone(), VERTEX_PIECE) {
                vertices.push(VertexPiece { part: number, vertices: range });
            }
        }
        blocks.shrink_to_fit();
        vertices.shrink_to_fit();
        Self {
            slopes: vec![0.0; layout.part_count()],
            changes: vec![Change::default(); layout.part_count()],
            block_sums: vec![Change::default(); blocks.len()],
            vertex_sums: vec![Change::default(); vertices.len()],
            blocks,
            vertices,
            along: layout.recovered.as_ref().map(|tables| Along::new(layout, tables)),
        }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.slopes[..])
            + size_of_val(&self.changes[..])
            + size_of_val(&self.blocks[..])
            + size_of_val(&self.vertices[..])
            + size_of_val(&self.block_sums[..])
            + size_of_val(&self.vertex_sums[..])
            + self.along.as_ref().map_or(0, Along::bytes)
    }

    /// Gradient [N s^2] at the trial of the parts that `acts` names, zero where pinned, and its slope. `loads` has room for
    /// what elements do to each copy.
    pub fn gradient(
        &mut self,
        constants: &mut StepConstants<S>,
        step: &Step<'_, S>,
        way: &Way<'_, S>,
        acts: impl Fn(usize) -> bool + Sync,
        loads: &mut [Point<S>],
        gradient: &mut [Vec3<S>],
    ) {
        let layout = step.layout;
        for (_, part) in layout.parts.iter().enumerate().filter(|(number, _)| acts(*number)) {
            let copies = Shared::new(&mut loads[part.copies.clone()]);
            constants.workers.each(part.copies.len(), COPY_GRAIN, |range| {
                // SAFETY: pieces do not overlap.
                unsafe { copies.range(range) }.fill(Point::default());
            });
        }
        let shared = Shared::new(loads);
        constants.workers.each(self.blocks.len(), 1, |range| {
            for BlockPiece { law, blocks, .. } in
                self.blocks[range].iter().filter(|piece| acts(piece.part))
            {
                let set = &layout.tet_sets[*law];
                let start_strain = &constants.start_strain[*law];
                let forces = Forces { x: way.to, start_strain, dt: step.dt, loads: &shared };
                with_tissue!(set, L, VISCOUS => {
                    let pass = OfLaw::<_, L, VISCOUS>::new(&forces);
                    constants.workers.piece(layout, set, blocks.clone(), &pass);
                });
            }
        });
        for (number, part) in layout.parts.iter().enumerate().filter(|(n, _)| acts(*n)) {
            load_recovered(constants, step, number, way.to, (false, None), loads);
            add_elements(layout, &way.moments, part, way.to, loads);
            constants.contacts.add_forces(&step.contact(), number, way.to, Bound::Without, loads);
        }
        for number in (0..layout.part_count()).filter(|&number| acts(number)) {
            let StepConstants { contacts, .. } = &*constants;
            contacts.add_pair_forces(&step.contact(), number, way.to, Bound::Without, loads);
        }
        let constants = &*constants;
        let (pieces, loads) = (&self.vertices, &*loads);
        let (sums, into) = (Shared::new(&mut self.vertex_sums), Shared::new(gradient));
        constants.workers.each(pieces.len(), 1, |range| {
            for i in range.filter(|&i| acts(pieces[i].part)) {
                let range = pieces[i].vertices.clone();
                // SAFETY: every piece is worked on once, and has vertices of its own.
                let gradient = unsafe { into.range(range.clone()) };
                let slope = vertex_gradient(constants, layout, way, loads, range, gradient);
                // SAFETY: as above.
                unsafe { *sums.at(i) = Change::of(slope) };
            }
        });
        for (number, slope) in self.slopes.iter_mut().enumerate().filter(|(n, _)| acts(*n)) {
            let of_part = pieces.iter().zip(&self.vertex_sums).filter(|(p, _)| p.part == number);
            *slope = of_part.map(|(_, sum)| sum.potential).sum();
        }
    }

    /// The change of a part's potential on its way, to the last trial of [`Self::gradient`].
    pub fn change(
        &mut self,
        constants: &StepConstants<S>,
        step: &Step<'_, S>,
        way: &Way<'_, S>,
        number: usize,
    ) {
        let (layout, part) = (step.layout, &step.layout.parts[number]);
        let (pieces, sums) = (&self.blocks, Shared::new(&mut self.block_sums));
        constants.workers.each(pieces.len(), 1, |range| {
            for i in range.filter(|&i| pieces[i].part == number) {
                let BlockPiece { law, ref blocks, .. } = pieces[i];
                let set = &layout.tet_sets[law];
                let start_strain = &constants.start_strain[law];
                let Way { from, to, .. } = *way;
                let tets = Changes { from, to, start_strain, dt: step.dt, sum: Cell::default() };
                with_tissue!(set, L, VISCOUS => {
                    let pass = OfLaw::<_, L, VISCOUS>::new(&tets);
                    constants.workers.piece(layout, set, blocks.clone(), &pass);
                });
                // SAFETY: every piece is worked on once.
                unsafe { *sums.at(i) = tets.sum.get() };
            }
        });
        let (pieces, sums) = (&self.vertices, Shared::new(&mut self.vertex_sums));
        constants.workers.each(pieces.len(), 1, |range| {
            for i in range.filter(|&i| pieces[i].part == number) {
                let sum = vertex_change(constants, way, pieces[i].vertices.clone());
                // SAFETY: every piece is worked on once.
                unsafe { *sums.at(i) = sum };
            }
        });
        let mut change = Change::default();
        let squared = step.dt * step.dt;
        for_each_kind!(layout, set => element_changes(set, &mut change, squared, way, part));
        let [potential, size] =
            constants.contacts.change(&step.contact(), number, [way.from, way.to]);
        change = change.plus(Change { potential: squared * potential, size: squared * size });
        if let Some(along) = &mut self.along {
            // From the trial, where gradients are known, back.
            let vertices = &mut along.moved[part.vertices.clone()];
            let places = way.from[part.vertices.clone()].iter().zip(&way.to[part.vertices.clone()]);
            for (moved, (from, to)) in vertices.iter_mut().zip(places) {
                moved.set_vec3(from.vec3() - to.vec3());
            }
            let [potential, size] = along_recovered(constants, step, number, along, Found::Change);
            let of_recovered = Change { potential: -squared * potential, size: squared * size };
            change = change.plus(of_recovered);
        }
        let blocks = self.blocks.iter().zip(&self.block_sums).filter(|(p, _)| p.part == number);
        change = blocks.fold(change, |change, (_, sum)| change.plus(*sum));
        let vertices = pieces.iter().zip(&self.vertex_sums).filter(|(p, _)| p.part == number);
        self.changes[number] = vertices.fold(change, |change, (_, sum)| change.plus(*sum));
    }
}

impl<S: Real> Evaluation<S> {
    /// The curvature of a part's potential along a direction [J s^2]: exactly, and without what may be negative in it.
    /// Of elements that are no tetrahedra only the latter counts.
    pub fn curvature(
        &mut self,
        constants: &mut StepConstants<S>,
        step: &Step<'_, S>,
        moments: &Moments<'_, S>,
        x: &[Point<S>],
        direction: &[Point<S>],
        number: usize,
    ) -> [f64; 2] {
        let layout = step.layout;
        let part = &layout.parts[number];
        let (mut exact, mut bound) = (0.0, 0.0);
        let mut add = |term: f64| {
            exact += term;
            bound += term;
        };
        for v in part.vertices.clone().filter(|&v| constants.inverse_masses[v] != S::ZERO) {
            let squared = direction[v].vec3().length_squared();
            add(constants.inertias[v].to_f64() * squared.to_f64());
        }
        for_each_kind!(layout, set => element_curvature(set, part, moments, x, direction, step.dt, &mut add));
        add(step.dt
            * step.dt
            * constants.contacts.curvature(&step.contact(), number, x, direction));
        let pieces = &self.blocks;
        let sums = Shared::new(&mut self.block_sums);
        constants.workers.each(pieces.len(), 1, |range| {
            for i in range.filter(|&i| pieces[i].part == number) {
                let BlockPiece { law, ref blocks, .. } = pieces[i];
                let set = &layout.tet_sets[law];
                let start_strain = &constants.start_strain[law];
                let along =
                    Curvatures { x, direction, start_strain, dt: step.dt, sums: Cell::default() };
                with_tissue!(set, L, VISCOUS => {
                    let pass = OfLaw::<_, L, VISCOUS>::new(&along);
                    constants.workers.piece(layout, set, blocks.clone(), &pass);
                });
                let [potential, size] = along.sums.get();
                // SAFETY: every piece is worked on once.
                unsafe { *sums.at(i) = Change { potential, size } };
            }
        });
        for (_, sum) in self.blocks.iter().zip(&self.block_sums).filter(|(p, _)| p.part == number) {
            exact += sum.potential;
            bound += sum.size;
        }
        if let Some(along) = &mut self.along {
            let vertices = part.vertices.clone();
            along.moved[vertices.clone()].copy_from_slice(&direction[vertices]);
            if let StepConstants { workers, recovered: Some(tets), .. } = constants {
                tets.evaluate(workers, layout, number, x);
            }
            let found = along_recovered(constants, step, number, along, Found::Curvature);
            exact += step.dt * step.dt * found[0];
            bound += step.dt * step.dt * found[1];
        }
        [exact, bound]
    }
}

/// Of a part's elements of one kind.
fn element_curvature<S: Real, K: Kind<N, M>, const N: usize, const M: usize>(
    set: &ElementSet<S, K, N, M>,
    part: &Part,
    moments: &Moments<'_, S>,
    x: &[Point<S>],
    direction: &[Point<S>],
    dt: f64,
    add: &mut impl FnMut(f64),
) {
    for i in set.of_part(part) {
        let places = set.places(i, x).map(|x| x.cast::<f64>());
        let d = set.places(i, direction).map(|d| d.cast::<f64>());
        let blocks = set.element::<f64>(i, moments).blocks(&places);
        for (a, row) in d.iter().zip(&blocks) {
            for (b, block) in d.iter().zip(row) {
                add(dt * dt * a.dot(*block * *b));
            }
        }
    }
}

struct Curvatures<'a, S> {
    x: &'a [Point<S>],
    direction: &'a [Point<S>],
    start_strain: &'a [[Eight<S>; 6]],
    dt: f64,
    sums: Cell<[f64; 2]>,
}

impl<S: Real, W: Law, const VISCOUS: bool> TetPass<S> for OfLaw<'_, Curvatures<'_, S>, W, VISCOUS> {
    #[inline(always)]
    fn block<L: Lanes<Real = S>>(&self, tets: &Block<'_, S>) {
        let Curvatures { x, direction, start_strain, dt, ref sums } = *self.pass;
        let shape = tets.shape::<L>();
        let f = deformation_gradient(&tets.corners::<L>(x).x, &shape);
        let d = deformation_gradient(&tets.corners::<L>(direction).x, &shape);
        let tissue = Tissue::new(W::MODEL, &tets.material(), dt);
        let mut start = [L::ZERO; 6];
        let is_viscous = VISCOUS && tets.is_viscous();
        if is_viscous {
            start = load_rows(start_strain[tets.index].as_flattened(), tets.lane);
        }
        let along = tissue.curvature_along_of::<W>(&f, &d, is_viscous.then_some(&start));
        let volume = tets.volume::<L>() * L::from_f64(dt * dt);
        let mut both = [[S::ZERO; LANES]; 2];
        for (lanes, value) in both.iter_mut().zip(along) {
            (volume * value).store(lanes, tets.lane);
        }
        let [mut exact, mut bound] = sums.get();
        for lane in tets.lane..(tets.lane + L::WIDTH).min(tets.filled()) {
            exact += both[0][lane].to_f64();
            bound += both[1][lane].to_f64();
        }
        sums.set([exact, bound]);
    }
}

/// A range in pieces.
fn cut(range: Range<usize>, size: usize) -> impl Iterator<Item = Range<usize>> {
    let end = range.end;
    range.step_by(size).map(move |start| start..(start + size).min(end))
}

struct Forces<'a, S> {
    x: &'a [Point<S>],
    start_strain: &'a [[Eight<S>; 6]],
    dt: f64,
    loads: &'a Shared<'a, Point<S>>,
}

impl<S: Real, W: Law, const VISCOUS: bool> TetPass<S> for OfLaw<'_, Forces<'_, S>, W, VISCOUS> {
    #[inline(always)]
    fn block<L: Lanes<Real = S>>(&self, tets: &Block<'_, S>) {
        let Forces { x, start_strain, dt, loads } = *self.pass;
        let (_, _, response) = respond::<S, L, W, VISCOUS>(tets, x, start_strain, dt);
        let volume = tets.volume::<L>() * L::from_f64(dt * dt);
        let forces = internal_forces(&response.piola, &tets.shape(), volume);
        // SAFETY: the piece has copies of its own, and one thread does all of it.
        unsafe { tets.add_in_order(loads, &forces) };
    }
}

struct Changes<'a, S> {
    from: &'a [Point<S>],
    to: &'a [Point<S>],
    start_strain: &'a [[Eight<S>; 6]],
    dt: f64,
    sum: Cell<Change>,
}

impl<S: Real, W: Law, const VISCOUS: bool> TetPass<S> for OfLaw<'_, Changes<'_, S>, W, VISCOUS> {
    #[inline(always)]
    fn block<L: Lanes<Real = S>>(&self, tets: &Block<'_, S>) {
        let Changes { from, to, start_strain, dt, ref sum } = *self.pass;
        let (before, mut moved) = (tets.corners::<L>(from).x, tets.corners::<L>(to).x);
        for corner in 0..4 {
            moved[corner] -= before[corner];
        }
        let shape = tets.shape::<L>();
        let f = deformation_gradient(&before, &shape);
        let d = deformation_gradient(&moved, &shape);
        let tissue = Tissue::new(W::MODEL, &tets.material(), dt);
        let mut start = [L::ZERO; 6];
        let is_viscous = VISCOUS && tets.is_viscous();
        if is_viscous {
            start = load_rows(start_strain[tets.index].as_flattened(), tets.lane);
        }
        let change = tissue.energy_change_of::<W>(&f, &d, is_viscous.then_some(&start));
        let volume = tets.volume::<L>() * L::from_f64(dt * dt);
        let mut changes = [S::ZERO; LANES];
        (volume * change).store(&mut changes, tets.lane);
        let mut all = sum.get();
        for lane in tets.lane..(tets.lane + L::WIDTH).min(tets.filled()) {
            let change = changes[lane].to_f64();
            all.potential += change;
            all.size += change.abs();
        }
        sum.set(all);
    }
}

/// Adds the change of what a part's elements of one kind store, in double precision.
fn element_changes<S: Real, K: Kind<N, M>, const N: usize, const M: usize>(
    set: &ElementSet<S, K, N, M>,
    change: &mut Change,
    squared: f64,
    way: &Way<'_, S>,
    part: &Part,
) {
    for i in set.of_part(part) {
        let from = set.places(i, way.from).map(|x| x.cast::<f64>());
        let to = set.places(i, way.to);
        let moved: [Vec3<f64>; N] = std::array::from_fn(|a| to[a].cast::<f64>() - from[a]);
        let term = set.element::<f64>(i, &way.moments).energy_change(&from, &moved);
        *change = change.plus(Change::of(squared * term));
    }
}

/// The gradient by some vertices, and its slope.
fn vertex_gradient<S: Real>(
    constants: &StepConstants<S>,
    layout: &Layout<S>,
    way: &Way<'_, S>,
    loads: &[Point<S>],
    range: Range<usize>,
    gradient: &mut [Vec3<S>],
) -> f64 {
    let mut slope = 0.0;
    for (v, into) in range.zip(gradient) {
        if constants.inverse_masses[v] == S::ZERO {
            *into = Vec3::ZERO;
            continue;
        }
        let place = way.to[v].vec3();
        let away = place - constants.predicted[v].vec3();
        *into = away * constants.inertias[v] - gather(layout, loads, v).vec3();
        slope += into.dot(place - way.from[v].vec3()).to_f64();
    }
    slope
}

/// The change of inertia's part of the potential by some vertices.
fn vertex_change<S: Real>(
    constants: &StepConstants<S>,
    way: &Way<'_, S>,
    range: Range<usize>,
) -> Change {
    let free = range.filter(|&v| constants.inverse_masses[v] != S::ZERO);
    free.fold(Change::default(), |sum, v| {
        let away = (way.to[v].vec3() - constants.predicted[v].vec3()).cast::<f64>();
        let moved = way.to[v].vec3().cast::<f64>() - way.from[v].vec3().cast::<f64>();
        let term = constants.inertias[v].to_f64() * moved.dot(away - moved * 0.5);
        sum.plus(Change::of(term))
    })
}
