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

mod forces;
#[cfg(feature = "gpu")]
mod gpu;
mod stability;
pub mod stage;

use crate::layout::Layout;
use crate::layout::{Before, Moments};
use crate::scalar::lanes::Point;
use crate::scalar::{Real, Vec3};
use crate::settings::SolverSettings;
use crate::solver::error::StepError;
use crate::solver::inputs::Inputs;
use crate::solver::plan::{Node, Plan, Repeat, Times};
use crate::solver::step::data::{Step, StepConstants, StepData, gather};
use crate::solver::step::predict::{Tethers, load_tethers};
use crate::solver::step::stage::StepStage;
use crate::solver::step::strain::measure_strain;
use crate::solver::step::tethers::bundle;
use crate::state::State;
use forces::Pieces;
pub use stability::{SmallSteps, Stability, small_steps};
use stage::ExplicitStage;

/// The stages of a step.
pub fn plan() -> Plan {
    let small_step = vec![ExplicitStage::LoadForces.into(), ExplicitStage::Advance.into()];
    Plan {
        nodes: vec![
            StepStage::ReadState.into(),
            ExplicitStage::Begin.into(),
            Node::Repeat(Repeat {
                most: Times::SmallSteps,
                until: None,
                is_watched: true,
                body: small_step,
            }),
            ExplicitStage::End.into(),
            StepStage::WriteState.into(),
        ],
    }
}

/// The memory of the explicit method beside the data of a step.
#[derive(Clone, Debug)]
pub struct Memory<S> {
    pub stability: Stability,
    pieces: Pieces,
    /// Of each part.
    small_steps: Vec<SmallSteps>,
    /// Velocities at the start of the step [m/s].
    start_velocities: Vec<Vec3<S>>,
}

impl<S: Real> Memory<S> {
    /// Memory for the steps of a model.
    pub fn new(layout: &Layout<S>, settings: &SolverSettings) -> Self {
        Self {
            stability: Stability::new(layout, settings),
            pieces: Pieces::new(layout),
            small_steps: vec![SmallSteps::default(); layout.part_count()],
            start_velocities: vec![Vec3::ZERO; layout.vertex_count()],
        }
    }

    /// Bytes of all arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.start_velocities[..])
            + size_of_val(&self.small_steps[..])
            + self.stability.bytes()
            + self.pieces.bytes()
    }

    /// Carries a stage out.
    pub fn run(
        &mut self,
        stage: ExplicitStage,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        state: &mut State<S>,
    ) {
        match stage {
            ExplicitStage::Begin => {
                state.multiplier_dt = step.dt;
                self.begin(step, data);
            }
            ExplicitStage::LoadForces => self.load_forces(step, data),
            ExplicitStage::Advance => self.advance(step, data),
            ExplicitStage::End => end(step, data, &self.start_velocities),
        }
    }

    /// Decides how many small steps each part takes in a step of `dt` [s]; returns the most.
    pub fn count_small_steps(
        &mut self,
        layout: &Layout<S>,
        inputs: &Inputs<S>,
        data: &mut StepData<S>,
        dt: f64,
    ) -> Result<u32, StepError> {
        let tethers = &mut data.constants.tethers;
        bundle(layout, inputs, tethers);
        let most = small_steps(dt, self.stability.step(layout, tethers))?;
        for (small, stable) in
            self.small_steps.iter_mut().zip(self.stability.steps(layout, tethers))
        {
            *small = SmallSteps { count: small_steps(dt, stable)?, done: 0 };
        }
        Ok(most)
    }

    /// [`ExplicitStage::Begin`].
    fn begin(&mut self, step: &Step<'_, S>, data: &mut StepData<S>) {
        let model = step.layout;
        data.prepare(step, Tethers::AsForces);
        data.constants.previous.copy_from_slice(&data.points);
        self.start_velocities.copy_from_slice(&data.velocities);
        if model.is_viscous() {
            let velocities = &data.velocities;
            for (part, small) in model.parts.iter().zip(&self.small_steps) {
                let back = S::from_f64(-small.dt(step.dt));
                data.constants.each_vertex(part, &mut data.points, |v, point| {
                    point.set_vec3(point.vec3() + velocities[v] * back);
                });
            }
            let constants = &mut data.constants;
            measure_strain(
                &constants.workers,
                model,
                None,
                &data.points,
                &mut constants.start_strain,
            );
            data.points.copy_from_slice(&data.constants.previous);
        }
    }

    /// [`ExplicitStage::LoadForces`].
    fn load_forces(&mut self, step: &Step<'_, S>, data: &mut StepData<S>) {
        let StepData { constants, points, velocities, loads } = data;
        for (number, small) in self.small_steps.iter().enumerate() {
            if small.done == small.count {
                continue;
            }
            let small = Step { dt: small.dt(step.dt), ..*step };
            let moments = Moments {
                anchors: step.inputs.anchors_of(&step.layout.rest_anchors),
                start: Before::Moving(points, velocities),
                dt: small.dt,
            };
            self.pieces.load(constants, &small, &moments, number, points, loads);
            let squared = S::from_f64(small.dt * small.dt);
            for tether in constants.tethers_of(&step.layout.parts[number]) {
                let force = tether.force(points[tether.vertex].vec3());
                let copy = step.layout.copy_offsets[tether.vertex] as usize;
                loads[copy].add(Point::new(force * squared, S::ZERO));
            }
        }
    }

    /// [`ExplicitStage::Advance`].
    fn advance(&mut self, step: &Step<'_, S>, data: &mut StepData<S>) {
        let model = step.layout;
        let StepData { constants, points, velocities, loads } = data;
        let small_steps = &mut self.small_steps;
        for (part, small) in model.parts.iter().zip(small_steps.iter_mut()) {
            if small.done == small.count {
                continue;
            }
            small.done += 1;
            let h = small.dt(step.dt);
            let (small, rate) = (S::from_f64(h), S::from_f64(1.0 / h));
            constants.each_vertex_with(part, points, velocities, |v, point, velocity| {
                let inverse_mass = constants.inverse_masses[v];
                if inverse_mass == S::ZERO {
                    return;
                }
                let force = gather(model, loads, v).vec3() * rate + constants.external[v] * small;
                *velocity += force * inverse_mass + step.inputs.gravity * small;
                point.set_vec3(point.vec3() + *velocity * small);
            });
        }
        let rate = S::from_f64(1.0 / step.dt);
        for pin in &step.inputs.pins {
            let v = model.numbering.of(pin.vertex);
            let SmallSteps { count, done } = small_steps[model.part_at(v)];
            let share = S::from_f64(f64::from(done) / f64::from(count));
            let start = constants.previous[v].vec3();
            let moved = start + (pin.target - start) * share;
            points[v].set_vec3(if done == count { pin.target } else { moved });
            velocities[v] = (pin.target - start) * rate;
        }
    }
}

/// [`ExplicitStage::End`]: `xt = x - dt (v - v_n) + dt^2 (g + M^-1 f_ext)`, tethers
/// among the loads, so that `M (x - xt)/dt^2` is mass times mean acceleration, less the loads.
fn end<S: Real>(step: &Step<'_, S>, data: &mut StepData<S>, start_velocities: &[Vec3<S>]) {
    let dt = S::from_f64(step.dt);
    for v in 0..data.points.len() {
        let constants = &mut data.constants;
        let load = step.inputs.gravity + constants.external[v] * (S::ONE / constants.masses[v]);
        let change: Vec3<S> = data.velocities[v] - start_velocities[v];
        let x = data.points[v].vec3();
        constants.predicted[v].set_vec3(x - change * dt + load * (dt * dt));
    }
    let StepData { constants, points, .. } = data;
    let StepConstants { tethers, predicted, masses, .. } = constants;
    load_tethers(tethers, predicted, step.dt, |v| masses[v], |v| points[v].vec3());
}
