//! Pictures, drawn in software.

use crate::fault::{Class, error};
use numpy::{PyArray1, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use viscera::scalar::Real;
use viscera::simulation::Simulation;
use viscera_picture::{Image, ImageSize, Medium, PictureError, Subject, write_png};

/// A simulation as it is now, as the bytes of a PNG file.
pub fn draw<S: Real>(simulation: &Simulation<S>, size: [u32; 2]) -> PyResult<Vec<u8>> {
    let bytes = image(simulation, size).and_then(|image| write_png(&image));
    bytes.map_err(|problem| error(Class::Simulation, problem))
}

/// The same as an array, shape (height, width, 3).
pub fn draw_array<'py, S: Real>(
    py: Python<'py>,
    simulation: &Simulation<S>,
    size: [u32; 2],
) -> PyResult<Bound<'py, PyArray3<u8>>> {
    let image = image(simulation, size).map_err(|problem| error(Class::Simulation, problem))?;
    let [width, height] = size.map(|side| side as usize);
    PyArray1::from_slice(py, image.pixels().as_flattened()).reshape([height, width, 3])
}

fn image<S: Real>(simulation: &Simulation<S>, size: [u32; 2]) -> Result<Image, PictureError> {
    let subject = Subject::of(simulation);
    let shots = [subject.shot(simulation, &simulation.report())];
    let look = subject.look(&shots, Medium::Picture)?;
    let [width, height] = size;
    let seen = look.seen_at(ImageSize::new(width, height)?)?;
    look.draw(&shots[0], &seen)
}
