//! Legacy VTK files, see "VTK file formats" in the VTK documentation: unstructured grids and polygonal data of versions 1
//! to 5.1, as text or as bytes.

mod numbers;
mod read;
mod write;

pub(super) use read::read;
pub use write::{write, write_surface};
