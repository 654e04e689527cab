//! Errors of a graphics processor.

use crate::mesh::embed::EmbeddingError;
use crate::solver::error::StepError;

/// Why the GPU backend cannot do what was asked. Nothing was changed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GpuError {
    /// There is none.
    #[error(
        "no graphics adapter was found; install its Vulkan driver (without a graphics card: \
         `apt-get install mesa-vulkan-drivers libvulkan1`; for a page: a browser with WebGPU), or use \
         `device = \"cpu\"`"
    )]
    NoAdapter,
    /// None has such a name.
    #[error("no adapter is called `{name}`; there are: {known}")]
    UnknownAdapter {
        /// What was asked for.
        name: String,
        /// The names there are.
        known: String,
    },
    /// The adapter cannot do what every kernel needs.
    #[error("{name} is below WebGPU's default limits: {lacking}; use `device = \"cpu\"`")]
    BelowBaseline {
        /// The adapter.
        name: String,
        /// What it lacks.
        lacking: String,
    },
    /// The driver said no.
    #[error("{name} gave no device: {reason}; use another adapter or `device = \"cpu\"`")]
    Refused {
        /// The adapter.
        name: String,
        /// Its reason.
        reason: String,
    },
    /// A mesh is too large for the device.
    #[error(
        "{what} of this model need {needed} bytes, and {name} binds at most {limit}: use a mesh of \
         about {largest} tetrahedra or fewer, or `device = \"cpu\"`"
    )]
    TooLarge {
        /// The array that does not fit.
        what: &'static str,
        /// Its size [bytes].
        needed: u64,
        /// What the device allows [bytes].
        limit: u64,
        /// The adapter.
        name: String,
        /// Tetrahedra that would fit, in proportion.
        largest: u64,
    },
    /// Its memory is used up.
    #[error(
        "{name} has no room for this model: use a coarser mesh, close what else uses its memory, or `device = \"cpu\"`"
    )]
    NoRoom {
        /// The adapter.
        name: String,
    },
    /// A fine surface is too large for the device.
    #[error(
        "a surface needs an array of {needed} bytes, and {name} binds at most {limit}: use one of about \
         {largest} vertices or fewer"
    )]
    SurfaceTooLarge {
        /// The size of the array [bytes].
        needed: u64,
        /// What the device allows [bytes].
        limit: u64,
        /// The adapter.
        name: String,
        /// Vertices that would fit, in proportion.
        largest: u64,
    },
    /// A surface was bound to other tetrahedra.
    #[error("a surface does not fit the model: {0}; bind it to the mesh that the model is made of")]
    Embedding(#[from] EmbeddingError),
    /// Only its solver places such a surface.
    #[error(
        "this surface is where its solver brings it; make one with `GpuSurface::following` to place it"
    )]
    FollowsSolver,
    /// The device was lost.
    #[error("{name} was lost ({reason}); what was finished is kept")]
    Lost {
        /// The adapter.
        name: String,
        /// The driver's reason.
        reason: String,
    },
    /// A step that cannot be made.
    #[error(transparent)]
    Step(#[from] StepError),
    /// The GPU computes in single precision.
    #[error(
        "graphics processors compute in single precision; use `precision = \"f32\"` or `device = \"cpu\"`"
    )]
    DoublePrecision,
    /// The kernels of the method were left out.
    #[error(
        "this build leaves the quasi-Newton method to the CPU; use `device = \"cpu\"` or \"auto\", or `method = \"xpbd\"`"
    )]
    OnlyOnCpu,
    /// The method has no kernels for these elements.
    #[error(
        "XPBD has no `elements = \"recovered\"`, nor has a build without `gpu-solves` on a graphics processor; use `elements = \"plain\"`, `device = \"cpu\"`, or another method"
    )]
    PlainElements,
}
