//! Iteration independence: the stiffness that tissue seems to have, whatever the number of iterations per frame.

use std::fmt;

use anyhow::Result;
use viscera::material::MaterialModel;
use viscera::settings::{Colors, Count, SolverSettings};

use super::methods::worse;
use super::{Context, Section};
use crate::load_cases::{LoadCase, Size, tissue};
use crate::settling::{Error, compare, settle, truth};
use viscera_report::{Axis, Plot, Series, Style, Table};

pub(super) const SECTION: Section = Section {
    name: "independence",
    title: "Iteration independence",
    cases: |quick, _| case_count(quick),
    run,
};

/// Young's modulus [Pa] and Poisson's ratio: the hard end of organs.
const YOUNG: f64 = 1e5;
const POISSON: f64 = 0.45;
/// Asked of the apparent stiffness.
const LIMIT: f64 = 1e-3;
/// Below this the rest of the damped motion is seen.
const FLOOR: f64 = 1e-9;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Formulation {
    Exact,
    Published,
}

impl Formulation {
    fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact at rest",
            Self::Published => "XPBD as published",
        }
    }
}

#[derive(Clone, Debug)]
struct Case {
    load_case: &'static str,
    size: Size,
    method: Formulation,
    colors: Colors,
    substeps: u32,
    iterations: u32,
    single: bool,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { load_case, colors, substeps, iterations, .. } = self;
        let (label, colors) = (label(self), color_name(*colors));
        write!(f, "{load_case}, {label}, colours {colors}, {substeps} x {iterations}")
    }
}

fn load_cases(quick: bool) -> &'static [&'static str] {
    if quick { &["cantilever"] } else { &["cantilever", "grab", "organ"] }
}

fn iterations(quick: bool) -> &'static [u32] {
    if quick { &[5, 20] } else { &[5, 10, 20, 50, 100, 200] }
}

const SUBSTEPS: [u32; 4] = [1, 2, 4, 8];

const COLORS: [Colors; 5] = [
    Colors::Unlimited,
    Colors::Limited(8),
    Colors::Limited(4),
    Colors::Limited(2),
    Colors::Limited(1),
];

/// Over iterations, over substeps, over colours: three lists.
fn cases(quick: bool) -> [Vec<Case>; 3] {
    let size = if quick { Size::Tiny } else { Size::Small };
    let mut lists = [Vec::new(), Vec::new(), Vec::new()];
    let methods: &[(Formulation, bool)] =
        &[(Formulation::Exact, false), (Formulation::Exact, true), (Formulation::Published, false)];
    for &load_case in load_cases(quick) {
        for &(method, single) in methods {
            let case = |colors, substeps, iterations| Case {
                load_case,
                size,
                method,
                colors,
                substeps,
                iterations,
                single,
            };
            let any = Colors::Unlimited;
            lists[0].extend(iterations(quick).iter().map(|&k| case(any, 1, k)));
            lists[1].extend(SUBSTEPS.map(|s| case(any, s, 5)));
            if method == Formulation::Exact && !single {
                lists[2].extend(COLORS.map(|colors| case(colors, 1, 20)));
            }
        }
    }
    lists
}

fn case_count(quick: bool) -> usize {
    cases(quick).iter().map(Vec::len).sum()
}

#[derive(Clone, Copy, Debug)]
struct Answer {
    error: Error,
    rejected_moving: f64,
}

fn answer(case: &Case) -> Result<Answer> {
    let material = tissue(MaterialModel::StableNeoHookean, YOUNG, POISSON)?;
    let load_case = LoadCase::new(case.load_case, case.size, material)?;
    let exact = case.method == Formulation::Exact;
    let settings = SolverSettings {
        colors: case.colors,
        substeps: Count::Of(case.substeps),
        iterations: Count::Of(case.iterations),
        rebase: exact,
        keep_multipliers: exact,
        ..SolverSettings::xpbd()
    };
    let settled = if case.single {
        settle::<f32>(&load_case, &settings)?
    } else {
        settle::<f64>(&load_case, &settings)?
    };
    let error = compare(&load_case, &truth(&load_case)?, &settled.positions)?;
    Ok(Answer { error, rejected_moving: settled.rejected_moving })
}

fn label(case: &Case) -> String {
    let precision = if case.single { ", single precision" } else { "" };
    format!("{}{precision}", case.method.name())
}

fn color_name(colors: Colors) -> String {
    match colors {
        Colors::Unlimited => "unlimited".to_owned(),
        Colors::Limited(count) => count.to_string(),
    }
}

fn run(context: &mut Context) -> Result<()> {
    context.document.paragraph(format!(
        "Apparent stiffness: the reference's displacement over ours along it, over all free vertices, \
         after 180 frames with velocities times 0.9 after each. 1 is right, 2 would feel twice as \
         stiff. Stable neo-Hookean, E = {} kPa, nu = {POISSON}.",
        YOUNG / 1e3
    ));
    let lists = cases(context.quick);
    let answers = [
        context.run_cases(&lists[0], answer)?,
        context.run_cases(&lists[1], answer)?,
        context.run_cases(&lists[2], answer)?,
    ];
    context.document.subheading("Over iterations, one step per frame");
    let counts = iterations(context.quick).iter().map(|k| k.to_string());
    tabulate(context, &lists[0], &answers[0], counts.collect());
    figure(context, &lists[0], &answers[0])?;
    context.document.subheading("Over substeps, five iterations each");
    tabulate(context, &lists[1], &answers[1], SUBSTEPS.map(|s| s.to_string()).to_vec());
    context.document.subheading("Over colours, one step of 20 iterations per frame");
    tabulate(context, &lists[2], &answers[2], COLORS.map(color_name).to_vec());
    judge(context, "iterations", &lists[0], &answers[0]);
    judge(context, "substeps", &lists[1], &answers[1]);
    judge(context, "colours", &lists[2], &answers[2]);
    Ok(())
}

/// A row per scene and method, a column per number of iterations.
fn tabulate(context: &mut Context, cases: &[Case], answers: &[Answer], columns: Vec<String>) {
    let count = columns.len();
    let mut table =
        Table::new(["scene".to_owned(), "method".to_owned()].into_iter().chain(columns));
    for (cases, answers) in cases.chunks(count).zip(answers.chunks(count)) {
        let names = [cases[0].load_case.to_owned(), label(&cases[0])];
        let cells = answers.iter().map(|answer| {
            let other = if answer.error.is_other_minimum() { " (other minimum)" } else { "" };
            format!("{:.4}{other}", answer.error.stiffness)
        });
        table.row(names.into_iter().chain(cells));
    }
    context.document.table(&table);
}

fn figure(context: &mut Context, cases: &[Case], answers: &[Answer]) -> Result<()> {
    let mut plot = Plot::new(
        "How far the apparent stiffness is off, cantilever",
        Axis::logarithmic("iterations per frame"),
        Axis::logarithmic("|apparent stiffness - 1|"),
    );
    let count = iterations(context.quick).len();
    for (cases, answers) in cases.chunks(count).zip(answers.chunks(count)) {
        if cases[0].load_case != "cantilever" {
            continue;
        }
        let points = cases.iter().zip(answers).map(|(case, answer)| {
            let off = (answer.error.stiffness - 1.0).abs();
            [f64::from(case.iterations), if off < FLOOR { FLOOR } else { off }]
        });
        plot.series(Series::new(label(&cases[0]), points).with_style(Style::MarkedLine));
    }
    plot.reference(LIMIT, "0.1 %");
    context.document.figure("independence-iterations", &plot)
}

fn judge(context: &mut Context, over: &str, cases: &[Case], answers: &[Answer]) {
    let (mut least, mut most) = (f64::INFINITY, 0.0f64);
    let mut rejected = 0.0;
    for (case, answer) in cases.iter().zip(answers) {
        match case.method {
            Formulation::Exact => rejected = worse(rejected, answer.rejected_moving),
            Formulation::Published => {
                let error = (answer.error.stiffness - 1.0).abs();
                (least, most) = (least.min(error), worse(most, error));
            }
        }
    }
    for single in [false, true] {
        let is_meant = |case: &Case| case.method == Formulation::Exact && case.single == single;
        let meant = cases.iter().zip(answers).filter(|(case, _)| is_meant(case));
        let errors = meant.map(|(_, answer)| (answer.error.stiffness - 1.0).abs());
        let errors: Vec<f64> = errors.collect();
        let off = errors.iter().copied().fold(0.0, worse);
        // Colours are compared in double precision only.
        if single && !cases.iter().any(|case| case.single) {
            continue;
        }
        let (precision, plain) = match single {
            true => (", single precision", String::new()),
            false if most > 0.0 => {
                ("", format!(" (as published {:.1} to {:.0} % off)", 100.0 * least, 100.0 * most))
            }
            false => ("", String::new()),
        };
        context.verdict_of(
            errors.len(),
            format!("apparent stiffness over {over}{precision}"),
            "within 0.1 % of the reference",
            format!("{:.4} % off{plain}", 100.0 * off),
            off < LIMIT,
        );
    }
    context.document.paragraph(format!(
        "Over {over} the guard rejects at most {:.0} % of the steps of moving bodies.",
        100.0 * rejected
    ));
}
