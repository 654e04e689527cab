//! What solvers are measured on: procedural bars, or a mesh of one's own.

use anyhow::{Context, Result};
use std::borrow::Cow;
use std::path::Path;
use viscera::contact::{Shape, Tool};
use viscera::mesh::shapes::{self, MAX_TETS};
use viscera::mesh::{TetMesh, io};
use viscera::scalar::{Real, Vec3, vec3};
use viscera::solver::{Inputs, Pin};
use viscera_resources::files;

/// Of a bar, which is four times as long as wide [m].
const LENGTH: f64 = 0.2;
/// Tetrahedra per box of a bar.
const PER_BOX: f64 = 5.0;

/// About how many tetrahedra a bar has: `"30k"`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size(pub usize);

impl std::str::FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let text = text.trim();
        let (number, factor) = match text.strip_suffix(['k', 'K', 'm', 'M']) {
            Some(number) if text.ends_with(['k', 'K']) => (number, 1e3),
            Some(number) => (number, 1e6),
            None => (text, 1.0),
        };
        match number.parse::<f64>() {
            Ok(number) if (1.0..=MAX_TETS as f64).contains(&(number * factor)) => {
                Ok(Self((number * factor).round() as usize))
            }
            _ => Err(format!(
                "write about how many tetrahedra, from 1 to {}M, for example 1000, 30k or 1M",
                MAX_TETS / 1_000_000
            )),
        }
    }
}

/// What a case is computed on.
#[derive(Clone, Copy)]
pub enum Subject<'a> {
    /// A bar of about so many tetrahedra.
    Bar(Size),
    /// A mesh, and its name in the results.
    Mesh(&'a str, &'a TetMesh),
}

impl Subject<'_> {
    pub fn name(&self) -> &str {
        match self {
            Self::Bar(_) => "bar",
            Self::Mesh(name, _) => name,
        }
    }

    /// How many tetrahedra it has, or will have.
    pub fn tet_count(&self) -> usize {
        match self {
            Self::Bar(size) => (boxes(*size).iter().product::<usize>()) * PER_BOX as usize,
            Self::Mesh(_, mesh) => mesh.tets().len(),
        }
    }

    /// The mesh.
    pub fn mesh(&self) -> Result<Cow<'_, TetMesh>> {
        match self {
            Self::Bar(size) => {
                let cells = boxes(*size);
                let edge = LENGTH / cells[0] as f64;
                let size = Vec3::from_f64(cells.map(|n| n as f64 * edge));
                Ok(Cow::Owned(shapes::block(size, cells)?))
            }
            Self::Mesh(_, mesh) => Ok(Cow::Borrowed(mesh)),
        }
    }
}

/// Boxes along each axis, as cubic as can be.
fn boxes(Size(tets): Size) -> [usize; 3] {
    let boxes = tets as f64 / PER_BOX;
    let across = (boxes / 4.0).cbrt().round().max(1.0);
    let along = (boxes / (across * across)).round().max(1.0);
    [along, across, across].map(|n| n as usize)
}

/// Reads a mesh file; its unit of length does not matter to the time.
pub fn read(path: &Path) -> Result<(String, TetMesh)> {
    let name = path.display().to_string();
    let (mesh, _) = io::read_tet_mesh(&name, &files::read(path)?, 1.0)?;
    let stem = path.file_stem().context("a file has a name")?;
    Ok((stem.to_string_lossy().into_owned(), mesh))
}

/// Held at one end, the hundredth of its length with the smallest x; the rest hangs.
pub fn hanging<S: Real>(mesh: &TetMesh) -> Inputs<S> {
    let xs = || mesh.vertices().iter().map(|v| v.x);
    let (low, high) = (xs().fold(f64::INFINITY, f64::min), xs().fold(f64::NEG_INFINITY, f64::max));
    let end = low + 0.01 * (high - low);
    let pins = (0u32..).zip(mesh.vertices()).filter(|(_, x)| x.x <= end);
    let pins = pins.map(|(vertex, x)| Pin { vertex, target: x.cast() }).collect();
    Inputs { gravity: vec3(0.0, 0.0, -9.81).cast(), pins, ..Inputs::default() }
}

/// A plate under the middle of what hangs, within the thickness of contact: wide enough to meet samples of the coarsest mesh.
pub fn supporting(mesh: &TetMesh) -> Tool {
    let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for x in mesh.vertices().iter().map(|x| x.to_array()) {
        for axis in 0..3 {
            bounds[0][axis] = bounds[0][axis].min(x[axis]);
            bounds[1][axis] = bounds[1][axis].max(x[axis]);
        }
    }
    let [low, high] = bounds.map(Vec3::from_f64);
    let (middle, size) = ((low + high) * 0.5, high - low);
    let radius = 0.05 * size.z;
    let half = Vec3 { x: 0.15 * size.x, y: 0.3 * size.y, z: 0.05 * size.z };
    let mut plate = Tool::new(Shape::RoundedBox { half, radius });
    let below = 0.5 * plate.law.thickness + half.z;
    plate.pose.translation = Vec3 { z: low.z - below, ..middle };
    plate
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_have_about_as_many_tetrahedra_as_asked_for() {
        for asked in [5, 100, 1_000, 3_000, 10_000, 100_000, 1_000_000] {
            let made = Subject::Bar(Size(asked)).tet_count() as f64;
            // Rounding the long side is off by half a slice of boxes at most.
            let slice = PER_BOX * boxes(Size(asked))[1].pow(2) as f64;
            assert!((made - asked as f64).abs() <= 0.5 * slice, "{asked} became {made}");
        }
        let bar = Subject::Bar(Size(100));
        assert_eq!(bar.mesh().expect("a bar").tets().len(), bar.tet_count());
    }

    #[test]
    fn sizes_are_read_with_their_factor() {
        for (text, count) in [("1", 1), ("30k", 30_000), ("1.5M", 1_500_000), ("50M", MAX_TETS)] {
            assert_eq!(text.parse(), Ok(Size(count)), "{text}");
        }
        for text in ["", "0", "k", "-1", "100T", "51M", "nan", "inf", "1e99"] {
            assert!(text.parse::<Size>().is_err(), "{text}");
        }
    }
}
