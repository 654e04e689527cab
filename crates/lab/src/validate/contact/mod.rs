//! Contact: a ball that is pressed into a block, tissue on tissue, and tools in motion.
//!
//! | file | what must come out |
//! |---|---|
//! | `hertz` | the closed form of a layer of finite depth, with the reference |
//! | `depth` | the reference's force and shape, with each of the library's methods |
//! | `samples` | the same force with more samples of the surface |
//! | `pressed` | the reference's force and shape of a block on a plane, for blocks that meet their images; springs in a row |
//! | `motion` | forces of tools in motion, and how far they are said to be off |

mod depth;
mod hertz;
mod motion;
mod pressed;
mod samples;

use anyhow::Result;

use super::{Context, Section};

pub(super) const SECTION: Section = Section {
    name: "contact",
    title: "Contact",
    cases: |quick, _| {
        hertz::case_count(quick)
            + depth::case_count(quick)
            + samples::case_count(quick)
            + pressed::case_count(quick)
            + motion::case_count(quick)
    },
    run,
};

fn run(context: &mut Context) -> Result<()> {
    hertz::add(context)?;
    depth::add(context)?;
    samples::add(context)?;
    pressed::add(context)?;
    motion::add(context)
}
