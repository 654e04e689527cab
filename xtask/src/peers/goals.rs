//! What is asked of a simulator, and the cheapest that does it.

use super::plan::{AUTOMATIC, STANDARD};
use super::results::{self, Entry};

/// A frame in real time [ms].
pub const REAL_TIME: f64 = 1e3 / 60.0;

/// Largest errors, as shares of the displacement.
pub struct Goal {
    /// In words.
    pub words: &'static str,
    /// At rest, if it matters.
    rest: Option<f64>,
    /// In motion, if it matters.
    motion: Option<f64>,
    /// Whether it is the automatic method at its standard accuracy that has to reach it; otherwise the cheapest of ours.
    of_standard: bool,
}

impl Goal {
    /// Comes to the right rest.
    pub const SETTLED: Self =
        Self { words: "at rest within 1 %", rest: Some(0.01), motion: None, of_standard: true };
    /// And moves as it should.
    pub const FOLLOWED: Self = Self {
        words: "at rest within 1 %, in motion within 5 %",
        rest: Some(0.01),
        motion: Some(0.05),
        of_standard: true,
    };
    /// Moves as the exact body.
    pub const EXACT: Self = Self {
        words: "in motion within 0.3 %",
        rest: None,
        motion: Some(0.003),
        of_standard: false,
    };

    /// All, in the order of the report.
    pub const ALL: [Self; 3] = [Self::SETTLED, Self::FOLLOWED, Self::EXACT];

    /// Whether errors at rest and in motion are small enough; what is not known is not.
    pub fn is_met_by(&self, rest: Option<f64>, motion: Option<f64>) -> bool {
        let fits = |limit: Option<f64>, error: Option<f64>| {
            limit.is_none_or(|limit| error.is_some_and(|error| error <= limit))
        };
        fits(self.rest, rest) && fits(self.motion, motion)
    }

    fn is_met(&self, entry: &Entry<'_>) -> bool {
        entry.trouble().is_none() && self.is_met_by(entry.judged_rest(), entry.judged_motion())
    }

    /// Which of ours is judged.
    pub fn ours<'a, 'b>(&self, entries: &'b [Entry<'a>]) -> Option<&'b Entry<'a>> {
        let standard = super::plan::settings(STANDARD, 1);
        let asked = |entry: &&Entry<'_>| {
            let is_standard = entry.peer == AUTOMATIC && *entry.asked == standard;
            results::is_ours(entry) && (is_standard || !self.of_standard)
        };
        cheapest(entries.iter().filter(asked), self)
    }

    /// The cheapest peer.
    pub fn peer<'a, 'b>(&self, entries: &'b [Entry<'a>]) -> Option<&'b Entry<'a>> {
        cheapest(entries.iter().filter(|entry| !results::is_ours(entry)), self)
    }
}

/// Of those that meet the goal.
pub fn cheapest<'a, 'b>(
    entries: impl Iterator<Item = &'b Entry<'a>>,
    goal: &Goal,
) -> Option<&'b Entry<'a>>
where
    'a: 'b,
{
    let met = entries.filter(|entry| goal.is_met(entry) && entry.cost().is_some());
    let cost = |entry: &&Entry<'_>| entry.cost().unwrap_or(f64::INFINITY);
    met.min_by(|a, b| cost(a).total_cmp(&cost(b)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    fn row(peer: &str, asked: Value, cost: f64, rest: f64, motion: f64) -> Value {
        json!({ "scene": "A", "size": "s", "peer": peer, "cfg_asked": asked, "round": 0, "cpu_ms": cost,
                "err_own_rms": rest, "dyn_own": motion, "status": "ok" })
    }

    #[test]
    fn the_cheapest_that_meets_a_goal_is_taken() {
        let standard = super::super::plan::settings(STANDARD, 1);
        let rows = [
            row(AUTOMATIC, standard, 1.0, 1e-3, 4e-2),
            row("viscera, explicit", json!({}), 0.5, 1e-3, 1e-3),
            row("MuJoCo, implicit", json!({}), 3.0, 1e-9, 0.5),
            row("MuJoCo, explicit", json!({}), 6.0, 1e-4, 2e-3),
            row("Pbat, VBD", json!({}), 0.1, 0.5, 0.9),
        ];
        let entries = Entry::all(&rows, &rows, "A", "s");
        let pairs = Goal::ALL.map(|goal| {
            [goal.ours(&entries), goal.peer(&entries)].map(|entry| entry.map(|entry| entry.peer))
        });
        let explicit = Some("MuJoCo, explicit");
        assert_eq!(pairs[0], [Some(AUTOMATIC), Some("MuJoCo, implicit")]);
        assert_eq!(pairs[1], [Some(AUTOMATIC), explicit]);
        assert_eq!(pairs[2], [Some("viscera, explicit"), explicit]);
    }

    #[test]
    fn what_is_not_known_meets_no_goal() {
        assert!(!Goal::FOLLOWED.is_met_by(Some(0.0), None));
        assert!(Goal::SETTLED.is_met_by(Some(0.01), None));
        assert!(!Goal::SETTLED.is_met_by(Some(0.011), Some(0.0)));
    }
}
