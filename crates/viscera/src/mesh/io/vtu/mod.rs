//! VTK XML unstructured grids, see "XML file formats" in the VTK documentation: read with numbers as text or as bytes
//! behind the XML, written with bytes.

mod arrays;
mod read;
mod write;

pub(super) use read::read;
pub use write::{Array, Grid, write, write_surface};

/// Cell types as VTK numbers them.
const VTK_TRIANGLE: u8 = 5;
const VTK_TETRA: u8 = 10;
