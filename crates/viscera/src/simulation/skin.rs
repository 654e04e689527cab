//! What contact of tissue with tissue needs of an assembly: the surfaces of all bodies, and ties between them.

use super::assemble::Assembly;
use super::assemble_error::AssembleError;
use crate::contact::search::{Closest, closest};
use crate::contact::skin::{SkinPoint, Tie as SkinTie, mean};
use crate::contact::tree::{SkinNow, Tree};
use crate::contact::{Overlap, Skin, turn_normals};
use crate::scalar::Vec3;
use crate::scene::{Scene, Tie};

/// A point of a surface belongs to a patch of vertices where those bear this share of it.
const BORNE: f64 = 0.5;

impl Assembly {
    /// Takes the surfaces of all bodies for tissue to meet on, and ties them: fine surfaces where bodies have them, else the
    /// outer faces of tetrahedra.
    pub(super) fn take_skin(&mut self, scene: &Scene) -> Result<(), AssembleError> {
        let contact = scene.contact.tissue();
        if !(contact.itself || contact.bodies) && scene.ties.is_empty() {
            return Ok(());
        }
        let mut skin = Skin::default();
        for (number, body) in (0..).zip(&self.bodies) {
            let first_tet = body.tets.start as u32;
            let positions = self.builder.positions();
            if body.has_fine_surface {
                let first = (body.vertices.start as u32, first_tet);
                skin.add_embedded(number, (&body.surface, &body.embedding), first, positions);
            } else {
                let tets = &self.builder.tets()[..body.tets.end];
                skin.add_boundary(number, (tets, first_tet), positions);
            }
        }
        let places = (!scene.ties.is_empty()).then(|| Places::new(&skin, self.builder.positions()));
        let mut ties = Vec::new();
        for (number, tie) in (0..).zip(&scene.ties) {
            for patch in [&tie.from, &tie.to] {
                self.notes.extend(patch.doubt(&self.bodies[patch.body].mesh));
            }
            if let Some(places) = &places {
                ties.extend(self.tie(&skin, places, tie, number)?);
            }
        }
        skin.ties = ties;
        let overlap = self.builder.set_skin(skin, &contact);
        self.check_overlap(scene, overlap)
    }

    /// Bodies may touch at rest, or overlap by as much as contact is thick; it begins there.
    fn check_overlap(
        &mut self,
        scene: &Scene,
        overlap: Option<Overlap>,
    ) -> Result<(), AssembleError> {
        let Some(Overlap { bodies, distance }) = overlap else { return Ok(()) };
        let [one, other] = bodies.map(|body| self.bodies[body].name.clone());
        let thickness = scene.contact.thickness;
        if distance <= -thickness {
            return Err(AssembleError::BodiesOverlap { one, other, depth: -distance, thickness });
        }
        self.notes.push(if distance < 0.0 {
            format!(
                "bodies `{one}` and `{other}` overlap by up to {:.2} mm at rest; contact begins where they are",
                -1e3 * distance
            )
        } else {
            format!(
                "bodies `{one}` and `{other}` are {:.2} mm apart at rest, which is closer than contact is thick \
                 ({:.2} mm); it begins where they are",
                1e3 * distance,
                1e3 * thickness
            )
        });
        Ok(())
    }

    /// The ties of one of the scene's.
    fn tie(
        &self,
        skin: &Skin,
        places: &Places,
        tie: &Tie,
        group: u32,
    ) -> Result<Vec<SkinTie>, AssembleError> {
        let positions = self.builder.positions();
        let [from, to] = [&tie.from, &tie.to].map(|patch| self.resolve(patch));
        let (from, to) = (from?.vertices, to?.vertices);
        let [body, other] = [tie.from.body, tie.to.body].map(|body| body as u32);
        let is_on: Vec<bool> = (0..)
            .zip(&skin.triangles)
            .map(|(number, triangle)| {
                let borne = triangle.map(|point| borne(&skin.points[point as usize], &to));
                skin.bodies[number] == other && borne.iter().all(|share| *share >= BORNE)
            })
            .collect();
        let Places { tree, at, normals } = places;
        let now = SkinNow { skin, at, normals };
        let (mut ties, mut untied) = (Vec::new(), Vec::new());
        for (number, sample) in (0..).zip(&skin.samples) {
            let point = SkinPoint { vertices: sample.vertices, weights: sample.weights };
            let is_own =
                skin.sample_bodies[number as usize] == body && borne(&point, &from) >= BORNE;
            if !is_own {
                continue;
            }
            let p = mean(sample.vertices, sample.weights, positions);
            let is_tied = |triangle: u32| is_on[triangle as usize];
            let Some(found) = tree.nearest_to(now, p, tie.distance, is_tied) else {
                untied.push(p);
                continue;
            };
            let Closest { weights, .. } = found.closest;
            ties.push(SkinTie {
                sample: number,
                triangle: found.triangle,
                weights,
                rest: found.closest.in_triangle(now.corners(found.triangle)),
                stiffness: tie.stiffness * sample.area,
                strength: tie.strength.map_or(f64::INFINITY, |strength| strength * sample.area),
                group,
            });
        }
        if ties.is_empty() {
            let on = (0..skin.triangles.len() as u32).filter(|&t| is_on[t as usize]);
            let far = |triangle: u32, p: Vec3<f64>| closest(p, now.corners(triangle)).away.length();
            let all = on.flat_map(|triangle| untied.iter().map(move |&p| far(triangle, p)));
            let nearest = all.fold(f64::INFINITY, f64::min);
            return Err(AssembleError::TiesNothing {
                place: tie.place.clone(),
                tie: tie.name.clone(),
                distance: tie.distance,
                nearest,
            });
        }
        Ok(ties)
    }
}

/// Where the surfaces of all bodies are, and what finds the nearest of their triangles.
struct Places {
    tree: Tree,
    at: Vec<Vec3<f64>>,
    normals: Vec<Vec3<f64>>,
}

impl Places {
    fn new(skin: &Skin, positions: &[Vec3<f64>]) -> Self {
        let place = |point: &SkinPoint| mean(point.vertices, point.weights, positions);
        let at: Vec<Vec3<f64>> = skin.points.iter().map(place).collect();
        let (mut tree, mut normals) = (Tree::new(skin, &at), Vec::new());
        turn_normals(skin, &at, &mut normals);
        tree.refit(SkinNow { skin, at: &at, normals: &normals }, 0.0);
        Self { tree, at, normals }
    }
}

/// The share of a point that vertices of a patch bear, which ascend.
fn borne(point: &SkinPoint, patch: &[u32]) -> f64 {
    let all = point.vertices.iter().zip(&point.weights);
    all.filter(|(v, _)| patch.binary_search(v).is_ok()).map(|(_, weight)| weight).sum()
}
