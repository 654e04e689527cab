//! Part of section 4: Anderson on multipliers, and when stress makes it diverge.

use anyhow::Result;
use std::fmt;
use viscera::material::MaterialModel;
use viscera::measure::measure_tets;
use viscera::settings::{AndersonOn, Colors, SolverSettings};
use viscera_report::{Axis, Plot, Series, Style, Table, scientific};

use super::Context;
use super::methods::{COLORED, JACOBI, anderson, published};
use super::step::{Curve, MeasuredStep};
use crate::scenes::{DENSITY, FRAME_RATE, Scene, Size};

/// Errors above this count as divergence: path errors of published XPBD stay below it.
const DIVERGED: f64 = 10.0;

const ITERATIONS: u32 = 200;

/// Scene, frames before the step, and parts of a frame that the step takes.
const MOMENTS: [(&str, u32, &[f64]); 2] =
    [("twist", 11, &[1.0, 10.0, 100.0]), ("cantilever", 10, &[1.0, 10.0, 100.0])];

/// Young's moduli [Pa]: stress follows them where the shape is given, as in the twist.
fn moduli(quick: bool) -> &'static [f64] {
    if quick { &[1e3, 1e5] } else { &[1e2, 1e3, 1e4, 1e5] }
}

struct Case {
    scene: &'static str,
    frames: u32,
    young: f64,
    parts: f64,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { scene, young, parts, .. } = self;
        write!(f, "Anderson on multipliers, {scene}, {young} Pa, 1/{} s", parts * FRAME_RATE)
    }
}

/// Where a case came to.
struct Answer {
    /// Largest principal stress [Pa] at the end of the step, without its sign.
    stress: f64,
    /// `h^2 sigma 12/(rho dx^2)`.
    number: f64,
    colored: Curve,
    jacobi: Curve,
    both: Curve,
}

fn cases(quick: bool) -> Vec<Case> {
    let mut cases = Vec::new();
    for (scene, frames, parts) in MOMENTS {
        // A bar that hangs in 100 Pa has no shape that Green strain would tell from its reflection.
        let least = if scene == "cantilever" { 1e4 } else { 0.0 };
        for &young in moduli(quick).iter().filter(|young| **young >= least) {
            cases.extend(parts.iter().map(|&parts| Case { scene, frames, young, parts }));
        }
    }
    cases
}

pub(super) fn case_count(quick: bool) -> usize {
    cases(quick).len()
}

pub(super) fn run(context: &mut Context) -> Result<()> {
    context.document.subheading("Anderson on multipliers alone");
    context.document.paragraph(
        "The other way out is to mix multipliers and recompute positions from them, \
         `x = xt + M^-1 J(x)^T l`, as proposed by those who saw that mixing positions stiffens. The tie then \
         holds, but `J` depends on `x`: the sum `J(x)^T l` is the force of the tissue, its derivative is the \
         geometric stiffness `K_geo` (stress times `g g^T`), and taking it from the last iterate is an \
         explicit step, stable only where `h^2 |K_geo| < M`: for edges `dx` under the stress `sigma` about \
         `h^2 sigma 12/(rho dx^2) < 1`. No unknown of the step is damped where that fails, however many \
         iterations are made. The table has this number beside what happened, over stiffness (a twisted bar: \
         its shape is given, its stress is not), sagging under weight (the stress hardly depends on the \
         stiffness) and time steps. `sigma` is the largest principal second Piola stress of the step's end, \
         `dx` the edge of a cube of six mean tetrahedra. E is swept here, so `--set young` does not matter.",
    );
    let cases = cases(context.quick);
    let changes = context.changes.clone();
    let size = if context.quick { Size::Tiny } else { Size::Small };
    let answers = context.run_cases(&cases, |case| {
        let law = MaterialModel::SaintVenantKirchhoff;
        let poisson = changes.poisson.unwrap_or(0.45);
        let tissue = crate::scenes::tissue(law, case.young, poisson)?;
        answer(case, changes.scene(case.scene, size, tissue)?)
    })?;
    report(context, &cases, &answers)
}

fn answer(case: &Case, scene: Scene) -> Result<Answer> {
    let dt = 1.0 / FRAME_RATE / case.parts;
    let edge = edge(&scene);
    let step = MeasuredStep::after(scene, case.frames, dt)?;
    let stress = stress(&step)?;
    let follow = |colors: Colors, on| {
        let settings = anderson(published(colors), on);
        step.follow::<f64>(&SolverSettings { iterations: ITERATIONS, ..settings })
    };
    Ok(Answer {
        stress,
        number: dt * dt * stress * 12.0 / (DENSITY * edge * edge),
        colored: follow(COLORED, AndersonOn::Multipliers)?,
        jacobi: follow(JACOBI, AndersonOn::Multipliers)?,
        both: follow(COLORED, AndersonOn::Both)?,
    })
}

/// Edge [m] of a cube that six tetrahedra of the mean volume fill.
fn edge(scene: &Scene) -> f64 {
    let count = scene.mesh.tets().len();
    let volume: f64 =
        (0..count).map(|tet| viscera::mesh::tet_volume(scene.mesh.corners(tet))).sum();
    libm::cbrt(6.0 * volume / count as f64)
}

/// Largest principal second Piola stress [Pa], tension or pressure, at the end of a step.
fn stress(step: &MeasuredStep) -> Result<f64> {
    let model = step.scene.model::<f64>(&SolverSettings::default())?;
    let mut tets = Vec::new();
    measure_tets(&model, &step.exact, &mut tets);
    let (lambda, mu) = (step.scene.tissue.lame_lambda(), step.scene.tissue.lame_mu());
    let largest = tets.iter().map(|tet| {
        // S = 2 mu E + lambda tr(E) I has the axes of E.
        let strains = tet.stretches.map(|s| 0.5 * (s * s - 1.0));
        let pressure = lambda * strains.iter().sum::<f64>();
        strains.iter().map(|strain| (2.0 * mu * strain + pressure).abs()).fold(0.0, f64::max)
    });
    Ok(largest.fold(0.0, f64::max))
}

fn diverged(curve: &Curve) -> bool {
    curve.errors.last().is_none_or(|error| *error > DIVERGED)
}

fn outcome(curve: &Curve) -> String {
    match curve.errors.last() {
        Some(error) if *error <= DIVERGED => format!("{error:.2}"),
        _ => format!("diverges ({})", curve.errors.len() - 1),
    }
}

fn report(context: &mut Context, cases: &[Case], answers: &[Answer]) -> Result<()> {
    let mut table = Table::new([
        "scene",
        "E [kPa]",
        "h [s]",
        "sigma [Pa]",
        "h^2 sigma 12/(rho dx^2)",
        "coloured, on multipliers",
        "Jacobi, on multipliers",
        "coloured, on both",
    ]);
    let mut data = Table::new(["scene", "young", "dt", "number", "coloured", "jacobi", "both"]);
    let mut plot = Plot::new(
        "Anderson on multipliers, coloured, and the bound",
        Axis::logarithmic("h^2 sigma 12/(rho dx^2)"),
        Axis::logarithmic("error after 200 iterations"),
    );
    plot.reference(DIVERGED, "counts as divergence");
    for (scene, ..) in MOMENTS {
        let points = cases.iter().zip(answers).filter(|(case, _)| case.scene == scene);
        let end = |curve: &Curve| curve.errors.last().map_or(1e6, |error| error.min(1e6));
        let points = points.map(|(_, answer)| [answer.number, end(&answer.colored)]);
        plot.series(Series::new(scene, points).with_style(Style::Markers));
    }
    let (mut above, mut both_right) = (0, 0);
    for (case, answer) in cases.iter().zip(answers) {
        let Answer { stress, number, colored, jacobi, both } = answer;
        let step = format!("1/{}", case.parts * FRAME_RATE);
        let outcomes = [colored, jacobi, both].map(outcome);
        let young = format!("{}", case.young / 1e3);
        let [a, b, c] = &outcomes;
        table.row([case.scene, &young, &step, &format!("{stress:.0}"), &scientific(*number), a, b, c]);
        let young = case.young.to_string();
        data.row([case.scene, &young, &step, &format!("{number:.6e}"), a, b, c]);
        above += usize::from(*number > 1.0);
        both_right += usize::from((*number > 1.0) == (diverged(colored) && diverged(jacobi)));
    }
    context.document.table(&table);
    context.plot(
        "acceleration-bound",
        &plot,
        "Left of 1 the iteration stays; right of it the error grows without end (cut off at 1e6).",
    )?;
    context.document.data("acceleration-bound", "All cases", &data)?;
    let count = cases.len();
    context.document.paragraph(format!(
        "In {above} of {count} cases the number is above 1. It tells right what happens in {both_right} of \
         {count}: divergence above, none below. A number in the last columns is the error after \
         {ITERATIONS} iterations, in brackets stand the iterations until the error passed 1e6 or all of them."
    ));
    Ok(())
}
