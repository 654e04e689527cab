//! A viscous bar dies down: as fast by every method as by small explicit steps.
//!
//! Kelvin-Voigt tissue of retardation time `tau` loses a mode of angular frequency `w` at the rate `w^2 tau/2`; what a
//! method damps by itself comes on top.

use std::fmt;

use anyhow::Result;
use viscera::scalar::Real;
use viscera::scene::Scene;
use viscera::settings::{Count, Method, SolverSettings};

use super::course::{SAFETY, begin, follow, small_steps};
use super::{Context, Section};
use viscera_report::{Axis, Plot, Series, Style, Table, percent};

pub(super) const SECTION: Section = Section {
    name: "decay",
    title: "A viscous bar dies down",
    cases: |quick, _| cases(quick).len(),
    run,
};

/// The end is pulled down, let go and swings about its rest shape: without gravity all energy is gone in the end.
const SCENE: &str = r#"
[time]
duration = "1 s"

[world]
gravity = 0

[[body]]
name = "bar"
shape = "beam"
length = "80 mm"
width = "20 mm"
height = "20 mm"
cells_across = 4
material = { young = "50 kPa", poisson = 0.45, viscosity = "10 ms" }

[[fixing]]
body = "bar"
half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }

[[force]]
body = "bar"
half_space = { point = ["79.9 mm", 0, 0], normal = [1, 0, 0] }
force = [0, 0, "-0.1 N"]
keys = [{ time = "0 s", factor = 0 }, { time = "0.1 s", factor = 1 }, { time = "0.12 s", factor = 0 }]
"#;

/// Frames from which on the bar swings freely, and until which it is watched.
const FREE: usize = 9;

/// Asked of the rate of decay.
const LIMIT: f64 = 0.03;

#[derive(Clone, Debug)]
struct Case {
    name: &'static str,
    settings: SolverSettings,
    single: bool,
    /// Over the thickness. The stable step of viscous tissue goes with the square of a cell.
    cells: u32,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

/// Small explicit steps first.
fn cases(quick: bool) -> Vec<Case> {
    let of = |method, substeps| SolverSettings { method, substeps, ..SolverSettings::xpbd() };
    let cells = if quick { 1 } else { 4 };
    let case = |name, settings| Case { name, settings, single: true, cells };
    let mut cases = vec![
        Case { single: false, ..case("small explicit steps", small_steps()) },
        case("explicit", of(Method::Explicit, Count::Auto)),
        case("quasi-Newton", of(Method::QuasiNewton, Count::Auto)),
        case("XPBD", of(Method::Xpbd, Count::Auto)),
    ];
    if !quick {
        cases.push(case("XPBD, 40 substeps", of(Method::Xpbd, Count::Of(40))));
        cases.push(case("XPBD, 160 substeps", of(Method::Xpbd, Count::Of(160))));
    }
    cases
}

struct Answer {
    /// Energy [J] after each frame.
    energies: Vec<f64>,
    /// Per frame.
    substeps: u32,
}

impl Answer {
    /// Rate [1/s] at which amplitudes decay: half the slope of the logarithm of the energy, by least squares.
    fn rate(&self, frame: f64) -> f64 {
        let points = self.energies.iter().enumerate().skip(FREE);
        let points: Vec<(f64, f64)> =
            points.map(|(k, energy)| (k as f64 * frame, libm::log(*energy))).collect();
        let count = points.len() as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
        let (t, y) = (mean(|p| p.0), mean(|p| p.1));
        let slope = points.iter().map(|p| (p.0 - t) * (p.1 - y)).sum::<f64>()
            / points.iter().map(|p| (p.0 - t) * (p.0 - t)).sum::<f64>();
        -0.5 * slope
    }
}

fn answer(case: &Case) -> Result<Answer> {
    let cells = case.cells.to_string();
    let mut scene = Scene::parse("the bar", SCENE, &[("body.bar.cells_across", &cells)])?;
    scene.solver = case.settings.clone();
    if case.single { swing::<f32>(scene) } else { swing::<f64>(scene) }
}

fn swing<S: Real>(scene: Scene) -> Result<Answer> {
    let mut simulation = begin::<S>(scene, None)?;
    let energies = follow(&mut simulation, |simulation| simulation.report().energy.total())?;
    Ok(Answer { energies, substeps: simulation.substeps() })
}

fn run(context: &mut Context) -> Result<()> {
    let cases = cases(context.quick);
    let answers = context.run_cases(&cases, answer)?;
    let frame = Scene::parse("the bar", SCENE, &[])?.time.frame;
    let truth = answers.first().map_or(f64::NAN, |answer| answer.rate(frame));
    context.document.paragraph(format!(
        "The end of a bar of 80 x 20 x 20 mm, stable neo-Hookean, E = 50 kPa, nu 0.45, viscosity 10 ms, is pulled down \
         without gravity, let go, and swings. Its rate of decay is half the slope of the logarithm of its energy, by \
         least squares over {:.2} to 1 s; the truth are small explicit steps, {SAFETY} of the largest stable one, in \
         double precision. The others work in single precision, with substeps of their own choice but where another \
         number is named: what a method damps beyond viscosity counts.",
        FREE as f64 * frame,
    ));
    let mut table = Table::new(["method", "substeps", "rate of decay", "over small steps'"]);
    let mut plot = Plot::new(
        "A viscous bar dies down",
        Axis::linear("time [s]"),
        Axis::logarithmic("energy [J]"),
    );
    for (index, (case, answer)) in cases.iter().zip(&answers).enumerate() {
        let rate = answer.rate(frame);
        let off = rate / truth - 1.0;
        table.row([
            case.name.to_owned(),
            answer.substeps.to_string(),
            format!("{rate:.3}/s"),
            if index == 0 { String::new() } else { percent(off) },
        ]);
        let points = answer.energies.iter().enumerate().skip(1);
        let points = points.map(|(k, energy)| [k as f64 * frame, *energy]);
        let style = if index == 0 { Style::MarkedLine } else { Style::Line };
        plot.series(Series::new(case.name, points).with_style(style));
        if index > 0 {
            context.verdict(
                format!(
                    "rate of decay of a viscous bar, {}, beside small explicit steps",
                    case.name
                ),
                format!("within {}", percent(LIMIT)),
                percent(off),
                off.abs() < LIMIT,
            );
        }
    }
    context.document.table(&table);
    context.document.figure("decay", &plot)
}
