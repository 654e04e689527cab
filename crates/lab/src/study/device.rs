//! The same by the GPU backend, where there is an adapter: the first one, which may be a software driver.

use anyhow::Result;
use std::sync::OnceLock;
use viscera::scalar::Vec3;
use viscera::settings::SolverSettings;
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

/// Iterations after which the device is asked where it stands: every look is a run of its own.
pub fn looks(most: u32) -> Vec<u32> {
    let steps = [1, 2, 5].into_iter();
    let decades = (0..6).flat_map(|decade| steps.clone().map(move |k| k * 10u32.pow(decade)));
    decades.take_while(|k| *k <= most).collect()
}

/// As [`MeasuredStep::follow`], after the iterations given: `[iterations, error]`.
pub fn follow(
    device: &Device,
    step: &MeasuredStep,
    settings: &SolverSettings,
    looks: &[u32],
) -> Result<Vec<[f64; 2]>> {
    let model = step.scene.model::<f32>(settings)?;
    let (_, start) = step.begin::<f32>(&model, settings)?;
    let mut solver = GpuSolver::new(device, &model, settings)?;
    let mut state = start.clone();
    let mut points = Vec::with_capacity(looks.len());
    for &count in looks {
        solver.set_iterations(count);
        solver.write(&model, &start)?;
        solver.step(&model, &step.inputs(), step.dt)?;
        solver.read(&model, &mut state)?;
        let positions: Vec<Vec3<f64>> = state.positions.iter().map(|x| x.cast()).collect();
        points.push([f64::from(count), step.error(&positions)]);
    }
    Ok(points)
}

/// As [`MeasuredStep::end`].
pub fn end(
    device: &Device,
    step: &MeasuredStep,
    settings: &SolverSettings,
) -> Result<Vec<Vec3<f64>>> {
    let model = step.scene.model::<f32>(settings)?;
    let (_, mut state) = step.begin::<f32>(&model, settings)?;
    let mut solver = GpuSolver::new(device, &model, settings)?;
    solver.write(&model, &state)?;
    for (inputs, dt) in step.substeps(settings.substeps) {
        solver.step(&model, &inputs, dt)?;
    }
    solver.read(&model, &mut state)?;
    Ok(state.positions.iter().map(|x| x.cast()).collect())
}
