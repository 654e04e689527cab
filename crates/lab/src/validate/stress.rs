//! Stress: violent grabs and scrambled starts at five iterations per frame.

use std::fmt;

use anyhow::Result;
use viscera::material::MaterialModel;
use viscera::settings::{Acceleration, SolverSettings};

use super::methods::{Form, scheduled};
use super::{Context, Section};
use crate::load_cases::tissue;
use crate::stress::{self, FRAMES, HELD, Kind, ROUND_OFF, Run, SIZE};
use viscera_reference::Reference;
use viscera_report::{Table, percent};

pub(super) const SECTION: Section =
    Section { name: "stress", title: "Stress", cases: |quick, _| case_count(quick), run };

const YOUNG: f64 = 1e4;
const POISSON: f64 = 0.45;
/// Asked of the share of tetrahedra inside out at the end.
const INVERTED: f64 = 0.01;

#[derive(Clone, Copy, Debug)]
struct Case {
    kind: Kind,
    form: Form,
    anderson: bool,
    seed: u64,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let acceleration = if self.anderson { ", Anderson" } else { "" };
        write!(f, "{} {}, {}{acceleration}", self.kind, self.seed, self.form.name())
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Answer {
    steps: u64,
    rejected: u64,
    above: u64,
    /// Whether a body that nothing holds ever has more mechanical energy than it was let go with.
    gained: bool,
    is_finite: bool,
    tets: usize,
    inverted: usize,
}

/// Lists of runs with what they are.
fn batches(quick: bool) -> Vec<(String, Vec<Case>)> {
    let mut batches = Vec::new();
    let many = if quick { 4 } else { 200 };
    let few = if quick { 1 } else { 25 };
    for (kind, name) in [(Kind::Grab, "violent grabs"), (Kind::Scramble, "scrambles")] {
        for (form, anderson, count) in [
            (Form::Colored, false, many),
            (Form::Colored, true, few),
            (Form::Clique, false, few),
            (Form::Jacobi, false, few),
        ] {
            let label = if anderson { ", Anderson" } else { "" };
            let cases = (0..count).map(|seed| Case { kind, form, anderson, seed });
            batches.push((format!("{name}, {}{label}", form.name()), cases.collect()));
        }
    }
    batches
}

fn case_count(quick: bool) -> usize {
    batches(quick).iter().map(|(_, cases)| cases.len()).sum()
}

fn answer(case: &Case) -> Result<Answer> {
    let load_case = stress::bar(tissue(MaterialModel::StableNeoHookean, YOUNG, POISSON)?)?;
    let acceleration = if case.anderson { Acceleration::Anderson } else { Acceleration::None };
    let settings = SolverSettings { acceleration, ..scheduled(case.form, 1, 5) };
    let mut run = Run::new(&load_case, case.kind, case.seed, &settings)?;
    let mut answer = Answer { tets: load_case.mesh.tets().len(), ..Answer::default() };
    let reference = Reference::new(&run.model);
    let mut let_go = None;
    for _ in 0..FRAMES {
        if run.is_free() && let_go.is_none() {
            let_go = Some(run.mechanical_energy(&reference)?);
        }
        answer.above += u64::from(run.step_watched(&reference)? > 1.0 + ROUND_OFF);
        answer.steps += 1;
        if let Some(let_go) = let_go {
            let now = run.mechanical_energy(&reference)?;
            answer.gained |= now > let_go * (1.0 + ROUND_OFF) || now.is_nan();
        }
    }
    answer.rejected = run.solver.rejected_steps();
    answer.is_finite = run.state.is_finite();
    answer.inverted = run.inverted();
    Ok(answer)
}

fn run(context: &mut Context) -> Result<()> {
    context.document.paragraph(format!(
        "A bar of {} mm, E = {} kPa, nu = {POISSON}, stable neo-Hookean, one step of five iterations per \
         frame. *Violent grabs*: two to seven vertices jump to places up to a body length away, jump again \
         after {} frames, and are let go after {HELD}. *Scrambles*: every vertex starts at a random place \
         of the bar's box. A step counts as above when the incremental potential at its end is above that at its start with pins moved; \
         a run gains energy when a body that nothing holds ever has more mechanical energy than it was let go with; both by \
         more than round-off ({ROUND_OFF:.0e}), and both computed by the reference, not by the solver.",
        SIZE.map(|side| format!("{:.0}", 1e3 * side)).join(" x "),
        YOUNG / 1e3,
        HELD / 2,
    ));
    let mut table = Table::new([
        "runs",
        "count",
        "steps",
        "rejected steps",
        "steps above",
        "runs that gain energy",
        "runs with NaN",
        "tets inside out at the end",
    ]);
    for (name, cases) in batches(context.quick) {
        let answers = context.run_cases(&cases, answer)?;
        let sum = |of: fn(&Answer) -> u64| answers.iter().map(of).sum::<u64>();
        let (steps, above) = (sum(|a| a.steps), sum(|a| a.above));
        let gained = sum(|a| u64::from(a.gained));
        let lost = sum(|a| u64::from(!a.is_finite));
        let (tets, inverted) = (sum(|a| a.tets as u64), sum(|a| a.inverted as u64));
        let share = inverted as f64 / tets as f64;
        table.row([
            name.clone(),
            cases.len().to_string(),
            steps.to_string(),
            percent(sum(|a| a.rejected) as f64 / steps as f64),
            above.to_string(),
            gained.to_string(),
            lost.to_string(),
            percent(share),
        ]);
        context.verdict_of(
            cases.len(),
            format!(
                "{} {name}: steps above; runs that gain energy; runs with NaN; tets inverted",
                cases.len()
            ),
            "0; 0; 0; < 1 %",
            format!("{above}; {gained}; {lost}; {}", percent(share)),
            above == 0 && gained == 0 && lost == 0 && share < INVERTED,
        );
    }
    context.document.table(&table);
    Ok(())
}
