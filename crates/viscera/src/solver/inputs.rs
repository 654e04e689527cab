//! Inputs of a step: loads, pins, tethers and anchors from outside, and whether they are legal.

use super::error::StepError;
use crate::contact::Tool;
use crate::layout::{HAS_CLUSTERS, Layout};
use crate::model::Model;
use crate::scalar::{Real, Vec3};
use crate::settings::{Clusters, Colors, Elements, Method, SolverSettings};
use crate::state::State;

/// A vertex that is moved, not simulated, during a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pin<S> {
    /// The vertex.
    pub vertex: u32,
    /// Where it is at the end of the step [m].
    pub target: Vec3<S>,
}

/// A spring without length from a vertex to a place, for the time of a step: how a tool holds tissue that
/// gives way. On a pinned vertex it does nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tether<S> {
    /// The vertex.
    pub vertex: u32,
    /// Where it is pulled to, throughout the step [m].
    pub target: Vec3<S>,
    /// [N/m], zero or more.
    pub stiffness: S,
}

/// Loads and constraints that act on the model from outside during one step.
#[derive(Clone, Debug, PartialEq)]
pub struct Inputs<S> {
    /// Acceleration of gravity [m/s^2].
    pub gravity: Vec3<S>,
    /// Pinned vertices. The set may change from step to step.
    pub pins: Vec<Pin<S>>,
    /// Soft position constraints to moving targets. The set may change from step to step; several on one vertex add up.
    pub tethers: Vec<Tether<S>>,
    /// Where each anchor is at the end of the step [m], in the order in which they were added. Empty: all at rest.
    pub anchors: Vec<Vec3<S>>,
    /// External forces [N] on single vertices; several on one vertex add up.
    pub forces: Vec<(u32, Vec3<S>)>,
    /// Tools and obstacles that touch the model's samples, each at the end of the step. A tool keeps its place in the list
    /// as long as it is there: what it has touched is remembered by that.
    pub tools: Vec<Tool>,
}

impl<S: Real> Default for Inputs<S> {
    fn default() -> Self {
        Self {
            gravity: Vec3::ZERO,
            pins: Vec::new(),
            tethers: Vec::new(),
            anchors: Vec::new(),
            forces: Vec::new(),
            tools: Vec::new(),
        }
    }
}

impl<S: Real> Inputs<S> {
    /// The same in another precision.
    pub fn cast<T: Real>(&self) -> Inputs<T> {
        let pin = |pin: &Pin<S>| Pin { vertex: pin.vertex, target: pin.target.cast() };
        let tether = |tether: &Tether<S>| Tether {
            vertex: tether.vertex,
            target: tether.target.cast(),
            stiffness: T::from_f64(tether.stiffness.to_f64()),
        };
        Inputs {
            gravity: self.gravity.cast(),
            pins: self.pins.iter().map(pin).collect(),
            tethers: self.tethers.iter().map(tether).collect(),
            anchors: self.anchors.iter().map(|anchor| anchor.cast()).collect(),
            forces: self.forces.iter().map(|&(vertex, force)| (vertex, force.cast())).collect(),
            tools: self.tools.clone(),
        }
    }

    /// Where anchors are that are at `at_rest` [m] where nothing moves them.
    pub fn anchors_of<'a>(&'a self, at_rest: &'a [Vec3<S>]) -> &'a [Vec3<S>] {
        if self.anchors.is_empty() { at_rest } else { &self.anchors }
    }
}

/// A step can be made with these inputs.
pub(crate) fn check_step<S: Real>(
    dt: f64,
    layout: &Layout<S>,
    inputs: &Inputs<S>,
) -> Result<(), StepError> {
    // Multipliers are forces times the squared step, so that the square must be a number too.
    let squared = S::from_f64(dt * dt);
    if !(dt > 0.0 && squared > S::ZERO && squared.is_finite()) {
        return Err(StepError::BadStep { dt });
    }
    check_inputs(layout, inputs)
}

fn is_legal<S: Real>(tether: &Tether<S>) -> bool {
    tether.target.is_finite() && tether.stiffness >= S::ZERO && tether.stiffness.is_finite()
}

/// The settings go together.
pub(crate) fn check_settings(settings: &SolverSettings) -> Result<(), StepError> {
    let method = settings.method;
    if method != Method::Xpbd {
        return Ok(());
    }
    match (settings.elements, settings.clusters, settings.colors) {
        (Elements::Recovered, ..) => Err(StepError::Elements { method }),
        (_, Clusters::OfTets(_), _) if !HAS_CLUSTERS => Err(StepError::NoClusters),
        (_, Clusters::OfTets(_), Colors::Limited(colors)) => {
            Err(StepError::ClustersAndColors { colors })
        }
        _ => Ok(()),
    }
}

/// The model is the one that was laid out.
pub(crate) fn check_model<S: Real>(layout: &Layout<S>, model: &Model<S>) -> Result<(), StepError> {
    if layout.revision == model.revision { Ok(()) } else { Err(StepError::OtherModel) }
}

/// The state fits the model; at rest it has no multipliers yet.
pub(crate) fn check_state<S: Real>(layout: &Layout<S>, state: &State<S>) -> Result<(), StepError> {
    let vertex_count = layout.vertex_count();
    let lengths = [
        ("list of positions", state.positions.len(), vertex_count),
        ("list of velocities", state.velocities.len(), vertex_count),
        ("list of multipliers", state.multipliers.len(), layout.multiplier_count),
    ];
    for (place, (what, given, expected)) in lengths.into_iter().enumerate() {
        let is_none = place == 2 && given == 0;
        if given != expected && !is_none {
            return Err(StepError::Mismatch { what, given, expected });
        }
    }
    Ok(())
}

/// The inputs fit the model.
pub(crate) fn check_inputs<S: Real>(
    layout: &Layout<S>,
    inputs: &Inputs<S>,
) -> Result<(), StepError> {
    let vertex_count = layout.vertex_count();
    let expected = layout.rest_anchors.len();
    if !inputs.anchors.is_empty() && inputs.anchors.len() != expected {
        return Err(StepError::AnchorCount { given: inputs.anchors.len(), expected });
    }
    let vertices = (inputs.pins.iter().map(|pin| ("pin", pin.vertex)))
        .chain(inputs.tethers.iter().map(|tether| ("tether", tether.vertex)))
        .chain(inputs.forces.iter().map(|&(vertex, _)| ("force", vertex)));
    for (what, vertex) in vertices {
        if vertex as usize >= vertex_count {
            return Err(StepError::UnknownVertex { what, vertex, vertex_count });
        }
    }
    let finite = [
        ("gravity", inputs.gravity.is_finite()),
        ("pin targets", inputs.pins.iter().all(|pin| pin.target.is_finite())),
        ("tethers", inputs.tethers.iter().all(is_legal)),
        ("anchors", inputs.anchors.iter().all(|anchor| anchor.is_finite())),
        ("forces", inputs.forces.iter().all(|(_, force)| force.is_finite())),
    ];
    if let Some((what, _)) = finite.into_iter().find(|(_, finite)| !finite) {
        return Err(StepError::NotFinite { what });
    }
    check_tools(layout, &inputs.tools)
}

/// Tools have shapes, laws and poses that tissue can meet.
fn check_tools<S: Real>(layout: &Layout<S>, tools: &[Tool]) -> Result<(), StepError> {
    for (tool, given) in tools.iter().enumerate() {
        let Tool { shape, pose, law, held, .. } = given;
        if !pose.is_finite() {
            return Err(StepError::NotFinite { what: "poses of tools" });
        }
        let moved = (!pose.is_rigid()).then_some("a pose keeps lengths: give a rotation matrix");
        let spring = held.as_ref().and_then(|held| held.spring.complaint());
        let hand = held.as_ref().filter(|held| !held.hand.is_rigid());
        let hand = hand.map(|_| "a hand's pose keeps lengths: give a rotation matrix");
        let why = shape.complaint().or_else(|| law.complaint()).or(spring).or(moved).or(hand);
        if let Some(why) = why {
            return Err(StepError::BadTool { tool, why });
        }
    }
    if !tools.is_empty() && layout.samples.is_empty() {
        return Err(StepError::NoSamples);
    }
    Ok(())
}
