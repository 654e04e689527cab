//! From a file to a scene: a mesh, a surface or a segmented scan becomes bodies with materials, holds and gravity.
//!
//! [`open`] tells by its content what a file is; [`parts`] makes bodies of it; [`Import::scene`] writes the scene file
//! that puts them together, with comments that say what was measured, what was assumed, and what to look at first.
//! Those are bytes in, bytes out. [`scene_of`] is what programs do where they get such a file in place of a scene: it reads the
//! file and writes its scene, where nothing else is lost ([`write()`]).

mod balance;
mod bodies;
mod choose;
mod describe;
mod error;
mod files;
mod filling;
mod hold;
mod made;
mod name;
mod open;
mod organs;
mod quality;
mod scene;
mod size;
mod tissue;
mod unit;

pub use bodies::{Import, Inner, Options, Part, Skin, Touching, parts};
pub use choose::same_names;
pub use error::ImportError;
pub use files::{folder_of, is_foreign, load, scene_of, title_of};
pub use hold::{Hold, Place};
pub use made::{Made, Replace, write};
pub use name::{name_of, stem_of};
pub use open::{Found, is_image, open, rename};
pub use quality::angles_plot;
pub use scene::Written;
pub use size::Fineness;
pub use tissue::Tissue;
pub use unit::{Unit, guess as guess_unit, millilitres};
