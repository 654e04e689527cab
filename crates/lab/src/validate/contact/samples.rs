//! More samples of the surface change little: four of each triangle beside sixteen, with the reference.

use std::fmt;

use anyhow::Result;
use viscera_report::{Table, percent};

use super::super::methods::worse;
use super::{Context, depth};

const YOUNG: f64 = 1e4;
/// Of the ball's lowest point below the top [mm]: contact begins at its thickness, 1 mm above it.
const DEPTHS: [f64; 5] = [-0.5, 0.5, 2.0, 4.0, 8.0];
/// Samples of each triangle: none, once and twice cut.
const CUTS: [u32; 3] = [0, 1, 2];
/// Asked of four beside sixteen.
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

fn answer(case: &Case) -> Result<[f64; 3]> {
    let mut forces = [0.0; 3];
    for (force, cuts) in forces.iter_mut().zip(CUTS) {
        let mut pressing = depth::pressing(case.quick, YOUNG, 1e-3 * case.depth)?;
        pressing.cuts = cuts;
        *force = pressing.truth()?.force();
    }
    Ok(forces)
}

pub(super) fn add(context: &mut Context) -> Result<()> {
    let cases = cases(context.quick);
    let answers = context.run_cases(&cases, answer)?;
    context.document.subheading("Samples per triangle");
    context.document.paragraph(
        "The force on the same ball with one, four and sixteen samples of each triangle of the surface, at rest by the \
         reference. At -0.5 mm the ball is within the thickness of contact and does not yet reach the surface.",
    );
    let heads = ["depth", "1 sample", "4 samples", "16 samples", "1 beside 16", "4 beside 16"];
    let mut table = Table::new(heads);
    let mut largest = 0.0;
    for (case, [one, four, sixteen]) in cases.iter().zip(&answers) {
        let error = four / sixteen - 1.0;
        largest = worse(largest, error.abs());
        table.row([
            format!("{} mm", case.depth),
            format!("{one:.5} N"),
            format!("{four:.5} N"),
            format!("{sixteen:.5} N"),
            percent(one / sixteen - 1.0),
            percent(error),
        ]);
    }
    context.document.table(&table);
    context.verdict_of(
        cases.len(),
        "ball on a block, force with 4 samples per triangle beside 16",
        format!("< {}", percent(LIMIT)),
        percent(largest),
        largest < LIMIT,
    );
    Ok(())
}
