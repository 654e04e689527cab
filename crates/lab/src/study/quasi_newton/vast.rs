//! Section 9: whether half a million tetrahedra take more passes than fifty thousand.

use anyhow::Result;
use viscera::settings::{Count, SolverSettings};
use viscera_report::Table;

use super::super::convergence::{Reach, level_name};
use super::super::methods::quasi_newton;
use super::super::{Context, Section};
use super::problems::{StepProblem, gradient_left, vast_problems};
use super::{Answer, GROWTH, ITERATIONS, LEVELS, count_text};

/// It takes minutes, and is run with `--only` alone.
pub(in super::super) const SECTION: Section = Section {
    name: "vast",
    title: "9. Passes on half a million tetrahedra",
    cases: |_, _| vast_problems().len(),
    run,
};

/// Asked of passes to both levels.
const WORST: [f64; 2] = super::WORST;
/// Asked of the gradient that is left at exact ends, over that at the inertial prediction.
const GRADIENT: f64 = 1e-10;

fn run(context: &mut Context) -> Result<()> {
    let problems = vast_problems();
    let changes = context.changes;
    let answers = context.run_cases(&problems, |problem| {
        let step = problem.step(changes)?;
        let ours = SolverSettings { iterations: Count::Of(ITERATIONS), ..quasi_newton() };
        Ok(Answer {
            tets: step.load_case.mesh.tets().len(),
            curve: step.follow::<f64>(&ours)?,
            rivals: Vec::new(),
            gradient: gradient_left(&step)?,
        })
    })?;
    context.document.paragraph(
        "Steps of section 8 on meshes ten times as fine. Exact ends are the method's own, in double precision; what is \
         left of the gradient there is given over that at the inertial prediction.",
    );
    let (vast, huge) = answers.split_at(answers.len() / 2);
    let levels = LEVELS.map(level_name).join(", ");
    let heads = ["scene", "mesh", "E", "nu", "tets"].map(str::to_owned);
    let more = [format!("passes: {levels}"), "gradient left".into()];
    let mut table = Table::new(heads.into_iter().chain(more));
    for (problem, pair) in problems.iter().zip(huge.iter().zip(vast)) {
        let StepProblem { scene, form, young, poisson, .. } = *problem;
        for answer in [pair.0, pair.1] {
            let passes = LEVELS.map(|level| Reach::of(&answer.curve, level).to_string());
            table.row([
                scene.to_owned(),
                form.to_string(),
                format!("{} kPa", young / 1e3),
                poisson.to_string(),
                answer.tets.to_string(),
                passes.join(", "),
                format!("{:.0e}", answer.gradient),
            ]);
        }
    }
    context.document.table(&table);
    judge(context, vast, huge);
    Ok(())
}

fn judge(context: &mut Context, vast: &[Answer], huge: &[Answer]) {
    let most = |of: &dyn Fn(usize) -> f64| (0..vast.len()).map(of).fold(0.0, f64::max);
    let passes = LEVELS.map(|level| most(&|at| vast[at].passes_to(level)));
    context.verdict(
        "quasi-Newton, half a million tets, passes to 1e-2, 1e-3, worst",
        format!("at most {}, {}", WORST[0], WORST[1]),
        passes.map(count_text).join(", "),
        passes[0] <= WORST[0] && passes[1] <= WORST[1],
    );
    let growth = most(&|at| vast[at].passes_to(LEVELS[1]) / huge[at].passes_to(LEVELS[1]));
    context.verdict(
        "quasi-Newton, passes to 1e-3 from 50,000 to half a million tets grow by, worst",
        format!("< {GROWTH}"),
        format!("{growth:.2}"),
        growth < GROWTH,
    );
    let gradient = most(&|at| vast[at].gradient);
    context.verdict(
        "quasi-Newton, half a million tets, gradient left at the exact ends, worst",
        format!("< {}", level_name(GRADIENT)),
        format!("{gradient:.1e}"),
        gradient < GRADIENT,
    );
}
