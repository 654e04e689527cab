//! The methods of solution: one arm for each.

use super::plan::{Plan, Times};
use super::{explicit, xpbd};
use crate::layout::Layout;
use crate::scalar::Real;
use crate::settings::{Method, SolverSettings};

impl Plan {
    /// The stages that the settings ask for.
    pub fn new<S: Real>(model: &Layout<S>, settings: &SolverSettings) -> Self {
        match settings.method {
            Method::Xpbd => xpbd::plan(model, settings),
            Method::Explicit => explicit::plan(),
        }
    }

    /// Iterations of the steps to come, where the method has iterations.
    pub fn set_iterations(&mut self, settings: &SolverSettings) {
        match settings.method {
            Method::Xpbd => {
                if let Some(iteration) = self.iteration_mut() {
                    iteration.most = Times::Count(settings.iterations);
                }
            }
            // Small steps are counted by the step.
            Method::Explicit => {}
        }
    }
}
