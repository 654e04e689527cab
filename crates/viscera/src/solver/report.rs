//! What of a frame is read, and how a guarded step ended: values that every backend has.

/// What of a frame a graphics processor hands back; where the processor of the machine computes, all of it is there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum FrameReading {
    /// Forces on tools, and how many steps were rejected: some hundred bytes. What moves stays on the device, to be drawn from
    /// there.
    Forces,
    /// Positions and velocities as well: 32 bytes a vertex.
    #[default]
    State,
    /// What the balance of forces is made of as well: some 50 bytes a vertex more.
    Balance,
}

/// How a guarded step ended, for one connected part of the model or for all of them.
///
/// Of all parts together, potential, limit and noise are those of the part that ended highest above its limit,
/// or least below it; so that [`StepReport::keeps_limit`] speaks for every part.
///
/// The quasi-Newton method judges every trial by a change of the potential, and the step by its energies: there
/// `potential` is the mechanical energy at the end of the step, `limit` what the part had and was given, both times the
/// squared step. A potential that is not finite says that energies are beyond the precision's range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepReport {
    /// Incremental potential [J s^2] at the end of the step.
    pub potential: f64,
    /// The lowest incremental potential [J s^2] of the places the step could have started from.
    pub limit: f64,
    /// The part of `potential` that round-off can pretend [J s^2]; at most this much above `limit` passes.
    pub noise: f64,
    /// Whether the sweeps ended above the limit, so that the step was rejected: the part's, or any part's.
    pub rejected: bool,
    /// The share of its velocities that the energy limit left to the part, or to the part that it slowed
    /// most; 1 where it did not act.
    pub kept_speed: f64,
}

impl StepReport {
    /// Of a step in which nothing had to be done.
    pub(crate) const QUIET: StepReport =
        StepReport { potential: 0.0, limit: 0.0, noise: 0.0, rejected: false, kept_speed: 1.0 };

    /// Whether the step holds what the guard promises: it ends no higher than its limit.
    pub fn keeps_limit(&self) -> bool {
        self.potential <= self.limit + self.noise
    }

    /// Of parts together; nothing of no part.
    pub(crate) fn of_all(parts: &[StepReport]) -> Option<StepReport> {
        let height = |report: &StepReport| {
            let above = report.potential - (report.limit + report.noise);
            // Infinite at an infinite limit is at the limit; NaN stands above everything.
            let unknown = if report.keeps_limit() { 0.0 } else { f64::INFINITY };
            if above.is_nan() { unknown } else { above }
        };
        parts.iter().copied().reduce(|worst, next| {
            let report = if height(&next) > height(&worst) { next } else { worst };
            StepReport {
                rejected: worst.rejected || next.rejected,
                kept_speed: worst.kept_speed.min(next.kept_speed),
                ..report
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A NaN, or an infinite value at an infinite limit, is not hidden by other parts.
    #[test]
    fn the_worst_part_speaks_for_all() {
        let of = |potential, limit| StepReport {
            potential,
            limit,
            noise: 0.0,
            rejected: false,
            kept_speed: 1.0,
        };
        let (good, over) = (of(1.0, 2.0), of(3.0, 2.0));
        let (infinite, unknown) = (of(f64::INFINITY, f64::INFINITY), of(f64::NAN, 1.0));
        for (parts, keeps) in [
            (&[good, infinite][..], true),
            (&[infinite, over, good], false),
            (&[good, unknown, over], false),
            (&[over, unknown], false),
            (&[unknown, good], false),
        ] {
            let all = StepReport::of_all(parts).expect("parts");
            assert_eq!(all.keeps_limit(), keeps, "{parts:?}");
        }
        assert_eq!(StepReport::of_all(&[]), None);
        let rejected = StepReport { rejected: true, kept_speed: 0.5, ..good };
        let all = StepReport::of_all(&[rejected, over]).expect("parts");
        assert_eq!(all, StepReport { rejected: true, kept_speed: 0.5, ..over });
    }
}
