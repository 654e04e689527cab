//! What a run says of its mesh's own error, beside the error that finer meshes show.

mod bars;

use std::fmt;

use anyhow::{Result, anyhow};
use viscera::scene::Scene;

use super::{Context, Section};
use crate::converge::{Found, compute};
use viscera_report::{Axis, Plot, Series, Style, Table, percent};

pub(super) const SECTION: Section = Section {
    name: "mesh",
    title: "The mesh's own error",
    cases: |quick, _| cases(quick).len(),
    run,
};

/// The estimate may be so many times too large, and too small.
const FACTOR: f64 = 2.0;

/// Errors below this share of the displacement are as small as what is left of the truth's own.
const UNSEEN: f64 = 5e-3;

/// What is done to a body.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Load {
    /// A bar of 80 x 20 x 20 mm sags at a wall.
    Sag,
    /// The same, its end turned by a right angle.
    Twist,
    /// The same, pulled by a spring at a corner of its end.
    Pull,
    /// A block of 40 x 40 x 20 mm on a table, the middle of its top pressed in by 4 mm.
    Press,
    /// The procedural liver hangs from its top.
    Hang,
    /// A ball of 30 mm rests on its lowest quarter, its top led aside by 8 mm.
    Shear,
}

/// A load, Young's modulus [kPa], Poisson's ratio, cells across or millimetres between them.
#[derive(Clone, Copy, Debug)]
struct Case(Load, f64, f64, u32);

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(load, young, poisson, cells) = *self;
        let (what, unit) = match load {
            Load::Sag => ("sagging bar", "cells"),
            Load::Twist => ("twisted bar", "cells"),
            Load::Pull => ("pulled bar", "cells"),
            Load::Press => ("pressed block", "cells"),
            Load::Hang => ("hanging liver", "mm"),
            Load::Shear => ("sheared ball", "mm"),
        };
        write!(f, "{what}, {young} kPa, nu {poisson}, {cells} {unit}")
    }
}

const CASES: [Case; 12] = [
    Case(Load::Sag, 50.0, 0.3, 2),
    Case(Load::Sag, 50.0, 0.45, 2),
    Case(Load::Sag, 50.0, 0.49, 2),
    Case(Load::Sag, 20.0, 0.45, 3),
    Case(Load::Twist, 50.0, 0.3, 2),
    Case(Load::Twist, 50.0, 0.49, 2),
    Case(Load::Pull, 50.0, 0.45, 2),
    Case(Load::Press, 10.0, 0.3, 4),
    Case(Load::Press, 10.0, 0.45, 4),
    Case(Load::Hang, 5.0, 0.45, 30),
    Case(Load::Hang, 10.0, 0.3, 24),
    Case(Load::Shear, 5.0, 0.45, 12),
];

fn cases(quick: bool) -> Vec<Case> {
    CASES.into_iter().step_by(if quick { 6 } else { 1 }).collect()
}

impl Case {
    fn scene(self) -> Result<Scene> {
        let Self(load, young, poisson, cells) = self;
        let material = format!(
            "material = {{ young = \"{young} kPa\", poisson = {poisson}, density = \"1000 kg/m^3\" }}"
        );
        let wall = "half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }";
        let bar = format!(
            "shape = \"beam\"\nlength = \"80 mm\"\nwidth = \"20 mm\"\nheight = \"20 mm\"\ncells_across = {cells}"
        );
        let end = "half_space = { point = [\"80 mm\", 0, 0], normal = [1, 0, 0] }";
        let (body, fixing, motion) = match load {
            Load::Sag => (bar, wall.to_owned(), None),
            Load::Twist => {
                let keys =
                    "{ time = \"1 s\", rotation_axis = [1, 0, 0], rotation_angle = \"90 deg\" }";
                (bar, wall.to_owned(), Some(format!("{end}\nkeys = [{keys}]")))
            }
            Load::Pull => {
                let corner = "sphere = { center = [\"80 mm\", \"10 mm\", \"10 mm\"], radius = \"15 mm\" }\n\
                              stiffness = \"60 N/m\"";
                let keys = "{ time = \"1 s\", translation = [0, \"20 mm\", \"20 mm\"] }";
                (bar, wall.to_owned(), Some(format!("{corner}\nkeys = [{keys}]")))
            }
            Load::Press => {
                let body = format!(
                    "shape = \"block\"\nsize = [\"40 mm\", \"40 mm\", \"20 mm\"]\ncells = [{cells}, {cells}, {}]",
                    cells / 2
                );
                let table = "half_space = { point = [0, 0, 0], normal = [0, 0, -1] }";
                let top = "box = { min = [\"9 mm\", \"9 mm\", \"19 mm\"], max = [\"31 mm\", \"31 mm\", \"21 mm\"] }";
                let keys = "{ time = \"1 s\", translation = [0, 0, \"-4 mm\"] }";
                (body, table.to_owned(), Some(format!("{top}\nkeys = [{keys}]")))
            }
            Load::Hang => {
                let body = format!("shape = \"liver\"\nspacing = \"{cells} mm\"");
                let top = "half_space = { point = [0, 0, \"52 mm\"], normal = [0.2, 0.4, 1] }";
                (body, top.to_owned(), None)
            }
            Load::Shear => {
                let body =
                    format!("shape = \"sphere\"\nradius = \"30 mm\"\nspacing = \"{cells} mm\"");
                let low = "half_space = { point = [0, 0, \"-15 mm\"], normal = [0, 0, -1] }";
                let high = "half_space = { point = [0, 0, \"15 mm\"], normal = [0, 0, 1] }";
                let keys = "{ time = \"1 s\", translation = [\"8 mm\", 0, 0] }";
                (body, low.to_owned(), Some(format!("{high}\nkeys = [{keys}]")))
            }
        };
        let motion = motion.map_or(String::new(), |motion| {
            format!("[[motion]]\nname = \"hand\"\nbody = \"body\"\n{motion}\n")
        });
        let text = format!(
            "[[body]]\nname = \"body\"\n{body}\n{material}\n[[fixing]]\nbody = \"body\"\n{fixing}\n{motion}"
        );
        Ok(Scene::parse("a body", &text, &[])?)
    }
}

/// Of linear and of recovered-gradient tetrahedra: the error and the estimate of it, shares of the displacement.
struct Answer {
    tets: usize,
    errors: [f64; 2],
    estimates: [f64; 2],
    complete: bool,
}

fn answer(case: &Case) -> Result<Answer> {
    let scene = case.scene()?;
    let found: Found = compute(&scene, &mut |file| Err(file.to_owned()), 3, None)?;
    let coarsest = [0, 1].map(|kind| &found.curves[kind].meshes[0]);
    let mut complete = true;
    let mut estimates = [0.0; 2];
    for (estimate, mesh) in estimates.iter_mut().zip(coarsest) {
        let own = mesh.estimate.as_ref().ok_or_else(|| anyhow!("{case}: no estimate"))?;
        *estimate = own.displacement;
        complete &= own.complete;
    }
    Ok(Answer {
        tets: coarsest[0].tets,
        errors: coarsest.map(|mesh| found.error(mesh)),
        estimates,
        complete,
    })
}

/// Whether an estimate says how large an error is.
fn is_near(error: f64, estimate: f64) -> bool {
    let least = error.max(UNSEEN);
    let most = estimate.max(UNSEEN);
    most <= FACTOR * least && least <= FACTOR * most
}

fn run(context: &mut Context) -> Result<()> {
    let cases = cases(context.quick);
    let answers = context.run_cases(&cases, answer)?;
    context.document.paragraph(format!(
        "At its end a run says how far its mesh is from the body that it stands for: it brings a mesh with halved edges to rest \
         under the same loads and goes on in that direction, by 3/2 of the way with recovered-gradient tetrahedra, by 2 with linear \
         ones. Here that estimate stands beside the error itself: root mean square distance over root mean square \
         displacement, from what three meshes lead to, each with eight times the tetrahedra of the one before \
         (`viscera-lab converge`). Errors below {} count as that much.",
        percent(UNSEEN)
    ));
    let mut table = Table::new([
        "scene",
        "tetrahedra",
        "linear: error",
        "estimate",
        "recovered-gradient: error",
        "estimate",
    ]);
    for (case, answer) in cases.iter().zip(&answers) {
        let Answer { tets, errors, estimates, complete } = answer;
        let least = if *complete { "" } else { "at least " };
        let mut row = vec![case.to_string(), tets.to_string()];
        for (error, estimate) in errors.iter().zip(estimates) {
            row.extend([percent(*error), format!("{least}{}", percent(*estimate))]);
        }
        table.row(row);
    }
    context.document.table(&table);
    let mut plot = Plot::new(
        "Estimated error of a mesh beside the true one",
        Axis::logarithmic("error of places, percent of the displacement"),
        Axis::logarithmic("estimate, percent of the displacement"),
    );
    for (kind, name) in ["linear", "recovered-gradient"].into_iter().enumerate() {
        let points = answers.iter().map(|it| [100.0 * it.errors[kind], 100.0 * it.estimates[kind]]);
        plot.series(Series::new(name, points).with_style(Style::Markers));
    }
    for (name, factor) in [("equal", 1.0), ("twice", FACTOR), ("half", 1.0 / FACTOR)] {
        let line = [0.3, 60.0].map(|error| [error, factor * error]);
        plot.series(Series::new(name, line).with_style(Style::Dashed));
    }
    context.plot(
        "mesh-error",
        &plot,
        "Marks between the outer lines are estimates within a factor of two of the error.",
    )?;
    context.picture(
        "coarse-bars",
        "Three bars at rest under their weight, of linear tetrahedra, of recovered-gradient ones, and fine",
        &bars::draw(&CASES[1].scene()?)?,
        "A bar two cells thick at a Poisson ratio of 0.45. The line is the fine bar: linear tetrahedra hold the coarse one up.",
    )?;
    for (kind, name) in ["linear", "recovered-gradient"].into_iter().enumerate() {
        let near = answers.iter().filter(|it| is_near(it.errors[kind], it.estimates[kind])).count();
        context.verdict(
            format!(
                "{name} tetrahedra: scenes whose mesh error is estimated within a factor of {FACTOR}"
            ),
            answers.len().to_string(),
            near.to_string(),
            near == answers.len(),
        );
    }
    Ok(())
}
