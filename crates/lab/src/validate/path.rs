//! Part of "Motion": the path of a bar's end beside that of small explicit steps.

use anyhow::{Context as _, Result, anyhow};
use std::fmt;
use viscera::scalar::{Real, Vec3};
use viscera::scene::Scene;
use viscera::settings::{Count, Integrator, Method, SolverSettings};
use viscera::simulation::{Assembly, Simulation};

use super::Context;
use viscera_report::{Axis, Plot, Series, Style, Table, percent};

/// The bar and its fall. A length is written as a user would.
const SCENE: &str = r#"
[time]
duration = "0.5 s"

[[body]]
name = "bar"
shape = "beam"
length = "80 mm"
width = "20 mm"
height = "20 mm"
cells_across = 4
material = { young = "50 kPa", poisson = 0.45, density = "1000 kg/m^3" }

[[fixing]]
name = "wall"
body = "bar"
half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }
"#;

/// Poisson's ratios, and the largest error that is asked of the quasi-Newton method for each.
const POISSONS: [(f64, f64); 3] = [(0.3, 0.04), (0.45, 0.04), (0.49, 0.05)];

/// Of the largest stable step, small explicit ones take this share: their path changes by less than a
/// thousandth when it is halved.
const SAFETY: f64 = 0.25;

/// Who moves the bar.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Mover {
    name: &'static str,
    method: Method,
    integrator: Integrator,
    substeps: Count,
    iterations: Count,
    /// Whether its error is asked to be small.
    is_judged: bool,
}

const fn mover(name: &'static str, method: Method, substeps: Count) -> Mover {
    let (integrator, iterations) = (Integrator::Sdirk2, Count::Auto);
    Mover { name, method, integrator, substeps, iterations, is_judged: false }
}

const MOVERS: [Mover; 7] = [
    Mover { is_judged: true, ..mover("quasi-Newton", Method::QuasiNewton, Count::Auto) },
    mover("quasi-Newton, 1 substep", Method::QuasiNewton, Count::Of(1)),
    Mover {
        iterations: Count::Of(40),
        ..mover("quasi-Newton, 1 substep, 40 passes", Method::QuasiNewton, Count::Of(1))
    },
    mover("quasi-Newton, 2 substeps", Method::QuasiNewton, Count::Of(2)),
    mover("quasi-Newton, 4 substeps", Method::QuasiNewton, Count::Of(4)),
    Mover {
        integrator: Integrator::ImplicitEuler,
        ..mover("quasi-Newton, implicit Euler", Method::QuasiNewton, Count::Auto)
    },
    mover("XPBD, defaults", Method::Xpbd, Count::Auto),
];

#[derive(Clone, Copy, Debug)]
struct Case {
    poisson: f64,
    /// Small explicit steps where there is none.
    mover: Option<Mover>,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.mover.map_or("small explicit steps", |mover| mover.name);
        write!(f, "path of the end, nu {}, {name}", self.poisson)
    }
}

/// For each Poisson's ratio small explicit steps, then the others.
fn cases() -> Vec<Case> {
    let all = || [None].into_iter().chain(MOVERS.map(Some));
    let of = |(poisson, _)| all().map(move |mover| Case { poisson, mover });
    POISSONS.into_iter().flat_map(of).collect()
}

pub(super) fn case_count() -> usize {
    cases().len()
}

/// What became of the end.
struct Path {
    /// Mean place of the end's vertices [m], at rest and after each frame.
    places: Vec<Vec3<f64>>,
    /// Of a frame.
    substeps: u32,
}

impl Path {
    /// Root mean square distance from another path over that path's displacement.
    fn distance(&self, exact: &Self) -> f64 {
        let rest = exact.places.first().copied().unwrap_or(Vec3::ZERO);
        let pairs = self.places.iter().zip(&exact.places);
        let error: f64 = pairs.map(|(x, y)| (*x - *y).length_squared()).sum();
        let moved: f64 = exact.places.iter().map(|x| (*x - rest).length_squared()).sum();
        (error / moved).sqrt()
    }
}

fn answer(case: &Case) -> Result<Path> {
    let poisson = case.poisson.to_string();
    let mut scene = Scene::parse("the bar", SCENE, &[("body.bar.material.poisson", &poisson)])?;
    scene.solver = match case.mover {
        None => SolverSettings {
            method: Method::Explicit,
            explicit_safety: SAFETY,
            ..SolverSettings::default()
        },
        Some(Mover { method, integrator, substeps, iterations, .. }) => {
            let defaults = SolverSettings::default();
            SolverSettings { method, integrator, substeps, iterations, ..defaults }
        }
    };
    match case.mover {
        None => path::<f64>(scene),
        Some(_) => path::<f32>(scene),
    }
}

/// Runs a scene and follows the end.
fn path<S: Real>(scene: Scene) -> Result<Path> {
    let frames = scene.frame_count();
    let assembly = Assembly::new(&scene, &mut |file| Err(format!("{file}: no files here")))?;
    let mut simulation = Simulation::<S>::new(scene, assembly)?;
    let rest = simulation.state().positions.clone();
    let far = rest.iter().fold(f64::NEG_INFINITY, |far, x| far.max(x.x.to_f64()));
    let end: Vec<usize> = (0..rest.len()).filter(|&v| rest[v].x.to_f64() > far - 1e-6).collect();
    let place = |positions: &[Vec3<S>]| {
        let sum = end.iter().fold(Vec3::ZERO, |sum: Vec3<f64>, &v| sum + positions[v].cast());
        sum * (1.0 / end.len() as f64)
    };
    let mut places = vec![place(&rest)];
    for _ in 0..frames {
        simulation.advance_frame().map_err(|error| anyhow!("{error}"))?;
        places.push(place(&simulation.state().positions));
    }
    Ok(Path { places, substeps: simulation.substeps() })
}

/// The table, the figure and the claims.
pub(super) fn run(context: &mut Context) -> Result<()> {
    let cases = cases();
    let answers = context.run_cases(&cases, answer)?;
    context.document.subheading("The path of a bar's end");
    context.document.paragraph(format!(
        "A bar of 80 x 20 x 20 mm, stable neo-Hookean, E = 50 kPa, is let go at its rest shape, held at one \
         end, and swings undamped for half a second. The truth here is the motion itself: small explicit \
         steps on the same mesh, {SAFETY} of the largest stable one, in double precision. The error is the \
         root mean square distance of the end's middle over its root mean square displacement, over all \
         frames, in single precision and with the method's own number of iterations but where another is named. What a step damps and \
         delays counts here. Substeps are per frame of 1/60 s; `quasi-Newton` chooses them by itself."
    ));
    let heads = POISSONS.iter().flat_map(|(nu, _)| [format!("nu {nu}: error"), "substeps".into()]);
    let mut table = Table::new(["method".to_owned()].into_iter().chain(heads));
    let runs: Vec<&[Path]> = answers.chunks(1 + MOVERS.len()).collect();
    for (index, mover) in MOVERS.iter().enumerate() {
        let mut row = vec![mover.name.to_owned()];
        for (run, (poisson, limit)) in runs.iter().zip(POISSONS) {
            let (exact, ours) = (&run[0], &run[1 + index]);
            let error = ours.distance(exact);
            row.extend([percent(error), ours.substeps.to_string()]);
            if mover.is_judged {
                context.verdict(
                    format!("path of a bar's end over 0.5 s, {}, nu {poisson}", mover.name),
                    format!("< {}", percent(limit)),
                    percent(error),
                    error < limit,
                );
            }
        }
        table.row(row);
    }
    context.document.table(&table);
    let run = runs.get(1).context("there is no middle of Poisson's ratios")?;
    figure(context, run)
}

/// The fall of the end over time.
fn figure(context: &mut Context, run: &[Path]) -> Result<()> {
    let mut plot = Plot::new(
        format!("The end of a bar, nu {}", POISSONS[1].0),
        Axis::linear("time [s]"),
        Axis::linear("fall of the end [mm]"),
    );
    let names = ["small explicit steps"].into_iter().chain(MOVERS.iter().map(|mover| mover.name));
    for (index, (name, path)) in names.zip(run).enumerate() {
        let rest = path.places[0];
        let point = |(frame, x): (usize, &Vec3<f64>)| [frame as f64 / 60.0, 1e3 * (rest.z - x.z)];
        let style = if index == 0 { Style::MarkedLine } else { Style::Line };
        let points = path.places.iter().enumerate().map(point);
        plot.series(Series::new(name, points).with_style(style));
    }
    context.document.figure("motion-path", &plot)
}
