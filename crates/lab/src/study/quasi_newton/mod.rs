//! Section 8: how many passes the quasi-Newton method takes to the end of a step.

mod figure;
mod other_forms;
mod problems;
mod vast;

use anyhow::Result;
use viscera::settings::{AndersonOn, Count, SolverSettings};
use viscera_report::Table;

use super::convergence::{Reach, level_name};
use super::methods::{COLORED, JACOBI, NamedSettings, anderson, exact, published, quasi_newton};
use super::step::Curve;
use super::{Context, Section};
use crate::forms::Form;
use problems::{StepProblem, gradient_left, on_mesh, problems};

pub(super) const SECTION: Section = Section {
    name: "quasi-newton",
    title: "8. Passes of the quasi-Newton method",
    cases: |quick, changes| problems(quick, changes).len() + figure::case_count(quick),
    run,
};

pub(super) use vast::SECTION as VAST;

const LEVELS: [f64; 2] = [1e-2, 1e-3];
/// Passes that are followed.
const ITERATIONS: u32 = 100;

/// Asked of passes to both levels up to [`COMPRESSIBLE`]: in the median, and of the worst step.
const MEDIAN: [f64; 2] = [10.0, 20.0];
const WORST: [f64; 2] = [12.0, 25.0];
/// Asked of the worst step above it.
const WORST_INCOMPRESSIBLE: [f64; 2] = [20.0, 45.0];
/// Poisson's ratio up to which volume changes with ease.
const COMPRESSIBLE: f64 = 0.45;
/// Asked of the passes to the lower level on the finer mesh, over those on the coarser one.
const GROWTH: f64 = 1.3;
/// Asked of the gradient that is left at exact ends, over that at the inertial prediction.
const GRADIENT: f64 = 1e-7;

/// What was found of a step.
struct Answer {
    tets: usize,
    curve: Curve,
    /// Of [`rivals`], on the coarser mesh.
    rivals: Vec<Curve>,
    /// Left at the exact end, over that at the inertial prediction.
    gradient: f64,
}

impl Answer {
    /// Passes to a level; infinite where it was not reached.
    fn passes_to(&self, level: f64) -> f64 {
        self.curve.first_below(level).map_or(f64::INFINITY, |passes| passes as f64)
    }
}

/// What the method is compared with.
fn rivals(quick: bool) -> Vec<NamedSettings> {
    let rival = |name: &str, settings: SolverSettings, iterations: u32| {
        let iterations = if quick { iterations / 10 } else { iterations };
        NamedSettings::new(name, settings).with_iterations(iterations)
    };
    vec![
        rival("exact XPBD, Anderson", anderson(exact(COLORED), AndersonOn::Both), 1000),
        rival("exact XPBD", exact(COLORED), 1000),
        rival("Jacobi", published(JACOBI), 3000),
    ]
}

fn run(context: &mut Context) -> Result<()> {
    introduce(context);
    let problems = problems(context.quick, context.changes);
    let (quick, changes) = (context.quick, context.changes);
    let answers = context.run_cases(&problems, |problem| {
        let step = problem.step(changes)?;
        let ours = SolverSettings { iterations: Count::Of(ITERATIONS), ..quasi_newton() };
        let with_rivals = problem.form == Form::Usual && !problem.is_fine;
        let rivals = if with_rivals { rivals(quick) } else { Vec::new() };
        Ok(Answer {
            tets: step.load_case.mesh.tets().len(),
            curve: step.follow::<f64>(&ours)?,
            rivals: rivals
                .iter()
                .map(|rival| step.follow::<f64>(&rival.settings))
                .collect::<Result<_>>()?,
            gradient: gradient_left(&step)?,
        })
    })?;
    figure::show(context, &problems, &answers)?;
    table(context, &problems, &answers)?;
    judge(context, &problems, &answers);
    other_forms::show(context, &problems, &answers)
}

fn introduce(context: &mut Context) {
    context.document.paragraph(
        "The quasi-Newton method finds the minimum `x*` of the incremental potential of section 1 by L-BFGS \
         about an additive multilevel preconditioner. A pass evaluates the gradient once, which is one round \
         over all tetrahedra, and applies the preconditioner; a sweep of XPBD, which is one round over them as \
         well, is counted as a pass here. Stable neo-Hookean tissue; one step of implicit Euler of 1/60 s in \
         the middle of each motion: the cantilever after 10 frames of falling, the bar after 11 of being \
         twisted and pulled, the block after 7 of being grabbed. Errors as in section 1, in double precision. \
         The method starts without anything learned from the steps before, which is the harder case: in a \
         simulation pairs are kept.",
    );
}

/// Passes to both levels of every step.
fn table(context: &mut Context, problems: &[StepProblem], answers: &[Answer]) -> Result<()> {
    let sizes = sizes(problems, answers);
    let rivals = rivals(context.quick);
    let levels = LEVELS.map(level_name).join(", ");
    let mut heads = vec!["scene".to_owned(), "E".into(), "nu".into()];
    heads.extend(sizes.iter().map(|(_, tets)| format!("quasi-Newton, {tets} tets: {levels}")));
    heads.extend(rivals.iter().map(|rival| format!("{rival}: {levels}")));
    let mut table = Table::new(heads);
    let mut data = Table::new(["scene", "E [Pa]", "nu", "tets", "method", "level", "passes"]);
    let is_shown = |problem: &StepProblem| problem.form == Form::Usual && !problem.is_fine;
    for (index, problem) in problems.iter().enumerate().filter(|(_, problem)| is_shown(problem)) {
        let StepProblem { scene, young, poisson, .. } = *problem;
        let mut row = vec![scene.to_owned(), format!("{} kPa", young / 1e3), poisson.to_string()];
        let mut add = |method: &str, tets: usize, curve: &Curve| {
            let reached = LEVELS.map(|level| Reach::of(curve, level).to_string());
            for (level, passes) in LEVELS.iter().zip(&reached) {
                let [young, poisson, tets] =
                    [young.to_string(), poisson.to_string(), tets.to_string()];
                let level = level_name(*level);
                data.row([scene, &young, &poisson, &tets, method, &level, passes]);
            }
            row.push(reached.join(", "));
        };
        let on = |(is_fine, _): &(bool, usize)| on_mesh(problems, problem, *is_fine);
        for answer in sizes.iter().filter_map(on).map(|place| &answers[place]) {
            add("quasi-Newton", answer.tets, &answer.curve);
        }
        for (rival, curve) in rivals.iter().zip(&answers[index].rivals) {
            add(&rival.name, answers[index].tets, curve);
        }
        table.row(row);
    }
    context.document.paragraph(
        "Passes until the error is below each level; the rivals on the coarser mesh only. 'above N': N passes \
         were not enough; 'stops at p': the error has come to stand at p.",
    );
    context.document.table(&table);
    context.document.data("quasi-newton", "The same as data", &data)
}

/// Which meshes there are, the coarser one first, with the number of tetrahedra of the first scene on it.
fn sizes(problems: &[StepProblem], answers: &[Answer]) -> Vec<(bool, usize)> {
    let of = |is_fine| {
        let place = problems.iter().position(|problem| problem.is_fine == is_fine)?;
        Some((is_fine, answers[place].tets))
    };
    [false, true].into_iter().filter_map(of).collect()
}

/// What is asked of the counts on the usual meshes.
fn judge(context: &mut Context, problems: &[StepProblem], answers: &[Answer]) {
    let of_form = counts_of(problems, answers, |problem| problem.form == Form::Usual);
    judge_counts(context, "", &of_form, WORST_INCOMPRESSIBLE);
    let gradient = worst(&answers.iter().map(|answer| answer.gradient).collect::<Vec<_>>());
    context.verdict(
        "quasi-Newton, gradient left at the exact ends over that at the prediction",
        format!("< {}", level_name(GRADIENT)),
        format!("{gradient:.1e}"),
        gradient < GRADIENT,
    );
    judge_growth(context, Form::Usual, problems, answers);
}

/// Passes of some steps to both levels.
type Counts = Vec<(StepProblem, [f64; 2])>;

fn counts_of(
    problems: &[StepProblem],
    answers: &[Answer],
    of: impl Fn(&StepProblem) -> bool,
) -> Counts {
    let chosen = problems.iter().zip(answers).filter(|(problem, _)| of(problem));
    chosen
        .map(|(problem, answer)| (*problem, LEVELS.map(|level| answer.passes_to(level))))
        .collect()
}

/// What is asked of compressible tissue, and of the worst step of nearly incompressible tissue.
fn judge_counts(context: &mut Context, form: &str, counts: &Counts, asked: [f64; 2]) {
    let (soft, hard): (Counts, Counts) =
        counts.iter().partition(|(problem, _)| problem.poisson <= COMPRESSIBLE);
    if !soft.is_empty() {
        claim(context, &format!("{form}nu at most 0.45, median"), MEDIAN, &soft, median);
        claim(context, &format!("{form}nu at most 0.45, worst"), WORST, &soft, worst);
    }
    if !hard.is_empty() {
        claim(context, &format!("{form}nu above 0.45, worst"), asked, &hard, worst);
    }
}

/// A verdict on the median or the worst of passes to both levels.
fn claim(
    context: &mut Context,
    what: &str,
    asked: [f64; 2],
    counts: &Counts,
    of: fn(&[f64]) -> f64,
) {
    let measured =
        [0, 1].map(|level| of(&counts.iter().map(|(_, both)| both[level]).collect::<Vec<_>>()));
    context.verdict_of(
        counts.len(),
        format!("quasi-Newton, passes to 1e-2, 1e-3, {what}"),
        format!("at most {}, {}", asked[0], asked[1]),
        measured.map(count_text).join(", "),
        measured[0] <= asked[0] && measured[1] <= asked[1],
    );
}

/// Whether a finer mesh takes more passes.
fn judge_growth(context: &mut Context, form: Form, problems: &[StepProblem], answers: &[Answer]) {
    let mut growths = Vec::new();
    let mut sizes = [0, 0];
    let of_form = problems.iter().zip(answers).filter(|(problem, _)| problem.form == form);
    for (problem, coarse) in of_form.filter(|(problem, _)| !problem.is_fine) {
        if let Some(place) = on_mesh(problems, problem, true) {
            growths.push(answers[place].passes_to(LEVELS[1]) / coarse.passes_to(LEVELS[1]));
            sizes = [coarse.tets, answers[place].tets];
        }
    }
    // Meshes of some hundred tetrahedra have too few levels to tell.
    if context.quick || growths.is_empty() {
        return;
    }
    let [middle, most] = [median(&growths), worst(&growths)];
    context.verdict(
        format!(
            "quasi-Newton, {form}, passes to 1e-3 from {} to {} tets grow by, median",
            sizes[0], sizes[1]
        ),
        format!("< {GROWTH}"),
        if most.is_finite() {
            format!("{middle:.2}, at most {most:.2}")
        } else {
            format!("{middle:.2}, on some to above {ITERATIONS} passes")
        },
        middle < GROWTH,
    );
}

fn count_text(count: f64) -> String {
    if count.is_finite() { count.to_string() } else { format!("above {ITERATIONS}") }
}

/// The upper one of two in the middle; infinite counts are the largest.
fn median(values: &[f64]) -> f64 {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// The largest; one that is no number is the worst.
fn worst(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, |a, b| if b.is_nan() { f64::INFINITY } else { a.max(b) })
}
