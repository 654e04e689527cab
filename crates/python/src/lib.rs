//! The Python package `viscera`, as far as it is Rust: scenes, simulations and what one holds of them. The package around it
//! is in `crates/python/viscera/`.
//!
//! A panic of this code would be a defect; it reaches Python as `viscera.InternalError` ([`fault::guarded`]). Long work is
//! done without Python's lock ([`Simulation`](simulation::Simulation)), and Ctrl-C ends it between frames.

mod arrays;
mod body;
mod engine;
mod fault;
mod frame;
mod functions;
mod hold;
mod made;
mod picture;
mod rest;
mod scene;
mod simulation;
mod snapshot;
mod tool;
mod values;
mod worlds;

use pyo3::pymodule;

/// Soft tissue in real time: the part of `viscera` that is compiled.
#[pymodule]
mod _viscera {
    #[pymodule_export]
    use super::body::Body;
    #[pymodule_export]
    use super::frame::Frame;
    #[pymodule_export]
    use super::functions::{built_in_scenes, describe, digest, version};
    #[pymodule_export]
    use super::hold::Hold;
    #[pymodule_export]
    use super::made::labels;
    #[pymodule_export]
    use super::rest::{Rest, rest};
    #[pymodule_export]
    use super::scene::Scene;
    #[pymodule_export]
    use super::simulation::Simulation;
    #[pymodule_export]
    use super::tool::Tool;
    #[pymodule_export]
    use super::worlds::Worlds;
}
