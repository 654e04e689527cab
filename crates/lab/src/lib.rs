//! # viscera-lab
//!
//! The truth beside the solver: a Newton reference in double precision, and the studies that hold
//! every claim of the library against it.
//!
//! | to | look at |
//! |---|---|
//! | solve a step or a state of rest exactly | [`viscera_reference::Reference`] |
//! | set up what the studies share | [`load_cases`], [`contact_cases`], [`forms`], [`bending`], [`bars`], [`contact_bench`], [`unstructured`], [`delaunay`], [`settling`], [`motion`], [`stress`] |
//! | measure what contact costs | [`contact_costs`] |
//! | compare the library with what must come out | [`validate`] |
//! | see what the published method does, and what became of its open problems | [`study`] |
//! | ask the reference about a scene file | [`rest_command`] |
//! | write reports with tables and plots | [`viscera_report`] |

pub mod bars;
pub mod bending;
pub mod contact_bench;
pub mod contact_cases;
pub mod contact_costs;
pub mod converge;
pub mod delaunay;
pub mod forms;
pub mod load_cases;
pub mod motion;
pub mod rest_command;
pub mod sections;
pub mod settling;
pub mod stress;
pub mod study;
pub mod unstructured;
pub mod validate;
