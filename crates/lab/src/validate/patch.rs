//! The affine patch test: the boundary of an irregular mesh is moved by an affine map, and every
//! interior vertex must follow, because linear tetrahedra represent that state exactly.
//!
//! `x -> A x` with a stretch along x, the matching contraction across, and some shear. The error is
//! the largest distance of a vertex from `A x`, over the largest displacement.

use super::methods::{LibrarySolver, METHODS, MODELS, model_name, worse};
use super::{Context, Section};
use anyhow::{Context as _, Result};
use std::fmt;
use viscera::material::{Material, MaterialModel};
use viscera::mesh::TetMesh;
use viscera::mesh::shapes::Block;
use viscera::model::ModelBuilder;
use viscera::scalar::{Mat3, Real, Vec3, vec3};
use viscera::settings::{Count, SolverSettings};
use viscera::solver::{Inputs, Pin, Solver};
use viscera::state::State;
use viscera_report::{Axis, Plot, Series, Style, Table, percent, scientific};

pub(super) const SECTION: Section =
    Section { name: "patch", title: "Patch test", cases: |quick, _| case_count(quick), run };

/// Edge lengths of the block `[m]`.
const SIZE: [f64; 3] = [0.1, 0.05, 0.05];
const POISSON: f64 = 0.3;
/// Young's modulus `[Pa]`, as soft as liver.
const YOUNG: f64 = 1e4;
/// Share of the velocities that is kept after each frame, so that the block comes to rest.
const KEPT_VELOCITY: f64 = 0.9;
/// What the arithmetic may leave: some hundred roundings of positions, relative to a displacement
/// of about a tenth of them, and the last of a decaying motion.
const DOUBLE_LIMIT: f64 = 1e-10;
const SINGLE_LIMIT: f64 = 1e-5;

/// One block, moved and settled.
#[derive(Clone, Copy, Debug)]
struct Case {
    model: MaterialModel,
    stretch: f64,
    method: LibrarySolver,
    substeps: u32,
    iterations: u32,
    quick: bool,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self { model, stretch, method, substeps, iterations, .. } = self;
        let (model, method) = (model_name(*model), method.name());
        write!(f, "{model}, {method}, stretch {stretch}, {substeps} x {iterations}")
    }
}

/// The defaults under several stretches: in the order of the table's cells.
fn stretch_cases(quick: bool) -> Vec<Case> {
    let stretches: &[f64] = if quick { &[0.8, 1.4] } else { &[0.8, 0.9, 1.1, 1.2, 1.4] };
    let defaults = SolverSettings::xpbd();
    let (substeps, iterations) = (defaults.substeps(), defaults.iterations());
    let mut cases = Vec::new();
    for model in MODELS {
        for &stretch in stretches {
            cases.extend(METHODS.map(|method| Case {
                model,
                stretch,
                method,
                substeps,
                iterations,
                quick,
            }));
        }
    }
    cases
}

/// One large stretch at several numbers of iterations: in the order of the plot's series.
fn iteration_cases(quick: bool) -> Vec<Case> {
    let counts: &[u32] = if quick { &[1, 5, 20] } else { &[1, 2, 5, 10, 20, 50] };
    let (model, stretch) = (MaterialModel::StableNeoHookean, 1.4);
    let mut cases = Vec::new();
    for method in METHODS {
        for &iterations in counts {
            cases.push(Case { model, stretch, method, substeps: 1, iterations, quick });
        }
    }
    cases
}

fn case_count(quick: bool) -> usize {
    stretch_cases(quick).len() + iteration_cases(quick).len()
}

fn run(context: &mut Context) -> Result<()> {
    let mesh = block(context.quick)?;
    let frames = frames(context.quick);
    context.document.paragraph(format!(
        "The surface of an irregular block ({} tetrahedra) is stretched, contracted and sheared by \
         an affine map; the interior must follow it. The error is the largest distance from the map \
         after {frames} frames, over the largest displacement.",
        mesh.tets().len(),
    ));
    stretches(context)?;
    iterations(context)
}

fn stretches(context: &mut Context) -> Result<()> {
    let cases = stretch_cases(context.quick);
    let errors = context.run_cases(&cases, error_of)?;
    let heads = ["material", "stretch"].into_iter().chain(METHODS.map(LibrarySolver::name));
    let mut table = Table::new(heads);
    let (mut double, mut single) = (0.0f64, 0.0f64);
    let count = METHODS.len();
    for (cases, errors) in cases.chunks(count).zip(errors.chunks(count)) {
        let mut row = Vec::new();
        for (case, &error) in cases.iter().zip(errors) {
            if case.method == LibrarySolver::Published {
                row.push(percent(error));
                continue;
            }
            row.push(scientific(error));
            let worst = if case.method.is_single() { &mut single } else { &mut double };
            *worst = worse(*worst, error);
        }
        let case = cases[0];
        let names = [model_name(case.model).to_owned(), case.stretch.to_string()];
        table.row(names.into_iter().chain(row));
    }
    let defaults = SolverSettings::xpbd();
    let (substeps, iterations) = (defaults.substeps(), defaults.iterations());
    context.document.paragraph(format!(
        "With XPBD's default settings ({substeps} substeps of {iterations} iterations), and with as \
         many of XPBD as published:"
    ));
    context.document.table(&table);
    for (precision, worst, limit) in
        [("double", double, DOUBLE_LIMIT), ("single", single, SINGLE_LIMIT)]
    {
        context.verdict(
            format!("patch test, largest error, XPBD's defaults in {precision} precision"),
            format!("< {}", scientific(limit)),
            scientific(worst),
            worst < limit,
        );
    }
    Ok(())
}

fn iterations(context: &mut Context) -> Result<()> {
    let cases = iteration_cases(context.quick);
    let errors = context.run_cases(&cases, error_of)?;
    let mut plot = Plot::new(
        "Patch test: error against iterations, stretch 1.4",
        Axis::logarithmic("iterations per frame"),
        Axis::logarithmic("largest error / largest displacement"),
    );
    for method in METHODS {
        let points = cases.iter().zip(&errors).filter(|(case, _)| case.method == method);
        let points = points.map(|(case, error)| [f64::from(case.iterations), *error]);
        plot.series(Series::new(method.name(), points).with_style(Style::MarkedLine));
    }
    context.document.paragraph(
        "One step per frame and a growing number of iterations. XPBD as published stays away from \
         the map however many it takes; with the rebase and kept multipliers what is left is the \
         arithmetic.",
    );
    context.document.figure("patch-iterations", &plot)
}

fn block(quick: bool) -> Result<TetMesh> {
    let cells = if quick { [4, 3, 3] } else { [6, 4, 4] };
    let block = Block { jitter: 0.6, seed: 5, ..Block::new(Vec3::from_f64(SIZE), cells) };
    block.mesh().context("the block of the patch test")
}

fn frames(quick: bool) -> u32 {
    if quick { 80 } else { 120 }
}

fn error_of(case: &Case) -> Result<f64> {
    match case.method.is_single() {
        false => settled_error::<f64>(case),
        true => settled_error::<f32>(case),
    }
}

fn settled_error<S: Real>(case: &Case) -> Result<f64> {
    let settings = SolverSettings {
        substeps: Count::Of(case.substeps),
        iterations: Count::Of(case.iterations),
        ..case.method.settings()
    };
    let mesh = block(case.quick)?;
    let mut builder = ModelBuilder::new();
    builder.add_body(&mesh, &Material::new(case.model, YOUNG, POISSON, 1000.0)?)?;
    let model = builder.build::<S>()?;
    let map = affine_map(case.stretch);
    let mut inputs = Inputs::default();
    for (vertex, x) in mesh.vertices().iter().enumerate() {
        if is_on_boundary(*x) {
            inputs.pins.push(Pin { vertex: vertex as u32, target: (map * *x).cast() });
        }
    }
    let mut state = State::at_rest(&model);
    let mut solver = Solver::new(&model, &settings);
    let dt = 1.0 / 60.0 / f64::from(case.substeps);
    for _ in 0..frames(case.quick) {
        for _ in 0..case.substeps {
            solver.step(&model, &mut state, &inputs, dt)?;
        }
        for velocity in &mut state.velocities {
            *velocity = *velocity * S::from_f64(KEPT_VELOCITY);
        }
    }
    let (mut error, mut displacement) = (0.0, 0.0);
    for (rest, x) in mesh.vertices().iter().zip(&state.positions) {
        displacement = worse(displacement, (map * *rest - *rest).length());
        error = worse(error, (x.cast::<f64>() - map * *rest).length());
    }
    Ok(error / displacement)
}

fn affine_map(stretch: f64) -> Mat3<f64> {
    let lateral = 1.0 + POISSON * (1.0 - stretch);
    Mat3::from_columns(vec3(stretch, 0.05, 0.0), vec3(0.0, lateral, 0.02), vec3(0.03, 0.0, lateral))
}

fn is_on_boundary(x: Vec3<f64>) -> bool {
    (0..3).any(|axis| x[axis] < 1e-9 || x[axis] > SIZE[axis] - 1e-9)
}
