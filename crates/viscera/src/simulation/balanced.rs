//! Bodies that rest under gravity as they were given: scans and meshes of organs that hang already.

use super::assemble::Assembly;
use super::assemble_error::BalanceError;
use super::carried::{Carrying, Forces};
use crate::mesh::topology::BoundingBox;
use crate::model::{Model, ModelBuilder};
use crate::rest::{TooSoft, Unloaded};
use crate::scalar::Vec3;
use crate::scene::{Body, Scene};
use crate::settings::Elements;
use crate::solver::{Inputs, Pin};

/// A body that is to be balanced.
struct Task {
    /// Of the body alone.
    model: Model<f64>,
    /// Vertices that fixings hold, by their numbers in the body, and those of them that rigid ones do.
    held: Vec<bool>,
    rigid: Vec<bool>,
    /// What ties hang on it and hold it by, on vertices of all bodies.
    loads: Forces,
}

impl Assembly {
    /// Finds the shapes without load of bodies that are to rest under gravity as they are, for tetrahedra of these
    /// elements; does nothing where that was done for the same ones before.
    pub(super) fn balance(
        &mut self,
        scene: &Scene,
        elements: Elements,
    ) -> Result<(), BalanceError> {
        let gravity = scene.world.gravity;
        let is_needed = gravity.length() > 0.0 && scene.bodies.iter().any(|body| body.balanced);
        if !is_needed || self.balanced_for == Some(elements) {
            return Ok(());
        }
        if !cfg!(feature = "balance") {
            if self.balanced_for.replace(elements).is_none() {
                let note = "this build does not solve for shapes without gravity: what is `balanced` sags at first";
                self.notes.push(note.into());
            }
            return Ok(());
        }
        let mut tasks = Vec::new();
        for (index, body) in scene.bodies.iter().enumerate() {
            tasks.push(self.task(scene, index, body)?);
        }
        self.hang(scene, &mut tasks)?;
        for (index, body) in scene.bodies.iter().enumerate().filter(|(_, body)| body.balanced) {
            let task = &tasks[index];
            let found = task.balance(self.bodies[index].vertices.start as u32, gravity, elements);
            let found = found.map_err(|TooSoft { share }| self.too_soft(scene, index, share))?;
            self.builder.set_stress_free(index, &found.positions)?;
            self.let_springs_carry(scene, index, task, &found);
            if self.balanced_for.is_none() {
                self.notes.push(format!(
                    "body `{}` rests under gravity as it is; without gravity it would be up to {:.1} mm elsewhere",
                    body.name,
                    1e3 * found.sag
                ));
            }
        }
        self.balanced_for = Some(elements);
        Ok(())
    }

    fn task(&self, scene: &Scene, index: usize, body: &Body) -> Result<Task, BalanceError> {
        let assembled = &self.bodies[index];
        let mut builder = ModelBuilder::new();
        builder.add_body(&assembled.mesh, &body.material)?;
        for region in &body.regions {
            for label in region.label.numbers(&assembled.names) {
                builder.set_region_material(0, label, &region.material)?;
            }
        }
        let first = assembled.vertices.start;
        let mut held = vec![false; assembled.vertices.len()];
        let mut rigid = held.clone();
        let fixings = scene.fixings.iter().zip(&self.fixings);
        let fixings =
            fixings.map(|(fixing, patch)| (&fixing.patch, fixing.stiffness.is_none(), patch));
        // What a motion leads from the beginning on is held there until it moves.
        let motions = scene.motions.iter().zip(&self.motions);
        let motions = motions
            .filter(|(motion, _)| motion.start <= 0.0 && motion.stiffness.is_none())
            .map(|(motion, patch)| (&motion.patch, true, patch));
        for (_, is_rigid, patch) in fixings.chain(motions).filter(|(of, ..)| of.body == index) {
            for &v in &patch.vertices {
                held[v as usize - first] = true;
                rigid[v as usize - first] |= is_rigid;
            }
        }
        Ok(Task { model: builder.build()?, held, rigid, loads: Forces::new() })
    }

    /// Lets ties carry what nothing else holds.
    fn hang(&mut self, scene: &Scene, tasks: &mut [Task]) -> Result<(), BalanceError> {
        let is_held: Vec<bool> = tasks.iter().map(|task| task.held.contains(&true)).collect();
        let carrying = Carrying::new(self.builder.skin(), &is_held);
        for body in (0..tasks.len()).filter(|&body| scene.bodies[body].balanced) {
            if !carrying.is_carried(body) {
                let body = scene.bodies[body].name.clone();
                return Err(BalanceError::NotHeld { body });
            }
        }
        for body in carrying.hanging() {
            if !scene.bodies[body].balanced {
                continue;
            }
            let first = self.bodies[body].vertices.start as u32;
            let masses = (first..).zip(&tasks[body].model.masses);
            let mut loads: Forces =
                masses.map(|(v, &mass)| (v, scene.world.gravity * mass)).collect();
            loads.extend(&tasks[body].loads);
            let forces = carrying
                .hang(self, body, &loads)
                .ok_or_else(|| BalanceError::Turns { body: scene.bodies[body].name.clone() })?;
            for (v, force) in forces {
                let of = self.bodies.iter().position(|body| body.vertices.contains(&(v as usize)));
                tasks[of.unwrap_or(body)].loads.push((v, force));
            }
        }
        Ok(())
    }

    fn too_soft(&self, scene: &Scene, index: usize, share: f64) -> BalanceError {
        let body = &scene.bodies[index];
        let size = BoundingBox::around(self.bodies[index].mesh.vertices()).size();
        let longest = size.x.max(size.y).max(size.z);
        let material = &body.material;
        let weight = material.density() * scene.world.gravity.length() * longest;
        let softness = weight / material.young();
        let way_out = match share > 0.0 {
            true => format!(
                "a density up to {:.0} kg/m^3 works, or `young` from {:.1} kPa on",
                material.density() * share,
                material.young() / share / 1e3
            ),
            false => String::from("raise `young` by orders of magnitude"),
        };
        BalanceError::TooSoft { body: body.name.clone(), softness, way_out }
    }

    /// Puts the anchors of elastic fixings where their springs carry what was found to be carried.
    fn let_springs_carry(&mut self, scene: &Scene, index: usize, task: &Task, found: &Unloaded) {
        let first = self.bodies[index].vertices.start;
        let mut done = task.rigid.clone();
        for (fixing, patch) in scene.fixings.iter().zip(&self.fixings) {
            let Some(stiffness) = fixing.stiffness.filter(|_| fixing.patch.body == index) else {
                continue;
            };
            let share = stiffness / patch.vertices.len() as f64;
            for (&v, &anchor) in patch.vertices.iter().zip(&patch.attachments) {
                // Of several springs at a vertex the first one carries all.
                let is_free = !std::mem::replace(&mut done[v as usize - first], true);
                let carried = if is_free { found.holding[v as usize - first] } else { Vec3::ZERO };
                let place = self.builder.positions()[v as usize] + carried * (1.0 / share);
                self.builder.set_anchor(anchor, place);
            }
        }
    }
}

impl Task {
    /// `first` is the number of the body's first vertex.
    fn balance(
        &self,
        first: u32,
        gravity: Vec3<f64>,
        elements: Elements,
    ) -> Result<Unloaded, TooSoft> {
        let pin = |(vertex, &target): (u32, &Vec3<f64>)| Pin { vertex, target };
        let places = (0u32..).zip(&self.model.rest_positions);
        let pins = places.filter(|(v, _)| self.held[*v as usize]).map(pin).collect();
        let forces = self.loads.iter().map(|&(v, force)| (v - first, force)).collect();
        let inputs = Inputs { gravity, pins, forces, ..Inputs::default() };
        Unloaded::find(&self.model, &inputs, elements)
    }
}
