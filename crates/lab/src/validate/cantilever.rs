//! A cantilever under its weight: what the mesh does to the answer, and that the library's answer is
//! the mesh's.
//!
//! ```text
//! Timoshenko   w = q L^4/(8 E I) + q L^2/(2 k G A),   q = rho g A,  I = A^2/12,  k = 10 (1 + nu)/(12 + 11 nu)
//! ```
//!
//! The first term alone is Euler's and Bernoulli's; `k`: Cowper, "The shear coefficient in
//! Timoshenko's beam theory", 1966, for a square cross-section.

use std::fmt;

use anyhow::{Context as _, Result};
use viscera::material::{Material, MaterialModel};
use viscera::mesh::TetMesh;
use viscera::mesh::shapes::Block;
use viscera::scalar::Vec3;
use viscera::solver::{Inputs, Pin};

use super::methods::{LibrarySolver, worse};
use super::{Context, Section};
use crate::load_cases::{BAR, DENSITY, GRAVITY, LoadCase, NEAR, tissue};
use crate::settling::{Error, compare, truth};
use viscera_reference::Reference;
use viscera_report::{Axis, Plot, Series, Style, Table, percent, si};

pub(super) const SECTION: Section =
    Section { name: "cantilever", title: "Cantilever", cases: |quick, _| case_count(quick), run };

/// Young's modulus [Pa].
const YOUNG: f64 = 1e5;
/// Asked of the library.
const LIMIT: f64 = 1e-3;
/// Shares of gravity: beam theory holds for the first; the second bends by a third of the length.
const LOADS: [f64; 2] = [0.01, 1.0];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Elements {
    /// Linear tetrahedra, solved by the reference.
    Linear,
    /// Linear tetrahedra, solved by reference and library.
    Both,
    /// Quadratic tetrahedra.
    Quadratic,
}

#[derive(Clone, Copy, Debug)]
struct Case {
    poisson: f64,
    load: f64,
    /// Across; four times as many along.
    cells: usize,
    elements: Elements,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { poisson, load, cells, elements } = self;
        let elements = match elements {
            Elements::Linear => "linear tetrahedra",
            Elements::Both => "linear tetrahedra and the library",
            Elements::Quadratic => "quadratic tetrahedra",
        };
        write!(f, "nu {poisson}, {load} g, {cells} cells across, {elements}")
    }
}

fn poissons(quick: bool) -> &'static [f64] {
    if quick { &[0.3, 0.49] } else { &[0.3, 0.45, 0.49] }
}

fn linear_cells(quick: bool) -> &'static [usize] {
    if quick { &[2, 3, 4] } else { &[2, 3, 4, 6, 8] }
}

fn quadratic_cells(quick: bool) -> &'static [usize] {
    if quick { &[2, 3] } else { &[2, 3, 4, 6] }
}

/// The library takes most of the time: on the finest meshes it is asked for one Poisson ratio.
fn library_solves(poisson: f64, cells: usize, quick: bool) -> bool {
    if quick { cells == 2 } else { cells <= 4 || poisson == 0.45 }
}

/// The longest first, so that no core waits for them in the end.
fn cases(quick: bool) -> Vec<Case> {
    let mut cases = Vec::new();
    for &cells in linear_cells(quick).iter().rev() {
        for &poisson in poissons(quick) {
            for load in LOADS {
                let library = library_solves(poisson, cells, quick);
                let elements = if library { Elements::Both } else { Elements::Linear };
                cases.push(Case { poisson, load, cells, elements });
                if quadratic_cells(quick).contains(&cells) {
                    cases.push(Case { poisson, load, cells, elements: Elements::Quadratic });
                }
            }
        }
    }
    cases
}

fn case_count(quick: bool) -> usize {
    cases(quick).len()
}

struct Answer {
    /// How far the end's corners sink [m], mean.
    tip: f64,
    /// The same for the library, and how far it is from the reference.
    library: Option<(f64, Error)>,
    /// How far the quasi-Newton method is from the reference.
    quasi_newton: Option<Error>,
    tet_count: usize,
}

struct Answers<'a> {
    cases: &'a [Case],
    answers: &'a [Answer],
}

impl Answers<'_> {
    fn find(&self, poisson: f64, load: f64, cells: usize, quadratic: bool) -> Option<&Answer> {
        let place = self.cases.iter().position(|case| {
            case.poisson == poisson
                && case.load == load
                && case.cells == cells
                && (case.elements == Elements::Quadratic) == quadratic
        });
        self.answers.get(place?)
    }

    /// The tip on the finest quadratic mesh [m].
    fn fine(&self, poisson: f64, load: f64, quick: bool) -> f64 {
        let finest = quadratic_cells(quick).last().copied().unwrap_or_default();
        self.find(poisson, load, finest, true).map_or(f64::NAN, |answer| answer.tip)
    }
}

fn run(context: &mut Context) -> Result<()> {
    let cases = cases(context.quick);
    let answers = context.run_cases(&cases, answer)?;
    let answers = Answers { cases: &cases, answers: &answers };
    let [length, width, height] = BAR.map(|edge| si(edge, "m"));
    context.document.paragraph(format!(
        "A bar of {length} x {width} x {height}, stable neo-Hookean, E {}, is fixed at one end and \
         sinks under its weight. `tip` is how far the corners of its end sink. Four answers: the \
         library at rest with XPBD's default settings, the reference on the same linear tetrahedra, \
         quadratic tetrahedra as the fine solution, and for the small load beam theory,",
        si(YOUNG, "Pa"),
    ));
    context.document.paragraph(
        "```text\nw = q L^4/(8 E I) + q L^2/(2 k G A),   q = rho g A,  I = A^2/12,  \
         k = 10 (1 + nu)/(12 + 11 nu)\n```",
    );
    context.document.paragraph(
        "(Timoshenko; the first term alone is Euler's and Bernoulli's). Beam theory lets the fixed \
         end contract sideways, which the pins do not.",
    );
    fine_table(context, &answers);
    linear_table(context, &answers);
    locking_plot(context, &answers)?;
    verdict(context, &answers);
    Ok(())
}

fn fine_table(context: &mut Context, answers: &Answers) {
    let mut heads = vec!["load".to_owned(), "nu".to_owned()];
    for cells in quadratic_cells(context.quick) {
        heads.push(format!("quadratic, {cells} cells"));
    }
    heads.extend(["Timoshenko", "Euler-Bernoulli", "fine / Timoshenko"].map(str::to_owned));
    let mut table = Table::new(heads);
    for load in LOADS {
        for &poisson in poissons(context.quick) {
            let mut row = vec![load_text(load), poisson.to_string()];
            for &cells in quadratic_cells(context.quick) {
                let answer = answers.find(poisson, load, cells, true);
                row.push(answer.map_or(String::new(), |answer| millimetres(answer.tip)));
            }
            if load == LOADS[0] {
                let (bending, shear) = beam_theory(poisson, load);
                row.extend([bending + shear, bending].map(millimetres));
                let fine = answers.fine(poisson, load, context.quick);
                row.push(format!("{:.3}", fine / (bending + shear)));
            }
            table.row(row);
        }
    }
    context.document.subheading("Fine solution and beam theory");
    context.document.paragraph("The tip [mm] by quadratic tetrahedra and by beam theory:");
    context.document.table(&table);
}

fn linear_table(context: &mut Context, answers: &Answers) {
    let heads = ["load", "nu", "cells", "tets", "tip, reference", "tip, library", "rms error"];
    let heads = heads.into_iter().chain(["largest error", "volume error"]);
    let heads = heads.chain(["quasi-Newton: rms", "largest", "volume", "too stiff by"]);
    let mut table = Table::new(heads);
    for load in LOADS {
        for &poisson in poissons(context.quick) {
            for &cells in linear_cells(context.quick) {
                let Some(answer) = answers.find(poisson, load, cells, false) else { continue };
                let mut row = vec![load_text(load), poisson.to_string(), cells.to_string()];
                row.extend([answer.tet_count.to_string(), millimetres(answer.tip)]);
                let errors = |error: Option<&Error>| match error {
                    Some(error) => [error.rms, error.largest, error.volume.abs()].map(percent),
                    None => [const { String::new() }; 3],
                };
                let library = answer.library.as_ref();
                row.push(library.map_or(String::new(), |(tip, _)| millimetres(*tip)));
                row.extend(errors(library.map(|(_, error)| error)));
                row.extend(errors(answer.quasi_newton.as_ref()));
                let fine = answers.fine(poisson, load, context.quick);
                row.push(percent(fine / answer.tip - 1.0));
                table.row(row);
            }
        }
    }
    context.document.subheading("Linear tetrahedra");
    context.document.paragraph(
        "The tip [mm] on linear tetrahedra. The errors are the library's against the reference on \
         the same mesh, over the displacement; an empty field was not computed. `too stiff by` is \
         what the fine solution sinks more than the reference: the error of the mesh, which no \
         solver can mend.",
    );
    context.document.table(&table);
}

fn locking_plot(context: &mut Context, answers: &Answers) -> Result<()> {
    let mut plot = Plot::new(
        "Cantilever, small load: error of the tip against refinement",
        Axis::logarithmic("cells across"),
        Axis::logarithmic("missing deflection / fine solution"),
    );
    let load = LOADS[0];
    let missing = |poisson: f64, cells: &[usize], quadratic: bool| -> Vec<[f64; 2]> {
        let fine = answers.fine(poisson, load, context.quick);
        let of = |&cells: &usize| {
            let tip = answers.find(poisson, load, cells, quadratic)?.tip;
            Some([cells as f64, 1.0 - tip / fine])
        };
        cells.iter().filter_map(of).collect()
    };
    for &poisson in poissons(context.quick) {
        let points = missing(poisson, linear_cells(context.quick), false);
        plot.series(Series::new(format!("linear, nu {poisson}"), points));
    }
    // The finest quadratic mesh is what the others are measured by.
    let coarser = quadratic_cells(context.quick).split_last().map_or(&[][..], |(_, rest)| rest);
    for &poisson in poissons(context.quick) {
        let points = missing(poisson, coarser, true);
        let series = Series::new(format!("quadratic, nu {poisson}"), points);
        plot.series(series.with_style(Style::Markers));
    }
    let orders = poissons(context.quick).iter().map(|&poisson| {
        let points = missing(poisson, linear_cells(context.quick), false);
        let order = match points[..] {
            [.., [x, y], [finer_x, finer_y]] => libm::log(y / finer_y) / libm::log(finer_x / x),
            _ => f64::NAN,
        };
        format!("{order:.1} at nu {poisson}")
    });
    context.document.paragraph(format!(
        "Linear tetrahedra lock: each can only shear and stretch as a whole, so that a bent mesh \
         stores energy that the bar does not have, more of it where the volume must be kept. \
         Between the two finest meshes the error falls with this power of the cell's size: {}. \
         Quadratic tetrahedra bend; what they still gain from mesh to mesh (see the table above) is \
         how far the fine solution can be trusted: at the edge of the fixed end stress has no bound, \
         and near nu = 0.5 that is slow to resolve.",
        orders.collect::<Vec<_>>().join(", "),
    ));
    context.document.figure("cantilever-locking", &plot)
}

fn verdict(context: &mut Context, answers: &Answers) {
    let mut worst = [0.0; 2];
    for answer in answers.answers {
        let library = answer.library.as_ref().map(|(_, error)| error);
        for (worst, error) in worst.iter_mut().zip([library, answer.quasi_newton.as_ref()]) {
            *worst = error.map_or(*worst, |error| worse(*worst, worse(error.rms, error.largest)));
        }
    }
    for (method, worst) in ["", ", quasi-Newton"].into_iter().zip(worst) {
        let what = "cantilever, largest error at rest against the reference on the same mesh";
        let asked = format!("< {}", percent(LIMIT));
        context.verdict(format!("{what}{method}"), asked, percent(worst), worst < LIMIT);
    }
}

fn load_text(load: f64) -> String {
    if load == 1.0 { "g".to_owned() } else { format!("{load} g") }
}

fn millimetres(length: f64) -> String {
    format!("{:.4}", 1e3 * length)
}

/// How far the tip sinks [m] by bending and by shear.
fn beam_theory(poisson: f64, load: f64) -> (f64, f64) {
    let [length, width, height] = BAR;
    let area = width * height;
    let second_moment = area * height * height / 12.0;
    let shear_modulus = YOUNG / (2.0 * (1.0 + poisson));
    let shear_coefficient = 10.0 * (1.0 + poisson) / (12.0 + 11.0 * poisson);
    let line_load = -DENSITY * GRAVITY.z * load * area;
    let bending = line_load * length.powi(4) / (8.0 * YOUNG * second_moment);
    let shear = line_load * length.powi(2) / (2.0 * shear_coefficient * shear_modulus * area);
    (bending, shear)
}

fn bar(cells: usize) -> Result<TetMesh> {
    let block = Block::new(Vec3::from_f64(BAR), [4 * cells, cells, cells]);
    block.mesh().context("the bar of the cantilever")
}

/// Mean of the sinking of the end's corners [m], which every mesh has.
fn tip(mesh: &TetMesh, positions: &[Vec3<f64>]) -> f64 {
    let is_end = |x: f64, edge: f64| x < NEAR || x > edge - NEAR;
    let (mut sum, mut count) = (0.0, 0.0);
    for (rest, x) in mesh.vertices().iter().zip(positions) {
        if rest.x > BAR[0] - NEAR && is_end(rest.y, BAR[1]) && is_end(rest.z, BAR[2]) {
            sum += rest.z - x.z;
            count += 1.0;
        }
    }
    sum / count
}

fn answer(case: &Case) -> Result<Answer> {
    let tissue = tissue(MaterialModel::StableNeoHookean, YOUNG, case.poisson)?;
    let mesh = bar(case.cells)?;
    let gravity = GRAVITY * case.load;
    if case.elements == Elements::Quadratic {
        let positions = quadratic(&mesh, &tissue, gravity)?;
        let tet_count = mesh.tets().len();
        let tip = tip(&mesh, &positions);
        return Ok(Answer { tip, library: None, quasi_newton: None, tet_count });
    }
    let mut load_case = LoadCase::bare("cantilever", mesh, tissue);
    load_case.gravity = gravity;
    load_case.fixed = load_case.select(|x| x.x < NEAR);
    let truth = truth(&load_case)?;
    let (mut library, mut quasi_newton) = (None, None);
    if case.elements == Elements::Both {
        let settled = LibrarySolver::Double.settle(&load_case)?;
        let error = compare(&load_case, &truth, &settled.positions)?;
        library = Some((tip(&load_case.mesh, &settled.positions), error));
        let settled = LibrarySolver::QuasiNewton.settle(&load_case)?;
        quasi_newton = Some(compare(&load_case, &truth, &settled.positions)?);
    }
    let tip = tip(&load_case.mesh, &truth.positions);
    Ok(Answer { tip, library, quasi_newton, tet_count: load_case.mesh.tets().len() })
}

fn quadratic(mesh: &TetMesh, tissue: &Material, gravity: Vec3<f64>) -> Result<Vec<Vec3<f64>>> {
    let mut reference = Reference::quadratic(mesh, tissue);
    let rest = reference.problem().rest_positions.clone();
    let fixed = rest.iter().enumerate().filter(|(_, x)| x.x < NEAR);
    let pins = fixed.map(|(v, x)| Pin { vertex: v as u32, target: *x }).collect();
    let inputs = Inputs { gravity, pins, ..Inputs::default() };
    Ok(reference.settle(&rest, &inputs)?.positions)
}
