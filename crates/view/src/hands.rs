//! What a person's hands have: points of the tissue, and instruments.

use crate::engine::Command;
use crate::holds::Holds;
use viscera_stage::Instruments;

/// Both.
#[derive(Debug, Default)]
pub struct Hands {
    /// Points of the tissue that are held.
    pub holds: Holds,
    /// Instruments.
    pub instruments: Instruments,
}

impl Hands {
    /// Forgets everything: the simulations have begun anew. What was taken since, before this was known, is let go.
    pub fn clear(&mut self) -> Vec<Command> {
        let mut late: Vec<Command> = self.holds.clear();
        let hands: Vec<_> = self.instruments.list().iter().map(|held| held.id).collect();
        let away = hands.into_iter().filter_map(|hand| self.instruments.put_away(hand));
        late.extend(away.map(Command::Tool));
        self.instruments.clear();
        late
    }
}
