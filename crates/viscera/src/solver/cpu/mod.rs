//! The CPU backend: passes over blocks of tetrahedra, threads, and the memory of a step.

pub mod memory;
pub mod precision;
pub mod products;
pub mod team;
pub mod tets;
pub mod threads;

pub use memory::Memory;
