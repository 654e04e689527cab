//! Forces over the last seconds: of what a hand holds and of tools. A curve stays after its hand has let go.

use std::collections::VecDeque;
use viscera_stage::{HoldId, RunSnapshot};

use crate::engine::Snapshot;

/// How much of the past curves show [s].
pub const REMEMBERED: f64 = 8.0;

/// Whose force it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// A point of the tissue that is held by hand.
    Hold(HoldId),
    /// The tool of this name.
    Tool(String),
}

/// The force of one thing at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// [s].
    pub time: f64,
    /// Of the first and the second simulation [N]; NaN where there is none.
    pub forces: [f64; 2],
    /// What the first one may be off by [N], where that is known.
    pub error: Option<f64>,
}

/// The force of one thing over time.
#[derive(Clone, Debug)]
pub struct ForceCurve {
    /// Whose.
    pub source: Source,
    /// As it is called.
    pub name: String,
    /// Times ascending.
    pub points: VecDeque<Point>,
}

/// All curves.
#[derive(Debug, Default)]
pub struct ForceCurves {
    list: Vec<ForceCurve>,
    /// Holds that had curves so far.
    holds: usize,
}

impl ForceCurves {
    /// In the order in which they began.
    pub fn list(&self) -> &[ForceCurve] {
        &self.list
    }

    /// The newest point of a curve.
    pub fn last(&self, source: &Source) -> Option<Point> {
        let curve = self.list.iter().find(|curve| curve.source == *source)?;
        curve.points.back().copied()
    }

    /// Forgets everything: the simulations have begun anew.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// Notes the forces of a snapshot, and forgets what is long past.
    pub fn note(&mut self, snapshot: &Snapshot) {
        let time = snapshot.time;
        // After a reset time begins anew.
        let is_past = |curve: &ForceCurve| curve.points.back().is_some_and(|last| last.time > time);
        if self.list.iter().any(is_past) {
            self.clear();
        }
        let first = snapshot.runs.first();
        for hold in first.into_iter().flat_map(|run| &run.held) {
            let of_hold = |run: &RunSnapshot| {
                let hold = run.held.iter().find(|other| other.id == hold.id)?;
                Some(hold.force.length())
            };
            self.push(
                Source::Hold(hold.id),
                Point { time, forces: forces(snapshot, of_hold), error: None },
            );
        }
        for tool in first.into_iter().flat_map(|run| &run.tools) {
            let of_tool = |run: &RunSnapshot| {
                let tool = run.tools.iter().find(|other| other.met.name == tool.met.name)?;
                Some(tool.force())
            };
            let point = Point { time, forces: forces(snapshot, of_tool), error: tool.met.error };
            self.push(Source::Tool(tool.met.name.clone()), point);
        }
        for curve in &mut self.list {
            while curve.points.front().is_some_and(|point| point.time < time - REMEMBERED) {
                curve.points.pop_front();
            }
        }
        self.list.retain(|curve| !curve.points.is_empty());
    }

    fn push(&mut self, source: Source, point: Point) {
        let known = self.list.iter().position(|curve| curve.source == source);
        let number = known.unwrap_or_else(|| {
            let name = match &source {
                Source::Tool(name) => name.clone(),
                Source::Hold(_) => {
                    self.holds += 1;
                    format!("point {}", self.holds)
                }
            };
            self.list.push(ForceCurve { source, name, points: VecDeque::new() });
            self.list.len() - 1
        });
        let points = &mut self.list[number].points;
        // A snapshot may come again.
        if points.back().is_some_and(|last| last.time == point.time) {
            points.pop_back();
        }
        points.push_back(point);
    }
}

/// Of the first and the second simulation.
fn forces(snapshot: &Snapshot, of: impl Fn(&RunSnapshot) -> Option<f64>) -> [f64; 2] {
    [0, 1].map(|run| snapshot.runs.get(run).and_then(&of).unwrap_or(f64::NAN))
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera::scalar::{Vec3, vec3};

    fn at(time: f64, is_held: bool) -> Snapshot {
        let hold = viscera_stage::HeldPatch {
            id: 1,
            place: Vec3::ZERO,
            target: Vec3::ZERO,
            force: vec3(0.0, 3.0, 4.0),
        };
        let held = if is_held { vec![hold] } else { Vec::new() };
        let run = RunSnapshot { held, ..Default::default() };
        Snapshot { time, runs: vec![run], ..Snapshot::default() }
    }

    #[test]
    fn a_curve_forgets_what_is_long_past_and_what_a_reset_has_undone() {
        let mut curves = ForceCurves::default();
        for time in [1.0, 2.0, 1.5 + REMEMBERED] {
            curves.note(&at(time, true));
        }
        let times = |curves: &ForceCurves| -> Vec<f64> {
            curves.list()[0].points.iter().map(|point| point.time).collect()
        };
        assert_eq!(times(&curves), [2.0, 1.5 + REMEMBERED]);
        assert_eq!(curves.list()[0].points[0].forces[0], 5.0);
        curves.note(&at(1.5 + REMEMBERED, true));
        assert_eq!(times(&curves), [2.0, 1.5 + REMEMBERED]);
        curves.note(&at(0.0, true));
        assert_eq!(times(&curves), [0.0]);
    }

    #[test]
    fn a_curve_stays_after_the_release_until_it_is_long_past() {
        let mut curves = ForceCurves::default();
        curves.note(&at(1.0, true));
        curves.note(&at(2.0, false));
        assert_eq!(curves.list().len(), 1);
        assert_eq!(curves.last(&Source::Hold(1)).map(|point| point.time), Some(1.0));
        curves.note(&at(1.1 + REMEMBERED, false));
        assert!(curves.list().is_empty() && curves.last(&Source::Hold(1)).is_none());
    }
}
