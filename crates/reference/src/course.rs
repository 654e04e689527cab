//! States of rest of a scene, from one to the next, so that each lies in the minimum that its motions lead to.

use viscera::contact::{Shape, Wrench};
use viscera::scalar::Vec3;
use viscera::scene::{Instrument, Scene};
use viscera::simulation::{Simulation, ToolState};
use viscera::solver::Inputs;

use super::overlap::find_overlap;
use super::sensitivity::{Change, Tangent};
use super::{Convergence, Reference, ReferenceError, Tolerance};

/// Why a scene has no state of rest that does not depend on how it came there.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Undetermined {
    /// A motion takes hold of tissue on its way.
    #[error(
        "motion `{name}` takes hold of moving tissue at {start} s, which a state of rest does not determine; let it start \
         at 0 s"
    )]
    LateHold {
        /// Of the motion.
        name: String,
        /// [s].
        start: f64,
    },
    /// Settings change on the way.
    #[error(
        "settings change at {time} s; write those of the end where the bodies and the solver are, and leave [[change]] out"
    )]
    Change {
        /// [s].
        time: f64,
    },
    /// A tool comes on its way.
    #[error(
        "tool `{name}` comes at {begin} s, and states of rest know the tools of the beginning only; let it be there from 0 s, \
         away from tissue"
    )]
    LateTool {
        /// Its name.
        name: String,
        /// [s].
        begin: f64,
    },
    /// Connective tissue, which the reference has none of.
    #[error(
        "`{name}` ties bodies together, and states of rest know springs, fixings and tools only; leave out [[tie]]"
    )]
    Tie {
        /// Of the tie.
        name: String,
    },
    /// Several bodies that may touch.
    #[error(
        "its bodies meet each other, and states of rest know contact with tools only; where they stay apart set \
         contact.bodies = false"
    )]
    Bodies,
    /// A tool leaves on its way.
    #[error(
        "tool `{name}` leaves at {end} s, and states of rest know the tools of the beginning only; let it move away"
    )]
    LeavingTool {
        /// Its name.
        name: String,
        /// [s].
        end: f64,
    },
    /// A spring holds a tool.
    #[error(
        "a spring holds tool `{name}`, and states of rest know tools that are where they are led; leave out its spring"
    )]
    Spring {
        /// Of the tool.
        name: String,
    },
    /// Jaws close until they press.
    #[error(
        "the jaws of tool `{name}` follow a force, so that a state of rest does not tell their angle; drive them by an angle"
    )]
    Jaws {
        /// Of the tool.
        name: String,
    },
    /// Jaws tie tissue.
    #[error(
        "tool `{name}` ties tissue to its jaws, and where it does so is a matter of motion; leave out its locks"
    )]
    Locks {
        /// Of the tool.
        name: String,
    },
}

/// Refuses scenes whose states of rest depend on more than what acts there.
pub fn check_determined(scene: &Scene) -> Result<(), Undetermined> {
    // Where tissue was when it was taken hold of is a matter of its motion.
    if let Some(motion) = scene.motions.iter().find(|motion| motion.start > 0.0) {
        return Err(Undetermined::LateHold { name: motion.name.clone(), start: motion.start });
    }
    if let Some(change) = scene.changes.first() {
        return Err(Undetermined::Change { time: change.time });
    }
    if let Some(tie) = scene.ties.first() {
        return Err(Undetermined::Tie { name: tie.name.clone() });
    }
    if scene.bodies.len() > 1 && scene.contact.bodies {
        return Err(Undetermined::Bodies);
    }
    if let Some(tool) = scene.tools.iter().find(|tool| tool.begin > 0.0) {
        return Err(Undetermined::LateTool { name: tool.name.clone(), begin: tool.begin });
    }
    if let Some((tool, end)) = scene.tools.iter().find_map(|tool| Some((tool, tool.leaves()?))) {
        return Err(Undetermined::LeavingTool { name: tool.name.clone(), end });
    }
    if let Some(tool) = scene.tools.iter().find(|tool| tool.spring.is_some()) {
        return Err(Undetermined::Spring { name: tool.name.clone() });
    }
    let with_jaws = || scene.tools.iter().filter_map(|tool| Some((tool, tool.jaws.as_ref()?)));
    if let Some((tool, _)) = with_jaws().find(|(_, jaws)| jaws.follow_force()) {
        return Err(Undetermined::Jaws { name: tool.name.clone() });
    }
    match with_jaws().find(|(_, jaws)| !jaws.locks.is_empty()) {
        Some((tool, _)) => Err(Undetermined::Locks { name: tool.name.clone() }),
        None => Ok(()),
    }
}

/// Unbalanced forces over those of the start: next to round-off, as derivatives are of what is at rest.
const CLOSE: f64 = 1e-13;

/// Of the size of all bodies, what holds and pulls moves from one solve to the next at most.
const STRIDE: f64 = 0.1;

/// Of the tool's thickness, and of the shortest edges on the tissue's surface, what a tool moves: one that goes deeper at once
/// pushes tissue out on its other side.
const TOOL_STRIDE: f64 = 0.25;

/// A frame is divided in two so many times at most.
const HALVINGS: u32 = 10;

/// How far what acts may move at once.
struct Strides {
    /// [m].
    of_holds: f64,
    /// [m].
    of_tools: f64,
    /// Of all bodies [m].
    size: f64,
}

impl Strides {
    fn new(simulation: &Simulation<f64>) -> Self {
        let (model, tools) = (simulation.model(), simulation.inputs_at(0.0).tools);
        let along = |axis: usize| {
            let ends = model.rest_positions.iter().map(|x| x[axis]);
            ends.clone().fold(f64::NEG_INFINITY, f64::max) - ends.fold(f64::INFINITY, f64::min)
        };
        let size = Vec3::from_f64([0, 1, 2].map(along)).length();
        let edges = model.samples.iter().map(|sample| sample.edge).fold(size, f64::min);
        let thinnest = tools.iter().map(|tool| thickness(&tool.shape)).fold(edges, f64::min);
        Self { of_holds: STRIDE * size, of_tools: TOOL_STRIDE * thinnest, size }
    }

    /// How many strides there are between what acts at two times.
    fn between(&self, before: &Inputs<f64>, after: &Inputs<f64>) -> f64 {
        let pins = before.pins.iter().zip(&after.pins).map(|(a, b)| (b.target - a.target).length());
        let pulled = before.tethers.iter().zip(&after.tethers);
        let pulled = pulled.map(|(a, b)| (b.target - a.target).length());
        let tools = before.tools.iter().zip(&after.tools).map(|(a, b)| {
            let columns = a.pose.rotation.columns.iter().zip(&b.pose.rotation.columns);
            let turned = columns.map(|(a, b)| (*b - *a).length()).fold(0.0, f64::max);
            let moved = (b.pose.translation - a.pose.translation).length();
            moved + turned * a.shape.reach().min(self.size)
        });
        let holds = pins.chain(pulled).fold(0.0, f64::max) / self.of_holds;
        holds.max(tools.fold(0.0, f64::max) / self.of_tools)
    }
}

/// The diameter of the largest ball in a tool's shape [m].
fn thickness(shape: &Shape) -> f64 {
    match shape {
        Shape::Sphere { radius } | Shape::Capsule { radius, .. } => 2.0 * radius,
        Shape::RoundedBox { half, .. } => 2.0 * half.x.min(half.y).min(half.z),
        // Solid without end, and nobody knows how thin.
        Shape::HalfSpace | Shape::Mesh(_) => f64::INFINITY,
    }
}

/// A scene whose states of rest are followed.
pub struct Course<'a> {
    simulation: &'a Simulation<f64>,
    reference: Reference,
    strides: Strides,
}

/// A state of rest of a scene.
#[derive(Clone, Debug)]
pub struct RestState {
    /// [s].
    pub time: f64,
    /// What acts there.
    pub inputs: Inputs<f64>,
    /// Positions [m], shape [vertex_count].
    pub positions: Vec<Vec3<f64>>,
    /// Forces [N] that hold pinned vertices, zero on free ones, shape [vertex_count].
    pub holding: Vec<Vec3<f64>>,
    /// On each of the tools that act there.
    pub wrenches: Vec<Wrench>,
    /// How the last solve went; Newton steps of all of them.
    pub convergence: Convergence,
}

impl<'a> Course<'a> {
    /// Of a simulation that has just been made, with the elements that its solver has.
    pub fn new(simulation: &'a Simulation<f64>, memory: u64) -> Self {
        let (model, elements) = (simulation.model(), simulation.solver().elements);
        let tolerance = Tolerance { relative: CLOSE, ..Tolerance::default() };
        let reference = Reference::with_elements(model, elements).allow_memory(memory);
        let reference = reference.with_tolerance(tolerance);
        Self { simulation, reference, strides: Strides::new(simulation) }
    }

    /// Solves end where this says that they shall not go on ([`Reference::stop_where`]).
    pub fn stop_where(mut self, goes_on: fn() -> bool) -> Self {
        self.reference = self.reference.stop_where(goes_on);
        self
    }

    /// What solves.
    pub fn reference(&self) -> &Reference {
        &self.reference
    }

    /// The same, for what keeps its analysis.
    pub fn reference_mut(&mut self) -> &mut Reference {
        &mut self.reference
    }

    /// Positions [m] where nothing acts, shape [vertex_count].
    pub fn rest(&self) -> &[Vec3<f64>] {
        &self.simulation.model().rest_positions
    }

    /// The state of rest at a time [s]: from `start`, positions [m] of the state at a time before, on, in strides that are
    /// short enough to follow what moves.
    pub fn go(
        &mut self,
        (before, start): (f64, &[Vec3<f64>]),
        time: f64,
    ) -> Result<RestState, ReferenceError> {
        let (mut here, mut steps) = (start.to_vec(), 0);
        for stop in self.stops(before, time) {
            let state = self.settle(&here, stop)?;
            here = state.positions;
            steps += state.convergence.steps;
        }
        let mut state = self.settle(&here, time)?;
        state.convergence.steps += steps;
        let meets_itself = self.simulation.scene().contact.self_;
        match find_overlap(self.simulation.model(), &state.positions).filter(|_| meets_itself) {
            Some(vertex) => Err(ReferenceError::Overlap { vertex }),
            None => Ok(state),
        }
    }

    /// Times between two [s] from each of which to the next nothing moves further than its stride.
    fn stops(&self, before: f64, time: f64) -> Vec<f64> {
        let frame = self.simulation.scene().time.frame;
        // After its end a scene stands still.
        let scene_end = self.simulation.scene().frame_count() as f64 * frame;
        let frames = (1u32..).map(|frames| before + f64::from(frames) * frame);
        let ends = frames.take_while(|end| *end < time.min(scene_end)).chain([time]);
        let mut stops = Vec::new();
        let mut last = (before, self.simulation.inputs_at(before));
        let mut frame_before = before;
        for end in ends {
            self.divide(&mut last, (frame_before, end), HALVINGS, &mut stops);
            frame_before = end;
        }
        stops
    }

    /// Adds stops in a frame, so that strides since the last one and in it are short enough.
    fn divide(
        &self,
        last: &mut (f64, Inputs<f64>),
        (start, end): (f64, f64),
        halvings: u32,
        stops: &mut Vec<f64>,
    ) {
        let inputs = self.simulation.inputs_at(end);
        if self.strides.between(&last.1, &inputs) <= 1.0 {
            return;
        }
        if start > last.0 {
            *last = (start, self.simulation.inputs_at(start));
            stops.push(start);
        }
        if halvings > 0 && self.strides.between(&last.1, &inputs) > 1.0 {
            let middle = 0.5 * (start + end);
            self.divide(last, (start, middle), halvings - 1, stops);
            self.divide(last, (middle, end), halvings - 1, stops);
        }
    }

    /// The state of rest at a time [s] that Newton's method finds from `start` [m], whatever lies between.
    fn settle(&mut self, start: &[Vec3<f64>], time: f64) -> Result<RestState, ReferenceError> {
        let inputs = self.simulation.inputs_at(time);
        let solution = self.reference.settle(start, &inputs)?;
        let (positions, convergence) = (solution.positions, solution.convergence);
        let wrenches = self.reference.wrenches(&positions, &inputs, &[])?;
        let mut holding = vec![Vec3::ZERO; positions.len()];
        let reactions = self.reference.reactions(&positions, &inputs)?;
        for (pin, force) in inputs.pins.iter().zip(reactions) {
            holding[pin.vertex as usize] = force;
        }
        Ok(RestState { time, inputs, positions, holding, wrenches, convergence })
    }

    fn slope(&self, state: &RestState, change: &Change) -> Vec<Vec3<f64>> {
        let of = (self.simulation.model(), self.simulation.solver().elements);
        self.reference.slope(of, (&state.positions, &state.inputs), change)
    }

    /// How a state of rest changes, by each of these changes.
    pub fn tangents(
        &self,
        state: &RestState,
        changes: &[Change],
    ) -> Result<Vec<Tangent>, ReferenceError> {
        let mut linearized = self.reference.linearize(&state.positions, &state.inputs)?;
        let tangent = |change| linearized.tangent(&self.slope(state, change), change);
        Ok(changes.iter().map(tangent).collect())
    }

    /// Derivatives of a function of positions, by each of these changes, from its gradient [per m], shape [vertex_count].
    pub fn pull_back(
        &self,
        state: &RestState,
        by_positions: &[Vec3<f64>],
        changes: &[Change],
    ) -> Result<Vec<f64>, ReferenceError> {
        let mut linearized = self.reference.linearize(&state.positions, &state.inputs)?;
        let adjoint = linearized.adjoint(by_positions);
        let by_change = |change: &Change| {
            let slope = self.slope(state, change);
            -adjoint.iter().zip(&slope).map(|(a, b)| a.dot(*b)).sum::<f64>()
        };
        Ok(changes.iter().map(by_change).collect())
    }

    /// Forces [N] on the tissue by each of the scene's fixings, motions, forces and tools, by their names.
    pub fn forces(&self, state: &RestState) -> Vec<(String, Vec3<f64>)> {
        let mut forces = self.patches(state, &state.positions, &state.holding);
        let on_parts: Vec<_> = state.wrenches.iter().map(|wrench| wrench.force).collect();
        forces.extend(self.tools(&on_parts));
        forces
    }

    /// Their derivatives by the number at `key`, whose change of the state is known [N per unit].
    pub fn forces_along(
        &self,
        state: &RestState,
        tangent: &Tangent,
        key: &str,
    ) -> Vec<(String, Vec3<f64>)> {
        // Forces of patches are linear in positions and holding forces: any step will do, and one about as large as the body
        // rounds least.
        let largest = |of: &[Vec3<f64>]| of.iter().map(|x| x.length()).fold(0.0, f64::max);
        let moved = largest(&tangent.positions);
        let step = if moved > 0.0 { largest(&state.positions) / moved } else { 1.0 };
        let add = |to: &[Vec3<f64>], change: &[Vec3<f64>]| -> Vec<_> {
            to.iter().zip(change).map(|(to, change)| *to + *change * step).collect()
        };
        let here = self.patches(state, &state.positions, &state.holding);
        let positions = add(&state.positions, &tangent.positions);
        let there = self.patches(state, &positions, &add(&state.holding, &tangent.holding));
        let mut forces: Vec<_> = (here.iter().zip(there))
            .map(|((name, here), (_, there))| (name.clone(), (there - *here) * (1.0 / step)))
            .collect();
        // Springs of a fixing pull in proportion to their stiffness.
        for fixing in &self.simulation.scene().fixings {
            let is_it =
                key.strip_prefix("fixing.").and_then(|rest| rest.strip_suffix(".stiffness"))
                    == Some(&fixing.name);
            let (Some(stiffness), true) = (fixing.stiffness, is_it) else { continue };
            let pulls = here.iter().find(|(name, _)| *name == fixing.name);
            let entry = forces.iter_mut().find(|(name, _)| *name == fixing.name);
            if let (Some((_, pulls)), Some((_, force))) = (pulls, entry) {
                *force += *pulls * (1.0 / stiffness);
            }
        }
        forces.extend(self.tools(&tangent.tools));
        forces
    }

    fn patches(
        &self,
        state: &RestState,
        positions: &[Vec3<f64>],
        holding: &[Vec3<f64>],
    ) -> Vec<(String, Vec3<f64>)> {
        let patches = self.simulation.patch_forces_at(state.time, positions, holding);
        patches.into_iter().map(|patch| (patch.name, Vec3::from_f64(patch.force))).collect()
    }

    /// What each tool does to tissue, from the forces on its parts.
    fn tools(&self, on_parts: &[Vec3<f64>]) -> Vec<(String, Vec3<f64>)> {
        let mut parts = on_parts.iter();
        let states = self.simulation.tools();
        let of_tool = |(tool, state): (&Instrument, &ToolState)| {
            let count = if state.is_there { tool.parts.len() } else { 0 };
            let force = parts.by_ref().take(count).fold(Vec3::ZERO, |sum, force| sum - *force);
            (tool.name.clone(), force)
        };
        self.simulation.assembly().tools.iter().zip(&states).map(of_tool).collect()
    }
}
