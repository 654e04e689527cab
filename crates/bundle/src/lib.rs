//! # viscera-bundle
//!
//! Makes a folder of static files out of the page's sources and its wasm module, and serves it.
//!
//! | to | look at |
//! |---|---|
//! | put JavaScript around a wasm module | [`module`] |
//! | name files after their content and rewrite what refers to them | [`site`] |
//! | make the package for other people's pages | [`package`] |
//! | write a folder at once, or not at all | [`files`] |
//! | see what travels | [`sizes`] |
//! | show the folder to a browser | [`server`] |

pub mod files;
mod http;
pub mod module;
pub mod package;
mod references;
pub mod server;
pub mod site;
pub mod sizes;
