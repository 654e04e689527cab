//! The energy limit: no step ends with more mechanical energy than it began with and was given, as far
//! as velocities can give it back.
//!
//! ```text
//! T_1 <= T_n + V(x_n with pins moved) - V(x_1) + sum_i (m_i g + f_i) . (x_1 - x_n)_i
//! v *= sqrt(limit/T_1) where it is exceeded;  T: kinetic energy of the free vertices, V: tissue with
//! its viscosity, springs, attachments, tethers
//! ```
//!
//! Implicit Euler dissipates: where the stored energy is convex along the step, its exact solution holds
//! this by itself. Sweeps that stop early do not: the step guard bounds `Phi`, which lets the kinetic
//! energy grow up to fourfold, and kept multipliers that trail a fast motion push it on, step after
//! step. With several substeps stiff, nearly incompressible tissue then never comes to rest. Scaling
//! velocities takes that energy back and moves no position, so that the state of rest is untouched.
//! Round-off gets no allowance: what a step may gain by it, step after step, would add up.
//!
//! Every connected part of the model has a limit of its own, so that one body does not slow another. A
//! part that nothing holds keeps its momentum: there everything is relative to its center of mass.

use super::cpu::{Step, Workspace};
use crate::scalar::{Real, Vec3};

/// What a connected part has and is given during a step; sums over its free vertices.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Energy {
    /// Whether a pin, an attachment or a tether holds it.
    held: bool,
    /// [kg].
    mass: f64,
    /// [N].
    load: Vec3<f64>,
    /// Work of the load [J].
    work: f64,
    /// Mass times displacement [kg m].
    shift: Vec3<f64>,
    /// With the places and velocities of the step's start, and of its end.
    start: Motion,
    end: Motion,
}

#[derive(Clone, Copy, Debug, Default)]
struct Motion {
    /// Of tissue, springs and attachments [J].
    stored: f64,
    /// Kinetic energy [J].
    kinetic: f64,
    /// [kg m/s].
    momentum: Vec3<f64>,
}

impl Motion {
    fn add<S: Real>(&mut self, mass: f64, velocity: Vec3<S>) {
        let velocity = velocity.cast::<f64>();
        self.kinetic += 0.5 * mass * velocity.length_squared();
        self.momentum += velocity * mass;
    }
}

impl Energy {
    /// Velocity [m/s] that is not scaled, and the share that what is beside it keeps.
    fn limit(&self) -> (Vec3<f64>, f64) {
        let mut given = self.start.kinetic + self.start.stored - self.end.stored + self.work;
        let mut kinetic = self.end.kinetic;
        let mut drift = Vec3::ZERO;
        if !self.held && self.mass > 0.0 {
            let inverse = 1.0 / self.mass;
            drift = self.end.momentum * inverse;
            kinetic -= 0.5 * inverse * self.end.momentum.length_squared();
            given -= 0.5 * inverse * self.start.momentum.length_squared();
            given -= inverse * self.load.dot(self.shift);
        }
        let share = if kinetic > given { (given.max(0.0) / kinetic).sqrt() } else { 1.0 };
        (drift, share)
    }
}

impl<S: Real> Workspace<S> {
    /// Remembers energy and momentum before the step, with the last evaluation of the potential.
    pub(super) fn begin_energy(&mut self, step: &Step<'_, S>) {
        let (model, ground, energies) = (step.model, &self.ground, &mut self.energies);
        for (number, (energy, part)) in energies.iter_mut().zip(model.parts.iter()).enumerate() {
            *energy = Energy::default();
            energy.start.stored = self.evaluator.stored[number];
            energy.held = ground.holds(part);
            for tether in ground.tethers_of(part) {
                energy.start.stored += tether.energy(ground.previous[tether.vertex].vec3());
            }
            for v in part.vertices.clone() {
                if ground.inverse_masses[v] != S::ZERO {
                    energy.start.add(ground.masses[v].to_f64(), self.velocities[v]);
                }
            }
        }
    }

    /// [`super::plan::Stage::LimitEnergy`]. The last evaluation of each part's potential was that of its end.
    pub(super) fn limit_energy(&mut self, step: &Step<'_, S>) {
        let (model, ground, energies) = (step.model, &self.ground, &mut self.energies);
        for (number, (energy, part)) in energies.iter_mut().zip(model.parts.iter()).enumerate() {
            energy.end.stored = self.evaluator.stored[number];
            for tether in ground.tethers_of(part) {
                energy.end.stored += tether.energy(self.points[tether.vertex].vec3());
            }
            let free = |v: &usize| ground.inverse_masses[*v] != S::ZERO;
            for v in part.vertices.clone().filter(free) {
                let mass = ground.masses[v].to_f64();
                let load = step.inputs.gravity * ground.masses[v] + ground.external[v];
                let load = load.cast::<f64>();
                let moved = (self.points[v].vec3() - ground.previous[v].vec3()).cast::<f64>();
                energy.end.add(mass, self.velocities[v]);
                energy.mass += mass;
                energy.load += load;
                energy.work += load.dot(moved);
                energy.shift += moved * mass;
            }
            let (drift, share) = energy.limit();
            if !(share < 1.0 && energy.mass > 0.0) {
                continue;
            }
            let (drift, scale) = (drift.cast::<S>(), S::from_f64(share));
            for v in part.vertices.clone().filter(free) {
                let velocity = &mut self.velocities[v];
                *velocity = drift + (*velocity - drift) * scale;
            }
            self.guard.set_kept_speed(number, share);
        }
    }
}
