//! The state: everything that moves.

use crate::model::Model;
use crate::scalar::{Real, Vec3};

/// Positions, velocities and multipliers of a model at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct State<S> {
    /// Positions [m], shape [vertex_count].
    pub positions: Vec<Vec3<S>>,
    /// Velocities [m/s], shape [vertex_count].
    pub velocities: Vec<Vec3<S>>,
    /// Multipliers [J s^2] of all constraints, in the solver's layout, shape [multiplier_count]; empty before the
    /// first step, as if all were zero. Another solver of the same model may have another layout: clear them for it.
    /// A solver that keeps them from step to step starts from the last step's forces. After
    /// changing positions by hand, reset the warm start: [`crate::solver::Solver::restart`].
    pub multipliers: Vec<S>,
    /// The step [s] to which the multipliers belong: they are forces times its square.
    pub multiplier_dt: f64,
}

impl<S: Real> State<S> {
    /// The model at rest.
    pub fn at_rest(model: &Model<S>) -> Self {
        Self {
            positions: model.rest_positions.clone(),
            velocities: vec![Vec3::ZERO; model.vertex_count()],
            multipliers: Vec::new(),
            multiplier_dt: 0.0,
        }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.positions[..])
            + size_of_val(&self.velocities[..])
            + size_of_val(&self.multipliers[..])
    }

    /// True while every number is finite.
    pub fn is_finite(&self) -> bool {
        self.positions.iter().chain(&self.velocities).all(|v| v.is_finite())
    }
}
