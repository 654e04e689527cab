//! # viscera-web
//!
//! Tissue in the browser. What a page needs of the library, as a module of WebAssembly: a session holds one scene in
//! motion, or two beside each other, the hands that pull on it, and the picture of it. The page itself is in `page/`, the
//! package for other pages in `package/`.
//!
//! | to | look at |
//! |---|---|
//! | run a scene, hold it, look at it | [`Session`] |
//! | list scenes, presets and settings | [`catalog`] |
//! | choose device, mesh and accuracy for a frame rate | [`choose`](choose::choose) |
//! | see what JavaScript sees | `exports` |
//!
//! A session has no clock, no thread and no document: whoever owns it, a worker of the page mostly, calls it.

pub mod catalog;
pub mod choose;
mod hands;
mod holds;
mod loaded;
mod looking;
mod pictures;
mod report;
mod session;
mod tools;

#[cfg(target_arch = "wasm32")]
mod exports;
#[cfg(target_arch = "wasm32")]
mod screen;

pub use loaded::LoadRequest;
pub use report::{LoadedReport, Report, RunReport};
pub use session::{Grip, MOST_FILE_BYTES, MOST_TETS, Session};
