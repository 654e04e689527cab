//! Estimates the time of a step on the CPU and on a graphics processor, before there is a device.
//!
//! ```text
//! CPU   tetrahedra x sweeps x 40 ns
//! GPU   dispatches x 4 us
//! ```

use super::layout::Pieces;
use super::record::Recorder;
use crate::layout::Layout;
use crate::settings::SolverSettings;
use crate::solver::plan::Plan;

/// A tetrahedron's share of a sweep on the CPU [s]: between 27 ns without and 57 ns with rebase and
/// guards, in single precision, one thread, ten thousand tetrahedra (docs/peers.md). Several threads
/// need less, from 16,000 tetrahedra on. Too large, and small meshes go to a GPU that only waits; too
/// small, and a GPU is left idle.
const TET_AND_SWEEP: f64 = 40e-9;

/// A dispatch that must wait for the one before it [s]. Taken from what is commonly seen, 2 to 5 us; no
/// device was measured for it. That a dispatch over many tetrahedra takes longer is left out: where that
/// matters, the CPU is slower by far.
const DISPATCH: f64 = 4e-6;

/// Estimates for one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepCost {
    /// Sweeps, or small steps of an explicit method.
    pub sweeps: u32,
    /// Dispatches.
    pub dispatches: u64,
    /// On the CPU [s].
    pub cpu: f64,
    /// On a graphics processor [s].
    pub gpu: f64,
}

impl StepCost {
    /// Of a model that is solved in this way, with so many sweeps.
    pub fn new(layout: &Layout<f32>, settings: &SolverSettings, sweeps: u32) -> Self {
        let settings = &settings.chosen_on_device();
        // How many dispatches there are does not depend on the length of the long vector.
        let plan = Plan::new(layout, settings);
        let pieces = Pieces { count: 1, first_of_vertices: 0, groups: 1 };
        let record = Recorder::new(layout, settings, [0; 2], pieces, None).record(&plan);
        let [prologue, body, epilogue] =
            [record.prologue, record.body, record.epilogue].map(|list| list.len() as u64);
        let dispatches = prologue + u64::from(sweeps) * body + epilogue;
        let cpu = layout.tet_count() as f64 * f64::from(sweeps) * TET_AND_SWEEP;
        Self { sweeps, dispatches, cpu, gpu: dispatches as f64 * DISPATCH }
    }

    /// Whether a graphics processor is expected to be faster.
    pub fn gpu_pays(&self) -> bool {
        self.gpu < self.cpu
    }

    /// Tetrahedra from which on it is, were all else the same.
    pub fn pays_from(&self) -> u64 {
        (self.gpu / (f64::from(self.sweeps) * TET_AND_SWEEP)).ceil() as u64
    }
}
