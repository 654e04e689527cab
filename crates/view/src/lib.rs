//! # viscera-view
//!
//! The window: pull on tissue and see it answer. A library as well, so that tests drive the window that
//! people use.
//!
//! | to | look at |
//! |---|---|
//! | the window's state, and what happens to it | [`App`] |
//! | the simulation on its own thread | [`engine`] |
//! | looking, pressing, pulling | [`viewport`] |
//! | instruments in hands: keys, controller | [`hands`], [`steering`], [`controller`] |
//! | forces over time | [`curves`] |
//! | what is chosen, undo | [`choices`], [`session`] |
//! | the panels | [`panels`] |
//! | one step by several solvers | [`probe`] |

pub mod app;
pub mod capture;
pub mod choices;
pub mod controller;
pub mod curves;
pub mod document;
pub mod engine;
pub mod hands;
pub mod help;
pub mod holds;
pub mod messages;
pub mod panels;
pub mod preferences;
pub mod probe;
pub mod save;
pub mod session;
pub mod steering;
pub mod viewport;
pub mod window;

pub use app::{App, FIRST_SCENE, Options};
