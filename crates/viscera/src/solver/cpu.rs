//! The CPU backend: carries out the stages of a plan.
#![allow(unsafe_code)]

use super::Inputs;
use super::StepError;
use super::acceleration::Chebyshev;
use super::energy::Energy;
use super::explicit::{SmallSteps, Stability};
use super::guard::Guard;
use super::iterates::{Iterate, Mixing};
use super::loads::load_multipliers;
use super::plan::Stage;
use super::potential::{Evaluator, measure_strain};
use super::rebase::copy_count;
use super::sweep::solve_color;
use super::tethers::{Bundle, bundle};
use super::threads::{Shared, Workers};
use std::sync::Arc;

use crate::model::{Model, Part};
use crate::scalar::lanes::{Eight, LANES, Point};
use crate::scalar::{Real, Vec3};
use crate::settings::{Acceleration, AndersonOn, Method, SolverSettings, Start};
use crate::state::State;

/// Vertices that a thread does at a time.
const GRAIN: usize = 2048;

/// What a stage may look at but not change.
pub(super) struct Step<'a, S> {
    pub model: &'a Model<S>,
    pub inputs: &'a Inputs<S>,
    pub dt: f64,
    pub settings: &'a SolverSettings,
}

/// Green strain at the start of the step of the blocks of viscous sets, `[green, neo]`.
pub(super) type StartStrain<S> = [Vec<[Eight<S>; 6]>; 2];

/// What stays the same from the prediction to the end of a step.
#[derive(Clone, Debug)]
pub(super) struct Ground<S> {
    pub workers: Workers,
    /// Positions at the start of the step [m].
    pub previous: Vec<Point<S>>,
    /// Inertial prediction `xt` [m], of pinned vertices too.
    pub predicted: Vec<Point<S>>,
    /// External forces [N] without gravity.
    pub external: Vec<Vec3<S>>,
    /// Masses [kg].
    pub masses: Vec<S>,
    /// Springs to places outside, one for a vertex that has any.
    pub tethers: Vec<Bundle<S>>,
    /// `m'`: masses, and what tethers make of them [kg]; see [`super::tethers`].
    pub inertias: Vec<S>,
    /// `1/m'`, zero where pinned [1/kg].
    pub inverse_masses: Vec<S>,
    /// See [`StartStrain`].
    pub start_strain: StartStrain<S>,
}

/// Everything a step needs beside model and state, vertices in the solver's numbering.
#[derive(Clone, Debug)]
pub(super) struct Workspace<S> {
    /// What [`sizes`] says of the model that this is for.
    sizes: [usize; 11],
    /// The connected parts of that model.
    parts: Arc<[Part]>,
    pub ground: Ground<S>,
    /// Positions [m]; with each travels the inverse mass of its copies during a sweep [1/kg].
    pub points: Vec<Point<S>>,
    /// Velocities [m/s].
    pub velocities: Vec<Vec3<S>>,
    /// Of each part of the model; empty where steps are not guarded.
    pub energies: Vec<Energy>,
    pub evaluator: Evaluator,
    /// Points of the copies; empty where nothing is split.
    pub copies: Vec<Point<S>>,
    /// What constraints put on each copy: impulse [N s^2] and bound [kg]; empty where no stage needs
    /// it.
    pub loads: Vec<Point<S>>,
    /// Iterate before the sweep, and the one before that.
    pub iterate: [Iterate<S>; 2],
    /// The diagonal of `a~` of every multiplier; empty but for Chebyshev.
    pub multiplier_weights: Vec<S>,
    /// Of each part, where it is in use.
    pub chebyshev: Vec<Chebyshev>,
    /// Of each part, where Anderson is in use.
    pub mixings: Vec<Mixing<S>>,
    /// Positions of a part that Anderson has mixed [m].
    pub mixed: Vec<S>,
    /// Empty where steps are not guarded.
    pub guard: Guard<S>,
    /// Of an explicit method.
    pub stability: Stability,
    /// Of each part in an explicit step; empty for other methods.
    pub small_steps: Vec<SmallSteps>,
    /// Velocities at the start of an explicit step [m/s]; empty for other methods.
    pub start_velocities: Vec<Vec3<S>>,
}

impl<S: Real> Workspace<S> {
    pub fn new(model: &Model<S>, settings: &SolverSettings) -> Self {
        let vertices = model.vertex_count();
        let explicit = settings.method == Method::Explicit;
        let acceleration = if explicit { Acceleration::None } else { settings.acceleration };
        let accelerated = acceleration != Acceleration::None;
        let points = |wanted: bool| vec![Point::default(); if wanted { vertices } else { 0 }];
        let iterate = |wanted: bool| Iterate {
            positions: points(wanted),
            multipliers: vec![S::ZERO; if wanted { model.multiplier_count } else { 0 }],
        };
        let chebyshev = acceleration == Acceleration::Chebyshev;
        let anderson = acceleration == Acceleration::Anderson;
        let needs_loads = explicit
            || settings.rebase
            || (anderson && settings.anderson_on == AndersonOn::Multipliers);
        let window = settings.anderson_window as usize;
        let parts = |wanted: bool| if wanted { &model.parts[..] } else { &[] };
        let largest = parts(anderson).iter().map(|part| part.vertices.len()).max().unwrap_or(0);
        let guarded = settings.guards_steps();
        let strains = |set: &crate::model::TetSet<S>| {
            vec![[[S::ZERO; LANES]; 6]; if set.viscous { set.block_count() } else { 0 }]
        };
        Self {
            sizes: sizes(model).map(|(_, size)| size),
            parts: Arc::clone(&model.parts),
            ground: Ground {
                workers: Workers::new(settings.threads, model.tet_count()),
                previous: points(true),
                predicted: points(true),
                external: vec![Vec3::ZERO; vertices],
                masses: model.numbering.order.iter().map(|&v| model.masses[v as usize]).collect(),
                tethers: Vec::new(),
                inertias: vec![S::ZERO; vertices],
                inverse_masses: vec![S::ZERO; vertices],
                start_strain: model.tet_sets().map(strains),
            },
            points: points(true),
            velocities: vec![Vec3::ZERO; vertices],
            energies: vec![Energy::default(); parts(guarded).len()],
            evaluator: Evaluator::new(guarded.then_some(model)),
            copies: vec![Point::default(); if model.is_split() { model.copy_count() } else { 0 }],
            loads: vec![Point::default(); if needs_loads { model.copy_count() } else { 0 }],
            iterate: [iterate(accelerated), iterate(chebyshev)],
            multiplier_weights: vec![S::ZERO; if chebyshev { model.multiplier_count } else { 0 }],
            chebyshev: vec![Chebyshev::default(); parts(chebyshev).len()],
            mixings: parts(anderson).iter().map(|part| Mixing::new(part, window)).collect(),
            mixed: vec![S::ZERO; 3 * largest],
            guard: Guard::new(guarded.then_some(model)),
            stability: Stability::new(explicit.then_some(model), settings),
            small_steps: vec![SmallSteps::default(); parts(explicit).len()],
            start_velocities: vec![Vec3::ZERO; if explicit { vertices } else { 0 }],
        }
    }

    /// Bytes of all arrays.
    pub fn bytes(&self) -> usize {
        let Ground { previous, predicted, external, masses, inertias, inverse_masses, .. } =
            &self.ground;
        let points = [&self.points, previous, predicted, &self.copies, &self.loads];
        let iterates = self.iterate.iter();
        points.into_iter().map(|points| size_of_val(&points[..])).sum::<usize>()
            + [external, &self.velocities].map(|v| size_of_val(&v[..])).iter().sum::<usize>()
            + [masses, inertias, inverse_masses].map(|m| size_of_val(&m[..])).iter().sum::<usize>()
            + self.ground.start_strain.iter().map(|s| size_of_val(&s[..])).sum::<usize>()
            + iterates.clone().map(|i| size_of_val(&i.positions[..])).sum::<usize>()
            + iterates.map(|i| size_of_val(&i.multipliers[..])).sum::<usize>()
            + size_of_val(&self.multiplier_weights[..])
            + size_of_val(&self.chebyshev[..])
            + size_of_val(&self.mixed[..])
            + size_of_val(&self.energies[..])
            + size_of_val(&self.start_velocities[..])
            + size_of_val(&self.small_steps[..])
            + self.stability.bytes()
            + self.evaluator.bytes()
            + self.mixings.iter().map(|m| size_of_val(m) + m.bytes()).sum::<usize>()
            + self.guard.bytes()
    }

    /// The model is one of the same shape as that for which the memory was taken, and its elements
    /// stay within that memory.
    pub fn check(&self, model: &Model<S>) -> Result<(), StepError> {
        for (given, (what, expected)) in self.sizes.into_iter().zip(sizes(model)) {
            if given != expected {
                return Err(StepError::Mismatch { what, given, expected });
            }
        }
        if !Arc::ptr_eq(&self.parts, &model.parts) && self.parts != model.parts {
            return Err(StepError::OtherParts);
        }
        // Of what decides where passes read and write, callers can change the number of vertices and
        // the form of a set. A set without copies of its own goes by vertices among copies as well.
        let vertices = model.vertex_count().min(model.copy_count());
        for set in model.tet_sets() {
            let [elastic, viscous] = set.multiplier_counts();
            for (what, given, expected) in [
                ("model's list of vertices", vertices, set.bounds[0]),
                ("model's list of copies", model.copy_count(), set.bounds[1]),
                // Both kinds are written side by side: neither reaches into the other's places.
                ("model's multipliers", set.viscous_offset, set.multiplier_offset + elastic),
                ("model's multipliers", model.multiplier_count, set.viscous_offset + viscous),
            ] {
                if given < expected {
                    return Err(StepError::Mismatch { what, given, expected });
                }
            }
        }
        Ok(())
    }

    pub fn run(&mut self, stage: &Stage, step: &Step<'_, S>, state: &mut State<S>) {
        match *stage {
            Stage::ReadState => self.read_state(step.model, state),
            Stage::MeasureStrain => {
                let ground = &mut self.ground;
                let (workers, strains) = (&ground.workers, &mut ground.start_strain);
                measure_strain(workers, step.model, None, &self.points, strains);
            }
            Stage::Predict(start) => self.predict(step, start),
            Stage::ResetMultipliers => {
                state.multipliers.fill(S::ZERO);
                self.start_acceleration(step, state);
            }
            Stage::RescaleMultipliers => {
                if state.multiplier_dt > 0.0 && state.multiplier_dt != step.dt {
                    let ratio = step.dt / state.multiplier_dt;
                    let factor = S::from_f64(ratio * ratio);
                    state.multipliers.iter_mut().for_each(|l| *l *= factor);
                }
                self.start_acceleration(step, state);
            }
            Stage::RememberIterate => self.remember_iterate(&state.multipliers),
            Stage::LoadCorners => {
                let workers = &self.ground.workers;
                let (x, l) = (&self.points, &state.multipliers);
                load_multipliers(workers, step.model, x, l, &mut self.loads);
            }
            Stage::Rebase => self.rebase(step),
            Stage::RecomputePositions => self.recompute_positions(step.model),
            Stage::SplitCopies => self.split_copies(step.model),
            Stage::SolveColor(color) => {
                let split = step.model.is_split();
                let points = if split { &mut self.copies } else { &mut self.points };
                let Ground { workers, start_strain, .. } = &self.ground;
                let multipliers = &mut state.multipliers;
                solve_color(workers, step, points, multipliers, start_strain, color as usize);
            }
            Stage::JoinCopies => self.join_copies(step.model),
            Stage::Chebyshev => self.chebyshev(step, &mut state.multipliers),
            Stage::Anderson(on) => self.anderson(step, &mut state.multipliers, on),
            Stage::ChooseStart => self.choose_start(step),
            Stage::GuardStep => self.guard_step(step),
            Stage::GuardIterate => self.guard_iterate(step, &mut state.multipliers),
            Stage::RepairMultipliers => self.repair_multipliers(step, &mut state.multipliers),
            Stage::UpdateVelocities => {
                let rate = S::from_f64(1.0 / step.dt);
                for (v, velocity) in self.velocities.iter_mut().enumerate() {
                    *velocity = (self.points[v].vec3() - self.ground.previous[v].vec3()) * rate;
                }
            }
            Stage::LimitEnergy => self.limit_energy(step),
            Stage::BeginExplicit => {
                state.multiplier_dt = step.dt;
                self.begin_explicit(step);
            }
            Stage::LoadForces => self.load_explicit_forces(step),
            Stage::AdvanceExplicit => self.advance_explicit(step),
            Stage::EndExplicit => self.end_explicit(step),
            Stage::WriteState => {
                for (v, &user) in step.model.numbering.order.iter().enumerate() {
                    state.positions[user as usize] = self.points[v].vec3();
                    state.velocities[user as usize] = self.velocities[v];
                }
            }
        }
    }

    pub(super) fn read_positions(&mut self, model: &Model<S>, state: &State<S>) {
        for (point, &user) in self.points.iter_mut().zip(&model.numbering.order) {
            point.set_vec3(state.positions[user as usize]);
        }
    }

    fn read_state(&mut self, model: &Model<S>, state: &State<S>) {
        self.read_positions(model, state);
        for (velocity, &user) in self.velocities.iter_mut().zip(&model.numbering.order) {
            *velocity = state.velocities[user as usize];
        }
    }

    /// External forces, inertias, and their inverses, which pins have none of.
    pub(super) fn prepare(&mut self, step: &Step<'_, S>) {
        let (model, ground) = (step.model, &mut self.ground);
        ground.external.fill(Vec3::ZERO);
        for &(vertex, force) in &step.inputs.forces {
            ground.external[model.numbering.of(vertex)] += force;
        }
        ground.inverse_masses.fill(S::ONE);
        for pin in &step.inputs.pins {
            ground.inverse_masses[model.numbering.of(pin.vertex)] = S::ZERO;
        }
        bundle(model, step.inputs, &mut ground.tethers);
        // Before they make anything heavier: what holds a pinned vertex holds its own weight.
        let inverse_masses = &ground.inverse_masses;
        ground.tethers.retain(|tether| inverse_masses[tether.vertex] != S::ZERO);
        ground.inertias.copy_from_slice(&ground.masses);
        // Small explicit steps take tethers as forces.
        if step.settings.method == Method::Xpbd {
            let squared = S::from_f64(step.dt * step.dt);
            for tether in &ground.tethers {
                ground.inertias[tether.vertex] += tether.stiffness * squared;
            }
        }
        for (inverse, &inertia) in ground.inverse_masses.iter_mut().zip(&ground.inertias) {
            if *inverse != S::ZERO {
                *inverse = S::ONE / inertia;
            }
        }
    }

    fn predict(&mut self, step: &Step<'_, S>, start: Start) {
        self.prepare(step);
        let (model, ground) = (step.model, &mut self.ground);
        let dt = S::from_f64(step.dt);
        for v in 0..model.vertex_count() {
            let x = self.points[v].vec3();
            let load = ground.external[v] * (S::ONE / ground.inertias[v]);
            let inertial = x + self.velocities[v] * dt;
            let predicted = inertial + (step.inputs.gravity + load) * (dt * dt);
            ground.previous[v].set_vec3(x);
            ground.predicted[v].set_vec3(predicted);
            let x = match start {
                Start::Previous => x,
                Start::Inertial | Start::Auto => inertial,
                Start::Predicted => predicted,
            };
            self.points[v] = Point::new(x, ground.inverse_masses[v] * copy_count(model, v));
        }
        for tether in &ground.tethers {
            let v = tether.vertex;
            let inertial = ground.previous[v].vec3() + self.velocities[v] * dt;
            let pull = tether.force(inertial + step.inputs.gravity * (dt * dt));
            let predicted =
                ground.predicted[v].vec3() + pull * (S::ONE / ground.inertias[v]) * (dt * dt);
            ground.predicted[v].set_vec3(predicted);
            if start == Start::Predicted {
                self.points[v].set_vec3(predicted);
            }
        }
        for pin in &step.inputs.pins {
            self.points[model.numbering.of(pin.vertex)].set_vec3(pin.target);
        }
        if start == Start::Auto {
            for part in model.parts.iter() {
                if !self.ground.holds(part) {
                    self.start_falling(step, part);
                }
            }
        }
    }

    /// Starts a part that nothing holds where its center of mass will be. Inner forces do not move that, so
    /// that no multiplier carries its acceleration; sweeps and a rebase that is not applied in full would
    /// find it in part only, and the guard would have to take the step back.
    fn start_falling(&mut self, step: &Step<'_, S>, part: &Part) {
        let ground = &self.ground;
        let (mut mass, mut force) = (0.0, Vec3::<f64>::ZERO);
        for v in part.vertices.clone() {
            mass += ground.masses[v].to_f64();
            force += ground.external[v].cast();
        }
        let dt = S::from_f64(step.dt);
        let acceleration = step.inputs.gravity + (force * (1.0 / mass)).cast();
        for v in part.vertices.clone() {
            let inertial = ground.previous[v].vec3() + self.velocities[v] * dt;
            self.points[v].set_vec3(inertial + acceleration * (dt * dt));
        }
    }
}

impl<S: Real> Ground<S> {
    /// Whether a pin, an attachment or a tether holds a part.
    pub fn holds(&self, part: &Part) -> bool {
        let mut inverse_masses = self.inverse_masses[part.vertices.clone()].iter();
        part.attachments().next().is_some()
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

    /// As [`Ground::each_vertex`], with the vertex's velocity.
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

/// Everything in a model that decides how much memory a step needs and which stages it has.
pub(super) fn sizes<S: Real>(model: &Model<S>) -> [(&'static str, usize); 11] {
    let viscous = model.tet_sets().map(|set| if set.viscous { set.len() } else { 0 });
    [
        ("solver's list of vertices", model.vertex_count()),
        ("solver's list of multipliers", model.multiplier_count),
        ("solver's list of parts", model.part_count()),
        ("solver's list of colors", model.color_count),
        ("solver's list of copies", model.copy_count()),
        ("solver's list of Saint Venant-Kirchhoff tetrahedra", model.green_strain.len()),
        ("solver's list of neo-Hookean tetrahedra", model.neo_hookean.len()),
        ("solver's blocks of Saint Venant-Kirchhoff tetrahedra", model.green_strain.block_count()),
        ("solver's blocks of neo-Hookean tetrahedra", model.neo_hookean.block_count()),
        ("solver's list of viscous Saint Venant-Kirchhoff tetrahedra", viscous[0]),
        ("solver's list of viscous neo-Hookean tetrahedra", viscous[1]),
    ]
}
