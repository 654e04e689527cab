//! Modes of bodies that nothing holds: six without energy, and not many more slow ones than the body itself has. Too few
//! is too stiff; far too many is a mesh that trembles.

use std::fmt;

use anyhow::{Result, ensure};
use viscera::layout::Smoothing;
use viscera::material::MaterialModel;
use viscera::model::ModelBuilder;
use viscera_report::Table;

use super::{Context, list};
use crate::bending::YOUNG;
use crate::bending::bodies::{Body, Filling, Shape};
use crate::load_cases::tissue;
use viscera_reference::Reference;

/// Of rigid motion.
const RIGID: usize = 6;

/// The elastic mode of the body itself below which those of a mesh are counted.
const COUNTED: usize = 40;

/// The most that may lie below it. Linear tetrahedra have about [`COUNTED`], averaged ones 70 to 77.
const MOST: usize = 70;

const POISSONS: [f64; 2] = [0.3, 0.49];

const MESHES: [Filling; 3] = [Filling::Five, Filling::Six, Filling::Shuffled(1)];

/// A mesh, or the body itself.
struct Case {
    mesh: Option<Filling>,
    across: usize,
    poisson: f64,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { mesh, across, poisson } = self;
        match mesh {
            Some(filling) => write!(f, "modes of {filling}, {across} across, nu {poisson}"),
            None => write!(f, "modes of the body, nu {poisson}"),
        }
    }
}

/// Bars so many cells across.
fn across(quick: bool) -> usize {
    if quick { 2 } else { 4 }
}

fn meshes(quick: bool) -> &'static [Filling] {
    if quick { &MESHES[..1] } else { &MESHES }
}

fn cases(quick: bool) -> Vec<Case> {
    let across = across(quick);
    let truths = POISSONS.iter().map(|&poisson| Case { mesh: None, across, poisson });
    let of_mesh = |&filling: &Filling| {
        POISSONS.iter().map(move |&poisson| Case { mesh: Some(filling), across, poisson })
    };
    truths.chain(meshes(quick).iter().flat_map(of_mesh)).collect()
}

pub(super) fn case_count(quick: bool) -> usize {
    cases(quick).len()
}

/// Squared frequencies [1/s^2], ascending: of the body the lowest; of a mesh all, recovered and linear.
fn answer(case: &Case) -> Result<[Vec<f64>; 2]> {
    let tissue = tissue(MaterialModel::StableNeoHookean, YOUNG, case.poisson)?;
    let mesh = Body::new(Shape::Bar, case.mesh.unwrap_or(Filling::Five), case.across)?.mesh;
    if case.mesh.is_none() {
        let truth = Reference::quadratic(&mesh, &tissue).lowest_frequencies(RIGID + COUNTED)?;
        ensure!(truth[RIGID - 1] < 1e-6 * truth[RIGID], "no six rigid modes: {:?}", &truth[..8]);
        return Ok([truth, Vec::new()]);
    }
    let mut builder = ModelBuilder::new();
    builder.add_body(&mesh, &tissue)?;
    let model = builder.build::<f64>()?;
    let recovered = Reference::recovered(&model, Smoothing::RECOVERED).spectrum()?;
    Ok([recovered, Reference::new(&model).spectrum()?])
}

/// Modes that are zero to the round-off of a matrix of this size.
fn count_zeros(squares: &[f64]) -> usize {
    let largest = squares.last().copied().unwrap_or(0.0);
    let noise = f64::EPSILON * squares.len() as f64 * largest;
    squares.iter().filter(|square| square.abs() < noise).count()
}

pub(super) fn add(context: &mut Context) -> Result<()> {
    let cases = cases(context.quick);
    let answers = context.run_cases(&cases, answer)?;
    context.document.paragraph(format!(
        "Modes of a bar that nothing holds, {} cells across: those without energy, which are six; elastic ones below \
         the {COUNTED}th of the body itself, that of ten-node tetrahedra of the same mesh; and the seventh and the \
         largest squared frequency over that of linear tetrahedra.",
        across(context.quick)
    ));
    let heads = ["mesh", "nu", "without energy", "below the body's 40th", "linear"];
    let mut table = Table::new(heads.into_iter().chain(["seventh", "largest"]));
    for &filling in meshes(context.quick) {
        let (mut zeros, mut below) = (Vec::new(), Vec::new());
        for (case, [recovered, linear]) in cases.iter().zip(&answers) {
            if case.mesh != Some(filling) {
                continue;
            }
            let of_body = |(of, _): &(&Case, _)| of.mesh.is_none() && of.poisson == case.poisson;
            let body = cases.iter().zip(&answers).find(of_body).map(|(_, [body, _])| body);
            let limit = body.and_then(|body| body.last().copied()).unwrap_or(f64::NAN);
            let count =
                |all: &[f64]| all.iter().skip(RIGID).filter(|square| **square < limit).count();
            zeros.push(count_zeros(recovered));
            below.push(count(recovered));
            let over = |k: usize| format!("{:.2}", recovered[k] / linear[k]);
            table.row([
                filling.to_string(),
                case.poisson.to_string(),
                count_zeros(recovered).to_string(),
                count(recovered).to_string(),
                count(linear).to_string(),
                over(RIGID),
                over(recovered.len() - 1),
            ]);
        }
        let name = format!("free bar, {filling}, nu {}", list(POISSONS.iter().map(f64::to_string)));
        context.verdict(
            format!("{name}: modes without energy"),
            format!("{RIGID}"),
            list(zeros.iter().map(usize::to_string)),
            zeros.iter().all(|&zeros| zeros == RIGID),
        );
        if context.quick {
            // Two cells across have hardly as many modes that mean anything.
            continue;
        }
        context.verdict(
            format!("{name}: modes below the body's {COUNTED}th"),
            format!("at most {MOST}"),
            list(below.iter().map(usize::to_string)),
            below.iter().all(|&below| below <= MOST),
        );
    }
    context.document.table(&table);
    Ok(())
}
