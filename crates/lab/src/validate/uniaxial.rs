//! Uniaxial stretch: a bar is stretched or compressed, its sides are free, and it deforms alike
//! everywhere. With the stretch `s` along x and `l` across, the lateral stress vanishes where
//!
//! ```text
//! stable neo-Hookean       l^2 = (1 + (1 - 2 nu) (1 - 1/s))/s     P = mu (s - l^2/s)
//! Saint Venant-Kirchhoff   l^2 = 1 - nu (s^2 - 1)                 P = E s (s^2 - 1)/2
//! ```
//!
//! and `P` is the force over the area at rest.

use std::fmt;

use anyhow::{Context as _, Result};
use viscera::material::{Material, MaterialModel};
use viscera::mesh::shapes::Block;
use viscera::scalar::{Vec3, vec3};

use super::methods::{LibrarySolver, MODELS, floored, model_name, worse};
use super::{Context, Section};
use crate::load_cases::{DrivenPath, LoadCase, NEAR, tissue};
use crate::settling::{truth, volume};
use viscera_report::{Axis, Plot, Series, Style, Table, percent, scientific};

pub(super) const SECTION: Section = Section {
    name: "uniaxial",
    title: "Uniaxial stretch",
    cases: |quick, _| case_count(quick),
    run,
};

/// Edge lengths of the bar [m]. Twice as long as thick: a slender one would buckle.
const SIZE: [f64; 3] = [0.06, 0.03, 0.03];
/// Young's modulus [Pa].
const YOUNG: f64 = 1e4;
/// Frames of the stretching; two seconds are left to come to rest.
const PATH_FRAMES: u32 = 60;
/// Smallest and largest stretch.
const STRETCH_RANGE: [f64; 2] = [0.8, 1.6];
/// Cells of the mesh along each axis.
const CELLS: [usize; 3] = [4, 2, 2];
/// Below this an error is round-off, whose digits differ from machine to machine.
const FLOOR: f64 = 1e-9;
/// Asked of the library.
const LIMIT: f64 = 1e-3;
/// Asked of the reference.
const REFERENCE_LIMIT: f64 = 1e-8;

/// Where an answer comes from, in the order of the table's columns.
const SOLVERS: [ComparedSolver; 3] = [
    ComparedSolver::Reference,
    ComparedSolver::Library(LibrarySolver::Double),
    ComparedSolver::Library(LibrarySolver::Single),
];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ComparedSolver {
    Reference,
    Library(LibrarySolver),
}

#[derive(Clone, Copy, Debug)]
struct Case {
    model: MaterialModel,
    poisson: f64,
    stretch: f64,
    solver: ComparedSolver,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { model, poisson, stretch, solver } = self;
        let solver = match solver {
            ComparedSolver::Reference => "reference",
            ComparedSolver::Library(method) => method.name(),
        };
        write!(f, "{}, nu {poisson}, stretch {stretch}, {solver}", model_name(*model))
    }
}

/// In the order of the table: its columns vary fastest.
fn cases(quick: bool) -> Vec<Case> {
    let mut cases = Vec::new();
    for model in MODELS {
        for &poisson in poissons(quick) {
            for &stretch in stretches(quick) {
                let case = |solver| Case { model, poisson, stretch, solver };
                cases.extend(SOLVERS.map(case));
            }
        }
    }
    cases
}

fn stretches(quick: bool) -> &'static [f64] {
    if quick { &STRETCH_RANGE } else { &[0.8, 0.9, 1.1, 1.2, 1.4, 1.6] }
}

fn poissons(quick: bool) -> &'static [f64] {
    if quick { &[0.49] } else { &[0.3, 0.45, 0.49] }
}

fn case_count(quick: bool) -> usize {
    cases(quick).len()
}

/// What comes out.
#[derive(Clone, Copy, Debug, Default)]
struct Answer {
    /// Largest distance from the closed form over the largest displacement.
    largest: f64,
    /// Relative errors.
    side: f64,
    force: f64,
    volume: f64,
    /// Force over area and Young's modulus.
    stress: f64,
}

impl Answer {
    /// The larger of all errors, without signs.
    fn worse(&self, other: &Self) -> Self {
        let worse = |a: f64, b: f64| worse(a.abs(), b.abs());
        Self {
            largest: worse(self.largest, other.largest),
            side: worse(self.side, other.side),
            force: worse(self.force, other.force),
            volume: worse(self.volume, other.volume),
            stress: f64::NAN,
        }
    }
}

fn run(context: &mut Context) -> Result<()> {
    let cases = cases(context.quick);
    context.document.paragraph(
        "A bar twice as long as thick, of an irregular mesh, is stretched along x. Its ends take the \
         places of the closed form, its sides are free. The lateral stress vanishes where, with the \
         stretch `s` along and `l` across,",
    );
    context.document.paragraph(
        "```text\nstable neo-Hookean       l^2 = (1 + (1 - 2 nu) (1 - 1/s))/s     P = mu (s - l^2/s)\n\
         Saint Venant-Kirchhoff   l^2 = 1 - nu (s^2 - 1)                 P = E s (s^2 - 1)/2\n```",
    );
    context.document.paragraph(
        "`P` is the force over the area at rest. Linear tetrahedra represent this state exactly, so \
         that no error of the mesh is left: side stretch (at half length) and force (what holds the \
         end) must be the closed form's.",
    );
    let answers = context.run_cases(&cases, answer)?;
    table(context, &cases, &answers);
    plot(context, &cases, &answers)?;
    verdicts(context, &cases, &answers);
    Ok(())
}

fn table(context: &mut Context, cases: &[Case], answers: &[Answer]) {
    let heads = ["material", "nu", "reference, places", "f64, places", "f64, sides", "f64, force"];
    let heads = heads.into_iter().chain(["f64, volume", "f32, places", "f32, sides", "f32, force"]);
    let mut table = Table::new(heads.chain(["f32, volume"]));
    for model in MODELS {
        for &poisson in poissons(context.quick) {
            let of = |solver| {
                let chosen = cases.iter().zip(answers).filter(|(case, _)| {
                    case.model == model && case.poisson == poisson && case.solver == solver
                });
                chosen.fold(Answer::default(), |all, (_, answer)| all.worse(answer))
            };
            let [reference, double, single] = SOLVERS.map(of);
            let mut row = vec![model_name(model).to_owned(), poisson.to_string()];
            row.push(floored(reference.largest, REFERENCE_LIMIT));
            for answer in [double, single] {
                let errors = [answer.largest, answer.side, answer.force, answer.volume];
                row.extend(errors.map(|error| floored(error, FLOOR)));
            }
            table.row(row);
        }
    }
    context.document.paragraph(format!(
        "The worst of {} stretches from {} to {}. `places` is the largest distance of a vertex from \
         the closed form over the largest displacement; the others are relative errors.",
        stretches(context.quick).len(),
        STRETCH_RANGE[0],
        STRETCH_RANGE[1],
    ));
    context.document.table(&table);
}

fn plot(context: &mut Context, cases: &[Case], answers: &[Answer]) -> Result<()> {
    let mut plot = Plot::new(
        "Uniaxial stretch: force against stretch",
        Axis::linear("stretch"),
        Axis::linear("force / (area at rest x Young's modulus)"),
    );
    let curve = |model, poisson| -> Result<Vec<[f64; 2]>> {
        let tissue = tissue(model, YOUNG, poisson)?;
        let stretches = (0..=80).map(|i| 0.8 + 0.01 * f64::from(i));
        Ok(stretches.map(|s| [s, closed_form(&tissue, s).1 / YOUNG]).collect())
    };
    for model in MODELS {
        // Without lateral stress, Saint Venant-Kirchhoff's force does not depend on nu.
        let all = poissons(context.quick);
        let shown = if model == MaterialModel::StableNeoHookean { all } else { &all[..1] };
        for &poisson in shown {
            let name = match model {
                MaterialModel::StableNeoHookean => format!("{}, nu {poisson}", model_name(model)),
                MaterialModel::SaintVenantKirchhoff => model_name(model).to_owned(),
            };
            plot.series(Series::new(name, curve(model, poisson)?).with_style(Style::Line));
        }
    }
    for model in MODELS {
        let chosen = cases.iter().zip(answers).filter(|(case, _)| {
            case.model == model && case.solver == ComparedSolver::Library(LibrarySolver::Single)
        });
        let points = chosen.map(|(case, answer)| [case.stretch, answer.stress]);
        let name = format!("library, {}", model_name(model));
        plot.series(Series::new(name, points).with_style(Style::Markers));
    }
    context.document.paragraph(
        "Lines are closed forms, markers the library's answers in single precision. Where tissue is \
         squeezed, Saint Venant-Kirchhoff gives way: its slope falls as the stretch does.",
    );
    context.document.figure("uniaxial-force", &plot)
}

fn verdicts(context: &mut Context, cases: &[Case], answers: &[Answer]) {
    for solver in SOLVERS {
        let chosen = cases.iter().zip(answers).filter(|(case, _)| case.solver == solver);
        let mut worst = 0.0;
        for (_, Answer { largest, side, force, volume, .. }) in chosen {
            let errors = [largest, side, force, volume].into_iter();
            worst = errors.fold(worst, |worst, error| worse(worst, error.abs()));
        }
        let (who, limit) = match solver {
            ComparedSolver::Reference => ("the reference", REFERENCE_LIMIT),
            ComparedSolver::Library(LibrarySolver::Single) => {
                ("XPBD's defaults in single precision", LIMIT)
            }
            ComparedSolver::Library(_) => ("XPBD's defaults in double precision", LIMIT),
        };
        let figure = |error| {
            if solver == ComparedSolver::Reference { scientific(error) } else { percent(error) }
        };
        let measured = if worst < FLOOR { floored(worst, FLOOR) } else { figure(worst) };
        let what = format!("uniaxial stretch, largest error: {who}");
        context.verdict(what, format!("< {}", figure(limit)), measured, worst < limit);
    }
}

/// Lateral stretch, and force over the area at rest [Pa].
fn closed_form(tissue: &Material, s: f64) -> (f64, f64) {
    let (young, poisson) = (tissue.young(), tissue.poisson());
    match tissue.model() {
        MaterialModel::StableNeoHookean => {
            let squared = (1.0 + (1.0 - 2.0 * poisson) * (1.0 - 1.0 / s)) / s;
            (squared.sqrt(), tissue.lame_mu() * (s - squared / s))
        }
        MaterialModel::SaintVenantKirchhoff => {
            let strain = s * s - 1.0;
            ((1.0 - poisson * strain).sqrt(), 0.5 * young * s * strain)
        }
    }
}

fn bar(case: &Case, side: f64) -> Result<LoadCase> {
    let block = Block { jitter: 0.5, seed: 2, ..Block::new(Vec3::from_f64(SIZE), CELLS) };
    let mesh = block.mesh().context("the bar of the uniaxial stretch")?;
    let mut load_case = LoadCase::bare("bar", mesh, tissue(case.model, YOUNG, case.poisson)?);
    // What is near to x = 0 is listed first, then the pulled end.
    load_case.driven = load_case.select(|x| x.x < NEAR);
    load_case.driven.extend(load_case.select(|x| x.x > SIZE[0] - NEAR));
    let center = vec3(0.0, 0.5 * SIZE[1], 0.5 * SIZE[2]);
    load_case.path = DrivenPath::Stretch { center, factors: vec3(case.stretch, side, side) };
    load_case.path_frames = PATH_FRAMES;
    Ok(load_case)
}

fn answer(case: &Case) -> Result<Answer> {
    let tissue = tissue(case.model, YOUNG, case.poisson)?;
    let (side, stress) = closed_form(&tissue, case.stretch);
    let load_case = bar(case, side)?;
    let (positions, pin_forces) = match case.solver {
        ComparedSolver::Reference => {
            let truth = truth(&load_case)?;
            (truth.positions, truth.pin_forces)
        }
        ComparedSolver::Library(method) => {
            let settled = method.settle(&load_case)?;
            (settled.positions, settled.pin_forces)
        }
    };
    let rest = load_case.mesh.vertices();
    let (mut largest_error, mut largest_move) = (0.0, 0.0);
    // Lower and upper edge along y at half length.
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for (rest, x) in rest.iter().zip(&positions) {
        let exact = load_case.path.at(*rest, 1.0);
        let (distance, displacement) = ((*x - exact).length(), (exact - *rest).length());
        largest_error = worse(largest_error, distance);
        largest_move = worse(largest_move, displacement);
        if (rest.x - 0.5 * SIZE[0]).abs() < NEAR {
            (low, high) = (low.min(x.y), high.max(x.y));
        }
    }
    let area = SIZE[1] * SIZE[2];
    let pulled =
        pin_forces.iter().zip(&load_case.driven).filter(|&(_, &v)| rest[v as usize].x > NEAR);
    let measured = pulled.map(|(force, _)| force.x).sum::<f64>() / area;
    Ok(Answer {
        largest: largest_error / largest_move,
        side: (high - low) / (SIZE[1] * side) - 1.0,
        force: measured / stress - 1.0,
        volume: volume(&load_case, &positions)?.0 / (case.stretch * side * side * SIZE[0] * area)
            - 1.0,
        stress: measured / YOUNG,
    })
}
