//! Whether what a scene asks for is what computes it: not every method, and devices not all, computes contact.

use super::assemble::Assembly;
use super::error::SimulationError;
use crate::contact::beyond_devices;
use crate::scene::{Instrument, Scene};
use crate::settings::{DeviceRequest, SolverSettings};
use crate::solver::StepError;

/// Contact is computed where the scene asks for it to be.
pub(super) fn check_device(scene: &Scene, callers_device: bool) -> Result<(), SimulationError> {
    match device_of(scene, callers_device) {
        Some(device)
            if bodies_meet(scene) && !scene.solver.chosen_on_device().meets_on_device() =>
        {
            Err(SimulationError::BodiesOnDevice { device })
        }
        Some(_) if scene.tools.is_empty() => Ok(()),
        Some(_) => check_tools(scene, callers_device, scene.tools.iter()),
        None => Ok(()),
    }
}

/// Where the scene asks for a device, that computes contact with these tools.
pub(super) fn check_tools<'a>(
    scene: &Scene,
    callers_device: bool,
    tools: impl Iterator<Item = &'a Instrument>,
) -> Result<(), SimulationError> {
    let Some(device) = device_of(scene, callers_device) else { return Ok(()) };
    let parts = tools.flat_map(|tool| {
        let count = tool.parts.len() + tool.solids.len();
        std::iter::repeat_n(tool.spring.is_some(), count)
    });
    beyond_devices(parts).map_or(Ok(()), |why| Err(SimulationError::ToolsOnDevice { device, why }))
}

/// The device that is asked for, where one is.
fn device_of(scene: &Scene, callers_device: bool) -> Option<DeviceRequest> {
    let on_device = match &scene.solver.device {
        DeviceRequest::Cpu | DeviceRequest::Auto => None,
        device => Some(device.clone()),
    };
    on_device.or(callers_device.then_some(DeviceRequest::Gpu))
}

/// Whether bodies of a scene meet each other, or are tied.
fn bodies_meet(scene: &Scene) -> bool {
    scene.bodies.len() > 1 && scene.contact.bodies || !scene.ties.is_empty()
}

/// The method takes contact.
pub(super) fn check_contact(scene: &Scene, solver: &SolverSettings) -> Result<(), StepError> {
    if scene.tools.is_empty() && !bodies_meet(scene) { Ok(()) } else { refuse_method(solver) }
}

/// Not all methods compute contact.
pub(super) fn refuse_method(solver: &SolverSettings) -> Result<(), StepError> {
    if solver.takes_contact() { Ok(()) } else { Err(StepError::ContactNeedsRebase) }
}

/// Whether the patches are those of the scene and name vertices that there are. Numbers of vertices stay what they are as
/// materials change and bodies are added, so that patches do not depend on the model's revision.
pub(super) fn check_patches(scene: &Scene, assembly: &Assembly) -> Result<(), SimulationError> {
    for (what, found, expected) in [
        ("bodies", assembly.bodies.len(), scene.bodies.len()),
        ("fixings", assembly.fixings.len(), scene.fixings.len()),
        ("motions", assembly.motions.len(), scene.motions.len()),
        ("forces", assembly.forces.len(), scene.forces.len()),
        ("tools", assembly.tools.len(), scene.tools.len()),
    ] {
        if found != expected {
            return Err(SimulationError::OtherScene { what, found, expected });
        }
    }
    let vertex_count = assembly.builder.positions().len();
    let patches = assembly.fixings.iter().chain(&assembly.motions).chain(&assembly.forces);
    let mut vertices = patches.flat_map(|patch| patch.vertices.iter().copied());
    match vertices.find(|&vertex| vertex as usize >= vertex_count) {
        Some(vertex) => Err(SimulationError::Patch { vertex, vertex_count }),
        None => Ok(()),
    }
}
