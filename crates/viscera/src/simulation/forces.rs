//! Forces of what holds and pulls tissue.

use super::holding::PinnedBy;
use super::{Assembly, PatchForce, PatchKind, ResolvedPatch, Simulation};
use crate::scalar::{Real, Vec3};
use crate::scene::Motion;
use crate::solver::Inputs;

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
        self.instruments.act(&self.assembly.tools, time, &mut inputs);
        inputs
    }

    /// Forces on the scene's patches, as last measured: those of [`Simulation::report`] without its other numbers.
    pub fn patch_forces(&self) -> Vec<PatchForce> {
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
        self.patch_forces_of(&self.assembly, time, positions, holding)
    }

    /// The same on other meshes of the scene's bodies.
    pub(super) fn patch_forces_of(
        &self,
        assembly: &Assembly,
        time: f64,
        positions: &[Vec3<f64>],
        holding: &[Vec3<f64>],
    ) -> Vec<PatchForce> {
        let scene = &self.scene;
        let rest = assembly.builder.positions();
        let position = |v: u32| positions.get(v as usize).copied().unwrap_or(rest[v as usize]);
        let held = |v: u32| holding.get(v as usize).copied().unwrap_or_default();
        let pinned_by = |v: u32| self.taken.pinned_by(scene, assembly, time, v);
        let mut forces = Vec::new();
        for (index, (fixing, patch)) in scene.fixings.iter().zip(&assembly.fixings).enumerate() {
            let share = fixing.stiffness.map(|total| total / patch.vertices.len() as f64);
            let anchor = |i: usize| assembly.builder.anchor(patch.attachments[i]);
            let on_vertex = |i: usize, v: u32| match share {
                // Springs of a fixing pull at a vertex that something else pins as well: they are part of the
                // model, and what pins the vertex has to hold against them.
                Some(stiffness) => {
                    (anchor(i).unwrap_or(rest[v as usize]) - position(v)) * stiffness
                }
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
