//! # viscera
//!
//! Real-time soft-tissue simulation for surgical applications.

pub mod coloring;
pub mod elements;
pub mod material;
pub mod measure;
pub mod mesh;
pub mod model;
pub mod scalar;
pub mod scene;
pub mod settings;
pub mod simulation;
pub mod solver;
pub mod state;
pub mod units;
