//! The force balance at the end of a step: how well the implicit-Euler equations hold.
//!
//! ```text
//! r_i = m_i (x_i - xt_i)/dt^2 - f_i(x)
//! ```
//!
//! `f` are the forces of all elements. On free vertices `r` is the solver's error as a force
//! [N]; on pinned ones it is what holds them: the force of the fixing or the tool on the tissue.

use super::data::EndOfStep;
use super::tissue::Tissue;
use crate::elements::kinds::{Energy, Kind};
use crate::elements::{deformation_gradient, internal_forces, shape_gradients};
use crate::layout::Layout;
use crate::layout::{Before, ElementSet, Moments};
use crate::model::for_each_kind;
use crate::scalar::{Mat3, Real, Vec3};
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

    pub(in crate::solver) fn measure<S: Real>(
        &mut self,
        layout: &Layout<S>,
        state: &State<S>,
        inputs: &Inputs<S>,
        step: &EndOfStep<'_, S>,
    ) {
        let dt = state.multiplier_dt;
        *self = Self { residual: std::mem::take(&mut self.residual), ..Self::default() };
        self.residual.clear();
        self.residual.resize(layout.vertex_count(), Vec3::ZERO);
        if dt <= 0.0 {
            return;
        }
        for (set, strains) in layout.tet_sets.iter().zip(step.start_strain) {
            for (tet, (block, lane)) in layout.tets(set).zip(set.places()) {
                let x = tet.vertices.map(|v| state.positions[v as usize].cast::<f64>());
                let shape = tet.inverse_rest_shape.cast::<f64>();
                let volume = tet.rest_volume.to_f64();
                let material = &layout.materials[tet.material];
                let start = set.is_viscous(block).then(|| strains[block].map(|c| c[lane].to_f64()));
                let tissue = Tissue {
                    model: set.model,
                    lame_lambda: material.lame_lambda.to_f64(),
                    lame_mu: material.lame_mu.to_f64(),
                    viscosity_rate: material.viscosity.to_f64() / dt,
                };
                let f = deformation_gradient(&x, &shape);
                let response = tissue.respond(&f, start.as_ref());
                self.elastic_energy += volume * response.elastic_energy;
                let floors = Floors::new::<S>(&x, &shape, volume, &tissue);
                self.energy_floor += floors.energy;
                self.force_floor += floors.force;
                self.rounding += floors.rounding;
                let forces = internal_forces(&response.piola, &shape, volume);
                for (v, force) in tet.vertices.into_iter().zip(forces) {
                    self.residual[v as usize] -= force;
                }
            }
        }
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

/// What strains that mean nothing make of a tetrahedron.
struct Floors {
    /// [J].
    energy: f64,
    /// [N].
    force: f64,
    /// Of rounding of its corners to the precision alone [N].
    rounding: f64,
}

impl Floors {
    /// Rounding changes volumes as well, against the largest stiffness that tissue has.
    fn new<S: Real>(
        x: &[Vec3<f64>; 4],
        shape: &Mat3<f64>,
        volume: f64,
        tissue: &Tissue<f64>,
    ) -> Self {
        let reach = x.iter().fold(0.0, |reach: f64, x| reach.max(x.length()));
        let slopes = shape_gradients(shape).map(|g| g.length());
        let slope = slopes.into_iter().fold(0.0, f64::max);
        let rounding = S::EPSILON * reach * slope;
        let bulk = volume * (tissue.lame_lambda + 2.0 * tissue.lame_mu);
        let young = volume * 3.0 * tissue.lame_mu;
        let strain = ROUNDED * rounding;
        Self {
            energy: bulk * strain * strain + young * SMALLEST_STRAIN * SMALLEST_STRAIN,
            force: slope * (bulk * strain + young * SMALLEST_STRAIN),
            rounding: slope * bulk * rounding,
        }
    }
}
