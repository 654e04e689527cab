//! Passes on bodies that are harder than boxes along the axes.

use anyhow::Result;
use viscera_report::Table;

use super::super::Context;
use super::super::convergence::{Reach, level_name};
use super::problems::{OTHERS, StepProblem, on_mesh};
use super::{Answer, LEVELS, claim, counts_of, judge_counts, judge_growth, median, worst};
use crate::forms::Form;

/// Asked of the worst step of nearly incompressible tissue on unstructured meshes.
const UNSTRUCTURED_INCOMPRESSIBLE: [f64; 2] = [22.0, 45.0];
/// Asked of the worst step of a cut bar, and of one with an inclusion.
const CUT: [f64; 2] = [25.0, 40.0];
const INCLUSION: [f64; 2] = [16.0, 30.0];
/// Asked of the passes of other forms, over those of the aligned bar.
const OVER_ALIGNED: f64 = 1.3;

/// The table and the claims.
pub(super) fn show(
    context: &mut Context,
    problems: &[StepProblem],
    answers: &[Answer],
) -> Result<()> {
    if problems.iter().all(|problem| problem.form == Form::Usual) {
        return Ok(());
    }
    table(context, problems, answers)?;
    // Meshes of some hundred tetrahedra are too coarse to tell forms apart.
    if context.quick {
        return Ok(());
    }
    let of = |form: Form| counts_of(problems, answers, |problem| problem.form == form);
    judge_counts(context, "unstructured, ", &of(Form::Unstructured), UNSTRUCTURED_INCOMPRESSIBLE);
    judge_growth(context, Form::Unstructured, problems, answers);
    for (form, asked) in [(Form::Cut, CUT), (Form::Inclusion, INCLUSION)] {
        claim(context, &format!("{form}, worst"), asked, &of(form), worst);
    }
    for form in [Form::Turned, Form::Jittered, Form::Slender, Form::Touching] {
        judge_beside_aligned(context, form, problems, answers);
    }
    Ok(())
}

/// Passes of a step over those of the aligned bar, to both levels.
fn over_aligned(
    problem: &StepProblem,
    problems: &[StepProblem],
    answers: &[Answer],
) -> Option<[f64; 2]> {
    let aligned = StepProblem { form: Form::Aligned, ..*problem };
    let [ours, theirs] = [problem, &aligned]
        .map(|step| on_mesh(problems, step, problem.is_fine).map(|place| &answers[place]));
    let (ours, theirs) = (ours?, theirs?);
    Some(LEVELS.map(|level| ours.passes_to(level) / theirs.passes_to(level)))
}

fn table(context: &mut Context, problems: &[StepProblem], answers: &[Answer]) -> Result<()> {
    let levels = LEVELS.map(level_name).join(", ");
    let mut table = Table::new([
        "form".to_owned(),
        "scene".into(),
        "E".into(),
        "nu".into(),
        "tets".into(),
        format!("passes: {levels}"),
        "over the aligned bar".into(),
    ]);
    let mut data = Table::new(["form", "scene", "E [Pa]", "nu", "tets", "level", "passes"]);
    for form in [Form::Unstructured].into_iter().chain(OTHERS) {
        let mut of_form: Vec<_> =
            problems.iter().zip(answers).filter(|(problem, _)| problem.form == form).collect();
        // The coarser meshes first.
        of_form.sort_by_key(|(problem, _)| problem.is_fine);
        for (problem, answer) in of_form {
            let StepProblem { scene, young, poisson, .. } = *problem;
            let reached = LEVELS.map(|level| Reach::of(&answer.curve, level).to_string());
            let [form, poisson, tets] =
                [form.to_string(), poisson.to_string(), answer.tets.to_string()];
            for (level, passes) in LEVELS.iter().zip(&reached) {
                let [young, level] = [young.to_string(), level_name(*level)];
                data.row([&form, scene, &young, &poisson, &tets, &level, passes]);
            }
            let over = over_aligned(problem, problems, answers);
            let over =
                over.map_or(String::new(), |both| both.map(|r| format!("{r:.2}")).join(", "));
            let young = format!("{} kPa", young / 1e3);
            table.row([form, scene.into(), young, poisson, tets, reached.join(", "), over]);
        }
    }
    context.document.paragraph(
        "The same steps on other bodies. *Unstructured*: the vertices of the table above pushed about at random and \
         the tetrahedra between them exchanged at random, until no order is left. The others are bars of boxes whose \
         vertices are where they belong: *aligned* as they are, to compare with; *turned* by 37 degrees, the whole \
         scene, about the axis (1, 2, 3); *jittered* by 90 % of what cannot turn a tetrahedron inside out; *slender*, \
         200 x 25 x 25 mm; *two touching* side by side, of which each has as many tetrahedra as the aligned bar and, in \
         the cantilever, hangs from another end; *cut* across by 60 % of the height; with a ball in the middle, 3 cm \
         wide, that is 100 times as stiff.",
    );
    context.document.table(&table);
    context.document.data("quasi-newton-forms", "The same as data", &data)
}

fn judge_beside_aligned(
    context: &mut Context,
    form: Form,
    problems: &[StepProblem],
    answers: &[Answer],
) {
    let of_form = problems.iter().filter(|problem| problem.form == form);
    let ratios: Vec<[f64; 2]> =
        of_form.filter_map(|problem| over_aligned(problem, problems, answers)).collect();
    let [most, middle] = [worst, median]
        .map(|of| [0, 1].map(|level| of(&ratios.iter().map(|r| r[level]).collect::<Vec<_>>())));
    context.verdict_of(
        ratios.len(),
        format!("quasi-Newton, passes to 1e-2, 1e-3, {form}, over the aligned bar's, worst"),
        format!("at most {OVER_ALIGNED}"),
        format!(
            "{}; in the median {}",
            most.map(|r| format!("{r:.2}")).join(", "),
            middle.map(|r| format!("{r:.2}")).join(", ")
        ),
        most.iter().all(|ratio| *ratio <= OVER_ALIGNED),
    );
}
