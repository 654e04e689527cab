//! Estimates the time of a step on the CPU and on a graphics processor, before there is a device.
//!
//! ```text
//! CPU   tetrahedra x passes x 40 ns of XPBD, 20 ns of the quasi-Newton method, 6 ns of the explicit one
//! GPU   dispatches x 4 us
//! ```

use super::layout::Pieces;
use super::record::Recorder;
use crate::layout::Layout;
use crate::settings::{Method, SolverSettings};
use crate::solver::plan::{Plan, QuasiNewtonStage};
use crate::solver::quasi_newton::on_device::DeviceLevels;
use crate::solver::step::contacts::on_device::Samples;

/// A tetrahedron's share of a pass on the CPU [s]. Of a sweep of XPBD: between 27 ns without and 57 ns with rebase and
/// guards, in single precision, one thread, ten thousand tetrahedra (docs/peers.md); of the others see
/// [`pass_per_tet`]. Several threads need less, from 16,000 tetrahedra on. Too large, and small meshes go to a GPU that only
/// waits; too small, and a GPU is left idle.
const TET_AND_SWEEP: f64 = 40e-9;

/// A dispatch that must wait for the one before it [s]. Taken from what is commonly seen, 2 to 5 us; an H100 took 7 us
/// (docs/gpu.md). That a dispatch over many tetrahedra takes longer is left out: where that matters, the CPU is slower by
/// far.
pub(super) const DISPATCH: f64 = 4e-6;

/// As [`TET_AND_SWEEP`], of a pass of each method: an iteration of the quasi-Newton method took half as long as a sweep of
/// XPBD's defaults in the same bench (ten thousand tetrahedra, one thread), a small step of the explicit one a seventh.
fn pass_per_tet(method: Method) -> f64 {
    match method {
        Method::Xpbd => TET_AND_SWEEP,
        Method::Auto | Method::QuasiNewton => 20e-9,
        Method::Explicit => 6e-9,
    }
}

/// Estimates for one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepCost {
    /// Passes over the mesh: sweeps, small steps of the explicit method, iterations of all solves of the quasi-Newton
    /// method.
    pub passes: u32,
    /// Dispatches.
    pub dispatches: u64,
    /// On the CPU [s].
    pub cpu: f64,
    /// On a graphics processor [s].
    pub gpu: f64,
    pass_per_tet: f64,
}

impl StepCost {
    /// Of a model that is solved in this way, with so many small steps, which count for the explicit method alone.
    pub fn new(layout: &Layout<f32>, settings: &SolverSettings, small_steps: u32) -> Self {
        let settings = &settings.chosen_on_device();
        let plan = Plan::on_device(layout, settings);
        let levels = DeviceLevels::new(layout, settings).map(|(levels, _)| levels);
        // How many dispatches there are depends neither on the length of the long vector nor on the number of pieces.
        let pieces = Pieces { count: 2, first_of_vertices: 1, groups: 1 };
        let samples = Samples::new(layout);
        let recorder = Recorder::new(layout, settings, [0; 2], pieces, levels.as_ref(), samples);
        let record = recorder.record(&plan);
        let [prologue, body, epilogue] =
            [record.prologue, record.body, record.epilogue].map(|list| list.len() as u64);
        let repeats = plan.passes(small_steps);
        let dispatches = prologue + u64::from(repeats) * body + epilogue;
        // Of the quasi-Newton method the first solve alone is the iteration; others are unrolled behind it.
        let is_pass = |stage: &&_| **stage == QuasiNewtonStage::Evaluate.into();
        let unrolled = plan.split().epilogue.iter().filter(is_pass).count() as u32;
        let (passes, pass_per_tet) = (repeats + unrolled, pass_per_tet(settings.method));
        let cpu = layout.tet_count() as f64 * f64::from(passes) * pass_per_tet;
        let gpu = dispatches as f64 * DISPATCH;
        Self { passes, dispatches, cpu, gpu, pass_per_tet }
    }

    /// Whether a graphics processor is expected to be faster.
    pub fn gpu_pays(&self) -> bool {
        self.gpu < self.cpu
    }

    /// Tetrahedra from which on it is, were all else the same.
    pub fn pays_from(&self) -> u64 {
        (self.gpu / (f64::from(self.passes) * self.pass_per_tet)).ceil() as u64
    }
}
