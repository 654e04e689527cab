//! What several tables of a scene file have in common.

use crate::settings::{Range, at_least, choices};

/// Sizes from a micrometre to a hundred metres: what lies beyond is a slip of the unit.
pub(super) const SIZE: Range = at_least(1e-6).up_to(100.0);

choices! {
    /// How values pass from one key to the next.
    pub enum Interpolation {
        /// With zero velocity at each key (3 s^2 - 2 s^3).
        Smooth = "smooth",
        /// With constant velocity between keys.
        Linear = "linear",
    }
}
