//! Contact in a step.

use crate::contact::Wrench;
use crate::layout::Layout;
use crate::scalar::Real;

/// What samples and tools are to each other in a step.
#[derive(Clone, Debug, Default)]
pub struct Contacts {
    /// Of each tool, at the end of the last step.
    pub wrenches: Vec<Wrench>,
}

impl Contacts {
    /// For the steps of a model.
    pub fn new<S: Real>(_layout: &Layout<S>) -> Self {
        Self::default()
    }
}
