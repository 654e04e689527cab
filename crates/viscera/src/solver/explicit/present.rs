//! The stiffness of the present shape, and the small steps that follow from it.
//!
//! ```text
//! k_i = sum_(e at i) c rho(K_e) B(F_e)/B(I),   d2W/dF2 <= B(F)      omega^2 <= max_i k_i/m_i
//! ```
//!
//! The pass that adds up forces adds up `k_i` beside them, in every second small step, and in each where motion is
//! violent. What ends in the middle between two places where forces are taken can be of any length: small steps are divided
//! anew as soon as they come too close to the limit.
//!
//! Two remedies for violent motion, which explicit steps would follow for ever, since they lose no energy. A part of which
//! a tetrahedron is inside out, or that has stiffened a lot, takes its forces ahead of its places: `f(x + tau v)` is
//! `f(x) - tau K v`, viscosity for nothing, until it has calmed down. And a vertex that is too stiff for the shortest small
//! step gives up its speed and goes where its forces lead: `x += f/k`, downhill, since `K <= diag(k_i I)`.
#![allow(unsafe_code)]

use super::stability::{Stability, element_stiffness};
use crate::elements::kinds::{Energy, Kind};
use crate::elements::law::{LAWS, Law, with_law};
use crate::layout::{ElementSet, Layout, Part, TetSet};
use crate::model::for_each_kind;
use crate::scalar::lanes::{Eight, LANES, Point};
use crate::scalar::{Mat3, Real};
use crate::solver::cpu::threads::Shared;
use crate::solver::step::data::{StepConstants, copies_of};
use crate::solver::step::groups::Groups;

/// The share of the largest stable step of the present shape above which small steps are divided anew. Larger ones follow
/// violent motion less well, since stiffness grows on until the next; with smaller ones more scenes leave the steps that
/// suit their shape at rest.
const LARGEST_SHARE: f64 = 0.7;

/// Small steps are at most so many times shorter than those of the shape at rest: what a violent grab costs at most. With
/// half as many half as many tetrahedra again stay inside out after violent grabs.
const SHORTEST: f64 = 16.0;

/// A vertex gives up its speed where `omega^2` times kick and drift is larger: four is unstable. More where the settings' own
/// small steps have more than that at rest.
const STIFFEST: f64 = 3.0;

/// A part is in violent motion where a tetrahedron is inside out, or where it has stiffened so much that small steps have to
/// be so many times shorter than at rest: tissue that falls far stays below.
const VIOLENT: f64 = 3.0;

/// The share of the stable step that parts in violent motion take at most.
const VIOLENT_SHARE: f64 = 0.5;

/// Parts in violent motion take forces so many small steps ahead of their places: as much as is stable with twice the small
/// steps, `1/4 + 0.5/2 < 1`.
const AHEAD: f64 = 0.5;

/// Parts in calm motion look for the stiffness of their shape in every second small step: it changes little in between, and
/// finding it costs a fifth of a pass.
const LOOKS: u32 = 2;

/// Parts in calm motion that something holds take forces so many small steps ahead: the fastest oscillations are gone within
/// 50 small steps, and half a second of the slowest loses less than a thousandth of its way.
const CALM: f64 = 0.02;

/// How many small steps ahead of its place a part takes forces in calm motion: none where nothing holds it, because that would
/// brake its spin.
pub fn calm_ahead(is_held: bool) -> f64 {
    if is_held { CALM } else { 0.0 }
}

/// Vertices whose stiffest is found first.
const PIECE: usize = 1024;

/// What of the stiffness does not depend on the shape.
#[derive(Clone, Debug)]
pub struct AtRest<S> {
    /// `rho(K_e)/B(I)` [m], block by block, law by law.
    pub tets: [Vec<Eight<S>>; LAWS],
    /// Of other elements, at each vertex, beside the curvature that comes with their forces [N/m]; the solver's order.
    others: Vec<S>,
    /// The stiffest of each piece of vertices.
    partial: Vec<f64>,
}

impl<S: Real> AtRest<S> {
    /// Of a model.
    pub fn new(layout: &Layout<S>, stability: &Stability) -> Self {
        let mut others = vec![0.0; layout.vertex_count()];
        for_each_kind!(layout, set => add_others(set, layout, &mut others));
        let most = layout.parts.iter().map(|part| part.vertices.len().div_ceil(PIECE)).max();
        Self {
            tets: std::array::from_fn(|law| of_tets(layout, stability, &layout.tet_sets[law])),
            others: others.into_iter().map(S::from_f64).collect(),
            partial: vec![0.0; most.unwrap_or(0)],
        }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        let tets: usize = self.tets.iter().map(|blocks| size_of_val(&blocks[..])).sum();
        tets + size_of_val(&self.others[..]) + size_of_val(&self.partial[..])
    }

    /// Adds up what is loaded on each vertex of a part, into its first copy, with `(omega h)^2` in place of the bound;
    /// returns the largest of these, `h` [s] being the small step of the loads.
    pub fn gather(
        &mut self,
        constants: &StepConstants<S>,
        layout: &Layout<S>,
        part: &Part,
        h: f64,
        loads: &mut [Point<S>],
    ) -> f64 {
        let Self { others, partial, .. } = self;
        let (first, squared) = (part.vertices.start, S::from_f64(h * h));
        let shared = Shared::new(loads);
        let stiffest = |vertices: std::ops::Range<usize>| {
            let mut largest = S::ZERO;
            for v in vertices.start + first..vertices.end + first {
                // SAFETY: every vertex, and with it its copies, is worked on once.
                let copies = unsafe { shared.range(copies_of(layout, v)) };
                let mut sum = Point::default();
                copies.iter().for_each(|load| sum.add(*load));
                sum.w = (sum.w + others[v] * squared) * constants.inverse_masses[v];
                largest = largest.max(sum.w);
                copies[0] = sum;
            }
            largest.to_f64()
        };
        let pieces = (part.vertices.len(), PIECE);
        constants.workers.reduce(pieces, partial, stiffest, f64::max).unwrap_or(0.0)
    }
}

/// `c rho(K_e)/B(I)` [m] of a set.
fn of_tets<S: Real>(layout: &Layout<S>, stability: &Stability, set: &TetSet<S>) -> Vec<Eight<S>> {
    let mut blocks = vec![[S::ZERO; LANES]; set.block_count()];
    for ((block, lane), tet) in set.places().zip(layout.tets(set)) {
        let material = &layout.materials[tet.material];
        let lame = [material.lame_lambda, material.lame_mu].map(Real::to_f64);
        let largest = element_stiffness(&tet.inverse_rest_shape.cast::<f64>(), lame);
        let at_rest =
            with_law!(set.model, L => L::stiffness(&Mat3::<f64>::IDENTITY, lame[0], lame[1]));
        let share = stability.share(layout.part_at(layout.numbering.of(tet.vertices[0])));
        let volume = tet.rest_volume.to_f64();
        blocks[block][lane] = S::from_f64(share * volume * largest / at_rest);
    }
    blocks
}

/// Adds what the elements of one kind are stiffer by than their curvature says [N/m].
fn add_others<S: Real, K: Kind<N, M>, const N: usize, const M: usize>(
    set: &ElementSet<S, K, N, M>,
    layout: &Layout<S>,
    others: &mut [f64],
) {
    for (i, vertices) in set.vertices.iter().enumerate() {
        let element = set.list.element::<f64>(i, &layout.rest_anchors);
        for &v in vertices {
            others[layout.numbering.of(v)] += element.stiffness() - element.curvature();
        }
    }
}

/// The small steps of a part in one step: as many as it needs, whatever others do.
///
/// Each takes forces in its middle: positions drift to there, velocities are kicked, positions drift on.
#[derive(Clone, Copy, Debug, Default)]
pub struct SmallSteps {
    part: usize,
    /// [s].
    pub dt: f64,
    /// Small steps to come, the one at whose middle the part is included.
    pub left: u32,
    /// The shortest that they may be [s].
    shortest: f64,
    /// Whether a tetrahedron is inside out where forces were taken last.
    pub is_inverted: bool,
    /// How far ahead of its place [s] forces are taken.
    pub ahead: f64,
    /// How many small steps ahead of its place forces are taken in calm motion.
    calm: f64,
    /// Small steps since the stiffness of the shape was found, of [`LOOKS`].
    pub since: u32,
    is_violent: bool,
    /// Whether the part was in violent motion at any time in the step.
    pub was_violent: bool,
}

/// What a part does in the middle of a small step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Move {
    /// The time for which forces act [s].
    pub kick: f64,
    /// The time for which velocities act [s]: to the middle of the next small step, or to the end of the last.
    pub drift: f64,
    /// What remains of the step after that [s].
    pub remains: f64,
    /// How far ahead of its place [s] the part was, and is afterwards.
    pub ahead: [f64; 2],
    /// `(omega h)^2` above which a vertex gives way as if it were heavier.
    pub stiffest: f64,
}

impl SmallSteps {
    /// So many of one part in a step of `dt` [s].
    pub fn new(part: usize, count: u32, dt: f64) -> Self {
        let small = dt / f64::from(count);
        let shortest = small / SHORTEST;
        Self { part, dt: small, left: count, shortest, ..Self::default() }
    }

    /// Of two parts that touch: the shorter small steps, and violent motion where one is in it.
    pub fn together(self, other: Self) -> Self {
        let chosen = if other.left > self.left { other } else { self };
        Self {
            is_inverted: self.is_inverted || other.is_inverted,
            was_violent: self.was_violent || other.was_violent,
            ..chosen
        }
    }

    /// Parts of a group take the same small steps.
    pub fn pool(all: &mut [Self], groups: &Groups) {
        groups.pool(all, Self::together);
        for (number, small) in all.iter_mut().enumerate() {
            *small = small.of(number);
        }
    }

    /// The same small steps, of another part.
    pub fn of(self, part: usize) -> Self {
        Self { part, ..self }
    }

    /// No step has more that would have so many at rest: divisions are rounded up, some a little below the shortest.
    pub fn most(count: u32) -> u32 {
        count.saturating_mul(2 * SHORTEST as u32).saturating_add(64)
    }

    /// What is left of the step [s] from a time [s] after the beginning of the next small step on, in small steps that are
    /// short enough for a part of which the largest `(omega h)^2` is known.
    fn divide(&mut self, stability: &Stability, squared: f64, done: f64) {
        let frequency = squared.sqrt() / self.dt;
        let limit = stability.limit(self.part, frequency);
        let rest = self.shortest * SHORTEST;
        let is_stiff = limit.is_nan() || rest > VIOLENT * stability.safety * limit;
        let is_violent = self.is_inverted || is_stiff;
        self.is_violent = is_violent;
        self.was_violent |= is_violent;
        let [share, largest] = match is_violent {
            true => [stability.safety.min(VIOLENT_SHARE); 2],
            false => [stability.safety, LARGEST_SHARE.max(stability.safety)],
        };
        self.ahead = self.dt * if is_violent { AHEAD } else { self.calm };
        // Not where the limit is no number.
        if self.dt <= largest * limit {
            return;
        }
        let small = (share * limit).max(self.shortest);
        let left = self.dt * (f64::from(self.left) - done);
        let count = (left / small + done).ceil().max(1.0);
        self.dt = left / (count - done);
        self.ahead = self.dt * if is_violent { AHEAD } else { self.calm };
        self.left = count as u32;
    }

    /// Before the first small step of a part that something holds or nothing.
    pub fn begin(&mut self, stability: &Stability, squared: f64, is_held: bool) {
        self.calm = calm_ahead(is_held);
        self.divide(stability, squared, 0.0);
        self.since = if self.is_violent { 0 } else { 1 };
    }

    /// Whether the stiffness of the present shape is found with the next forces.
    pub fn looks(&self) -> bool {
        self.since == 0
    }

    /// In the middle of a small step, at places where `(omega h)^2` is known if the part looked for it.
    pub fn advance(&mut self, stability: &Stability, squared: f64) -> Move {
        let (before, was_ahead) = (self.dt, self.ahead);
        let looked = self.looks();
        if looked {
            self.divide(stability, squared, 0.5);
        }
        self.since = if self.is_violent || self.is_inverted { 0 } else { (self.since + 1) % LOOKS };
        let viscosity = stability.viscosity(self.part);
        self.left -= 1;
        let drift = if self.left == 0 { 0.5 * self.dt } else { self.dt };
        let kick = 0.5 * (before + self.dt);
        // `omega^2 kick drift (1 + 2 eta/drift) <= 3`, in terms of the loads' small step.
        // Small steps that are asked for to be longer than usual are no reason, nor those that are longer than is stable.
        let share = stability.safety;
        let most = STIFFEST.max(4.2 * if viscosity > 0.0 { share } else { share * share });
        let stiffest = match looked {
            true => most * before * before / (kick * (self.dt + 2.0 * (viscosity + was_ahead))),
            false => f64::INFINITY,
        };
        let remains = self.dt * (f64::from(self.left) - 0.5).max(0.0);
        if self.left == 0 {
            self.ahead = 0.0;
        }
        Move { kick, drift, remains, ahead: [was_ahead, self.ahead], stiffest }
    }
}
