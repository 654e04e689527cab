//! The explicit integrator: the cheap baseline, and the truth of motion where it is stable.
//!
//! ```text
//! v_(k+1/2) = v_(k-1/2) + h M^-1 (f_ext + f(x_k)),   x_(k+1) = x_k + h v_(k+1/2)      symplectic Euler
//! h <= (2/omega) (sqrt(1 + xi^2) - xi),   xi = eta omega/2       with viscosity eta
//! omega^2 <= max_i sum_(e at i) rho(K_e)/m_i
//! ```
//!
//! Energy stays within a band that narrows with `h`, for any number of steps, because the method is
//! symplectic (Hairer, Lubich, Wanner, "Geometric Numerical Integration", 2006, chapter I); the limit of
//! `h` with stiffness-proportional damping is that of Belytschko, Liu, Moran, "Nonlinear Finite
//! Elements for Continua and Structures", 2000, section 6.2. The bound of the highest frequency holds
//! because `K_e <= rho(K_e) I` on the vertices of every element `e`. Every connected part of the model takes
//! as many small steps as it needs itself.

use super::StepError;
use super::cpu::{Ground, Step, Workspace};
use super::potential::{load_forces, measure_strain};
use super::rebase::gather;
use super::tethers::Bundle;
use crate::elements::shape_gradients;
use crate::model::Model;
use crate::scalar::lanes::Point;
use crate::scalar::{Mat3, Real, Vec3};
use crate::settings::SolverSettings;

/// More small steps than this in one step are a mistake of units rather than patience.
const MOST_SMALL_STEPS: f64 = 100_000.0;

/// Rounds of the power method for an element's stiffness: 1 % is enough for a bound with a margin.
const POWER_ROUNDS: usize = 20;

/// What the largest stable small step depends on.
#[derive(Clone, Debug)]
pub(super) struct Stability {
    /// The largest small step [s] of the stiffest part without tethers, with the margin of the settings;
    /// infinite for other methods.
    pub step: f64,
    /// Of the elements around each vertex, the user's order [N/m]; empty for other methods.
    stiffness: Vec<f64>,
    /// Empty for other methods.
    parts: Vec<PartStability>,
    safety: f64,
}

/// Of one connected part of the model.
#[derive(Clone, Copy, Debug, Default)]
struct PartStability {
    /// Largest [1/s].
    frequency: f64,
    /// Largest [s].
    viscosity: f64,
}

/// The small steps of a part in one step: as many as it needs, whatever others do.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SmallSteps {
    count: u32,
    done: u32,
}

impl SmallSteps {
    /// [s]; `dt` is the whole step.
    fn dt(self, dt: f64) -> f64 {
        dt / f64::from(self.count)
    }
}

impl Stability {
    /// Of a model that an explicit method moves; without one there is no limit.
    pub fn new<S: Real>(model: Option<&Model<S>>, settings: &SolverSettings) -> Self {
        let (stiffness, parts) = model.map(part_stability).unwrap_or_default();
        let safety = settings.explicit_safety;
        let mut stability = Self { step: f64::INFINITY, stiffness, parts, safety };
        if let Some(model) = model {
            stability.step = stability.step(model, &[]);
        }
        stability
    }

    /// The largest small step [s] of the stiffest part with these tethers.
    pub fn step<S: Real>(&self, model: &Model<S>, tethers: &[Bundle<S>]) -> f64 {
        self.steps(model, tethers).fold(f64::INFINITY, f64::min)
    }

    /// The largest small step [s] of each part with these tethers, sorted by vertex.
    pub fn steps<S: Real>(
        &self,
        model: &Model<S>,
        tethers: &[Bundle<S>],
    ) -> impl Iterator<Item = f64> {
        let mut tethers = tethers.iter().peekable();
        self.parts.iter().zip(model.parts.iter()).map(move |(stability, part)| {
            let mut frequency = stability.frequency;
            while let Some(tether) = tethers.next_if(|t| t.vertex < part.vertices.end) {
                let v = model.numbering.order[tether.vertex] as usize;
                let stiffness = self.stiffness[v] + tether.stiffness.to_f64();
                frequency = frequency.max((stiffness / model.masses[v].to_f64()).sqrt());
            }
            let xi = 0.5 * stability.viscosity * frequency;
            self.safety * (2.0 / frequency) * ((1.0 + xi * xi).sqrt() - xi)
        })
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.stiffness[..]) + size_of_val(&self.parts[..])
    }
}

/// Of the elements around each vertex [N/m], and what of it decides in each part.
fn part_stability<S: Real>(model: &Model<S>) -> (Vec<f64>, Vec<PartStability>) {
    let mut stiffness = vec![0.0; model.vertex_count()];
    let mut parts = vec![PartStability::default(); model.part_count()];
    for set in model.tet_sets() {
        for tet in model.tets(set) {
            let material = &model.materials[tet.material];
            let viscosity = &mut parts[model.part_of(tet.vertices[0])].viscosity;
            *viscosity = viscosity.max(material.viscosity.to_f64());
            let shape = tet.inverse_rest_shape.cast::<f64>();
            let lame = [material.lame_lambda, material.lame_mu].map(Real::to_f64);
            let largest = tet.rest_volume.to_f64() * element_stiffness(&shape, lame);
            for v in tet.vertices {
                stiffness[v as usize] += largest;
            }
        }
    }
    let springs = &model.springs;
    for (ends, k) in springs.vertices.iter().zip(&springs.stiffness) {
        for &v in ends {
            stiffness[v as usize] += 2.0 * k.to_f64();
        }
    }
    for (&v, k) in model.attachments.vertices.iter().zip(&model.attachments.stiffness) {
        stiffness[v as usize] += k.to_f64();
    }
    for (stability, part) in parts.iter_mut().zip(model.parts.iter()) {
        let vertices = model.numbering.order[part.vertices.clone()].iter().map(|&v| v as usize);
        let ratios = vertices.map(|v| stiffness[v] / model.masses[v].to_f64());
        stability.frequency = ratios.fold(0.0, f64::max).sqrt();
    }
    (stiffness, parts)
}

impl<S: Real> Ground<S> {
    /// Adds the tethers to the loads in the prediction of an explicit step; `place` gives a vertex's
    /// position [m] by the solver's number.
    pub fn load_tethers(&mut self, dt: f64, place: impl Fn(usize) -> Vec3<S>) {
        for tether in &self.tethers {
            let v = tether.vertex;
            let load = tether.force(place(v)) * (S::ONE / self.masses[v]);
            let predicted = self.predicted[v].vec3() + load * S::from_f64(dt * dt);
            self.predicted[v].set_vec3(predicted);
        }
    }
}

/// The largest eigenvalue of a tetrahedron's stiffness at rest, per volume [Pa/m^2]. Both laws have the
/// same stiffness at rest: that of linear elasticity.
fn element_stiffness(shape: &Mat3<f64>, [lambda, mu]: [f64; 2]) -> f64 {
    let g = shape_gradients(shape);
    // Any displacement but a rigid one will do; swelling and shear together meet every eigenvector.
    let mut u = [g[1] + g[2] * 0.3, g[2] - g[0] * 0.2, g[3] + g[0] * 0.7, g[1] * -0.4 + g[0]];
    let mut value = 0.0;
    for _ in 0..POWER_ROUNDS {
        let length = u.iter().map(|u| u.length_squared()).sum::<f64>().sqrt();
        let mut gradient = Mat3::ZERO;
        for (u, g) in u.iter().zip(g) {
            gradient = gradient + Mat3::outer(*u * (1.0 / length), g);
        }
        let stress =
            (gradient + gradient.transpose()) * mu + Mat3::IDENTITY * (lambda * gradient.trace());
        for (u, g) in u.iter_mut().zip(g) {
            *u = stress * g;
        }
        value = u.iter().map(|u| u.length_squared()).sum::<f64>().sqrt();
    }
    value
}

/// How many small steps, of `stable` [s] at most, make a step of `dt` [s].
pub(super) fn small_steps(dt: f64, stable: f64) -> Result<u32, StepError> {
    let count = (dt / stable).ceil().max(1.0);
    if count <= MOST_SMALL_STEPS {
        return Ok(count as u32);
    }
    Err(StepError::TooStiff { dt, stable })
}

impl<S: Real> Workspace<S> {
    /// Decides how many small steps each part takes in a step of `dt` [s]; returns the most.
    pub(super) fn count_small_steps(
        &mut self,
        model: &Model<S>,
        dt: f64,
    ) -> Result<u32, StepError> {
        let tethers = &self.ground.tethers;
        let most = small_steps(dt, self.stability.step(model, tethers))?;
        for (small, stable) in self.small_steps.iter_mut().zip(self.stability.steps(model, tethers))
        {
            *small = SmallSteps { count: small_steps(dt, stable)?, done: 0 };
        }
        Ok(most)
    }

    /// [`super::plan::Stage::BeginExplicit`].
    pub(super) fn begin_explicit(&mut self, step: &Step<'_, S>) {
        let model = step.model;
        self.prepare(step);
        self.ground.previous.copy_from_slice(&self.points);
        self.start_velocities.copy_from_slice(&self.velocities);
        if model.tet_sets().iter().any(|set| set.viscous) {
            let velocities = &self.velocities;
            for (part, small) in model.parts.iter().zip(&self.small_steps) {
                let back = S::from_f64(-small.dt(step.dt));
                self.ground.each_vertex(part, &mut self.points, |v, point| {
                    point.set_vec3(point.vec3() + velocities[v] * back);
                });
            }
            let ground = &mut self.ground;
            measure_strain(&ground.workers, model, None, &self.points, &mut ground.start_strain);
            self.points.copy_from_slice(&self.ground.previous);
        }
    }

    /// [`super::plan::Stage::LoadForces`].
    pub(super) fn load_explicit_forces(&mut self, step: &Step<'_, S>) {
        let Self { ground, points, loads, small_steps, .. } = self;
        for (part, small) in step.model.parts.iter().zip(small_steps) {
            if small.done == small.count {
                continue;
            }
            let small = Step { dt: small.dt(step.dt), ..*step };
            load_forces::<S, false>(ground, &small, part, points, loads);
            let squared = S::from_f64(small.dt * small.dt);
            for tether in ground.tethers_of(part) {
                let force = tether.force(points[tether.vertex].vec3());
                let copy = step.model.copy_offsets[tether.vertex] as usize;
                loads[copy].add(Point::new(force * squared, S::ZERO));
            }
            let (workers, strains) = (&ground.workers, &mut ground.start_strain);
            measure_strain(workers, step.model, Some(part), points, strains);
        }
    }

    /// [`super::plan::Stage::AdvanceExplicit`].
    pub(super) fn advance_explicit(&mut self, step: &Step<'_, S>) {
        let model = step.model;
        let Self { ground, points, velocities, loads, small_steps, .. } = self;
        for (part, small) in model.parts.iter().zip(small_steps.iter_mut()) {
            if small.done == small.count {
                continue;
            }
            small.done += 1;
            let h = small.dt(step.dt);
            let (small, rate) = (S::from_f64(h), S::from_f64(1.0 / h));
            ground.each_vertex_with(part, points, velocities, |v, point, velocity| {
                let inverse_mass = ground.inverse_masses[v];
                if inverse_mass == S::ZERO {
                    return;
                }
                let force = gather(model, loads, v).vec3() * rate + ground.external[v] * small;
                *velocity += force * inverse_mass + step.inputs.gravity * small;
                point.set_vec3(point.vec3() + *velocity * small);
            });
        }
        let rate = S::from_f64(1.0 / step.dt);
        for pin in &step.inputs.pins {
            let v = model.numbering.of(pin.vertex);
            let SmallSteps { count, done } = small_steps[model.part_at(v)];
            let share = S::from_f64(f64::from(done) / f64::from(count));
            let start = ground.previous[v].vec3();
            let moved = start + (pin.target - start) * share;
            points[v].set_vec3(if done == count { pin.target } else { moved });
            velocities[v] = (pin.target - start) * rate;
        }
    }

    /// [`super::plan::Stage::EndExplicit`]: `xt = x - dt (v - v_n) + dt^2 (g + M^-1 f_ext)`, tethers
    /// among the loads, so that `M (x - xt)/dt^2` is mass times mean acceleration, less the loads.
    pub(super) fn end_explicit(&mut self, step: &Step<'_, S>) {
        let dt = S::from_f64(step.dt);
        for v in 0..self.points.len() {
            let ground = &mut self.ground;
            let load = step.inputs.gravity + ground.external[v] * (S::ONE / ground.masses[v]);
            let change: Vec3<S> = self.velocities[v] - self.start_velocities[v];
            let x = self.points[v].vec3();
            ground.predicted[v].set_vec3(x - change * dt + load * (dt * dt));
        }
        let Self { ground, points, .. } = self;
        ground.load_tethers(step.dt, |v| points[v].vec3());
    }
}
