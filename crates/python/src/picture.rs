//! Pictures, drawn in software.

use crate::fault::{Class, error};
use pyo3::PyResult;
use viscera::scalar::Real;
use viscera::simulation::Simulation;
use viscera_picture::{ImageSize, PictureError, Subject, write_png};

/// A simulation as it is now, as the bytes of a PNG file.
pub fn draw<S: Real>(simulation: &Simulation<S>, size: [u32; 2]) -> PyResult<Vec<u8>> {
    let draw = || -> Result<Vec<u8>, PictureError> {
        let subject = Subject::of(simulation);
        let shots = [subject.shot(simulation, &simulation.report())];
        let look = subject.look(&shots)?;
        let [width, height] = size;
        let seen = look.seen_at(ImageSize::new(width, height)?)?;
        write_png(&look.draw(&shots[0], &seen)?)
    };
    draw().map_err(|problem| error(Class::Simulation, problem))
}
