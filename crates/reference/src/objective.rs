//! What Newton's method minimises: the potential of an implicit Euler step, or of a body at rest.
//!
//! ```text
//! step     Phi(x) = 1/(2 dt^2) sum_i m_i |x_i - xt_i|^2 + V(x),   xt = x_n + dt v_n + dt^2 (g + f/m)
//! statics  Phi(x) = V(x) - sum_i (m_i g + f_i) . x_i
//! ```
//!
//! `V` holds tissue, springs, attachments, tethers and contact [J]; viscosity takes part in a step only.

use viscera::elements::spring;
use viscera::scalar::{Mat3, Vec3};
use viscera::solver::Tether;

use super::contact::Contacts;
use super::matrix::{MatrixValues, Pattern};
use super::problem::{Problem, TetElements};
use super::recovered::Start;
use super::tissue::{Creep, block, project};

/// What acts from outside, and what resists beside the tissue.
#[derive(Clone, Debug)]
pub struct Objective<'a> {
    /// Tissue, springs, attachments, masses.
    pub problem: &'a Problem,
    /// Anchors of the attachments [m].
    pub anchors: &'a [Vec3<f64>],
    /// Soft position constraints.
    pub tethers: &'a [Tether<f64>],
    /// Tools that touch it.
    pub contacts: Contacts<'a>,
    /// What pulls.
    pub load: Load,
}

/// Statics or a step.
#[derive(Clone, Debug)]
pub enum Load {
    /// Dead forces [N], shape [vertex_count].
    Forces(Vec<Vec3<f64>>),
    /// A step of implicit Euler.
    Inertia {
        /// [s].
        dt: f64,
        /// `xt` [m], shape [vertex_count].
        predicted: Vec<Vec3<f64>>,
        /// Green strain at the start, per point of the linear tetrahedra where tissue is viscous.
        creep: Vec<Option<Creep>>,
        /// The same of recovered-gradient tetrahedra.
        start: Start,
    },
}

/// `Phi`, and the size of the terms that add up to it: round-off is a share of the latter.
#[derive(Clone, Copy, Debug)]
pub struct Value {
    /// [J].
    pub sum: f64,
    /// [J].
    pub size: f64,
}

impl Value {
    /// Adds a term [J].
    pub fn add(&mut self, term: f64) {
        self.sum += term;
        self.size += term.abs();
    }
}

impl Objective<'_> {
    fn creep(&self, point: usize) -> Option<&Creep> {
        match &self.load {
            Load::Inertia { creep, .. } => creep.get(point).and_then(Option::as_ref),
            Load::Forces(_) => None,
        }
    }

    /// Recovered-gradient tetrahedra at the start of the step; without viscosity in statics.
    fn start(&self, viscous: bool) -> &Start {
        const REST: &Start = &Start::NONE;
        match &self.load {
            Load::Inertia { start, .. } if viscous => start,
            _ => REST,
        }
    }

    /// Attachments and tethers: vertex, stiffness [N/m] and anchor [m].
    fn anchored(&self) -> impl Iterator<Item = (u32, f64, Vec3<f64>)> {
        let attachments = self.problem.attachments.iter();
        attachments
            .map(|a| (a.vertex, a.stiffness, self.anchors[a.anchor as usize]))
            .chain(self.tethers.iter().map(|t| (t.vertex, t.stiffness, t.target)))
    }

    /// Elastic energy alone [J]: tissue without viscosity, springs, attachments, tethers.
    pub fn elastic_energy(&self, x: &[Vec3<f64>]) -> f64 {
        let mut value = Value { sum: 0.0, size: 0.0 };
        self.add_elastic(x, false, &mut value);
        value.sum
    }

    /// `Phi`.
    pub fn value(&self, x: &[Vec3<f64>]) -> Value {
        let mut value = Value { sum: 0.0, size: 0.0 };
        self.add_elastic(x, true, &mut value);
        self.contacts.add_energy(x, &mut value);
        match &self.load {
            Load::Forces(forces) => {
                for (v, force) in forces.iter().enumerate() {
                    value.add(-force.dot(x[v] - self.problem.rest_positions[v]));
                }
            }
            Load::Inertia { dt, predicted, .. } => {
                for (v, target) in predicted.iter().enumerate() {
                    let weight = 0.5 * self.problem.masses[v] / (dt * dt);
                    value.add(weight * (x[v] - *target).length_squared());
                }
            }
        }
        value
    }

    fn add_elastic(&self, x: &[Vec3<f64>], viscous: bool, value: &mut Value) {
        let problem = self.problem;
        let creep = |point| if viscous { self.creep(point) } else { None };
        add_energies(problem, &problem.linear, x, creep, value);
        add_energies(problem, &problem.quadratic, x, |_| None, value);
        problem.recovered.add_energy(x, self.start(viscous), value);
        for s in &problem.springs {
            let ends = s.ends.map(|v| x[v as usize]);
            value.add(spring::energy(&ends, s.rest_length, s.stiffness));
        }
        for (v, stiffness, anchor) in self.anchored() {
            value.add(0.5 * stiffness * (x[v as usize] - anchor).length_squared());
        }
    }

    /// Gradient of `Phi` [N], shape [vertex_count]; minus the unbalanced force, pinned or not.
    pub fn gradient(&self, x: &[Vec3<f64>]) -> Vec<Vec3<f64>> {
        let problem = self.problem;
        let mut gradient = vec![Vec3::ZERO; x.len()];
        add_gradients(problem, &problem.linear, x, |point| self.creep(point), &mut gradient);
        add_gradients(problem, &problem.quadratic, x, |_| None, &mut gradient);
        problem.recovered.add_gradient(x, self.start(true), &mut gradient);
        for s in &problem.springs {
            let ends = s.ends.map(|v| x[v as usize]);
            let forces = spring::forces(&ends, s.rest_length, s.stiffness);
            for (v, force) in s.ends.into_iter().zip(forces) {
                gradient[v as usize] += -force;
            }
        }
        for (v, stiffness, anchor) in self.anchored() {
            gradient[v as usize] += (x[v as usize] - anchor) * stiffness;
        }
        self.contacts.add_gradient(x, &mut gradient);
        match &self.load {
            Load::Forces(forces) => {
                for (g, force) in gradient.iter_mut().zip(forces) {
                    *g += -*force;
                }
            }
            Load::Inertia { dt, predicted, .. } => {
                for (v, target) in predicted.iter().enumerate() {
                    gradient[v] += (x[v] - *target) * (problem.masses[v] / (dt * dt));
                }
            }
        }
        gradient
    }

    /// Hessian of `Phi` [N/m] by the free vertices. `positive`: with the negative curvature of every
    /// quadrature point and spring left out.
    pub fn hessian(&self, x: &[Vec3<f64>], pattern: &Pattern, positive: bool) -> MatrixValues {
        let problem = self.problem;
        let mut matrix = MatrixValues::new(pattern);
        let creep = |point| self.creep(point);
        add_stiffness(problem, &problem.linear, x, creep, positive, pattern, &mut matrix);
        add_stiffness(problem, &problem.quadratic, x, |_| None, positive, pattern, &mut matrix);
        problem.recovered.add_hessian(x, self.start(true), positive, pattern, &mut matrix);
        for s in &problem.springs {
            let block = spring_block(s.ends.map(|v| x[v as usize]), s, positive);
            let [a, b] = s.ends;
            matrix.add(pattern, a, a, &block);
            matrix.add(pattern, b, b, &block);
            let across = block.map(|row| row.map(|entry| -entry));
            // One of the two lies below the diagonal; the other is left out by the pattern.
            matrix.add(pattern, a, b, &across);
            matrix.add(pattern, b, a, &across);
        }
        for (v, stiffness, _) in self.anchored() {
            matrix.add(pattern, v, v, &diagonal(stiffness));
        }
        self.contacts.add_hessian(x, positive, pattern, &mut matrix);
        if let Load::Inertia { dt, .. } = &self.load {
            for (v, mass) in problem.masses.iter().enumerate() {
                matrix.add(pattern, v as u32, v as u32, &diagonal(mass / (dt * dt)));
            }
        }
        matrix
    }
}

fn add_energies<'a, const N: usize>(
    problem: &Problem,
    elements: &TetElements<N>,
    x: &[Vec3<f64>],
    creep: impl Fn(usize) -> Option<&'a Creep>,
    value: &mut Value,
) {
    for (i, point) in elements.points.iter().enumerate() {
        let tissue = &problem.tissues[elements.tissue[elements.tet_of(i)] as usize];
        let f = elements.deformation_gradient(i, x);
        value.add(point.volume * tissue.energy_density(&f, creep(i)));
    }
}

fn add_gradients<'a, const N: usize>(
    problem: &Problem,
    elements: &TetElements<N>,
    x: &[Vec3<f64>],
    creep: impl Fn(usize) -> Option<&'a Creep>,
    gradient: &mut [Vec3<f64>],
) {
    for (i, point) in elements.points.iter().enumerate() {
        let tet = elements.tet_of(i);
        let tissue = &problem.tissues[elements.tissue[tet] as usize];
        let piola = tissue.piola(&elements.deformation_gradient(i, x), creep(i));
        for (&node, &g) in elements.nodes[tet].iter().zip(&point.gradients) {
            gradient[node as usize] += piola * g * point.volume;
        }
    }
}

fn add_stiffness<'a, const N: usize>(
    problem: &Problem,
    elements: &TetElements<N>,
    x: &[Vec3<f64>],
    creep: impl Fn(usize) -> Option<&'a Creep>,
    positive: bool,
    pattern: &Pattern,
    matrix: &mut MatrixValues,
) {
    for (i, point) in elements.points.iter().enumerate() {
        let tet = elements.tet_of(i);
        let tissue = &problem.tissues[elements.tissue[tet] as usize];
        let mut stiffness = tissue.stiffness(&elements.deformation_gradient(i, x), creep(i));
        if positive {
            project(&mut stiffness);
        }
        let nodes = &elements.nodes[tet];
        for (a, &gi) in point.gradients.iter().enumerate() {
            for (b, &gj) in point.gradients.iter().enumerate() {
                if pattern.holds(nodes[a], nodes[b]) {
                    let block = block(&stiffness, gi, gj).map(|row| row.map(|e| e * point.volume));
                    matrix.add(pattern, nodes[a], nodes[b], &block);
                }
            }
        }
    }
}

/// `k (n n^T + (1 - L/l) (I - n n^T))`.
fn spring_block(ends: [Vec3<f64>; 2], s: &super::problem::Spring, positive: bool) -> [[f64; 3]; 3] {
    let (n, length) = spring::direction(&ends);
    // Without a length there is no direction: the spring rests, as it does in the solver.
    if n == Vec3::ZERO {
        return [[0.0; 3]; 3];
    }
    let across = 1.0 - s.rest_length / length;
    let across = if positive { across.max(0.0) } else { across };
    let along = Mat3::outer(n, n);
    let block = (along + (Mat3::IDENTITY + along * -1.0) * across) * s.stiffness;
    block.columns.map(|column| column.to_array())
}

fn diagonal(value: f64) -> [[f64; 3]; 3] {
    [[value, 0.0, 0.0], [0.0, value, 0.0], [0.0, 0.0, value]]
}

/// Green strain at `x` with the resistance to leaving it in a step of `dt` [s]; nothing where tissue
/// is not viscous.
pub fn creep_at(problem: &Problem, x: &[Vec3<f64>], dt: f64) -> Vec<Option<Creep>> {
    if problem.tissues.iter().all(|tissue| tissue.viscosity == 0.0) {
        return Vec::new();
    }
    let elements = &problem.linear;
    let of_point = |point: usize| {
        let tissue = &problem.tissues[elements.tissue[elements.tet_of(point)] as usize];
        let rate = tissue.viscosity / dt;
        (rate > 0.0).then(|| Creep::new(&elements.deformation_gradient(point, x), rate))
    };
    (0..elements.points.len()).map(of_point).collect()
}
