//! What a scene does to its bodies at a time, and the forces of that.

use super::{Assembly, PatchForce, PatchKind, ResolvedPatch, Simulation};
use crate::scalar::{Real, Vec3};
use crate::scene::{Motion, Scene};
use crate::solver::{Inputs, Pin, Tether};
use crate::state::State;

/// Times of a scene are those of frames up to this share of one: what rounding makes of them, and less
/// than any substep.
const TIME_TOLERANCE: f64 = 1.0 / 4096.0;

/// How late something may be and still belong to a time of the scene [s].
pub(super) fn tolerance(scene: &Scene) -> f64 {
    TIME_TOLERANCE * scene.time.frame
}

/// Where vertices were when patches were taken hold of, motion by motion [m]; nothing for those that have
/// not been, or that were at rest.
#[derive(Clone, Debug, Default)]
pub(super) struct Taken(Vec<Option<Vec<Vec3<f64>>>>);

impl Taken {
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
            let is_due = motion.start > 0.0 && time + tolerance(scene) >= motion.start;
            if is_due && taken.is_none() {
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
    /// in which [`Taken::act`] writes its pins.
    fn pinned_by(
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
enum PinnedBy {
    /// A rigid fixing, by its number.
    Fixing(usize),
    /// A rigid motion, by its number.
    Motion(usize),
}

/// Something that holds tissue now.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hold {
    /// The middle of its patch [m].
    pub place: Vec3<f64>,
    /// Where that is to be [m].
    pub target: Vec3<f64>,
    /// Its force on the tissue [N]: of springs as it is now, of a rigid hold as last measured; of a vertex
    /// that something else pins, nothing.
    pub force: Vec3<f64>,
}

impl<S: Real> Simulation<S> {
    /// What a motion does to its patch at the end of the last frame; nothing where it does not hold it.
    pub fn hold(&self, motion: usize) -> Option<Hold> {
        let (at, patch) = (self.scene.motions.get(motion)?, self.assembly.motions.get(motion)?);
        let rest = self.assembly.builder.positions();
        let time = self.time();
        let places = self.taken.places(motion, at, patch, rest, time)?;
        let share = 1.0 / patch.vertices.len() as f64;
        let mut hold = Hold::default();
        for (i, &v) in patch.vertices.iter().enumerate() {
            let (place, target) = (self.state.positions[v as usize].cast::<f64>(), places(i));
            hold.place += place * share;
            hold.target += target * share;
            let held = self.balance.residual.get(v as usize).copied().unwrap_or_default();
            let pinned_by = self.taken.pinned_by(&self.scene, &self.assembly, time, v);
            hold.force += on_moved(at, motion, pinned_by, held, (target - place) * share);
        }
        Some(hold)
    }

    /// What the scene does at a time [s]. What is taken hold of later than now acts from then on.
    pub fn inputs_at(&self, time: f64) -> Inputs<S> {
        let mut inputs = Inputs::default();
        self.taken.act(&self.scene, &self.assembly, time, &mut inputs);
        inputs
    }

    pub(super) fn patch_forces(&self) -> Vec<PatchForce> {
        let positions: Vec<_> = self.state.positions.iter().map(|x| x.cast()).collect();
        self.patch_forces_at(self.time(), &positions, &self.balance.residual)
    }

    /// Forces on the scene's patches at a time [s], for a caller with a state of its own:
    /// `positions` [m], and the forces `holding` [N] by which held vertices are held where they are,
    /// both of shape [vertex_count].
    pub fn patch_forces_at(
        &self,
        time: f64,
        positions: &[Vec3<f64>],
        holding: &[Vec3<f64>],
    ) -> Vec<PatchForce> {
        let (scene, assembly) = (&self.scene, &self.assembly);
        let rest = assembly.builder.positions();
        let position = |v: u32| positions.get(v as usize).copied().unwrap_or(rest[v as usize]);
        let held = |v: u32| holding.get(v as usize).copied().unwrap_or_default();
        let pinned_by = |v: u32| self.taken.pinned_by(scene, assembly, time, v);
        let mut forces = Vec::new();
        for (index, (fixing, patch)) in scene.fixings.iter().zip(&assembly.fixings).enumerate() {
            let share = fixing.stiffness.map(|total| total / patch.vertices.len() as f64);
            let on_vertex = |_: usize, v: u32| match share {
                // Springs of a fixing pull at a vertex that something else pins as well: they are part of the
                // model, and what pins the vertex has to hold against them.
                Some(stiffness) => (rest[v as usize] - position(v)) * stiffness,
                None if pinned_by(v) == Some(PinnedBy::Fixing(index)) => held(v),
                None => Vec3::ZERO,
            };
            forces.push(sum(&fixing.name, PatchKind::Fixing, patch, position, on_vertex));
        }
        for (index, (motion, patch)) in scene.motions.iter().zip(&assembly.motions).enumerate() {
            let places = self.taken.places(index, motion, patch, rest, time);
            let share = 1.0 / patch.vertices.len() as f64;
            let on_vertex = |i: usize, v: u32| match &places {
                None => Vec3::ZERO,
                Some(place) => {
                    let away = (place(i) - position(v)) * share;
                    on_moved(motion, index, pinned_by(v), held(v), away)
                }
            };
            forces.push(sum(&motion.name, PatchKind::Motion, patch, position, on_vertex));
        }
        for (force, patch) in scene.forces.iter().zip(&assembly.forces) {
            let share = force.at(time) * (1.0 / patch.vertices.len() as f64);
            forces.push(sum(&force.name, PatchKind::Force, patch, position, |_, _| share));
        }
        forces
    }
}

/// The force [N] of a motion on a vertex of its patch: what `held` it there [N] where the vertex is this
/// motion's, the pull of its springs where nothing pins it. `away` is the way to its target, divided by the
/// number of vertices [m].
fn on_moved(
    motion: &Motion,
    index: usize,
    pinned_by: Option<PinnedBy>,
    held: Vec3<f64>,
    away: Vec3<f64>,
) -> Vec3<f64> {
    match (motion.stiffness, pinned_by) {
        (None, Some(PinnedBy::Motion(last))) if last == index => held,
        (Some(stiffness), None) => away * stiffness,
        _ => Vec3::ZERO,
    }
}

/// Adds up forces [N] on the vertices of a patch, and their torque about its middle.
fn sum(
    name: &str,
    kind: PatchKind,
    patch: &ResolvedPatch,
    position: impl Fn(u32) -> Vec3<f64>,
    on_vertex: impl Fn(usize, u32) -> Vec3<f64>,
) -> PatchForce {
    let mut middle = Vec3::<f64>::ZERO;
    for &v in &patch.vertices {
        middle += position(v) * (1.0 / patch.vertices.len() as f64);
    }
    let (mut force, mut torque) = (Vec3::ZERO, Vec3::ZERO);
    for (i, &v) in patch.vertices.iter().enumerate() {
        let on_vertex = on_vertex(i, v);
        force += on_vertex;
        torque += (position(v) - middle).cross(on_vertex);
    }
    let (force, torque) = (force.to_array(), torque.to_array());
    PatchForce { name: name.to_owned(), kind, force, torque }
}
