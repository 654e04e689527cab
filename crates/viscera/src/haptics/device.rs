//! What a haptic device is to the loop that feels with it.

use crate::scalar::Vec3;
use crate::scalar::rigid::RigidTransform;

/// Where the hand has the stylus of a device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stylus {
    /// From its own frame to the device's; of length in metres.
    pub pose: RigidTransform,
    /// Whether its first button is pressed: jaws close.
    pub is_pressed: bool,
}

/// A device that says where a hand is and pushes against it. It is asked and told once a tick.
pub trait HapticDevice {
    /// Its name, for messages.
    fn name(&self) -> String;

    /// Where the stylus is now. Does not wait for longer than a tick.
    fn read(&mut self) -> Result<Stylus, DeviceError>;

    /// Pushes against the hand from now on: a force [N] and a torque [N m] in the device's axes, of which it leaves out what
    /// it cannot do.
    fn exert(&mut self, force: Vec3<f64>, torque: Vec3<f64>) -> Result<(), DeviceError>;
}

/// Why a device says nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DeviceError {
    /// It is not there, or was taken away.
    #[error(
        "haptic device `{device}` is gone: {reason}; connect it again and start over, or take `--device virtual`"
    )]
    Gone {
        /// Its name.
        device: String,
        /// What its driver says.
        reason: String,
    },
    /// It has not answered for some time.
    #[error(
        "haptic device `{device}` has not answered for {:.0} ms; its force is off; check its cable and its service", 1e3 * .seconds
    )]
    Silent {
        /// Its name.
        device: String,
        /// For so long [s].
        seconds: f64,
    },
    /// It says what is no pose.
    #[error("haptic device `{device}` sends no pose: {reason}; update its service")]
    Garbled {
        /// Its name.
        device: String,
        /// What was wrong.
        reason: String,
    },
}
