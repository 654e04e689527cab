//! All integration tests of the program: one program that is linked once.

mod common;
#[path = "../../../viscera/tests/all/common/data.rs"]
mod data;
#[path = "../../../viscera/tests/all/common/tied.rs"]
mod tied;

mod advice;
mod anatomy;
mod bad_input;
mod bench;
mod bench_plot;
mod bench_scene;
#[cfg(feature = "gpu")]
mod devices;
mod documents;
mod frames;
mod haptics;
mod hold;
mod imports;
mod repair;
mod replay;
mod run;
mod saved;
mod ties;
mod words;
