//! The CPU backend: carries out the stages of a plan.

use super::Inputs;
use super::StepError;
use super::acceleration::{Anderson, Chebyshev, chebyshev_update};
use super::energy::Energy;
use super::guard::Guard;
use super::plan::Stage;
use super::sweep::{Relaxation, Sweep, corners, read, read_vec3};
use crate::elements::{CornerLoad, TetForm, deformation_gradient, green_strain};
use crate::elements::{neo_hookean_pair, neo_hookean_stretch, spring};
use crate::model::Model;
use crate::scalar::{Real, Vec3};
use crate::settings::{Acceleration, AndersonGuard, AndersonOn, SolverSettings, Start};
use crate::state::State;

/// The rebase multiplies an error of curvature `k` by `1 - k/mh`: stable from `mh >= k/2` on, so little
/// more than half of the bound will do, and inertia is regained nearly twice as fast. With less, stiff
/// and nearly incompressible tissue no longer settles in 5 sweeps; with all of it a bar that is dropped
/// lags two to three times as far behind. Where vertices have copies, their sweeps need the whole bound.
fn bound_share<S: Real>(model: &Model<S>) -> f64 {
    if model.is_split() { 1.0 } else { 0.6 }
}

/// What a stage may look at but not change.
pub(super) struct Step<'a, S> {
    pub model: &'a Model<S>,
    pub inputs: &'a Inputs<S>,
    pub dt: f64,
    pub settings: &'a SolverSettings,
}

/// Everything a step needs beside model and state.
#[derive(Clone, Debug)]
pub(super) struct Workspace<S> {
    /// What [`sizes`] says of the model that this is for.
    sizes: [usize; 10],
    /// Positions at the start of the step [m].
    pub previous: Vec<Vec3<S>>,
    /// Of each part of the model; empty where steps are not guarded.
    pub energies: Vec<Energy>,
    /// Inertial prediction `xt` [m], of pinned vertices too.
    pub predicted: Vec<Vec3<S>>,
    /// External forces [N] without gravity.
    pub external: Vec<Vec3<S>>,
    /// `1/m`, zero where pinned [1/kg].
    pub inverse_masses: Vec<S>,
    /// Inverse mass of each of a vertex's copies during a sweep [1/kg].
    weights: Vec<S>,
    /// Positions of the copies [m]; empty where nothing is split.
    copies: Vec<Vec3<S>>,
    /// One entry per corner of every constraint; empty where no stage needs it.
    pub loads: Vec<CornerLoad<S>>,
    /// Green strain at the start of the step of viscous sets, `[green, neo]`.
    pub start_strain: [Vec<green_strain::Voigt<S>>; 2],
    /// Iterate before the sweep, and the one before that.
    iterate: [Iterate<S>; 2],
    /// Diagonal of `a~` of each multiplier: weights of the norm in which iterates are compared.
    multiplier_weights: Vec<S>,
    /// The share of the rebase that is applied.
    rebase_factor: S,
    /// The share of the mass bounds that counts.
    bound_share: S,
    chebyshev: Chebyshev,
    pub anderson: Anderson<S>,
    /// Empty where steps are not guarded.
    pub guard: Guard<S>,
}

#[derive(Clone, Debug, Default)]
struct Iterate<S> {
    positions: Vec<Vec3<S>>,
    multipliers: Vec<S>,
}

impl<S: Real> Workspace<S> {
    pub fn new(model: &Model<S>, settings: &SolverSettings) -> Self {
        let vertices = model.vertex_count();
        let accelerated = settings.acceleration != Acceleration::None;
        let iterate = |wanted: bool| Iterate {
            positions: vec![Vec3::ZERO; if wanted { vertices } else { 0 }],
            multipliers: vec![S::ZERO; if wanted { model.multiplier_count } else { 0 }],
        };
        let needs_loads = settings.rebase
            || (settings.acceleration == Acceleration::Anderson
                && settings.anderson_on == AndersonOn::Multipliers);
        let anderson = settings.acceleration == Acceleration::Anderson;
        let window = settings.anderson_window as usize;
        let length = if anderson { 3 * vertices + model.multiplier_count } else { 0 };
        Self {
            sizes: sizes(model).map(|(_, size)| size),
            previous: vec![Vec3::ZERO; vertices],
            energies: vec![
                Energy::default();
                if settings.guards_steps() { model.component_count } else { 0 }
            ],
            predicted: vec![Vec3::ZERO; vertices],
            external: vec![Vec3::ZERO; vertices],
            inverse_masses: vec![S::ZERO; vertices],
            weights: vec![S::ZERO; vertices],
            copies: vec![Vec3::ZERO; if model.is_split() { model.copy_count() } else { 0 }],
            loads: vec![
                CornerLoad::default();
                if needs_loads { model.gather_slots.len() } else { 0 }
            ],
            start_strain: model.tet_sets().map(|set| {
                vec![[S::ZERO; 6]; if set.viscous_offset.is_some() { set.len() } else { 0 }]
            }),
            iterate: [
                iterate(accelerated),
                iterate(settings.acceleration == Acceleration::Chebyshev),
            ],
            multiplier_weights: vec![S::ZERO; if accelerated { model.multiplier_count } else { 0 }],
            rebase_factor: S::from_f64(rebase_factor(model, settings)),
            bound_share: S::from_f64(bound_share(model)),
            chebyshev: Chebyshev::default(),
            anderson: Anderson::new(window, length),
            guard: Guard::new(if settings.guards_steps() { vertices } else { 0 }),
        }
    }

    /// The model is one of the same shape as that for which the memory was taken.
    pub fn check(&self, model: &Model<S>) -> Result<(), StepError> {
        for (given, (what, expected)) in self.sizes.into_iter().zip(sizes(model)) {
            if given != expected {
                return Err(StepError::Mismatch { what, given, expected });
            }
        }
        Ok(())
    }

    pub fn run(&mut self, stage: &Stage, step: &Step<'_, S>, state: &mut State<S>) {
        match *stage {
            Stage::MeasureStrain => self.measure_strain(step, state),
            Stage::Predict(start) => self.predict(step, state, start),
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
            Stage::RememberIterate => self.remember_iterate(state),
            Stage::LoadCorners => self.load_corners(step, state),
            Stage::Rebase => self.rebase(step, state),
            Stage::RecomputePositions => self.recompute_positions(step, state),
            Stage::SplitCopies => split_copies(step.model, &state.positions, &mut self.copies),
            Stage::SolveColor(color) => self.solve_color(step, state, color as usize),
            Stage::JoinCopies => join_copies(step.model, &self.copies, &mut state.positions),
            Stage::Chebyshev => self.chebyshev(step, state),
            Stage::Anderson(on) => self.anderson(step, state, on),
            Stage::ChooseStart => self.choose_start(step, state),
            Stage::GuardStep => self.guard_step(step, state),
            Stage::GuardIterate => self.guard_iterate(step, state),
            Stage::RepairMultipliers => self.repair_multipliers(step, state),
            Stage::UpdateVelocities => {
                let rate = S::from_f64(1.0 / step.dt);
                for (v, velocity) in state.velocities.iter_mut().enumerate() {
                    *velocity = (state.positions[v] - self.previous[v]) * rate;
                }
            }
            Stage::LimitEnergy => self.limit_energy(step, state),
        }
    }

    pub(super) fn measure_strain(&mut self, step: &Step<'_, S>, state: &State<S>) {
        for (set, strains) in step.model.tet_sets().into_iter().zip(&mut self.start_strain) {
            for (tet, strain) in strains.iter_mut().enumerate() {
                let x = corners(&state.positions, set.vertices[tet]);
                let f = deformation_gradient(&x, &set.inverse_rest_shape[tet]);
                *strain = green_strain::strain(&f);
            }
        }
    }

    fn predict(&mut self, step: &Step<'_, S>, state: &mut State<S>, start: Start) {
        let model = step.model;
        self.external.fill(Vec3::ZERO);
        for &(vertex, force) in &step.inputs.forces {
            self.external[vertex as usize] += force;
        }
        let dt = S::from_f64(step.dt);
        for v in 0..model.vertex_count() {
            let x = state.positions[v];
            let inverse_mass = S::ONE / model.masses[v];
            let acceleration = step.inputs.gravity + self.external[v] * inverse_mass;
            let inertial = x + state.velocities[v] * dt;
            let predicted = inertial + acceleration * (dt * dt);
            self.previous[v] = x;
            self.predicted[v] = predicted;
            self.inverse_masses[v] = inverse_mass;
            state.positions[v] = match start {
                Start::Previous => x,
                Start::Inertial => inertial,
                Start::Predicted | Start::Auto => predicted,
            };
        }
        for pin in &step.inputs.pins {
            self.inverse_masses[pin.vertex as usize] = S::ZERO;
            state.positions[pin.vertex as usize] = pin.target;
        }
        for v in 0..model.vertex_count() {
            self.weights[v] = self.inverse_masses[v] * copy_count(model, v);
        }
    }

    fn start_acceleration(&mut self, step: &Step<'_, S>, state: &mut State<S>) {
        state.multiplier_dt = step.dt;
        self.anderson.start();
        self.chebyshev.start(step.settings.chebyshev_radius);
        if !self.multiplier_weights.is_empty() {
            fill_multiplier_weights(step, &mut self.multiplier_weights);
        }
    }

    fn remember_iterate(&mut self, state: &State<S>) {
        self.iterate.swap(0, 1);
        if self.iterate[0].positions.is_empty() {
            self.iterate.swap(0, 1);
        }
        self.iterate[0].positions.copy_from_slice(&state.positions);
        self.iterate[0].multipliers.copy_from_slice(&state.multipliers);
    }

    fn load_corners(&mut self, step: &Step<'_, S>, state: &State<S>) {
        let model = step.model;
        let (x, l) = (&state.positions, &state.multipliers);
        for set in model.tet_sets() {
            for tet in 0..set.len() {
                let corners = corners(x, set.vertices[tet]);
                let shape = &set.inverse_rest_shape[tet];
                let at = set.multiplier_offset + set.form.multiplier_count() * tet;
                let mut loads = match set.form {
                    TetForm::GreenStrain => {
                        green_strain::corner_loads(&corners, shape, &read(l, at))
                    }
                    TetForm::NeoHookeanPair => {
                        neo_hookean_pair::corner_loads(&corners, shape, &read(l, at))
                    }
                    TetForm::NeoHookeanStretch => {
                        neo_hookean_stretch::corner_loads(&corners, shape, &read(l, at))
                    }
                };
                if let Some(offset) = set.viscous_offset {
                    let viscous = read(l, offset + 6 * tet);
                    let more = green_strain::corner_loads(&corners, shape, &viscous);
                    for (load, more) in loads.iter_mut().zip(more) {
                        load.impulse += more.impulse;
                        load.mass_bound += more.mass_bound;
                    }
                }
                let first = set.corner_offset + 4 * tet;
                self.loads[first..first + 4].copy_from_slice(&loads);
            }
        }
        let springs = &model.springs;
        for (i, ends) in springs.vertices.iter().enumerate() {
            let ends = ends.map(|v| x[v as usize]);
            let loads = spring::corner_loads(&ends, l[springs.multiplier_offset + i]);
            let first = springs.corner_offset + 2 * i;
            self.loads[first..first + 2].copy_from_slice(&loads);
        }
        let attachments = &model.attachments;
        for i in 0..attachments.vertices.len() {
            let impulse = read_vec3(l, attachments.multiplier_offset + 3 * i);
            let load = CornerLoad { impulse, mass_bound: S::ZERO };
            self.loads[attachments.corner_offset + i] = load;
        }
    }

    /// Sum of a vertex's corner loads, in the model's fixed order.
    pub fn gather(&self, model: &Model<S>, v: usize) -> CornerLoad<S> {
        let range = model.gather_offsets[v] as usize..model.gather_offsets[v + 1] as usize;
        let mut sum = CornerLoad::default();
        for &slot in &model.gather_slots[range] {
            let load = &self.loads[slot as usize];
            sum.impulse += load.impulse;
            sum.mass_bound += load.mass_bound;
        }
        sum
    }

    /// Stabilised rebase: pulls positions back onto `M (x - xt) = J(x)^T l`, from which path
    /// dependence drives them, by one damped step in the metric `mh`, a share of the bound of the
    /// geometric stiffness above the mass.
    fn rebase(&mut self, step: &Step<'_, S>, state: &mut State<S>) {
        let model = step.model;
        let factor = self.rebase_factor;
        let share = self.bound_share;
        for v in 0..model.vertex_count() {
            if self.inverse_masses[v] == S::ZERO {
                continue;
            }
            let load = self.gather(model, v);
            let mass = model.masses[v];
            let residual = (state.positions[v] - self.predicted[v]) * mass - load.impulse;
            let inverse = S::ONE / (mass + load.mass_bound * share);
            state.positions[v] -= residual * (factor * inverse);
            self.weights[v] = inverse * copy_count(model, v);
        }
    }

    fn recompute_positions(&mut self, step: &Step<'_, S>, state: &mut State<S>) {
        for v in 0..step.model.vertex_count() {
            if self.inverse_masses[v] != S::ZERO {
                let impulse = self.gather(step.model, v).impulse;
                state.positions[v] = self.predicted[v] + impulse * self.inverse_masses[v];
            }
        }
    }

    fn solve_color(&mut self, step: &Step<'_, S>, state: &mut State<S>, color: usize) {
        let model = step.model;
        let split = model.is_split();
        let sweep = Sweep {
            points: if split { &mut self.copies } else { &mut state.positions },
            multipliers: &mut state.multipliers,
            weights: &self.weights,
            dt: step.dt,
            relaxation: Relaxation::new(step.settings),
        };
        sweep.solve(step, &self.start_strain, color);
    }

    fn chebyshev(&mut self, step: &Step<'_, S>, state: &mut State<S>) {
        let settings = step.settings;
        let change = self.change_norm(step, state).sqrt();
        let measured = settings.chebyshev_radius == 0.0;
        let omega = self.chebyshev.weight(change, settings.chebyshev_delay, measured);
        let gamma = S::from_f64(settings.chebyshev_damping);
        if omega == 1.0 && settings.chebyshev_damping == 1.0 {
            return;
        }
        let omega = S::from_f64(omega);
        let [now, older] = &self.iterate;
        for v in 0..state.positions.len() {
            for axis in 0..3 {
                let (q, o) = (now.positions[v][axis], older.positions[v][axis]);
                chebyshev_update(&mut state.positions[v][axis], q, o, omega, gamma);
            }
        }
        for (i, l) in state.multipliers.iter_mut().enumerate() {
            chebyshev_update(l, now.multipliers[i], older.multipliers[i], omega, gamma);
        }
    }

    /// Squared norm of what the sweep changed: `sum m |dx|^2 + sum a~ dl^2`.
    fn change_norm(&self, step: &Step<'_, S>, state: &State<S>) -> f64 {
        let mut sum = 0.0;
        for (v, x) in state.positions.iter().enumerate() {
            let change = *x - self.iterate[0].positions[v];
            sum += step.model.masses[v].to_f64() * change.length_squared().to_f64();
        }
        for (i, l) in state.multipliers.iter().enumerate() {
            let change = (*l - self.iterate[0].multipliers[i]).to_f64();
            sum += self.multiplier_weights[i].to_f64() * change * change;
        }
        sum
    }

    fn anderson(&mut self, step: &Step<'_, S>, state: &mut State<S>, on: AndersonOn) {
        let vertices = state.positions.len();
        let (mapped, residual) = self.anderson.push();
        for v in 0..vertices {
            let before = self.iterate[0].positions[v];
            for axis in 0..3 {
                mapped[3 * v + axis] = state.positions[v][axis];
                residual[3 * v + axis] = state.positions[v][axis] - before[axis];
            }
        }
        for (i, &l) in state.multipliers.iter().enumerate() {
            mapped[3 * vertices + i] = l;
            residual[3 * vertices + i] = l - self.iterate[0].multipliers[i];
        }
        let masses = &step.model.masses;
        let multiplier_weights = &self.multiplier_weights;
        let norm_weight = |i: usize| match (i < 3 * vertices, on) {
            (true, AndersonOn::Multipliers) | (false, AndersonOn::Positions) => 0.0,
            (true, _) => masses[i / 3].to_f64(),
            (false, _) => multiplier_weights[i - 3 * vertices].to_f64(),
        };
        let guard = step.settings.guard_of_mixtures() == AndersonGuard::Residual;
        let (weights, count) = self.anderson.mixing_weights(norm_weight, guard);
        let weights = &weights[..count];
        if on != AndersonOn::Multipliers {
            for v in 0..vertices {
                for axis in 0..3 {
                    state.positions[v][axis] = self.anderson.mixed(3 * v + axis, weights);
                }
            }
        }
        if on != AndersonOn::Positions {
            for (i, l) in state.multipliers.iter_mut().enumerate() {
                *l = self.anderson.mixed(3 * vertices + i, weights);
            }
        }
    }
}

/// Everything in a model that decides how much memory a step needs and which stages it has.
fn sizes<S: Real>(model: &Model<S>) -> [(&'static str, usize); 10] {
    let viscous =
        model.tet_sets().map(|set| if set.viscous_offset.is_some() { set.len() } else { 0 });
    [
        ("solver's list of vertices", model.vertex_count()),
        ("solver's list of multipliers", model.multiplier_count),
        ("solver's list of parts", model.component_count),
        ("solver's list of colors", model.color_count),
        ("solver's list of copies", model.copy_count()),
        ("solver's list of corners", model.gather_slots.len()),
        ("solver's list of Saint Venant-Kirchhoff tetrahedra", model.green_strain.len()),
        ("solver's list of neo-Hookean tetrahedra", model.neo_hookean.len()),
        ("solver's list of viscous Saint Venant-Kirchhoff tetrahedra", viscous[0]),
        ("solver's list of viscous neo-Hookean tetrahedra", viscous[1]),
    ]
}

/// The more copies a vertex has, the further a sweep's primal part runs ahead of its multipliers;
/// slowing the rebase alone restores the balance and leaves the fixed point where it is. 1, 1/2
/// and 1/4 are the largest powers of two that settled in every scene tried.
fn rebase_factor<S: Real>(model: &Model<S>, settings: &SolverSettings) -> f64 {
    match (settings.rebase_factor > 0.0, model.is_split(), model.color_count) {
        (true, ..) => settings.rebase_factor,
        (_, false, _) => 1.0,
        (_, true, 1) => 0.25,
        (_, true, _) => 0.5,
    }
}

fn copy_count<S: Real>(model: &Model<S>, v: usize) -> S {
    S::from_f64(f64::from(model.copy_offsets[v + 1] - model.copy_offsets[v]))
}

fn split_copies<S: Real>(model: &Model<S>, positions: &[Vec3<S>], copies: &mut [Vec3<S>]) {
    for (v, x) in positions.iter().enumerate() {
        copies[model.copy_offsets[v] as usize..model.copy_offsets[v + 1] as usize].fill(*x);
    }
}

/// Averages the changes of the copies, not the copies: the mean of equal numbers is then that
/// number, and a vertex nobody moved stays where it is to the bit.
fn join_copies<S: Real>(model: &Model<S>, copies: &[Vec3<S>], positions: &mut [Vec3<S>]) {
    for (v, x) in positions.iter_mut().enumerate() {
        let range = model.copy_offsets[v] as usize..model.copy_offsets[v + 1] as usize;
        let share = S::ONE / S::from_f64(range.len() as f64);
        let mut sum = Vec3::ZERO;
        for copy in &copies[range] {
            sum += *copy - *x;
        }
        *x += sum * share;
    }
}

/// The diagonal of `a~` of every multiplier.
fn fill_multiplier_weights<S: Real>(step: &Step<'_, S>, weights: &mut [S]) {
    let model = step.model;
    let dt = S::from_f64(step.dt);
    for set in model.tet_sets() {
        let count = set.form.multiplier_count();
        for tet in 0..set.len() {
            let material = &model.materials[set.material[tet] as usize];
            let volume = set.rest_volume[tet];
            let scale = S::ONE / (volume * dt * dt);
            let at = set.multiplier_offset + count * tet;
            match set.form {
                TetForm::GreenStrain | TetForm::NeoHookeanStretch => {
                    for p in 0..6 {
                        weights[at + p] = material.compliance[p][p] * scale;
                    }
                }
                TetForm::NeoHookeanPair => {
                    weights[at] = scale / (material.lame_lambda + material.lame_mu);
                    weights[at + 1] = scale / material.lame_mu;
                }
            }
            if let Some(offset) = set.viscous_offset
                && material.viscosity > S::ZERO
            {
                for p in 0..6 {
                    weights[offset + 6 * tet + p] =
                        material.compliance[p][p] / (volume * material.viscosity * dt);
                }
            }
        }
    }
    for (i, stiffness) in model.springs.stiffness.iter().enumerate() {
        weights[model.springs.multiplier_offset + i] = S::ONE / (*stiffness * dt * dt);
    }
    for (i, stiffness) in model.attachments.stiffness.iter().enumerate() {
        let at = model.attachments.multiplier_offset + 3 * i;
        weights[at..at + 3].fill(S::ONE / (*stiffness * dt * dt));
    }
}
