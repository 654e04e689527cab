//! A game controller: what its sticks, triggers and buttons say, and whether it is there.
//!
//! | on the controller | does |
//! |---|---|
//! | left stick | moves the instrument in the plane of the picture |
//! | right stick | turns it |
//! | shoulders | nearer (left), away (right) |
//! | triggers | jaws open (left), close (right) |
//! | lower button | locks the jaws |
//! | upper button | makes the other instrument active |
//!
//! Reading one takes the feature `controller`, which needs a library of the system.

use viscera_stage::Nudge;

/// What it does, for the list of keys.
pub const HELP: &str = "game controller: left stick moves, right stick turns, shoulders nearer and away, triggers open and close \
                        the jaws, lower button locks them, upper button makes the other instrument active";

/// What a controller says at a moment. Sticks and triggers go from -1 or 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sticks {
    /// To the right and up.
    pub left: [f64; 2],
    /// To the right and up.
    pub right: [f64; 2],
    /// Left and right.
    pub triggers: [f64; 2],
    /// Left and right.
    pub shoulders: [bool; 2],
}

/// What has happened on it.
#[derive(Clone, Debug, PartialEq)]
pub enum News {
    /// One of this name is there.
    Connected(String),
    /// It is gone.
    Unplugged,
    /// The jaws are to be locked, or unlocked.
    Lock,
    /// The other instrument is to be active.
    Next,
    /// Sticks and triggers are like this now.
    Sticks(Sticks),
}

/// The controller, where there is one.
#[derive(Default)]
pub struct Controller {
    name: Option<String>,
    sticks: Sticks,
    #[cfg(feature = "controller")]
    source: Option<gilrs::Gilrs>,
    /// Why none can be read.
    missing: Option<String>,
}

/// A stick that says less than this is at rest: worn ones never come back to the middle.
const REST: f64 = 0.15;

/// Speeds at the end of a stick: sizes of things per second, and [rad/s].
const SPEED: f64 = 0.6;
const TURN: f64 = 1.6;
const OPENING: f64 = 1.0;

impl Controller {
    /// Looks for one; without one it hears nothing until one is plugged in.
    #[cfg(feature = "controller")]
    pub fn open() -> Self {
        match gilrs::Gilrs::new() {
            Ok(source) => {
                let name = source.gamepads().next().map(|(_, pad)| pad.name().to_owned());
                Self { name, source: Some(source), ..Self::default() }
            }
            Err(error) => Self { missing: Some(error.to_string()), ..Self::default() },
        }
    }

    /// Without the feature none is read.
    #[cfg(not(feature = "controller"))]
    pub fn open() -> Self {
        let missing = "this program was built without game controllers; build it with `--features controller`";
        Self { missing: Some(missing.to_owned()), ..Self::default() }
    }

    /// Its name, where one is there.
    pub fn name(&self) -> Option<&str> {
        self.name.as_deref()
    }

    /// Why none can be read at all.
    pub fn missing(&self) -> Option<&str> {
        self.missing.as_deref()
    }

    /// What has happened since it was last asked.
    pub fn news(&mut self) -> Vec<News> {
        #[cfg(feature = "controller")]
        {
            let mut news = Vec::new();
            while let Some(event) = self.source.as_mut().and_then(gilrs::Gilrs::next_event) {
                news.extend(self.read(&event));
            }
            news
        }
        #[cfg(not(feature = "controller"))]
        Vec::new()
    }

    #[cfg(feature = "controller")]
    fn read(&self, event: &gilrs::Event) -> Option<News> {
        use gilrs::{Axis, Button, EventType};
        let pad = self.source.as_ref()?.gamepad(event.id);
        match event.event {
            EventType::Connected => Some(News::Connected(pad.name().to_owned())),
            EventType::Disconnected => Some(News::Unplugged),
            EventType::ButtonPressed(Button::South, _) => Some(News::Lock),
            EventType::ButtonPressed(Button::North, _) => Some(News::Next),
            _ => {
                let axis = |axis| f64::from(pad.value(axis));
                let button =
                    |button| pad.button_data(button).map_or(0.0, |data| f64::from(data.value()));
                Some(News::Sticks(Sticks {
                    left: [axis(Axis::LeftStickX), axis(Axis::LeftStickY)],
                    right: [axis(Axis::RightStickX), axis(Axis::RightStickY)],
                    triggers: [button(Button::LeftTrigger2), button(Button::RightTrigger2)],
                    shoulders: [Button::LeftTrigger, Button::RightTrigger]
                        .map(|b| pad.is_pressed(b)),
                }))
            }
        }
    }

    /// Takes over what has happened. Of one that is gone the sticks are at rest: what it led stands still.
    pub fn hear(&mut self, news: &News) {
        match news {
            News::Connected(name) => self.name = Some(name.clone()),
            News::Unplugged => (self.name, self.sticks) = (None, Sticks::default()),
            News::Sticks(sticks) => {
                self.sticks = *sticks;
                self.name.get_or_insert_with(|| "a controller".to_owned());
            }
            News::Lock | News::Next => {}
        }
    }

    /// What sticks and triggers ask for in a time [s], where things are of this size [m]; nothing at rest.
    pub fn nudge(&self, time: f64, extent: f64) -> Option<Nudge> {
        let Sticks { left, right, triggers, shoulders } = self.sticks;
        let [x, y] = left.map(respond);
        let [a, b] = right.map(respond);
        let [open, close] = triggers.map(respond);
        let depth = f64::from(u8::from(shoulders[0])) - f64::from(u8::from(shoulders[1]));
        let (way, turn) = (SPEED * extent * time, TURN * time);
        let nudge = Nudge {
            way: [way * x, way * y, 0.5 * way * depth],
            tilt: [turn * a, turn * b],
            roll: 0.0,
            opening: OPENING * time * (open - close),
        };
        (nudge != Nudge::default()).then_some(nudge)
    }
}

/// Nothing near the middle, fine beside it, all at the end. What is no number is nothing.
fn respond(value: f64) -> f64 {
    if !value.is_finite() {
        return 0.0;
    }
    let beyond = (value.abs() - REST).max(0.0) / (1.0 - REST);
    value.signum() * beyond.min(1.0).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sticks_at_rest_ask_for_nothing_and_an_unplugged_controller_stands_still() {
        let mut controller = Controller::default();
        let worn = Sticks { left: [0.1, -0.12], ..Sticks::default() };
        controller.hear(&News::Sticks(worn));
        assert!(controller.nudge(0.1, 0.2).is_none());
        let led = Sticks {
            left: [1.0, 0.0],
            right: [0.0, 1.0],
            triggers: [0.0, 1.0],
            shoulders: [true, false],
        };
        controller.hear(&News::Sticks(led));
        let nudge = controller.nudge(0.1, 0.2).expect("a nudge");
        let whole = SPEED * 0.2 * 0.1;
        assert!((nudge.way[0] - whole).abs() < 1e-12 && nudge.way[1] == 0.0 && nudge.way[2] > 0.0);
        assert!(nudge.tilt[1] > 0.0 && nudge.opening < 0.0);
        controller.hear(&News::Unplugged);
        assert!(controller.nudge(0.1, 0.2).is_none() && controller.name().is_none());
    }

    #[test]
    fn a_stick_is_fine_beside_the_middle_and_takes_no_nonsense() {
        assert!(respond(0.3) < 0.05 && (respond(-1.0) + 1.0).abs() < 1e-12);
        assert_eq!([f64::NAN, f64::INFINITY, 0.15].map(respond).map(f64::abs), [0.0; 3]);
    }
}
