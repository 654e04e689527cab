//! Bytes and operations of a step by counting, and the times that follow from them: no device is needed for it.

use super::measurement::Bench;
use super::solvers::SolverEntry;
use super::subjects::Subject;
use serde::Serialize;

/// Bandwidths [B/s] that times are told for: a laptop's, a card's for games, a data centre's.
pub const BANDWIDTHS: [f64; 3] = [100e9, 500e9, 4000e9];

/// A kernel of a step, all its dispatches together.
#[derive(Clone, Debug, Serialize)]
pub struct KernelLine {
    pub kernel: &'static str,
    pub dispatches: u64,
    pub compulsory_bytes: f64,
    pub written_bytes: f64,
    pub moved_bytes: f64,
    pub operations: f64,
    /// The array that it moves most of.
    pub most: Option<String>,
}

/// The shortest time of a step.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Roofline {
    pub bytes_per_second: f64,
    pub seconds: f64,
}

/// What a step moves.
#[derive(Clone, Debug, Serialize)]
pub struct TrafficReport {
    pub mesh: String,
    pub tets: usize,
    pub solver: &'static str,
    /// Iterations of a solve, or small steps, and how many solves a step has.
    pub passes: u32,
    pub solves: u32,
    /// Steps that the times are of: those of a frame, where one is asked for.
    pub steps: u32,
    pub dispatches: u64,
    pub compulsory_bytes: f64,
    pub moved_bytes: f64,
    pub operations: f64,
    /// Of one pass.
    pub pass_compulsory_bytes: f64,
    pub pass_moved_bytes: f64,
    pub bytes_per_tet: f64,
    /// Tetrahedra of meshes like this one in WebGPU's baseline of 128 MiB per binding, and the array that fills it first.
    pub largest_mesh: u64,
    pub largest_array: &'static str,
    /// Of a dispatch that waits for the one before it.
    pub latency_seconds: f64,
    pub rooflines: Vec<Roofline>,
    pub kernels: Vec<KernelLine>,
}

impl TrafficReport {
    /// Compulsory bytes of what a measurement tells of the quasi-Newton method: a pass of each of its solves, or a step.
    pub fn of_unit(&self, entry: &SolverEntry) -> Option<f64> {
        let is_counted = entry.name.starts_with("quasi-newton");
        let of_passes = f64::from(self.solves) * self.pass_compulsory_bytes;
        let bytes = if entry.sweeps.is_some() { of_passes } else { self.compulsory_bytes };
        is_counted.then_some(bytes)
    }

    /// Whether it is of the same steps of the same mesh.
    pub fn is_alike(&self, other: &Self) -> bool {
        let of = |t: &Self| (t.solver, t.passes, t.steps, t.dispatches);
        self.mesh == other.mesh && self.tets == other.tets && of(self) == of(other)
    }

    /// The shortest time [s] of all steps.
    pub fn seconds_at(&self, bytes_per_second: f64) -> f64 {
        let waiting = self.dispatches as f64 * self.latency_seconds;
        f64::from(self.steps) * (self.compulsory_bytes / bytes_per_second).max(waiting)
    }
}

/// Of a case; nothing where the build has no backend for devices.
#[cfg(feature = "gpu")]
pub fn report(subject: &Subject<'_>, bench: &Bench<'_>, small_steps: u32) -> Option<TrafficReport> {
    use viscera::settings::Count;
    use viscera::solver::gpu::Traffic;

    const BASELINE: u64 = 128 << 20;
    let entry = bench.entry;
    let mut settings = entry.settings();
    if let Some([sweeps, _]) = entry.sweeps {
        settings.iterations = Count::Of(sweeps);
    }
    let traffic = Traffic::new(&bench.model, &settings, small_steps);
    let (step, pass) = (traffic.step(), traffic.pass());
    let line = |(of, dispatches): (viscera::solver::gpu::DispatchTraffic, u64)| KernelLine {
        kernel: of.kernel,
        dispatches,
        compulsory_bytes: of.compulsory,
        written_bytes: of.written,
        moved_bytes: of.moved,
        operations: of.operations,
        most: of.most.map(|slot| format!("{slot:?}")),
    };
    let kernels: Vec<KernelLine> = traffic.by_kernel().into_iter().map(line).collect();
    let evaluations = kernels.iter().find(|line| line.kernel == "evaluate_elements");
    let evaluations = evaluations.map_or(traffic.passes, |line| line.dispatches as u32);
    let largest = traffic.memory.iter().max_by_key(|(_, bytes)| *bytes);
    let mut report = TrafficReport {
        mesh: subject.name().to_owned(),
        tets: bench.model.tet_count(),
        solver: entry.name,
        passes: traffic.passes,
        solves: evaluations / traffic.passes.max(1),
        steps: bench.steps,
        dispatches: traffic.dispatch_count(),
        compulsory_bytes: step.compulsory,
        moved_bytes: step.moved,
        operations: step.operations,
        pass_compulsory_bytes: pass.compulsory,
        pass_moved_bytes: pass.moved,
        bytes_per_tet: traffic.bytes_per_tet(),
        largest_mesh: traffic.largest_mesh(BASELINE),
        largest_array: largest.map_or("", |(what, _)| what),
        latency_seconds: Traffic::LATENCY,
        rooflines: Vec::new(),
        kernels,
    };
    let roofline = |bytes_per_second| Roofline {
        bytes_per_second,
        seconds: report.seconds_at(bytes_per_second),
    };
    report.rooflines = BANDWIDTHS.map(roofline).to_vec();
    Some(report)
}

/// As above.
#[cfg(not(feature = "gpu"))]
pub fn report(_: &Subject<'_>, _: &Bench<'_>, _: u32) -> Option<TrafficReport> {
    None
}
