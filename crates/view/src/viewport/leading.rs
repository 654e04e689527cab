//! Instruments under the pointer: which one a press takes up, and how a drag leads it.

use eframe::egui::{Modifiers, Pos2, Vec2};
use viscera::scalar::Vec3;
use viscera_stage::{RunSnapshot, ToolSnapshot, meet_plane, pick_tool};

use super::lens::Lens;
use crate::instruments::{InHand, Instruments, Nudge};

/// A press so near to a working end takes that instrument up [points].
const NEAR: f32 = 14.0;

/// Angle that an instrument turns by for a drag across the picture's height [rad].
const TURN: f64 = 3.5;

/// How far a step of the wheel, or a drag across the picture's height, leads in depth, as a share of the size of things.
const PER_POINT: f64 = 2e-3;
const PER_HEIGHT: f64 = 1.5;

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
    let through = run.tools.iter().find(|tool| is_active(tool)).filter(|tool| {
        pick_tool(std::slice::from_ref(*tool), from, direction).is_some()
    });
    let is_near = |tool: &&ToolSnapshot| {
        let place = lens.place(tool.pose.translation);
        tool.hand.is_some() && place.is_some_and(|place| place.distance(pointer) < NEAR)
    };
    through.or_else(|| run.tools.iter().find(is_near))
}

/// What a drag from one place to another asks of an instrument, and the wheel, in points. Where the picture says nothing of a
/// place it is no number, and the instrument says so.
pub fn nudge(
    held: &InHand,
    lens: &Lens,
    (pointer, moved): (Pos2, Vec2),
    scroll: f32,
    modifiers: Modifiers,
    extent: f64,
) -> Nudge {
    let height = f64::from(lens.rect.height().max(1.0));
    let [x, y] = [f64::from(moved.x) / height, f64::from(-moved.y) / height];
    let depth = -PER_POINT * f64::from(scroll) * extent;
    let mut nudge = Nudge { way: [0.0, 0.0, depth], ..Nudge::default() };
    if moved == Vec2::ZERO {
        return nudge;
    }
    if modifiers.alt {
        nudge.roll = TURN * x;
    } else if modifiers.shift {
        nudge.tilt = [TURN * x, TURN * y];
    } else if modifiers.command {
        nudge.way[2] -= PER_HEIGHT * extent * y;
    } else {
        let [right, up, normal] = lens.orbit().axes();
        let eye = lens.orbit().position();
        let at = |place: Pos2| meet_plane(eye, lens.ray(place), held.pose.translation, normal);
        let nowhere = Vec3::splat(f64::NAN);
        let way = match at(pointer - moved).zip(at(pointer)) {
            Some((before, now)) => now - before,
            None => nowhere,
        };
        (nudge.way[0], nudge.way[1]) = (way.dot(right), way.dot(up));
    }
    nudge
}
