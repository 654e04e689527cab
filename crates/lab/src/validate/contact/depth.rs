//! Force and shape of a block at rest under a ball, by each of the library's methods and by the reference, with the
//! same law of contact.

use std::fmt;

use anyhow::Result;
use viscera::material::MaterialModel;
use viscera::settings::Method;
use viscera_report::{Axis, Plot, Series, Style, Table, percent};

use super::super::methods::{floored_percent, worse};
use super::Context;
use crate::contact_cases::{Pressing, Way};
use crate::load_cases::{FRAME_RATE, tissue};

const POISSON: f64 = 0.45;
/// Of the ball [m].
const RADIUS: f64 = 0.015;
/// Of the block's cells [m].
const EDGE: f64 = 0.005;
/// Of the ball's lowest point below the top [mm].
const DEPTHS: [u32; 3] = [2, 4, 8];
/// Asked of force and shape, and of forces by any two methods.
const FORCE: f64 = 1e-3;
const SHAPE: f64 = 1e-4;
const SWAP: f64 = 2e-3;
/// Below this an error is round-off, whose digits differ from machine to machine.
const FLOOR: f64 = 1e-8;

const WAYS: [Way; 5] = [
    Way::of(Method::Xpbd),
    Way::of(Method::Xpbd).in_single(),
    Way::of(Method::QuasiNewton),
    Way::of(Method::QuasiNewton).in_single(),
    Way::of(Method::Explicit),
];

/// The ball over a block that is as fine as time allows.
pub(super) fn pressing(quick: bool, young: f64, depth: f64) -> Result<Pressing> {
    let cells = if quick { [8, 8, 4] } else { [12, 12, 6] };
    let tissue = tissue(MaterialModel::StableNeoHookean, young, POISSON)?;
    Ok(Pressing { depth, ..Pressing::on_block(cells, EDGE, RADIUS, tissue)? })
}

#[derive(Clone, Copy, Debug)]
struct Case {
    quick: bool,
    young: f64,
    /// [mm].
    depth: u32,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ball {} mm deep, {} kPa", self.depth, self.young / 1e3)
    }
}

fn cases(quick: bool) -> Vec<Case> {
    let youngs: &[f64] = if quick { &[1e4] } else { &[1e4, 1e5] };
    let of = |&young: &f64| DEPTHS.map(|depth| Case { quick, young, depth });
    youngs.iter().flat_map(of).collect()
}

pub(super) fn case_count(quick: bool) -> usize {
    cases(quick).len()
}

struct Ours {
    /// [N].
    force: f64,
    /// Error of the shape.
    shape: f64,
    /// Share of the steps that the guard has rejected.
    rejected: f64,
    /// Until it was at rest.
    frames: u32,
}

struct Answer {
    true_force: f64,
    /// Of each way.
    library: Vec<Ours>,
}

fn answer(case: &Case) -> Result<Answer> {
    let pressing = pressing(case.quick, case.young, 1e-3 * f64::from(case.depth))?;
    let truth = pressing.truth()?;
    let solve = |way: &Way| -> Result<_> {
        let rest = pressing.settle(way)?;
        let shape = pressing.shape_error(&truth, &rest);
        Ok(Ours { force: rest.force(), shape, rejected: rest.effort, frames: rest.frames })
    };
    let library = WAYS.iter().map(solve).collect::<Result<_>>()?;
    Ok(Answer { true_force: truth.force(), library })
}

pub(super) fn add(context: &mut Context) -> Result<()> {
    let cases = cases(context.quick);
    let answers = context.run_cases(&cases, answer)?;
    context.document.subheading("Force against depth");
    context.document.paragraph(
        "A ball of 15 mm goes down into a block of cells of 5 mm, stable neo-Hookean, nu 0.45, on a fixed bottom, \
         with the usual law of contact and without friction. Errors of the force are relative, those of the shape \
         the largest distance of a vertex from the reference's place over the largest displacement. `time` is how \
         long it took to be at rest, at least 3 s, with a tenth of the velocities taken away after each frame; \
         `rejected` the share of all steps that the guard has rejected.",
    );
    let heads = ["E", "depth", "force, reference", "method", "force, library"];
    let mut table = Table::new(heads.into_iter().chain(["force", "shape", "time", "rejected"]));
    let mut plot = Plot::new(
        "Ball on a block: force against depth",
        Axis::linear("depth [mm]"),
        Axis::linear("force over Young's modulus [N/kPa]"),
    );
    for (case, answer) in cases.iter().zip(&answers) {
        for (way, &Ours { force, shape, rejected, frames }) in WAYS.iter().zip(&answer.library) {
            table.row([
                format!("{} kPa", case.young / 1e3),
                format!("{} mm", case.depth),
                format!("{:.4} N", answer.true_force),
                way.to_string(),
                format!("{force:.4} N"),
                floored_percent((force / answer.true_force - 1.0).abs(), FLOOR),
                floored_percent(shape, FLOOR),
                format!("{:.0} s", f64::from(frames) / FRAME_RATE),
                percent(rejected),
            ]);
        }
    }
    context.document.table(&table);
    let soft = || cases.iter().zip(&answers).filter(|(case, _)| case.young == 1e4);
    let at = |case: &Case, force: f64| [f64::from(case.depth), 0.1 * force];
    let truth = soft().map(|(case, answer)| at(case, answer.true_force));
    let truth = std::iter::once([0.0, 0.0]).chain(truth);
    plot.series(Series::new("reference", truth).with_style(Style::Line));
    for (number, way) in WAYS.iter().enumerate().filter(|(_, way)| !way.single) {
        let ours = soft().map(|(case, answer)| at(case, answer.library[number].force));
        plot.series(Series::new(way.to_string(), ours).with_style(Style::Markers));
    }
    context.document.figure("contact-depth", &plot)?;
    verdicts(context, &answers);
    Ok(())
}

fn verdicts(context: &mut Context, answers: &[Answer]) {
    for (number, way) in WAYS.iter().enumerate() {
        let (mut force_error, mut shape_error) = (0.0, 0.0);
        for Answer { true_force, library } in answers {
            let Ours { force, shape, .. } = library[number];
            force_error = worse(force_error, (force / true_force - 1.0).abs());
            shape_error = worse(shape_error, shape);
        }
        let errors = [("force", force_error, FORCE), ("shape", shape_error, SHAPE)];
        for (what, error, limit) in errors {
            let what = format!("ball on a block, largest error of the {what}, {way}");
            let measured = floored_percent(error, FLOOR);
            context.verdict(what, format!("< {}", percent(limit)), measured, error < limit);
        }
    }
    let spread = |answer: &Answer| {
        let forces = || answer.library.iter().map(|ours| ours.force);
        let (least, most) = (forces().fold(f64::INFINITY, f64::min), forces().fold(0.0, worse));
        (most - least) / answer.true_force
    };
    let spread = answers.iter().map(spread).fold(0.0, worse);
    context.verdict(
        "ball on a block, force by one method and by another",
        format!("< {}", percent(SWAP)),
        floored_percent(spread, FLOOR),
        spread < SWAP,
    );
}
