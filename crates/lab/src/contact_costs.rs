//! What contact costs on this machine, by one thread: distances of an instrument's grid, and pairs of tissue and tissue.
//!
//! | number | what is done once for each |
//! |---|---|
//! | distances per ms | value and gradient at a point within three thicknesses of the surface, points in the order of space |
//! | pairs per ms | all that a step does with a pair: it is found, anew, while both bodies move; force and curvature are added to vertices; what the next step needs is kept |
//!
//! Pairs are counted that touch or nearly do; the time is that of the whole surfaces, what meets nothing included.

use std::hint::black_box;
use std::time::Instant;

use anyhow::{Result, ensure};
use viscera::contact::{DistanceGrid, TissueContact};
use viscera::material::MaterialModel;
use viscera::mesh::shapes::{Block, capsule, turned};
use viscera::mesh::topology::boundary_faces;
use viscera::mesh::{SurfaceMesh, TetMesh};
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::{Vec3, vec3};
use viscera::settings::{Method, SolverSettings};
use viscera::solver::Meetings;
use viscera::state::State;
use viscera_report::Table;
use viscera_resources::processor;

use crate::load_cases::{Random, tissue};

/// Asked: distances with gradient, and pairs found and evaluated, per ms and thread.
const DISTANCES_ASKED: f64 = 30_000.0;
const PAIRS_ASKED: f64 = 3_000.0;

/// Of contact [m].
const THICKNESS: f64 = 1e-3;

/// Points at which distances are asked, and how far from the surface at most [m].
const POINTS: usize = 20_000;
const NEAR: f64 = 3.0 * THICKNESS;

/// How often each is measured; the first are not counted.
const REPEATS: usize = 41;
const SKIPPED: usize = 5;

/// A step of pairs [s], and the way of the upper body in it [m]: 6 mm/s.
const STEP: f64 = 1.0 / 240.0;
const WAY: f64 = 25e-6;

/// Measures, and returns what is to be printed.
pub fn measure() -> Result<String> {
    let mut table = Table::new(["what", "size", "per ms and thread, median", "best", "asked"]);
    for (name, surface) in [("rod of 5 mm", rod(2.5e-3, 0.04)), ("ball of 60 mm", rod(0.03, 0.0))] {
        let (grid, rates) = distances(&surface)?;
        let size = format!("{:.1} MiB, cells {:.2} mm", mib(grid.bytes()), 1e3 * grid.cell());
        table.row(row(&format!("distances, {name}"), size, rates, DISTANCES_ASKED));
    }
    for (name, bodies) in [("blocks face to face", blocks()?), ("a capsule on a block", bed()?)] {
        let (counts, rates) = pairs(&bodies)?;
        let size = format!("{} pairs, {} samples", counts[0], counts[1]);
        table.row(row(&format!("pairs, {name}"), size, rates, PAIRS_ASKED));
    }
    Ok(format!("{}\n{}", processor(), table.to_text()))
}

fn row(what: &str, size: String, [median, best]: [f64; 2], asked: f64) -> [String; 5] {
    let number = |rate: f64| format!("{rate:.0}");
    [what.to_owned(), size, number(median), number(best), number(asked)]
}

fn mib(bytes: usize) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}

/// How much of `count` things that are done at a time is done in a millisecond: the median of many times, and the best.
fn rates(mut act: impl FnMut() -> usize) -> [f64; 2] {
    let mut rates = Vec::with_capacity(REPEATS);
    for repeat in 0..REPEATS + SKIPPED {
        let start = Instant::now();
        let count = act();
        let rate = count as f64 / (1e3 * start.elapsed().as_secs_f64());
        if repeat >= SKIPPED {
            rates.push(rate);
        }
    }
    rates.sort_by(f64::total_cmp);
    [rates[REPEATS / 2], rates[REPEATS - 1]]
}

/// A rod with round ends, of a straight part of so much [m]; a ball where that is zero.
fn rod(radius: f64, length: f64) -> SurfaceMesh {
    const STEPS: u32 = 32;
    // From -90 to 90 degrees.
    let end = |steps: std::ops::RangeInclusive<u32>, shift: f64| {
        steps.map(move |step| {
            let angle = std::f64::consts::PI * (f64::from(step) / f64::from(2 * STEPS) - 0.5);
            let (sin, cos) = libm::sincos(angle);
            let is_pole = step == 0 || step == 2 * STEPS;
            [if is_pole { 0.0 } else { radius * cos }, radius * sin + shift]
        })
    };
    let (lower, from) = (end(0..=STEPS, 0.0), STEPS + u32::from(length == 0.0));
    let upper = end(from..=2 * STEPS, length);
    turned(&lower.chain(upper).collect::<Vec<_>>(), 2 * STEPS)
}

/// Distances of a surface's grid per ms.
fn distances(surface: &SurfaceMesh) -> Result<(DistanceGrid, [f64; 2])> {
    let grid = DistanceGrid::new(surface, THICKNESS)?;
    let mut points = points_near(&grid);
    // Samples of tissue come in the order of space as well.
    points.sort_by_key(|x| (x.to_array().map(|x| (x / NEAR).floor() as i64), x.z.to_bits()));
    let rates = rates(|| {
        let mut sum = Vec3::ZERO;
        for x in &points {
            let there = grid.distance(black_box(*x));
            sum += there.normal * (there.value * there.slope);
        }
        black_box(sum);
        points.len()
    });
    Ok((grid, rates))
}

/// At random, within [`NEAR`] of the surface.
fn points_near(grid: &DistanceGrid) -> Vec<Vec3<f64>> {
    let vertices = &grid.surface().vertices;
    let mut random = Random(1);
    let mut points = Vec::with_capacity(POINTS);
    while points.len() < POINTS {
        let share = 0.5 + 0.5 * random.vector(1.0).x;
        let vertex = vertices[((share * vertices.len() as f64) as usize).min(vertices.len() - 1)];
        let x = vertex + random.vector(2.0 * NEAR);
        if grid.distance(x).value.abs() < NEAR {
            points.push(x);
        }
    }
    points
}

/// Two bodies that touch.
struct Bodies {
    model: Model<f32>,
    /// The first vertex of the upper one.
    first: usize,
    lowered: f64,
    /// The middles of all outer faces.
    samples: usize,
}

fn bodies(lower: &TetMesh, upper: &TetMesh, lowered: f64) -> Result<Bodies> {
    let tissue = tissue(MaterialModel::StableNeoHookean, 5e3, 0.45)?;
    let mut builder = ModelBuilder::new();
    builder.add_body(lower, &tissue)?;
    builder.add_body(upper, &tissue)?;
    builder.touch_tissue(&TissueContact::default())?;
    let model = builder.build()?;
    let faces = |mesh: &TetMesh| boundary_faces(mesh.tets()).len();
    let samples = faces(lower) + faces(upper);
    Ok(Bodies { first: lower.vertices().len(), model, lowered, samples })
}

fn raised(mesh: &TetMesh, by: Vec3<f64>) -> Result<TetMesh> {
    let vertices = mesh.vertices().iter().map(|x| *x + by).collect();
    Ok(TetMesh::new(vertices, mesh.tets().to_vec(), mesh.regions().to_vec())?.0)
}

/// Faces of 60 x 60 mm, pressed to half of the contact's thickness.
fn blocks() -> Result<Bodies> {
    let block = Block::new(vec3(0.06, 0.06, 0.01), [20, 20, 3]).mesh()?;
    bodies(&block, &raised(&block, vec3(0.4e-3, 0.7e-3, 0.0111))?, 0.6e-3)
}

/// A round body on a flat one, as organs lie on each other: few of all samples meet anything.
fn bed() -> Result<Bodies> {
    let block = Block::new(vec3(0.08, 0.06, 0.015), [26, 20, 5]).mesh()?;
    let body = capsule(0.02, 0.03, 3e-3)?.tets;
    let lowest = body.vertices().iter().map(|x| x.z).fold(f64::INFINITY, f64::min);
    bodies(&block, &raised(&body, vec3(0.04, 0.03, 0.0162 - lowest))?, 1.2e-3)
}

/// Pairs per ms, and how many pairs and samples there are.
fn pairs(bodies: &Bodies) -> Result<([usize; 2], [f64; 2])> {
    let Bodies { model, first, lowered, samples } = bodies;
    let settings = SolverSettings { method: Method::QuasiNewton, ..SolverSettings::default() };
    let mut meetings = Meetings::new(model, &settings);
    let mut state = State::at_rest(model);
    let rest = model.rest_positions.clone();
    let mut step = 0;
    let (mut count, mut force) = (0, 0.0);
    let rates = rates(|| {
        // Down and up again, in a slow swing: what is found in one step is not what was found in the last.
        step += 1;
        let swing = f64::from(step % 16 - 8).abs();
        let way = vec3(0.5 * WAY * swing, 0.0, WAY * (swing - 4.0) - lowered);
        let velocity: Vec3<f32> = vec3(0.0, 0.0, -WAY / STEP).cast();
        for (v, rest) in rest.iter().enumerate().skip(*first) {
            state.positions[v] = (rest.cast::<f64>() + way).cast();
            state.velocities[v] = velocity;
        }
        (count, force) = meetings.meet(&state, STEP);
        count
    });
    ensure!(count > 0 && force > 0.0, "two bodies do not touch");
    Ok(([count, *samples], rates))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_measured_touches() {
        for bodies in [blocks(), bed()] {
            let bodies = bodies.expect("two bodies");
            let settings = SolverSettings::default();
            let mut meetings = Meetings::new(&bodies.model, &settings);
            let mut state = State::at_rest(&bodies.model);
            assert_eq!(meetings.meet(&state, STEP).1, 0.0, "nothing touches at rest");
            for x in state.positions.iter_mut().skip(bodies.first) {
                x.z -= bodies.lowered as f32;
            }
            let (count, force) = meetings.meet(&state, STEP);
            assert!(count > 20 && force > 1e-3, "{count} {force}");
        }
    }

    #[test]
    fn points_are_near_rods_that_have_the_volume_of_rods() {
        let surface = rod(2.5e-3, 0.04);
        let pi = std::f64::consts::PI;
        let volume = pi * 2.5e-3f64.powi(2) * (0.04 + 4.0 / 3.0 * 2.5e-3);
        assert!((surface.enclosed_volume() / volume - 1.0).abs() < 5e-3);
        let ball = rod(0.03, 0.0);
        let volume = 4.0 / 3.0 * pi * 0.03f64.powi(3);
        assert!((ball.enclosed_volume() / volume - 1.0).abs() < 5e-3);
    }
}
