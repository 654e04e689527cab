//! From a file to a scene: a mesh, a surface or a segmented scan becomes bodies with materials, holds and gravity.
//!
//! [`open`] tells by its content what a file is; [`parts`] makes bodies of it; [`Import::scene`] writes the scene file
//! that puts them together, with comments that say what was measured, what was assumed, and what to look at first.
//! Bytes in, bytes out: programs read and write the files.

mod balance;
mod bodies;
mod choose;
mod error;
mod filling;
mod hold;
mod name;
mod open;
mod organs;
mod scene;
mod size;
mod tissue;
mod unit;

pub use bodies::{Import, Inner, Options, Part, Skin, Touching, parts};
pub use choose::same_names;
pub use error::ImportError;
pub use hold::{Hold, Place};
pub use name::{name_of, stem_of};
pub use open::{Found, is_image, open, rename};
pub use scene::Written;
pub use size::Fineness;
pub use tissue::Tissue;
pub use unit::{Unit, guess as guess_unit, millilitres};
