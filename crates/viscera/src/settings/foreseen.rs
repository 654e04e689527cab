//! What settings alone tell of the method in force.

use super::{DeviceRequest, Elements, Method, SolverSettings};

impl SolverSettings {
    /// The settings in force, as far as they tell it alone: on a device that is asked for by name "auto" is "xpbd". Elsewhere
    /// it stays what it is: a scene chooses, mostly "quasi_newton".
    pub fn foreseen(&self) -> Self {
        match self.device {
            DeviceRequest::Auto | DeviceRequest::Cpu => self.clone(),
            DeviceRequest::Gpu | DeviceRequest::Named(_) => self.chosen(Method::Xpbd),
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
    fn automatic_is_xpbd_on_a_device_that_is_named_and_nowhere_else() {
        let on = |device, method| {
            SolverSettings { device, method, ..SolverSettings::default() }.foreseen().method
        };
        let named = || DeviceRequest::Named("any".into());
        assert_eq!(on(named(), Method::Auto), Method::Xpbd);
        assert_eq!(on(DeviceRequest::Gpu, Method::Auto), Method::Xpbd);
        assert_eq!(on(named(), Method::Explicit), Method::Explicit);
        assert_eq!(on(DeviceRequest::Auto, Method::Auto), Method::Auto);
        assert_eq!(on(DeviceRequest::Cpu, Method::Auto), Method::Auto);
    }
}
