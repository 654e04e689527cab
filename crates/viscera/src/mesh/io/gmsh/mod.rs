//! Gmsh meshes: versions 1 (`$NOD`, `$ELM`), 2.x, 4.0 and 4.1, as text or binary in either byte order; see "File formats" in
//! the Gmsh reference manual.
//!
//! Vertex numbers may be any, in any order. The region of a cell is its first physical group, 0 without one; physical groups
//! of points, curves and surfaces are patches.

mod kinds;
mod numbers;
mod read;
mod records;
mod write;
mod write_binary;

pub(super) use read::read;
pub use write::write;
pub use write_binary::write_binary;
