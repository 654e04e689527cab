//! Bytes and operations of a step by counting, without a device: what its dispatches cannot do without, and what they
//! move where every gather goes to memory.
//!
//! ```text
//! compulsory   every array that a dispatch must read or write, once
//! moved        the same as the kernel is written: an entry that several threads read counts once for each of them
//! time         max(bytes/bandwidth, dispatches x latency)
//! ```
//!
//! What kernels read and write stands in one table for each method, what there is of it in a model in `counts.rs`. Steps are
//! ordinary ones: nothing is rejected, and pairs are kept as many as there is room for.

mod counts;
mod dispatch;
mod explicit;
mod meetings;
mod quasi_newton;
mod step;
mod table;
mod values;
mod xpbd;

use super::buffers::{Buffers, Size};
use super::cost::DISPATCH;
use super::layout::DeviceLayout;
use super::record::{Dispatch, Recorder};
use super::slots::{multipliers_start, unknowns_size};
use super::stages::Record;
use crate::layout::Layout;
use crate::model::Model;
use crate::settings::SolverSettings;
use crate::solver::plan::Plan;
use crate::solver::quasi_newton::on_device::DeviceLevels;
use counts::Counts;
pub use dispatch::DispatchTraffic;
use dispatch::NOTHING;

/// The dispatches of a step, written down without a device.
pub(super) struct Recorded {
    pub plan: Plan,
    pub record: Record,
    on_device: DeviceLayout,
    levels: Option<(DeviceLevels, Vec<u32>)>,
}

impl Recorded {
    /// Of a model that lies as these settings ask for, which are those that are chosen on a device.
    pub fn new(layout: &Layout<f32>, settings: &SolverSettings) -> Self {
        let plan = Plan::on_device(layout, settings);
        let on_device = DeviceLayout::new(layout, settings);
        let levels = DeviceLevels::new(layout, settings);
        let first = (multipliers_start(layout.vertex_count()) / 4) as u32;
        let vector = [(unknowns_size(layout) / 4) as u32, first];
        let of_levels = levels.as_ref().map(|(levels, _)| levels);
        let pieces = on_device.pieces();
        let samples = on_device.samples;
        let recorder = Recorder::new(layout, settings, vector, pieces, of_levels, samples);
        Self { record: recorder.record(&plan), plan, on_device, levels }
    }
}

/// What a step of a model moves.
#[derive(Clone, Debug, PartialEq)]
pub struct Traffic {
    /// Once before the iterations, in each of them, and once after: as the device is sent them.
    pub dispatches: [Vec<DispatchTraffic>; 3],
    /// Iterations of a step, or small steps.
    pub passes: u32,
    /// Name and bytes of every array.
    pub memory: Vec<(&'static str, u64)>,
    tets: u64,
}

impl Traffic {
    /// Of a step of a model with so many small steps, which count for the explicit method alone.
    pub fn new(model: &Model<f32>, settings: &SolverSettings, small_steps: u32) -> Self {
        let settings = &settings.chosen_on_device();
        let layout = Layout::on_device(model, settings);
        let Recorded { plan, record, on_device, levels } = Recorded::new(&layout, settings);
        let of_levels = levels.as_ref().map(|(levels, words)| (levels, words.as_slice()));
        let counts = Counts::new(&layout, settings, &on_device, of_levels);
        let of = |list: &Vec<Dispatch>| list.iter().map(|d| counts.traffic(d)).collect();
        let table = on_device.table(&layout, settings);
        let sizes = Buffers::sizes(&layout, settings, &on_device, of_levels.map(|l| l.0), &table);
        Self {
            dispatches: [&record.prologue, &record.body, &record.epilogue].map(of),
            passes: plan.passes(small_steps),
            memory: sizes.into_iter().map(|Size { what, bytes, .. }| (what, bytes)).collect(),
            tets: model.tet_count() as u64,
        }
    }

    /// Each dispatch of a step, and how often it is sent.
    pub fn of_step(&self) -> impl Iterator<Item = (&DispatchTraffic, u32)> {
        let times = [1, self.passes, 1];
        let lists = self.dispatches.iter().zip(times);
        lists.flat_map(|(list, times)| list.iter().map(move |dispatch| (dispatch, times)))
    }

    /// Dispatches of a step.
    pub fn dispatch_count(&self) -> u64 {
        self.of_step().map(|(_, times)| u64::from(times)).sum()
    }

    /// Sums over a step.
    pub fn step(&self) -> DispatchTraffic {
        self.sum(self.of_step())
    }

    /// Sums over one iteration, or small step.
    pub fn pass(&self) -> DispatchTraffic {
        self.sum(self.dispatches[1].iter().map(|dispatch| (dispatch, 1)))
    }

    /// Sums over a step, kernel by kernel, in the order in which they are first sent; and how many dispatches they are.
    pub fn by_kernel(&self) -> Vec<(DispatchTraffic, u64)> {
        let mut all: Vec<(DispatchTraffic, u64)> = Vec::new();
        for (dispatch, times) in self.of_step() {
            let kernel = dispatch.kernel;
            let place = all.iter().position(|(known, _)| known.kernel == kernel);
            let place = place.unwrap_or_else(|| {
                all.push((DispatchTraffic { kernel, most: dispatch.most, ..NOTHING }, 0));
                all.len() - 1
            });
            all[place].0.add(dispatch, times);
            all[place].1 += u64::from(times);
        }
        all
    }

    fn sum<'a>(&self, all: impl Iterator<Item = (&'a DispatchTraffic, u32)>) -> DispatchTraffic {
        all.fold(NOTHING, |mut sum, (dispatch, times)| {
            sum.add(dispatch, times);
            sum
        })
    }

    /// The shortest time [s] of a step where memory moves so many bytes in a second: of its compulsory bytes, or of
    /// dispatches that wait for one another, [`Traffic::LATENCY`] each.
    pub fn roofline(&self, bytes_per_second: f64) -> f64 {
        let waiting = self.dispatch_count() as f64 * Self::LATENCY;
        (self.step().compulsory / bytes_per_second).max(waiting)
    }

    /// What a dispatch takes at least that waits for the one before it [s].
    pub const LATENCY: f64 = DISPATCH;

    /// Bytes of all arrays over the tetrahedra.
    pub fn bytes_per_tet(&self) -> f64 {
        let bytes: u64 = self.memory.iter().map(|(_, bytes)| bytes).sum();
        bytes as f64 / self.tets as f64
    }

    /// About how many tetrahedra of meshes like this one fit where no array is larger than a binding [B] may be.
    pub fn largest_mesh(&self, binding: u64) -> u64 {
        let largest = self.memory.iter().map(|(_, bytes)| *bytes).max().unwrap_or(1);
        (self.tets as f64 * binding as f64 / largest as f64) as u64
    }
}

#[cfg(test)]
mod tests;
