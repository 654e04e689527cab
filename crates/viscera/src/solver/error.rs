//! Why a step cannot be made.

use crate::settings::Method;

/// Why a step cannot be made. The state is unchanged.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StepError {
    /// The step is not a positive, finite time, or too extreme for the precision in use.
    #[error("the step must be above zero and finite, and so must its square; {dt} s is not")]
    BadStep {
        /// The step given [s].
        dt: f64,
    },
    /// The explicit method would need more small steps than anybody waits for.
    #[error(
        "explicit steps are stable up to {stable:e} s, far below the {dt} s asked for; use \
         `method = \"xpbd\"`, softer tissue, or larger tetrahedra of better shape"
    )]
    TooStiff {
        /// The step given [s].
        dt: f64,
        /// The largest stable one [s].
        stable: f64,
    },
    /// The method has linear tetrahedra only.
    #[error(
        "`elements = \"recovered\"` is computed by the methods \"quasi_newton\" and \"explicit\", and not by \"{method}\"; use \
         one of those, or `elements = \"plain\"`"
    )]
    Elements {
        /// The method of the settings.
        method: Method,
    },
    /// Clusters copy no vertices.
    #[error(
        "`clusters` sweeps without copies of vertices, and `colors = {colors}` makes some; use `colors = \"unlimited\"`, or \
         `clusters = \"none\"`"
    )]
    ClustersAndColors {
        /// The colours of the settings.
        colors: u32,
    },
    /// Clusters were left out.
    #[error(
        "this build sweeps without clusters; use `clusters = \"none\"`, which comes to the same rest"
    )]
    NoClusters,
    /// An input names no vertex.
    #[error("a {what} names vertex {vertex}; the model has {vertex_count}")]
    UnknownVertex {
        /// "pin", "tether" or "force".
        what: &'static str,
        /// The index given.
        vertex: u32,
        /// How many vertices there are.
        vertex_count: usize,
    },
    /// The list of anchors is neither empty nor complete.
    #[error("{given} anchors were given, and the model has {expected}; give all of them or none")]
    AnchorCount {
        /// How many were given.
        given: usize,
        /// How many there are.
        expected: usize,
    },
    /// An input is infinite or not a number.
    #[error(
        "the {what} of a step must be finite in the solver's precision; look for a slip of the unit"
    )]
    NotFinite {
        /// The input concerned.
        what: &'static str,
    },
    /// A tool that tissue cannot meet.
    #[error("tool {tool}: {why}")]
    BadTool {
        /// Its place in the list.
        tool: usize,
        /// What is wrong with it.
        why: &'static str,
    },
    /// Tools, and nothing that they could touch.
    #[error(
        "tools were given, and the model has no samples of its surface that they could touch; take some with \
         `ModelBuilder::sample_surface`"
    )]
    NoSamples,
    /// The method cannot take contact.
    #[error(
        "contact is part of XPBD's rebase: with `rebase = false` tools and bodies touch nothing; leave out `rebase`, use \
         `method = \"quasi_newton\"`, or leave out tools and set `contact.bodies = false`"
    )]
    ContactNeedsRebase,
    /// A device does not compute this contact.
    #[error("on a graphics processor {why}, or `device = \"cpu\"`")]
    ContactOnDevice {
        /// What it cannot do, and what it can.
        why: &'static str,
    },
    /// The solver was built for another model.
    #[error("the model is not the one that the solver was built for; build a solver for it")]
    OtherModel,
    /// State and model do not belong together.
    #[error("the {what} has {given} entries; the model needs {expected}")]
    Mismatch {
        /// The array concerned.
        what: &'static str,
        /// Its length.
        given: usize,
        /// The length that fits.
        expected: usize,
    },
}
