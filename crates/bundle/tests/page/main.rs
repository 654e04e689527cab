//! The page in a real browser, without a display and, where a test says so, without WebGPU.

mod browser;
mod driver;
mod hands;
mod kernels;
mod native;
mod offline;
mod page;
mod setup;
mod trouble;
