//! Why there is no reference solution.

/// Why there is no reference solution.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReferenceError {
    /// More memory than allowed.
    #[error(
        "the reference would need {:.1} GB for {unknowns} unknowns, more than the {:.1} GB allowed; \
         take a coarser mesh, or allow more with `Reference::allow_memory`",
        *bytes as f64 / 1e9, *limit as f64 / 1e9
    )]
    TooLarge {
        /// Three per free vertex.
        unknowns: usize,
        /// What it would take [B].
        bytes: u64,
        /// What it may take [B].
        limit: u64,
    },
    /// A body can drift or turn freely.
    #[error("{}", loose_text(*.vertex, *.turns))]
    Loose {
        /// A vertex of that body.
        vertex: u32,
        /// True where only turning is left free.
        turns: bool,
    },
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
    /// A list has the wrong length.
    #[error("the {what} has {given} entries; the model needs {expected}")]
    Mismatch {
        /// The list.
        what: &'static str,
        /// Its length.
        given: usize,
        /// The length that fits.
        expected: usize,
    },
    /// A number is none, or the step is no time.
    #[error("the {what} must be finite{}", if *.what == "step" { " and above zero" } else { "" })]
    NotFinite {
        /// What is not.
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
    /// A touched sample of no sample or no tool.
    #[error(
        "sample {sample} is said to touch tool {tool}; there are {samples} samples and {tools} tools"
    )]
    UnknownTouch {
        /// The sample given.
        sample: u32,
        /// The tool given.
        tool: u32,
        /// How many samples there are.
        samples: usize,
        /// How many tools there are.
        tools: usize,
    },
    /// Somebody wanted no more of it ([`crate::Reference::stop_where`]).
    #[error("the solve was stopped")]
    Stopped,
    /// Tissue passes through itself.
    #[error(
        "tissue lies in tissue at vertex {vertex}: states of rest know contact with tools only; take a load with which the \
         body does not meet itself, or set contact.self = false where that does not matter"
    )]
    Overlap {
        /// A vertex that lies in a tetrahedron of its body.
        vertex: u32,
    },
    /// Positions that are no state of rest that returns after a push.
    #[error("the body is not stable at these positions, so it does not oscillate; settle it first")]
    Unstable,
    /// Quadratic tetrahedra have no lumped masses.
    #[error("quadratic tetrahedra have no lumped masses: only `settle` is defined for them")]
    NoStep,
    /// Inverse iteration came to no mode.
    #[error(
        "no slowest oscillation after {steps} steps: nothing is free to move, or two are equally slow; \
         begin with another direction"
    )]
    NoMode {
        /// Steps done.
        steps: u32,
    },
    /// Newton's method came to no minimum.
    #[error(
        "Newton's method stopped after {steps} steps with a gradient of {gradient:.1e} N, {:.1e} of \
         the first; start nearer to the solution, or load in smaller steps",
        gradient / start_gradient
    )]
    NotConverged {
        /// Newton steps done.
        steps: u32,
        /// Gradient at the end [N].
        gradient: f64,
        /// Gradient at the start [N].
        start_gradient: f64,
    },
}

fn loose_text(vertex: u32, turns: bool) -> String {
    let (what, cure) = if turns {
        ("is held but free to turn", "hold at least three of its vertices that are not in line")
    } else {
        ("is not held by anything", "pin or attach some of its vertices")
    };
    format!("the body of vertex {vertex} {what}, so it has no state of rest; {cure}")
}
