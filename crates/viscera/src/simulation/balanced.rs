//! Bodies that rest under gravity as they were given: scans and meshes of organs that hang already.

use std::sync::Arc;

use rayon::prelude::*;

use super::assemble::{Assembly, ResolvedPatch};
use super::assemble_error::{AssembleError, BalanceError};
use super::balance::{Balance, BodyBalance, Rests, bits, hashed};
use super::carried::{Carrying, Forces};
use crate::mesh::topology::BoundingBox;
use crate::model::{Model, ModelBuilder};
use crate::rest::{TooSoft, Unloaded};
use crate::scalar::Vec3;
use crate::scene::{Body, Patch, Scene};
use crate::settings::Elements;
use crate::solver::{Inputs, Pin};

/// Vertices of a body that a fixing, or a motion at its beginning, holds, by their numbers in the whole model.
struct Hold<'a> {
    body: usize,
    is_rigid: bool,
    vertices: &'a [u32],
}

/// A body that is to be balanced.
struct Task {
    /// Of the body alone.
    model: Model<f64>,
    /// Vertices that fixings hold, by their numbers in the body, and those of them that rigid ones do.
    held: Vec<bool>,
    rigid: Vec<bool>,
    /// What ties hang on it and hold it by, on vertices of all bodies.
    loads: Forces,
    /// Whether it is to rest as it is, and something holds it.
    is_carried: bool,
}

impl Assembly {
    /// How the scene's bodies carry gravity, where some are to rest as they are and that was solved for.
    pub fn balance(&self) -> Option<&Balance> {
        self.balance.as_deref()
    }

    /// Whether bodies that are to rest under gravity as they are sag, since this build does not solve for that, and nothing was
    /// given that fits.
    pub fn sags(&self) -> bool {
        self.balanced_for.is_some() && self.balance.is_none()
    }

    /// Finds how a scene's bodies carry gravity, and why those do not that cannot. Bodies that are in `known` are not solved for
    /// again where nothing of theirs has changed.
    pub fn try_balance(
        scene: &Scene,
        load: &mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
        known: Option<&Balance>,
    ) -> Result<(Balance, Vec<BalanceError>), AssembleError> {
        let assembly = Self::without_balance(scene, load)?;
        let elements = scene.solver.foreseen_elements(false);
        Ok(assembly.find_balance(scene, elements, known)?)
    }

    /// Lets bodies that are to rest under gravity as they are do that, for tetrahedra of these elements; does nothing where that
    /// was done for the same ones before.
    pub(super) fn apply_balance(
        &mut self,
        scene: &Scene,
        elements: Elements,
    ) -> Result<(), BalanceError> {
        let is_wanted = |body: &Body| body.balanced;
        let is_needed = scene.world.gravity.length() > 0.0 && scene.bodies.iter().any(is_wanted);
        if !is_needed || self.balanced_for == Some(elements) {
            return Ok(());
        }
        let is_first = self.balanced_for.replace(elements).is_none();
        let before = self.balance.take();
        // Once one was applied the model is another.
        let key = before.as_ref().filter(|_| !is_first).map(|before| Ok(before.key));
        let key = key.unwrap_or_else(|| self.key(scene))?;
        let known = before.filter(|known| known.is_of(elements));
        let fits = known.as_ref().is_some_and(|known| known.key == key);
        let balance = match known {
            Some(known) if fits => known,
            known if cfg!(feature = "balance") => {
                let (found, errors) = self.find_balance(scene, elements, known.as_deref())?;
                if let Some(error) = errors.into_iter().next() {
                    return Err(error);
                }
                Arc::new(Balance { key, ..found })
            }
            _ => {
                if is_first {
                    let note = "this build does not solve for shapes without gravity: what is `balanced` sags at first";
                    self.notes.push(note.into());
                }
                return Ok(());
            }
        };
        let vector = |x: &[f64; 3]| Vec3::from_f64(*x);
        for BodyBalance { body, shape, .. } in &balance.bodies {
            let shape: Vec<_> = shape.iter().map(vector).collect();
            self.builder.set_stress_free(*body, &shape)?;
        }
        for (anchor, place) in &balance.anchors {
            self.builder.set_anchor(*anchor, vector(place));
        }
        self.builder.set_tie_rests(&balance.ties);
        if is_first {
            self.notes.extend(balance.notes().cloned());
        }
        self.balance = Some(balance);
        Ok(())
    }

    /// Differs where a balance would. What holds a body rigidly is no part of the model.
    fn key(&self, scene: &Scene) -> Result<u64, BalanceError> {
        let key = hashed(self.builder.build::<f64>()?.revision(), bits(scene.world.gravity));
        let key = hashed(key, scene.bodies.iter().map(|body| u64::from(body.balanced)));
        Ok(self.holds(scene).fold(key, |key, hold| {
            let vertices = hold.vertices.iter().map(|&v| u64::from(v));
            let which = [hold.body as u64, u64::from(hold.is_rigid), hold.vertices.len() as u64];
            hashed(key, which.into_iter().chain(vertices))
        }))
    }

    /// What holds bodies from the beginning on.
    fn holds<'a>(&'a self, scene: &'a Scene) -> impl Iterator<Item = Hold<'a>> {
        let fixings = scene.fixings.iter().zip(&self.fixings);
        let fixings =
            fixings.map(|(fixing, patch)| (&fixing.patch, fixing.stiffness.is_none(), patch));
        // What a motion leads from the beginning on is held there until it moves.
        let motions = scene.motions.iter().zip(&self.motions);
        let motions = motions
            .filter(|(motion, _)| motion.start <= 0.0 && motion.stiffness.is_none())
            .map(|(motion, patch)| (&motion.patch, true, patch));
        let hold = |(of, is_rigid, patch): (&Patch, bool, &'a ResolvedPatch)| Hold {
            body: of.body,
            is_rigid,
            vertices: &patch.vertices,
        };
        fixings.chain(motions).map(hold)
    }

    fn find_balance(
        &self,
        scene: &Scene,
        elements: Elements,
        known: Option<&Balance>,
    ) -> Result<(Balance, Vec<BalanceError>), BalanceError> {
        let mut tasks = Vec::new();
        for (index, body) in scene.bodies.iter().enumerate() {
            tasks.push(self.task(scene, index, body)?);
        }
        let (ties, mut errors) = self.hang(scene, &mut tasks);
        let key = self.key(scene)?;
        let recovered = elements == Elements::Recovered;
        let mut balance = Balance { key, recovered, ties, ..Balance::default() };
        let known = known.filter(|known| known.is_of(elements));
        let known = |key| known?.bodies.iter().find(|body| body.key == key);
        let carried = |(index, task): (usize, &Task)| -> Result<_, BalanceError> {
            let first = self.bodies[index].vertices.start as u32;
            let key = task.key(first, scene.world.gravity);
            if let Some(known) = known(key) {
                return Ok(BodyBalance { body: index, ..known.clone() });
            }
            let found = task.balance(first, scene.world.gravity, elements);
            let found = found.map_err(|TooSoft { share }| self.too_soft(scene, index, share))?;
            let held = (0u32..).zip(&found.holding).filter(|(v, _)| task.held[*v as usize]);
            Ok(BodyBalance {
                body: index,
                key,
                shape: found.positions.iter().map(|x| x.to_array()).collect(),
                holding: held.map(|(v, force)| (v, force.to_array())).collect(),
                note: format!(
                    "body `{}` rests under gravity as it is; without gravity it would be up to {:.1} mm elsewhere",
                    scene.bodies[index].name,
                    1e3 * found.sag
                ),
            })
        };
        let wanted: Vec<(usize, &Task)> =
            tasks.iter().enumerate().filter(|(_, task)| task.is_carried).collect();
        // Each is solved for by itself.
        let found: Vec<_> = wanted.into_par_iter().with_max_len(1).map(carried).collect();
        for result in found {
            match result {
                Ok(body) => {
                    balance.anchors.extend(self.springs_that_carry(scene, &tasks, &body));
                    balance.bodies.push(body);
                }
                Err(error) => errors.push(error),
            }
        }
        Ok((balance, errors))
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
        for hold in self.holds(scene).filter(|hold| hold.body == index) {
            for &v in hold.vertices {
                held[v as usize - first] = true;
                rigid[v as usize - first] |= hold.is_rigid;
            }
        }
        let (loads, is_carried) = (Forces::new(), body.balanced);
        Ok(Task { model: builder.build()?, held, rigid, loads, is_carried })
    }

    /// Lets ties carry what nothing else holds: where they are without force, and what nothing carries.
    fn hang(&self, scene: &Scene, tasks: &mut [Task]) -> (Rests, Vec<BalanceError>) {
        let (mut rests, mut errors) = (Rests::new(), Vec::new());
        let is_held: Vec<bool> = tasks.iter().map(|task| task.held.contains(&true)).collect();
        let carrying = Carrying::new(self.builder.skin(), &is_held);
        let name = |body: usize| scene.bodies[body].name.clone();
        for body in 0..tasks.len() {
            if tasks[body].is_carried && !carrying.is_carried(body) {
                tasks[body].is_carried = false;
                errors.push(BalanceError::NotHeld { body: name(body) });
            }
        }
        for body in carrying.hanging() {
            if !tasks[body].is_carried {
                continue;
            }
            let first = self.bodies[body].vertices.start as u32;
            let masses = (first..).zip(&tasks[body].model.masses);
            let mut loads: Forces =
                masses.map(|(v, &mass)| (v, scene.world.gravity * mass)).collect();
            loads.extend(&tasks[body].loads);
            let Some(hung) = carrying.hang(self, body, &loads) else {
                tasks[body].is_carried = false;
                errors.push(BalanceError::Turns { body: name(body) });
                continue;
            };
            rests.extend(hung.rests);
            for (v, force) in hung.forces {
                let of = self.bodies.iter().position(|body| body.vertices.contains(&(v as usize)));
                tasks[of.unwrap_or(body)].loads.push((v, force));
            }
        }
        (rests, errors)
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

    /// Where the anchors of elastic fixings are, by their numbers, so that their springs carry what was found to be carried.
    fn springs_that_carry(
        &self,
        scene: &Scene,
        tasks: &[Task],
        of: &BodyBalance,
    ) -> Vec<(usize, [f64; 3])> {
        let first = self.bodies[of.body].vertices.start;
        let mut done = tasks[of.body].rigid.clone();
        let mut holding = vec![Vec3::ZERO; done.len()];
        for (v, force) in &of.holding {
            holding[*v as usize] = Vec3::from_f64(*force);
        }
        let mut anchors = Vec::new();
        for (fixing, patch) in scene.fixings.iter().zip(&self.fixings) {
            let Some(stiffness) = fixing.stiffness.filter(|_| fixing.patch.body == of.body) else {
                continue;
            };
            let share = stiffness / patch.vertices.len() as f64;
            for (&v, &anchor) in patch.vertices.iter().zip(&patch.attachments) {
                // Of several springs at a vertex the first one carries all.
                let is_free = !std::mem::replace(&mut done[v as usize - first], true);
                let carried = if is_free { holding[v as usize - first] } else { Vec3::ZERO };
                let place = self.builder.positions()[v as usize] + carried * (1.0 / share);
                anchors.push((anchor, place.to_array()));
            }
        }
        anchors
    }
}

impl Task {
    /// Differs where a balance of the body would. `first` is the number of its first vertex.
    fn key(&self, first: u32, gravity: Vec3<f64>) -> u64 {
        let key = hashed(self.model.revision(), bits(gravity));
        let key = hashed(key, self.held.iter().map(|&held| u64::from(held)));
        let loads = self.loads.iter();
        hashed(key, loads.flat_map(|&(v, x)| [u64::from(v - first)].into_iter().chain(bits(x))))
    }

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
