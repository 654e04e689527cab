//! All integration tests of `viscera-lab` and its library: one program that is linked once.

mod at_rest;
mod common;
#[path = "../../../viscera/tests/all/common/data.rs"]
mod data;

mod contact;
mod contact_at_rest;
mod holds;
mod mesh_error;
mod oracle;
mod organs;
mod quasi_newton;
mod recovered;
mod recovered_meshes;
mod reference;
mod reference_oracle;
mod rest_command;
mod study;
mod study_problems;
mod validate;
