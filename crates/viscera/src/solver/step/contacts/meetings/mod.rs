//! Tissue that meets tissue on a device: what kernels know of the skin, and what they keep of it.
//!
//! Every sample of the skin has one place for what it meets, and every tie one of its own behind them: no list that could
//! overflow. They stand behind the loads, `MEETING_VECTORS` each (`records.wgsl`), and behind them what a step makes of the
//! skin: places of its points, normals of its triangles with the range of those who meet them, boxes of its tree, and
//! meetings sorted by triangles, in which triangles find the reactions.

mod extents;
mod rows;
mod tables;
#[cfg(test)]
mod tests;

pub(crate) use crate::settings::HAS_MEETINGS as IS_THERE;
pub use extents::{MEETING_VECTORS, Meetings, names};
pub use rows::{kept, pairs, rows, torn, torn_rows};
pub use tables::{SkinRow, put};
