//! A graphics device for whole scenes; a software driver will do.

use viscera::scalar::{Real, Vec3};
use viscera::solver::gpu::{Adapter, Device};

/// The first device there is; without any the test fails and says what to install.
pub fn open() -> Device {
    let adapter = Adapter::find(None).unwrap_or_else(|error| panic!("{error}"));
    adapter.open().unwrap_or_else(|error| panic!("{error}"))
}

/// Largest distance of vectors from the oracle's.
pub fn largest<S: Real>(a: &[Vec3<S>], oracle: &[Vec3<f64>]) -> f64 {
    let pairs = a.iter().zip(oracle);
    pairs.map(|(a, b)| (a.cast::<f64>() - *b).length()).fold(0.0, f64::max)
}
