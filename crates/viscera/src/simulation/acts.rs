//! What hands do to a running simulation, one act after the other, as a recording has it.

use crate::contact::ContactLaw;
use crate::scalar::Vec3;
use crate::scalar::rigid::RigidTransform;
use crate::scene::{Instrument, SceneError, Selector, read_tray};

/// Something that was done between two frames. Numbers of holds and tools are those that taking them has returned.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Act {
    /// `Simulation::take_hold`.
    TakeHold {
        /// Its name, without the number.
        name: String,
        /// The body's number.
        body: usize,
        /// What is held of it.
        selector: Selector,
        /// [N/m].
        stiffness: Option<f64>,
    },
    /// `Simulation::lead`.
    Lead {
        /// The hold.
        hold: usize,
        /// [m].
        translation: Vec3<f64>,
    },
    /// `Simulation::let_go`.
    LetGo {
        /// The hold.
        hold: usize,
    },
    /// `Simulation::change`.
    Change {
        /// Keys and values.
        settings: Vec<(String, String)>,
    },
    /// `Simulation::take_tool`.
    TakeTool {
        /// Its name.
        name: String,
        /// What was written of it.
        text: String,
        /// Where it was taken.
        pose: RigidTransform,
        /// Stiffness, thickness [m] and friction of its contact.
        law: [f64; 3],
    },
    /// `Simulation::move_tool`.
    MoveTool {
        /// The tool.
        tool: usize,
        /// Where it is to be.
        pose: RigidTransform,
    },
    /// `Simulation::open_jaws`.
    OpenJaws {
        /// The tool.
        tool: usize,
        /// [rad].
        angle: f64,
    },
    /// `Simulation::lock_jaws`.
    LockJaws {
        /// The tool.
        tool: usize,
        /// Whether they are locked from then on.
        locked: bool,
    },
    /// `Simulation::put_away`.
    PutAway {
        /// The tool.
        tool: usize,
    },
    /// `Simulation::reset`.
    Reset,
}

impl Act {
    /// Of an instrument as it is given to be taken.
    pub(super) fn take_tool(given: &Instrument) -> Self {
        let ContactLaw { stiffness, thickness, friction } = given.law;
        Self::TakeTool {
            name: given.name.clone(),
            text: given.text(),
            pose: given.placement,
            law: [stiffness, thickness, friction],
        }
    }
}

/// The instrument that was given to be taken.
pub(super) fn given(
    name: &str,
    text: &str,
    pose: &RigidTransform,
    [stiffness, thickness, friction]: [f64; 3],
) -> Result<Option<Instrument>, SceneError> {
    let mut tool = read_tray("recording", text)?.into_iter().next();
    if let Some(tool) = &mut tool {
        tool.name = name.to_owned();
        tool.placement = *pose;
        tool.law = ContactLaw { stiffness, thickness, friction };
    }
    Ok(tool)
}
