//! Recovered-gradient tetrahedra in a solve: viscosity acts against the strain at its start, which stays.
#![allow(unsafe_code)]

use crate::material::MaterialModel;
use crate::scalar::Real;
use crate::scalar::lanes::Point;
use crate::solver::cpu::threads::Shared;
use crate::solver::step::data::{Step, StepConstants};
use crate::solver::step::recovered::{Along, Found, Load, Since};

/// The law that recovered-gradient tetrahedra have, by its number.
const NEO_HOOKEAN: usize = MaterialModel::StableNeoHookean as usize;

/// Adds `he^2` times the forces of a part's recovered-gradient tetrahedra.
pub fn load_recovered<S: Real>(
    constants: &mut StepConstants<S>,
    step: &Step<'_, S>,
    number: usize,
    x: &[Point<S>],
    loads: &mut [Point<S>],
) {
    let StepConstants { workers, recovered: Some(tets), start_strain, .. } = constants else {
        return;
    };
    tets.evaluate(workers, step.layout, number, x);
    let is_viscous = step.layout.tet_sets[NEO_HOOKEAN].viscous;
    let strains = Shared::new(&mut start_strain[NEO_HOOKEAN]);
    let load = Load {
        scale: S::from_f64(step.dt * step.dt),
        viscous: is_viscous.then_some((strains, S::from_f64(1.0 / step.dt))),
        goes_on: false,
        at_rest: None,
    };
    tets.add_forces(workers, step.layout, number, &load, loads);
}

/// Of a part's recovered-gradient tetrahedra along displacements, from where they were evaluated.
pub fn along_recovered<S: Real>(
    constants: &StepConstants<S>,
    step: &Step<'_, S>,
    number: usize,
    along: &mut Along<S>,
    found: Found,
) -> [f64; 2] {
    let StepConstants { workers, recovered: Some(tets), start_strain, .. } = constants else {
        return [0.0; 2];
    };
    let since = Since { strains: &start_strain[NEO_HOOKEAN], dt: step.dt };
    tets.along(workers, step.layout, number, (along, found), since)
}
