//! `viscera-lab study`: what the published method shows, what it leaves open, and how that is settled here.

mod acceleration;
mod artefact;
mod bodies;
mod coloring;
mod convergence;
mod cost;
mod device;
mod methods;
mod multipliers;
mod panels;
mod quasi_newton;
mod stability;
pub mod step;
mod stiffness;

use crate::sections::{Context, Program, Section};

/// All sections, in the order of the report.
pub const PROGRAM: Program = Program {
    title: "The study",
    command: "viscera-lab study",
    sections: &[
        coloring::SECTION,
        bodies::COLORS,
        bodies::ACCELERATIONS,
        acceleration::SECTION,
        stiffness::SECTION,
        stability::SECTION,
        cost::SECTION,
        quasi_newton::SECTION,
        quasi_newton::VAST,
    ],
    extra: &["vast"],
};
