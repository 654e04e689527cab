//! A bar is twisted by a whole turn, in increments: a stretch of large rotations, where the library's
//! answer must still be the reference's that has gone the same way.

use std::f64::consts::PI;
use std::fmt;

use anyhow::Result;
use viscera::material::MaterialModel;
use viscera::scalar::{Vec3, vec3};

use super::methods::{RIGHT_AT_REST, floored, floored_percent, worse};
use super::{Context, Section};
use crate::load_cases::{BAR, DrivenPath, LoadCase, Size, tissue};
use crate::settling::{Error, Truth, compare, truth_in_parts};
use viscera_report::{Axis, Plot, Series, Style, Table, percent, si};

pub(super) const SECTION: Section = Section {
    name: "twist",
    title: "Twist by 360 degrees",
    cases: |quick, _| case_count(quick),
    run,
};

/// Young's modulus [Pa].
const YOUNG: f64 = 1e4;
const POISSON: f64 = 0.45;
/// How fast the end turns [degrees/frame]: a whole turn takes a third of the settling's three seconds.
const SPEED: u32 = 6;
/// The reference's increments [degrees].
const INCREMENT: u32 = 10;
/// Below this an error is round-off, whose digits differ from machine to machine.
const FLOOR: f64 = 1e-9;
/// Asked of the library.
const LIMIT: f64 = 1e-3;

#[derive(Clone, Copy, Debug)]
struct Case {
    /// [degrees].
    angle: u32,
    size: Size,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} degrees, {:?} mesh", self.angle, self.size)
    }
}

/// The finer mesh first: it takes longest.
fn cases(quick: bool) -> Vec<Case> {
    let (angles, size): (&[u32], _) = match quick {
        true => (&[90, 180], Size::Tiny),
        false => (&[45, 90, 135, 180, 225, 270, 315, 360], Size::Small),
    };
    let finer = (!quick).then_some(Case { angle: 360, size: Size::Large });
    finer.into_iter().chain(angles.iter().map(|&angle| Case { angle, size })).collect()
}

fn case_count(quick: bool) -> usize {
    cases(quick).len()
}

struct Answer {
    tet_count: usize,
    truth: Truth,
    /// [N m].
    true_torque: f64,
    /// Volume now over volume at rest.
    true_volume: f64,
    /// Torque [N m] and error by each method of [`RIGHT_AT_REST`].
    library: Vec<(f64, Error)>,
}

fn run(context: &mut Context) -> Result<()> {
    let mut cases = cases(context.quick);
    let mut answers = context.run_cases(&cases, answer)?;
    if !context.quick {
        // The finer mesh stands last in the tables.
        cases.rotate_left(1);
        answers.rotate_left(1);
    }
    let [length, width, height] = BAR.map(|edge| si(edge, "m"));
    context.document.paragraph(format!(
        "A bar of {length} x {width} x {height}, stable neo-Hookean, E {}, nu {POISSON}, is held at \
         both ends; one end turns by {SPEED} degrees per frame and stops at the angle. The reference \
         follows in increments of {INCREMENT} degrees. The torque is that of the pins of the turned \
         end about the bar's axis.",
        si(YOUNG, "Pa"),
    ));
    table(context, &cases, &answers);
    errors(context, &cases, &answers);
    plot(context, &cases, &answers)?;
    verdict(context, &answers);
    Ok(())
}

fn table(context: &mut Context, cases: &[Case], answers: &[Answer]) {
    let heads = ["angle", "tets", "torque", "energy", "volume", "inverted", "|grad|", "minimum"];
    let mut table = Table::new(heads);
    for (case, answer) in cases.iter().zip(answers) {
        let Truth { standing, minimum, inverted, .. } = &answer.truth;
        table.row([
            format!("{}°", case.angle),
            answer.tet_count.to_string(),
            si(answer.true_torque, "N m"),
            si(standing.elastic_energy, "J"),
            percent(answer.true_volume - 1.0),
            inverted.to_string(),
            if standing.gradient < 1e-9 { "< 1e-9 N".into() } else { si(standing.gradient, "N") },
            if *minimum { "yes" } else { "no, a saddle" }.to_owned(),
        ]);
    }
    context.document.paragraph(
        "The reference: `volume` is the change since rest; `minimum` tells whether the exact Hessian \
         is positive there. That the finer mesh takes less torque is the mesh's doing: coarse linear \
         tetrahedra are too stiff (see the cantilever).",
    );
    context.document.table(&table);
}

fn errors(context: &mut Context, cases: &[Case], answers: &[Answer]) {
    let heads = ["angle", "tets", "method", "rms", "largest", "torque", "volume", "energy"];
    let mut table = Table::new(heads.into_iter().chain(["|grad|", "inverted", ""]));
    for (case, answer) in cases.iter().zip(answers) {
        for (method, (torque, error)) in RIGHT_AT_REST.iter().zip(&answer.library) {
            table.row([
                format!("{}°", case.angle),
                answer.tet_count.to_string(),
                method.name().to_owned(),
                floored_percent(error.rms, FLOOR),
                floored_percent(error.largest, FLOOR),
                floored_percent((torque / answer.true_torque - 1.0).abs(), FLOOR),
                floored_percent(error.volume.abs(), FLOOR),
                floored(error.energy.abs(), FLOOR),
                floored(error.gradient, FLOOR),
                error.inverted.to_string(),
                if error.is_other_minimum() { "another minimum" } else { "" }.to_owned(),
            ]);
        }
    }
    context.document.paragraph(
        "The library at rest against it, XPBD's default settings. `rms` and `largest` are errors of places \
         over the displacement, `torque` and `volume` relative errors; `energy` is what the potential \
         is away from the reference's, over the elastic energy; `|grad|` is the unbalanced force over \
         the pins' force. Far away and yet in balance would be another minimum.",
    );
    context.document.table(&table);
}

fn plot(context: &mut Context, cases: &[Case], answers: &[Answer]) -> Result<()> {
    let mut plot = Plot::new(
        "Twist: torque against angle",
        Axis::linear("angle [degrees]"),
        Axis::linear("torque [mN m]"),
    );
    let coarse = || cases.iter().zip(answers).filter(|(case, _)| case.size != Size::Large);
    let point = |case: &Case, torque: f64| [f64::from(case.angle), 1e3 * torque];
    let truth = coarse().map(|(case, answer)| point(case, answer.true_torque));
    let from_rest = std::iter::once([0.0, 0.0]).chain(truth);
    plot.series(Series::new("reference", from_rest).with_style(Style::Line));
    for (at, method) in RIGHT_AT_REST.iter().enumerate() {
        let points = coarse().map(|(case, answer)| point(case, answer.library[at].0));
        plot.series(Series::new(method.name(), points).with_style(Style::Markers));
    }
    context.document.figure("twist-torque", &plot)
}

fn verdict(context: &mut Context, answers: &[Answer]) {
    for (at, method) in RIGHT_AT_REST.iter().enumerate() {
        let (mut worst, mut others) = (0.0, 0);
        for Answer { library, true_torque, .. } in answers {
            let (torque, error) = &library[at];
            if error.is_other_minimum() {
                others += 1;
                continue;
            }
            let torque_error = (torque / true_torque - 1.0).abs();
            let places = worse(error.rms, error.largest);
            worst = worse(worst, worse(places, worse(torque_error, error.volume.abs())));
        }
        let what = format!("twist to 360 degrees, largest error, {}", method.name());
        context.verdict(
            what,
            format!("< {}", percent(LIMIT)),
            match others {
                0 => floored_percent(worst, FLOOR),
                _ => format!("{}, {others} in another minimum", floored_percent(worst, FLOOR)),
            },
            worst < LIMIT && others == 0,
        );
    }
}

fn load_case(case: &Case) -> Result<LoadCase> {
    let tissue = tissue(MaterialModel::StableNeoHookean, YOUNG, POISSON)?;
    let mut load_case = LoadCase::new("twist", case.size, tissue)?;
    let angle = f64::from(case.angle) * PI / 180.0;
    load_case.path = DrivenPath::Screw { center: axis_point(), angle, advance: 0.0 };
    load_case.path_frames = case.angle.div_ceil(SPEED);
    Ok(load_case)
}

fn axis_point() -> Vec3<f64> {
    vec3(0.0, 0.5 * BAR[1], 0.5 * BAR[2])
}

/// Of the pins of the turned end about the bar's axis [N m].
fn torque(load_case: &LoadCase, positions: &[Vec3<f64>], pin_forces: &[Vec3<f64>]) -> f64 {
    let driven = load_case.driven.iter().zip(pin_forces.iter().skip(load_case.fixed.len()));
    let arm = |v: u32| positions[v as usize] - axis_point();
    driven.map(|(&v, force)| arm(v).cross(*force).x).sum()
}

fn answer(case: &Case) -> Result<Answer> {
    let load_case = load_case(case)?;
    let truth = truth_in_parts(&load_case, case.angle.div_ceil(INCREMENT))?;
    let library = RIGHT_AT_REST.iter().map(|method| -> Result<_> {
        let settled = method.settle(&load_case)?;
        let error = compare(&load_case, &truth, &settled.positions)?;
        Ok((torque(&load_case, &settled.positions, &settled.pin_forces), error))
    });
    let library = library.collect::<Result<_>>()?;
    Ok(Answer {
        tet_count: load_case.mesh.tets().len(),
        true_torque: torque(&load_case, &truth.positions, &truth.pin_forces),
        true_volume: truth.volume / load_case.mesh.volume(),
        truth,
        library,
    })
}
