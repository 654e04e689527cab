//! Tissue that is felt: haptic devices, the force that is sent to them, and a simulated hand.
//!
//! ```text
//! simulation   m a = k (x - t) + .. + F_tissue         the tool, held by a spring: crate::contact::held
//! device       F = r g k (t - x)                       a thousand times a second, t the tool as last seen, g energy, r contact
//!              |F - F_before| <= 0.05 N;   E = -sum F.dx >= 0
//! ```
//!
//! The device never waits for the simulation, which may be slower, late, or lose frames: it sees the tool where it was last, and
//! the tool's spring is all that it knows. What a hand feels is the spring and the tissue in a row, `1/(1/k + 1/K)`.
//!
//! Nothing here looks at a clock: the loop is the caller's (`viscera haptics` has one).

mod device;
mod hand;
mod rendering;

pub use device::{DeviceError, HapticDevice, Stylus};
pub use hand::{Path, VirtualDevice};
pub use rendering::{Observer, Rendering, Seen};
