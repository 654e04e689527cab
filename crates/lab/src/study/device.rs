//! The same by the GPU backend, where there is an adapter: the first one, which may be a software driver.

use anyhow::Result;
use std::sync::OnceLock;
use viscera::scalar::{Real, Vec3};
use viscera::settings::{Count, SolverSettings};
use viscera::solver::gpu::{Adapter, Device, GpuSolver};

use super::step::MeasuredStep;

/// The device; one for all sections, because it keeps what it has compiled.
pub fn device() -> Option<&'static Device> {
    static DEVICE: OnceLock<Option<Device>> = OnceLock::new();
    DEVICE.get_or_init(|| Adapter::find(None).and_then(|adapter| adapter.open()).ok()).as_ref()
}

/// What a report says of the device, or of the lack of one.
pub fn describe() -> String {
    match device() {
        Some(device) => format!("GPU backend on {}", device.name()),
        None => {
            "There is no graphics adapter here: curves of the GPU backend are left out. On Linux \
                 the package mesa-vulkan-drivers brings one in software."
                .to_owned()
        }
    }
}

/// Where device and CPU are in single precision after so many iterations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceSample {
    pub iterations: u32,
    /// Distances from the exact end: the device, then the CPU.
    pub errors: [f64; 2],
    /// Distances from the CPU in double precision: the device, then the CPU.
    pub rounding: [f64; 2],
}

/// Dispatches that all iterations up to a sample may take: a software driver is slow.
const MOST_DISPATCHES: usize = 6000;

/// Iterations after which the device is asked where it stands: every sample is a run of its own.
fn counts(settings: &SolverSettings, passes: usize) -> impl Iterator<Item = u32> {
    let most = settings.iterations().min((MOST_DISPATCHES / passes.max(1)) as u32);
    let decades = (0..6).flat_map(|decade| [1, 2, 5].map(|k| k * 10u32.pow(decade)));
    decades.take_while(move |k| *k <= most)
}

/// As [`MeasuredStep::follow`], by the device, where one iteration is so many passes.
pub fn follow(
    device: &Device,
    step: &MeasuredStep,
    settings: &SolverSettings,
    passes: usize,
) -> Result<Vec<DeviceSample>> {
    let counts: Vec<u32> = counts(settings, passes).collect();
    let most = counts.last().copied().unwrap_or(1);
    // Iterates are compared as they are, before a guard judges the end of the step.
    let settings =
        SolverSettings { iterations: Count::Of(most), step_guard: false, ..settings.clone() };
    let (double, single) =
        (iterates::<f64>(step, &settings, &counts)?, iterates::<f32>(step, &settings, &counts)?);
    let model = step.load_case.model::<f32>()?;
    let (_, start) = step.begin::<f32>(&model, &settings)?;
    let mut solver = GpuSolver::new(device, &model, &settings)?;
    let mut state = start.clone();
    let mut found = Vec::with_capacity(counts.len());
    for ((&iterations, double), single) in counts.iter().zip(&double).zip(&single) {
        solver.set_iterations(iterations);
        solver.write(&model, &start)?;
        solver.step(&model, &step.inputs(), step.dt)?;
        solver.read(&model, &mut state)?;
        let places: Vec<Vec3<f64>> = state.positions.iter().map(|x| x.cast()).collect();
        found.push(DeviceSample {
            iterations,
            errors: [step.error(&places), step.error(single)],
            rounding: [step.distance(&places, double), step.distance(single, double)],
        });
    }
    Ok(found)
}

/// Where the CPU has the vertices [m] after so many iterations each.
fn iterates<S: Real>(
    step: &MeasuredStep,
    settings: &SolverSettings,
    counts: &[u32],
) -> Result<Vec<Vec<Vec3<f64>>>> {
    let model = step.load_case.model::<S>()?;
    let (mut solver, mut state) = step.begin(&model, settings)?;
    let mut seen = Vec::with_capacity(counts.len());
    solver.step_watched(&model, &mut state, &step.inputs(), step.dt, |iteration, x| {
        if counts.contains(&iteration) {
            seen.push(x.to_vec());
        }
    })?;
    Ok(seen)
}

/// As [`MeasuredStep::end`].
pub fn end(
    device: &Device,
    step: &MeasuredStep,
    settings: &SolverSettings,
) -> Result<Vec<Vec3<f64>>> {
    let model = step.load_case.model::<f32>()?;
    let (_, mut state) = step.begin::<f32>(&model, settings)?;
    let mut solver = GpuSolver::new(device, &model, settings)?;
    solver.write(&model, &state)?;
    for (inputs, dt) in step.substeps(settings.substeps()) {
        solver.step(&model, &inputs, dt)?;
    }
    solver.read(&model, &mut state)?;
    Ok(state.positions.iter().map(|x| x.cast()).collect())
}
