//! More samples of the surface change little: four of each triangle beside nine and sixteen, with the reference.

use std::fmt;

use anyhow::Result;
use viscera_report::{Table, percent};

use super::super::methods::worse;
use super::{Context, depth};
use crate::contact_cases::Sampling;

const YOUNG: f64 = 1e4;
/// Of the ball's lowest point below the top [mm]: contact begins at its thickness, 1 mm above it. Asked is something
/// from 0 on.
const DEPTHS: [f64; 6] = [-0.5, 0.0, 0.5, 2.0, 4.0, 8.0];
const SAMPLINGS: [Sampling; 4] =
    [Sampling::Cut(0), Sampling::Cut(1), Sampling::Nine, Sampling::Cut(2)];
/// Asked of four beside nine and sixteen.
const LIMIT: f64 = 0.015;

#[derive(Clone, Copy, Debug)]
struct Case {
    quick: bool,
    /// [mm].
    depth: f64,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "samples, ball {} mm deep", self.depth)
    }
}

fn cases(quick: bool) -> Vec<Case> {
    DEPTHS.iter().map(|&depth| Case { quick, depth }).collect()
}

pub(super) fn case_count(quick: bool) -> usize {
    cases(quick).len()
}

fn answer(case: &Case) -> Result<[f64; 4]> {
    let mut forces = [0.0; 4];
    for (force, samples) in forces.iter_mut().zip(SAMPLINGS) {
        let mut pressing = depth::pressing(case.quick, YOUNG, 1e-3 * case.depth)?;
        pressing.samples = samples;
        *force = pressing.truth()?.force();
    }
    Ok(forces)
}

pub(super) fn add(context: &mut Context) -> Result<()> {
    let cases = cases(context.quick);
    let answers = context.run_cases(&cases, answer)?;
    context.document.subheading("Samples per triangle");
    context.document.paragraph(
        "The force on the same ball with one, four, nine and sixteen samples of each triangle of the surface, at \
         rest by the reference. At -0.5 mm the ball is within the thickness of contact and does not yet reach the \
         surface.",
    );
    let heads = ["depth", "1 sample", "4 samples", "9 samples", "16 samples"];
    let heads = heads.into_iter().chain(["1 beside 16", "4 beside 9", "4 beside 16"]);
    let mut table = Table::new(heads);
    let mut largest = [0.0; 2];
    for (case, forces) in cases.iter().zip(&answers) {
        let [one, four, nine, sixteen] = *forces;
        let errors = [four / nine - 1.0, four / sixteen - 1.0];
        if case.depth >= 0.0 {
            largest = std::array::from_fn(|i| worse(largest[i], errors[i].abs()));
        }
        let force = |force: &f64| format!("{force:.5} N");
        let errors = [one / sixteen - 1.0, errors[0], errors[1]].map(percent);
        let cells = std::iter::once(format!("{} mm", case.depth)).chain(forces.iter().map(force));
        table.row(cells.chain(errors));
    }
    context.document.table(&table);
    for (more, largest) in ["9", "16"].into_iter().zip(largest) {
        context.verdict(
            format!("ball 0 to 8 mm in a block, force with 4 samples per triangle beside {more}"),
            format!("< {}", percent(LIMIT)),
            percent(largest),
            largest < LIMIT,
        );
    }
    Ok(())
}
