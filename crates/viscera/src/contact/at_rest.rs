//! Bodies that are close to each other, or overlap, at rest.

use super::meeting::{DEEPEST, Looking, Moment, depths, turn_normals};
use super::skin::{Skin, TissueContact, Topology, mean};
use super::tree::{SkinNow, Tree, Wanted};
use crate::mesh::embed::barycentric_weights;
use crate::scalar::Vec3;
use std::collections::BTreeMap;
use std::ops::Range;

/// Two bodies that are close at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overlap {
    /// Their numbers.
    pub bodies: [usize; 2],
    /// [m], below zero where they overlap.
    pub distance: f64,
}

impl Skin {
    /// After all bodies were added: what is near what on tetrahedra of vertices at these places [m] at rest, `bodies` being the
    /// ranges of their tetrahedra, and the samples that are closer to others than the thickness of contact. Returns the least
    /// distance [m] between two bodies' surfaces, below zero where they overlap; nothing where it is more than the thickness.
    pub fn finish(
        &mut self,
        tets: &[[u32; 4]],
        positions: &[Vec3<f64>],
        bodies: &[Range<usize>],
        contact: &TissueContact,
    ) -> Option<Overlap> {
        self.topology = Topology::new(self, tets, positions.len());
        self.shifts.clear();
        if !(contact.itself || contact.bodies) {
            return None;
        }
        let at: Vec<Vec3<f64>> = self
            .points
            .iter()
            .map(|point| mean(point.vertices, point.weights, positions))
            .collect();
        let thickness = contact.law.thickness;
        // Where bodies overlap, as deep as half of what a triangle measures.
        let size = self.samples.iter().map(|sample| sample.edge).fold(0.0, f64::max);
        let reach = (2.0 * thickness).max(size);
        let mut tree = Tree::new(self, &at);
        let mut normals = Vec::new();
        turn_normals(self, &at, &mut normals);
        let now = SkinNow { skin: self, at: &at, normals: &normals };
        let wanted = Wanted {
            itself: contact.itself,
            bodies: contact.bodies,
            reach,
            depths: depths(contact, f64::INFINITY),
            margin: thickness,
            turn: 0.0,
        };
        tree.list(now, wanted);
        let mut nearest: Option<Overlap> = None;
        let mut shifts = BTreeMap::<[u32; 2], f64>::new();
        let moment = Moment { now, tree: &tree, contact, deepest: DEEPEST };
        let inside = Inside::new(tets, positions, bodies);
        for (number, sample) in (0..).zip(&self.samples) {
            let p = mean(sample.vertices, sample.weights, positions);
            let leaf = tree.leaf_of(number);
            let looking = Looking { sample: number, p, leaf, kept: None, near: None };
            let meet = |deepest: f64| {
                let moment = Moment { deepest, ..moment };
                let found = moment.meet(&looking, reach)?;
                let distance = found.closest.signed().0;
                Some((distance, self.bodies[found.triangle as usize] as usize))
            };
            let own = self.sample_bodies[number as usize] as usize;
            let shallow = meet(DEEPEST).filter(|(distance, _)| *distance < thickness);
            if let Some((distance, other)) = shallow {
                let [a, b] = [own as u32, other as u32];
                let shift = shifts.entry([a.min(b), a.max(b)]).or_default();
                *shift = shift.max(thickness - distance);
            }
            // What looks deeper may be the far side of something thin: then the sample is not inside.
            let is_deep = |(distance, other): &(f64, usize)| {
                *distance < -thickness && *other != own && inside.is_in(*other, p)
            };
            let deep = meet(f64::INFINITY).filter(is_deep);
            for (distance, other) in shallow.into_iter().chain(deep) {
                let is_nearer = nearest.is_none_or(|least| distance < least.distance);
                if own != other && is_nearer {
                    nearest = Some(Overlap { bodies: [own, other], distance });
                }
            }
        }
        self.shifts = shifts.into_iter().collect();
        nearest
    }
}

/// The tetrahedra of each body, and boxes around them.
struct Inside {
    bodies: Vec<Solid>,
}

struct Solid {
    around: Box3,
    tets: Vec<(Box3, [Vec3<f64>; 4])>,
}

/// The lower and the upper corner [m] of a box.
type Box3 = [Vec3<f64>; 2];

impl Inside {
    fn new(tets: &[[u32; 4]], positions: &[Vec3<f64>], bodies: &[Range<usize>]) -> Self {
        let around = |points: &mut dyn Iterator<Item = Vec3<f64>>| {
            let none = [Vec3::splat(f64::INFINITY), Vec3::splat(f64::NEG_INFINITY)];
            points.fold(none, |[low, high], x| [low.min(x), high.max(x)])
        };
        let solid = |range: &Range<usize>| {
            let places = |tet: &[u32; 4]| tet.map(|v| positions[v as usize]);
            let all: Vec<_> = tets[range.clone()]
                .iter()
                .map(|tet| (around(&mut places(tet).into_iter()), places(tet)))
                .collect();
            Solid { around: around(&mut all.iter().flat_map(|(around, _)| *around)), tets: all }
        };
        Self { bodies: bodies.iter().map(solid).collect() }
    }

    /// Whether a point [m] is in a tetrahedron of a body.
    fn is_in(&self, body: usize, p: Vec3<f64>) -> bool {
        let within = |[low, high]: &Box3| p.max(*low) == p && p.min(*high) == p;
        let Some(solid) = self.bodies.get(body).filter(|solid| within(&solid.around)) else {
            return false;
        };
        solid.tets.iter().any(|(around, corners)| {
            within(around) && barycentric_weights(*corners, p).iter().all(|weight| *weight > 0.0)
        })
    }
}
