//! The first bending frequency of the cantilever: the linearised problem on the same mesh, beam
//! theory, and the library's motion after a release.
//!
//! Implicit Euler with a step `h` turns an oscillation of angular frequency `w` into
//!
//! ```text
//! q_n = rho^n cos(n theta + phase),   theta = atan(w h),   rho = 1/sqrt(1 + w^2 h^2)
//! ```
//!
//! slower by `theta/(w h)` and damped. Timoshenko's cantilever, with `b^2 = rho A L^4 w^2/(E I)`,
//! `r^2 = I/(A L^2)`, `s^2 = E I/(k G A L^2)`, has its frequencies where
//!
//! ```text
//! 2 + (b^2 (r^2 - s^2)^2 + 2) cosh(b a) cos(b c) - b (r^2 + s^2)/sqrt(1 - b^2 r^2 s^2) sinh(b a) sin(b c) = 0
//! a, c = sqrt((sqrt((r^2 - s^2)^2 + 4/b^2) -+ (r^2 + s^2))/2)
//! ```
//!
//! Huang, "The effect of rotatory inertia and of shear deformation on the frequency and normal mode
//! equations of uniform beams with simple end conditions", 1961.

use std::f64::consts::PI;
use std::fmt;

use anyhow::{Context as _, Result, bail};
use viscera::material::MaterialModel;
use viscera::mesh::shapes::Block;
use viscera::scalar::{Real, Vec3, vec3};
use viscera::settings::{Count, SolverSettings};
use viscera::solver::{Inputs, Solver};
use viscera::state::State;

use super::methods::worse;
use super::{Context, Section};
use crate::load_cases::{BAR, DENSITY, FRAME_RATE, GRAVITY, LoadCase, NEAR, tissue};
use viscera_reference::{Mode, Reference};
use viscera_report::{Axis, Plot, Series, Style, Table, percent, si};

pub(super) const SECTION: Section = Section {
    name: "frequency",
    title: "First bending frequency",
    cases: |quick, _| case_count(quick),
    run,
};

/// Young's modulus [Pa].
const YOUNG: f64 = 1e5;
/// Poisson ratio of the motion.
const POISSON: f64 = 0.3;
const POISSONS: [f64; 3] = [0.3, 0.45, 0.49];
/// Share of gravity that bends the bar before the release: half a percent of its length.
const LOAD: f64 = 0.01;
/// Crossings of zero that are waited for: three and a half periods.
const CROSSINGS: usize = 7;
/// Frames after which the waiting ends.
const FRAMES: u32 = 600;
/// Asked of the library with the default settings.
const LIMIT: f64 = 0.01;

/// A motion after the release.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Case {
    substeps: u32,
    iterations: u32,
    single: bool,
    quick: bool,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { substeps, iterations, .. } = self;
        write!(f, "{substeps} substeps of {iterations}, {}", precision(self.single))
    }
}

fn precision(single: bool) -> &'static str {
    if single { "single" } else { "double" }
}

/// Substeps and iterations, those with the most work first; then the defaults.
fn cases(quick: bool) -> Vec<Case> {
    let schedules: &[(u32, u32)] = match quick {
        true => &[(10, 5), (2, 10), (4, 5)],
        false => &[
            (4, 20),
            (20, 4),
            (10, 5),
            (20, 2),
            (2, 20),
            (4, 10),
            (10, 3),
            (4, 5),
            (2, 10),
            (1, 20),
            (10, 1),
            (2, 5),
            (1, 10),
            (4, 2),
            (1, 5),
        ],
    };
    let defaults = SolverSettings::xpbd();
    let (substeps, iterations) = (defaults.substeps(), defaults.iterations());
    let case = |substeps, iterations, single| Case { substeps, iterations, single, quick };
    let mut cases: Vec<_> = schedules.iter().map(|&(n, k)| case(n, k, false)).collect();
    cases.extend([false, true].map(|single| case(substeps, iterations, single)));
    cases
}

/// A mesh whose frequency is asked for.
#[derive(Clone, Copy, Debug)]
struct Bar {
    cells: usize,
    /// [Pa].
    young: f64,
    poisson: f64,
}

impl fmt::Display for Bar {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let young = si(self.young, "Pa");
        write!(f, "{} cells across, E {young}, nu {}", self.cells, self.poisson)
    }
}

/// In the order of the table: its columns vary fastest.
fn bars(quick: bool) -> Vec<Bar> {
    let cells: &[usize] = if quick { &[2, 4] } else { &[2, 3, 4, 6, 8] };
    let of = |&cells: &usize| POISSONS.map(|poisson| Bar { cells, young: YOUNG, poisson });
    cells.iter().flat_map(of).collect()
}

fn case_count(quick: bool) -> usize {
    cases(quick).len() + bars(quick).len() + stiffer_bars(quick).len()
}

/// Bars that ask more and more of the defaults.
fn stiffer_bars(quick: bool) -> Vec<Bar> {
    let (cells, youngs): (usize, &[f64]) =
        if quick { (2, &[4e5, 1.6e6]) } else { (4, &[5e4, 1e5, 2e5, 4e5, 8e5]) };
    let of = |&young: &f64| Bar { cells, young, poisson: POISSON };
    youngs.iter().map(of).collect()
}

fn run(context: &mut Context) -> Result<()> {
    let [length, width, height] = BAR.map(|edge| si(edge, "m"));
    context.document.paragraph(format!(
        "A bar of {length} x {width} x {height}, stable neo-Hookean, E {}, fixed at one end. How fast \
         does it swing?",
        si(YOUNG, "Pa"),
    ));
    meshes(context)?;
    motions(context)?;
    stiffer(context)
}

fn meshes(context: &mut Context) -> Result<()> {
    let bars = bars(context.quick);
    let frequencies = context.run_cases(&bars, |bar| {
        let load_case = bar.load_case()?;
        Ok(bar.mode(&load_case)?.omega / (2.0 * PI))
    })?;
    let heads = POISSONS.iter().flat_map(|nu| [format!("nu {nu}"), "over Timoshenko".to_owned()]);
    let mut table = Table::new(std::iter::once("cells across".to_owned()).chain(heads));
    let count = POISSONS.len();
    for (bars, frequencies) in bars.chunks(count).zip(frequencies.chunks(count)) {
        let mut row: Vec<_> = bars.first().map(|bar| bar.cells.to_string()).into_iter().collect();
        for (bar, frequency) in bars.iter().zip(frequencies) {
            row.push(si(*frequency, "Hz"));
            row.push(format!("{:.3}", frequency / timoshenko(bar.poisson)));
        }
        table.row(row);
    }
    for (name, theory) in
        [("Timoshenko", timoshenko as fn(f64) -> f64), ("Euler-Bernoulli", |_| euler_bernoulli())]
    {
        let mut row = vec![name.to_owned()];
        for poisson in POISSONS {
            row.push(si(theory(poisson), "Hz"));
            row.push(format!("{:.3}", theory(poisson) / timoshenko(poisson)));
        }
        table.row(row);
    }
    context.document.subheading("The mesh's frequency");
    context.document.paragraph(
        "The lowest bending frequency of the linearised problem (lumped masses, inverse iteration) on \
         linear tetrahedra, and beam theory's. A mesh that locks is too stiff and swings too fast, by \
         the square root of its stiffness.",
    );
    context.document.table(&table);
    Ok(())
}

/// What a motion was.
#[derive(Clone, Copy, Debug)]
struct Motion {
    /// [Hz].
    frequency: f64,
    /// Share of the amplitude that is left after a period.
    left: f64,
}

fn motions(context: &mut Context) -> Result<()> {
    let cells = if context.quick { 2 } else { 4 };
    let bar = Bar { cells, young: YOUNG, poisson: POISSON };
    let load_case = bar.load_case()?;
    let mode = bar.mode(&load_case)?;
    let start = bent(&load_case)?;
    let cases = cases(context.quick);
    let motions = context.run_cases(&cases, |case| match case.single {
        true => release::<f32>(case, &load_case, &mode, &start),
        false => release::<f64>(case, &load_case, &mode, &start),
    })?;
    let exact = mode.omega / (2.0 * PI);
    context.document.subheading("The library's motion");
    context.document.paragraph(format!(
        "The bar ({cells} cells across, {} tetrahedra, nu {POISSON}) is bent by {} % of its weight and \
         let go. Its part in the first mode, `q = phi^T M u`, crosses zero every half period. The mesh \
         swings with {}; implicit Euler with a step `h` makes of that, for `w = 2 pi f`,",
        load_case.mesh.tets().len(),
        100.0 * LOAD,
        si(exact, "Hz"),
    ));
    context.document.paragraph(
        "```text\nq_n = rho^n cos(n theta + phase),   theta = atan(w h),   rho = 1/sqrt(1 + w^2 h^2)\n```",
    );
    let heads = ["substeps", "iterations", "precision", "frequency", "implicit Euler", "off by"];
    let mut table = Table::new(heads.into_iter().chain(["left per period", "implicit Euler"]));
    let mut order: Vec<usize> = (0..cases.len()).collect();
    order.sort_by_key(|&at| (cases[at].substeps, cases[at].iterations, cases[at].single));
    for at in order {
        let (case, motion) = (&cases[at], &motions[at]);
        let euler = implicit_euler(mode.omega, case.substeps);
        table.row([
            case.substeps.to_string(),
            case.iterations.to_string(),
            precision(case.single).to_owned(),
            format!("{:.4} Hz", motion.frequency),
            format!("{:.4} Hz", euler.frequency),
            percent(motion.frequency / euler.frequency - 1.0),
            format!("{:.3}", motion.left),
            format!("{:.3}", euler.left),
        ]);
    }
    context.document.table(&table);
    plot(context, &cases, &motions, mode.omega)?;
    let defaults = SolverSettings::xpbd();
    let mut worst = 0.0;
    for (case, motion) in cases.iter().zip(&motions) {
        if (case.substeps, case.iterations) == (defaults.substeps(), defaults.iterations()) {
            let euler = implicit_euler(mode.omega, case.substeps);
            worst = worse(worst, (motion.frequency / euler.frequency - 1.0).abs());
        }
    }
    let what = "first bending frequency, XPBD's defaults, against implicit Euler of the same step";
    context.verdict(what, format!("< {}", percent(LIMIT)), percent(worst), worst < LIMIT);
    Ok(())
}

fn plot(context: &mut Context, cases: &[Case], motions: &[Motion], omega: f64) -> Result<()> {
    let work = || Axis::logarithmic("iterations per frame (substeps x iterations)");
    let mut error = Plot::new(
        "Bending: error of the frequency",
        work(),
        Axis::logarithmic("|frequency / implicit Euler's - 1|"),
    );
    let mut growth = Plot::new(
        "Bending: amplitude after a period",
        work(),
        Axis::linear("amplitude left / implicit Euler's"),
    );
    let mut counts: Vec<u32> = cases.iter().map(|case| case.substeps).collect();
    counts.sort_unstable();
    counts.dedup();
    for substeps in counts {
        let euler = implicit_euler(omega, substeps);
        let chosen = cases.iter().zip(motions);
        let mut chosen: Vec<_> =
            chosen.filter(|(case, _)| case.substeps == substeps && !case.single).collect();
        chosen.sort_by_key(|(case, _)| case.iterations);
        let series = |value: &dyn Fn(&Motion) -> f64| {
            let points = chosen
                .iter()
                .map(|(case, motion)| [f64::from(substeps * case.iterations), value(motion)]);
            let name = format!("{substeps} substep{}", if substeps == 1 { "" } else { "s" });
            Series::new(name, points).with_style(Style::MarkedLine)
        };
        error.series(series(&|motion| (motion.frequency / euler.frequency - 1.0).abs()));
        growth.series(series(&|motion| motion.left / euler.left));
    }
    growth.reference(1.0, "implicit Euler");
    context.document.paragraph(
        "With too few iterations for the step, the multipliers trail behind the motion: it becomes \
         slow and keeps another share of its amplitude than implicit Euler leaves. Rest does not \
         depend on that; more substeps mend it at the same work.",
    );
    context.document.figure("frequency-error", &error)?;
    context.document.figure("frequency-amplitude", &growth)
}

/// How stiff tissue may be before the defaults' two iterations fall behind the motion.
fn stiffer(context: &mut Context) -> Result<()> {
    let bars = stiffer_bars(context.quick);
    let defaults = SolverSettings::xpbd();
    let (substeps, iterations) = (defaults.substeps(), defaults.iterations());
    let case = Case { substeps, iterations, single: false, quick: context.quick };
    let motions = context.run_cases(&bars, |bar| {
        let load_case = bar.load_case()?;
        let mode = bar.mode(&load_case)?;
        Ok((mode.omega, release::<f64>(&case, &load_case, &mode, &bent(&load_case)?)?))
    })?;
    let heads = ["E", "(E/rho) (h/edge)^2", "frequency", "implicit Euler", "off by"];
    let mut table = Table::new(heads.into_iter().chain(["left per period", "implicit Euler"]));
    let dt = 1.0 / FRAME_RATE / f64::from(substeps);
    for (bar, (omega, motion)) in bars.iter().zip(&motions) {
        let edge = BAR[1] / bar.cells as f64;
        let euler = implicit_euler(*omega, substeps);
        table.row([
            si(bar.young, "Pa"),
            format!("{:.2}", bar.young / DENSITY * (dt / edge).powi(2)),
            format!("{:.4} Hz", motion.frequency),
            format!("{:.4} Hz", euler.frequency),
            percent(motion.frequency / euler.frequency - 1.0),
            format!("{:.3}", motion.left),
            format!("{:.3}", euler.left),
        ]);
    }
    context.document.subheading("Stiffer tissue with XPBD's default settings");
    context.document.paragraph(format!(
        "The same release with {substeps} substeps of {iterations} iterations and other stiffnesses. \
         `(E/rho) (h/edge)^2`, with the edge of a cell, is the square of how many cells a wave along \
         the bar passes in a substep. Where it is large for the number of iterations, an undamped \
         small swing keeps too much of its amplitude: take more substeps, which lower it by their \
         square.",
    ));
    context.document.table(&table);
    Ok(())
}

impl Bar {
    fn load_case(&self) -> Result<LoadCase> {
        let block = Block::new(Vec3::from_f64(BAR), [4 * self.cells, self.cells, self.cells]);
        let mesh = block.mesh().context("the bar of the frequency")?;
        let tissue = tissue(MaterialModel::StableNeoHookean, self.young, self.poisson)?;
        let mut load_case = LoadCase::bare("cantilever", mesh, tissue);
        load_case.fixed = load_case.select(|x| x.x < NEAR);
        Ok(load_case)
    }

    fn mode(&self, load_case: &LoadCase) -> Result<Mode> {
        let model = load_case.model::<f64>()?;
        let down = vec3(0.0, 0.0, -1.0);
        Ok(Reference::new(&model).lowest_mode(
            &model.rest_positions,
            &load_case.inputs(1.0),
            down,
        )?)
    }
}

/// The bar at rest under a small load [m].
fn bent(load_case: &LoadCase) -> Result<Vec<Vec3<f64>>> {
    let model = load_case.model::<f64>()?;
    let inputs = Inputs { gravity: GRAVITY * LOAD, ..load_case.inputs(1.0) };
    Ok(Reference::new(&model).settle(&model.rest_positions, &inputs)?.positions)
}

/// Lets the bent bar go and measures how it swings.
fn release<S: Real>(
    case: &Case,
    load_case: &LoadCase,
    mode: &Mode,
    start: &[Vec3<f64>],
) -> Result<Motion> {
    let settings = SolverSettings {
        substeps: Count::Of(case.substeps),
        iterations: Count::Of(case.iterations),
        ..SolverSettings::xpbd()
    };
    let model = load_case.model::<S>()?;
    let mut solver = Solver::new(&model, &settings);
    let mut state = State::at_rest(&model);
    for (x, start) in state.positions.iter_mut().zip(start) {
        *x = start.cast();
    }
    let dt = 1.0 / FRAME_RATE / f64::from(case.substeps);
    let inputs = load_case.inputs(1.0);
    solver.restart(&model, &mut state, &inputs, dt)?;
    let part = |state: &State<S>| -> f64 {
        let moved = state.positions.iter().zip(load_case.mesh.vertices());
        let terms = moved.zip(mode.shape.iter().zip(&model.masses));
        terms.map(|((x, rest), (u, m))| u.dot(x.cast() - *rest) * m.to_f64()).sum()
    };
    let mut q = vec![part(&state)];
    let mut crossings = 0;
    for _ in 0..FRAMES * case.substeps {
        solver.step(&model, &mut state, &inputs, dt)?;
        let (before, now) = (q[q.len() - 1], part(&state));
        q.push(now);
        crossings += usize::from(before * now < 0.0);
        if crossings >= CROSSINGS {
            break;
        }
    }
    measure(&q, dt)
}

/// Frequency from the first to the last crossing of zero, by lines between samples; decay from the
/// largest values between crossings.
fn measure(q: &[f64], dt: f64) -> Result<Motion> {
    let mut crossings = Vec::new();
    let mut peaks = Vec::new();
    let mut peak = 0.0f64;
    for (n, pair) in q.windows(2).enumerate() {
        peak = peak.max(pair[0].abs());
        if pair[0] * pair[1] < 0.0 {
            crossings.push(n as f64 + pair[0] / (pair[0] - pair[1]));
            peaks.push(peak);
            peak = 0.0;
        }
    }
    let (&[first, .., last], &[_, first_peak, .., last_peak]) = (&crossings[..], &peaks[..]) else {
        bail!("the bar does not swing");
    };
    let half_periods = (crossings.len() - 1) as f64;
    let left = libm::pow(last_peak / first_peak, 2.0 / (peaks.len() - 2) as f64);
    Ok(Motion { frequency: half_periods / (2.0 * dt * (last - first)), left })
}

fn implicit_euler(omega: f64, substeps: u32) -> Motion {
    let dt = 1.0 / FRAME_RATE / f64::from(substeps);
    let theta = libm::atan(omega * dt);
    let steps_per_period = 2.0 * PI / theta;
    let left = libm::pow(1.0 + (omega * dt).powi(2), -0.5 * steps_per_period);
    Motion { frequency: theta / (2.0 * PI * dt), left }
}

/// `sqrt(E I/(rho A L^4))` [rad/s].
fn bending_rate() -> f64 {
    let [length, _, height] = BAR;
    (YOUNG * height * height / (12.0 * DENSITY)).sqrt() / (length * length)
}

/// [Hz].
fn euler_bernoulli() -> f64 {
    // The first root of 1 + cosh(x) cos(x).
    1.875_104_068_711_961_f64.powi(2) * bending_rate() / (2.0 * PI)
}

/// [Hz]. The first root of the frequency equation, by bisection.
fn timoshenko(poisson: f64) -> f64 {
    let [length, _, height] = BAR;
    let shear_coefficient = 10.0 * (1.0 + poisson) / (12.0 + 11.0 * poisson);
    let rotation = height * height / (12.0 * length * length);
    let shear = rotation * 2.0 * (1.0 + poisson) / shear_coefficient;
    let equation = |b: f64| {
        let (sum, difference) = (rotation + shear, rotation - shear);
        let root = (difference * difference + 4.0 / (b * b)).sqrt();
        let (a, c) = ((0.5 * (root - sum)).sqrt(), (0.5 * (root + sum)).sqrt());
        let product = libm::cosh(b * a) * libm::cos(b * c);
        let mixed = libm::sinh(b * a) * libm::sin(b * c);
        let factor = b * sum / (1.0 - b * b * rotation * shear).sqrt();
        2.0 + (b * b * difference * difference + 2.0) * product - factor * mixed
    };
    // Positive at 0, and negative at the root of the slender beam, which is always higher.
    let (mut low, mut high) = (0.1, 3.516);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if equation(middle) > 0.0 { low = middle } else { high = middle }
    }
    low * bending_rate() / (2.0 * PI)
}
