//! Motion: a dropped cantilever beside exact implicit Euler of the same step.

use std::fmt;

use anyhow::Result;
use viscera::material::MaterialModel;
use viscera::settings::{Acceleration, AndersonGuard, SolverSettings};

use super::methods::{Form, scheduled, worse};
use super::{Context, Section, path};
use crate::load_cases::{FRAME_RATE, LoadCase, Size, tissue};
use crate::motion::{errors, exact, simulate};
use viscera_report::{Axis, Plot, Series, Style, Table, percent};

pub(super) const SECTION: Section =
    Section { name: "motion", title: "Motion", cases: |quick, _| case_count(quick), run };

/// Half a second.
const FRAMES: u32 = 30;
const YOUNGS: [f64; 2] = [3e4, 1e5];
const POISSON: f64 = 0.45;

#[derive(Clone, Copy, Debug, PartialEq)]
struct Schedule {
    form: Form,
    substeps: u32,
    iterations: u32,
    anderson: Option<AndersonGuard>,
    published: bool,
    /// The largest error that is asked for.
    limit: Option<f64>,
}

const fn schedule(form: Form, substeps: u32, iterations: u32) -> Schedule {
    Schedule { form, substeps, iterations, anderson: None, published: false, limit: None }
}

const SCHEDULES: [Schedule; 11] = [
    Schedule { limit: Some(0.03), ..schedule(Form::Colored, 4, 5) },
    schedule(Form::Colored, 10, 2),
    schedule(Form::Colored, 1, 20),
    Schedule {
        anderson: Some(AndersonGuard::Energy),
        limit: Some(0.02),
        ..schedule(Form::Colored, 1, 20)
    },
    Schedule {
        anderson: Some(AndersonGuard::Residual),
        limit: Some(0.02),
        ..schedule(Form::Colored, 1, 20)
    },
    schedule(Form::Colored, 4, 20),
    schedule(Form::Clique, 4, 5),
    schedule(Form::Clique, 4, 20),
    schedule(Form::Jacobi, 4, 20),
    Schedule { published: true, ..schedule(Form::Colored, 4, 5) },
    Schedule { published: true, ..schedule(Form::Colored, 1, 20) },
];

impl fmt::Display for Schedule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { form, substeps, iterations, anderson, published, .. } = self;
        write!(f, "{}, {substeps} x {iterations}", form.name())?;
        match anderson {
            None => {}
            Some(AndersonGuard::Energy) => f.write_str(", Anderson guarded by energy")?,
            Some(_) => f.write_str(", Anderson guarded by residual")?,
        }
        if *published {
            f.write_str(", XPBD as published")?;
        }
        Ok(())
    }
}

#[derive(Clone, Debug)]
struct Case {
    young: f64,
    schedule: Schedule,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "drop, {} kPa, {}", self.young / 1e3, self.schedule)
    }
}

fn cases(quick: bool) -> Vec<Case> {
    let of = |schedule| YOUNGS.map(|young| Case { young, schedule });
    let kept = if quick { 5 } else { SCHEDULES.len() };
    SCHEDULES[..kept].iter().flat_map(|&schedule| of(schedule)).collect()
}

fn case_count(quick: bool) -> usize {
    cases(quick).len() + path::case_count(quick)
}

fn answer(case: &Case) -> Result<Vec<f64>> {
    let material = tissue(MaterialModel::StableNeoHookean, case.young, POISSON)?;
    let load_case = LoadCase::new("cantilever", Size::Small, material)?;
    let Schedule { form, substeps, iterations, anderson, published, .. } = case.schedule;
    let acceleration = anderson.map_or(Acceleration::None, |_| Acceleration::Anderson);
    let settings = SolverSettings {
        acceleration,
        anderson_guard: anderson.unwrap_or(AndersonGuard::Residual),
        rebase: !published,
        keep_multipliers: !published,
        ..scheduled(form, substeps, iterations)
    };
    let ours = simulate::<f64>(&load_case, &settings, FRAMES)?;
    Ok(errors(&load_case, &ours, &exact(&load_case, substeps, FRAMES)?))
}

fn run(context: &mut Context) -> Result<()> {
    context.document.paragraph(format!(
        "The cantilever is let go at its rest shape and falls for half a second, undamped. The error is \
         the distance from exact implicit Euler of the *same* substeps, root mean square over all \
         vertices, over the largest displacement of the exact motion; the largest over {FRAMES} frames. \
         It tells how well a step is solved, not how much the step itself damps. nu = {POISSON}."
    ));
    let cases = cases(context.quick);
    let answers = context.run_cases(&cases, answer)?;
    let heads = YOUNGS.map(|young| format!("E = {} kPa", young / 1e3));
    let mut table = Table::new(["schedule".to_owned()].into_iter().chain(heads));
    let mut plot = Plot::new(
        "Error of the motion, E = 100 kPa",
        Axis::linear("time [s]"),
        Axis::logarithmic("error / largest displacement"),
    );
    for (cases, answers) in cases.chunks(YOUNGS.len()).zip(answers.chunks(YOUNGS.len())) {
        let schedule = cases[0].schedule;
        let largest = |errors: &Vec<f64>| errors.iter().copied().fold(0.0, worse);
        let cells: Vec<f64> = answers.iter().map(largest).collect();
        table.row([schedule.to_string()].into_iter().chain(cells.iter().map(|&e| percent(e))));
        if let Some(limit) = schedule.limit {
            let worst = cells.iter().copied().fold(0.0, worse);
            context.verdict(
                format!("motion over 0.5 s, {schedule}"),
                format!("< {}", percent(limit)),
                percent(worst),
                worst < limit,
            );
        }
        if let Some(errors) = answers.last().filter(|_| schedule.form == Form::Colored) {
            let points = errors.iter().enumerate().skip(1);
            let points = points.map(|(frame, &e)| [(frame + 1) as f64 / FRAME_RATE, e]);
            // There are more series than colours.
            let style = if schedule.published { Style::Dashed } else { Style::Line };
            plot.series(Series::new(schedule.to_string(), points).with_style(style));
        }
    }
    context.document.table(&table);
    context.document.figure("motion-drop", &plot)?;
    path::run(context)
}
