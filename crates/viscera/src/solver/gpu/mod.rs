//! The GPU backend: the stages of a plan as dispatches of one submission.
//!
//! ```text
//! GpuSolver::new      constants, buffers and kernels onto the device; stages written down as dispatches
//! GpuSolver::step     inputs and constants of the step, one compute pass, one submission; no waiting
//! GpuSolver::steps    several steps, each with inputs of its own, in one submission
//! GpuSolver::request  copies what moves into memory that the host can read, behind the last step
//! GpuSolver::newest   the newest copy that has arrived, if any; never waits
//! GpuSolver::ask_for_frame, take_frame   all that a simulation needs of a frame, without waiting
//! GpuSolver::restart  warm-start reset: multipliers from positions
//! GpuSolver::time_step  the same, timed stage by stage by the device's clock
//! GpuSolver::copy_positions, GpuSurface::place_copy   positions of a frame for a picture, and values for its colours, on the device
//! GpuSurface::update  a fine surface behind the last step, ready to be drawn
//! ```
//!
//! The state lives on the device, vertices in the solver's numbering. What decides during a step (step
//! lengths, weights, rejections) lies in one record there, `Control`; nothing is read back inside a step.

mod bindings;
mod buffers;
mod clock;
mod clusters;
mod contact;
mod control;
mod copy;
mod cost;
mod device;
mod error;
mod frames;
mod history;
mod inputs;
pub mod kernels;
mod layout;
pub(in crate::solver) mod limits;
mod meetings;
mod members;
mod outgoing;
mod parts;
mod pipelines;
mod positions;
mod reading;
pub(in crate::solver) mod record;
mod report;
mod ring;
mod second;
mod sent;
mod shared;
mod shown;
mod slots;
mod solver;
mod stages;
mod step;
mod surface;
mod surface_kernels;
mod surface_values;
mod switch;
mod timing;
mod tools;
mod traffic;
pub(in crate::solver) mod uniforms;
mod values;
mod words;

/// Whether this build has the quasi-Newton method on devices.
pub use super::quasi_newton::on_device::IS_THERE as HAS_SOLVES;
pub use copy::MemoryCopy;
pub use cost::StepCost;
pub use device::{Adapter, Device, baseline, shortfall};
pub use error::GpuError;
pub use frames::Frame;
pub use positions::DevicePositions;
pub use shared::{HostLayout, host_layouts};
pub use shown::TissueValue;
pub use slots::Slot;
pub use solver::GpuSolver;
pub use surface::{GpuSurface, Skin};
pub use timing::{StageTime, StepPart, StepTimes};
pub use traffic::{DispatchTraffic, Traffic};
