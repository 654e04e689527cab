//! How bodies swing about their rest shapes, and by how much time steps lead them astray.
//!
//! ```text
//! u(t) = sum_k a_k phi_k (1 - cos w_k t)          let go at rest under a load, phi_i M phi_j = delta_ij
//! u_n  = sum_k a_k phi_k (1 - Re R(w_k h)^n)      in steps of h, where R is the growth of one step
//! e^2  = sum_k a_k^2 <(Re R^(t/h) - cos w_k t)^2> / sum_k a_k^2 <(1 - cos w_k t)^2>       means over time
//! e_p  = e min(1, a_p/(s a)),   a_p^2 = sum_k a_k^2 of the part,   a: the largest,   s: 1/20
//! ```
//!
//! What gives way far less than the softest part, as cartilage beside a liver, is seen to move by nothing: its error counts as a
//! share of a twentieth of what the softest one moves by.
//!
//! Hairer, Norsett, Wanner, "Solving Ordinary Differential Equations I", section II.1, of the growth of linear
//! oscillations.

use std::f64::consts::PI;

/// Duration [s] of the motion whose error is foretold.
pub const SECONDS: f64 = 0.5;

/// Moments of it that are looked at.
const MOMENTS: u32 = 30;

/// A part that moves by a smaller share than this of what the one does that moves most is measured by that share.
const SEEN: f64 = 0.05;

/// An oscillation of a part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Oscillation {
    /// [s]
    pub period: f64,
    /// `a_k^2`: mean square displacement, weighted by mass, under a load along each axis; the same load for all parts.
    pub weight: f64,
}

/// The oscillations that a sudden load, in proportion to mass, excites in what is held.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Oscillations {
    /// Those of each part that something holds, slow ones first.
    parts: Vec<Vec<Oscillation>>,
}

/// What a step makes of a linear oscillation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Growth {
    /// The logarithm of its amplitude after the step over that before it.
    pub logarithm: f64,
    /// The angle [rad] by which it turns.
    pub angle: f64,
}

impl Oscillations {
    /// Of each part that something holds.
    pub fn new(parts: impl IntoIterator<Item = Vec<Oscillation>>) -> Self {
        let is_oscillation =
            |one: &Oscillation| one.period > 0.0 && one.period.is_finite() && one.weight > 0.0;
        let sorted = |mut all: Vec<Oscillation>| {
            all.retain(is_oscillation);
            all.sort_by(|a, b| b.period.total_cmp(&a.period));
            all
        };
        let parts = parts.into_iter().map(sorted).filter(|all| !all.is_empty()).collect();
        Self { parts }
    }

    /// Those of each part that something holds, of all axes, slow ones first.
    pub fn parts(&self) -> &[Vec<Oscillation>] {
        &self.parts
    }

    /// The period [s] of the slowest oscillation, of the part that oscillates fastest; infinite where nothing is held.
    pub fn slowest_period(&self) -> f64 {
        self.parts.iter().map(|all| all[0].period).fold(f64::INFINITY, f64::min)
    }

    /// The error of motion over [`SECONDS`] in steps [s] that make so much of an oscillation by whose angle a step
    /// should turn [rad]: root mean square, over the root mean square displacement, of the part for which it is the largest. Of
    /// parts that hardly move less counts, see above.
    pub fn error(&self, step: f64, growth: impl Fn(f64) -> Growth) -> f64 {
        let moved = |all: &Vec<Oscillation>| all.iter().map(|one| one.weight).sum::<f64>().sqrt();
        let most = self.parts.iter().map(moved).fold(0.0, f64::max);
        let of_part = |all: &Vec<Oscillation>| {
            let (mut error, mut moved) = (0.0, 0.0);
            for &Oscillation { period, weight } in all {
                let omega = 2.0 * PI / period;
                let Growth { logarithm, angle } = growth(omega * step);
                for moment in 1..=MOMENTS {
                    let time = SECONDS * f64::from(moment) / f64::from(MOMENTS);
                    let steps = time / step;
                    let exact = libm::cos(omega * time);
                    let ours = libm::exp(steps * logarithm) * libm::cos(steps * angle);
                    error += weight * (ours - exact) * (ours - exact);
                    moved += weight * (1.0 - exact) * (1.0 - exact);
                }
            }
            if moved > 0.0 { (error / moved).sqrt() } else { 0.0 }
        };
        let seen = |all: &Vec<Oscillation>| (moved(all) / (SEEN * most)).min(1.0);
        self.parts.iter().map(|all| seen(all) * of_part(all)).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps that turn too far by a share make an error of that share of the angle, as long as it is small: of one
    /// oscillation the means are known.
    #[test]
    fn the_error_of_a_slow_phase() {
        let period = 0.02;
        let one = Oscillations::new([vec![Oscillation { period, weight: 2.0 }]]);
        let late = 1e-4;
        let found = one.error(1e-4, |angle| Growth { logarithm: 0.0, angle: angle * (1.0 + late) });
        // <(late w t sin w t)^2> = (late w T)^2 / 6, <(1 - cos w t)^2> = 3/2.
        let expected = late * 2.0 * PI / period * SECONDS / 3.0;
        assert!((found / expected - 1.0).abs() < 0.25, "{found} of {expected}");
    }

    /// The part with the largest error counts, and within it every oscillation by its weight.
    #[test]
    fn parts_and_weights() {
        let of = |period, weight| Oscillation { period, weight };
        let euler = |angle: f64| Growth { logarithm: -0.5 * angle * angle, angle };
        let alone = |period| Oscillations::new([vec![of(period, 1.0)]]).error(1e-3, euler);
        let [slow, fast] = [0.5, 0.1].map(alone);
        assert!(slow < fast);
        let apart = |least| Oscillations::new([vec![of(0.5, 3.0)], vec![of(0.1, least)]]);
        assert!((apart(0.01).error(1e-3, euler) / fast - 1.0).abs() < 1e-9);
        // A part that moves by a fortieth of what the other does.
        let hardly_seen = apart(3.0 / 1600.0).error(1e-3, euler);
        assert!((hardly_seen / (0.5 * fast) - 1.0).abs() < 1e-9, "{hardly_seen} of {fast}");
        // The slow one's own error is left.
        assert!((apart(1e-12).error(1e-3, euler) / slow - 1.0).abs() < 1e-9);
        let apart = apart(0.01);
        assert_eq!(apart.slowest_period(), 0.1);
        let together = Oscillations::new([vec![of(0.1, 1e-3), of(0.5, 3.0)]]);
        let both = together.error(1e-3, euler);
        assert!(slow < both && both < 1.1 * slow, "{both} of {slow}");
        assert_eq!(together.slowest_period(), 0.5);
        let nothing = Oscillations::new([vec![of(f64::INFINITY, 1.0)], Vec::new()]);
        assert_eq!(nothing.slowest_period(), f64::INFINITY);
        assert_eq!(nothing.error(1e-3, euler), 0.0);
    }
}
