//! The static equations of a body on ten-node tetrahedra: the same corners, and a node on every edge.
//!
//! ```text
//! N_a = L_a (2 L_a - 1),  N_ab = 4 L_a L_b                        with the barycentric coordinates L
//! F   = sum_a c_a g_a^T,  c_a = (4 L_a - 1) x_a + 4 sum_b L_b x_ab,  g_a = grad L_a
//! V   = sum_t V_t/4 sum_q W(F_q) - work of the loads              at four points q
//! ```
//!
//! Tetrahedra with nodes on their edges bend and keep their volume without locking: their error is of the third order in the
//! size of the cells where that of linear ones is of the second (Hughes, "The Finite Element Method", 2000, chapter 4).
//! Edges are straight at rest. What holds both ends of an edge holds its middle.

use super::newton::Equations;
use super::{Statics, add_stiffness_of_holds, slope_stiffness, still};
use crate::elements::{law, shape_gradients};
use crate::material::MaterialModel;
use crate::mesh::topology::{TET_EDGES, edges_of, ends_of};
use crate::scalar::{Mat3, Real, Vec3};

/// Barycentric coordinates of the four points that integrate squares of linear functions exactly:
/// `(5 + 3 sqrt 5)/20` once, `(5 - sqrt 5)/20` three times.
const POINTS: [[f64; 4]; 4] = {
    const A: f64 = 0.585_410_196_624_968_5;
    const B: f64 = 0.138_196_601_125_010_5;
    [[A, B, B, B], [B, A, B, B], [B, B, A, B], [B, B, B, A]]
};

/// One tetrahedron.
struct Tet {
    /// Corners, then the edges in the order of [`TET_EDGES`].
    nodes: [u32; 10],
    /// `g_a` [1/m].
    gradients: [Vec3<f64>; 4],
    /// [m^3].
    volume: f64,
    lambda: f64,
    mu: f64,
    law: MaterialModel,
}

/// Corners have the numbers of the model's vertices, the edges' nodes follow.
pub(super) struct Quadratic<'a, S> {
    corners: &'a Statics<'a, S>,
    tets: Vec<Tet>,
    /// The ends of each edge, ascending.
    edges: Vec<[u32; 2]>,
    /// `int rho N` [kg], shape [node_count]: negative at corners.
    masses: Vec<f64>,
    moves: Vec<bool>,
    softness: Vec<f64>,
    shortest: f64,
}

impl<'a, S: Real> Quadratic<'a, S> {
    pub(super) fn new(corners: &'a Statics<'a, S>) -> Self {
        let model = corners.model;
        let edges = edges_of(&model.tet_vertices);
        let vertex_count = model.vertex_count();
        let node_count = vertex_count + edges.len();
        let density = densities(corners);
        let mut masses = vec![0.0; node_count];
        let mut stiffness = vec![0.0; node_count];
        let mut steepest = 0.0f64;
        let mut tets = Vec::with_capacity(model.tet_count());
        for tet in model.tets() {
            let mut nodes = [0; 10];
            nodes[..4].copy_from_slice(&tet.vertices);
            for (node, edge) in nodes[4..].iter_mut().zip(ends_of(&tet.vertices)) {
                // Every edge of every tetrahedron is in the list.
                *node = (vertex_count + edges.binary_search(&edge).unwrap_or_default()) as u32;
            }
            let gradients = shape_gradients(&tet.inverse_rest_shape.cast::<f64>());
            let volume = tet.rest_volume.to_f64();
            let mass =
                volume * tet.vertices.iter().map(|&v| density[v as usize] / 4.0).sum::<f64>();
            for (i, &node) in nodes.iter().enumerate() {
                masses[node as usize] += mass * if i < 4 { -1.0 / 20.0 } else { 1.0 / 5.0 };
            }
            let of_slope = 0.25 * volume * slope_stiffness(model, tet.material);
            for point in POINTS {
                for (&node, slope) in nodes.iter().zip(slopes(&point, &gradients)) {
                    stiffness[node as usize] += of_slope * slope.length_squared();
                    steepest = steepest.max(slope.length());
                }
            }
            let material = &model.materials[tet.material as usize];
            let [lambda, mu] = [material.lame_lambda, material.lame_mu].map(Real::to_f64);
            tets.push(Tet { nodes, gradients, volume, lambda, mu, law: tet.law });
        }
        add_stiffness_of_holds(model, corners.inputs, &mut stiffness);
        let mut moves = corners.moves.clone();
        moves.extend(edges.iter().map(|edge| edge.iter().any(|&v| corners.moves[v as usize])));
        let softness = stiffness.iter().map(|&k| if k > 0.0 { 1.0 / k } else { 0.0 }).collect();
        let shortest = if steepest > 0.0 { 1.0 / steepest } else { 1.0 };
        Self { corners, tets, edges, masses, moves, softness, shortest }
    }

    /// Places [m] of all nodes, shape [node_count], from those of the corners: the middle of an edge that moves lies where
    /// the mean gradients around its ends put it, `(x_a + x_b)/2 + (G_a - G_b)(X_b - X_a)/8`.
    pub(super) fn nodes(&self, x: &[Vec3<f64>]) -> Vec<Vec3<f64>> {
        let mut sums = vec![Mat3::ZERO; x.len()];
        let mut volumes = vec![0.0; x.len()];
        for tet in &self.tets {
            let [a, b, c, d] = [0, 1, 2, 3]
                .map(|a| Mat3::outer(x[tet.nodes[a] as usize], tet.gradients[a]) * tet.volume);
            let gradient = (a + b) + (c + d);
            for &v in &tet.nodes[..4] {
                sums[v as usize] = sums[v as usize] + gradient;
                volumes[v as usize] += tet.volume;
            }
        }
        let mean = |v: usize| sums[v] * (1.0 / volumes[v]);
        let rest = &self.corners.model.rest_positions;
        let middle = |(i, edge): (usize, &[u32; 2])| {
            let [a, b] = edge.map(|v| v as usize);
            let straight = (x[a] + x[b]) * 0.5;
            if !self.moves[x.len() + i] {
                return straight;
            }
            straight + (mean(a) - mean(b)) * (rest[b] - rest[a]).cast() * 0.125
        };
        x.iter().copied().chain(self.edges.iter().enumerate().map(middle)).collect()
    }

    /// `grad V` [N] of all nodes.
    fn full_gradient(&self, x: &[Vec3<f64>], gradient: &mut [Vec3<f64>]) {
        let gravity = self.corners.inputs.gravity.cast::<f64>();
        for (load, mass) in gradient.iter_mut().zip(&self.masses) {
            *load = gravity * -mass;
        }
        self.corners.add_loads(x, gradient);
        for tet in &self.tets {
            tet.add_gradient(x, gradient);
        }
    }

    /// The forces [N] at these places [m] by which what is pinned is held, shape [vertex_count]: half of what holds the
    /// middle of an edge at each of its ends.
    pub(super) fn holding(&self, x: &[Vec3<f64>]) -> Vec<Vec3<f64>> {
        let mut forces = vec![Vec3::ZERO; x.len()];
        self.full_gradient(x, &mut forces);
        for (force, moves) in forces.iter_mut().zip(&self.moves) {
            if *moves {
                *force = Vec3::ZERO;
            }
        }
        let of_edges = forces.split_off(self.corners.moves.len());
        for (edge, force) in self.edges.iter().zip(of_edges) {
            edge.iter().for_each(|&v| forces[v as usize] += force * 0.5);
        }
        forces
    }
}

impl Tet {
    fn add_gradient(&self, x: &[Vec3<f64>], gradient: &mut [Vec3<f64>]) {
        let places = self.nodes.map(|node| x[node as usize]);
        let mut forces = [Vec3::ZERO; 10];
        for point in POINTS {
            // `c_a`
            let mut moments = [0, 1, 2, 3].map(|a| places[a] * (4.0 * point[a] - 1.0));
            for (&[a, b], &place) in TET_EDGES.iter().zip(&places[4..]) {
                moments[a] += place * (4.0 * point[b]);
                moments[b] += place * (4.0 * point[a]);
            }
            let g = &self.gradients;
            let [p, q, r, s] = [0, 1, 2, 3].map(|a| Mat3::outer(moments[a], g[a]));
            let f = (p + q) + (r + s);
            let (_, piola) = law::respond(self.law, &f, self.lambda, self.mu);
            let pulls = g.map(|g| piola * g * (0.25 * self.volume));
            for a in 0..4 {
                forces[a] += pulls[a] * (4.0 * point[a] - 1.0);
            }
            for (&[a, b], force) in TET_EDGES.iter().zip(&mut forces[4..]) {
                *force += (pulls[a] * point[b] + pulls[b] * point[a]) * 4.0;
            }
        }
        for (node, force) in self.nodes.into_iter().zip(forces) {
            gradient[node as usize] += force;
        }
    }
}

impl<S: Real> Equations for Quadratic<'_, S> {
    fn gradient(&self, x: &[Vec3<f64>], gradient: &mut [Vec3<f64>]) {
        self.full_gradient(x, gradient);
        still(gradient, &self.moves);
    }

    fn softness(&self) -> &[f64] {
        &self.softness
    }

    fn shortest(&self) -> f64 {
        self.shortest
    }

    fn pass(&self) -> f64 {
        (POINTS.len() * self.tets.len()) as f64
    }
}

/// Gradients of the ten functions at a point [1/m].
fn slopes(point: &[f64; 4], g: &[Vec3<f64>; 4]) -> [Vec3<f64>; 10] {
    let mut slopes = [Vec3::ZERO; 10];
    for a in 0..4 {
        slopes[a] = g[a] * (4.0 * point[a] - 1.0);
    }
    for (slope, [a, b]) in slopes[4..].iter_mut().zip(TET_EDGES) {
        *slope = (g[b] * point[a] + g[a] * point[b]) * 4.0;
    }
    slopes
}

/// Mass over volume [kg/m^3] around each vertex: a model keeps no other density.
fn densities<S: Real>(corners: &Statics<'_, S>) -> Vec<f64> {
    let model = corners.model;
    let mut volumes = vec![0.0; model.vertex_count()];
    for tet in model.tets() {
        let quarter = 0.25 * tet.rest_volume.to_f64();
        tet.vertices.iter().for_each(|&v| volumes[v as usize] += quarter);
    }
    let masses = model.masses.iter().map(|mass| mass.to_f64());
    masses
        .zip(volumes)
        .map(|(mass, volume)| if volume > 0.0 { mass / volume } else { 0.0 })
        .collect()
}
