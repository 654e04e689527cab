//! Part of section 4: Anderson on multipliers, and when stress makes it diverge.

use anyhow::Result;
use std::fmt;
use viscera::material::MaterialModel;
use viscera::measure::measure_tets;
use viscera::settings::{AndersonOn, Colors, Count, SolverSettings};
use viscera_report::{Axis, Plot, Series, Style, Table, scientific};

use super::Context;
use super::convergence::{CEILING, FLOOR, in_data, in_words, level_name};
use super::methods::{COLORED, JACOBI, anderson, published};
use super::step::MeasuredStep;
use crate::load_cases::{DENSITY, FRAME_RATE, LoadCase, Size};

/// What diverges is drawn here.
const LOST: f64 = 1e6;
/// At most this error counts as arrived.
const ARRIVED: f64 = 1e-3;

const ITERATIONS: u32 = 200;

/// Scene, frames before the step, and parts of a frame that the step takes.
const MOMENTS: [(&str, u32, &[f64]); 2] =
    [("twist", 11, &[1.0, 10.0, 100.0]), ("cantilever", 10, &[1.0, 10.0, 100.0])];

/// Young's moduli [Pa]: stress follows them where the shape is given, as in the twist.
fn moduli(quick: bool) -> &'static [f64] {
    if quick { &[1e3, 1e5] } else { &[1e2, 1e3, 1e4, 1e5] }
}

struct Case {
    load_case: &'static str,
    frames: u32,
    young: f64,
    parts: f64,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { load_case, young, parts, .. } = self;
        write!(f, "Anderson on multipliers, {load_case}, {young} Pa, 1/{} s", parts * FRAME_RATE)
    }
}

/// Where a case came to.
struct Answer {
    /// Largest principal stress [Pa] at the end of the step, without its sign.
    stress: f64,
    /// `h^2 sigma 12/(rho dx^2)`.
    number: f64,
    /// Last errors of Anderson on multipliers over coloured sweeps and over Jacobi's, and of Anderson on
    /// both over coloured ones.
    ends: [f64; 3],
}

impl Answer {
    /// Whether mixing multipliers diverges in one of the two.
    fn diverges(&self) -> bool {
        self.ends[0].max(self.ends[1]) > CEILING
    }
}

fn cases(quick: bool) -> Vec<Case> {
    let mut cases = Vec::new();
    for (load_case, frames, parts) in MOMENTS {
        // A bar that hangs in 100 Pa has no shape that Green strain would tell from its reflection.
        let least = if load_case == "cantilever" { 1e4 } else { 0.0 };
        for &young in moduli(quick).iter().filter(|young| **young >= least) {
            cases.extend(parts.iter().map(|&parts| Case { load_case, frames, young, parts }));
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
         explicit step, stable for certain only where `h^2 |K_geo| < M`: for edges `dx` under the stress `sigma` about \
         `h^2 sigma 12/(rho dx^2) < 1`. More iterations do not help where that fails. The table has this number beside what happened, over stiffness (a twisted bar: \
         its shape is given, its stress is not), sagging under weight (the stress hardly depends on the \
         stiffness) and time steps. `sigma` is the largest principal second Piola stress of the step's end, \
         `dx` the edge of a cube of six mean tetrahedra. E is swept here, so `--set young` does not matter.",
    );
    let cases = cases(context.quick);
    let changes = context.changes;
    let size = if context.quick { Size::Tiny } else { Size::Small };
    let answers = context.run_cases(&cases, |case| {
        let law = MaterialModel::SaintVenantKirchhoff;
        let poisson = changes.poisson.unwrap_or(0.45);
        let tissue = crate::load_cases::tissue(law, case.young, poisson)?;
        answer(case, changes.load_case(case.load_case, size, tissue)?)
    })?;
    report(context, &cases, &answers)
}

fn answer(case: &Case, load_case: LoadCase) -> Result<Answer> {
    let dt = 1.0 / FRAME_RATE / case.parts;
    let edge = edge(&load_case);
    let step = MeasuredStep::after(load_case, case.frames, dt)?;
    let stress = stress(&step)?;
    let end = |colors: Colors, on| -> Result<f64> {
        let settings = anderson(published(colors), on);
        let settings = SolverSettings { iterations: Count::Of(ITERATIONS), ..settings };
        Ok(step.follow::<f64>(&settings)?.last())
    };
    let ends = [
        end(COLORED, AndersonOn::Multipliers)?,
        end(JACOBI, AndersonOn::Multipliers)?,
        end(COLORED, AndersonOn::Both)?,
    ];
    let number = dt * dt * stress * 12.0 / (DENSITY * edge * edge);
    Ok(Answer { stress, number, ends })
}

/// Edge [m] of a cube that six tetrahedra of the mean volume fill.
fn edge(load_case: &LoadCase) -> f64 {
    let count = load_case.mesh.tets().len();
    let volume: f64 =
        (0..count).map(|tet| viscera::mesh::tet_volume(load_case.mesh.corners(tet))).sum();
    libm::cbrt(6.0 * volume / count as f64)
}

/// Largest principal second Piola stress [Pa], tension or pressure, at the end of a step.
fn stress(step: &MeasuredStep) -> Result<f64> {
    let model = step.load_case.model::<f64>()?;
    let mut tets = Vec::new();
    measure_tets(&model, &step.exact, &mut tets);
    let (lambda, mu) = (step.load_case.tissue.lame_lambda(), step.load_case.tissue.lame_mu());
    let largest = tets.iter().map(|tet| {
        // S = 2 mu E + lambda tr(E) I has the axes of E.
        let strains = tet.stretches.map(|s| 0.5 * (s * s - 1.0));
        let pressure = lambda * strains.iter().sum::<f64>();
        strains.iter().map(|strain| (2.0 * mu * strain + pressure).abs()).fold(0.0, f64::max)
    });
    Ok(largest.fold(0.0, f64::max))
}

fn report(context: &mut Context, cases: &[Case], answers: &[Answer]) -> Result<()> {
    tabulate(context, cases, answers);
    figure(context, cases, answers)?;
    conclude(context, answers);
    Ok(())
}

fn tabulate(context: &mut Context, cases: &[Case], answers: &[Answer]) {
    let mut table = Table::new([
        "scene",
        "E [kPa]",
        "h [s]",
        "sigma [Pa]",
        "h^2 sigma 12/(rho dx^2)",
        "on multipliers, coloured",
        "on multipliers, Jacobi",
        "on both, coloured",
    ]);
    for (case, Answer { stress, number, ends }) in cases.iter().zip(answers) {
        let [young, step] = [(case.young / 1e3).to_string(), step_name(case)];
        let (stress, number) = (format!("{stress:.0}"), scientific(*number));
        let [colored, jacobi, both] = ends.map(in_words);
        table.row([case.load_case, &young, &step, &stress, &number, &colored, &jacobi, &both]);
    }
    context
        .document
        .paragraph(format!("Errors after {ITERATIONS} iterations of Anderson's method:"));
    context.document.table(&table);
}

fn step_name(case: &Case) -> String {
    format!("1/{}", case.parts * FRAME_RATE)
}

fn figure(context: &mut Context, cases: &[Case], answers: &[Answer]) -> Result<()> {
    let mut plot = Plot::new(
        "Anderson on multipliers, the worse of coloured and Jacobi",
        Axis::logarithmic("h^2 sigma 12/(rho dx^2)"),
        Axis::logarithmic(format!("error after {ITERATIONS} iterations")),
    );
    plot.reference(CEILING, "counts as divergence");
    let mut data = Table::new(["scene", "young", "step", "number", "coloured", "jacobi", "both"]);
    for (load_case, ..) in MOMENTS {
        let mut points = Vec::new();
        for (case, Answer { number, ends, .. }) in
            cases.iter().zip(answers).filter(|(case, _)| case.load_case == load_case)
        {
            points.push([*number, ends[0].max(ends[1]).clamp(FLOOR, LOST)]);
            let [young, step] = [case.young.to_string(), step_name(case)];
            let [colored, jacobi, both] = ends.map(in_data);
            data.row([
                load_case,
                &young,
                &step,
                &format!("{number:.6e}"),
                &colored,
                &jacobi,
                &both,
            ]);
        }
        plot.series(Series::new(load_case, points).with_style(Style::Markers));
    }
    context.plot(
        "acceleration-bound",
        &plot,
        "The bound is at 1: left of it no point should be high. Errors that grow without end are drawn at \
         1e6.",
    )?;
    context.document.data("acceleration-bound", "All cases", &data)
}

fn conclude(context: &mut Context, answers: &[Answer]) {
    let numbers = |diverging: bool, above: bool| {
        let chosen = move |answer: &&Answer| {
            answer.diverges() == diverging && (answer.number > 1.0) == above
        };
        answers.iter().filter(chosen).map(|answer| answer.number).collect::<Vec<f64>>()
    };
    let [calm, lost] = [numbers(false, true), numbers(true, true)];
    let below = numbers(true, false).len();
    let all_below = below + numbers(false, false).len();
    let least = lost.iter().copied().min_by(f64::total_cmp);
    let most = calm.iter().copied().max_by(f64::total_cmp);
    let count = |is: fn(&Answer) -> bool| answers.iter().filter(|answer| is(answer)).count();
    let arrived = count(|answer| answer.ends[..2].iter().all(|end| *end <= ARRIVED));
    let stays = count(|answer| answer.ends[2] < CEILING);
    let near = count(|answer| answer.ends[2] <= ARRIVED);
    context.document.paragraph(format!(
        "Below 1 the iteration diverges in {below} of {all_below} cases, above 1 in {} of {}; the largest \
         number at which it does not is {}, the smallest at which it does {}. The bound is a safe one: it \
         takes the largest stress anywhere, and all of `K_geo` to act at once. A fixed point of the \
         iteration satisfies both `C + a~ l = 0` and `x = xt + M^-1 J(x)^T l`, and so is the true end of the \
         step: {arrived} of {} cases come within {} of it by either order of sweeps. Anderson on both \
         stays in the scene in {stays} of {}, and comes as near in {near}: it has the published method's own answer. \
         The exact form has the true fixed point without the bound: it goes back to it by steps over masses \
         that outweigh `K_geo`.",
        lost.len(),
        lost.len() + calm.len(),
        most.map_or("none".to_owned(), scientific),
        least.map_or("none".to_owned(), scientific),
        answers.len(),
        level_name(ARRIVED),
        answers.len(),
    ));
    context.verdict(
        "Anderson on multipliers under stress, by h^2 sigma 12/(rho dx^2)",
        "below 1 it never diverges, above 1 it does in some",
        format!(
            "below 1: {below} of {all_below}; above: {} of {}",
            lost.len(),
            lost.len() + calm.len()
        ),
        below == 0 && all_below > 0 && !lost.is_empty(),
    );
}
