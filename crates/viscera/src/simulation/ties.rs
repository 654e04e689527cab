//! What a simulation says of ties between its bodies.

use super::Simulation;
use super::force_text::Unit;
use crate::scalar::{Real, Vec3};
use std::fmt;

/// What one of the scene's ties holds.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct TieForce {
    /// The tie's name in the scene.
    pub name: String,
    /// At how many points of the surface it was tied,
    pub points: usize,
    /// and at how many it is torn.
    pub torn: usize,
    /// Force [N] of the others on the tissue that is tied (`from`); on what it is tied to, minus that.
    pub force: [f64; 3],
}

impl fmt::Display for TieForce {
    /// One line of a table, to four decimals unless a precision says otherwise.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = f.precision().unwrap_or(4);
        let Self { name, points, torn, force } = self;
        let force = Vec3::<f64>::from_f64(*force).length();
        let unit = Unit::of(force, digits);
        let (force, prefix) = (unit.number(force), unit.prefix);
        write!(f, "{name}: {torn} of {points} points torn, force {force} {prefix}N")
    }
}

impl<S: Real> Simulation<S> {
    /// Forces of the scene's ties where tissue is now, and how many points of each are torn.
    pub fn tie_forces(&self) -> Vec<TieForce> {
        let (skin, torn) = (&self.model.skin, &self.state.contact.torn);
        let place = |vertices: [u32; 4], weights: [f64; 4]| {
            let at = |v: u32| self.state.positions[v as usize].cast::<f64>();
            vertices.iter().zip(weights).fold(Vec3::ZERO, |sum, (&v, weight)| sum + at(v) * weight)
        };
        let new =
            |name: &str| TieForce { name: name.to_owned(), points: 0, torn: 0, force: [0.0; 3] };
        let mut forces: Vec<_> = self.scene.ties.iter().map(|tie| new(&tie.name)).collect();
        let mut sums = vec![Vec3::<f64>::ZERO; forces.len()];
        for (number, tie) in skin.ties.iter().enumerate() {
            let Some(of_group) = forces.get_mut(tie.group as usize) else { continue };
            of_group.points += 1;
            if torn.get(number).copied().unwrap_or(false) {
                of_group.torn += 1;
                continue;
            }
            let sample = &skin.samples[tie.sample as usize];
            let corners = skin.triangles[tie.triangle as usize].map(|point| {
                let point = &skin.points[point as usize];
                place(point.vertices, point.weights)
            });
            let [_, unstretched] = tie.unstretched(corners);
            let away = place(sample.vertices, sample.weights) - tie.point(corners);
            sums[tie.group as usize] += (unstretched - away) * tie.stiffness;
        }
        for (force, sum) in forces.iter_mut().zip(sums) {
            force.force = sum.to_array();
        }
        forces
    }
}
