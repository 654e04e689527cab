//! A sample of tissue and the triangle of tissue that it meets in one step.
//!
//! ```text
//! d = nu.(p - q) + shift,   p = sum_a b_a x_a the sample, q = sum_b beta_b x_b the nearest point of the triangle
//! E = A psi(d) + E_f(u),   u = (I - nu nu^T)((p - q) - (p_n - q_n)) + u_n           f on p, -f on q
//! end of step:  u *= min(1, mu min(N, N_new)/(K |u|)),   N = N_new;  nothing is kept where N_new = 0
//! tie:  E = K/2 |p - q - r|^2
//! ```
//!
//! Triangle, weights, normal `nu` from the triangle to the sample and `u_n` are constants of a step, so that `d` is affine in
//! up to 16 vertices and the energy convex. Forces act along `nu` through both points: momentum is kept to round-off, and
//! where the step begins angular momentum as well. Both sides of a contact have samples of their own, each with half of its
//! area. What friction keeps is the slip `u`, as a sum over the triangle's corners, which turns with the tissue.

use super::law::{Dragged, Foundation, Friction, Squeezed, tangential};
use super::search::Closest;
use super::touch::Felt;
use crate::scalar::Vec3;

/// What is kept of a pair that is pressed, from step to step.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Kept {
    /// The number of the sample on the skin.
    pub sample: u32,
    /// The triangle that it met.
    pub triangle: u32,
    /// Of the slip, in terms of the triangle's edges from its first corner.
    pub slip: [f64; 2],
    /// Normal force at the end of the last step [N].
    pub pressed: f64,
    /// Energy of contact then, without that of friction [J].
    pub energy: f64,
}

/// How a pair holds together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bond {
    /// Contact: it pushes, and rubs.
    Contact {
        /// The constants of contact.
        foundation: Foundation,
        /// What distances are longer by, because they were less than the thickness at rest [m].
        shift: f64,
        /// Stiffness [N/m] and limit [N] of friction; nothing in the first step of a contact.
        friction: Option<(f64, f64)>,
        /// The coefficient of friction.
        coefficient: f64,
    },
    /// A tie, which pulls as well.
    Tie {
        /// The tie's number.
        number: u32,
        /// [N/m].
        stiffness: f64,
        /// `r`: from the triangle to the sample without force [m].
        rest: Vec3<f64>,
    },
}

/// A sample and a triangle in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// The place of the sample in the layout.
    pub sample: u32,
    /// The triangle.
    pub triangle: u32,
    /// Barycentric weights of its point.
    pub weights: [f64; 3],
    /// From the triangle to the sample, of length 1.
    pub normal: Vec3<f64>,
    /// `u_n - (p_n - q_n)` [m].
    pub offset: Vec3<f64>,
    /// How it holds together.
    pub bond: Bond,
}

/// Closer than this [m] the direction between two points means little: the triangle's own counts.
const CLOSE: f64 = 1e-5;

impl Closest {
    /// Signed distance [m], below zero behind the triangle, and the normal from the triangle to the point.
    pub fn signed(&self) -> (f64, Vec3<f64>) {
        let outer = self.normal * (1.0 / self.normal.length());
        let length = self.away.length();
        let along = outer.dot(self.away);
        if length < CLOSE {
            return (along, outer);
        }
        let sign = if along < 0.0 { -1.0 } else { 1.0 };
        (sign * length, self.away * (sign / length))
    }
}

impl Pair {
    /// What the sample feels from `away` [m], its way from the triangle's point.
    pub fn feel(&self, away: Vec3<f64>) -> Felt {
        let none = Felt {
            distance: 0.0,
            energy: 0.0,
            force: Vec3::ZERO,
            pressed: 0.0,
            normal: self.normal,
            stiffness: 0.0,
            drag: 0.0,
            tie: 0.0,
            turning: 0.0,
        };
        match self.bond {
            Bond::Contact { foundation, shift, friction, .. } => {
                let distance = self.normal.dot(away) + shift;
                let Squeezed { energy, force, stiffness } = foundation.squeeze(distance);
                let mut felt = Felt {
                    distance,
                    energy,
                    force: self.normal * force,
                    pressed: force,
                    stiffness,
                    ..none
                };
                if let Some((stiffness, limit)) = friction {
                    let friction = Friction { anchor: Vec3::ZERO, stiffness, limit };
                    let Dragged { energy, force, stiffness } = friction.drag(self.slip(away));
                    felt.energy += energy;
                    felt.force += force;
                    felt.drag = stiffness;
                }
                felt
            }
            Bond::Tie { stiffness, rest, .. } => {
                let off = away - rest;
                Felt {
                    distance: self.normal.dot(away),
                    energy: 0.5 * stiffness * off.length_squared(),
                    force: -off * stiffness,
                    drag: stiffness,
                    tie: stiffness,
                    ..none
                }
            }
        }
    }

    /// Energy of contact [J] with the sample `away` [m] from the triangle's point, without that of friction; none of a tie.
    pub fn squeezed(&self, away: Vec3<f64>) -> f64 {
        match self.bond {
            Bond::Contact { foundation, shift, .. } => {
                foundation.squeeze(self.normal.dot(away) + shift).energy
            }
            Bond::Tie { .. } => 0.0,
        }
    }

    /// How far the sample has slipped along the triangle [m].
    fn slip(&self, away: Vec3<f64>) -> Vec3<f64> {
        tangential(away + self.offset, self.normal)
    }

    /// What the sample feels `away` [m] from the triangle's point in explicit motion: friction gives way at once at `mu`
    /// times the normal force that is there.
    pub fn slip_now(&mut self, away: Vec3<f64>) -> Felt {
        let Bond::Contact { foundation, shift, friction: before, coefficient } = self.bond else {
            return self.feel(away);
        };
        let stiffness = foundation.area * foundation.stiffness;
        let limit = coefficient * self.feel(away).pressed;
        let mut friction = None;
        if limit > 0.0 {
            // A contact that has just begun has not slipped.
            let slip = if before.is_some() { self.slip(away) } else { Vec3::ZERO };
            let elastic = stiffness * slip.length();
            let share = if elastic > limit { limit / elastic } else { 1.0 };
            self.offset = slip * share - away;
            friction = Some((stiffness, limit));
        }
        self.bond = Bond::Contact { foundation, shift, friction, coefficient };
        self.feel(away)
    }

    /// The most that second derivatives add up to before the sample has moved by half the thickness [N/m].
    pub fn stiffness_near(&self, felt: &Felt) -> f64 {
        match self.bond {
            Bond::Contact { foundation, coefficient, .. } => {
                let near = foundation.stiffness_near(felt.distance).max(felt.stiffness);
                let rubs = near > 0.0 && coefficient > 0.0;
                let drag = if rubs { foundation.area * foundation.stiffness } else { 0.0 };
                near + drag.max(felt.drag)
            }
            Bond::Tie { stiffness, .. } => stiffness,
        }
    }

    /// What is kept after a step that has ended with the sample `away` [m] from the triangle's point, where it feels this;
    /// nothing where they have parted. `corners` are the triangle's then [m].
    pub fn keep(
        &self,
        number: u32,
        away: Vec3<f64>,
        felt: &Felt,
        corners: [Vec3<f64>; 3],
    ) -> Option<Kept> {
        let Bond::Contact { friction, coefficient, .. } = self.bond else { return None };
        if felt.pressed <= 0.0 {
            return None;
        }
        let slip = friction.map_or([0.0; 2], |(stiffness, limit)| {
            let slip = self.slip(away);
            let elastic = stiffness * slip.length();
            let most = limit.min(coefficient * felt.pressed);
            let share = if elastic > most { most / elastic } else { 1.0 };
            in_edges(slip * share, corners)
        });
        let energy = self.squeezed(away);
        Some(Kept { sample: number, triangle: self.triangle, slip, pressed: felt.pressed, energy })
    }
}

impl Closest {
    /// The way from the triangle to the point, as [`Tie::rest`](super::skin::Tie::rest) has it.
    pub(crate) fn in_triangle(&self, corners: [Vec3<f64>; 3]) -> [f64; 3] {
        in_triangle(self.away, self.normal, corners)
    }
}

/// The same of any vector [m], `normal` of any length.
fn in_triangle(away: Vec3<f64>, normal: Vec3<f64>, corners: [Vec3<f64>; 3]) -> [f64; 3] {
    let outer = normal * (1.0 / normal.length());
    let along = outer.dot(away);
    let [on_b, on_c] = in_edges(away - outer * along, corners);
    [on_b, on_c, along]
}

/// What [`Tie::rest`](super::skin::Tie::rest) is, for the vector [m] that [`Tie::unstretched`](super::skin::Tie::unstretched)
/// is to be where the triangle's corners are at these places; nothing where they span no triangle.
pub(crate) fn tie_rest(unstretched: Vec3<f64>, corners: [Vec3<f64>; 3]) -> Option<[f64; 3]> {
    let [a, b, c] = corners;
    let rest = in_triangle(unstretched, (b - a).cross(c - a), corners);
    rest.iter().all(|x| x.is_finite()).then_some(rest)
}

/// A vector [m] along a triangle in terms of its edges from the first corner; zero where they span nothing.
fn in_edges(vector: Vec3<f64>, [a, b, c]: [Vec3<f64>; 3]) -> [f64; 2] {
    let (ab, ac) = (b - a, c - a);
    let (bb, bc, cc) = (ab.dot(ab), ab.dot(ac), ac.dot(ac));
    let determinant = bb * cc - bc * bc;
    let (on_b, on_c) = (vector.dot(ab), vector.dot(ac));
    let found = [(on_b * cc - on_c * bc) / determinant, (on_c * bb - on_b * bc) / determinant];
    if found.iter().all(|x| x.is_finite()) { found } else { [0.0; 2] }
}

/// The vector [m] that [`Kept::slip`] is now.
pub fn from_edges([on_b, on_c]: [f64; 2], [a, b, c]: [Vec3<f64>; 3]) -> Vec3<f64> {
    (b - a) * on_b + (c - a) * on_c
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::search::closest;
    use crate::scalar::vec3;

    fn pair(normal: Vec3<f64>, friction: Option<(f64, f64)>) -> Pair {
        let foundation = Foundation { area: 4e-6, stiffness: 1e7, thickness: 1e-3 };
        Pair {
            sample: 0,
            triangle: 0,
            weights: [0.2, 0.3, 0.5],
            normal,
            offset: vec3(1e-5, 3e-5, -2e-5),
            bond: Bond::Contact { foundation, shift: 0.2e-3, friction, coefficient: 0.5 },
        }
    }

    #[test]
    fn forces_are_slopes_and_curvatures_cover_their_change() {
        let normal = vec3(0.36, 0.48, 0.8);
        let tie = Bond::Tie { number: 0, stiffness: 40.0, rest: vec3(1e-4, 0.0, 2e-4) };
        for bond in [
            pair(normal, None).bond,
            pair(normal, Some((50.0, 1e-3))).bond,
            pair(normal, Some((50.0, 1.0))).bond,
            tie,
        ] {
            let pair = Pair { bond, ..pair(normal, None) };
            for distance in [-0.3e-3, 0.1e-3, 0.55e-3, 0.9e-3] {
                let away = normal * distance + vec3(2e-5, -3e-5, 1e-5);
                let felt = pair.feel(away);
                let h = 1e-9;
                for axis in 0..3 {
                    let mut step = Vec3::ZERO;
                    step[axis] = h;
                    let [a, b] = [step, -step].map(|step| pair.feel(away + step));
                    let slope = (b.energy - a.energy) / (2.0 * h);
                    assert!((slope - felt.force[axis]).abs() < 1e-6, "{bond:?}");
                    let second = (b.force - a.force)[axis] / (2.0 * h);
                    let bound = felt.curvature().columns[axis][axis];
                    assert!(second <= bound * (1.0 + 1e-5) + 1e-4, "{second} {bound} {bond:?}");
                }
            }
        }
    }

    /// A triangle and a sample on it that turn together keep their slip, which turns with them; it gives way at the limit.
    #[test]
    fn what_is_kept_turns_with_the_tissue() {
        let turn = crate::scalar::rigid::rotation_matrix(vec3(0.3, -0.5, 0.2));
        let triangle = [vec3(0.0, 0.0, 0.0), vec3(4e-3, 1e-3, 0.0), vec3(1e-3, 5e-3, 0.0)];
        let p = vec3(1.5e-3, 2e-3, 0.4e-3);
        let near = closest(p, triangle);
        let (distance, normal) = near.signed();
        assert!(
            (distance - 0.4e-3).abs() < 1e-15 && (normal - vec3(0.0, 0.0, 1.0)).length() < 1e-12
        );
        let slip = vec3(3e-5, -4e-5, 0.0);
        let at = pair(normal, Some((50.0, 1.0)));
        let pair = Pair { offset: slip - near.away, weights: near.weights, ..at };
        let felt = pair.feel(near.away);
        let kept = pair.keep(7, near.away, &felt, triangle).expect("pressed");
        assert!((from_edges(kept.slip, triangle) - slip).length() < 1e-18);
        let turned = triangle.map(|corner| turn * corner);
        assert!((from_edges(kept.slip, turned) - turn * slip).length() < 1e-18);
        // Friction holds against the slip until it is too weak.
        assert!((felt.force - normal * felt.pressed + slip * 50.0).length() < 1e-12);
        let Bond::Contact { foundation, shift, coefficient, .. } = pair.bond else { panic!() };
        let weak = Some((50.0, 1e-3));
        let bond = Bond::Contact { foundation, shift, coefficient, friction: weak };
        let pair = Pair { bond, ..pair };
        let kept = pair.keep(7, near.away, &pair.feel(near.away), triangle).expect("pressed");
        assert!((50.0 * from_edges(kept.slip, triangle).length() - 1e-3).abs() < 1e-15);
        // What has parted is forgotten.
        let apart = near.away + normal * 1e-3;
        assert_eq!(pair.keep(7, apart, &pair.feel(apart), triangle), None);
    }

    #[test]
    fn behind_a_triangle_distances_are_negative() {
        let triangle = [vec3(0.0, 0.0, 0.0), vec3(4e-3, 0.0, 0.0), vec3(0.0, 5e-3, 0.0)];
        let (distance, normal) = closest(vec3(1e-3, 1e-3, -2e-3), triangle).signed();
        assert!((distance + 2e-3).abs() < 1e-15 && normal.z > 0.999);
        // Beside it the normal leads from its edge.
        let (distance, normal) = closest(vec3(1e-3, -1e-3, 1e-3), triangle).signed();
        assert!((distance - 2f64.sqrt() * 1e-3).abs() < 1e-15);
        assert!((normal - vec3(0.0, -1.0, 1.0) * 0.5f64.sqrt()).length() < 1e-12);
    }
}
