//! A flat punch is pressed into a block: places and the force against depth.

use std::fmt;

use anyhow::Result;
use viscera::material::MaterialModel;
use viscera::scalar::{Vec3, vec3};

use super::methods::{LibrarySolver, floored, floored_percent, worse};
use super::{Context, Section};
use crate::load_cases::{BLOCK, DrivenPath, LoadCase, NEAR, Size, tissue};
use crate::settling::{Error, Truth, compare, truth};
use viscera_report::{Axis, Plot, Series, Style, Table, percent, si};

pub(super) const SECTION: Section =
    Section { name: "indentation", title: "Indentation", cases: |quick, _| case_count(quick), run };

/// Young's modulus [Pa].
const YOUNG: f64 = 1e4;
/// How fast the punch moves [m/frame].
const SPEED: f64 = 5e-4;
/// Half of the punch's edge over the block's.
const HALF_PUNCH: f64 = 0.2;
/// Below this an error is round-off, whose digits differ from machine to machine.
const FLOOR: f64 = 1e-9;
/// Asked of the library.
const LIMIT: f64 = 1e-3;
/// The library's answers, in the order of the table's rows.
const METHODS: [LibrarySolver; 2] = [LibrarySolver::Double, LibrarySolver::Single];

#[derive(Clone, Copy, Debug)]
struct Case {
    poisson: f64,
    /// [mm].
    depth: u32,
    size: Size,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "nu {}, {} mm deep", self.poisson, self.depth)
    }
}

fn poissons(quick: bool) -> &'static [f64] {
    if quick { &[0.45] } else { &[0.45, 0.49] }
}

fn cases(quick: bool) -> Vec<Case> {
    let (depths, size): (&[u32], _) =
        if quick { (&[5, 15], Size::Tiny) } else { (&[2, 5, 10, 15], Size::Small) };
    let of = |&poisson: &f64| depths.iter().map(move |&depth| Case { poisson, depth, size });
    poissons(quick).iter().flat_map(of).collect()
}

fn case_count(quick: bool) -> usize {
    cases(quick).len()
}

struct Answer {
    tet_count: usize,
    truth: Truth,
    /// With which the punch presses [N].
    true_force: f64,
    /// Volume now over volume at rest.
    true_volume: f64,
    /// Force [N] and error by each of the methods.
    library: [(f64, Error); 2],
}

fn run(context: &mut Context) -> Result<()> {
    let cases = cases(context.quick);
    let answers = context.run_cases(&cases, answer)?;
    let [length, width, height] = BLOCK.map(|edge| si(edge, "m"));
    let tet_count = answers.first().map_or(0, |answer| answer.tet_count);
    context.document.paragraph(format!(
        "A block of {length} x {width} x {height} ({tet_count} tetrahedra), stable neo-Hookean, E {}, \
         stands on a fixed bottom. The vertices of its top under a square flat punch of {} stick to \
         it; it is pressed down by {} per frame, without gravity. The force is that of the punch's pins: the \
         library's by its own force balance in the last step of the settling.",
        si(YOUNG, "Pa"),
        si(2.0 * HALF_PUNCH * BLOCK[0], "m"),
        si(SPEED, "m"),
    ));
    table(context, &cases, &answers);
    plot(context, &cases, &answers)?;
    verdict(context, &answers);
    Ok(())
}

fn table(context: &mut Context, cases: &[Case], answers: &[Answer]) {
    let heads = ["nu", "depth", "force, reference", "volume", "precision", "force, library"];
    let heads = heads.into_iter().chain(["force", "rms", "largest", "volume error", "energy"]);
    let mut table = Table::new(heads.chain(["|grad|", "inverted", ""]));
    for (case, answer) in cases.iter().zip(answers) {
        for (method, (force, error)) in METHODS.iter().zip(&answer.library) {
            table.row([
                case.poisson.to_string(),
                format!("{} mm", case.depth),
                newtons(answer.true_force),
                percent(answer.true_volume - 1.0),
                if *method == LibrarySolver::Single { "single" } else { "double" }.to_owned(),
                newtons(*force),
                floored_percent((force / answer.true_force - 1.0).abs(), FLOOR),
                floored_percent(error.rms, FLOOR),
                floored_percent(error.largest, FLOOR),
                floored_percent(error.volume.abs(), FLOOR),
                floored(error.energy.abs(), FLOOR),
                floored(error.gradient, FLOOR),
                format!("{} / {}", error.inverted, answer.truth.inverted),
                if error.is_other_minimum() { "another minimum" } else { "" }.to_owned(),
            ]);
        }
    }
    context.document.paragraph(
        "`volume` is the change since rest; the columns after the library's force are its errors: \
         relative ones of force and volume, of places over the displacement, of the potential over \
         the elastic energy; `|grad|` is the unbalanced force over the pins' force; `inverted` counts \
         tetrahedra, library / reference.",
    );
    context.document.table(&table);
}

/// Five digits: an error of a tenth of a percent must show.
fn newtons(force: f64) -> String {
    format!("{force:.4} N")
}

fn plot(context: &mut Context, cases: &[Case], answers: &[Answer]) -> Result<()> {
    let mut plot = Plot::new(
        "Indentation: force against depth",
        Axis::linear("depth [mm]"),
        Axis::linear("force of the punch [N]"),
    );
    for &poisson in poissons(context.quick) {
        let chosen = || cases.iter().zip(answers).filter(move |(case, _)| case.poisson == poisson);
        let truth = chosen().map(|(case, answer)| [f64::from(case.depth), answer.true_force]);
        let from_rest = std::iter::once([0.0, 0.0]).chain(truth);
        let name = format!("reference, nu {poisson}");
        plot.series(Series::new(name, from_rest).with_style(Style::Line));
        let single = chosen().map(|(case, answer)| [f64::from(case.depth), answer.library[1].0]);
        let name = format!("library in single precision, nu {poisson}");
        plot.series(Series::new(name, single).with_style(Style::Markers));
    }
    context.document.figure("indentation-force", &plot)
}

fn verdict(context: &mut Context, answers: &[Answer]) {
    for (at, method) in METHODS.iter().enumerate() {
        let (mut force_error, mut places) = (0.0, 0.0);
        for Answer { library, true_force, .. } in answers {
            let (force, error) = &library[at];
            force_error = worse(force_error, (force / true_force - 1.0).abs());
            places = worse(places, worse(error.rms, error.largest));
        }
        for (what, worst) in [("force", force_error), ("places", places)] {
            let what = format!("indentation, largest error of the {what}, {}", method.name());
            context.verdict(
                what,
                format!("< {}", percent(LIMIT)),
                floored_percent(worst, FLOOR),
                worst < LIMIT,
            );
        }
    }
}

fn load_case(case: &Case) -> Result<LoadCase> {
    let tissue = tissue(MaterialModel::StableNeoHookean, YOUNG, case.poisson)?;
    let mut load_case = LoadCase::new("press", case.size, tissue)?;
    let under = |x: f64, edge: f64| (x - 0.5 * edge).abs() < HALF_PUNCH * edge + NEAR;
    let top = BLOCK[2] - NEAR;
    load_case.driven =
        load_case.select(|x| x.z > top && under(x.x, BLOCK[0]) && under(x.y, BLOCK[1]));
    let depth = 1e-3 * f64::from(case.depth);
    load_case.path = DrivenPath::Shift(vec3(0.0, 0.0, -depth));
    load_case.path_frames = (depth / SPEED).round() as u32;
    Ok(load_case)
}

/// With which the driven pins press down [N].
fn force(load_case: &LoadCase, pin_forces: &[Vec3<f64>]) -> f64 {
    pin_forces.iter().skip(load_case.fixed.len()).map(|force| -force.z).sum()
}

fn answer(case: &Case) -> Result<Answer> {
    let load_case = load_case(case)?;
    let truth = truth(&load_case)?;
    let solve = |method: LibrarySolver| -> Result<_> {
        let settled = method.settle(&load_case)?;
        let error = compare(&load_case, &truth, &settled.positions)?;
        Ok((force(&load_case, &settled.pin_forces), error))
    };
    let [double, single] = METHODS.map(solve);
    Ok(Answer {
        tet_count: load_case.mesh.tets().len(),
        true_force: force(&load_case, &truth.pin_forces),
        true_volume: truth.volume / load_case.mesh.volume(),
        library: [double?, single?],
        truth,
    })
}
