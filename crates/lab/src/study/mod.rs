//! `viscera-lab study`: what the published method shows, what it leaves open, and how that is settled here.

mod bodies;
mod coloring;
mod device;
mod methods;
mod panels;
mod step;

use crate::sections::{Context, Program, Section};

/// All sections, in the order of the report.
pub const PROGRAM: Program = Program {
    title: "The study",
    command: "viscera-lab study",
    sections: &[coloring::SECTION, bodies::COLORS, bodies::ACCELERATIONS],
};
