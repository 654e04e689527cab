//! `viscera-lab study`: what the published method shows, what it leaves open, and how that is settled here.

mod acceleration;
mod artefact;
mod coloring;
mod convergence;
mod cost;
mod methods;
mod multipliers;
mod step;

use crate::sections::{Context, Program, Section};

/// All sections, in the order of the report.
pub const PROGRAM: Program = Program {
    title: "The study",
    command: "viscera-lab study",
    sections: &[coloring::SECTION, acceleration::SECTION, cost::SECTION],
};
