//! A finished frame, and the place where it waits for the window.

use std::sync::Mutex;
use viscera::measure::Energies;
use viscera::scalar::Vec3;

use super::stage::Stage;

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

/// What all simulations are at one time.
#[derive(Debug, Default)]
pub struct Frame {
    /// Of which [`super::Stage`].
    pub generation: u64,
    /// Frames computed so far.
    pub number: u64,
    /// Simulated time [s].
    pub time: f64,
    /// What the values are.
    pub coloring: Coloring,
    /// One for each simulation.
    pub lanes: Vec<Lane>,
}

impl Frame {
    /// The exact solution, where there is one.
    pub fn ghost(&self, stage: &Stage) -> Option<&Lane> {
        let is_here = stage.has_ghost && self.generation == stage.generation;
        self.lanes.last().filter(|_| is_here)
    }

    /// Whether the others wait for the exact solution: it takes longer than a frame is to last [s], or has not
    /// computed one yet.
    pub fn waits_for_ghost(&self, stage: &Stage, pace: f64) -> bool {
        self.ghost(stage).is_some_and(|ghost| ghost.wall == 0.0 || ghost.wall > pace)
    }
}

/// What one simulation is at that time.
#[derive(Debug, Default)]
pub struct Lane {
    /// Positions [m] of the tetrahedra's vertices, the user's order, shape [vertex_count].
    pub positions: Vec<Vec3<f32>>,
    /// Values of the surfaces' vertices, one body after the other; empty for plain tissue.
    pub values: Vec<f32>,
    /// What is held.
    pub holds: Vec<Hold>,
    /// Wall time of the last frame [s].
    pub wall: f64,
    /// What is measured now and then.
    pub measures: Measures,
}

impl Lane {
    /// The largest distance [m] of a vertex from where another simulation has it.
    pub fn distance(&self, other: &Self) -> f64 {
        let pairs = self.positions.iter().zip(&other.positions);
        pairs.fold(0.0, |most, (a, b)| f64::max(most, f64::from((*a - *b).length())))
    }
}

/// How many tetrahedra are inverted, in words; nothing where there are none.
pub fn inverted(lane: &Lane) -> Option<String> {
    match lane.measures.inverted {
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
    /// Substeps that the step guard has taken back so far.
    pub rejected: u64,
    /// Tetrahedra that are turned inside out.
    pub inverted: usize,
    /// What the scene itself moves and pulls.
    pub tools: Vec<Tool>,
}

/// Something of the scene's that moves or pulls tissue.
#[derive(Clone, Debug)]
pub struct Tool {
    /// Its name.
    pub name: String,
    /// Its vertices, the user's order.
    pub vertices: Vec<u32>,
    /// Force on the tissue [N].
    pub force: Vec3<f64>,
}

/// Something held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hold {
    /// Whose.
    pub id: HoldId,
    /// The middle of the patch [m].
    pub place: Vec3<f64>,
    /// Where that is pulled to [m].
    pub target: Vec3<f64>,
    /// Force on the tissue [N].
    pub force: Vec3<f64>,
}

/// Holds the newest finished frame, and frames whose memory can be used again.
#[derive(Debug, Default)]
pub struct Slot {
    places: Mutex<Places>,
}

#[derive(Debug, Default)]
struct Places {
    fresh: Option<Box<Frame>>,
    spare: Option<Box<Frame>>,
}

impl Slot {
    /// A frame to fill.
    pub fn blank(&self) -> Box<Frame> {
        self.places.lock().map(|mut places| places.spare.take()).ok().flatten().unwrap_or_default()
    }

    /// Puts a frame where the window finds it, in place of one it has not taken.
    pub fn publish(&self, frame: Box<Frame>) {
        if let Ok(mut places) = self.places.lock()
            && let Some(missed) = places.fresh.replace(frame)
        {
            places.spare = Some(missed);
        }
    }

    /// Exchanges the frame that is shown for a newer one. Held locks are short, and not waited for.
    pub fn take(&self, shown: &mut Option<Box<Frame>>) -> bool {
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
    fn the_window_gets_the_newest_frame_and_memory_goes_around() {
        let slot = Slot::default();
        let mut shown = None;
        assert!(!slot.take(&mut shown));
        for number in 1..=3 {
            let mut frame = slot.blank();
            frame.number = number;
            slot.publish(frame);
        }
        assert!(slot.take(&mut shown));
        assert_eq!(shown.as_ref().map(|frame| frame.number), Some(3));
        assert!(!slot.take(&mut shown));
        // One of those that nobody took.
        assert_eq!(slot.blank().number, 2);
    }
}
