//! What is done to a running simulation by hand. All of it becomes part of the scene, so that a scene file
//! with [`Live`] behind its other tables does the same to the bit.

use super::Simulation;
use super::acts::Act;
use super::automatic::{self, Chosen};
use super::checks::{check_contact, check_tools};
use super::error::{LiveError, SimulationError};
use super::holding::{GraspOrigins, tolerance};
use super::instruments::Instruments;
use crate::model::ModelError;
use crate::scalar::{Real, Vec3};
use crate::scene::{
    Change, Hand, Instrument, Interpolation, Motion, MotionKey, Patch, Scene, SceneError,
};
use crate::settings::{Precision, SolverSettings};
use crate::solver::balance::ForceBalance;
use crate::solver::check_settings;
use crate::state::{ContactState, Learned, State};

/// What was done by hand since the beginning or the last [`Simulation::reset`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Live {
    /// Holds, of which each is a motion.
    pub motions: Vec<Motion>,
    /// Settings.
    pub changes: Vec<Change>,
    /// Tools that were taken into the scene.
    pub tools: Vec<Instrument>,
    /// Hands that took tools, with the names of these: those above among them.
    pub hands: Vec<(String, Hand)>,
}

impl Live {
    /// As a scene file has it, to be put behind its other tables: of this scene, whose bodies it names.
    pub fn text(&self, scene: &Scene) -> String {
        let Self { motions, changes, tools, hands } = self;
        scene.write(motions, changes) + &scene.write_tools(tools, hands)
    }
}

impl<S: Real> Simulation<S> {
    /// Takes hold of a patch where it is now: by springs of a total stiffness [N/m], or rigidly. Returns
    /// the number of the motion that it becomes; its name is `stem` with a number behind.
    pub fn take_hold(
        &mut self,
        stem: &str,
        patch: Patch,
        stiffness: Option<f64>,
    ) -> Result<usize, LiveError> {
        let count = self.scene.bodies.len();
        if patch.body >= count {
            return Err(LiveError::NoBody { body: patch.body, count });
        }
        if let Some(stiffness) = stiffness.filter(|k| !(1e-6..=1e12).contains(k)) {
            return Err(LiveError::Stiffness { stiffness });
        }
        let resolved = self.assembly.resolve(&patch)?;
        let is_taken = |name: &String| self.scene.motions.iter().any(|other| other.name == *name);
        let names = (1..).map(|number| format!("{stem}-{number}"));
        let name = names.into_iter().find(|name| !is_taken(name)).unwrap_or_default();
        let time = self.time();
        let key = MotionKey { time, translation: Vec3::ZERO, rotation: Vec3::ZERO };
        let (body, selector) = (patch.body, &patch.selector);
        self.note(|| {
            let selector = selector.clone();
            Act::TakeHold { name: stem.to_owned(), body, selector, stiffness }
        });
        self.scene.motions.push(Motion {
            name,
            patch,
            keys: vec![key],
            interpolation: Interpolation::Linear,
            about: Vec3::ZERO,
            start: time,
            stiffness,
            release: None,
        });
        self.assembly.motions.push(resolved);
        Ok(self.scene.motions.len() - 1)
    }

    /// Says where a hold is to be at the end of the next frame, from where it was taken [m]; it goes
    /// there steadily.
    pub fn lead(&mut self, hold: usize, translation: Vec3<f64>) -> Result<(), LiveError> {
        if !translation.is_finite() {
            return Err(LiveError::NotFinite);
        }
        let (now, end) = (self.time(), (self.frame + 1) as f64 * self.scene.time.frame);
        let keys = &mut self.held_motion(hold)?.keys;
        if keys.last().is_some_and(|key| key.time == end) {
            keys.pop();
        }
        let at = |time, translation| MotionKey { time, translation, rotation: Vec3::ZERO };
        if let &[.., last] = keys.as_slice() {
            let rests = last.translation == translation;
            match keys.as_slice() {
                // A hold that stands still needs no keys.
                [.., before, _] if rests && before.translation == translation => {
                    keys.pop();
                }
                _ if last.time < now => keys.push(at(now, last.translation)),
                _ => {}
            }
        }
        keys.push(at(end, translation));
        self.note(|| Act::Lead { hold, translation });
        Ok(())
    }

    /// Lets a hold go, from the next frame on.
    pub fn let_go(&mut self, hold: usize) -> Result<(), LiveError> {
        // Between the end of the last substep, which it held, and that of the next.
        let release = self.time() + tolerance(&self.scene);
        self.held_motion(hold)?.release = Some(release);
        self.note(|| Act::LetGo { hold });
        Ok(())
    }

    /// A hold that is held.
    fn held_motion(&mut self, hold: usize) -> Result<&mut Motion, LiveError> {
        let by_hand = hold >= self.written.motions.len();
        let motion = self.scene.motions.get_mut(hold);
        let held = motion.filter(|motion| by_hand && motion.release.is_none());
        held.ok_or(LiveError::NoHold { hold })
    }

    /// Changes settings from the next frame on, keys and values as in overrides
    /// ([`Scene::change`]): the model is built again, positions and velocities stay.
    pub fn change(&mut self, settings: &[(String, String)]) -> Result<(), LiveError> {
        self.make_changes()?;
        let mut scene = self.scene.clone();
        scene.change(settings)?;
        let mut written = self.written.clone();
        written.change(settings)?;
        // Behind those that were made before, one of which may be a rounding later than its frame.
        let made = self.changes_made.checked_sub(1).and_then(|last| scene.changes.get(last));
        let time = made.map_or(self.time(), |last| last.time.max(self.time()));
        let change = Change { time, settings: settings.to_vec() };
        scene.changes.insert(self.changes_made, change.clone());
        self.rebuild(scene)?;
        self.written = written;
        self.by_hand.push(change);
        self.changes_made += 1;
        self.note(|| Act::Change { settings: settings.to_vec() });
        Ok(())
    }

    /// Another simulation that goes on from here, in any precision, with settings of its own: for a comparison
    /// of solvers. Where this one was taken hold of, the other is held as well.
    pub fn fork<T: Real>(&self, settings: &[(String, String)]) -> Result<Simulation<T>, LiveError> {
        let precision = match size_of::<T>() == size_of::<f64>() {
            true => Precision::F64,
            false => Precision::F32,
        };
        let of_fork = |scene: &Scene| -> Result<Scene, SceneError> {
            let mut scene = scene.clone();
            scene.set_precision(precision)?;
            scene.change(settings)?;
            Ok(scene)
        };
        let scene = of_fork(&self.scene)?;
        let mut fork =
            Simulation::<T>::offered(scene, self.assembly.clone(), self.offered.clone())?;
        fork.written = of_fork(&self.written)?;
        fork.frame = self.frame;
        fork.taken = self.taken.clone();
        fork.instruments = self.instruments.clone();
        fork.choose_substeps();
        fork.changes_made = self.changes_made;
        fork.by_hand.clone_from(&self.by_hand);
        fork.balance.clone_from(&self.balance);
        let double = |all: &[Vec3<S>]| all.iter().map(|x| x.cast::<f64>().cast()).collect();
        let current = self.current_state();
        let positions: Vec<Vec3<T>> = double(&current.positions);
        let velocities: Vec<Vec3<T>> = double(&current.velocities);
        let contact = current.contact.clone();
        let state = State { positions, velocities, contact, ..State::at_rest(&fork.model) };
        fork.begin_at(state);
        // Constraints in the same order, which settings decide, go on with the multipliers they have.
        let order = |solver: &SolverSettings| {
            (solver.method, solver.colors, solver.neo_hookean, solver.rebase)
        };
        let same_order = order(&self.solver) == order(&fork.solver);
        if same_order && self.layout().multiplier_count == fork.layout().multiplier_count {
            let whole = self.whole_state();
            let kept = whole.multipliers.into_iter().map(|l| T::from_f64(l.to_f64())).collect();
            let positions = std::mem::take(&mut fork.state.positions);
            let velocities = std::mem::take(&mut fork.state.velocities);
            let multiplier_dt = whole.multiplier_dt;
            // What was learned of other tissue misleads.
            let Learned { pairs, parts } = match self.scene.bodies == fork.scene.bodies {
                true => whole.learned,
                false => Learned::default(),
            };
            let learned = Learned { pairs: double(&pairs), parts };
            fork.put(State {
                positions,
                velocities,
                multipliers: kept,
                multiplier_dt,
                learned,
                contact: whole.contact,
            });
        }
        Ok(fork)
    }

    /// Back to the beginning, at rest: what was held is let go, settings stay as they were set by hand.
    pub fn reset(&mut self) -> Result<(), LiveError> {
        let frame = std::mem::take(&mut self.frame);
        // Whose tools are those of the beginning.
        let mut assembly = self.assembly.clone();
        assembly.motions.truncate(self.written.motions.len());
        assembly.tools.truncate(self.written.tools.len());
        for (tool, written) in assembly.tools.iter_mut().zip(&self.written.tools) {
            tool.hands.clone_from(&written.hands);
        }
        assembly.take_samples(&self.written)?;
        let before = std::mem::replace(&mut self.assembly, assembly);
        let instruments = Instruments::new(&self.assembly.tools, self.written.time.frame);
        let instruments = std::mem::replace(&mut self.instruments, instruments);
        let contact = std::mem::take(&mut self.state.contact);
        if let Err(error) = self.rebuild(self.written.clone()) {
            (self.frame, self.assembly, self.instruments) = (frame, before, instruments);
            self.state.contact = contact;
            return Err(error);
        }
        self.taken = GraspOrigins::default();
        self.divided = self.substeps;
        self.by_hand.clear();
        self.changes_made = 0;
        self.rejected_substeps = 0;
        self.put_in_place(State::at_rest(&self.model));
        self.balance = ForceBalance::default();
        self.inputs = self.inputs_at(0.0);
        self.state.contact = ContactState::of(&self.inputs.tools);
        self.measure_tissue();
        self.note(|| Act::Reset);
        Ok(())
    }

    /// Regards what is not in this scene, which is the simulation's own without it, as done by hand: of a simulation that
    /// was built from a scene with [`Live::text`] behind it, and goes on where hands had left another.
    pub fn with_hands_since(mut self, mut written: Scene) -> Result<Self, LiveError> {
        let is_new = |change: &&Change| !written.changes.contains(*change);
        let by_hand: Vec<Change> = self.scene.changes.iter().filter(is_new).cloned().collect();
        for change in &by_hand {
            written.change(&change.settings)?;
        }
        (self.written, self.by_hand) = (written, by_hand);
        Ok(self)
    }

    /// Motions of the scene from this number on are holds that were taken by hand.
    pub fn first_hold(&self) -> usize {
        self.written.motions.len()
    }

    /// What was done by hand.
    pub fn live(&self) -> Live {
        let motions = self.scene.motions[self.written.motions.len()..].to_vec();
        let tools = self.scene.tools[self.written.tools.len()..].to_vec();
        Live { motions, changes: self.by_hand.clone(), tools, hands: self.live_hands() }
    }

    /// What the scene wants at the beginning of a frame.
    pub(super) fn begin_frame(&mut self) -> Result<(), LiveError> {
        self.make_changes()?;
        self.tools_come_and_go()?;
        let time = self.time();
        if self.taken.is_due(&self.scene, time) {
            self.refresh_state();
        }
        self.taken.take(&self.scene, &self.assembly, time, &self.state);
        Ok(())
    }

    /// Makes the changes whose time has come.
    fn make_changes(&mut self) -> Result<(), LiveError> {
        let now = self.time() + tolerance(&self.scene);
        while self.scene.changes.get(self.changes_made).is_some_and(|change| change.time <= now) {
            self.make_change()?;
        }
        Ok(())
    }

    /// Makes the next of the scene's changes, where there is one.
    pub(super) fn make_change(&mut self) -> Result<(), LiveError> {
        if let Some(change) = self.scene.changes.get(self.changes_made) {
            let mut scene = self.scene.clone();
            scene.change(&change.settings)?;
            self.rebuild(scene)?;
            self.changes_made += 1;
        }
        Ok(())
    }

    /// Goes on with another scene of the same bodies.
    fn rebuild(&mut self, scene: Scene) -> Result<(), LiveError> {
        let same_device = scene.solver.device == self.scene.solver.device;
        self.rebuild_on_device(scene, same_device)
    }

    /// The same, on the device that computes now or on one that is chosen anew.
    pub(super) fn rebuild_on_device(
        &mut self,
        scene: Scene,
        same_device: bool,
    ) -> Result<(), LiveError> {
        let set = |problem: ModelError| LiveError::Simulation(problem.into());
        let on_device = same_device && self.callers_device;
        // Of the materials that it was given with: a body that is softened by hand sags.
        let elements = scene.solver.foreseen_elements(on_device);
        self.assembly.apply_balance(&self.written, elements).map_err(SimulationError::from)?;
        let builder = self.assembly.with_materials(&scene).map_err(set)?;
        let model = builder.build::<S>().map_err(SimulationError::from)?;
        self.resumed_method = self.resumed_method.filter(|_| same_device);
        let Chosen { settings: solver, oscillations, solver: ready } = match self.resumed_method {
            Some(method) => automatic::keep_method(&scene, &self.assembly, &model, method),
            None => automatic::choose_method(&scene, &self.assembly, &model, on_device),
        };
        check_settings(&solver).map_err(SimulationError::from)?;
        check_contact(&scene, &solver).map_err(SimulationError::from)?;
        if !scene.tools.is_empty() {
            check_tools(&scene, on_device, self.assembly.tools.iter())?;
        }
        self.refresh_state();
        let contact = self.contact_of(&self.state);
        let backend = self.backend.renew(same_device, &model, &solver, ready, &self.offered)?;
        self.under_way = false;
        let rest = State::at_rest(&model);
        let state = State {
            positions: std::mem::take(&mut self.state.positions),
            velocities: std::mem::take(&mut self.state.velocities),
            contact,
            ..rest
        };
        (self.scene, self.model, self.backend) = (scene, model, backend);
        (self.solver, self.oscillations) = (solver, oscillations);
        self.assembly.builder = builder;
        self.choose_substeps();
        self.begin_at(state);
        Ok(())
    }

    /// A state of this model, with the tissue's answer to where it is.
    fn begin_at(&mut self, mut state: State<S>) {
        let inputs = self.inputs_at(self.time());
        let dt = self.substep_dt();
        state.multiplier_dt = dt;
        let restarted = self.backend.restart(&self.model, &mut state, &inputs, dt);
        debug_assert!(restarted.is_ok(), "{restarted:?}");
        self.state = state;
        self.unread = 0;
        (self.stepped, self.is_balanced) = (false, false);
        self.wrenches = None;
        self.shadow = None;
    }

    /// Another state in the same memory: callers look at positions and velocities where they are.
    pub(super) fn put_in_place(&mut self, mut state: State<S>) {
        let State { positions, velocities, .. } = &mut self.state;
        positions.clone_from(&state.positions);
        velocities.clone_from(&state.velocities);
        state.positions = std::mem::take(positions);
        state.velocities = std::mem::take(velocities);
        self.put(state);
    }

    /// The state from now on, on whatever computes the steps.
    pub(super) fn put(&mut self, state: State<S>) {
        if let Some(device) = self.backend.device_mut() {
            device.write(&self.model, &state);
        }
        self.state = state;
        (self.unread, self.frames_since_before) = (0, 1);
        self.shadow = None;
    }
}
