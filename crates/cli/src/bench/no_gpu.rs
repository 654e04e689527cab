//! In the place of the graphics processor, where a build has no backend for it.

use super::computers::{Computer, Stepper};
use super::measurement::Bench;
use super::results::AdapterFacts;
use anyhow::{Result, bail};

/// There is none.
pub enum Gpu {}

impl Gpu {
    /// Says what to do.
    pub fn open(_name: Option<&str>) -> Result<Self> {
        bail!("--device: the GPU backend was left out of this build; build with `--features gpu`")
    }

    pub fn is_software(&self) -> bool {
        match *self {}
    }

    pub fn facts(&self) -> AdapterFacts {
        match *self {}
    }
}

impl Computer for Gpu {
    fn kind(&self) -> &'static str {
        match *self {}
    }

    fn threads(&self) -> Option<u32> {
        match *self {}
    }

    fn copy_bandwidth(&self) -> Result<f64> {
        match *self {}
    }

    fn stepper<'a>(&self, _: &'a Bench<'_>, _: Option<u32>) -> Result<Box<dyn Stepper + 'a>> {
        match *self {}
    }
}
