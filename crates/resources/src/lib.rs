//! # viscera-resources
//!
//! What the programs take from their machine, once for all of them: files, built-in scenes, memory.
//!
//! | to | look at |
//! |---|---|
//! | read a file, write one atomically, print a result | [`files`] |
//! | find the mesh files of a scene | [`MeshFiles`] |
//! | run a scene that needs no file | [`scene_text()`], [`BUILT_IN`], [`BuiltInScene`] |
//! | refuse what does not fit into memory | [`memory`], [`Memory`] |
//! | name the processor beside what it was measured on | [`processor()`] |

pub mod files;
pub mod memory;
mod processor;
mod scenes;

pub use files::MeshFiles;
pub use memory::Memory;
pub use processor::processor;
pub use scenes::{BUILT_IN, BuiltInScene, scene_text};
