//! How far a mesh is from the body that it stands for: its state of rest beside that of a mesh with eight times the
//! tetrahedra.
//!
//! ```text
//! x   places at rest on the scene's mesh,  x'  on the mesh with every edge halved, under the same inputs
//! y = x + c (x' - x),  c = 1/(1 - 2^-p)            where errors fall with the power p of the edges' length
//! error = sqrt(sum_v m_v |y_v - x_v|^2 / sum_v m_v |y_v - X_v|^2)        over the vertices that both have
//! ```
//!
//! `p` is 2 where strains are smooth, 1 where a clamp ends or a patch is small, so that `c` is 4/3 to 2. It is 3/2 here for
//! recovered-gradient tetrahedra, and 2 for linear ones, which lock until cells are fine. Richardson, "The approximate arithmetical solution by finite
//! differences of physical problems", Phil. Trans. R. Soc. A 210, 1911.

use super::holding::GraspOrigins;
use super::{Assembly, PatchForce, Simulation};
use crate::mesh::topology::{TET_EDGES, edges};
use crate::model::Model;
use crate::rest::WayToRest;
use crate::scalar::{Real, Vec3};
use crate::settings::{Count, DeviceRequest, Elements, Integrator, Method, SolverSettings};
use crate::solver::balance::ForceBalance;
use crate::solver::{Inputs, Solver};
use crate::state::State;

/// `c` of recovered-gradient tetrahedra, and of linear ones.
const BEYOND: f64 = 1.5;
const BEYOND_LINEAR: f64 = 2.0;

/// The error of a mesh that is enough: what one does not see.
const ENOUGH: f64 = 0.05;

/// Edges shorter by more than this make more than 200 times as many tetrahedra: that is no advice.
const MOST_TIMES_FINER: f64 = 6.0;

/// Tetrahedra of the largest mesh whose own error is estimated: that takes some seconds.
pub const MESH_ERROR_TETS: usize = 20_000;

/// The same where bodies rest under gravity as they were given: the finer mesh is balanced, too.
const BALANCED_TETS: usize = 5_000;

/// A mesh beside the body that it stands for, at rest.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct MeshReport {
    /// Estimate of the root mean square distance of vertices from where those of the body are, over their displacement.
    pub displacement: f64,
    /// Apparent stiffness of the mesh over that of the body, minus one: above zero it gives way too little.
    pub stiffness: f64,
    /// The largest difference between the force on a patch and that of the body, over the largest such force.
    pub force: f64,
    /// Root mean square length of edges [m].
    pub edge: f64,
    /// The length of edges [m] with which displacement and forces would be within 5 %: errors fall with its square.
    pub edge_for_five_percent: f64,
    /// False where the estimate ended early: the errors are at least so large.
    pub complete: bool,
}

impl MeshReport {
    /// Of displacement and forces.
    pub fn largest_error(&self) -> f64 {
        self.displacement.max(self.force)
    }

    /// What a person should know, and do, where the mesh is too coarse.
    pub fn advice(&self) -> Option<String> {
        let (needed, now) = (1e3 * self.edge_for_five_percent, 1e3 * self.edge);
        (self.largest_error() > ENOUGH).then(|| match now / needed <= MOST_TIMES_FINER {
            true => format!("for 5 % take edges of about {needed:.2} mm, now {now:.2} mm"),
            // So many tetrahedra are neither made nor simulated.
            false => format!(
                "take finer edges, now {now:.2} mm: with those of {:.2} mm errors are about a quarter",
                0.5 * now
            ),
        })
    }
}

impl std::fmt::Display for MeshReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let how = if self.stiffness > 0.0 { "too stiff" } else { "too soft" };
        let least = if self.complete { "about" } else { "at least" };
        write!(
            f,
            "mesh: its own error is {least} {:.1} % of the displacement ({how}) and {:.1} % of the forces",
            100.0 * self.displacement,
            100.0 * self.force
        )?;
        self.advice().map_or(Ok(()), |advice| write!(f, "; {advice}"))
    }
}

/// The finer mesh comes to rest by steps of implicit Euler without velocity [s]: organs swing about once in half of one,
/// so that a step leaves little of the way, and what is inside out still has inertia to turn back with.
const STEP: f64 = 0.2;

/// Passes of a step.
const PASSES: u32 = 20;

/// It is at rest where a step adds less than this share of the way so far, and after so many steps it is not.
const SMALL: f64 = 0.02;
const MOST_STEPS: u32 = 100;

impl<S: Real> Simulation<S> {
    /// How far the mesh is from the body that it stands for, at rest under what acts at the end of the last frame. Nothing
    /// before the first frame, where nothing is held or displaced, where tissue was in motion when it was taken hold of,
    /// where there is contact, of which the way to rest knows nothing, where nothing acts on bodies that rest under gravity
    /// as they were given, and of more than [`MESH_ERROR_TETS`]. Takes about as long as a hundred frames, and the memory of a mesh eight
    /// times as large: for the end of a run.
    pub fn mesh_error(&self) -> Option<MeshReport> {
        let is_balanced = self.scene.bodies.iter().any(|body| body.balanced);
        let most = if is_balanced { BALANCED_TETS } else { MESH_ERROR_TETS };
        let is_large = self.model.tet_count() > most;
        // What rests as it was given does so on any mesh: its error shows where something else acts.
        let is_loaded = !self.scene.motions.is_empty() || !self.scene.forces.is_empty();
        if is_balanced && !is_loaded {
            return None;
        }
        if !self.stepped || is_large || self.has_contact() {
            return None;
        }
        let (time, positions) = (self.time(), &self.state.positions);
        let still = vec![Vec3::ZERO; positions.len()];
        let elements = self.solver.elements;
        let inputs = self.inputs_at(time);
        let way = WayToRest::measure(&self.model, positions, &still, &inputs, elements)?;
        let places = positions.iter().zip(&way.way).map(|(x, way)| x.cast::<f64>() + *way);
        let places: Vec<Vec3<f64>> = places.collect();
        let report = self.mesh_error_at(time, &places, &way.holding)?;
        Some(MeshReport { complete: report.complete && way.complete, ..report })
    }

    /// The same of a caller's own state of rest under what acts at a time [s]: `places` [m], and the forces `holding` [N]
    /// by which pinned vertices are held there, both of shape [vertex_count].
    pub fn mesh_error_at(
        &self,
        time: f64,
        places: &[Vec3<f64>],
        holding: &[Vec3<f64>],
    ) -> Option<MeshReport> {
        if self.scene.motions.iter().any(|motion| motion.start > 0.0) {
            return None;
        }
        let finer = self.assembly.refined(&self.scene).ok()?;
        let model = finer.builder.build::<S>().ok()?;
        let mut inputs = Inputs::default();
        GraspOrigins::default().act(&self.scene, &finer, time, &mut inputs);
        self.instruments.act(&finer.tools, time, &mut inputs);
        self.place_held(&mut inputs.tools);
        let settings = SolverSettings {
            method: Method::QuasiNewton,
            integrator: Integrator::ImplicitEuler,
            iterations: Count::Of(PASSES),
            history: 10,
            device: DeviceRequest::Cpu,
            threads: self.solver.threads,
            elements: self.solver.elements,
            ..SolverSettings::default()
        };
        let mut solver = Solver::new(&model, &settings);
        let mut state = State::at_rest(&model);
        self.put_middles(&finer, places, &mut state);
        let complete = settle(&mut solver, &model, &inputs, &mut state)?;
        let fine: Vec<Vec3<f64>> = state.positions.iter().map(|x| x.cast()).collect();
        let mut balance = ForceBalance::default();
        solver.force_balance(&model, &state, &inputs, &mut balance).ok()?;
        let ours = self.patch_forces_at(time, places, holding);
        let finer_forces = self.patch_forces_of(&finer, time, &fine, &balance.residual);
        self.compared(&finer, (places, &ours), (&fine, &finer_forces), complete)
    }

    /// The vertices of the coarser mesh where they are, the middles of its edges between them.
    fn put_middles(&self, finer: &Assembly, places: &[Vec3<f64>], state: &mut State<S>) {
        for (fine, coarse) in finer.bodies.iter().zip(&self.assembly.bodies) {
            let own = &places[coarse.vertices.clone()];
            let into = &mut state.positions[fine.vertices.clone()];
            let middles = edges(&coarse.mesh);
            let middles = middles.iter().map(|&[a, b]| (own[a as usize] + own[b as usize]) * 0.5);
            for (into, place) in into.iter_mut().zip(own.iter().copied().chain(middles)) {
                *into = place.cast();
            }
        }
    }

    /// The report of places and forces on the scene's mesh, and on the finer one.
    fn compared(
        &self,
        finer: &Assembly,
        (places, ours): (&[Vec3<f64>], &[PatchForce]),
        (fine, finer_forces): (&[Vec3<f64>], &[PatchForce]),
        complete: bool,
    ) -> Option<MeshReport> {
        let is_recovered = self.solver.elements == Elements::Recovered;
        let beyond = if is_recovered { BEYOND } else { BEYOND_LINEAR };
        let (mut apart, mut square, mut along) = (0.0, 0.0, 0.0);
        let (mut edge, mut count) = (0.0, 0.0);
        for (of_fine, coarse) in finer.bodies.iter().zip(&self.assembly.bodies) {
            for (i, v) in coarse.vertices.clone().enumerate() {
                let mass = self.model.masses[v].to_f64();
                let rest = self.model.rest_positions[v].cast::<f64>();
                let gone = (fine[of_fine.vertices.start + i] - places[v]) * beyond;
                let moved = places[v] - rest;
                apart += mass * gone.length_squared();
                square += mass * (moved + gone).length_squared();
                along += mass * (moved + gone).dot(moved);
            }
            for tet in coarse.mesh.tets() {
                for [a, b] in TET_EDGES.map(|edge| edge.map(|a| tet[a] as usize)) {
                    let vertices = coarse.mesh.vertices();
                    edge += (vertices[a] - vertices[b]).length_squared();
                    count += 1.0;
                }
            }
        }
        let edge = (edge / count).sqrt();
        let displacement = (apart / square).sqrt();
        let force = beyond * self.apart(ours, finer_forces);
        let edge_for_five_percent = edge * (ENOUGH / displacement.max(force)).sqrt();
        let is_displaced = square > 0.0 && along > 0.0 && displacement.is_finite();
        is_displaced.then_some(MeshReport {
            displacement,
            stiffness: square / along - 1.0,
            force,
            edge,
            edge_for_five_percent,
            complete,
        })
    }
}

/// Brings a state to rest; whether it came there. Nothing where it ran away.
fn settle<S: Real>(
    solver: &mut Solver<S>,
    model: &Model<S>,
    inputs: &Inputs<S>,
    state: &mut State<S>,
) -> Option<bool> {
    let start = state.positions.clone();
    let mut before = start.clone();
    for _ in 0..MOST_STEPS {
        state.velocities.fill(Vec3::ZERO);
        solver.step(model, state, inputs, STEP).ok()?;
        if !state.is_finite() {
            return None;
        }
        let length = |from: &[Vec3<S>]| {
            let steps = state.positions.iter().zip(from).map(|(x, y)| (*x - *y).length_squared());
            steps.map(S::to_f64).sum::<f64>().sqrt()
        };
        if length(&before) <= SMALL * length(&start) {
            return Some(true);
        }
        before.copy_from_slice(&state.positions);
    }
    Some(false)
}
