//! Arrays of NumPy.

use crate::fault::{Class, error};
use numpy::{
    Element, PyArray1, PyArray2, PyArray3, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use viscera::scalar::rigid::RigidTransform;
use viscera::scalar::{Mat3, Real, Vec3};

/// Vectors as a new array, shape (n, 3).
pub fn vectors<'py, T: Element + Real>(
    py: Python<'py>,
    all: &[Vec3<T>],
) -> PyResult<Bound<'py, PyArray2<T>>> {
    let flat: Vec<T> = all.iter().flat_map(|x| x.to_array()).collect();
    PyArray1::from_vec(py, flat).reshape([all.len(), 3])
}

/// Whole numbers as a new array, shape (n, N).
pub fn indices<'py, const N: usize>(
    py: Python<'py>,
    all: &[[u32; N]],
) -> PyResult<Bound<'py, PyArray2<u32>>> {
    PyArray1::from_slice(py, all.as_flattened()).reshape([all.len(), N])
}

/// A few numbers as a new array.
pub fn row<'py>(py: Python<'py>, numbers: &[f64]) -> Bound<'py, PyArray1<f64>> {
    PyArray1::from_slice(py, numbers)
}

/// Numbers of any array-like of this shape.
pub fn numbers(what: &str, value: &Bound<'_, PyAny>, shape: &[usize]) -> PyResult<Vec<f64>> {
    let py = value.py();
    let numpy = py.import("numpy")?;
    let refuse = |found: String| {
        error(Class::Scene, format!("{what} is an array of shape {shape:?}; this one {found}"))
    };
    let array = numpy
        .call_method1("asarray", (value, "float64"))
        .map_err(|problem| refuse(format!("is none: {}", problem.value(py))))?;
    let array = array.cast_into::<PyArrayDyn<f64>>()?;
    if array.shape() != shape {
        return Err(refuse(format!("has shape {:?}", array.shape())));
    }
    let numbers: Vec<f64> = array.readonly().as_array().iter().copied().collect();
    match numbers.iter().all(|number| number.is_finite()) {
        true => Ok(numbers),
        false => Err(refuse("holds NaN or infinity".to_owned())),
    }
}

/// A place or a translation [m].
pub fn vector(what: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec3<f64>> {
    let numbers = numbers(what, value, &[3])?;
    Ok(Vec3::from_f64([numbers[0], numbers[1], numbers[2]]))
}

/// A pose as a matrix of shape (4, 4): rotation and translation [m].
pub fn pose(what: &str, value: &Bound<'_, PyAny>) -> PyResult<RigidTransform> {
    rigid(what, &numbers(what, value, &[4, 4])?)
}

/// A pose from 16 numbers, row by row.
pub fn rigid(what: &str, m: &[f64]) -> PyResult<RigidTransform> {
    if m[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err(error(
            Class::Scene,
            format!("{what}: the last row of a pose is (0, 0, 0, 1); this one is {:?}", &m[12..]),
        ));
    }
    let column = |j: usize| Vec3::from_f64([m[j], m[4 + j], m[8 + j]]);
    let rotation = Mat3 { columns: [column(0), column(1), column(2)] };
    Ok(RigidTransform { rotation, translation: column(3) })
}

/// A pose as a matrix of shape (4, 4).
pub fn pose_array<'py>(
    py: Python<'py>,
    pose: &RigidTransform,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let mut all = [0.0; 16];
    let columns = pose.rotation.columns.iter().chain([&pose.translation]);
    for (j, column) in columns.enumerate() {
        for (i, number) in column.to_array().into_iter().enumerate() {
            all[4 * i + j] = number;
        }
    }
    all[15] = 1.0;
    PyArray1::from_slice(py, &all).reshape([4, 4])
}

/// Positions of a body, refreshed after each frame: at one place in memory as long as anybody looks at it.
pub enum Positions {
    /// Of a simulation in single precision.
    Single(Py<PyArray2<f32>>),
    /// Of one in double precision.
    Double(Py<PyArray2<f64>>),
}

/// A precision that arrays have.
pub trait Precise: Real + Element {
    /// Room for so many vertices.
    fn room(py: Python<'_>, count: usize) -> Positions;
    /// The array, where it is of this precision.
    fn of(positions: &Positions) -> Option<&Py<PyArray2<Self>>>;
}

impl Precise for f32 {
    fn room(py: Python<'_>, count: usize) -> Positions {
        Positions::Single(PyArray2::zeros(py, [count, 3], false).unbind())
    }

    fn of(positions: &Positions) -> Option<&Py<PyArray2<Self>>> {
        match positions {
            Positions::Single(array) => Some(array),
            Positions::Double(_) => None,
        }
    }
}

impl Precise for f64 {
    fn room(py: Python<'_>, count: usize) -> Positions {
        Positions::Double(PyArray2::zeros(py, [count, 3], false).unbind())
    }

    fn of(positions: &Positions) -> Option<&Py<PyArray2<Self>>> {
        match positions {
            Positions::Double(array) => Some(array),
            Positions::Single(_) => None,
        }
    }
}

/// Writes positions into the array that people look at.
pub fn refresh<S: Precise>(py: Python<'_>, array: &Positions, from: &[Vec3<S>]) -> PyResult<()> {
    let Some(array) = S::of(array) else { return Ok(()) };
    let mut array = array.bind(py).try_readwrite()?;
    for (to, from) in array.as_slice_mut()?.chunks_exact_mut(3).zip(from) {
        to.copy_from_slice(&from.to_array());
    }
    Ok(())
}

/// A view of positions that cannot be written to.
pub fn view<'py>(py: Python<'py>, positions: &Positions) -> PyResult<Bound<'py, PyAny>> {
    let base = match positions {
        Positions::Single(array) => array.bind(py).as_any(),
        Positions::Double(array) => array.bind(py).as_any(),
    };
    read_only(base)
}

fn read_only<'py>(base: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let view = base.call_method0("view")?;
    view.call_method1("setflags", (false,))?;
    Ok(view)
}

/// Numbers of an array-like with a row for each world, flattened, and how many a row has: one of these numbers.
pub fn matrix(
    what: &str,
    value: &Bound<'_, PyAny>,
    rows: usize,
    columns: &[usize],
) -> PyResult<(Vec<f64>, usize)> {
    let py = value.py();
    let shapes = columns.iter().map(|columns| match columns {
        1 => format!("({rows},)"),
        16 => format!("({rows}, 4, 4)"),
        columns => format!("({rows}, {columns})"),
    });
    let shapes = shapes.collect::<Vec<_>>().join(" or ");
    let refuse =
        |found: String| error(Class::Scene, format!("{what}: give shape {shapes}; this {found}"));
    let array = py.import("numpy")?.call_method1("asarray", (value, "float64"));
    let array = array.map_err(|problem| refuse(format!("is none: {}", problem.value(py))))?;
    let array = array.cast_into::<PyArrayDyn<f64>>()?;
    let fits = columns.iter().copied().find(|&columns| match (columns, array.shape()) {
        (1, [n]) => *n == rows,
        (16, [n, 4, 4]) => *n == rows,
        (columns, [n, m]) => *n == rows && *m == columns,
        _ => false,
    });
    let columns = fits.ok_or_else(|| refuse(format!("has shape {:?}", array.shape())))?;
    let numbers: Vec<f64> = array.readonly().as_array().iter().copied().collect();
    match numbers.iter().all(|number| number.is_finite()) {
        true => Ok((numbers, columns)),
        false => Err(refuse("holds NaN or infinity".to_owned())),
    }
}

/// Positions of a body in many worlds, shape (n, vertices, 3), refreshed after each step, at one place in memory.
pub struct Frames(Py<PyArray3<f32>>);

impl Frames {
    /// Room for so many worlds and vertices.
    pub fn new(py: Python<'_>, worlds: usize, vertices: usize) -> PyResult<Self> {
        Ok(Self(PyArray3::zeros(py, [worlds, vertices, 3], false).unbind()))
    }

    /// Writes the positions of one world.
    pub fn refresh(&self, py: Python<'_>, world: usize, from: &[Vec3<f32>]) -> PyResult<()> {
        let mut array = self.0.bind(py).try_readwrite()?;
        let all = array.as_slice_mut()?;
        let own = all.chunks_exact_mut(3 * from.len()).nth(world);
        for (to, from) in own.into_iter().flat_map(|own| own.chunks_exact_mut(3)).zip(from) {
            to.copy_from_slice(&from.to_array());
        }
        Ok(())
    }

    /// A view of all that cannot be written to.
    pub fn view<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        read_only(self.0.bind(py).as_any())
    }
}
