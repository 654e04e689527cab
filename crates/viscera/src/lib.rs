//! # viscera
//!
//! Real-time soft-tissue simulation for surgical applications.

pub mod material;
pub mod mesh;
pub mod scalar;
pub mod scene;
pub mod settings;
pub mod units;
