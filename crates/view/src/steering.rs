//! Keys that lead instruments while they are held down.

use eframe::egui::{InputState, Key};
use viscera_stage::Nudge;

/// What they do, for the list of keys.
pub const HELD: &[(&str, &str)] = &[
    ("arrows, other: J L I K", "move the active instrument, the other one"),
    ("PgUp PgDn, other: U O", "away, nearer"),
    ("Shift with these", "turn it: its handle follows; PgUp PgDn roll it"),
    ("C V, other: N B", "close and open the jaws"),
];

/// Keys of one instrument: left, right, up, down, away, nearer, close, open.
type Keys = [Key; 8];

const ACTIVE: Keys = [
    Key::ArrowLeft,
    Key::ArrowRight,
    Key::ArrowUp,
    Key::ArrowDown,
    Key::PageUp,
    Key::PageDown,
    Key::C,
    Key::V,
];
const OTHER: Keys = [Key::J, Key::L, Key::I, Key::K, Key::U, Key::O, Key::N, Key::B];

/// Speeds: sizes of things per second, and [rad/s].
const SPEED: f64 = 0.45;
const TURN: f64 = 1.2;
const OPENING: f64 = 0.8;

/// A window that stood still for longer than this does not make up for it [s].
const LONGEST: f64 = 0.1;

/// What keys ask for that are held down, of the active and of the other instrument, where things are of this size [m].
pub fn steer(input: &InputState, extent: f64) -> [Option<Nudge>; 2] {
    let time = f64::from(input.stable_dt).min(LONGEST);
    [ACTIVE, OTHER].map(|keys| {
        if input.modifiers.command || input.modifiers.alt {
            return None;
        }
        let down = keys.map(|key| f64::from(u8::from(input.key_down(key))));
        nudge(down, input.modifiers.shift, time, extent)
    })
}

fn nudge(down: [f64; 8], shift: bool, time: f64, extent: f64) -> Option<Nudge> {
    let [left, right, up, below, away, nearer, close, open] = down;
    let (x, y, depth) = (right - left, up - below, nearer - away);
    let opening = OPENING * time * (open - close);
    let (way, turn) = (SPEED * extent * time, TURN * time);
    let nudge = if shift {
        Nudge { tilt: [turn * x, turn * y], roll: turn * depth, opening, ..Nudge::default() }
    } else {
        Nudge { way: [way * x, way * y, way * depth], opening, ..Nudge::default() }
    };
    (nudge != Nudge::default()).then_some(nudge)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_move_and_with_shift_turn() {
        let right_and_close = [0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let moved = nudge(right_and_close, false, 0.1, 0.2).expect("a nudge");
        assert!((moved.way[0] - 0.1 * 0.2 * SPEED).abs() < 1e-12 && moved.opening < 0.0);
        let turned = nudge(right_and_close, true, 0.1, 0.2).expect("a nudge");
        assert_eq!((turned.way, turned.tilt), ([0.0; 3], [0.1 * TURN, 0.0]));
        assert!(nudge([0.0; 8], true, 0.1, 0.2).is_none());
        // Both directions at once are none.
        assert!(nudge([1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], false, 0.1, 0.2).is_none());
    }
}
