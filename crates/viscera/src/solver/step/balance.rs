//! The force balance at the end of a step: how well the implicit-Euler equations hold.
//!
//! ```text
//! r_i = m_i (x_i - xt_i)/dt^2 - f_i(x)
//! ```
//!
//! `f` are the forces of all elements. On free vertices `r` is the solver's error as a force
//! [N]; on pinned ones it is what holds them: the force of the fixing or the tool on the tissue.

use super::data::{EndOfStep, OfRecovered, gather};
use super::recovered::Load;
use super::strain::is_recovered;
use super::tissue::Tissue;
use crate::elements::kinds::{Energy, Kind};
use crate::elements::law::{Law, with_law};
use crate::elements::{deformation_gradient, internal_forces, shape_gradients};
use crate::layout::{Before, ElementSet, Layout, Moments, TetSet};
use crate::material::MaterialModel;
use crate::model::for_each_kind;
use crate::scalar::lanes::{Eight, Instructions, Kernel, LANES, Lanes, Point, run};
use crate::scalar::{Mat3, Real, Scalar, Vec3, vec3};
use crate::solver::cpu::threads::Shared;
use crate::solver::inputs::Inputs;
use crate::state::State;

/// Forces and works of one step, in double precision.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ForceBalance {
    /// `r_i` [N], shape [vertex_count].
    pub residual: Vec<Vec3<f64>>,
    /// Sum of `|r_i|` [N] over free vertices.
    pub unbalanced: f64,
    /// Sum of the magnitudes of all loads [N]: weights, external forces, reactions of pins.
    pub load: f64,
    /// Elastic energy [J] of the tetrahedra.
    pub elastic_energy: f64,
    /// Work [J] of the residuals of free vertices through their displacements from rest, less the mean
    /// displacement of what is pinned: what is led away is not deformed by that.
    pub residual_work: f64,
    /// Energy [J] of strains that mean nothing, the sum of `E V eps^2`: a hundred-thousandth, or what rounding of
    /// positions makes.
    pub energy_floor: f64,
    /// Forces [N] of such strains, the sum of `E A eps`, and of inertia where positions are rounded.
    pub force_floor: f64,
    /// Forces [N] that rounding of positions alone makes.
    pub rounding: f64,
    /// Largest displacement of a free vertex from rest [m].
    pub displacement: f64,
}

/// Strain too small to be seen or felt.
const SMALLEST_STRAIN: f64 = 1e-5;

/// Positions are off by so many units of their precision.
const ROUNDED: f64 = 10.0;

impl ForceBalance {
    /// `unbalanced / load`; 0 where nothing acts. The forces of strains that mean nothing count as a load.
    pub fn relative_residual(&self) -> f64 {
        let load = self.load + self.force_floor;
        if load > 0.0 { self.unbalanced / load } else { 0.0 }
    }

    /// Residual work over twice the elastic energy: an estimate of how far the apparent stiffness
    /// is off. A linear body at rest has `u (K u - f)/(u K u)` here, which is `1 - s` where `u` is
    /// `1/s` times the solution: 0 for the solution, positive where the body has given way too
    /// much, negative where too little. Energy, not the work of the stresses, because that one
    /// means nothing after a turn. 0 where all strain means nothing, or all of that work is what rounding makes: of
    /// tissue that moves as a whole.
    pub fn stiffness_error(&self) -> f64 {
        let is_strained = self.elastic_energy > self.energy_floor;
        let is_work = self.residual_work.abs() > self.rounding * self.displacement;
        if is_strained && is_work { 0.5 * self.residual_work / self.elastic_energy } else { 0.0 }
    }

    /// Of the elements of one kind. What their forces sum to comes from outside.
    fn add_elements<S: Real, K: Kind<N, M>, const N: usize, const M: usize>(
        &mut self,
        set: &ElementSet<S, K, N, M>,
        state: &State<S>,
        moments: &Moments<'_, S>,
    ) {
        for (i, &vertices) in set.vertices.iter().enumerate() {
            let x = vertices.map(|v| state.positions[v as usize].cast::<f64>());
            let mut from_outside = Vec3::<f64>::ZERO;
            for (v, force) in vertices.into_iter().zip(set.element::<f64>(i, moments).forces(&x)) {
                self.residual[v as usize] -= force;
                from_outside += force;
            }
            self.load += from_outside.length();
        }
    }

    /// Of contact with tools.
    fn add_contacts<S: Real>(
        &mut self,
        layout: &Layout<S>,
        state: &State<S>,
        inputs: &Inputs<S>,
        step: &EndOfStep<'_, S>,
    ) {
        let place = |v: usize| state.positions[layout.numbering.order[v] as usize];
        for part in 0..layout.part_count() {
            step.contacts.each_at(layout, &inputs.tools, part, place, |sample, felt| {
                self.load += felt.force.length();
                for (&v, &weight) in sample.vertices.iter().zip(&sample.weights) {
                    let user = layout.numbering.order[v as usize] as usize;
                    self.residual[user] -= felt.force * weight;
                }
            });
        }
        step.contacts.pairs.each_force_at(place, |v, force| {
            self.residual[layout.numbering.order[v] as usize] -= force;
        });
    }

    /// Of recovered-gradient tetrahedra, in the precision of the state.
    fn add_recovered<S: Real>(
        &mut self,
        layout: &Layout<S>,
        state: &State<S>,
        step: &mut EndOfStep<'_, S>,
    ) {
        let EndOfStep { recovered: Some(recovered), start_strain, .. } = step else { return };
        let OfRecovered { workers, tets, points, loads } = recovered;
        let law = MaterialModel::StableNeoHookean as usize;
        let rate = S::from_f64(1.0 / state.multiplier_dt);
        let is_viscous = layout.tet_sets[law].viscous;
        let viscous = is_viscous.then(|| (Shared::new(&mut start_strain[law]), rate));
        let load = Load { scale: S::ONE, viscous, goes_on: false, at_rest: None };
        for (point, &user) in points.iter_mut().zip(&layout.numbering.order) {
            point.set_vec3(state.positions[user as usize]);
        }
        loads.fill(Point::default());
        for part in 0..layout.part_count() {
            tets.evaluate(workers, layout, part, points);
            self.elastic_energy += tets.energy(workers, layout, part);
            tets.add_forces(workers, layout, part, &load, loads);
        }
        for (place, &user) in layout.numbering.order.iter().enumerate() {
            let force = gather(layout, loads, place).vec3();
            self.residual[user as usize] -= force.cast::<f64>();
        }
    }

    pub(in crate::solver) fn measure<S: Real>(
        &mut self,
        layout: &Layout<S>,
        state: &State<S>,
        inputs: &Inputs<S>,
        step: &mut EndOfStep<'_, S>,
    ) {
        let dt = state.multiplier_dt;
        *self = Self { residual: std::mem::take(&mut self.residual), ..Self::default() };
        self.residual.clear();
        self.residual.resize(layout.vertex_count(), Vec3::ZERO);
        if dt <= 0.0 {
            return;
        }
        for (set, strains) in layout.tet_sets.iter().zip(&*step.start_strain) {
            let tets = Tets { layout, set, positions: &state.positions, strains, dt };
            let only_floors = is_recovered(layout, set);
            run(Instructions::detect(), OfTets { tets, balance: self, only_floors });
        }
        self.add_recovered(layout, state, step);
        let moments = Moments {
            anchors: inputs.anchors_of(&layout.rest_anchors),
            start: Before::Places(step.previous),
            dt,
        };
        for_each_kind!(layout, set => self.add_elements(set, state, &moments));
        for tether in step.tethers {
            let v = layout.numbering.order[tether.vertex];
            self.load += tether.force(state.positions[v as usize]).cast::<f64>().length();
        }
        self.add_contacts(layout, state, inputs, step);
        let gravity = inputs.gravity.cast::<f64>();
        for &(_, force) in &inputs.forces {
            self.load += force.cast::<f64>().length();
        }
        let displacement =
            |v: usize| state.positions[v].cast::<f64>() - layout.rest_positions[v].cast::<f64>();
        let pins = inputs.pins.iter().map(|pin| displacement(pin.vertex as usize));
        let led = pins.fold(Vec3::ZERO, |sum: Vec3<f64>, moved| sum + moved);
        let led = led * (1.0 / inputs.pins.len().max(1) as f64);
        for v in 0..layout.vertex_count() {
            let mass = layout.masses[v].to_f64();
            let x = state.positions[v].cast::<f64>();
            let place = layout.numbering.of(v as u32);
            let predicted = step.predicted[place].vec3().cast();
            let inertia = step.inertias[place].to_f64();
            self.residual[v] += (x - predicted) * (inertia / (dt * dt));
            self.force_floor += ROUNDED * S::EPSILON * x.length() * inertia / (dt * dt);
            let residual = self.residual[v];
            if step.inverse_masses[place] == S::ZERO {
                self.load += residual.length();
            } else {
                self.unbalanced += residual.length();
                self.load += mass * gravity.length();
                let moved = displacement(v) - led;
                self.residual_work += residual.dot(moved);
                self.displacement = self.displacement.max(moved.length());
            }
        }
    }
}

/// The tetrahedra of one law.
struct Tets<'a, S> {
    layout: &'a Layout<S>,
    set: &'a TetSet<S>,
    /// [m], in the user's numbering.
    positions: &'a [Vec3<S>],
    /// The Green strain at the start of the step, of viscous blocks.
    strains: &'a [[Eight<S>; 6]],
    dt: f64,
}

/// Adds what they do to a balance.
struct OfTets<'a, S> {
    tets: Tets<'a, S>,
    balance: &'a mut ForceBalance,
    /// Neither forces nor energies: what rounding makes of linear tetrahedra it makes of others as well.
    only_floors: bool,
}

impl<S: Real> Kernel<f64> for OfTets<'_, S> {
    #[inline(always)]
    fn run<L: Lanes<Real = f64>>(self) {
        let Self { tets, balance, only_floors } = self;
        for index in 0..tets.set.blocks.len() {
            let block = tets.block(index);
            let answers = with_law!(tets.set.model, W => block.answers::<S, L, W>());
            // One by one and in order: forces meet at vertices, and sums are the same bits for any number of lanes.
            for lane in 0..block.filled {
                balance.energy_floor += answers.floors[0][lane];
                balance.force_floor += answers.floors[1][lane];
                balance.rounding += answers.floors[2][lane];
                if only_floors {
                    continue;
                }
                balance.elastic_energy += answers.elastic_energy[lane];
                for corner in 0..4 {
                    let [x, y, z] = &answers.forces[corner];
                    let v = block.vertices[corner][lane] as usize;
                    balance.residual[v] -= vec3(x[lane], y[lane], z[lane]);
                }
            }
        }
    }
}

/// Eight tetrahedra in double precision.
struct WideBlock {
    /// The user's numbers of the corners.
    vertices: [Eight<u32>; 4],
    /// Positions [m] of the corners.
    x: [[Eight<f64>; 3]; 4],
    /// `Dm^-1` [1/m] by columns.
    shape: [[Eight<f64>; 3]; 3],
    volume: Eight<f64>,
    lame_lambda: Eight<f64>,
    lame_mu: Eight<f64>,
    viscosity_rate: Eight<f64>,
    /// The Green strain at the start of the step, where the block is viscous.
    start: Option<[Eight<f64>; 6]>,
    filled: usize,
}

/// What eight tetrahedra answer.
struct Answers {
    /// [J].
    elastic_energy: Eight<f64>,
    /// See [`Floors`].
    floors: [Eight<f64>; 3],
    /// Forces [N] on the corners.
    forces: [[Eight<f64>; 3]; 4],
}

impl<S: Real> Tets<'_, S> {
    #[inline(always)]
    fn block(&self, index: usize) -> WideBlock {
        let (set, constants) = (self.set, &self.set.blocks[index]);
        let none = [0.0; LANES];
        let mut block = WideBlock {
            vertices: [[0; LANES]; 4],
            x: [[none; 3]; 4],
            shape: [[none; 3]; 3],
            volume: none,
            lame_lambda: none,
            lame_mu: none,
            viscosity_rate: none,
            start: None,
            filled: set.filled[index] as usize,
        };
        for corner in 0..4 {
            for lane in 0..LANES {
                let v = self.layout.numbering.order[constants.vertices[corner][lane] as usize];
                let x = self.positions[v as usize];
                block.vertices[corner][lane] = v;
                block.x[corner][0][lane] = x.x.to_f64();
                block.x[corner][1][lane] = x.y.to_f64();
                block.x[corner][2][lane] = x.z.to_f64();
            }
        }
        for lane in 0..LANES {
            for entry in 0..9 {
                block.shape[entry / 3][entry % 3][lane] =
                    constants.inverse_rest_shape[entry][lane].to_f64();
            }
            let material = &self.layout.materials[constants.material[lane] as usize];
            block.volume[lane] = constants.rest_volume[lane].to_f64();
            block.lame_lambda[lane] = material.lame_lambda.to_f64();
            block.lame_mu[lane] = material.lame_mu.to_f64();
            block.viscosity_rate[lane] = material.viscosity.to_f64() / self.dt;
        }
        if set.is_viscous(index) {
            let mut start = [none; 6];
            for p in 0..6 {
                for lane in 0..LANES {
                    start[p][lane] = self.strains[index][p][lane].to_f64();
                }
            }
            block.start = Some(start);
        }
        block
    }
}

impl WideBlock {
    #[inline(always)]
    fn answers<S: Real, L: Lanes<Real = f64>, W: Law>(&self) -> Answers {
        let none = [0.0; LANES];
        let mut answers =
            Answers { elastic_energy: none, floors: [none; 3], forces: [[none; 3]; 4] };
        for lane in (0..self.filled).step_by(L::WIDTH) {
            let (mut x, mut shape) = ([Vec3::<L>::ZERO; 4], Mat3::<L>::ZERO);
            for corner in 0..4 {
                x[corner] = load(&self.x[corner], lane);
            }
            for column in 0..3 {
                shape.columns[column] = load(&self.shape[column], lane);
            }
            let volume = L::load(&self.volume, lane);
            let tissue = Tissue {
                model: W::MODEL,
                lame_lambda: L::load(&self.lame_lambda, lane),
                lame_mu: L::load(&self.lame_mu, lane),
                viscosity_rate: L::load(&self.viscosity_rate, lane),
            };
            let f = deformation_gradient(&x, &shape);
            let response = match &self.start {
                None => tissue.respond_by::<W>(&f, None),
                Some(strain) => {
                    let mut start = [L::ZERO; 6];
                    for p in 0..6 {
                        start[p] = L::load(&strain[p], lane);
                    }
                    tissue.respond_by::<W>(&f, Some(&start))
                }
            };
            (volume * response.elastic_energy).store(&mut answers.elastic_energy, lane);
            let floors = Floors::new(S::EPSILON, &x, &shape, volume, &tissue);
            floors.energy.store(&mut answers.floors[0], lane);
            floors.force.store(&mut answers.floors[1], lane);
            floors.rounding.store(&mut answers.floors[2], lane);
            let forces = internal_forces(&response.piola, &shape, volume);
            for corner in 0..4 {
                forces[corner].x.store(&mut answers.forces[corner][0], lane);
                forces[corner].y.store(&mut answers.forces[corner][1], lane);
                forces[corner].z.store(&mut answers.forces[corner][2], lane);
            }
        }
        answers
    }
}

#[inline(always)]
fn load<L: Lanes>([x, y, z]: &[Eight<L::Real>; 3], lane: usize) -> Vec3<L> {
    vec3(L::load(x, lane), L::load(y, lane), L::load(z, lane))
}

/// What strains that mean nothing make of a tetrahedron.
struct Floors<S> {
    /// [J].
    energy: S,
    /// [N].
    force: S,
    /// Of rounding of its corners to the precision alone [N].
    rounding: S,
}

impl<S: Scalar> Floors<S> {
    /// Rounding, by so much relatively, changes volumes as well, against the largest stiffness that tissue has.
    #[inline(always)]
    fn new(epsilon: f64, x: &[Vec3<S>; 4], shape: &Mat3<S>, volume: S, tissue: &Tissue<S>) -> Self {
        let slopes = shape_gradients(shape);
        let (mut reach, mut slope) = (S::ZERO, S::ZERO);
        for corner in 0..4 {
            reach = reach.max(x[corner].length_squared());
            slope = slope.max(slopes[corner].length_squared());
        }
        let (reach, slope) = (reach.sqrt(), slope.sqrt());
        let rounding = S::from_f64(epsilon) * reach * slope;
        let bulk = volume * (tissue.lame_lambda + S::TWO * tissue.lame_mu);
        let young = volume * S::from_f64(3.0) * tissue.lame_mu;
        let strain = S::from_f64(ROUNDED) * rounding;
        let smallest = S::from_f64(SMALLEST_STRAIN);
        Self {
            energy: bulk * strain * strain + young * smallest * smallest,
            force: slope * (bulk * strain + young * smallest),
            rounding: slope * bulk * rounding,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elements::law::ALL_LAWS;
    use crate::material::Material;
    use crate::mesh::shapes::beam;
    use crate::model::ModelBuilder;
    use crate::settings::SolverSettings;

    /// Viscous tissue and tissue that is not, of both laws, blocks that are not full.
    #[test]
    fn lanes_answer_as_one_tet_at_a_time_does() {
        let mesh = beam(0.1, 0.03, 0.03, 3, 0.0).expect("a bar");
        let mut builder = ModelBuilder::new();
        for (law, viscosity) in ALL_LAWS.into_iter().flat_map(|law| [(law, 0.0), (law, 0.02)]) {
            let tissue = Material::new(law, 8e3, 0.45, 1000.0).expect("a tissue");
            let tissue = tissue.with_viscosity(viscosity).expect("a viscosity");
            builder.add_body(&mesh, &tissue).expect("a body");
        }
        let model = builder.build::<f32>().expect("a model");
        let layout = Layout::new(&model, &SolverSettings::default());
        let noise = |k: usize| libm::sin(k as f64 * 78.233) * 1e-3;
        let moved = |(v, x): (usize, &Vec3<f32>)| {
            *x + vec3(noise(3 * v), noise(3 * v + 1), noise(3 * v + 2)).cast()
        };
        let positions: Vec<_> = model.rest_positions.iter().enumerate().map(moved).collect();
        let dt = 1e-3;
        let mut compared = 0;
        for set in &layout.tet_sets {
            let strains = vec![[[0.01f32; LANES]; 6]; set.block_count()];
            let balance_by = |instructions: Instructions| {
                let mut balance = ForceBalance {
                    residual: vec![Vec3::ZERO; layout.vertex_count()],
                    ..ForceBalance::default()
                };
                let tets =
                    Tets { layout: &layout, set, positions: &positions, strains: &strains, dt };
                run(instructions, OfTets { tets, balance: &mut balance, only_floors: false });
                balance
            };
            let balance = balance_by(Instructions::detect());
            assert_eq!(balance, balance_by(Instructions::Portable));
            let mut expected = vec![Vec3::<f64>::ZERO; layout.vertex_count()];
            let (mut elastic_energy, mut rounding) = (0.0, 0.0);
            for (tet, (block, _)) in layout.tets(set).zip(set.places()) {
                let x = tet.vertices.map(|v| positions[v as usize].cast::<f64>());
                let shape = tet.inverse_rest_shape.cast::<f64>();
                let volume = tet.rest_volume.to_f64();
                let material = &layout.materials[tet.material];
                let tissue = Tissue {
                    model: set.model,
                    lame_lambda: material.lame_lambda.to_f64(),
                    lame_mu: material.lame_mu.to_f64(),
                    viscosity_rate: material.viscosity.to_f64() / dt,
                };
                let start = set.is_viscous(block).then_some([f64::from(0.01f32); 6]);
                let response = tissue.respond(&deformation_gradient(&x, &shape), start.as_ref());
                elastic_energy += volume * response.elastic_energy;
                let longest =
                    |all: [Vec3<f64>; 4]| all.map(|x| x.length()).into_iter().fold(0.0, f64::max);
                let slope = longest(shape_gradients(&shape));
                let bulk = volume * (tissue.lame_lambda + 2.0 * tissue.lame_mu);
                rounding += slope * bulk * (f32::EPSILON as f64 * longest(x) * slope);
                let forces = internal_forces(&response.piola, &shape, volume);
                for (v, force) in tet.vertices.into_iter().zip(forces) {
                    expected[v as usize] -= force;
                }
                compared += 1;
            }
            assert_eq!(balance.residual, expected);
            assert_eq!((balance.elastic_energy, balance.rounding), (elastic_energy, rounding));
        }
        assert_eq!(compared, model.tet_count());
    }
}
