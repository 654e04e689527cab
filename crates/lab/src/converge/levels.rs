//! A scene at rest on one mesh after the other, each with eight times the tetrahedra of the one before.
//!
//! States of rest by large steps of implicit Euler that start without velocity, `min V(y) + m |y - x|^2/(2 h^2)`, solved
//! by the quasi-Newton method in double precision, until one step of Newton's method for `V` alone moves nothing any more.

use anyhow::{Result, bail};
use viscera::mesh::topology::edges;
use viscera::rest::WayToRest;
use viscera::scalar::Vec3;
use viscera::scene::Scene;
use viscera::settings::{Count, DeviceRequest, Elements, Integrator, Method, SolverSettings};
use viscera::simulation::{Assembly, MeshReport, PatchForce, Simulation};
use viscera::solver::{Inputs, Solver};
use viscera::state::State;

use crate::sections::Progress;

/// Parts of the way that moved patches go, one state near rest after the other.
pub const PARTS: u32 = 12;

/// Steps of a part; the last one takes as many as it needs, up to so many.
const STEPS: u32 = 6;
const MOST_STEPS: u32 = 400;

/// The step [s]: organs swing about once in half of one, so that a step leaves little of the way to rest, and what is
/// inside out still has inertia to turn back with.
const STEP: f64 = 0.2;

/// A state of rest that is farther away than this is named: errors of meshes are of this size.
pub const ENOUGH: f64 = 1e-3;

/// At rest where Newton's step is less than this share of the displacement.
const AT_REST: f64 = 1e-4;

/// Newton's step is measured after so many steps: it costs as much as many of them.
const BETWEEN: u32 = 10;

/// Passes of a solve.
const PASSES: u32 = 20;

/// A scene's bodies at rest on one mesh.
#[derive(Clone, Debug)]
pub struct AtRest {
    /// Tetrahedra of all bodies.
    pub tets: usize,
    /// Root mean square length of edges [m].
    pub edge: f64,
    /// Places [m] of the vertices that every mesh has, those of the coarsest one, in its order.
    pub places: Vec<Vec3<f64>>,
    /// Places [m] of all vertices of this mesh.
    pub all: Vec<Vec3<f64>>,
    /// Forces on patches.
    pub forces: Vec<PatchForce>,
    /// Tetrahedra inside out.
    pub inverted: usize,
    /// Whether Newton's step became small; where it did not, how large it is, of the displacement.
    pub left: f64,
    /// What a run would say of this mesh's error, where it was asked for.
    pub estimate: Option<MeshReport>,
}

/// The scene with its bodies refined so often, more than it asks for.
pub fn refined(scene: &Scene, times: u32) -> Scene {
    let mut scene = scene.clone();
    scene.bodies.iter_mut().for_each(|body| body.refine += times);
    scene
}

/// The scene as it is brought to rest.
fn statics(scene: &Scene, elements: Elements) -> Scene {
    let solver = SolverSettings {
        method: Method::QuasiNewton,
        integrator: Integrator::ImplicitEuler,
        iterations: Count::Of(PASSES),
        history: 10,
        device: DeviceRequest::Cpu,
        threads: scene.solver.threads,
        elements,
        ..SolverSettings::default()
    };
    let mut scene = scene.clone();
    scene.solver = solver;
    scene
}

/// Brings a scene to the rest that its end has, with `vertices` of each body kept for the result. A step of the bar for each part.
pub fn at_rest(
    scene: &Scene,
    assembly: &Assembly,
    elements: Elements,
    kept: &[usize],
    estimates: bool,
    progress: Option<&Progress>,
) -> Result<AtRest> {
    let scene = statics(scene, elements);
    let end = scene.frame_count() as f64 * scene.time.frame;
    let simulation = Simulation::<f64>::new(scene, assembly.clone())?;
    let model = simulation.model();
    let mut solver = Solver::new(model, simulation.solver());
    let mut state = State::at_rest(model);
    let mut step = |state: &mut State<f64>, inputs: &Inputs<f64>| -> Result<()> {
        state.velocities.fill(Vec3::ZERO);
        solver.step(model, state, inputs, STEP)?;
        if !state.is_finite() {
            bail!("{}: the bodies did not come to rest", simulation.scene().name);
        }
        Ok(())
    };
    for part in 1..PARTS {
        let _case = progress.map(|bar| bar.case(&format!("part {part} of {PARTS}")));
        let inputs = simulation.inputs_at(end * f64::from(part) / f64::from(PARTS));
        for _ in 0..STEPS {
            step(&mut state, &inputs)?;
        }
    }
    let _case = progress.map(|bar| bar.case("coming to rest"));
    let inputs = simulation.inputs_at(end);
    let still = vec![Vec3::ZERO; model.vertex_count()];
    let mut way = None;
    for taken in 1..=MOST_STEPS {
        step(&mut state, &inputs)?;
        if !taken.is_multiple_of(BETWEEN) {
            continue;
        }
        way = WayToRest::measure(model, &state.positions, &still, &inputs, elements);
        if way.as_ref().is_none_or(|way| way.stable && way.error() < AT_REST) {
            break;
        }
    }
    let Some(way) = way else {
        bail!(
            "{}: nothing holds the bodies, so they have no state of rest",
            simulation.scene().name
        )
    };
    let rest: Vec<_> = state.positions.iter().zip(&way.way).map(|(x, d)| *x + *d).collect();
    let estimate = match estimates {
        true => simulation.mesh_error_at(end, &rest, &way.holding),
        false => None,
    };
    let bodies = assembly.bodies.iter().zip(kept);
    let places = bodies.flat_map(|(body, &count)| &rest[body.vertices.start..][..count]);
    let mut tets = Vec::new();
    viscera::measure::measure_tets(model, &rest, &mut tets);
    Ok(AtRest {
        tets: model.tet_count(),
        edge: length_of_edges(assembly),
        places: places.copied().collect(),
        forces: simulation.patch_forces_at(end, &rest, &way.holding),
        all: rest.clone(),
        inverted: tets.iter().filter(|tet| tet.is_inverted()).count(),
        left: way.error(),
        estimate,
    })
}

/// Root mean square [m].
fn length_of_edges(assembly: &Assembly) -> f64 {
    let (mut squares, mut count) = (0.0, 0.0);
    for body in &assembly.bodies {
        for [a, b] in edges(&body.mesh) {
            let [a, b] = [a, b].map(|v| body.mesh.vertices()[v as usize]);
            squares += (a - b).length_squared();
            count += 1.0;
        }
    }
    (squares / count).sqrt()
}

/// What finer and finer meshes lead to, of values on three of them or two: each difference is a fixed share of the one before.
#[derive(Clone, Debug)]
pub struct Limit {
    /// Places [m] on no mesh at all.
    pub places: Vec<Vec3<f64>>,
    /// How errors fall with the length of edges: its power. Two where that is not measured.
    pub order: f64,
}

/// Orders that are believed: with a corner in which stress has no bounds, and of smooth strains.
const ORDERS: [f64; 2] = [0.7, 3.0];

/// Of meshes from coarse to fine.
pub fn limit(levels: &[AtRest]) -> Limit {
    let apart = |a: &AtRest, b: &AtRest| {
        let squares = a.places.iter().zip(&b.places).map(|(x, y)| (*x - *y).length_squared());
        squares.sum::<f64>().sqrt()
    };
    match levels {
        [.., a, b, c] => {
            let ratio = apart(a, b) / apart(b, c).max(f64::MIN_POSITIVE);
            let order = libm::log2(ratio).clamp(ORDERS[0], ORDERS[1]);
            beyond(b, c, order)
        }
        [.., b, c] => beyond(b, c, 2.0),
        [one] => Limit { places: one.places.clone(), order: 2.0 },
        [] => Limit { places: Vec::new(), order: 2.0 },
    }
}

fn beyond(coarse: &AtRest, fine: &AtRest, order: f64) -> Limit {
    let share = 1.0 / (libm::exp2(order) - 1.0);
    let places = coarse.places.iter().zip(&fine.places);
    Limit { places: places.map(|(a, b)| *b + (*b - *a) * share).collect(), order }
}

/// Root mean square distance of places from true ones, over their root mean square displacement, by mass.
pub fn error(rest: &[Vec3<f64>], masses: &[f64], places: &[Vec3<f64>], truth: &[Vec3<f64>]) -> f64 {
    let (mut apart, mut moved) = (0.0, 0.0);
    for (v, mass) in masses.iter().enumerate() {
        apart += mass * (places[v] - truth[v]).length_squared();
        moved += mass * (truth[v] - rest[v]).length_squared();
    }
    if moved > 0.0 { (apart / moved).sqrt() } else { 0.0 }
}
