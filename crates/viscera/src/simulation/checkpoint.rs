//! A moment of a running simulation, kept in memory, to which the same simulation goes back.

use super::Simulation;
use super::error::LiveError;
use super::holding::GraspOrigins;
use super::instruments::Instruments;
use crate::contact::Wrench;
use crate::scalar::{Real, Vec3};
use crate::scene::{Hand, Motion};
use crate::solver::Inputs;
use crate::solver::balance::ForceBalance;
use crate::state::State;

/// A moment of a simulation, of the same model: what [`Simulation::restore`] goes back to. It costs a copy of the state, where
/// [`Simulation::save`] and [`Simulation::resume`] build a simulation.
#[derive(Clone, Debug)]
pub struct Checkpoint<S> {
    /// Of the model.
    revision: u64,
    frame: u64,
    changes_made: usize,
    state: State<S>,
    before: Vec<Vec3<S>>,
    inputs: Inputs<S>,
    taken: GraspOrigins,
    instruments: Instruments,
    balance: ForceBalance,
    is_balanced: bool,
    wrenches: Vec<Wrench>,
    divided: u32,
    rejected_substeps: u64,
    /// Holds by hand, as far as they had come.
    holds: Vec<Motion>,
    /// Hands of each tool.
    hands: Vec<Vec<Hand>>,
}

impl<S: Real> Simulation<S> {
    /// The moment after the last frame.
    pub fn checkpoint(&self) -> Checkpoint<S> {
        Checkpoint {
            revision: self.model.revision(),
            frame: self.frame,
            changes_made: self.changes_made,
            state: self.whole_state(),
            before: self.before.clone(),
            inputs: self.inputs.clone(),
            taken: self.taken.clone(),
            instruments: self.instruments.clone(),
            balance: self.balance.clone(),
            is_balanced: self.is_balanced,
            wrenches: self.wrenches().to_vec(),
            divided: self.divided,
            rejected_substeps: self.rejected_substeps,
            holds: self.scene.motions[self.written.motions.len()..].to_vec(),
            hands: self.scene.tools.iter().map(|tool| tool.hands.clone()).collect(),
        }
    }

    /// Goes back to a moment of this simulation, or of another one of the same scene and settings: it goes on from there to
    /// the bit. Holds that were taken later are gone; what forces on tools are off by is known again after the next frame, and
    /// [`Simulation::ledger`] goes on. Refused where settings have changed since, or tools were taken.
    pub fn restore(&mut self, checkpoint: &Checkpoint<S>) -> Result<(), LiveError> {
        let Checkpoint { revision, changes_made, holds, hands, .. } = checkpoint;
        let first = self.written.motions.len();
        let is_same = *revision == self.model.revision()
            && *changes_made == self.changes_made
            && hands.len() == self.scene.tools.len()
            && first + holds.len() <= self.scene.motions.len();
        if !is_same {
            return Err(LiveError::OtherModel);
        }
        self.scene.motions.truncate(first);
        self.scene.motions.extend_from_slice(holds);
        self.assembly.motions.truncate(first + holds.len());
        for (number, hands) in hands.iter().enumerate() {
            for tools in [&mut self.scene.tools, &mut self.assembly.tools] {
                tools[number].hands.clone_from(hands);
            }
        }
        self.frame = checkpoint.frame;
        self.before.clone_from(&checkpoint.before);
        self.inputs.clone_from(&checkpoint.inputs);
        self.taken.clone_from(&checkpoint.taken);
        self.instruments.clone_from(&checkpoint.instruments);
        self.balance.clone_from(&checkpoint.balance);
        self.divided = checkpoint.divided;
        self.rejected_substeps = checkpoint.rejected_substeps;
        self.under_way = false;
        // What the solver remembers is of another step.
        (self.stepped, self.is_balanced) = (false, checkpoint.is_balanced);
        self.wrenches = Some(checkpoint.wrenches.clone());
        self.put_in_place(checkpoint.state.clone());
        self.measure_tissue();
        Ok(())
    }
}
