//! # viscera
//!
//! Real-time soft-tissue simulation for surgical applications.

pub mod mesh;
pub mod scalar;
