//! Tools at rest: what a state of rest says of them, and what it cannot.

use viscera::scalar::Vec3;
use viscera::scene::Scene;
use viscera::simulation::{Simulation, ToolForce, ToolState};

use super::path::Rest;

/// Says that tools have no friction in a state of rest, where they have some in the scene.
pub(crate) fn note(scene: &Scene) -> Option<String> {
    let tool = scene.tools.iter().find(|tool| tool.law.friction > 0.0)?;
    Some(format!(
        "tools touch without friction here, tool `{}` for one: with it a state of rest depends on the way there",
        tool.name
    ))
}

/// Forces on the scene's tools in a state of rest.
pub(super) fn forces(simulation: &Simulation<f64>, rest: &Rest) -> Vec<ToolForce> {
    let mut parts = rest.state.wrenches.iter().zip(&rest.state.inputs.tools);
    let states = simulation.tools();
    let of_tool = |(tool, state): (&viscera::scene::Instrument, &ToolState)| {
        let count = if state.is_there { tool.parts.len() } else { 0 };
        let origin = tool.pose(rest.state.time).translation;
        let (mut force, mut torque) = (Vec3::ZERO, Vec3::ZERO);
        let (mut touches, mut pinned, mut depth) = (0, 0, 0.0f64);
        for (wrench, placed) in parts.by_ref().take(count) {
            force += wrench.force;
            torque += wrench.torque + (placed.pose.translation - origin).cross(wrench.force);
            touches += wrench.touches;
            pinned += wrench.pinned;
            depth = depth.max(wrench.depth);
        }
        let (force, torque) = (force.to_array(), torque.to_array());
        ToolForce {
            name: tool.name.clone(),
            force,
            torque,
            touches,
            pinned,
            left_out: 0,
            depth,
            has_jumped: false,
            crossed: None,
            error: None,
            torque_error: None,
        }
    };
    simulation.assembly().tools.iter().zip(&states).map(of_tool).collect()
}
