//! # viscera
//!
//! Real-time soft-tissue simulation for surgical applications: tetrahedral meshes under extended
//! position-based dynamics (XPBD) whose stiffness is the one that was typed in.
//!
//! | to | look at |
//! |---|---|
//! | read, write, check or make meshes | [`mesh`], [`mesh::io`], [`mesh::shapes`] |
//! | say what tissue is made of | [`material`] |
//! | build something to simulate | [`model::ModelBuilder`], [`state::State`] |
//! | simulate it | [`solver::Solver`], [`settings::SolverSettings`] |
//! | run what a scene file says | [`scene::Scene`], [`simulation::Simulation`] |
//! | run it many times side by side | [`worlds::Worlds`] |
//! | learn strains, stresses, energies, forces | [`measure`], [`solver::balance`] |
//! | look up an equation | [`elements`], [`solver`] |
//!
//! ```
//! use viscera::scene::Scene;
//! use viscera::simulation::{Assembly, Simulation};
//!
//! let text = r#"
//!     [[body]]
//!     name = "bar"
//!     shape = "beam"
//!     length = "60 mm"
//!     width = "20 mm"
//!     height = "20 mm"
//!     cells_across = 2
//!     material = { preset = "liver" }
//!
//!     [[fixing]]
//!     name = "wall"
//!     body = "bar"
//!     half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }
//! "#;
//! let scene = Scene::parse("bar.toml", text, &[])?;
//! let assembly = Assembly::new(&scene, &mut |file| Err(format!("{file}: no files here")))?;
//! let mut simulation = Simulation::<f32>::new(scene, assembly)?;
//! simulation.advance_frame()?;
//! println!("the wall holds the bar with {:?} N", simulation.report().patches[0].force);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Lengths are metres, masses kilograms, times seconds, forces newtons; +z is up. The library
//! reads no files and no clocks, and never panics on its input: errors name the place and the next
//! move.

pub mod coloring;
pub mod contact;
pub mod elements;
pub mod haptics;
pub mod layout;
pub mod material;
pub mod measure;
pub mod mesh;
pub mod model;
pub mod record;
pub mod rest;
pub mod scalar;
pub mod scene;
pub mod settings;
pub mod simulation;
pub mod solver;
mod sorting;
pub mod state;
pub mod units;
pub mod worlds;
