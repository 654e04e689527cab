//! Checksums of a frame's state, small enough for every frame and fine enough to tell where it differs.
//!
//! ```text
//! of each body     positions of its vertices in up to 256 blocks, then velocities of all
//! of each tool     force, torque, touches, depth and the angle of its jaws
//! ```
//!
//! 32 bits each, of the bits of the numbers.

use crate::scalar::{Real, Vec3};
use crate::simulation::Simulation;
use std::ops::Range;

/// Blocks of a body's vertices at most.
const BLOCKS: usize = 256;

/// What a checksum is of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Positions of some vertices of a body.
    Positions {
        /// The body.
        body: String,
        /// Numbers among the body's vertices.
        vertices: Range<usize>,
    },
    /// Velocities of a body's vertices.
    Velocities {
        /// The body.
        body: String,
    },
    /// The force on a tool, its torque, what touches it, or its jaws.
    Tool {
        /// The tool.
        tool: String,
    },
    /// The velocity of one vertex.
    Velocity {
        /// The body.
        body: String,
        /// Its number among the body's vertices.
        vertex: usize,
    },
    /// What is kept from frame to frame beside positions and velocities: multipliers, contact, jaws.
    Kept,
}

impl std::fmt::Display for Quantity {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Positions { body, vertices } if vertices.len() == 1 => {
                write!(f, "the position of vertex {} of body `{body}`", vertices.start)
            }
            Self::Positions { body, vertices } => write!(
                f,
                "positions of body `{body}`, among its vertices {} to {}",
                vertices.start,
                vertices.end.saturating_sub(1)
            ),
            Self::Velocities { body } => write!(f, "velocities of body `{body}`"),
            Self::Tool { tool } => {
                write!(f, "the force on tool `{tool}`, what touches it, or the angle of its jaws")
            }
            Self::Velocity { body, vertex } => {
                write!(f, "the velocity of vertex {vertex} of body `{body}`")
            }
            Self::Kept => f.write_str(
                "what is kept between frames beside positions and velocities: multipliers, contact, jaws",
            ),
        }
    }
}

fn mix(hash: u64, number: u64) -> u64 {
    (hash ^ number).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29)
}

/// Of the bytes of a file.
pub fn hash_of(bytes: &[u8]) -> u64 {
    let word =
        |chunk: &[u8]| chunk.iter().rev().fold(0_u64, |word, &byte| (word << 8) | u64::from(byte));
    bytes.chunks(8).fold(mix(0, bytes.len() as u64), |hash, chunk| mix(hash, word(chunk)))
}

fn folded(numbers: impl Iterator<Item = f64>) -> u32 {
    let hash = numbers.fold(0, |hash, number| mix(hash, number.to_bits()));
    (hash ^ (hash >> 32)) as u32
}

fn of_vectors<S: Real>(vectors: &[Vec3<S>]) -> u32 {
    folded(vectors.iter().flat_map(|v| v.to_array().map(S::to_f64)))
}

/// Calls `with` for each checksum of a state: what it is of, and the checksum.
fn each<S: Real>(simulation: &Simulation<S>, mut with: impl FnMut(&dyn Fn() -> Quantity, u32)) {
    let state = simulation.state();
    for body in &simulation.assembly().bodies {
        let positions = &state.positions[body.vertices.clone()];
        let size = positions.len().div_ceil(BLOCKS).max(1);
        for (number, block) in positions.chunks(size).enumerate() {
            let vertices = number * size..number * size + block.len();
            let name =
                || Quantity::Positions { body: body.name.clone(), vertices: vertices.clone() };
            with(&name, of_vectors(block));
        }
        let name = || Quantity::Velocities { body: body.name.clone() };
        with(&name, of_vectors(&state.velocities[body.vertices.clone()]));
    }
    for (number, tool) in simulation.tool_forces().iter().enumerate() {
        let others = [f64::from(tool.touches), f64::from(tool.pinned), tool.depth];
        let angle = simulation.jaw_angle(number).unwrap_or(0.0);
        let numbers = tool.force.into_iter().chain(tool.torque).chain(others).chain([angle]);
        let name = || Quantity::Tool { tool: tool.name.clone() };
        with(&name, folded(numbers));
    }
}

/// The checksums of a state, in their order.
pub fn checks<S: Real>(simulation: &Simulation<S>) -> Vec<u8> {
    let mut bytes = Vec::new();
    each(simulation, |_, check| bytes.extend(check.to_le_bytes()));
    bytes
}

/// The first of the quantities of a state that have other checksums.
pub fn difference<S: Real>(simulation: &Simulation<S>, recorded: &[u8]) -> Option<Quantity> {
    let (mut first, mut at) = (None, 0);
    each(simulation, |quantity, check| {
        if first.is_none() && recorded.get(at..at + 4) != Some(&check.to_le_bytes()) {
            first = Some(quantity());
        }
        at += 4;
    });
    first.or((at != recorded.len()).then_some(Quantity::Kept))
}
