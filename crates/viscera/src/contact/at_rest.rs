//! Bodies that are close to each other, or overlap, at rest.

use super::meeting::{Marks, Moment, turn_normals};
use super::search::{Grid, Since};
use super::skin::{Skin, TissueContact, Topology, mean};
use crate::scalar::Vec3;

/// Two bodies that are close at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overlap {
    /// Their numbers.
    pub bodies: [usize; 2],
    /// [m], below zero where they overlap.
    pub distance: f64,
}

impl Skin {
    /// After all bodies were added: what is near what on tetrahedra of vertices at these places [m] at rest, and the samples
    /// that are closer to others than the thickness of contact. Returns the least distance [m] between two bodies' surfaces,
    /// below zero where they overlap, with the sample and the triangle; nothing where it is more than the thickness.
    pub fn finish(
        &mut self,
        tets: &[[u32; 4]],
        positions: &[Vec3<f64>],
        contact: &TissueContact,
    ) -> Option<Overlap> {
        self.topology = Topology::new(self, tets, positions.len());
        self.shifts = vec![0.0; self.samples.len()];
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
        let mut grid = Grid::new(self.triangles.len());
        grid.sort(&self.triangles, &at, reach);
        let mut marks = Marks::new(positions.len());
        let mut normals = Vec::new();
        turn_normals(self, &at, &mut normals);
        grid.turn(&normals);
        let mut nearest: Option<Overlap> = None;
        let mut shifts = std::mem::take(&mut self.shifts);
        let (at, normals, grid) = (&at[..], &normals[..], &grid);
        let moment = Moment { skin: self, at, normals, grid, since: Since::NOTHING, contact };
        for (number, shift) in shifts.iter_mut().enumerate() {
            let sample = &self.samples[number];
            let p = mean(sample.vertices, sample.weights, positions);
            let (Some(found), _) = moment.meet(&mut marks, (number, p), None, [reach; 2]) else {
                continue;
            };
            let (distance, _) = found.closest.signed();
            if distance >= thickness {
                continue;
            }
            *shift = thickness - distance;
            let bodies = [self.sample_bodies[number], self.bodies[found.triangle as usize]]
                .map(|b| b as usize);
            let is_nearer = nearest.is_none_or(|least| distance < least.distance);
            if bodies[0] != bodies[1] && is_nearer {
                nearest = Some(Overlap { bodies, distance });
            }
        }
        self.shifts = shifts;
        nearest
    }
}
