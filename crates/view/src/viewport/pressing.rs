//! What the left button takes.

use eframe::egui::Pos2;
use viscera_stage::pick;

use super::{Lens, NEAR, Viewport, leading};
use crate::engine::{Command, Snapshot};
use crate::hands::Hands;
use crate::holds::Grip;

/// The left button went down.
#[derive(Clone, Copy)]
pub struct Pressed {
    pub run: usize,
    pub at: Pos2,
    /// Whether tissue is passed over.
    pub only_tools: bool,
}

impl Viewport {
    /// The left button goes down: on an instrument, on something held, on tissue, or beside it. Tissue is taken with a grip.
    #[expect(clippy::too_many_arguments, reason = "the window's state, lent for one event")]
    pub(super) fn press(
        &mut self,
        lens: &Lens,
        run: usize,
        snapshot: &Snapshot,
        pointer: Pos2,
        hands: &mut Hands,
        grip: Option<&Grip>,
        commands: &mut Vec<Command>,
    ) {
        let (Some(setup), Some(shown)) = (&self.setup, snapshot.runs.get(run)) else { return };
        if setup.generation != snapshot.generation {
            return;
        }
        let near = shown.held.iter().find(|hold| {
            [hold.place, hold.target]
                .iter()
                .any(|x| lens.place(*x).is_some_and(|place| place.distance(pointer) < NEAR))
        });
        if near.is_some_and(|hold| hands.holds.resume(hold.id)) {
            return;
        }
        let eye = lens.orbit().position();
        let hit = pick(&setup.assembly, shown, eye, lens.ray(pointer));
        let tissue = hit.map(|hit| (hit.point - eye).length());
        if let Some(tool) = leading::tool_at(shown, lens, pointer, tissue, &hands.instruments) {
            let hand = tool.hand.unwrap_or_else(|| {
                let scene_tool = setup.assembly.tools.get(tool.number);
                commands.push(Command::Tool(hands.instruments.hold(tool, scene_tool)));
                hands.instruments.active().map_or(0, |held| held.id)
            });
            hands.instruments.drag(hand);
            return;
        }
        let taken = hit.zip(grip).map(|(hit, grip)| hands.holds.take(&hit, grip));
        commands.extend(taken);
    }
}
