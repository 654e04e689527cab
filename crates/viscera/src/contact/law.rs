//! The law of contact: energies of a sample of tissue at a tool, their forces and curvatures.
//!
//! ```text
//! psi(d) = k/2 max(dh - d, 0)^2 + (B - 1) k/2 max(dh/2 - d, 0)^2      energy per area [J/m^2], d distance [m]
//! p = -psi' [Pa],  c = psi'' = k or B k [Pa/m];   E = A psi,  f = A p n
//! curvature of E: A (c n n^T - p H),  |H| the distance's own curvature
//! E_f = K |u|^2/2 where K |u| <= L, else L (|u| - L/(2 K))            friction: u slip from the anchor, K = k_t A [N/m]
//! f_t = -u min(K, L/|u|),   L = mu N of the step before               its curvature is at most min(K, L/|u|)
//! ```
//!
//! Piecewise quadratic and finite everywhere: a tool that has moved into tissue still has a force. Ten times stiffer below
//! half the thickness, so that a gap stays. Friction is a spring to an anchor that gives way at `L` (Huber's function),
//! convex and continuous in its slope: what rests does not creep, and both are an exact part of the step's potential.

use crate::scalar::{Mat3, Vec3};

/// How many times stiffer contact is below half its thickness.
pub const SECOND_STAGE: f64 = 10.0;

/// The constants of contact at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foundation {
    /// `A`: the sample's area at rest [m^2].
    pub area: f64,
    /// `k` [Pa/m].
    pub stiffness: f64,
    /// `dh`: distance at which contact begins [m].
    pub thickness: f64,
}

/// Contact at a distance: derivatives of the energy of a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Squeezed {
    /// [J].
    pub energy: f64,
    /// Normal force [N], away from the tool.
    pub force: f64,
    /// Its second derivative [N/m].
    pub stiffness: f64,
}

impl Foundation {
    /// At a distance [m] from the tool.
    pub fn squeeze(&self, distance: f64) -> Squeezed {
        let gap = self.thickness - distance;
        if gap <= 0.0 {
            return Squeezed::default();
        }
        let k = self.area * self.stiffness;
        let deep = (gap - 0.5 * self.thickness).max(0.0);
        let more = (SECOND_STAGE - 1.0) * k;
        Squeezed {
            energy: 0.5 * k * gap * gap + 0.5 * more * deep * deep,
            force: k * gap + more * deep,
            stiffness: if deep > 0.0 { k + more } else { k },
        }
    }

    /// The stiffness [N/m] that a sample at a distance [m] may have before it has moved by half the thickness.
    pub fn stiffness_near(&self, distance: f64) -> f64 {
        self.squeeze(distance - 0.5 * self.thickness).stiffness
    }
}

/// Constants of friction at one sample in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction {
    /// Where the sample would be without slip [m].
    pub anchor: Vec3<f64>,
    /// `K` [N/m].
    pub stiffness: f64,
    /// `L` [N]; infinite where it is locked.
    pub limit: f64,
}

/// Friction at a slip: derivatives of its energy.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dragged {
    /// [J].
    pub energy: f64,
    /// On the tissue [N].
    pub force: Vec3<f64>,
    /// A bound of the second derivative in every tangential direction [N/m].
    pub stiffness: f64,
}

impl Friction {
    /// At a slip [m] from the anchor.
    pub fn drag(&self, slip: Vec3<f64>) -> Dragged {
        let Self { stiffness, limit, .. } = *self;
        let length = slip.length();
        if stiffness * length <= limit {
            return Dragged {
                energy: 0.5 * stiffness * length * length,
                force: -slip * stiffness,
                stiffness,
            };
        }
        // The bound along the slip too: with the true second derivative, zero, steps go too far.
        let share = limit / length;
        Dragged {
            energy: limit * (length - 0.5 * limit / stiffness),
            force: -slip * share,
            stiffness: share,
        }
    }
}

/// What a vector has across a normal of length 1.
pub fn tangential(vector: Vec3<f64>, normal: Vec3<f64>) -> Vec3<f64> {
    vector - normal * normal.dot(vector)
}

/// `c n n^T + t (I - n n^T)`.
pub fn block(normal: Vec3<f64>, along: f64, across: f64) -> Mat3<f64> {
    Mat3::IDENTITY * across + Mat3::outer(normal, normal) * (along - across)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::vec3;

    const FOUNDATION: Foundation = Foundation { area: 2e-6, stiffness: 1e7, thickness: 1e-3 };

    #[test]
    fn forces_are_derivatives_of_the_energy() {
        let h = 1e-9;
        for i in -40..60 {
            let d = 2.5e-5 * f64::from(i) + 1e-7;
            let at = |d: f64| FOUNDATION.squeeze(d);
            let force = (at(d - h).energy - at(d + h).energy) / (2.0 * h);
            assert!((force - at(d).force).abs() < 1e-6 * FOUNDATION.squeeze(-1e-3).force, "{d}");
            let stiffness = (at(d - h).force - at(d + h).force) / (2.0 * h);
            assert!((stiffness - at(d).stiffness).abs() < 1e-5 * at(-1.0).stiffness, "{d}");
        }
    }

    #[test]
    fn contact_begins_at_its_thickness_and_hardens_at_half_of_it() {
        let k = 20.0;
        assert_eq!(FOUNDATION.squeeze(1e-3), Squeezed::default());
        assert!((FOUNDATION.squeeze(0.8e-3).force - k * 0.2e-3).abs() < 1e-15);
        assert!((FOUNDATION.squeeze(0.0).force - k * (1e-3 + 9.0 * 0.5e-3)).abs() < 1e-15);
        assert_eq!(
            FOUNDATION.squeeze(0.1e-3).stiffness,
            10.0 * FOUNDATION.squeeze(0.9e-3).stiffness
        );
        assert_eq!(FOUNDATION.stiffness_near(1.2e-3), FOUNDATION.squeeze(0.9e-3).stiffness);
        assert_eq!(FOUNDATION.stiffness_near(1.6e-3), 0.0);
    }

    #[test]
    fn friction_is_the_slope_of_its_energy_and_gives_way() {
        let friction = Friction { anchor: Vec3::ZERO, stiffness: 50.0, limit: 0.01 };
        let h = 1e-9;
        for length in [1e-5, 1e-4, 1.9e-4, 2.1e-4, 1e-3] {
            let slip = vec3(0.6, 0.0, 0.8) * length;
            for axis in 0..3 {
                let mut step = Vec3::ZERO;
                step[axis] = h;
                let [a, b] = [slip + step, slip - step].map(|slip| friction.drag(slip).energy);
                let rough = (b - a) / (2.0 * h);
                assert!((rough - friction.drag(slip).force[axis]).abs() < 1e-8, "{length}");
            }
            let at = friction.drag(slip);
            assert!(at.force.length() <= 0.01 * (1.0 + 1e-12));
            // The bound holds along the slip and across it.
            for direction in [vec3(0.6, 0.0, 0.8), vec3(0.0, 1.0, 0.0)] {
                let [a, b] =
                    [1.0, -1.0].map(|sign| friction.drag(slip + direction * (sign * h)).force);
                let second = (b - a).dot(direction) / (2.0 * h);
                assert!(second <= at.stiffness * (1.0 + 1e-4) && second > -1e-4, "{length}");
            }
        }
    }

    #[test]
    fn blocks_have_their_stiffness_along_and_across() {
        let normal = vec3(0.6, 0.0, 0.8);
        let block = block(normal, 7.0, 2.0);
        assert!((block * normal - normal * 7.0).length() < 1e-14);
        let across = tangential(vec3(0.0, 1.0, 1.0), normal);
        assert!((block * across - across * 2.0).length() < 1e-14);
    }
}
