//! Part of section 4: Anderson on positions makes tissue stiff.

use anyhow::Result;
use std::fmt;
use viscera::material::MaterialModel;
use viscera::settings::{AndersonOn, Colors};
use viscera_report::{Axis, Plot, Series, Style, Table};

use super::Context;
use super::methods::{COLORED, JACOBI, anderson, published};
use super::step::{Curve, MeasuredStep};
use crate::scenes::Size;

/// Young's modulus [Pa]: soft tissue, under stress that shows.
const YOUNG: f64 = 1e4;

/// Scenes and the frames before the measured step, which lie in the middle of the motion.
const SCENES: [(&str, u32); 3] = [("cantilever", 10), ("twist", 11), ("grab", 7)];

/// What the ratio of strains is asked to lie within.
const RATIO: [f64; 2] = [0.5, 0.9];

fn budgets(quick: bool) -> &'static [u32] {
    if quick { &[5, 20, 80] } else { &[2, 5, 10, 20, 50, 100, 200, 400] }
}

/// Sweeps, the unknowns that are mixed, and names.
const MIXES: [(Colors, AndersonOn, &str); 4] = [
    (COLORED, AndersonOn::Positions, "coloured, on positions"),
    (JACOBI, AndersonOn::Positions, "Jacobi, on positions"),
    (COLORED, AndersonOn::Both, "coloured, on both"),
    (JACOBI, AndersonOn::Both, "Jacobi, on both"),
];

struct Case<'a> {
    step: &'a MeasuredStep,
    mix: usize,
    iterations: u32,
}

impl fmt::Display for Case<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, Anderson {}, {}", self.step.scene.name, MIXES[self.mix].2, self.iterations)
    }
}

pub(super) fn case_count(quick: bool) -> usize {
    SCENES.len() * (1 + MIXES.len() * budgets(quick).len())
}

pub(super) fn run(context: &mut Context) -> Result<()> {
    context.document.subheading("Anderson on positions alone");
    context.document.paragraph(
        "A block of constraints is solved for `(J M^-1 J^T + a~) dl = -C - a~ l`: the term `a~ l` tells it \
         how much stress it has already answered with, and stops it at `C = -a~ l`. Mixing positions \
         alone takes `x` far along the way and leaves `l` where it was. The multipliers lag, so the blocks \
         believe that hardly any stress has built up and pull on towards `C = 0`, which is what \
         position-based dynamics without compliance does; and nothing brings `x` back to \
         `xt + M^-1 J^T l`. The iteration comes to rest in a body that is too stiff. It is measured as the \
         root mean square of Green strain over the body, over that of the true end of the step: 1 is right, \
         less is stiffer. Green strain, E = 10 kPa, nu = 0.45, one step of 1/60 s after frames that \
         Newton's method has solved (cantilever 10, twist 11, grab 7).",
    );
    let size = if context.quick { Size::Tiny } else { Size::Large };
    let tissue = context.changes.tissue(MaterialModel::SaintVenantKirchhoff, YOUNG, 0.45)?;
    let names = SCENES.map(|(name, _)| name);
    let steps = context.run_cases(&names, |name| {
        let frames = SCENES.iter().find(|scene| scene.0 == *name).map_or(0, |scene| scene.1);
        MeasuredStep::new(context.changes.scene(name, size, tissue.clone())?, frames)
    })?;
    let mut cases = Vec::new();
    for step in &steps {
        for mix in 0..MIXES.len() {
            let budgets = budgets(context.quick).iter();
            cases.extend(budgets.map(|&iterations| Case { step, mix, iterations }));
        }
    }
    let curves = context.run_cases(&cases, |case| {
        let (colors, on, _) = MIXES[case.mix];
        let mut settings = anderson(published(colors), on);
        settings.iterations = case.iterations;
        case.step.follow::<f64>(&settings)
    })?;
    figure(context, &cases, &curves)?;
    tabulate(context, &cases, &curves);
    Ok(())
}

fn figure(context: &mut Context, cases: &[Case], curves: &[Curve]) -> Result<()> {
    let mut plot = Plot::new(
        "Anderson on positions or on both, coloured",
        Axis::logarithmic("iterations"),
        Axis::linear("strain / true strain"),
    );
    plot.reference(1.0, "true strain");
    let mut data =
        Table::new(["scene", "anderson", "iterations", "strain ratio", "error at the end"]);
    let count = budgets(context.quick).len();
    for (cases, curves) in cases.chunks(count).zip(curves.chunks(count)) {
        let (scene, (colors, on, name)) = (cases[0].step.scene.name, MIXES[cases[0].mix]);
        let ratios: Vec<[f64; 2]> = cases
            .iter()
            .zip(curves)
            .map(|(case, curve)| [f64::from(case.iterations), curve.strain_ratio])
            .collect();
        for (curve, ratio) in curves.iter().zip(&ratios) {
            let [iterations, ratio] = ratio.map(|value| format!("{value:.6}"));
            let iterations = iterations.trim_end_matches(".000000");
            data.row([scene, name, iterations, &ratio, &format!("{:.6e}", end(curve))]);
        }
        if colors == COLORED {
            let positions = on == AndersonOn::Positions;
            let style = if positions { Style::MarkedLine } else { Style::Dashed };
            let what = if positions { "positions" } else { "both" };
            plot.series(Series::new(format!("{scene}, {what}"), ratios).with_style(style));
        }
    }
    context.plot(
        "acceleration-strain",
        &plot,
        "On positions alone the strain stays below the true one however long it iterates; on both it \
         comes near it.",
    )?;
    context.document.data("acceleration-strain", "Jacobi's and errors as well", &data)
}

fn tabulate(context: &mut Context, cases: &[Case], curves: &[Curve]) {
    let mut table = Table::new(["scene", "Anderson", "strain / true strain", "error at the end"]);
    let count = budgets(context.quick).len();
    let mut stiff = Vec::new();
    for (cases, curves) in cases.chunks(count).zip(curves.chunks(count)) {
        let (Some(case), Some(curve)) = (cases.last(), curves.last()) else { continue };
        let (colors, on, name) = MIXES[case.mix];
        let ratio = curve.strain_ratio;
        let scene = case.step.scene.name;
        table.row([scene, name, &format!("{ratio:.2}"), &format!("{:.2}", end(curve))]);
        if on == AndersonOn::Positions && colors == COLORED {
            stiff.push((scene, ratio));
        }
    }
    context.document.paragraph(format!(
        "After {} iterations (error 1 is where everybody starts):",
        budgets(context.quick).last().copied().unwrap_or(0)
    ));
    context.document.table(&table);
    let within = stiff.iter().all(|(_, ratio)| (RATIO[0]..=RATIO[1]).contains(ratio));
    let measured: Vec<String> =
        stiff.iter().map(|(scene, ratio)| format!("{scene} {ratio:.2}")).collect();
    context.verdict(
        "strain of Anderson on positions over the true strain",
        format!("{} to {}: the artefact is there", RATIO[0], RATIO[1]),
        measured.join(", "),
        within,
    );
}

/// The last error of a curve.
fn end(curve: &Curve) -> f64 {
    curve.errors.last().copied().unwrap_or(f64::NAN)
}
