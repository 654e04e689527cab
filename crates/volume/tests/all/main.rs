//! All integration tests of `viscera-volume`: one program that is linked once.

#[path = "../../../viscera/tests/all/common/data.rs"]
mod data;
mod files;
mod memory;

mod anatomy;
mod damage;
mod errors;
mod names;
mod nifti;
mod nrrd;
mod organs;
mod orientation;
mod segments;
mod summary;
mod tissue;
