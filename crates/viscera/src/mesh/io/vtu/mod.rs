//! VTK XML unstructured grids in ASCII, see "XML file formats" in the VTK documentation.

mod read;
mod write;

pub(super) use read::read;
pub use write::{Array, write, write_surface};

/// Cell types as VTK numbers them.
const VTK_TRIANGLE: u8 = 5;
const VTK_TETRA: u8 = 10;
