//! # viscera-web-files
//!
//! The page's second module: it is fetched where a person opens a file of their own. Any mesh, surface or segmented scan becomes
//! a scene; mesh files in every format become those that the first module reads; and what is to rest under gravity as it is gets
//! its shape without.
//!
//! | to | look at |
//! |---|---|
//! | make a scene of files that were opened together | [`prepare()`], [`Request`], [`Prepared`] |

#[cfg(target_arch = "wasm32")]
mod exports;
mod prepare;

pub use prepare::{Files, Prepared, Request, prepare};
