//! The methods of solution: one arm for each.

use super::plan::{Plan, Times};
use super::{explicit, quasi_newton, xpbd};
use crate::layout::Layout;
use crate::scalar::Real;
use crate::settings::{Method, SolverSettings};

impl Plan {
    /// The stages that the settings ask for.
    pub fn new<S: Real>(layout: &Layout<S>, settings: &SolverSettings) -> Self {
        match settings.method {
            Method::Xpbd => xpbd::plan(layout, settings),
            Method::Explicit => explicit::plan(),
            Method::Auto | Method::QuasiNewton => {
                quasi_newton::plan(settings, &layout.materials, true)
            }
        }
    }

    /// The same on a device, which takes no step again.
    #[cfg(feature = "gpu")]
    pub fn on_device(layout: &Layout<f32>, settings: &SolverSettings) -> Self {
        match settings.method {
            Method::Xpbd | Method::Explicit => Self::new(layout, settings),
            Method::Auto | Method::QuasiNewton => {
                quasi_newton::plan(settings, &layout.materials, false)
            }
        }
    }

    /// Iterations of the steps to come, where the method has iterations.
    pub fn set_iterations<S: Real>(&mut self, layout: &Layout<S>, settings: &SolverSettings) {
        match settings.method {
            Method::Xpbd => {
                if let Some(iteration) = self.iteration_mut() {
                    iteration.most = Times::Count(settings.iterations());
                }
            }
            // Small steps are counted by the step.
            Method::Explicit => {}
            Method::Auto | Method::QuasiNewton => {
                *self = quasi_newton::plan(settings, &layout.materials, true)
            }
        }
    }
}
