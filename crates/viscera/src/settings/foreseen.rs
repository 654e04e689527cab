//! What settings alone tell of the method in force.

use super::{DeviceRequest, Elements, Method, SolverSettings};

/// Whether this build computes on graphics processors how tissue meets tissue. Pages leave it out, whose size is limited.
pub(crate) const HAS_MEETINGS: bool =
    cfg!(all(feature = "gpu-solves", not(target_arch = "wasm32")));

impl SolverSettings {
    /// Whether a graphics processor computes by this method how tissue meets tissue.
    pub(crate) fn meets_on_device(&self) -> bool {
        HAS_MEETINGS && self.method == Method::QuasiNewton
    }
}

impl SolverSettings {
    /// The settings in force, as far as they tell it alone: on a device that is asked for by name "auto" is "quasi_newton", or
    /// "xpbd" in a build without it. Elsewhere it stays what it is: a scene chooses, mostly "quasi_newton".
    pub fn foreseen(&self) -> Self {
        match self.device {
            DeviceRequest::Auto | DeviceRequest::Cpu => self.clone(),
            DeviceRequest::Gpu | DeviceRequest::Named(_) => self.chosen_on_device(),
        }
    }

    /// The elements before the method is known: "auto" stands for one kind with either method of a CPU. `on_device` where
    /// the caller has chosen a device.
    pub(crate) fn foreseen_elements(&self, on_device: bool) -> Elements {
        match on_device {
            true => self.chosen_on_device().elements,
            false => self.foreseen().chosen(Method::QuasiNewton).elements,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn automatic_is_one_method_on_a_device_that_is_named_and_nowhere_else() {
        let on = |device, method| {
            SolverSettings { device, method, ..SolverSettings::default() }.foreseen().method
        };
        let named = || DeviceRequest::Named("any".into());
        let has_solves = cfg!(feature = "gpu-solves");
        let expected = if has_solves { Method::QuasiNewton } else { Method::Xpbd };
        assert_eq!(on(named(), Method::Auto), expected);
        assert_eq!(on(DeviceRequest::Gpu, Method::Auto), expected);
        assert_eq!(on(named(), Method::Explicit), Method::Explicit);
        assert_eq!(on(DeviceRequest::Auto, Method::Auto), Method::Auto);
        assert_eq!(on(DeviceRequest::Cpu, Method::Auto), Method::Auto);
    }
}
