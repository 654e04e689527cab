//! The beginning of a step: what acts, and where inertia takes the vertices.
//!
//! ```text
//! xt = x_n + dt v_n + dt^2 (g + M^-1 f_ext)
//! ```

use super::data::{Step, StepData, copy_count};
use super::tethers::{Bundle, bundle};
use crate::layout::Part;
use crate::scalar::lanes::Point;
use crate::scalar::{Real, Vec3};
use crate::settings::Start;

/// How a step takes tethers: as inertia, which is implicit, or as forces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tethers {
    AsInertia,
    AsForces,
}

impl<S: Real> StepData<S> {
    /// External forces, inertias, and their inverses, which pins have none of.
    pub fn prepare(&mut self, step: &Step<'_, S>, tethers: Tethers) {
        let (model, constants) = (step.layout, &mut self.constants);
        constants.external.fill(Vec3::ZERO);
        for &(vertex, force) in &step.inputs.forces {
            constants.external[model.numbering.of(vertex)] += force;
        }
        constants.inverse_masses.fill(S::ONE);
        for pin in &step.inputs.pins {
            constants.inverse_masses[model.numbering.of(pin.vertex)] = S::ZERO;
        }
        bundle(model, step.inputs, &mut constants.tethers);
        // Before they make anything heavier: what holds a pinned vertex holds its own weight.
        let inverse_masses = &constants.inverse_masses;
        constants.tethers.retain(|tether| inverse_masses[tether.vertex] != S::ZERO);
        constants.inertias.copy_from_slice(&constants.masses);
        if tethers == Tethers::AsInertia {
            let squared = S::from_f64(step.dt * step.dt);
            for tether in &constants.tethers {
                constants.inertias[tether.vertex] += tether.stiffness * squared;
            }
        }
        for (inverse, &inertia) in constants.inverse_masses.iter_mut().zip(&constants.inertias) {
            if *inverse != S::ZERO {
                *inverse = S::ONE / inertia;
            }
        }
    }

    /// [`super::stage::StepStage::Predict`].
    pub fn predict(&mut self, step: &Step<'_, S>, start: Start) {
        self.prepare(step, Tethers::AsInertia);
        let (model, constants) = (step.layout, &mut self.constants);
        let dt = S::from_f64(step.dt);
        for v in 0..model.vertex_count() {
            let x = self.points[v].vec3();
            let load = constants.external[v] * (S::ONE / constants.inertias[v]);
            let inertial = x + self.velocities[v] * dt;
            let predicted = inertial + (step.inputs.gravity + load) * (dt * dt);
            constants.previous[v].set_vec3(x);
            constants.predicted[v].set_vec3(predicted);
            let x = match start {
                Start::Previous => x,
                Start::Inertial | Start::Auto => inertial,
                Start::Predicted => predicted,
            };
            self.points[v] = Point::new(x, constants.inverse_masses[v] * copy_count(model, v));
        }
        for tether in &constants.tethers {
            let v = tether.vertex;
            let inertial = constants.previous[v].vec3() + self.velocities[v] * dt;
            let pull = tether.force(inertial + step.inputs.gravity * (dt * dt));
            let predicted =
                constants.predicted[v].vec3() + pull * (S::ONE / constants.inertias[v]) * (dt * dt);
            constants.predicted[v].set_vec3(predicted);
            if start == Start::Predicted {
                self.points[v].set_vec3(predicted);
            }
        }
        for pin in &step.inputs.pins {
            self.points[model.numbering.of(pin.vertex)].set_vec3(pin.target);
        }
        if start == Start::Auto {
            for (number, part) in model.parts.iter().enumerate() {
                if !self.constants.rests(number, part) {
                    self.start_falling(step, part);
                }
            }
        }
    }

    /// Starts a part that nothing holds where its center of mass will be. Inner forces do not move that, so
    /// that no multiplier carries its acceleration; sweeps and a rebase that is not applied in full would
    /// find it in part only, and the guard would have to take the step back.
    fn start_falling(&mut self, step: &Step<'_, S>, part: &Part) {
        let constants = &self.constants;
        let (mut mass, mut force) = (0.0, Vec3::<f64>::ZERO);
        for v in part.vertices.clone() {
            mass += constants.masses[v].to_f64();
            force += constants.external[v].cast();
        }
        let dt = S::from_f64(step.dt);
        let acceleration = step.inputs.gravity + (force * (1.0 / mass)).cast();
        for v in part.vertices.clone() {
            let inertial = constants.previous[v].vec3() + self.velocities[v] * dt;
            self.points[v].set_vec3(inertial + acceleration * (dt * dt));
        }
    }
}

/// Adds the tethers to the loads in the prediction of an explicit step; `mass` [kg] and `place` [m] are those of
/// the solver's vertices.
pub fn load_tethers<S: Real>(
    tethers: &[Bundle<S>],
    predicted: &mut [Point<S>],
    dt: f64,
    mass: impl Fn(usize) -> S,
    place: impl Fn(usize) -> Vec3<S>,
) {
    for tether in tethers {
        let v = tether.vertex;
        let load = tether.force(place(v)) * (S::ONE / mass(v));
        let moved = predicted[v].vec3() + load * S::from_f64(dt * dt);
        predicted[v].set_vec3(moved);
    }
}
