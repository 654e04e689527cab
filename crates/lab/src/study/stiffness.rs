//! Figure 5: the first open problem, stiffness that depends on the iterations per frame.

use std::fmt;

use anyhow::Result;
use viscera::material::MaterialModel;
use viscera::settings::AndersonOn;

use super::methods::{COLORED, NamedSettings, anderson, exact, law, published};
use super::step::{Cost, MeasuredStep};
use super::{Context, Section};
use crate::load_cases::{LoadCase, Size, tissue};
use crate::settling::{Error, FRAMES, KEPT_VELOCITY, Truth, compare, settle, truth};
use viscera_report::{Axis, Plot, Series, Style, Table, percent, scientific};

pub(super) const SECTION: Section = Section {
    name: "stiffness",
    title: "5. Open problem: the stiffness that tissue seems to have",
    cases: |quick, _| case_count(quick),
    run,
};

/// Young's modulus [Pa] of the Green strain: softer bars collapse under their weight.
const GREEN_YOUNG: f64 = 1e5;
/// Where nothing else is wanted.
const POISSON: f64 = 0.45;
/// Asked of the apparent stiffness, in double and in single precision.
const LIMITS: [f64; 2] = [1e-3, 5e-3];
/// Below this the rest of the damped motion is seen.
const FLOOR: f64 = 1e-9;
/// Farther off than this many displacements a body has left the scene.
const LOST: f64 = 10.0;

/// Young's moduli [Pa].
fn moduli(quick: bool) -> &'static [f64] {
    if quick { &[1e4, 1e5] } else { &[1e3, 3e3, 1e4, 3e4, 1e5] }
}

/// Iterations per frame.
fn iteration_counts(quick: bool) -> &'static [u32] {
    if quick { &[5, 20, 50] } else { &[5, 10, 20, 50, 100, 200] }
}

fn size(quick: bool) -> Size {
    if quick { Size::Tiny } else { Size::Small }
}

/// The methods; the last two are the exact form in double and in single precision.
fn methods() -> [NamedSettings; 6] {
    let published = || published(COLORED);
    let on = |on| anderson(published(), on);
    [
        NamedSettings::new("as published", published()),
        NamedSettings::new("Anderson on positions", on(AndersonOn::Positions)),
        NamedSettings::new("Anderson on multipliers", on(AndersonOn::Multipliers)),
        NamedSettings::new("Anderson on both", on(AndersonOn::Both)),
        NamedSettings::new("exact at rest", exact(COLORED)),
        NamedSettings::new("exact at rest, single precision", exact(COLORED)),
    ]
}

const DOUBLE: usize = 4;
const SINGLE: usize = 5;

/// Whose stiffness it is.
#[derive(Clone, Copy)]
struct Body {
    model: MaterialModel,
    /// [Pa].
    young: f64,
}

impl fmt::Display for Body {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "true rest of {:?}, {} kPa", self.model, self.young / 1e3)
    }
}

fn bodies(quick: bool) -> Vec<Body> {
    let soft = moduli(quick).iter().map(|&young| (MaterialModel::StableNeoHookean, young));
    let all = soft.chain([(MaterialModel::SaintVenantKirchhoff, GREEN_YOUNG)]);
    all.map(|(model, young)| Body { model, young }).collect()
}

struct Case {
    /// Which of the bodies, and what it is.
    body: usize,
    model: MaterialModel,
    young: f64,
    method: usize,
    iterations: u32,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { model, young, method, iterations, .. } = self;
        let (name, young) = (&methods()[*method].name, young / 1e3);
        write!(f, "{model:?}, {young} kPa, {name}, {iterations} iterations")
    }
}

/// Grouped by material and method, iterations innermost.
fn cases(quick: bool) -> Vec<Case> {
    let mut cases = Vec::new();
    for (body, Body { model, young }) in bodies(quick).into_iter().enumerate() {
        for method in 0..methods().len() {
            let case = |&iterations| Case { body, model, young, method, iterations };
            cases.extend(iteration_counts(quick).iter().map(case));
        }
    }
    cases
}

fn case_count(quick: bool) -> usize {
    bodies(quick).len() + cases(quick).len()
}

fn load_case(context: &Context, model: MaterialModel, young: f64) -> Result<LoadCase> {
    let poisson = context.changes.poisson.unwrap_or(POISSON);
    let tissue = tissue(model, young, poisson)?;
    context.changes.load_case("cantilever", size(context.quick), tissue)
}

fn answer(context: &Context, case: &Case, truth: &Truth) -> Result<Error> {
    let load_case = load_case(context, case.model, case.young)?;
    let settings = methods()[case.method].clone().with_iterations(case.iterations).settings;
    let settled = match case.method {
        SINGLE => settle::<f32>(&load_case, &settings)?,
        _ => settle::<f64>(&load_case, &settings)?,
    };
    compare(&load_case, truth, &settled.positions)
}

fn is_lost(error: &Error) -> bool {
    !(error.rms <= LOST && error.stiffness > 0.0)
}

/// How far the apparent stiffness is off.
fn off(error: &Error) -> f64 {
    if is_lost(error) { f64::INFINITY } else { (error.stiffness - 1.0).abs() }
}

fn run(context: &mut Context) -> Result<()> {
    teach(context);
    let cases = cases(context.quick);
    let truths = context.run_cases(&bodies(context.quick), |body| {
        truth(&load_case(context, body.model, body.young)?)
    })?;
    let errors = context.run_cases(&cases, |case| answer(context, case, &truths[case.body]))?;
    let count = iteration_counts(context.quick).len();
    let rows: Vec<(&[Case], &[Error])> = cases.chunks(count).zip(errors.chunks(count)).collect();
    for (body, rows) in rows.chunks(methods().len()).enumerate() {
        draw_methods(context, body, rows)?;
    }
    draw_exact(context, &rows)?;
    tabulate(context, &rows);
    record(context, &cases, &errors)?;
    costs(context)?;
    conclude(context, &cases, &errors);
    Ok(())
}

fn teach(context: &mut Context) {
    let doc = &mut context.document;
    doc.paragraph(format!(
        "A bar fixed at one end comes to rest under its weight ({FRAMES} frames of 1/60 s, one step each, \
         all velocities times {KEPT_VELOCITY} after every frame). *Apparent stiffness* is `s = sum u* . u* \
         / sum u* . u` over the free vertices, with `u` the displacement of the method and `u*` that of the \
         same mesh by Newton's method: 1 is right, 2 feels twice as stiff as what was typed. At rest there is \
         no motion left to resolve, so whatever `s` says is not a matter of time steps: a method that asks for \
         E and answers with `s E` has solved another problem. This section sweeps E itself and leaves \
         `--set young` aside."
    ));
    doc.paragraph(
        "Why `s` is not 1 as published: a sweep ends where `C + a~ l = 0`, and never looks at the other half, \
         `M (x - xt) = J^T l`; with `l` from zero in every frame, a few sweeps build up part of the stress \
         only, and many arrive where the gradients that turned on the way have led them: a place that depends \
         on the path, too soft or too stiff. *Anderson \
         on positions* extrapolates `x` and leaves `l` behind: positions move as if forces had acted that `l` \
         does not account for, and go on towards what the constraints want without compliance. Green strain wants the body \
         rigid; the pair of the stable neo-Hookean energy as published, `J - a` and `|F|`, is not zero at rest, \
         and wants it smaller. *On multipliers*, `x = xt + M^-1 J(x)^T l` treats the geometric stiffness \
         explicitly, which is stable only while `dt^2` times it stays below the mass. *On both*, equal \
         weights keep the two together where gradients are constant, so that it hurries towards the published \
         answer, right or wrong. The *exact form* pulls positions back to the other half before each sweep \
         (the rebase), keeps `l` from frame to frame, and guards steps: at rest nothing is left to \
         build up, and the number of sweeps drops out. For the stable neo-Hookean energy it has other constraints as \
         well, six components of the stretch in the place of the pair; Green strain has the same ones in both, \
         and shows what rebase, kept multipliers and guard do alone.",
    );
}

fn body_name(case: &Case) -> String {
    format!("{}, E = {} kPa", law(case.model), case.young / 1e3)
}

/// All methods on one body. A plot of each of five moduli would tell the same five times.
fn draw_methods(context: &mut Context, body: usize, rows: &[(&[Case], &[Error])]) -> Result<()> {
    let first = &rows[0].0[0];
    let name = match first.model {
        MaterialModel::SaintVenantKirchhoff => "stiffness-green".to_owned(),
        MaterialModel::StableNeoHookean if [1e4, 1e5].contains(&first.young) => {
            format!("stiffness-{body}")
        }
        MaterialModel::StableNeoHookean => return Ok(()),
    };
    let mut plot = Plot::new(
        body_name(first),
        Axis::logarithmic("iterations per frame"),
        Axis::logarithmic("apparent stiffness"),
    );
    for (cases, errors) in &rows[..=DOUBLE] {
        let kept = cases.iter().zip(*errors).filter(|(_, error)| !is_lost(error));
        let points = kept.map(|(case, error)| [f64::from(case.iterations), error.stiffness]);
        let method = &methods()[cases[0].method];
        plot.series(Series::new(method.name.clone(), points).with_style(Style::MarkedLine));
    }
    plot.reference(1.0, "what was typed");
    context.plot(
        &name,
        &plot,
        "A method whose curve is level at 1 gives the typed stiffness with any number of iterations; bodies that \
         left the scene have no point.",
    )
}

/// The exact form for all moduli.
fn draw_exact(context: &mut Context, rows: &[(&[Case], &[Error])]) -> Result<()> {
    let mut plot = Plot::new(
        "The exact form: how far the apparent stiffness is off",
        Axis::logarithmic("iterations per frame"),
        Axis::logarithmic("|apparent stiffness - 1|"),
    );
    for (cases, errors) in rows {
        let Case { model, method, young, .. } = cases[0];
        if method < DOUBLE || model == MaterialModel::SaintVenantKirchhoff {
            continue;
        }
        let kept = cases.iter().zip(*errors).filter(|(_, error)| !is_lost(error));
        let points = kept.map(|(case, error)| [f64::from(case.iterations), off(error).max(FLOOR)]);
        let (precision, style) = if method == DOUBLE {
            ("double", Style::MarkedLine)
        } else {
            ("single", Style::Dashed)
        };
        let name = format!("{} kPa, {precision}", young / 1e3);
        plot.series(Series::new(name, points).with_style(style));
    }
    plot.reference(LIMITS[0], "0.1 %");
    context.plot(
        "stiffness-exact",
        &plot,
        "What is left in double precision is the rest of the damped motion and of the sweeps; in single \
         precision, round-off of positions. A curve that fell with the iterations would be a stiffness that more \
         iterations have to buy.",
    )
}

fn cell(error: &Error) -> String {
    match () {
        () if is_lost(error) => "lost".to_owned(),
        () if error.is_other_minimum() => format!("{:.4} (other minimum)", error.stiffness),
        () => format!("{:.4}", error.stiffness),
    }
}

fn tabulate(context: &mut Context, rows: &[(&[Case], &[Error])]) {
    let counts = iteration_counts(context.quick).iter().map(|k| k.to_string());
    let heads = ["tissue", "method"].map(str::to_owned).into_iter().chain(counts);
    let mut table = Table::new(heads);
    for (cases, errors) in rows {
        let names = [body_name(&cases[0]), methods()[cases[0].method].name.clone()];
        table.row(names.into_iter().chain(errors.iter().map(cell)));
    }
    context.document.paragraph("Apparent stiffness by iterations per frame:");
    context.document.table(&table);
}

fn record(context: &mut Context, cases: &[Case], errors: &[Error]) -> Result<()> {
    let mut table = Table::new([
        "tissue",
        "young [Pa]",
        "method",
        "iterations",
        "apparent stiffness",
        "rms error",
        "unbalanced force",
        "inverted tets",
    ]);
    for (case, error) in cases.iter().zip(errors) {
        table.row([
            format!("{:?}", case.model),
            case.young.to_string(),
            methods()[case.method].name.clone(),
            case.iterations.to_string(),
            format!("{:.6}", error.stiffness),
            scientific(error.rms),
            scientific(error.gradient),
            error.inverted.to_string(),
        ]);
    }
    context.document.data("stiffness", "All rests", &table)
}

/// What the iterations cost: dependent passes and time, beside the iterations.
fn costs(context: &mut Context) -> Result<()> {
    let stiff = load_case(context, MaterialModel::StableNeoHookean, GREEN_YOUNG)?;
    let tets = stiff.mesh.tets().len();
    let step = MeasuredStep::new(stiff, 0)?;
    let counts = iteration_counts(context.quick).iter().map(|k| format!("{k} iterations"));
    let mut table = Table::new(["method".to_owned()].into_iter().chain(counts));
    for method in methods().into_iter().take(SINGLE) {
        let mut row = vec![method.name.clone()];
        for &iterations in iteration_counts(context.quick) {
            let settings = method.clone().with_iterations(iterations).settings;
            let Cost { passes, seconds } = step.frame_cost(&settings)?;
            row.push(format!("{passes} passes, {:.2} ms", 1e3 * seconds));
        }
        table.row(row);
    }
    context.document.paragraph(format!(
        "What a frame costs ({tets} tetrahedra, stable neo-Hookean): passes that wait for each other, and \
         milliseconds on one thread in single precision, with all that surrounds iterations, guards included:"
    ));
    context.document.table(&table);
    Ok(())
}

fn conclude(context: &mut Context, cases: &[Case], errors: &[Error]) {
    let of = |method, model| {
        let pairs = cases.iter().zip(errors);
        pairs.filter(move |(case, _)| case.method == method && case.model == model)
    };
    for model in [MaterialModel::StableNeoHookean, MaterialModel::SaintVenantKirchhoff] {
        let words: Vec<String> = methods()[..DOUBLE]
            .iter()
            .enumerate()
            .map(|(method, NamedSettings { name, .. })| {
                let kept = || of(method, model).filter(|(_, error)| !is_lost(error));
                let [all, left] = [of(method, model).count(), kept().count()];
                let range = kept().map(|(_, error)| error.stiffness);
                let [low, high] =
                    range.fold([f64::INFINITY, 0.0f64], |[low, high], s| [low.min(s), high.max(s)]);
                match left {
                    0 => format!("{name}: all {all} lost"),
                    _ => format!("{name}: {low:.2} to {high:.2}, {} of {all} lost", all - left),
                }
            })
            .collect();
        let law = law(model);
        let text =
            format!("Over all numbers of iterations of {law} bodies `s` is: {}.", words.join("; "));
        context.document.paragraph(text);
    }
    for (method, limit) in [DOUBLE, SINGLE].into_iter().zip(LIMITS) {
        let mine = || of(method, MaterialModel::StableNeoHookean);
        let others = mine().filter(|(_, error)| error.is_other_minimum()).count();
        let worst = mine().map(|(_, error)| off(error)).fold(0.0, f64::max);
        let elsewhere =
            if others > 0 { format!(" ({others} in another minimum)") } else { String::new() };
        context.verdict(
            format!(
                "apparent stiffness, coloured, {}, all E and iterations",
                methods()[method].name
            ),
            format!("within {} of the truth", percent(limit)),
            format!("{} off{elsewhere}", percent(worst)),
            worst <= limit && mine().count() > 0,
        );
    }
}
