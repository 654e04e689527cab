//! Coarse meshes against the continuum: how stiff a body is that is meshed with linear tetrahedra, with averaged ones
//! and with recovered-gradient ones. The truth is that of quadratic tetrahedra, extrapolated to no mesh at all; all
//! states of rest are the reference's, so that nothing here is a solver's.
//!
//! Locking: a linear tetrahedron that must keep its shape to bend stores energy that the body does not have, the more
//! the less its volume may change (Hughes, "The Finite Element Method", 2000, chapter 4).
//!
//! | file | what |
//! |---|---|
//! | `cases` | meshes and bodies under loads |
//! | `claims` | what is asked of bars, blocks and angles |
//! | `free` | modes of bodies that nothing holds |
//! | `reported` | organs, two materials, pressure, Poisson's ratio of .499: nothing is asked |

mod cases;
mod claims;
mod free;
mod reported;

use anyhow::Result;
use viscera::layout::Smoothing;

use super::{Context, Section};
use crate::bending::Element;

pub(super) const SECTION: Section = Section {
    name: "locking",
    title: "Coarse meshes against the continuum",
    cases: |quick, _| {
        claims::case_count(quick) + free::case_count(quick) + reported::case_count(quick)
    },
    run,
};

/// The tetrahedra that are compared, with their names.
const ELEMENTS: [(&str, Element); 3] = [
    ("linear", Element::Linear),
    ("averaged", Element::Smooth(Smoothing::AVERAGED)),
    ("recovered", RECOVERED),
];

const RECOVERED: Element = Element::Smooth(Smoothing::RECOVERED);

/// Poisson's ratios at which claims are made.
fn poissons(quick: bool) -> &'static [f64] {
    if quick { &[0.3, 0.49] } else { &[0.3, 0.45, 0.49] }
}

fn run(context: &mut Context) -> Result<()> {
    context.document.paragraph(
        "How much more a mesh gives than the body that it stands for: negative is too stiff. The body is that of \
         ten-node tetrahedra on two or three meshes, extrapolated; all answers are the reference's, by Newton's \
         method. `averaged` has most of its energy at vertices, `recovered` is the recovered-gradient tetrahedron. \
         Columns are Poisson's ratios. E 50 kPa, stable neo-Hookean; bars are 80 mm long and 20 mm thick, the block \
         is 60 x 60 x 30 mm, post and arm of the L-shaped bar are 60 mm long.",
    );
    claims::add(context)?;
    free::add(context)?;
    reported::add(context)
}

fn signed(fraction: f64) -> String {
    format!("{:+.1} %", 100.0 * fraction)
}

fn list(values: impl Iterator<Item = String>) -> String {
    values.collect::<Vec<_>>().join(", ")
}
