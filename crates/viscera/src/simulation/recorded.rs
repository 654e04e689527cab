//! What a recording needs of a simulation: what hands do to it, to be told and to be done again.

use super::Simulation;
use super::acts::{Act, given};
use super::error::LiveError;
use crate::scalar::Real;
use crate::scene::{Change, Patch, Scene};
use crate::settings::Place;

impl<S: Real> Simulation<S> {
    /// From now on remembers what hands do, for [`Simulation::take_acts`]; forgets what it has remembered before.
    pub fn remember_acts(&mut self) {
        self.acts = Some(Vec::new());
    }

    /// What hands have done since this was last asked for; nothing where it does not remember.
    pub fn take_acts(&mut self) -> Vec<Act> {
        self.acts.as_mut().map(std::mem::take).unwrap_or_default()
    }

    pub(super) fn is_recorded(&self) -> bool {
        self.acts.is_some()
    }

    pub(super) fn note(&mut self, act: impl FnOnce() -> Act) {
        if let Some(acts) = &mut self.acts {
            acts.push(act());
        }
    }

    /// Does what a hand has done.
    pub fn act(&mut self, act: &Act) -> Result<(), LiveError> {
        match act {
            Act::TakeHold { name, body, selector, stiffness } => {
                let place = Place::Override { key: "recording".into() };
                let purpose = format!("hold `{name}`");
                let patch = Patch { body: *body, selector: selector.clone(), purpose, place };
                self.take_hold(name, patch, *stiffness).map(|_| ())
            }
            Act::Lead { hold, translation } => self.lead(*hold, *translation),
            Act::LetGo { hold } => self.let_go(*hold),
            Act::Change { settings } => self.change(settings),
            Act::TakeTool { name, text, pose, law } => match given(name, text, pose, *law)? {
                Some(tool) => self.take_tool(tool).map(|_| ()),
                None => Ok(()),
            },
            Act::MoveTool { tool, pose } => self.move_tool(*tool, *pose),
            Act::OpenJaws { tool, angle } => self.open_jaws(*tool, *angle),
            Act::LockJaws { tool, locked } => self.lock_jaws(*tool, *locked),
            Act::PutAway { tool } => self.put_away(*tool),
            Act::Reset => self.reset(),
        }
    }

    /// The scene without what hands have done, but with the settings that they have changed.
    pub(crate) fn written(&self) -> &Scene {
        &self.written
    }

    /// All that this scene has more than `written` was done by hand, these changes of settings among it.
    pub(crate) fn came_by_hand(
        &mut self,
        mut written: Scene,
        changes: Vec<Change>,
    ) -> Result<(), LiveError> {
        for change in &changes {
            written.change(&change.settings)?;
        }
        (self.written, self.by_hand) = (written, changes);
        Ok(())
    }
}
