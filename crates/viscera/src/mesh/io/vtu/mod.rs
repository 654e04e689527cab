//! VTK XML unstructured grids and polygonal data, see "XML file formats" in the VTK documentation: read as text, Base64 or
//! bytes, plain or packed by zlib, in both byte orders; written with bytes behind the XML.

mod arrays;
mod codec;
mod places;
mod read;
mod write;

pub(super) use read::read;
pub use write::{Array, Grid, write, write_mesh, write_surface};

/// Cell types as VTK numbers them.
const VTK_TRIANGLE: u8 = 5;
const VTK_TETRA: u8 = 10;
