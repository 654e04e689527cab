//! The stages of the explicit method.

/// A stage of the explicit method; `h` is the small step of a connected part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExplicitStage {
    /// Masses and pins of the step; where tissue is viscous, its strain one small step ago.
    Begin,
    /// Forces of all elements, per copy.
    LoadForces,
    /// `v += h (g + M^-1 f)`, `x += h v`, until the part's last small step is done; pins move by their share.
    Advance,
    /// The prediction that a force balance of the mean acceleration needs.
    End,
}
