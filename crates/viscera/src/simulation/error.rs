//! Why a simulation cannot be built, changed, or go on.

use super::assemble_error::{AssembleError, BalanceError};
use crate::model::ModelError;
use crate::scene::SceneError;
use crate::settings::DeviceRequest;
use crate::solver::StepError;
#[cfg(feature = "gpu")]
use crate::solver::gpu::GpuError;

/// Why a simulation cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimulationError {
    /// Its bodies make no model.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// Scene and assembly do not belong together.
    #[error(
        "the scene has {expected} {what} and the assembly {found}; assemble the scene that is simulated"
    )]
    OtherScene {
        /// "bodies", "fixings", "motions", "forces" or "tools".
        what: &'static str,
        /// How many the assembly has.
        found: usize,
        /// How many the scene has.
        expected: usize,
    },
    /// A patch of another assembly.
    #[error("a patch names vertex {vertex}; the bodies have {vertex_count}")]
    Patch {
        /// The vertex.
        vertex: u32,
        /// How many vertices there are.
        vertex_count: usize,
    },
    /// A device was asked for that this build knows nothing of.
    #[error(
        "`device = \"{device}\"` needs the GPU backend, which was left out of this build; build with \
         `--features gpu`, or use `device = \"cpu\"`"
    )]
    NoGpuBackend {
        /// What was asked for.
        device: DeviceRequest,
    },
    /// A device was asked for in a scene with tools that it cannot compute contact with.
    #[error("`device = \"{device}\"`: on a graphics processor {why}, or `device = \"cpu\"`")]
    ToolsOnDevice {
        /// What was asked for.
        device: DeviceRequest,
        /// What it cannot do, and what it can.
        why: &'static str,
    },
    /// A device was asked for in a scene with several bodies, which meet, by a method that computes that on the CPU alone.
    #[error(
        "`device = \"{device}\"`: by this method, and in pages, contact between bodies is computed on the CPU; use \
         `method = \"quasi_newton\"`, `device = \"cpu\"` or `device = \"auto\"`, or let bodies pass through each other with \
         `contact.bodies = false` and no ties"
    )]
    BodiesOnDevice {
        /// What was asked for.
        device: DeviceRequest,
    },
    /// A body cannot rest under gravity as it was given.
    #[error(transparent)]
    Balance(#[from] BalanceError),
    /// The method cannot do it.
    #[error(transparent)]
    Step(#[from] StepError),
    /// The device cannot do it.
    #[cfg(feature = "gpu")]
    #[error(transparent)]
    Gpu(#[from] GpuError),
}

/// Why something cannot be done to a running simulation. Nothing of it has been done.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LiveError {
    /// A setting that cannot be.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A patch without vertices.
    #[error(transparent)]
    Patch(#[from] AssembleError),
    /// The model cannot be built or computed like that.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// A patch of a body that there is not.
    #[error("there is no body {body}; the scene has {count}")]
    NoBody {
        /// The number given.
        body: usize,
        /// How many there are.
        count: usize,
    },
    /// A stiffness that is none.
    #[error("a hold needs a stiffness from 1e-6 N/m to 1e12 N/m; {stiffness} N/m is not")]
    Stiffness {
        /// The stiffness given [N/m].
        stiffness: f64,
    },
    /// A place that is none.
    #[error("a hold cannot be led to a place that is no number")]
    NotFinite,
    /// A tool that there is not, or not now.
    #[error("there is no tool {tool} in the scene now: take one up, or wait for it to come")]
    NoTool {
        /// The number given.
        tool: usize,
    },
    /// A pose that is none.
    #[error(
        "tool `{tool}` cannot go there: a pose is a rotation and a place within 1000 m of the origin, all of it numbers"
    )]
    Pose {
        /// The tool.
        tool: String,
    },
    /// A tool that has no jaws.
    #[error("tool `{tool}` has no jaws; take a grasper")]
    NoJaws {
        /// The tool.
        tool: String,
    },
    /// An angle that jaws do not have.
    #[error("tool `{tool}`: {problem}")]
    Jaws {
        /// The tool.
        tool: String,
        /// What is wrong and what to do.
        problem: String,
    },
    /// A moment of something else.
    #[error(
        "settings have changed since this moment was kept, or tools were taken, or it is of another simulation; save it and \
         resume a simulation of its scene"
    )]
    OtherModel,
    /// A hold that there is not, or that was let go.
    #[error("there is no hold {hold}, or it was let go")]
    NoHold {
        /// The number given.
        hold: usize,
    },
}

/// Why a frame could not be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// Positions or stresses are no longer numbers.
    #[error(
        "the simulation diverged at {time:.4} s: positions or stresses are no longer numbers; {advice}"
    )]
    Diverged {
        /// Simulated time [s].
        time: f64,
        /// What the scene's settings leave to do.
        advice: String,
    },
    /// A step was refused.
    #[error(transparent)]
    Step(#[from] StepError),
    /// A change of settings, which the scene wants now, cannot be made.
    #[error(transparent)]
    Change(#[from] Box<LiveError>),
    /// The device failed. What [`Simulation::state`] gives is still that of the last frame.
    #[cfg(feature = "gpu")]
    #[error(transparent)]
    Gpu(#[from] GpuError),
}
