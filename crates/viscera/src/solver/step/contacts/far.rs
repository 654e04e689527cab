//! Samples that are surely far from a tool: nothing is computed of them.
//!
//! ```text
//! D_now >= 0.9 D - S (V + W)             D: distance when it was last computed, S: the steepest that the tool's distance is
//! V, W   ways since of the vertex and of the point of the tool that went farthest;   0.1 D: turns of up to 0.05
//! far where 0.7 D/S - V - W > 2 (thickness + way of the sample and the tool in the step)
//! ```
//!
//! It decides when a distance is computed, and never what is found: what is left out is what the distance itself would leave out.

use crate::contact::{Shape, Tool};
use crate::layout::{LaidSample, Layout};
use crate::scalar::lanes::Point;
use crate::scalar::rigid::{RigidTransform, axis_times_sine};
use crate::scalar::{Real, Vec3};

/// Turns of a tool [rad] after which distances are computed again.
const MOST_TURN: f64 = 0.05;

/// What is left of a distance after such turns, of the distance and of its way in a step.
const LEFT: f64 = 0.7;

/// Larger than what rounding makes of sums of ways [m].
const ROUNDING: f64 = 1e-9;

/// What is known of distances between samples and tools.
#[derive(Clone, Debug, Default)]
pub struct Far {
    /// Where vertices were at the last step [m].
    seen: Vec<Vec3<f64>>,
    /// By how much samples may go farther than the vertex that goes farthest.
    spread: f64,
    /// How far the vertex that goes farthest has gone, step by step [m].
    travelled: f64,
    tools: Vec<Known>,
    /// Of each sample and tool how far both may go until they may be near [m].
    until: Vec<f64>,
    /// The least of it of each block of samples.
    blocks: Vec<f64>,
    /// Of all tools what goes farthest.
    most: Most,
}

/// Samples in a row that are looked at together.
pub const BLOCK: usize = 64;

#[derive(Clone, Copy, Debug, Default)]
struct Most {
    went: f64,
    /// Thickness and way in the step [m].
    reach: f64,
}

/// Of one tool.
#[derive(Clone, Debug)]
struct Known {
    shape: Shape,
    pose: RigidTransform,
    /// How far it has gone [m], and turned since all distances were computed.
    went: f64,
    turned: f64,
    /// How far it goes in the step [m].
    goes: f64,
}

impl Far {
    /// For the samples of a layout.
    pub fn new<S: Real>(layout: &Layout<S>) -> Self {
        let spread = |sample: &LaidSample| sample.weights.iter().map(|weight| weight.abs()).sum();
        Self {
            seen: vec![Vec3::ZERO; layout.vertex_count()],
            spread: layout.samples.iter().map(spread).fold(1.0, f64::max),
            ..Self::default()
        }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.seen[..])
            + size_of_val(&self.until[..])
            + size_of_val(&self.blocks[..])
            + size_of_val(&self.tools[..])
    }

    /// A step begins, in which so many samples may meet tools that go on from `starts`.
    pub fn begin<S: Real>(
        &mut self,
        (count, points): (usize, &[Point<S>]),
        (tools, starts): (&[Tool], &[RigidTransform]),
    ) {
        let is_same = self.tools.len() == tools.len()
            && self.tools.iter().zip(tools).all(|(known, tool)| known.shape.is(&tool.shape));
        let mut moved = 0.0f64;
        for (seen, point) in self.seen.iter_mut().zip(points) {
            let place = point.vec3().cast::<f64>();
            moved = moved.max((place - *seen).length_squared());
            *seen = place;
        }
        self.travelled += moved.sqrt() * self.spread;
        if !is_same || !self.travelled.is_finite() {
            self.travelled = 0.0;
            self.until.clear();
            self.until.resize(count * tools.len(), f64::NEG_INFINITY);
            self.blocks.clear();
            self.blocks.resize(count.div_ceil(BLOCK), f64::NEG_INFINITY);
            self.tools.clear();
            self.tools.extend(tools.iter().zip(starts).map(|(tool, start)| Known {
                shape: tool.shape.clone(),
                pose: *start,
                went: 0.0,
                turned: 0.0,
                goes: 0.0,
            }));
        }
        let all = self.tools.iter_mut().zip(starts).zip(tools);
        for (number, ((known, start), tool)) in all.enumerate() {
            let [way, turn] = went(tool, &known.pose, start);
            let [goes, turns] = went(tool, start, &tool.pose);
            (known.pose, known.goes) = (*start, goes);
            known.went += way;
            known.turned += turn;
            // Written so that what is no number is looked at again.
            if !(known.turned + turns <= MOST_TURN && known.went + goes < f64::INFINITY) {
                (known.went, known.turned) = (0.0, 0.0);
                self.until.iter_mut().skip(number).step_by(tools.len()).for_each(|until| {
                    *until = f64::NEG_INFINITY;
                });
                self.blocks.fill(f64::NEG_INFINITY);
            }
        }
        let reach = |(known, tool): (&Known, &Tool)| tool.law.thickness + known.goes;
        self.most = Most {
            went: self.tools.iter().map(|known| known.went).fold(0.0, f64::max),
            reach: self.tools.iter().zip(tools).map(reach).fold(0.0, f64::max),
        };
    }

    /// Whether all samples of a block, which go `farthest` [m], surely meet no tool.
    pub fn is_block_far(&self, block: usize, farthest: f64) -> bool {
        let left = self.blocks[block] - self.travelled - self.most.went;
        left > 2.0 * (farthest + self.most.reach) + ROUNDING
    }

    /// All samples of a block were looked at.
    pub fn end_block(&mut self, block: usize) {
        let size = BLOCK * self.tools.len();
        let all = self.until.chunks(size).nth(block).unwrap_or_default();
        self.blocks[block] = all.iter().copied().fold(f64::INFINITY, f64::min);
    }

    /// Whether a sample that goes `farthest` [m] surely does not meet a tool.
    pub fn is_far(&self, place: usize, number: usize, tool: &Tool, farthest: f64) -> bool {
        let known = &self.tools[number];
        let left = self.until[place * self.tools.len() + number] - self.travelled - known.went;
        left > 2.0 * (tool.law.thickness + farthest + known.goes) + ROUNDING
    }

    /// Keeps a distance [m] that was computed.
    pub fn keep(&mut self, place: usize, number: usize, tool: &Tool, distance: f64) {
        let until =
            LEFT * distance / tool.shape.steepest() + self.travelled + self.tools[number].went;
        let count = self.tools.len();
        self.until[place * count + number] = until;
    }
}

/// How far the point of a tool goes that goes farthest [m], and by how much it turns.
fn went(tool: &Tool, from: &RigidTransform, to: &RigidTransform) -> [f64; 2] {
    let way = (to.translation - from.translation).length();
    if from.rotation == to.rotation {
        return [way, 0.0];
    }
    let turn = &(to.rotation * from.rotation.transpose());
    let sine = axis_times_sine(turn).length();
    // Where the sine no longer tells the angle it is large anyway.
    let angle = if turn.trace() > 1.0 { 1.6 * sine } else { f64::INFINITY };
    [way + angle * tool.shape.reach(), angle]
}
