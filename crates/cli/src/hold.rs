//! Whether tissue holds still on tools that stand still: the estimate of the way to rest knows nothing of tools.

use serde::Serialize;
use std::fmt;
use viscera::contact::Tool;
use viscera::scalar::{Real, Vec3};
use viscera::simulation::Simulation;

/// How long before its end a run is looked at [s].
const BEFORE: f64 = 0.5;

/// Tissue that moves less than this share of its displacement in that time holds still, as what is so near to rest is at rest.
const STILL: f64 = 0.005;

/// What is kept of a moment.
struct Moment<S: Real> {
    time: f64,
    positions: Vec<Vec3<S>>,
    parts: Vec<Tool>,
    forces: Vec<Vec3<f64>>,
}

/// Looks at a run some time before its end.
pub struct Hold<S: Real> {
    /// The frame after which it looks; nothing where there are no tools.
    frame: Option<u64>,
    seen: Option<Moment<S>>,
}

/// The last moments of a run whose tools stood still.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct HoldReport {
    /// Over so long a time [s].
    pub seconds: f64,
    /// The farthest that a vertex is from where it was at its beginning [m].
    pub distance: f64,
    /// The same over the largest displacement from the shape at rest.
    pub error: f64,
    /// The largest change of the force on a tool over the largest such force.
    pub force_error: f64,
}

impl<S: Real> Hold<S> {
    /// Of a run of so many frames.
    pub fn new(simulation: &Simulation<S>, frames: u64) -> Self {
        let scene = simulation.scene();
        let before = (BEFORE / scene.time.frame).round() as u64;
        let frame = frames.checked_sub(before).filter(|_| !scene.tools.is_empty());
        Self { frame, seen: None }
    }

    /// After each frame.
    pub fn look(&mut self, simulation: &Simulation<S>) {
        if self.frame == Some(simulation.frame()) {
            self.seen = Some(Moment::of(simulation));
        }
    }

    /// At the end; nothing where tools have moved since it looked.
    pub fn end(&self, simulation: &Simulation<S>) -> Option<HoldReport> {
        let (before, now) = (self.seen.as_ref()?, Moment::of(simulation));
        if before.parts != now.parts {
            return None;
        }
        let rest = &simulation.model().rest_positions;
        let displacement = farthest(rest, &now.positions);
        let distance = farthest(&before.positions, &now.positions);
        let largest = now.forces.iter().map(|force| force.length()).fold(0.0, f64::max);
        let changes = before.forces.iter().zip(&now.forces).map(|(a, b)| (*b - *a).length());
        let share = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { 0.0 };
        Some(HoldReport {
            seconds: now.time - before.time,
            distance,
            error: share(distance, displacement),
            force_error: share(changes.fold(0.0, f64::max), largest),
        })
    }
}

impl<S: Real> Moment<S> {
    fn of(simulation: &Simulation<S>) -> Self {
        let forces = simulation.tool_forces();
        Self {
            time: simulation.time(),
            positions: simulation.state().positions.clone(),
            parts: simulation.tool_parts(),
            forces: forces.iter().map(|tool| Vec3::from_f64(tool.force)).collect(),
        }
    }
}

/// The largest distance between vertices of the same number [m].
fn farthest<S: Real>(from: &[Vec3<S>], to: &[Vec3<S>]) -> f64 {
    let pairs = from.iter().zip(to);
    pairs.map(|(a, b)| (b.cast::<f64>() - a.cast()).length()).fold(0.0, f64::max)
}

impl fmt::Display for HoldReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let holds = self.error.max(self.force_error) < STILL;
        write!(
            f,
            "{}: over the last {:.1} s the tissue moved by {:.3} mm at most ({:.2} % of its displacement), and forces on \
             tools changed by {:.2} %{}",
            if holds { "holds still" } else { "not at rest yet" },
            self.seconds,
            1e3 * self.distance,
            100.0 * self.error,
            100.0 * self.force_error,
            if holds { "" } else { "; a longer time.duration shows where it comes to" },
        )
    }
}
