//! Snapshots of all simulations after a frame, and the place where the newest waits for the window.

use std::sync::Mutex;
use viscera::measure::Energies;
use viscera::scalar::Vec3;

use super::setup::Setup;

/// The window's number for something it holds.
pub type HoldId = u64;

/// What the tissue's colour shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Coloring {
    /// The tissue's own colour.
    #[default]
    Plain,
    /// Distance from rest [m].
    Displacement,
    /// Largest principal stretch less one.
    Strain,
    /// Von Mises stress [Pa].
    Stress,
}

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

/// The state of one simulation at that time.
#[derive(Debug, Default)]
pub struct RunSnapshot {
    /// Positions [m] of the tetrahedra's vertices, the user's order, shape [vertex_count].
    pub positions: Vec<Vec3<f32>>,
    /// Values of the surfaces' vertices, one body after the other; empty for plain tissue.
    pub values: Vec<f32>,
    /// Patches held by hand.
    pub held: Vec<HeldPatch>,
    /// Wall time of the last frame [s].
    pub wall: f64,
    /// Substeps per frame and iterations of each in force: what the method has chosen where it chooses.
    pub counts: [u32; 2],
    /// What is measured now and then.
    pub measures: Measures,
}

impl RunSnapshot {
    /// The largest distance [m] of a vertex from where another simulation has it.
    pub fn distance(&self, other: &Self) -> f64 {
        let pairs = self.positions.iter().zip(&other.positions);
        pairs.fold(0.0, |most, (a, b)| f64::max(most, f64::from((*a - *b).length())))
    }
}

/// How many tetrahedra are inverted, in words; nothing where there are none.
pub fn inverted(run: &RunSnapshot) -> Option<String> {
    match run.measures.inverted {
        0 => None,
        1 => Some("1 tetrahedron is inverted".to_owned()),
        count => Some(format!("{count} tetrahedra are inverted")),
    }
}

/// What takes a while to measure, and is measured ten times a second unless colours need it more often.
#[derive(Clone, Debug, Default)]
pub struct Measures {
    /// Unbalanced forces over loads, see [`viscera::simulation::FrameReport::relative_residual`].
    pub residual: f64,
    /// Energies [J].
    pub energy: Energies,
    /// Rejected substeps so far.
    pub rejected: u64,
    /// Tetrahedra that are turned inside out.
    pub inverted: usize,
    /// Patches that the scene itself moves and pulls.
    pub scene_patches: Vec<ScenePatch>,
}

/// A patch that the scene moves or pulls.
#[derive(Clone, Debug)]
pub struct ScenePatch {
    /// Its name.
    pub name: String,
    /// Its vertices, the user's order.
    pub vertices: Vec<u32>,
    /// Force on the tissue [N].
    pub force: Vec3<f64>,
}

/// A patch of tissue that is held by hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldPatch {
    /// The window's number for it.
    pub id: HoldId,
    /// The middle of the patch [m].
    pub place: Vec3<f64>,
    /// Where that is pulled to [m].
    pub target: Vec3<f64>,
    /// Force on the tissue [N].
    pub force: Vec3<f64>,
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
