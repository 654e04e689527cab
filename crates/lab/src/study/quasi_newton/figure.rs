//! Errors over passes: the quasi-Newton method beside XPBD.

use anyhow::{Context as _, Result};
use viscera::settings::AndersonOn;
use viscera_report::{Axis, Plot, Series, Style, Table};

use super::super::Context;
use super::super::convergence::{FLOOR, in_data, thinned};
use super::super::methods::{
    COLORED, JACOBI, NamedSettings, anderson, exact, published, quasi_newton,
};
use super::super::step::Curve;
use super::problems::{StepProblem, on_mesh};
use super::{Answer, ITERATIONS};
use crate::forms::Form;

/// What is followed on the step that is shown.
fn methods(quick: bool) -> Vec<NamedSettings> {
    let mixed = |settings| anderson(settings, AndersonOn::Both);
    let rivals = [
        ("XPBD, Jacobi", published(JACOBI), 3000),
        ("XPBD, Jacobi, Anderson", mixed(published(JACOBI)), 1000),
        ("XPBD, Gauss-Seidel", published(COLORED), 1000),
        ("XPBD, Gauss-Seidel, Anderson", mixed(published(COLORED)), 1000),
        ("exact XPBD, Gauss-Seidel", exact(COLORED), 1000),
        ("exact XPBD, Gauss-Seidel, Anderson", mixed(exact(COLORED)), 1000),
    ];
    let ours = NamedSettings::new("quasi-Newton", quasi_newton()).with_iterations(ITERATIONS);
    let rivals = rivals.into_iter().map(|(name, settings, iterations)| {
        let iterations = if quick { iterations / 10 } else { iterations };
        NamedSettings::new(name, settings).with_iterations(iterations)
    });
    std::iter::once(ours).chain(rivals).collect()
}

/// Cases beside those of the table: the step that is shown, and what is followed on it.
pub(super) fn case_count(quick: bool) -> usize {
    1 + methods(quick).len()
}

/// Errors from here on are not shown: sweeps as published begin with some forty times that of the prediction.
const CEILING: f64 = 100.0;

/// The step that is shown: a bar under torsion in the middle of its motion, of the middle of all tissues.
fn shown(problems: &[StepProblem]) -> Option<usize> {
    let twists = || {
        let all = problems.iter().enumerate();
        let is_usual = |problem: &StepProblem| problem.form == Form::Usual && !problem.is_fine;
        all.filter(move |(_, problem)| problem.scene == "twist" && is_usual(problem))
    };
    let count = twists().count();
    twists().nth(count / 2).map(|(index, _)| index)
}

/// The figure, and its points as data.
pub(super) fn show(
    context: &mut Context,
    problems: &[StepProblem],
    answers: &[Answer],
) -> Result<()> {
    let index = shown(problems).context("there is no twist")?;
    let problem = problems[index];
    let changes = context.changes;
    let steps = context.run_cases(&[problem], |problem| problem.step(changes))?;
    let step = steps.first().context("there is no step")?;
    let methods = methods(context.quick);
    let curves = context.run_cases(&methods, |method| step.follow::<f64>(&method.settings))?;
    let mut plot = Plot::new(
        format!("Twist, E = {} kPa, nu {}", problem.young / 1e3, problem.poisson),
        Axis::logarithmic("passes"),
        Axis::logarithmic("error, 1 = inertial prediction"),
    );
    plot.reference(1e-3, "1e-3");
    let mut data = Table::new(["curve", "passes", "error"]);
    let [coarse, fine] = [false, true]
        .map(|is_fine| on_mesh(problems, &problem, is_fine).map(|index| &answers[index]));
    for (method, curve) in methods.iter().zip(&curves) {
        let style = if method.name == "quasi-Newton" { Style::MarkedLine } else { Style::Line };
        add(&mut plot, &mut data, &method.name, curve, style);
    }
    if let Some(answer) = fine {
        let name = format!("quasi-Newton, {} tets", answer.tets);
        add(&mut plot, &mut data, &name, &answer.curve, Style::Dashed);
    }
    let tets = coarse.map_or(0, |answer| answer.tets);
    context.plot(
        "quasi-newton",
        &plot,
        &format!(
            "A step of the twisted bar, {tets} tetrahedra, stable neo-Hookean. Compare where curves cross the \
             level, and how steep they are there: quasi-Newton keeps its slope and, on the finer mesh \
             (dashed), its place; XPBD as published, here with the neo-Hookean pair, leaves the step at once and \
             comes to an answer of its own."
        ),
    )?;
    context.document.data("quasi-newton-curves", "All points", &data)
}

fn add(plot: &mut Plot, data: &mut Table, name: &str, curve: &Curve, style: Style) {
    let errors = &curve.errors;
    let points = thinned(errors.len());
    for &k in &points {
        data.row([name, &k.to_string(), &in_data(errors[k])]);
    }
    let is_shown = |point: &[f64; 2]| (FLOOR..CEILING).contains(&point[1]);
    let shown = points.iter().skip(1).map(|&k| [k as f64, errors[k]]).take_while(is_shown);
    plot.series(Series::new(name, shown).with_style(style));
}
