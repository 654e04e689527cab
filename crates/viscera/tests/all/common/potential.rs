//! What a guarded step must not raise, computed outside of the solver, in double precision and from the mesh: the
//! incremental potential and the mechanical energy of one stable neo-Hookean body.
//!
//! ```text
//! Phi(x) = sum_i m_i |x_i - xt_i|^2/(2 dt^2) + sum_e V_e W(F_e),  xt = x_n + dt v_n + dt^2 g,  pinned: no inertia
//! W = mu/2 (|F|^2 - 3) + lh/2 (J - a)^2 - lh/2 (1 - a)^2,  lh = lambda + mu,  a = 1 + mu/lh
//! ```

use crate::common::single_body;
use viscera::layout::{Domains, Smoothing};
use viscera::material::Material;
use viscera::mesh::{TetMesh, edge_matrix, tet_volume};
use viscera::model::Model;
use viscera::scalar::{Mat3, Real, Vec3};
use viscera::solver::Inputs;
use viscera::solver::recovered::Recovered;
use viscera::state::State;

/// A value [J], and what rounding of positions to a precision can make of it, to first order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rounded {
    pub value: f64,
    pub noise: f64,
}

impl Rounded {
    /// Above the other by more than both may be off; what is no number counts.
    pub fn is_above(self, other: Self) -> bool {
        let most = other.value + other.noise + self.noise;
        !matches!(
            self.value.partial_cmp(&most),
            Some(std::cmp::Ordering::Less | std::cmp::Ordering::Equal)
        )
    }
}

/// One body and what it is made of.
pub struct Outside<'a> {
    mesh: &'a TetMesh,
    masses: Vec<f64>,
    lambda: f64,
    mu: f64,
    /// Of the precision that positions are stored in.
    epsilon: f64,
    /// Where its tetrahedra are recovered-gradient ones.
    recovered: Option<(Model<f64>, Domains<f64>)>,
}

impl<'a> Outside<'a> {
    /// Masses [kg] are a fourth of each tetrahedron's.
    pub fn new<S: Real>(mesh: &'a TetMesh, young: f64, poisson: f64, density: f64) -> Self {
        let mut masses = vec![0.0; mesh.vertices().len()];
        for (t, tet) in mesh.tets().iter().enumerate() {
            let quarter = 0.25 * density * tet_volume(mesh.corners(t));
            tet.iter().for_each(|&v| masses[v as usize] += quarter);
        }
        let lambda = young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson));
        let (mu, recovered) = (young / (2.0 * (1.0 + poisson)), None);
        Self { mesh, masses, lambda, mu, epsilon: S::EPSILON, recovered }
    }

    /// The same body of recovered-gradient tetrahedra: of this material.
    pub fn of_recovered(self, tissue: &Material) -> Self {
        let model = single_body(self.mesh, tissue);
        let domains = Domains::new(&model, Smoothing::RECOVERED);
        Self { recovered: Some((model, domains)), ..self }
    }

    /// By the definition, one tetrahedron at a time.
    fn recovered_energy(&self, model: &Model<f64>, of: &Domains<f64>, x: &[Vec3<f64>]) -> Rounded {
        let mut truth = Recovered::new(of);
        truth.evaluate(of, &model.materials, x);
        let mut gradient = vec![Vec3::ZERO; x.len()];
        truth.add_gradient(of, &model.materials, &mut gradient);
        let rounded = gradient.iter().zip(x).map(|(g, x)| g.length() * self.epsilon * x.length());
        Rounded { value: truth.energy(of, &model.materials), noise: rounded.sum() }
    }

    fn elastic(&self, x: &[Vec3<f64>]) -> Rounded {
        if let Some((model, domains)) = &self.recovered {
            return self.recovered_energy(model, domains, x);
        }
        let (mu, lh) = (self.mu, self.lambda + self.mu);
        let a = 1.0 + mu / lh;
        let (mut value, mut noise) = (0.0, 0.0);
        for (t, tet) in self.mesh.tets().iter().enumerate() {
            let corners = self.mesh.corners(t);
            let inverse = edge_matrix(corners).inverse();
            let places = tet.map(|v| x[v as usize]);
            let f: Mat3<f64> = edge_matrix(places) * inverse;
            let (j, volume) = (f.determinant(), tet_volume(corners));
            let square = f.norm_squared();
            let density =
                0.5 * mu * (square - 3.0) + 0.5 * lh * ((j - a).powi(2) - (1.0 - a).powi(2));
            let stress = f * mu + f.cofactor() * (lh * (j - a));
            let reach = places.iter().map(|x| x.length()).fold(0.0, f64::max);
            value += volume * density;
            // Twice: at both ends of an edge.
            let strain = 2.0 * self.epsilon * reach * inverse.norm_squared().sqrt();
            noise += volume * stress.norm_squared().sqrt() * strain;
        }
        Rounded { value, noise }
    }

    /// `Phi` of a step of `dt` [s] from `before`: at the better of two places it could have started from, where it
    /// was and where inertia leads, pins moved in both; and at its end.
    pub fn incremental<S: Real>(
        &self,
        before: &State<S>,
        after: &State<S>,
        inputs: &Inputs<S>,
        dt: f64,
    ) -> [Rounded; 2] {
        let double = |all: &[Vec3<S>]| all.iter().map(|x| x.cast()).collect::<Vec<Vec3<f64>>>();
        let [from, end, velocities] =
            [&before.positions, &after.positions, &before.velocities].map(|all| double(all));
        let fall = inputs.gravity.cast::<f64>() * (dt * dt);
        let predicted: Vec<_> =
            from.iter().zip(&velocities).map(|(x, v)| *x + *v * dt + fall).collect();
        let mut is_pinned = vec![false; from.len()];
        let mut starts = [from, predicted.clone()];
        for pin in &inputs.pins {
            is_pinned[pin.vertex as usize] = true;
            starts.iter_mut().for_each(|x| x[pin.vertex as usize] = pin.target.cast());
        }
        let phi = |x: &[Vec3<f64>]| {
            let Rounded { mut value, mut noise } = self.elastic(x);
            for v in (0..x.len()).filter(|&v| !is_pinned[v]) {
                let away = x[v] - predicted[v];
                let stiffness = self.masses[v] / (dt * dt);
                value += 0.5 * stiffness * away.length_squared();
                noise += stiffness * away.length() * 2.0 * self.epsilon * x[v].length();
            }
            Rounded { value, noise }
        };
        let [here, there] = starts.map(|x| phi(&x));
        [if there.value < here.value { there } else { here }, phi(&end)]
    }

    /// Kinetic and elastic energy, where no load acts; velocities are differences of positions over `dt` [s].
    pub fn mechanical<S: Real>(&self, state: &State<S>, dt: f64) -> Rounded {
        let x: Vec<Vec3<f64>> = state.positions.iter().map(|x| x.cast()).collect();
        let Rounded { mut value, mut noise } = self.elastic(&x);
        for ((v, x), mass) in state.velocities.iter().zip(&x).zip(&self.masses) {
            let v = v.cast::<f64>();
            value += 0.5 * mass * v.length_squared();
            noise += mass * v.length() * 2.0 * self.epsilon * x.length() / dt;
        }
        Rounded { value, noise }
    }
}
