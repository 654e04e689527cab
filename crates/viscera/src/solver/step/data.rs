//! The data of a step, vertices in the solver's numbering: what every stage may read, and what the stages of
//! all methods change.
#![allow(unsafe_code)]

use super::contacts::{ContactStep, Contacts};
use super::groups::Groups;
use super::recovered::RecoveredTets;
use super::tethers::Bundle;
use crate::elements::law::LAWS;
use crate::layout::{Before, Moments};
use crate::layout::{Layout, Part, TetSet};
use crate::scalar::lanes::{Eight, LANES, Point};
use crate::scalar::{Real, Vec3};
use crate::settings::SolverSettings;
use crate::solver::cpu::threads::{Shared, Workers};
use crate::solver::inputs::Inputs;

/// Vertices that a thread does at a time.
const GRAIN: usize = 2048;

/// Data that a stage may read but not change.
pub struct Step<'a, S> {
    pub layout: &'a Layout<S>,
    pub inputs: &'a Inputs<S>,
    pub dt: f64,
    pub settings: &'a SolverSettings,
}

impl<'a, S> Step<'a, S> {
    /// What contact knows of it.
    pub fn contact(&self) -> ContactStep<'a, S> {
        ContactStep {
            layout: self.layout,
            tools: &self.inputs.tools,
            pins: &self.inputs.pins,
            dt: self.dt,
        }
    }
}

/// Green strain at the start of the step of the blocks of viscous sets, law by law.
pub type StartStrain<S> = [Vec<[Eight<S>; 6]>; LAWS];

/// Data that stay the same from the prediction to the end of a step, and the threads that work on it.
#[derive(Clone, Debug)]
pub struct StepConstants<S> {
    pub workers: Workers,
    /// Positions at the start of the step [m].
    pub previous: Vec<Point<S>>,
    /// Inertial prediction `xt` [m], of pinned vertices too.
    pub predicted: Vec<Point<S>>,
    /// External forces [N] without gravity.
    pub external: Vec<Vec3<S>>,
    /// Masses [kg].
    pub masses: Vec<S>,
    /// Soft position constraints, one for a vertex that has any.
    pub tethers: Vec<Bundle<S>>,
    /// `m'`: masses with the stiffness of tethers [kg]; see [`super::tethers`].
    pub inertias: Vec<S>,
    /// `1/m'`, zero where pinned [1/kg].
    pub inverse_masses: Vec<S>,
    /// See [`StartStrain`].
    pub start_strain: StartStrain<S>,
    /// Where the layout has recovered-gradient tetrahedra.
    pub recovered: Option<RecoveredTets<S>>,
    /// Velocities at the start of the step [m/s], once they have given way to those of its end.
    pub before: Vec<Vec3<S>>,
    /// Of samples and tools.
    pub contacts: Contacts,
    /// Parts that touch each other.
    pub groups: Groups,
}

/// Data that measures of a step need after its end: values that every backend fills. Vertices in the solver's
/// numbering.
pub struct EndOfStep<'a, S> {
    /// See [`StepConstants::previous`].
    pub previous: &'a [Point<S>],
    /// See [`StepConstants::predicted`].
    pub predicted: &'a [Point<S>],
    /// See [`StepConstants::inertias`].
    pub inertias: &'a [S],
    /// See [`StepConstants::inverse_masses`].
    pub inverse_masses: &'a [S],
    /// See [`StepConstants::tethers`].
    pub tethers: &'a [Bundle<S>],
    /// See [`StartStrain`].
    pub start_strain: &'a mut StartStrain<S>,
    /// Where tetrahedra are recovered-gradient tetrahedra.
    pub recovered: Option<OfRecovered<'a, S>>,
    /// Of samples and tools, where those are at the end of the step.
    pub contacts: &'a Contacts,
}

/// What measures of recovered-gradient tetrahedra work with: the step's own, which every step fills anew.
pub struct OfRecovered<'a, S> {
    pub workers: &'a Workers,
    pub tets: &'a mut RecoveredTets<S>,
    /// Places [m], shape [vertex_count].
    pub points: &'a mut [Point<S>],
    /// Shape [copy_count].
    pub loads: &'a mut [Point<S>],
}

/// Data that the stages of every method work on.
#[derive(Clone, Debug)]
pub struct StepData<S> {
    pub constants: StepConstants<S>,
    /// Positions [m]; with each travels the inverse mass of its copies during a sweep [1/kg].
    pub points: Vec<Point<S>>,
    /// Velocities [m/s].
    pub velocities: Vec<Vec3<S>>,
    /// The load of elements on each copy: impulse [N s^2] and bound [kg]; empty where no stage needs it.
    pub loads: Vec<Point<S>>,
}

impl<S: Real> StepData<S> {
    /// Memory for the steps of a model, with room for loads where stages of the method need it.
    pub fn new(layout: &Layout<S>, settings: &SolverSettings, needs_loads: bool) -> Self {
        let vertices = layout.vertex_count();
        let points = || vec![Point::default(); vertices];
        let strains = |set: &TetSet<S>| {
            vec![[[S::ZERO; LANES]; 6]; if set.viscous { set.block_count() } else { 0 }]
        };
        Self {
            constants: StepConstants {
                workers: Workers::new(settings.threads, layout.tet_count()),
                previous: points(),
                predicted: points(),
                external: vec![Vec3::ZERO; vertices],
                masses: layout.numbering.order.iter().map(|&v| layout.masses[v as usize]).collect(),
                tethers: Vec::new(),
                inertias: vec![S::ZERO; vertices],
                inverse_masses: vec![S::ZERO; vertices],
                start_strain: layout.tet_sets.each_ref().map(strains),
                recovered: layout
                    .recovered
                    .as_ref()
                    .map(|tables| RecoveredTets::new(layout, tables)),
                before: vec![Vec3::ZERO; vertices],
                contacts: Contacts::new(layout),
                groups: Groups::alone(layout.part_count()),
            },
            points: points(),
            velocities: vec![Vec3::ZERO; vertices],
            loads: vec![Point::default(); if needs_loads { layout.copy_count() } else { 0 }],
        }
    }

    /// Bytes of all arrays.
    pub fn bytes(&self) -> usize {
        let StepConstants {
            previous,
            predicted,
            external,
            before,
            masses,
            inertias,
            inverse_masses,
            ..
        } = &self.constants;
        let points = [&self.points, previous, predicted, &self.loads];
        points.into_iter().map(|points| size_of_val(&points[..])).sum::<usize>()
            + [external, before, &self.velocities]
                .map(|v| size_of_val(&v[..]))
                .iter()
                .sum::<usize>()
            + [masses, inertias, inverse_masses].map(|m| size_of_val(&m[..])).iter().sum::<usize>()
            + self.constants.start_strain.iter().map(|s| size_of_val(&s[..])).sum::<usize>()
            + self.constants.recovered.as_ref().map_or(0, RecoveredTets::bytes)
            + self.constants.contacts.bytes()
            + self.constants.groups.bytes()
    }

    /// For measures of the step.
    pub fn end_of_step(&mut self) -> EndOfStep<'_, S> {
        let Self { constants, points, loads, .. } = self;
        let StepConstants {
            previous, predicted, inertias, inverse_masses, tethers, contacts, ..
        } = constants;
        let (workers, start_strain) = (&constants.workers, &mut constants.start_strain);
        let recovered = constants.recovered.as_mut();
        EndOfStep {
            previous,
            predicted,
            inertias,
            inverse_masses,
            tethers,
            start_strain,
            recovered: recovered.map(|tets| OfRecovered { workers, tets, points, loads }),
            contacts,
        }
    }

    /// Positions of the state, in the solver's numbering.
    pub fn read_positions(&mut self, layout: &Layout<S>, positions: &[Vec3<S>]) {
        for (point, &user) in self.points.iter_mut().zip(&layout.numbering.order) {
            point.set_vec3(positions[user as usize]);
        }
    }
}

impl<S: Real> StepConstants<S> {
    /// The data that elements depend on in a step.
    pub fn moments<'a>(&'a self, step: &Step<'a, S>) -> Moments<'a, S> {
        Moments {
            anchors: step.inputs.anchors_of(&step.layout.rest_anchors),
            start: Before::Places(&self.previous),
            dt: step.dt,
        }
    }

    /// Whether a pin, an attachment, a tether or a tool holds a part.
    pub fn holds(&self, number: usize, part: &Part) -> bool {
        self.contacts.presses(number) || self.is_fixed(part)
    }

    /// Whether a part that nothing else holds lies on tools, or on other tissue.
    pub fn lies_on_others(&self, number: usize, part: &Part) -> bool {
        let presses = self.contacts.presses(number) || self.contacts.pairs.presses(number);
        presses && !self.is_fixed(part)
    }

    /// Whether a part does not fall: something holds it, or tissue that may fall as well.
    pub fn rests(&self, number: usize, part: &Part) -> bool {
        self.contacts.pairs.presses(number) || self.holds(number, part)
    }

    /// Whether a pin, an attachment or a tether holds a part.
    fn is_fixed(&self, part: &Part) -> bool {
        let mut inverse_masses = self.inverse_masses[part.vertices.clone()].iter();
        part.is_anchored()
            || !self.tethers_of(part).is_empty()
            || inverse_masses.any(|inverse| *inverse == S::ZERO)
    }

    /// The tethers of a part.
    pub fn tethers_of(&self, part: &Part) -> &[Bundle<S>] {
        let place = |v: usize| self.tethers.partition_point(|tether| tether.vertex < v);
        &self.tethers[place(part.vertices.start)..place(part.vertices.end)]
    }

    /// `change` on the point of every vertex of a part.
    pub fn each_vertex(
        &self,
        part: &Part,
        points: &mut [Point<S>],
        change: impl Fn(usize, &mut Point<S>) + Sync,
    ) {
        let (first, points) = (part.vertices.start, Shared::new(points));
        self.workers.each(part.vertices.len(), GRAIN, |range| {
            let range = first + range.start..first + range.end;
            // SAFETY: every vertex is worked on once.
            let piece = unsafe { points.range(range.clone()) };
            for (v, point) in range.zip(piece) {
                change(v, point);
            }
        });
    }

    /// As [`StepConstants::each_vertex`], with the vertex's velocity.
    pub fn each_vertex_with(
        &self,
        part: &Part,
        points: &mut [Point<S>],
        velocities: &mut [Vec3<S>],
        change: impl Fn(usize, &mut Point<S>, &mut Vec3<S>) + Sync,
    ) {
        let velocities = Shared::new(velocities);
        self.each_vertex(part, points, |v, point| {
            // SAFETY: every vertex is worked on once.
            change(v, point, unsafe { velocities.at(v) });
        });
    }
}

/// The copies of one of the solver's vertices.
pub fn copies_of<S: Real>(layout: &Layout<S>, v: usize) -> std::ops::Range<usize> {
    layout.copy_offsets[v] as usize..layout.copy_offsets[v + 1] as usize
}

/// Sum of a vertex's loads, in the order of its copies.
pub fn gather<S: Real>(layout: &Layout<S>, loads: &[Point<S>], v: usize) -> Point<S> {
    let mut sum = Point::default();
    for load in &loads[copies_of(layout, v)] {
        sum.add(*load);
    }
    sum
}

/// How many copies one of the solver's vertices has.
pub fn copy_count<S: Real>(layout: &Layout<S>, v: usize) -> S {
    S::from_f64(copies_of(layout, v).len() as f64)
}
