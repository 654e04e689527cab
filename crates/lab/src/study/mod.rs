//! `viscera-lab study`: what the published method shows, what it leaves open, and how that is settled here.

mod coloring;
mod methods;
mod stability;
mod step;
mod stiffness;

use crate::sections::{Context, Program, Section};

/// All sections, in the order of the report.
pub const PROGRAM: Program = Program {
    title: "The study",
    command: "viscera-lab study",
    sections: &[coloring::SECTION, stiffness::SECTION, stability::SECTION],
};
