//! Snapshots of all simulations after a frame, and the place where the newest waits for the window.

use std::sync::Mutex;
use viscera_stage::{Coloring, RunSnapshot};

use super::setup::Setup;

/// The state of all simulations after one frame.
#[derive(Debug, Default)]
pub struct Snapshot {
    /// Of which [`super::Setup`].
    pub generation: u64,
    /// Frames computed so far.
    pub number: u64,
    /// Simulated time [s].
    pub time: f64,
    /// What the values are.
    pub coloring: Coloring,
    /// One for each simulation.
    pub runs: Vec<RunSnapshot>,
}

impl Snapshot {
    /// The reference, where there is one.
    pub fn ghost(&self, setup: &Setup) -> Option<&RunSnapshot> {
        let is_here = setup.has_ghost && self.generation == setup.generation;
        self.runs.last().filter(|_| is_here)
    }

    /// Whether the others wait for the reference: it takes longer than a frame is to last [s], or has not
    /// computed one yet.
    pub fn waits_for_ghost(&self, setup: &Setup, pace: f64) -> bool {
        self.ghost(setup).is_some_and(|ghost| ghost.wall == 0.0 || ghost.wall > pace)
    }
}

/// Holds the newest snapshot, and one whose memory can be used again.
#[derive(Debug, Default)]
pub struct SnapshotExchange {
    places: Mutex<Exchanged>,
}

#[derive(Debug, Default)]
struct Exchanged {
    fresh: Option<Box<Snapshot>>,
    spare: Option<Box<Snapshot>>,
}

impl SnapshotExchange {
    /// A snapshot to fill.
    pub fn blank(&self) -> Box<Snapshot> {
        self.places.lock().map(|mut places| places.spare.take()).ok().flatten().unwrap_or_default()
    }

    /// Puts a snapshot where the window finds it, in place of one it has not taken.
    pub fn publish(&self, snapshot: Box<Snapshot>) {
        if let Ok(mut places) = self.places.lock()
            && let Some(missed) = places.fresh.replace(snapshot)
        {
            places.spare = Some(missed);
        }
    }

    /// Exchanges the snapshot that is shown for a newer one. Held locks are short, and not waited for.
    pub fn take(&self, shown: &mut Option<Box<Snapshot>>) -> bool {
        let Ok(mut places) = self.places.try_lock() else { return false };
        let Some(fresh) = places.fresh.take() else { return false };
        if let Some(old) = shown.replace(fresh) {
            places.spare = Some(old);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_window_gets_the_newest_snapshot_and_memory_goes_around() {
        let exchange = SnapshotExchange::default();
        let mut shown = None;
        assert!(!exchange.take(&mut shown));
        for number in 1..=3 {
            let mut snapshot = exchange.blank();
            snapshot.number = number;
            exchange.publish(snapshot);
        }
        assert!(exchange.take(&mut shown));
        assert_eq!(shown.as_ref().map(|snapshot| snapshot.number), Some(3));
        assert!(!exchange.take(&mut shown));
        // One of those that nobody took.
        assert_eq!(exchange.blank().number, 2);
    }
}
