//! Part of "Motion": the path of a bar's end beside that of small explicit steps.

use anyhow::{Context as _, Result};
use std::fmt;
use viscera::material::MaterialModel;
use viscera::scalar::{Real, Vec3};
use viscera::scene::Scene;
use viscera::settings::{Count, Integrator, Method, SolverSettings};

use super::Context;
use super::course::{Places, SAFETY, begin, distance, follow, small_steps};
use super::methods::model_name;
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

/// A bar, and the largest error that is asked of the quasi-Newton method.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bar {
    law: MaterialModel,
    /// [Pa].
    young: f64,
    poisson: f64,
    /// Cells over the thickness: 4 make 1,280 tetrahedra, 8 make 10,240.
    cells: u32,
    limit: f64,
    /// The same with two steps per frame, where that is asked for.
    limit_of_two: Option<f64>,
}

impl Bar {
    /// The largest error that is asked of who moves it.
    fn limit_of(&self, mover: &Mover) -> Option<f64> {
        if mover.is_judged {
            Some(self.limit)
        } else {
            self.limit_of_two.filter(|_| *mover == MOVERS[TWO])
        }
    }
}

const fn bar(young: f64, poisson: f64, cells: u32, limit: f64) -> Bar {
    Bar { law: MaterialModel::StableNeoHookean, young, poisson, cells, limit, limit_of_two: None }
}

impl fmt::Display for Bar {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { law, young, poisson, cells, .. } = self;
        write!(f, "{}, {} kPa, nu {poisson}, {cells} cells across", model_name(*law), young / 1e3)
    }
}

/// Bars that everybody moves.
const BARS: [Bar; 3] = [
    Bar { limit_of_two: TWO_STEPS, ..bar(5e4, 0.3, 4, 0.04) },
    bar(5e4, 0.45, 4, 0.04),
    bar(5e4, 0.49, 4, 0.05),
];

const GREEN: MaterialModel = MaterialModel::SaintVenantKirchhoff;
const TWO_STEPS: Option<f64> = Some(0.015);

/// Bars that the quasi-Newton method alone moves.
const MORE_BARS: [Bar; 8] = [
    Bar { limit_of_two: TWO_STEPS, ..bar(5e4, 0.3, 8, 0.04) },
    Bar { law: GREEN, limit_of_two: TWO_STEPS, ..bar(5e4, 0.3, 4, 0.04) },
    Bar { law: GREEN, limit_of_two: TWO_STEPS, ..bar(5e4, 0.3, 8, 0.04) },
    bar(5e4, 0.45, 8, 0.04),
    bar(5e4, 0.49, 8, 0.05),
    bar(5e5, 0.3, 4, 0.04),
    bar(5e5, 0.45, 4, 0.04),
    bar(5e5, 0.3, 8, 0.04),
];

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

const MOVERS: [Mover; 8] = [
    Mover { is_judged: true, ..mover("quasi-Newton", Method::QuasiNewton, Count::Auto) },
    mover("quasi-Newton, 1 substep", Method::QuasiNewton, Count::Of(1)),
    Mover {
        iterations: Count::Of(40),
        ..mover("quasi-Newton, 1 substep, 40 passes", Method::QuasiNewton, Count::Of(1))
    },
    mover("quasi-Newton, 2 substeps", Method::QuasiNewton, Count::Of(2)),
    Mover {
        iterations: Count::Of(40),
        ..mover("quasi-Newton, 2 substeps, 40 passes", Method::QuasiNewton, Count::Of(2))
    },
    mover("quasi-Newton, 4 substeps", Method::QuasiNewton, Count::Of(4)),
    Mover {
        integrator: Integrator::ImplicitEuler,
        ..mover("quasi-Newton, implicit Euler", Method::QuasiNewton, Count::Auto)
    },
    mover("XPBD, defaults", Method::Xpbd, Count::Auto),
];

/// Those of the second table: as chosen, then with two steps, and with two that are solved to their ends.
const OF_MORE_BARS: [Mover; 3] = [MOVERS[0], MOVERS[TWO], MOVERS[TWO + 1]];

/// Where two substeps are in [`MOVERS`].
const TWO: usize = 3;

#[derive(Clone, Copy, Debug)]
struct Case {
    bar: Bar,
    /// Small explicit steps where there is none.
    mover: Option<Mover>,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.mover.map_or("small explicit steps", |mover| mover.name);
        write!(f, "path of the end, {}, {name}", self.bar)
    }
}

/// For each bar small explicit steps, then the others.
fn cases(bars: &[Bar], movers: &[Mover]) -> Vec<Case> {
    let all = || [None].into_iter().chain(movers.iter().copied().map(Some));
    let of = |&bar| all().map(move |mover| Case { bar, mover });
    bars.iter().flat_map(of).collect()
}

/// The bars of the second table: a look takes seconds.
fn more_bars(quick: bool) -> &'static [Bar] {
    if quick { &[] } else { &MORE_BARS }
}

pub(super) fn case_count(quick: bool) -> usize {
    cases(&BARS, &MOVERS).len() + cases(more_bars(quick), &OF_MORE_BARS).len()
}

/// What became of the end.
struct Path {
    /// Mean place of the end's vertices.
    places: Places,
    /// Of a frame.
    substeps: u32,
    tets: usize,
}

fn answer(case: &Case) -> Result<Path> {
    let Bar { law, young, poisson, cells, .. } = case.bar;
    let (law, young) = (law.to_string(), format!("{young} Pa"));
    let (poisson, cells) = (poisson.to_string(), cells.to_string());
    let overrides = [
        ("body.bar.material.model", law.as_str()),
        ("body.bar.material.young", &young),
        ("body.bar.material.poisson", &poisson),
        ("body.bar.cells_across", &cells),
    ];
    let mut scene = Scene::parse("the bar", SCENE, &overrides)?;
    scene.solver = match case.mover {
        None => small_steps(),
        Some(Mover { method, integrator, substeps, iterations, .. }) => {
            let defaults = SolverSettings::xpbd();
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
    let mut simulation = begin::<S>(scene, None)?;
    let rest = simulation.state().positions.clone();
    let far = rest.iter().fold(f64::NEG_INFINITY, |far, x| far.max(x.x.to_f64()));
    let end: Vec<usize> = (0..rest.len()).filter(|&v| rest[v].x.to_f64() > far - 1e-6).collect();
    let places = follow(&mut simulation, |simulation| {
        let positions = &simulation.state().positions;
        let sum = end.iter().fold(Vec3::ZERO, |sum: Vec3<f64>, &v| sum + positions[v].cast());
        vec![sum * (1.0 / end.len() as f64)]
    })?;
    Ok(Path { places, substeps: simulation.substeps(), tets: simulation.model().tet_count() })
}

/// The table, the figure and the claims.
pub(super) fn run(context: &mut Context) -> Result<()> {
    let answers = context.run_cases(&cases(&BARS, &MOVERS), answer)?;
    context.document.subheading("The path of a bar's end");
    context.document.paragraph(format!(
        "A bar of 80 x 20 x 20 mm, stable neo-Hookean, E = 50 kPa, is let go at its rest shape, held at one \
         end, and swings undamped for half a second. The truth here is the motion itself: small explicit \
         steps on the same mesh, {SAFETY} of the largest stable one, in double precision. The error is the \
         root mean square distance of the end's middle over its root mean square displacement, over all \
         frames, in single precision and with the method's own number of iterations but where another is named. What a step damps and \
         delays counts here. Substeps are per frame of 1/60 s; `quasi-Newton` chooses them by itself."
    ));
    let heads =
        BARS.iter().flat_map(|bar| [format!("nu {}: error", bar.poisson), "substeps".into()]);
    let mut table = Table::new(["method".to_owned()].into_iter().chain(heads));
    let runs: Vec<&[Path]> = answers.chunks(1 + MOVERS.len()).collect();
    for (index, mover) in MOVERS.iter().enumerate() {
        let mut row = vec![mover.name.to_owned()];
        for (run, bar) in runs.iter().zip(&BARS) {
            let (exact, ours) = (&run[0], &run[1 + index]);
            let error = distance(&ours.places, &exact.places);
            row.extend([percent(error), ours.substeps.to_string()]);
            judge(context, bar, mover, error);
        }
        table.row(row);
    }
    context.document.table(&table);
    let run = runs.get(1).context("there is no middle of Poisson's ratios")?;
    figure(context, run)?;
    more(context)
}

/// A verdict, where something is asked.
fn judge(context: &mut Context, bar: &Bar, mover: &Mover, error: f64) {
    if let Some(limit) = bar.limit_of(mover) {
        context.verdict(
            format!("path of a bar's end over 0.5 s, {}, {bar}", mover.name),
            format!("< {}", percent(limit)),
            percent(error),
            error < limit,
        );
    }
}

/// Other laws, stiffer bars, finer meshes.
fn more(context: &mut Context) -> Result<()> {
    let bars = more_bars(context.quick);
    let answers = context.run_cases(&cases(bars, &OF_MORE_BARS), answer)?;
    if bars.is_empty() {
        return Ok(());
    }
    context.document.paragraph(
        "The same of other bars, by the quasi-Newton method with as many steps per frame as it chooses, and with two; \
         40 passes leave of an error what is the step's.",
    );
    let heads =
        ["law", "E", "nu", "tets", "error", "substeps", "2 substeps", "2 substeps, 40 passes"];
    let mut table = Table::new(heads);
    for (bar, paths) in bars.iter().zip(answers.chunks(1 + OF_MORE_BARS.len())) {
        let (exact, ours) = (&paths[0], &paths[1..]);
        let errors = [0, 1, 2].map(|at| distance(&ours[at].places, &exact.places));
        table.row([
            model_name(bar.law).to_owned(),
            format!("{} kPa", bar.young / 1e3),
            bar.poisson.to_string(),
            exact.tets.to_string(),
            percent(errors[0]),
            ours[0].substeps.to_string(),
            percent(errors[1]),
            percent(errors[2]),
        ]);
        for (mover, error) in OF_MORE_BARS.iter().zip(errors) {
            judge(context, bar, mover, error);
        }
    }
    context.document.table(&table);
    Ok(())
}

/// The fall of the end over time.
fn figure(context: &mut Context, run: &[Path]) -> Result<()> {
    let mut plot = Plot::new(
        format!("The end of a bar, nu {}", BARS[1].poisson),
        Axis::linear("time [s]"),
        Axis::linear("fall of the end [mm]"),
    );
    let names = ["small explicit steps"].into_iter().chain(MOVERS.iter().map(|mover| mover.name));
    for (index, (name, path)) in names.zip(run).enumerate() {
        let rest = path.places[0][0];
        let point =
            |(frame, x): (usize, &Vec<Vec3<f64>>)| [frame as f64 / 60.0, 1e3 * (rest.z - x[0].z)];
        let style = if index == 0 { Style::MarkedLine } else { Style::Line };
        let points = path.places.iter().enumerate().map(point);
        plot.series(Series::new(name, points).with_style(style));
    }
    context.document.figure("motion-path", &plot)
}
