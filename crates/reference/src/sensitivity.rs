//! How a state of rest changes with the constants of a model: exact derivatives, by one factor of the Hessian.
//!
//! ```text
//! g(x(p), p) = 0 on free vertices   =>   H dx/dp = -dg/dp                      tangent, one solve a number
//! L(x(p))                           =>   dL/dp = -lambda . dg/dp,  H lambda = dL/dx     adjoint, one solve a function
//! r = g on pinned vertices          =>   dr/dp = dg/dp + K dx/dp               forces that hold
//! ```
//!
//! Griewank, Walther, "Evaluating Derivatives", 2nd ed. 2008, chapter 15. All constants enter the gradient `g` linearly, so that
//! `dg/dp` is `g` itself with every constant's derivative in its place. Contact counts with the samples that touch at `x`;
//! where one begins or ends to touch, the force has no jump, and its derivative has one.

use viscera::layout::Smoothing;
use viscera::model::{MaterialConstants, Model};
use viscera::scalar::Vec3;
use viscera::settings::Elements;
use viscera::solver::Inputs;

use super::contact::Contacts;
use super::matrix::{FactorError, Factorization, MatrixValues, Pattern};
use super::objective::Load;
use super::problem::Problem;
use super::{Reference, ReferenceError, dead_loads, objective};

/// Derivatives of the constants of a model by one number `p`.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Of Lame's parameters of each material [Pa per unit of `p`].
    pub lame: Vec<[f64; 2]>,
    /// Of each vertex's mass [kg per unit].
    pub masses: Vec<f64>,
    /// Of the stiffness of attachments [N/m per unit].
    pub attachments: Vec<f64>,
    /// Of what contact at each sample is proportional to [Pa/m per unit].
    pub samples: Vec<f64>,
}

/// How the constants of a model depend on a number of its scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dependence {
    /// They are linear in it.
    Linear,
    /// As on Poisson's ratio.
    Poisson,
}

impl Dependence {
    /// On the number at a key of a scene; nothing where states of rest have no derivative by it.
    pub fn of_key(key: &str) -> Option<Self> {
        let steps: Vec<&str> = key.split('.').collect();
        match steps[..] {
            // The table of a region is that of its material.
            ["body", _, "material", last] | ["body", _, "region", _, last] => match last {
                "young" | "density" => Some(Self::Linear),
                "poisson" => Some(Self::Poisson),
                _ => None,
            },
            ["fixing", _, "stiffness"] => Some(Self::Linear),
            _ => None,
        }
    }

    /// A legal value beside one, for the second model of [`Dependence::change`].
    pub fn other(self, value: f64) -> f64 {
        match self {
            // Twice as much rounds nothing.
            Self::Linear => 2.0 * value,
            Self::Poisson => {
                if value > 0.2 {
                    0.1
                } else {
                    0.3
                }
            }
        }
    }

    /// The change of a model, from one with the other value.
    pub fn change(self, model: &Model<f64>, other: &Model<f64>, value: f64) -> Change {
        match self {
            Self::Linear => Change::linear(model, other, self.other(value) - value),
            Self::Poisson => Change::poisson(model, other),
        }
    }
}

impl Change {
    /// By a number that all constants are linear in, such as Young's modulus, density or a fixing's stiffness: from two models
    /// that differ in it alone, by `step`.
    pub fn linear(model: &Model<f64>, other: &Model<f64>, step: f64) -> Self {
        let share = 1.0 / step;
        let pairs = model.materials.iter().zip(&other.materials);
        let lame = pairs.map(|(a, b)| {
            [(b.lame_lambda - a.lame_lambda) * share, (b.lame_mu - a.lame_mu) * share]
        });
        let stiffness = |model: &Model<f64>| {
            let list = &model.elements.attachments;
            (0..list.vertices.len()).map(|i| list.stiffness(i)).collect::<Vec<_>>()
        };
        let samples = |model: &Model<f64>| {
            model.samples.iter().map(|sample| model.sample_stiffness(sample)).collect::<Vec<_>>()
        };
        let slope = |a: Vec<f64>, b: Vec<f64>| {
            a.iter().zip(&b).map(|(a, b)| (b - a) * share).collect::<Vec<_>>()
        };
        Self {
            lame: lame.collect(),
            masses: slope(model.masses.clone(), other.masses.clone()),
            attachments: slope(stiffness(model), stiffness(other)),
            samples: slope(samples(model), samples(other)),
        }
    }

    /// By Poisson's ratio, of the materials that differ in another model, which differs in it alone. With `E` held:
    /// `dlambda/dnu = E (1 + 2 nu^2)/((1 + nu)(1 - 2 nu))^2`, `dmu/dnu = -E/(2 (1 + nu)^2)`.
    pub fn poisson(model: &Model<f64>, other: &Model<f64>) -> Self {
        let of_material = |(a, b): (&MaterialConstants<f64>, &MaterialConstants<f64>)| {
            if (a.lame_lambda, a.lame_mu) == (b.lame_lambda, b.lame_mu) {
                return [0.0; 2];
            }
            let (lambda, mu) = (a.lame_lambda, a.lame_mu);
            let nu = 0.5 * lambda / (lambda + mu);
            let young = 2.0 * mu * (1.0 + nu);
            let below = (1.0 + nu) * (1.0 - 2.0 * nu);
            [
                young * (1.0 + 2.0 * nu * nu) / (below * below),
                -0.5 * young / ((1.0 + nu) * (1.0 + nu)),
            ]
        };
        Self {
            lame: model.materials.iter().zip(&other.materials).map(of_material).collect(),
            masses: vec![0.0; model.vertex_count()],
            attachments: vec![0.0; model.elements.attachments.vertices.len()],
            samples: vec![0.0; model.samples.len()],
        }
    }
}

impl Problem {
    /// The same problem with the derivative of every constant in its place; `elements` as it was made with.
    fn along(&self, model: &Model<f64>, elements: Elements, change: &Change) -> Self {
        let mut along = self.clone();
        let laws = change.lame.iter().cycle();
        for (tissue, [lambda, mu]) in along.tissues.iter_mut().zip(laws) {
            (tissue.lame_lambda, tissue.lame_mu) = (*lambda, *mu);
        }
        if elements == Elements::Recovered {
            along.recovered = self.recovered.along(model, Smoothing::RECOVERED, &change.lame);
        }
        along.masses.clone_from(&change.masses);
        along.springs.iter_mut().for_each(|spring| spring.stiffness = 0.0);
        for (attachment, stiffness) in along.attachments.iter_mut().zip(&change.attachments) {
            attachment.stiffness = *stiffness;
        }
        for (sample, stiffness) in along.samples.iter_mut().zip(&change.samples) {
            sample.stiffness = *stiffness;
        }
        along
    }
}

/// A state of rest with the factor of its Hessian.
pub struct Linearized<'a> {
    reference: &'a Reference,
    x: &'a [Vec3<f64>],
    inputs: &'a Inputs<f64>,
    pinned: Vec<bool>,
    /// Of free vertices.
    pattern: Pattern,
    factorization: Factorization,
    /// Of all vertices: what moves also changes forces on what is pinned.
    all: Pattern,
    stiffness: MatrixValues,
}

/// What one number changes in a state of rest, per unit of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Tangent {
    /// Positions [m per unit], zero where pinned.
    pub positions: Vec<Vec3<f64>>,
    /// Forces by which pinned vertices are held [N per unit], zero on free ones.
    pub holding: Vec<Vec3<f64>>,
    /// Forces on each of the tools [N per unit].
    pub tools: Vec<Vec3<f64>>,
}

impl Reference {
    /// `dg/dp` [N per unit] at `x`, shape [vertex_count]: how a number changes the gradient where nothing moves. `model` and
    /// `elements` are those that the reference was made of.
    pub fn slope(
        &self,
        (model, elements): (&Model<f64>, Elements),
        (x, inputs): (&[Vec3<f64>], &Inputs<f64>),
        change: &Change,
    ) -> Vec<Vec3<f64>> {
        let problem = self.problem.along(model, elements, change);
        // What does not depend on constants has no derivative by them.
        let inputs = Inputs { tethers: Vec::new(), forces: Vec::new(), ..inputs.clone() };
        let load = Load::Forces(dead_loads(&problem, &inputs));
        objective(&problem, &inputs, load).gradient(x)
    }

    /// Prepares derivatives at a state of rest. Fails where that is no stable one.
    pub fn linearize<'a>(
        &'a self,
        x: &'a [Vec3<f64>],
        inputs: &'a Inputs<f64>,
    ) -> Result<Linearized<'a>, ReferenceError> {
        let pinned = self.check_held(x, inputs)?;
        let pattern = Pattern::new(&self.problem, &pinned);
        let all = Pattern::new(&self.problem, &vec![false; pinned.len()]);
        let unknowns = pattern.unknowns();
        let too_large =
            |bytes: u64| ReferenceError::TooLarge { unknowns, bytes, limit: self.memory };
        let mut factorization = Factorization::new(&pattern).map_err(|_| too_large(u64::MAX))?;
        let cost = factorization.cost(&pattern, &self.problem);
        if cost.bytes > self.memory {
            return Err(too_large(cost.bytes));
        }
        let load = Load::Forces(Vec::new());
        let objective = objective(&self.problem, inputs, load);
        let hessian = objective.hessian(x, &pattern, false);
        factorization.factorize(&pattern, &hessian).map_err(|error| match error {
            FactorError::TooLarge => too_large(cost.bytes),
            FactorError::Indefinite | FactorError::Stopped => ReferenceError::Unstable,
        })?;
        let stiffness = objective.hessian(x, &all, false);
        Ok(Linearized {
            reference: self,
            x,
            inputs,
            pinned,
            pattern,
            factorization,
            all,
            stiffness,
        })
    }
}

impl Linearized<'_> {
    /// `dx/dp` and what follows from it, from `dg/dp` ([`Reference::slope`]).
    pub fn tangent(&mut self, slope: &[Vec3<f64>], change: &Change) -> Tangent {
        let mut positions = self.factorization.solve(&self.pattern, slope);
        positions.iter_mut().for_each(|moved| *moved = -*moved);
        let mut holding = self.stiffness.multiply(&self.all, &positions);
        for ((force, slope), pinned) in holding.iter_mut().zip(slope).zip(&self.pinned) {
            *force = if *pinned { *force + *slope } else { Vec3::ZERO };
        }
        let tools = self.on_tools(&positions, change);
        Tangent { positions, holding, tools }
    }

    /// Forces on tools where positions change and contact stiffens.
    fn on_tools(&self, moved: &[Vec3<f64>], change: &Change) -> Vec<Vec3<f64>> {
        let samples = &self.reference.problem.samples;
        let mut forces = vec![Vec3::ZERO; self.inputs.tools.len()];
        for felt in Contacts::new(samples, &self.inputs.tools, &[]).felt(self.x) {
            let sample = &samples[felt.sample as usize];
            // Forces are proportional to the sample's stiffness.
            let stiffens = change.samples[felt.sample as usize] / sample.stiffness;
            forces[felt.tool as usize] +=
                felt.contact * sample.place(moved) + felt.gradient * stiffens;
        }
        forces
    }

    /// `lambda` [m/N times the function's unit]: the answer to `dL/dx` [unit/m], shape [vertex_count]; what the function says of
    /// pinned vertices counts for nothing. Then `dL/dp = -lambda . dg/dp` for every number.
    pub fn adjoint(&mut self, by_positions: &[Vec3<f64>]) -> Vec<Vec3<f64>> {
        self.factorization.solve(&self.pattern, by_positions)
    }
}
