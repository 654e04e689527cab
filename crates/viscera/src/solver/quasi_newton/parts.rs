//! The progress of each connected part in a solve.

use crate::settings::MOST_HISTORY;

/// A trial is accepted without its change where the potential still falls there, no more steeply than at the start, or rises
/// by this share of the slope at the start at most: by the trapezoid rule it has then fallen by a quarter of that slope or more.
const SETTLED: f64 = 0.5;

/// Steps above this many resolutions are taken unchecked: a few units of the precision are round-off of the forces at rest.
const UNCHECKED_STEP: f64 = 4.0;

/// Steps above this many resolutions are clear: of shorter ones the change of the gradient is round-off.
const CLEAR_STEP: f64 = 16.0;

/// How a part takes a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scheme {
    /// Two stages of SDIRK2.
    #[default]
    Sdirk2,
    /// One solve of implicit Euler.
    Euler,
}

impl Scheme {
    /// Whether the energy of such a step is compared with what there was, and the step taken again where it is too
    /// high. A step of implicit Euler needs none of that: it stores no more than there was where its potential ends
    /// no higher than at its reference.
    pub fn is_checked(self) -> bool {
        self == Scheme::Sdirk2
    }
}

/// Where a solve of a part stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Phase {
    /// It is not concerned, or has converged: nothing moves.
    #[default]
    Done,
    /// The trial is the start, the iterate the reference.
    Starting,
    /// The trial is the reference itself: the start was worse.
    FromReference,
    /// The trial is a step from the iterate.
    Iterating,
}

/// Inner products of the pairs of a part, by their places.
#[derive(Clone, Copy, Debug)]
pub struct Products {
    /// `s_i . y_j` of pairs `i` that are not newer than `j`.
    pub sy: [[f64; MOST_HISTORY]; MOST_HISTORY],
    /// `y_i . M y_j`.
    pub yw: [[f64; MOST_HISTORY]; MOST_HISTORY],
}

impl Default for Products {
    fn default() -> Self {
        Self { sy: [[0.0; MOST_HISTORY]; MOST_HISTORY], yw: [[0.0; MOST_HISTORY]; MOST_HISTORY] }
    }
}

/// A part in a step.
#[derive(Clone, Copy, Debug, Default)]
pub struct Progress {
    pub scheme: Scheme,
    pub phase: Phase,
    /// Passes that are left to it in this solve.
    pub passes_left: u32,
    /// Whether the slope at the trial is enough to accept it.
    pub settled: bool,
    /// Whether the last trial was accepted, so that a new direction is to be found.
    pub accepted: bool,
    /// Whether the trial is a step from the iterate that nothing has judged yet.
    pub ahead: bool,
    /// `a`: the share of the direction that the trial goes.
    pub length: f64,
    /// `g . d` [J s^2].
    pub slope: f64,
    /// The longest vector of the direction [m].
    pub longest: f64,
    /// Trials in a row that were rejected, and all in this solve.
    pub failures: u32,
    pub rejections: u32,
    /// Steps below this [m] are round-off.
    pub resolution: f64,
    pub products: Products,
}

impl Progress {
    /// Whether it has a trial to evaluate, and a pass left for that.
    pub fn acts(&self) -> bool {
        self.phase != Phase::Done && self.passes_left > 0
    }

    /// Whether the trial is so far from the iterate that what changes on the way is more than round-off.
    pub fn is_clear(&self) -> bool {
        self.length * self.longest > CLEAR_STEP * self.resolution
    }

    /// Whether the trial is further from the iterate than round-off of a direction takes it, so that it may be taken unchecked.
    pub fn is_more_than_round_off(&self) -> bool {
        self.length * self.longest > UNCHECKED_STEP * self.resolution
    }

    /// Whether a trial is accepted for the slope of the potential [J s^2] at its end, without its change. `calm`: no trial
    /// of the last solve was rejected.
    ///
    /// Where the slope has fallen to a share of what it was, the trapezoid rule says that the potential has fallen far more
    /// than [`super::SUFFICIENT`] asks. Where the last solve was calm, the start of the next is as good as any: it has
    /// the velocity. A step that nothing checks afterwards is judged by its change.
    pub fn is_settled_by(&self, slope: f64, calm: bool) -> bool {
        match self.phase {
            Phase::Starting => self.scheme.is_checked() && calm && slope.is_finite(),
            Phase::Iterating => {
                let before = self.length * self.slope;
                let is_between = slope <= -SETTLED * before && slope >= before;
                self.scheme.is_checked() && self.is_clear() && is_between
            }
            Phase::FromReference => true,
            Phase::Done => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A slope decides only where it lies between that at the start and half of it the other way, where the step is more than
    /// round-off, and where the energy is checked in the end.
    #[test]
    fn a_slope_decides_only_where_the_potential_has_fallen() {
        let clear = Progress {
            phase: Phase::Iterating,
            length: 0.5,
            slope: -2.0,
            longest: 1.0,
            ..Progress::default()
        };
        for (slope, decides) in [
            (-1.0, true),
            (0.0, true),
            (0.5, true),
            (0.51, false),
            (-1.01, false),
            (f64::NAN, false),
            (f64::INFINITY, false),
        ] {
            assert_eq!(clear.is_settled_by(slope, true), decides, "{slope}");
        }
        let unchecked = Progress { scheme: Scheme::Euler, ..clear };
        let round_off = Progress { resolution: 0.5 / CLEAR_STEP, ..clear };
        for other in [unchecked, round_off] {
            assert!(!other.is_settled_by(0.0, true), "{other:?}");
        }
        let starting = Progress { phase: Phase::Starting, ..clear };
        assert!(starting.is_settled_by(7.0, true) && !starting.is_settled_by(7.0, false));
        assert!(!starting.is_settled_by(f64::NAN, true));
    }
}
