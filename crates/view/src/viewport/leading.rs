//! Instruments under the pointer: which one a press takes up, and how a drag leads it.

use eframe::egui::{Modifiers, Pos2, Vec2};
use viscera_stage::{Drag, InHand, Instruments, Nudge, RunSnapshot, ToolSnapshot, pick_tool};

use super::lens::Lens;

/// A press so near to a working end takes that instrument up [points].
const NEAR: f32 = 14.0;

/// How far a point of the wheel leads in depth, as a share of the size of things.
const PER_POINT: f64 = 2e-3;

/// The tool that a press takes up, before whatever tissue is so far away [m]: the one that is seen there, or whose working
/// end is near. The active one shines through tissue, and is taken through it.
pub fn tool_at<'a>(
    run: &'a RunSnapshot,
    lens: &Lens,
    pointer: Pos2,
    tissue: Option<f64>,
    instruments: &Instruments,
) -> Option<&'a ToolSnapshot> {
    let is_seen = |way: f64| tissue.is_none_or(|tissue| way <= tissue);
    let (from, direction) = (lens.orbit().position(), lens.ray(pointer));
    let active = instruments.active().map(|held| held.id);
    let is_active = |tool: &ToolSnapshot| tool.hand.is_some() && tool.hand == active;
    let hit = pick_tool(&run.tools, from, direction);
    if let Some(tool) = hit.filter(|(_, way)| is_seen(*way)).and_then(|(at, _)| run.tools.get(at)) {
        return Some(tool);
    }
    let through = run
        .tools
        .iter()
        .find(|tool| is_active(tool))
        .filter(|tool| pick_tool(std::slice::from_ref(*tool), from, direction).is_some());
    let is_near = |tool: &&ToolSnapshot| {
        let place = lens.place(tool.pose.translation);
        tool.hand.is_some() && place.is_some_and(|place| place.distance(pointer) < NEAR)
    };
    through.or_else(|| run.tools.iter().find(is_near))
}

/// What a drag asks of an instrument that has moved the pointer by so much, and the wheel meanwhile [points].
pub fn nudge(
    held: &InHand,
    lens: &Lens,
    (pointer, moved): (Pos2, Vec2),
    scroll: f32,
    modifiers: Modifiers,
    extent: f64,
) -> Nudge {
    let drag = match modifiers {
        Modifiers { alt: true, .. } => Drag::Roll,
        Modifiers { shift: true, .. } => Drag::Tilt,
        Modifiers { command: true, .. } => Drag::Depth,
        _ => Drag::Across,
    };
    let place = |at: Pos2| [at.x, at.y].map(f64::from);
    let way = [place(pointer - moved), place(pointer)];
    let mut nudge = held.dragged(drag, lens.eye(), way, extent);
    nudge.way[2] -= PER_POINT * f64::from(scroll) * extent;
    nudge
}
