//! `viscera-lab validate`: sections that compare the library with what must come out.

mod cantilever;
mod contact;
mod course;
mod decay;
mod expected;
mod frequency;
mod friction;
mod indentation;
mod independence;
mod locking;
mod mesh_error;
mod methods;
mod motion;
mod organ;
mod organs;
mod patch;
mod path;
mod rest;
mod stress;
mod twist;
mod uniaxial;

pub use organs::write_organs;

use crate::sections::{Context, Program, Section};

/// All sections, in the order of the report.
pub const PROGRAM: Program = Program {
    title: "Validation",
    command: "viscera-lab validate",
    sections: &[
        patch::SECTION,
        uniaxial::SECTION,
        cantilever::SECTION,
        locking::SECTION,
        mesh_error::SECTION,
        twist::SECTION,
        frequency::SECTION,
        indentation::SECTION,
        contact::SECTION,
        friction::SECTION,
        organ::SECTION,
        rest::SECTION,
        independence::SECTION,
        motion::SECTION,
        decay::SECTION,
        organs::SECTION,
        expected::SECTION,
        stress::SECTION,
    ],
    extra: &[],
};
