//! What a scene does to its bodies at a time, and the forces of that.

use super::assemble::{Assembly, ResolvedPatch};
use crate::scalar::{Real, Vec3};
use crate::scene::{Motion, Scene};
use crate::solver::{Inputs, Pin, Tether};
use crate::state::State;

/// Times of a scene are those of frames up to this share of one: what rounding makes of them, and less
/// than any substep.
const TIME_TOLERANCE: f64 = 1.0 / 4096.0;

/// How late something may be and still belong to a time of the scene [s].
pub(super) fn tolerance(scene: &Scene) -> f64 {
    tolerance_of(scene.time.frame)
}

/// The same of frames of this duration [s].
pub(super) fn tolerance_of(frame: f64) -> f64 {
    TIME_TOLERANCE * frame
}

/// Where vertices were when patches were taken hold of, motion by motion [m]; nothing for those that have
/// not been, or that were at rest.
#[derive(Clone, Debug, Default)]
pub(super) struct GraspOrigins(Vec<Option<Vec<Vec3<f64>>>>);

/// Whether a motion that takes hold of its patch where it finds it has begun at a time [s].
fn begins(scene: &Scene, motion: &Motion, time: f64) -> bool {
    motion.start > 0.0 && time + tolerance(scene) >= motion.start
}

impl GraspOrigins {
    /// Places of the patches of all motions.
    pub fn of(all: Vec<Option<Vec<Vec3<f64>>>>) -> Self {
        Self(all)
    }

    /// The places, motion by motion.
    pub fn all(&self) -> &[Option<Vec<Vec3<f64>>>] {
        &self.0
    }

    /// Whether there is a motion at a time [s] whose patch is still to be remembered.
    pub fn is_due(&self, scene: &Scene, time: f64) -> bool {
        let is_known = |index: usize| self.0.get(index).is_some_and(Option::is_some);
        let mut motions = scene.motions.iter().enumerate();
        motions.any(|(index, motion)| begins(scene, motion, time) && !is_known(index))
    }

    /// Remembers the patches that are taken hold of at a time [s], before the frame that begins then.
    pub fn take<S: Real>(
        &mut self,
        scene: &Scene,
        assembly: &Assembly,
        time: f64,
        state: &State<S>,
    ) {
        self.0.resize(scene.motions.len(), None);
        let motions = scene.motions.iter().zip(&assembly.motions);
        for (taken, (motion, patch)) in self.0.iter_mut().zip(motions) {
            if begins(scene, motion, time) && taken.is_none() {
                let places = patch.vertices.iter().map(|&v| state.positions[v as usize].cast());
                *taken = Some(places.collect());
            }
        }
    }

    /// Where each vertex of a patch is to be at a time [s]; nothing where it is not held.
    pub fn places<'a>(
        &'a self,
        index: usize,
        motion: &Motion,
        patch: &'a ResolvedPatch,
        rest: &'a [Vec3<f64>],
        time: f64,
    ) -> Option<impl Fn(usize) -> Vec3<f64> + 'a> {
        if !self.holds(index, motion, time) {
            return None;
        }
        let taken = self.0.get(index).and_then(Option::as_ref);
        let pose = motion.pose(time);
        Some(move |i: usize| {
            let origin = match taken {
                Some(origins) => origins[i],
                None => rest[patch.vertices[i] as usize],
            };
            pose.apply(origin)
        })
    }

    /// Whether a motion holds its patch at a time [s].
    fn holds(&self, index: usize, motion: &Motion, time: f64) -> bool {
        let is_taken = self.0.get(index).is_some_and(Option::is_some);
        let is_free = motion.start > 0.0 && !is_taken;
        !is_free && motion.release.is_none_or(|release| time < release)
    }

    /// What a vertex is pinned by at a time [s]: where patches overlap, by the last of them only, in the order
    /// in which [`GraspOrigins::act`] writes its pins.
    pub fn pinned_by(
        &self,
        scene: &Scene,
        assembly: &Assembly,
        time: f64,
        vertex: u32,
    ) -> Option<PinnedBy> {
        let has = |patch: &ResolvedPatch| patch.vertices.binary_search(&vertex).is_ok();
        let motions = scene.motions.iter().zip(&assembly.motions).enumerate().rev();
        let mut rigid = motions.filter(|(index, (motion, patch))| {
            motion.stiffness.is_none() && has(patch) && self.holds(*index, motion, time)
        });
        if let Some((index, _)) = rigid.next() {
            return Some(PinnedBy::Motion(index));
        }
        let fixings = scene.fixings.iter().zip(&assembly.fixings);
        let last =
            fixings.rev().position(|(fixing, patch)| fixing.stiffness.is_none() && has(patch));
        last.map(|behind| PinnedBy::Fixing(scene.fixings.len() - 1 - behind))
    }

    /// Puts what a scene does at a time [s] into the inputs; takes no memory where they have room.
    pub fn act<S: Real>(
        &self,
        scene: &Scene,
        assembly: &Assembly,
        time: f64,
        inputs: &mut Inputs<S>,
    ) {
        let rest = assembly.builder.positions();
        inputs.gravity = scene.world.gravity.cast();
        inputs.pins.clear();
        inputs.tethers.clear();
        for (fixing, patch) in scene.fixings.iter().zip(&assembly.fixings) {
            if fixing.stiffness.is_none() {
                let pins = patch.vertices.iter();
                let pins = pins.map(|&v| Pin { vertex: v, target: rest[v as usize].cast() });
                inputs.pins.extend(pins);
            }
        }
        // Later pins win where patches overlap: a motion takes a fixed vertex along.
        for (index, (motion, patch)) in scene.motions.iter().zip(&assembly.motions).enumerate() {
            let Some(place) = self.places(index, motion, patch, rest, time) else { continue };
            let vertices = patch.vertices.iter().copied().enumerate();
            match motion.stiffness.map(|total| total / patch.vertices.len() as f64) {
                None => inputs
                    .pins
                    .extend(vertices.map(|(i, vertex)| Pin { vertex, target: place(i).cast() })),
                Some(share) => inputs.tethers.extend(vertices.map(|(i, vertex)| Tether {
                    vertex,
                    target: place(i).cast(),
                    stiffness: S::from_f64(share),
                })),
            }
        }
        inputs.forces.clear();
        for (force, patch) in scene.forces.iter().zip(&assembly.forces) {
            let share = force.at(time) * (1.0 / patch.vertices.len() as f64);
            inputs.forces.extend(patch.vertices.iter().map(|&v| (v, share.cast())));
        }
    }
}

/// The patch that a pinned vertex belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PinnedBy {
    /// A rigid fixing, by its number.
    Fixing(usize),
    /// A rigid motion, by its number.
    Motion(usize),
}
