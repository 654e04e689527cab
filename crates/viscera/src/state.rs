//! The state: everything that moves.

use crate::contact::{HeldMotion, Kept, Tool, Touch};
use crate::model::Model;
use crate::scalar::rigid::RigidTransform;
use crate::scalar::{Real, Vec3};

/// Positions, velocities and multipliers of a model at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct State<S> {
    /// Positions [m], shape [vertex_count].
    pub positions: Vec<Vec3<S>>,
    /// Velocities [m/s], shape [vertex_count].
    pub velocities: Vec<Vec3<S>>,
    /// Multipliers [J s^2] of all constraints, in the solver's layout, shape [multiplier_count]; empty before the
    /// first step, as if all were zero. Another solver of the same model may have another layout: clear them for it.
    /// A solver that keeps them from step to step starts from the last step's forces. After
    /// changing positions by hand, reset the warm start: [`crate::solver::Solver::restart`].
    pub multipliers: Vec<S>,
    /// The step [s] to which the multipliers belong: they are forces times its square.
    pub multiplier_dt: f64,
    /// What the quasi-Newton and the explicit method have learned; empty for others.
    pub learned: Learned<S>,
    /// What tools have touched, and tissue tissue; empty where there is none.
    pub contact: ContactState,
}

/// What is kept of contact from step to step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContactState {
    /// Where each tool is. A tool that has no pose here begins the next step where it ends it: it has not moved, and what it
    /// would have met on its way is not there. [`ContactState::of`] has the poses of tools at the beginning.
    pub poses: Vec<RigidTransform>,
    /// How tools move that springs hold, at the place of the first tool of each body; empty where there are none.
    pub held: Vec<HeldMotion>,
    /// What tools press on: by connected part, sample and tool.
    pub touches: Vec<Touch>,
    /// Tissue that presses on tissue: by connected part and sample.
    pub pairs: Vec<Kept>,
    /// Of each tie, whether it is torn.
    pub torn: Vec<bool>,
}

impl ContactState {
    /// Of tools that are where they are, and have touched nothing yet.
    pub fn of(tools: &[Tool]) -> Self {
        let poses = tools.iter().map(|tool| tool.pose).collect();
        let held = |tool: &Tool| {
            let mut motion = HeldMotion::default();
            if let Some(held) = &tool.held {
                motion.put(&held.hand);
            }
            motion
        };
        let is_any = tools.iter().any(|tool| tool.held.is_some());
        let held = if is_any { tools.iter().map(held).collect() } else { Vec::new() };
        Self { poses, held, ..Self::default() }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.poses[..])
            + size_of_val(&self.held[..])
            + size_of_val(&self.touches[..])
            + size_of_val(&self.pairs[..])
            + size_of_val(&self.torn[..])
    }
}

/// What methods keep from step to step. The quasi-Newton method: pairs of a step and the change of the gradient along it,
/// which tell the curvature. The explicit method: how much energy has gone that comes back. Vertices are in the solver's
/// numbering.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Learned<S> {
    /// Steps [m] and changes of the gradient [N s^2] in turn, each of all vertices.
    pub pairs: Vec<Vec3<S>>,
    /// Of each connected part.
    pub parts: Vec<LearnedPart>,
}

/// What is kept of a connected part.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LearnedPart {
    /// How many pairs are in use.
    pub count: u32,
    /// Which of them is the newest; older ones stand before it, the first after the last.
    pub newest: u32,
    /// Scale of the preconditioner, by the newest pair.
    pub scale: f64,
    /// The step of the solves that the pairs are of [s]; zero before the first.
    pub dt: f64,
    /// Whether no trial of the last solve was rejected.
    pub calm: bool,
    /// The parts that it was in touch with; see [`crate::solver`].
    pub group: u64,
    /// Energy [J] that explicit steps have lost for a while: it swings about its mean.
    pub owed: f64,
}

impl<S: Real> Learned<S> {
    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.pairs[..]) + size_of_val(&self.parts[..])
    }

    /// Forgets everything, and makes room for so many pairs.
    pub(crate) fn clear(&mut self, history: usize, vertices: usize, parts: usize) {
        self.pairs.clear();
        self.pairs.resize(2 * history * vertices, Vec3::ZERO);
        self.parts.clear();
        self.parts.resize(parts, LearnedPart::default());
    }
}

impl<S: Real> State<S> {
    /// The model at rest.
    pub fn at_rest(model: &Model<S>) -> Self {
        Self {
            positions: model.rest_positions.clone(),
            velocities: vec![Vec3::ZERO; model.vertex_count()],
            multipliers: Vec::new(),
            multiplier_dt: 0.0,
            learned: Learned::default(),
            contact: ContactState::default(),
        }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.positions[..])
            + size_of_val(&self.velocities[..])
            + size_of_val(&self.multipliers[..])
            + self.learned.bytes()
            + self.contact.bytes()
    }

    /// True while every number is finite.
    pub fn is_finite(&self) -> bool {
        self.positions.iter().chain(&self.velocities).all(|v| v.is_finite())
    }
}
