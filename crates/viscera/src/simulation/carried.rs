//! What ties carry of bodies that nothing else holds, where they rest under gravity as they were given.
//!
//! ```text
//! f_s = k_s (u + w x r_s)              of the ties' points s, at r_s from their middle, on a body that is rigid
//! sum f_s = -F,  sum r_s x f_s = -T    F, T: force and torque of its weight, and of what hangs on it itself
//! ```
//!
//! A body that fixings hold carries itself: ties between two such bodies are at rest. Of the others each hangs on those
//! that are nearer to a fixing, counted by the ties between.

use super::assemble::Assembly;
use crate::contact::{Skin, Tie, tie_rest};
use crate::scalar::{Mat3, Vec3};

/// Forces [N] on vertices of all bodies.
pub(super) type Forces = Vec<(u32, Vec3<f64>)>;

/// What ties carry.
#[derive(Default)]
pub(super) struct Hung {
    /// On the body, and on what it hangs on.
    pub forces: Forces,
    /// Ties by their numbers, and where each is without force, see [`Tie::rest`].
    pub rests: Vec<(usize, [f64; 3])>,
}

/// What may be left of force and torque, as a share of the force.
const CARRIED: f64 = 1e-6;

/// How bodies hang on each other.
pub(super) struct Carrying {
    /// Of each body, how many ties lead to one that is held; nothing where none do.
    levels: Vec<Option<usize>>,
}

/// A point of the surface: vertices and weights.
type Point = Vec<(u32, f64)>;

impl Carrying {
    /// With bodies that fixings hold.
    pub fn new(skin: &Skin, is_held: &[bool]) -> Self {
        let mut levels: Vec<_> = is_held.iter().map(|held| held.then_some(0)).collect();
        for level in 0..levels.len() {
            for tie in &skin.ties {
                let [a, b] = bodies(skin, tie);
                for (from, to) in [(a, b), (b, a)] {
                    if levels[from] == Some(level) && levels[to].is_none() {
                        levels[to] = Some(level + 1);
                    }
                }
            }
        }
        Self { levels }
    }

    /// Whether fixings hold the body, or ties to one that is carried.
    pub fn is_carried(&self, body: usize) -> bool {
        self.levels[body].is_some()
    }

    /// Bodies that hang, those first on which nothing hangs.
    pub fn hanging(&self) -> Vec<usize> {
        let mut hanging: Vec<_> =
            (0..self.levels.len()).filter(|&body| self.levels[body] > Some(0)).collect();
        hanging.sort_by_key(|&body| std::cmp::Reverse(self.levels[body]));
        hanging
    }

    /// Lets the ties of a body that hangs carry `loads`, its weight and what hangs on it. Returns the forces of the ties, on it
    /// and on what it hangs on, and where they are without force; nothing where they cannot carry it.
    pub fn hang(&self, assembly: &Assembly, body: usize, loads: &Forces) -> Option<Hung> {
        let skin = assembly.builder.skin();
        let places = assembly.builder.positions();
        let at = |point: &Point| point.iter().map(|&(v, w)| places[v as usize] * w).sum_of();
        let carries = |tie: &usize| {
            let [a, b] = bodies(skin, &skin.ties[*tie]);
            let other = if a == body { b } else { a };
            (a == body || b == body) && self.levels[other] < self.levels[body]
        };
        let numbers: Vec<usize> = (0..skin.ties.len()).filter(carries).collect();
        let ends: Vec<[Point; 2]> = numbers.iter().map(|&n| ends(skin, &skin.ties[n])).collect();
        // Where the body is held, and how stiffly.
        let own: Vec<usize> =
            numbers.iter().map(|&n| usize::from(bodies(skin, &skin.ties[n])[0] != body)).collect();
        let held = ends.iter().zip(&own).zip(&numbers);
        let held: Vec<(Vec3<f64>, f64)> =
            held.map(|((ends, &own), &n)| (at(&ends[own]), skin.ties[n].stiffness)).collect();
        let loads: Vec<_> = loads.iter().map(|&(v, load)| (places[v as usize], load)).collect();
        let carried = rigid(&held, &loads)?;
        let mut hung = Hung::default();
        for (i, &force) in carried.iter().enumerate() {
            let tie = skin.ties[numbers[i]];
            let on_sample = if own[i] == 0 { force } else { -force };
            let corners = skin.triangles[tie.triangle as usize].map(|p| at(&of_skin(skin, p, 1.0)));
            let away = at(&ends[i][0]) - at(&ends[i][1]) + on_sample * (1.0 / tie.stiffness);
            hung.rests.push((numbers[i], tie_rest(away, corners)?));
            for (end, force) in ends[i].iter().zip([on_sample, -on_sample]) {
                hung.forces.extend(end.iter().map(|&(v, weight)| (v, force * weight)));
            }
        }
        Some(hung)
    }
}

/// The body that is tied, and the one that it is tied to.
fn bodies(skin: &Skin, tie: &Tie) -> [usize; 2] {
    [skin.sample_bodies[tie.sample as usize], skin.bodies[tie.triangle as usize]]
        .map(|body| body as usize)
}

/// The sample, and the point of the triangle.
fn ends(skin: &Skin, tie: &Tie) -> [Point; 2] {
    let sample = &skin.samples[tie.sample as usize];
    let own = sample.vertices.into_iter().zip(sample.weights).collect();
    let corners = skin.triangles[tie.triangle as usize].into_iter().zip(tie.weights);
    [own, corners.flat_map(|(point, weight)| of_skin(skin, point, weight)).collect()]
}

/// A point of the skin, with a share of its weights.
fn of_skin(skin: &Skin, point: u32, share: f64) -> Point {
    let point = &skin.points[point as usize];
    point.vertices.into_iter().zip(point.weights.map(|weight| weight * share)).collect()
}

/// Forces of springs at places, of these stiffnesses, that carry loads at others.
fn rigid(held: &[(Vec3<f64>, f64)], loads: &[(Vec3<f64>, Vec3<f64>)]) -> Option<Vec<Vec3<f64>>> {
    let whole: f64 = held.iter().map(|(_, stiffness)| stiffness).sum();
    let middle = held.iter().map(|&(x, stiffness)| x * (stiffness / whole)).sum_of();
    let force = loads.iter().map(|&(_, load)| load).sum_of();
    let torque = loads.iter().map(|&(x, load)| (x - middle).cross(load)).sum_of();
    // About the middle of stiffness shift and turn do not see each other: `sum k (r.r I - r r^T) w = -T`.
    let mut inertia = Mat3::ZERO;
    for &(x, stiffness) in held {
        let arm = x - middle;
        let about = Mat3::IDENTITY * arm.length_squared() - Mat3::outer(arm, arm);
        inertia = inertia + about * stiffness;
    }
    let turn = inertia.inverse() * -torque;
    let shift = force * (-1.0 / whole);
    let carried: Vec<Vec3<f64>> =
        held.iter().map(|&(x, stiffness)| (shift + turn.cross(x - middle)) * stiffness).collect();
    // Points along a line carry no torque about it.
    let torques = held.iter().zip(&carried).map(|((x, _), force)| (*x - middle).cross(*force));
    let left = (torque + torques.sum_of()).length();
    let reach = held.iter().map(|(x, _)| (*x - middle).length()).fold(0.0, f64::max);
    (!held.is_empty() && left <= CARRIED * force.length() * reach).then_some(carried)
}

/// Adds up vectors.
trait SumOf {
    fn sum_of(self) -> Vec3<f64>;
}

impl<I: Iterator<Item = Vec3<f64>>> SumOf for I {
    fn sum_of(self) -> Vec3<f64> {
        self.fold(Vec3::ZERO, |sum, x| sum + x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::vec3;

    fn about(center: Vec3<f64>, forces: &[(Vec3<f64>, Vec3<f64>)]) -> (Vec3<f64>, Vec3<f64>) {
        let force = forces.iter().map(|&(_, force)| force).sum_of();
        (force, forces.iter().map(|&(x, force)| (x - center).cross(force)).sum_of())
    }

    #[test]
    fn springs_carry_force_and_torque() {
        let held =
            [(vec3(0.1, 0.0, 0.3), 5.0), (vec3(0.2, 0.1, 0.3), 1.0), (vec3(0.0, 0.3, 0.2), 2.0)];
        let loads =
            [(vec3(0.5, 0.2, 0.0), vec3(0.0, 1.0, -9.0)), (Vec3::ZERO, vec3(2.0, 0.0, 0.0))];
        let carried = rigid(&held, &loads).expect("three points hold a body");
        let carried: Vec<_> = held.iter().map(|(x, _)| *x).zip(carried).collect();
        let center = vec3(-0.3, 0.1, 0.7);
        let ((force, torque), (load, moment)) = (about(center, &carried), about(center, &loads));
        assert!((force + load).length() < 1e-12 && (torque + moment).length() < 1e-12);
    }

    /// They carry what does not turn about the line that they lie on, and nothing else.
    #[test]
    fn two_points_do_not_hold_a_body() {
        let held = [(Vec3::ZERO, 1.0), (vec3(1.0, 0.0, 0.0), 1.0)];
        assert_eq!(rigid(&held, &[(vec3(0.5, 1.0, 0.0), vec3(0.0, 0.0, 1.0))]), None);
        assert_eq!(rigid(&[], &[(Vec3::ZERO, vec3(0.0, 0.0, 1.0))]), None);
    }
}
