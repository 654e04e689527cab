//! Steps of descent of the guards, from `x_s`, part by part.
//!
//! ```text
//! d_i = -grad_i Phi / (m_i + sum curvature),   x += a d,   a = 1, 0.4, 0.16, ..
//! until Phi(x + a d) <= Phi(x) + 1e-4 a grad Phi . d      (Armijo 1966)
//! ```
//!
//! A whole step divides the gradient by inertia and a bound of each vertex's own curvature, as if neighbours stood still.
//! Where they move together it overshoots, and is shortened.

use super::contacts::Bound;
use super::data::{Step, StepData, gather};
use super::gradient::load_forces;
use super::guard::Guard;
use crate::layout::Layout;
use crate::scalar::lanes::Point;
use crate::scalar::{Real, Vec3};

/// Of the decrease that the slope promises, a step along a line must deliver this share (Armijo).
pub const SUFFICIENT: f64 = 1e-4;

/// One that overshoots is shortened by this factor,
pub const SHORTEN: f64 = 0.4;

/// a descent at most so many times.
pub const SHORTENINGS: usize = 12;

impl<S: Real> Guard<S> {
    /// Lets a part's group begin its descent at `x_s`: finds the forces there.
    pub fn start_descent(&mut self, step: &Step<'_, S>, data: &mut StepData<S>, part: usize) {
        for part in data.constants.groups.of(part) {
            let vertices = step.layout.parts[part].vertices.clone();
            self.trial[vertices.clone()].copy_from_slice(&self.start[vertices]);
        }
        self.load_forces(step, data, part);
    }

    /// [`super::stage::GuardStage::TryLengths`].
    pub fn try_lengths(&mut self, after_shares: bool, step: &Step<'_, S>, data: &mut StepData<S>) {
        for part in 0..step.layout.part_count() {
            let guard = &mut self.parts[part];
            if after_shares {
                guard.descends = u32::from(guard.was_rejected != 0 && guard.share == 0.0);
            }
        }
        for part in 0..step.layout.part_count() {
            if self.parts[part].descends != 0 && data.constants.groups.leads(part) {
                self.search(step, data, part);
            }
        }
    }

    /// [`super::stage::GuardStage::TakeLength`].
    pub fn take_length(&mut self, step: &Step<'_, S>, data: &mut StepData<S>) {
        for (number, part) in step.layout.parts.iter().enumerate() {
            if self.parts[number].descends != 0 {
                let vertices = part.vertices.clone();
                self.trial[vertices.clone()].copy_from_slice(&data.points[vertices]);
            }
        }
        for number in 0..step.layout.part_count() {
            if self.parts[number].descends != 0 && data.constants.groups.leads(number) {
                self.load_forces(step, data, number);
            }
        }
    }

    /// Forces and curvature of each copy where the descent of a part's group is. Evaluations do not touch them, so that the
    /// direction is the same at every length.
    fn load_forces(&self, step: &Step<'_, S>, data: &mut StepData<S>, part: usize) {
        let StepData { constants, loads, .. } = data;
        let moments = constants.moments(step);
        for part in constants.groups.of(part) {
            load_forces::<S, true>(constants, step, &moments, part, &self.trial, loads);
        }
        for part in constants.groups.of(part) {
            let contact = step.contact();
            constants.contacts.add_pair_forces(&contact, part, &self.trial, Bound::Here, loads);
        }
    }

    /// Moves a part's group to the first length that brings enough, or leaves it where the line starts. `x_K`, which is given up
    /// by now, makes room for the places that are tried.
    fn search(&mut self, step: &Step<'_, S>, data: &mut StepData<S>, part: usize) {
        let (x, members) = (&self.trial, data.constants.groups.range(part));
        let before = self.evaluator.evaluate(&data.constants, step, x, part).value;
        let mut length = 1.0;
        for _ in 0..SHORTENINGS {
            // One pass finds slope and places; the slope [J s^2] is negative unless the gradient vanishes.
            let mut slope = 0.0;
            for place in members.clone() {
                let part = data.constants.groups.member(place);
                for v in step.layout.parts[part].vertices.clone() {
                    let (gradient, direction) = descent(step.layout, data, x, v);
                    slope += gradient.dot(direction).to_f64();
                    data.points[v].set_vec3(x[v].vec3() + direction * S::from_f64(length));
                }
            }
            let after = self.evaluator.evaluate(&data.constants, step, &data.points, part).value;
            // A potential that is NaN compares as false: the step is shortened, as after an overshoot. There is no
            // allowance for noise: where rounding hides the decrease, `x` stays, which is never above the limit.
            if after <= before + SUFFICIENT * length * slope {
                return;
            }
            length *= SHORTEN;
        }
        for place in members {
            let part = data.constants.groups.member(place);
            for v in step.layout.parts[part].vertices.clone() {
                data.points[v].set_vec3(x[v].vec3());
            }
        }
    }
}

/// Gradient of `Phi` by one vertex and the direction of descent; zero for a pinned one.
fn descent<S: Real>(
    layout: &Layout<S>,
    data: &StepData<S>,
    x: &[Point<S>],
    v: usize,
) -> (Vec3<S>, Vec3<S>) {
    let StepData { constants, loads, .. } = data;
    if constants.inverse_masses[v] == S::ZERO {
        return (Vec3::ZERO, Vec3::ZERO);
    }
    let load = gather(layout, loads, v);
    let mass = constants.inertias[v];
    let gradient = (x[v].vec3() - constants.predicted[v].vec3()) * mass - load.vec3();
    (gradient, gradient * (-S::ONE / (mass + load.w)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Material, MaterialModel};
    use crate::mesh::TetMesh;
    use crate::model::ModelBuilder;
    use crate::settings::SolverSettings;
    use crate::solver::Inputs;
    use crate::solver::cpu::Memory;
    use crate::solver::probe::{begun, quiet};

    /// A tetrahedron that has swollen. Its corners go back together, which the bounds, one vertex at a time,
    /// know nothing of: in long steps, where inertia is small, a whole step of descent overshoots.
    fn swollen(settings: &SolverSettings) -> (Layout<f64>, Vec<Vec3<f64>>) {
        let corners = [[1.0; 3], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0], [-1.0, -1.0, 1.0]];
        let rest = corners.map(|x| Vec3::from_f64(x) * 0.01).to_vec();
        let mesh = TetMesh::new(rest, vec![[0, 1, 2, 3]], vec![0]).expect("a tetrahedron").0;
        let law = MaterialModel::StableNeoHookean;
        let tissue = Material::new(law, 1e4, 0.45, 1000.0).expect("legal");
        let mut builder = ModelBuilder::new();
        builder.add_body(&mesh, &tissue).expect("a body");
        let places = mesh.vertices().iter().map(|x| *x * 1.02).collect();
        (Layout::new(&builder.build().expect("a model"), settings), places)
    }

    /// Before a descent: places, the places of a whole step of it, `Phi` at both, and the slope.
    struct Descent {
        before: Vec<Point<f64>>,
        whole: Vec<Point<f64>>,
        values: [f64; 2],
        slope: f64,
    }

    fn whole_descent(memory: &mut Memory<f64>, step: &Step<'_, f64>) -> Descent {
        let data = &mut memory.data;
        let before = data.points.clone();
        let moments = data.constants.moments(step);
        load_forces::<_, true>(&data.constants, step, &moments, 0, &before, &mut data.loads);
        let (mut whole, mut slope) = (before.clone(), 0.0);
        for v in 0..before.len() {
            let (gradient, direction) = descent(step.layout, data, &before, v);
            slope += gradient.dot(direction);
            whole[v].set_vec3(before[v].vec3() + direction);
        }
        let evaluator = &mut memory.guard.as_mut().expect("guarded steps").evaluator;
        let values =
            [&before, &whole].map(|x| evaluator.evaluate(&data.constants, step, x, 0).value);
        Descent { before, whole, values, slope }
    }

    /// Armijo's condition decides where `Phi` changes by less than 1e-4 of what the slope promises.
    #[test]
    fn a_descent_delivers_its_share_of_what_the_slope_promises() {
        let (settings, inputs) = (SolverSettings::xpbd(), Inputs::default());
        let (model, places) = swollen(&settings);
        // What a whole step changes, of what its slope promises: -1/2 in short steps.
        let change = |dt: f64| {
            let step = quiet(&model, &inputs, &settings, dt);
            let Descent { values, slope, .. } = whole_descent(&mut begun(&step, &places), &step);
            (values[1] - values[0]) / slope.abs()
        };
        for (wanted, is_enough) in [(-2e-4, true), (-0.5e-4, false), (0.5e-4, false)] {
            let (mut short, mut long) = (1e-5, 1.0);
            assert!(change(short) < wanted && wanted < change(long));
            for _ in 0..60 {
                let middle = 0.5 * (short + long);
                if change(middle) < wanted { short = middle } else { long = middle }
            }
            assert!((change(short) - wanted).abs() < 1e-6);
            let step = quiet(&model, &inputs, &settings, short);
            let mut memory = begun(&step, &places);
            let Descent { before, whole, values, slope } = whole_descent(&mut memory, &step);
            let Memory { data, guard, .. } = &mut memory;
            let guard = guard.as_mut().expect("guarded steps");
            guard.start.clone_from(&before);
            guard.start_descent(&step, data, 0);
            guard.parts[0].descends = 1;
            guard.try_lengths(false, &step, data);
            let x = data.points.clone();
            let is_whole = x.iter().zip(&whole).all(|(a, b)| a.vec3() == b.vec3());
            assert_eq!(is_whole, is_enough, "{wanted}");
            // How far it went, and what that delivers.
            let [gone, far] = [&x, &whole].map(|x| (x[0].vec3() - before[0].vec3()).length());
            let after = guard.evaluator.evaluate(&data.constants, &step, &x, 0).value;
            assert!(gone > 0.0 && after - values[0] <= 1e-4 * (gone / far) * slope, "{wanted}");
        }
    }
}
