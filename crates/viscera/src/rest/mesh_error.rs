//! How far a mesh is from the body that it stands for: its state of rest beside that of ten-node tetrahedra.
//!
//! ```text
//! x   places at rest on the model's own elements
//! y   places at rest of the same body on ten-node tetrahedra ([`super::quadratic`]): y <- y + s d,  K(y) d = -grad V(y)
//! error = sqrt(sum_v m_v |y_v - x_v|^2 / sum_v m_v |y_v - X_v|^2)
//! ```
//!
//! `y` starts where the elements and the gradients recovered at their vertices say that it is, so that mostly one step
//! of Newton's method is enough. It is a mesh of its own kind, whose error is a small part of that of linear tetrahedra
//! on the same corners; neither the solver nor the elements in use judge themselves. Errors as differences to a richer
//! space on the same mesh: Deuflhard, Leinen, Yserentant, "Concepts of an adaptive hierarchical finite element code",
//! Impact of Computing in Science and Engineering 1, 1989.

use super::Statics;
use super::newton::{self, Effort, Equations, dot, longest};
use super::quadratic::Quadratic;
use crate::mesh::topology::edges_of;
use crate::model::Model;
use crate::scalar::{Real, Vec3};
use crate::settings::Elements;
use crate::solver::Inputs;

/// Conjugate gradients leave a tenth of the error: it is an estimate.
const COMPLETE: f64 = 0.01;

/// Passes over single tetrahedra at most, in all: two seconds.
const MOST_WORK: f64 = 4e7;

/// Newton's method ends where a step changes the error by less than this share of it.
const SMALL_STEP: f64 = 0.2;

/// The first shift where curvature is negative, its factor from step to step, and the largest: such a step is a gradient's.
const SHIFT: f64 = 1e-3;
const SHIFT_FACTOR: f64 = 8.0;
const LARGEST_SHIFT: f64 = 10.0;

/// Of the decrease that the slope promises, a step must deliver this share; half is Newton's in a parabola.
const LEAST_DECREASE: f64 = 0.1;

/// The shortest share of a step of Newton's method that is tried.
const SHORTEST_STEP: f64 = 0.01;

/// The mesh's own error at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshError {
    /// Root mean square distance to the places of the body over its root mean square displacement, by mass.
    pub displacement: f64,
    /// Apparent stiffness of the mesh over the body's, minus one: above zero it gives way too little.
    pub stiffness: f64,
    /// Root mean square length of edges [m].
    pub edge: f64,
    /// The body's places [m] at the model's vertices, shape [vertex_count].
    pub places: Vec<Vec3<f64>>,
    /// The forces [N] by which what is pinned is held on the body, shape [vertex_count].
    pub holding: Vec<Vec3<f64>>,
    /// False where iterations ended early: the error is at least so large.
    pub complete: bool,
}

impl MeshError {
    /// Of a model at rest at `at_rest` [m], shape [vertex_count], under these inputs. Takes about as long as a thousand
    /// passes over the mesh, and 0.8 kB per tetrahedron while it lasts. Nothing where nothing is held.
    pub fn measure<S: Real>(
        model: &Model<S>,
        at_rest: &[Vec3<f64>],
        inputs: &Inputs<S>,
    ) -> Option<Self> {
        let statics = Statics::new(model, inputs, Elements::Plain);
        if !statics.is_held || !at_rest.iter().all(|x| x.is_finite()) {
            return None;
        }
        let quadratic = Quadratic::new(&statics);
        let (nodes, complete) = settle(&quadratic, quadratic.nodes(at_rest));
        let mut error = Self::between(model, &statics.moves, at_rest, &nodes)?;
        error.holding = quadratic.holding(&nodes);
        error.complete = complete;
        Some(error)
    }

    /// Of places at rest against those of the body; what nothing holds is left out. Nothing where nothing is displaced.
    fn between<S: Real>(
        model: &Model<S>,
        moves: &[bool],
        at_rest: &[Vec3<f64>],
        nodes: &[Vec3<f64>],
    ) -> Option<Self> {
        let (mut apart, mut square, mut along) = (0.0, 0.0, 0.0);
        for v in (0..at_rest.len()).filter(|&v| moves[v]) {
            let (rest, mass) = (model.rest_positions[v].cast::<f64>(), model.masses[v].to_f64());
            let (ours, true_one) = (at_rest[v] - rest, nodes[v] - rest);
            apart += mass * (true_one - ours).length_squared();
            square += mass * true_one.length_squared();
            along += mass * true_one.dot(ours);
        }
        let edges = edges_of(&model.tet_vertices);
        let length = |edge: &[u32; 2]| {
            let [a, b] = edge.map(|v| model.rest_positions[v as usize].cast::<f64>());
            (a - b).length_squared()
        };
        let edge = (edges.iter().map(length).sum::<f64>() / edges.len().max(1) as f64).sqrt();
        (square > 0.0 && along > 0.0).then(|| Self {
            displacement: (apart / square).sqrt(),
            stiffness: square / along - 1.0,
            edge,
            places: nodes[..at_rest.len()].to_vec(),
            holding: Vec::new(),
            complete: true,
        })
    }
}

/// Places of rest, from those given, and whether they were found.
fn settle(equations: &impl Equations, start: Vec<Vec3<f64>>) -> (Vec<Vec3<f64>>, bool) {
    let mut x = start;
    let mut total = vec![Vec3::ZERO; x.len()];
    let (mut left, mut shift) = (MOST_WORK, 0.0);
    while left > 0.0 && shift <= LARGEST_SHIFT {
        let effort = Effort { complete: COMPLETE, most_work: left, shift };
        let found = newton::solve(equations, &x, effort);
        left -= found.work;
        let step = if found.stable { length_of_step(equations, &x, &found.way) } else { 0.0 };
        for ((x, total), way) in x.iter_mut().zip(&mut total).zip(&found.way) {
            *x += *way * step;
            *total += *way * step;
        }
        if step == 1.0 && shift == 0.0 && longest(&found.way) <= SMALL_STEP * longest(&total) {
            return (x, found.complete);
        }
        shift = match step {
            0.0 => (shift * SHIFT_FACTOR).max(SHIFT),
            1.0 if shift > SHIFT => shift / SHIFT_FACTOR,
            1.0 => 0.0,
            _ => shift,
        };
    }
    (x, false)
}

/// The share of a way that leads down: one, a half, a quarter ...; zero where none does.
fn length_of_step(equations: &impl Equations, x: &[Vec3<f64>], way: &[Vec3<f64>]) -> f64 {
    let mut gradient = vec![Vec3::ZERO; x.len()];
    let mut slope_at = |share: f64| {
        let moved: Vec<_> = x.iter().zip(way).map(|(x, way)| *x + *way * share).collect();
        equations.gradient(&moved, &mut gradient);
        dot(&gradient, way)
    };
    let slope = slope_at(0.0);
    let mut share = 1.0;
    while share >= SHORTEST_STEP {
        // Simpson's rule: the potential itself is a difference of large numbers near its minimum.
        let change = share / 6.0 * (slope + 4.0 * slope_at(0.5 * share) + slope_at(share));
        if change <= LEAST_DECREASE * share * slope {
            return share;
        }
        share *= 0.5;
    }
    0.0
}
