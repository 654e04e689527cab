//! The CPU backend: carries out the stages of a plan.
#![allow(unsafe_code)]

use super::Inputs;
use super::StepError;
use super::acceleration::{Anderson, Chebyshev};
use super::energy::Energy;
use super::explicit::Stability;
use super::guard::Guard;
use super::iterates::Iterate;
use super::loads::load_multipliers;
use super::plan::Stage;
use super::potential::{Evaluator, measure_strain};
use super::sweep::solve_color;
use super::tethers::{Bundle, bundle};
use super::threads::{Shared, Workers};
use crate::model::Model;
use crate::scalar::lanes::{Eight, LANES, Point};
use crate::scalar::{Real, Vec3};
use crate::settings::{Acceleration, AndersonOn, Method, SolverSettings, Start};
use crate::state::State;

/// The rebase multiplies an error of curvature `k` by `1 - k/mh`: stable from `mh >= k/2` on, so little
/// more than half of the bound will do, and inertia is regained nearly twice as fast. With less, stiff
/// and nearly incompressible tissue no longer settles in 5 sweeps; with all of it a bar that is dropped
/// lags two to three times as far behind. Where vertices have copies, their sweeps need the whole bound.
pub(super) fn bound_share<S: Real>(model: &Model<S>) -> f64 {
    if model.is_split() { 1.0 } else { 0.6 }
}

/// Vertices that a thread does at a time.
const GRAIN: usize = 2048;

/// What a stage may look at but not change.
pub(super) struct Step<'a, S> {
    pub model: &'a Model<S>,
    pub inputs: &'a Inputs<S>,
    pub dt: f64,
    pub settings: &'a SolverSettings,
    /// Of an explicit method in this step.
    pub small_steps: u32,
}

impl<S> Step<'_, S> {
    /// [s].
    pub fn small_dt(&self) -> f64 {
        self.dt / f64::from(self.small_steps)
    }
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
    pub ground: Ground<S>,
    /// Positions [m]; with each travels the inverse mass of its copies during a sweep [1/kg].
    pub points: Vec<Point<S>>,
    /// Velocities [m/s].
    pub velocities: Vec<Vec3<S>>,
    /// Of each part of the model; empty where steps are not guarded.
    pub energies: Vec<Energy>,
    pub evaluator: Evaluator<S>,
    /// Points of the copies; empty where nothing is split.
    pub copies: Vec<Point<S>>,
    /// What constraints put on each copy: impulse [N s^2] and bound [kg]; empty where no stage needs
    /// it.
    pub loads: Vec<Point<S>>,
    /// Iterate before the sweep, and the one before that.
    pub iterate: [Iterate<S>; 2],
    /// Weights of the norm in which iterates are compared, three of each vertex (its mass, in
    /// Anderson's norm where positions count) and then of the multipliers (the diagonal of `a~`).
    pub norm_weights: Vec<S>,
    /// The share of the rebase that is applied.
    rebase_factor: S,
    /// The share of the mass bounds that counts.
    bound_share: S,
    pub chebyshev: Chebyshev,
    pub anderson: Anderson<S>,
    /// Positions that Anderson has mixed [m].
    pub mixed: Vec<S>,
    /// Empty where steps are not guarded.
    pub guard: Guard<S>,
    /// Of an explicit method.
    pub stability: Stability,
    /// Small steps done in this step.
    pub small_step: u32,
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
        let anderson = acceleration == Acceleration::Anderson;
        let needs_loads = explicit
            || settings.rebase
            || (anderson && settings.anderson_on == AndersonOn::Multipliers);
        let window = settings.anderson_window as usize;
        let length = if anderson { 3 * vertices + model.multiplier_count } else { 0 };
        let guarded = settings.guards_steps();
        let strains = |set: &crate::model::TetSet<S>| {
            vec![[[S::ZERO; LANES]; 6]; if set.viscous { set.block_count() } else { 0 }]
        };
        Self {
            sizes: sizes(model).map(|(_, size)| size),
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
            energies: vec![Energy::default(); if guarded { model.component_count } else { 0 }],
            evaluator: Evaluator::new(guarded.then_some(model)),
            copies: vec![Point::default(); if model.is_split() { model.copy_count() } else { 0 }],
            loads: vec![Point::default(); if needs_loads { model.copy_count() } else { 0 }],
            iterate: [iterate(accelerated), iterate(acceleration == Acceleration::Chebyshev)],
            norm_weights: vec![
                S::ZERO;
                if accelerated { 3 * vertices + model.multiplier_count } else { 0 }
            ],
            rebase_factor: S::from_f64(rebase_factor(model, settings)),
            bound_share: S::from_f64(bound_share(model)),
            chebyshev: Chebyshev::default(),
            anderson: Anderson::new(window, length),
            mixed: vec![S::ZERO; if anderson { 3 * vertices } else { 0 }],
            guard: Guard::new(if guarded { vertices } else { 0 }),
            stability: Stability::new(explicit.then_some(model), settings),
            small_step: 0,
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
            + size_of_val(&self.norm_weights[..])
            + size_of_val(&self.mixed[..])
            + size_of_val(&self.energies[..])
            + size_of_val(&self.start_velocities[..])
            + self.stability.bytes()
            + self.evaluator.bytes()
            + self.anderson.bytes()
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
                measure_strain(workers, step.model, &self.points, strains);
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
            Stage::Rebase => self.rebase(step.model),
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
                Start::Inertial => inertial,
                Start::Predicted | Start::Auto => predicted,
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
            if matches!(start, Start::Predicted | Start::Auto) {
                self.points[v].set_vec3(predicted);
            }
        }
        for pin in &step.inputs.pins {
            self.points[model.numbering.of(pin.vertex)].set_vec3(pin.target);
        }
    }

    /// Stabilised rebase: pulls positions back onto `M (x - xt) = J(x)^T l`, from which path
    /// dependence drives them, by one damped step in the metric `mh`, a share of the bound of the
    /// geometric stiffness above the mass.
    fn rebase(&mut self, model: &Model<S>) {
        let (factor, share) = (self.rebase_factor, self.bound_share);
        let (ground, loads) = (&self.ground, &self.loads);
        self.ground.each_vertex(&mut self.points, |v, point| {
            if ground.inverse_masses[v] == S::ZERO {
                return;
            }
            let load = gather(model, loads, v);
            let mass = ground.inertias[v];
            let residual = (point.vec3() - ground.predicted[v].vec3()) * mass - load.vec3();
            let inverse = S::ONE / (mass + load.w * share);
            let x = point.vec3() - residual * (factor * inverse);
            *point = Point::new(x, inverse * copy_count(model, v));
        });
    }

    fn recompute_positions(&mut self, model: &Model<S>) {
        let (ground, loads) = (&self.ground, &self.loads);
        self.ground.each_vertex(&mut self.points, |v, point| {
            let inverse_mass = ground.inverse_masses[v];
            if inverse_mass != S::ZERO {
                let impulse = gather(model, loads, v).vec3();
                point.set_vec3(ground.predicted[v].vec3() + impulse * inverse_mass);
            }
        });
    }

    fn split_copies(&mut self, model: &Model<S>) {
        for (v, point) in self.points.iter().enumerate() {
            self.copies[copies_of(model, v)].fill(*point);
        }
    }

    /// Averages the changes of the copies, not the copies: the mean of equal numbers is then that
    /// number, and a vertex nobody moved stays where it is to the bit.
    fn join_copies(&mut self, model: &Model<S>) {
        let copies = &self.copies;
        self.ground.each_vertex(&mut self.points, |v, point| {
            let range = copies_of(model, v);
            let share = S::ONE / S::from_f64(range.len() as f64);
            let x = point.vec3();
            let mut sum = Vec3::ZERO;
            for copy in &copies[range] {
                sum += copy.vec3() - x;
            }
            point.set_vec3(x + sum * share);
        });
    }
}

impl<S: Real> Ground<S> {
    /// `change` on every vertex's point.
    pub fn each_vertex(
        &self,
        points: &mut [Point<S>],
        change: impl Fn(usize, &mut Point<S>) + Sync,
    ) {
        let points = Shared::new(points);
        self.workers.each(points.len(), GRAIN, |range| {
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
        points: &mut [Point<S>],
        velocities: &mut [Vec3<S>],
        change: impl Fn(usize, &mut Point<S>, &mut Vec3<S>) + Sync,
    ) {
        let velocities = Shared::new(velocities);
        self.each_vertex(points, |v, point| {
            // SAFETY: every vertex is worked on once.
            change(v, point, unsafe { velocities.at(v) });
        });
    }
}

/// Sum of a vertex's loads, in the order of its copies.
pub(super) fn gather<S: Real>(model: &Model<S>, loads: &[Point<S>], v: usize) -> Point<S> {
    let mut sum = Point::default();
    for load in &loads[copies_of(model, v)] {
        sum.add(*load);
    }
    sum
}

/// Places for the energies of single tetrahedra: needed where they belong to different parts.
pub(super) fn energy_slots<S: Real>(model: &Model<S>) -> usize {
    let blocks: usize = model.tet_sets().into_iter().map(|set| set.block_count()).sum();
    if model.component_count > 1 { LANES * blocks } else { 0 }
}

/// Everything in a model that decides how much memory a step needs and which stages it has.
pub(super) fn sizes<S: Real>(model: &Model<S>) -> [(&'static str, usize); 11] {
    let viscous = model.tet_sets().map(|set| if set.viscous { set.len() } else { 0 });
    [
        ("solver's list of vertices", model.vertex_count()),
        ("solver's list of multipliers", model.multiplier_count),
        ("solver's list of parts", model.component_count),
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

/// The more copies a vertex has, the further a sweep's primal part runs ahead of its multipliers;
/// slowing the rebase alone restores the balance and leaves the fixed point where it is. 1, 1/2
/// and 1/4 are the largest powers of two that settled in every scene tried.
pub(super) fn rebase_factor<S: Real>(model: &Model<S>, settings: &SolverSettings) -> f64 {
    match (settings.rebase_factor > 0.0, model.is_split(), model.color_count) {
        (true, ..) => settings.rebase_factor,
        (_, false, _) => 1.0,
        (_, true, 1) => 0.25,
        (_, true, _) => 0.5,
    }
}

fn copy_count<S: Real>(model: &Model<S>, v: usize) -> S {
    S::from_f64(copies_of(model, v).len() as f64)
}

fn copies_of<S: Real>(model: &Model<S>, v: usize) -> std::ops::Range<usize> {
    model.copy_offsets[v] as usize..model.copy_offsets[v + 1] as usize
}
