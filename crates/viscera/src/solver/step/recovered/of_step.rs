//! What the methods ask of recovered-gradient tetrahedra in a step.
#![allow(unsafe_code)]

#[cfg(feature = "gpu")]
use super::RecoveredTets;
use super::{Along, Found, Load, Since};
#[cfg(feature = "gpu")]
use crate::layout::{Layout, TetSet};
use crate::material::MaterialModel;
use crate::scalar::Real;
#[cfg(feature = "gpu")]
use crate::scalar::lanes::LANES;
use crate::scalar::lanes::{Eight, Point};
use crate::solver::cpu::threads::Shared;
#[cfg(feature = "gpu")]
use crate::solver::cpu::threads::Workers;
#[cfg(feature = "gpu")]
use crate::solver::step::data::{OfRecovered, StartStrain};
use crate::solver::step::data::{Step, StepConstants};
#[cfg(feature = "gpu")]
use crate::solver::step::strain::put_strains_of;

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

/// Tetrahedra that are measured where a device has left them.
#[cfg(feature = "gpu")]
pub struct MeasuredTets {
    workers: Workers,
    tets: Option<RecoveredTets<f32>>,
    points: Vec<Point<f32>>,
    loads: Vec<Point<f32>>,
    /// What viscosity acts against.
    pub start_strain: StartStrain<f32>,
}

#[cfg(feature = "gpu")]
impl MeasuredTets {
    /// Takes the memory; without any strain.
    pub fn new(layout: &Layout<f32>) -> Self {
        let strains = |set: &TetSet<f32>| {
            vec![[[0.0; LANES]; 6]; if set.viscous { set.block_count() } else { 0 }]
        };
        let has_them = usize::from(layout.recovered.is_some());
        Self {
            workers: Workers::one(),
            tets: layout.recovered.as_ref().map(|tables| RecoveredTets::new(layout, tables)),
            points: vec![Point::default(); has_them * layout.vertex_count()],
            loads: vec![Point::default(); has_them * layout.copy_count()],
            start_strain: layout.tet_sets.each_ref().map(strains),
        }
    }

    /// The strains of a part at some places [m], of which a share of the change since then is left.
    pub fn put_strains(
        &mut self,
        layout: &Layout<f32>,
        number: usize,
        x: &[Point<f32>],
        share: f32,
    ) {
        let Self { workers, tets, start_strain, .. } = self;
        put_strains_of(workers, layout, (number, tets.as_mut()), x, share, start_strain);
    }

    /// For measures: what recovered-gradient ones work with, and the strains.
    pub fn of_step(&mut self) -> (Option<OfRecovered<'_, f32>>, &mut StartStrain<f32>) {
        let Self { workers, tets, points, loads, start_strain } = self;
        let workers = &*workers;
        (tets.as_mut().map(|tets| OfRecovered { workers, tets, points, loads }), start_strain)
    }
}
