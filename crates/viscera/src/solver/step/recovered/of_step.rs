//! What the methods ask of recovered-gradient tetrahedra in a step.
#![allow(unsafe_code)]

#[cfg(feature = "gpu")]
use super::RecoveredTets;
use super::{Along, Found, Load, Since};
#[cfg(feature = "gpu")]
use crate::layout::{Layout, RecoveredTables};
use crate::material::MaterialModel;
use crate::scalar::Real;
use crate::scalar::lanes::{Eight, Point};
use crate::solver::cpu::threads::Shared;
#[cfg(feature = "gpu")]
use crate::solver::cpu::threads::Workers;
#[cfg(feature = "gpu")]
use crate::solver::step::data::{OfRecovered, StartStrain};
use crate::solver::step::data::{Step, StepConstants};

/// The law that they have, by its number.
const NEO_HOOKEAN: usize = MaterialModel::StableNeoHookean as usize;

/// Adds `h^2` times the forces of those of a part, and the bound of their stiffness where `at_rest` has what of it does not
/// depend on the shape. Viscosity acts against the change of strain since the start, which is `x` from now on where it
/// `goes_on`. Returns whether one is inside out.
pub fn load_recovered<S: Real>(
    constants: &mut StepConstants<S>,
    step: &Step<'_, S>,
    number: usize,
    x: &[Point<S>],
    (goes_on, at_rest): (bool, Option<&[Eight<S>]>),
    loads: &mut [Point<S>],
) -> bool {
    let StepConstants { workers, recovered: Some(tets), start_strain, .. } = constants else {
        return false;
    };
    let inverted = tets.evaluate(workers, step.layout, number, x);
    let is_viscous = step.layout.tet_sets[NEO_HOOKEAN].viscous;
    let strains = Shared::new(&mut start_strain[NEO_HOOKEAN]);
    let viscous = is_viscous.then_some((strains, S::from_f64(1.0 / step.dt)));
    let load = Load { scale: S::from_f64(step.dt * step.dt), viscous, goes_on, at_rest };
    tets.add_forces(workers, step.layout, number, &load, loads);
    inverted
}

/// Those of a part along displacements, from where they were evaluated.
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

/// Recovered-gradient tetrahedra that are measured where a device has left them.
#[cfg(feature = "gpu")]
pub struct MeasuredTets {
    workers: Workers,
    tets: RecoveredTets<f32>,
    points: Vec<Point<f32>>,
    loads: Vec<Point<f32>>,
}

#[cfg(feature = "gpu")]
impl MeasuredTets {
    /// Where tissue is viscous, its strains at the start of the solve, `start` [m], take their places.
    pub fn new(
        layout: &Layout<f32>,
        tables: &RecoveredTables<f32>,
        start: &[Point<f32>],
        start_strain: &mut StartStrain<f32>,
    ) -> Self {
        let workers = Workers::one();
        let mut tets = RecoveredTets::new(layout, tables);
        if !start.is_empty() && layout.tet_sets[NEO_HOOKEAN].viscous {
            for number in 0..layout.part_count() {
                tets.evaluate(&workers, layout, number, start);
                tets.put_strains(&workers, layout, number, 0.0, &mut start_strain[NEO_HOOKEAN]);
            }
        }
        let points = vec![Point::default(); layout.vertex_count()];
        Self { workers, tets, points, loads: vec![Point::default(); layout.copy_count()] }
    }

    /// For measures.
    pub fn of_step(&mut self) -> OfRecovered<'_, f32> {
        let Self { workers, tets, points, loads } = self;
        OfRecovered { workers, tets, points, loads }
    }
}
