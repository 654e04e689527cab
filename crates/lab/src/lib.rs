//! # viscera-lab
//!
//! The truth beside the solver: a Newton reference in double precision, and the studies that hold
//! every claim of the library against it.

pub mod reference;
pub mod report;
pub mod validate;
