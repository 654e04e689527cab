//! Bars of the peers' benchmark in no order, and how far the body itself sinks that they stand for.

use std::path::{Path, PathBuf};

use anyhow::Result;
use viscera::material::MaterialModel;
use viscera::mesh::TetMesh;
use viscera_resources::files::write_atomic;

use crate::bending::bodies::{Body, Filling, Shape};
use crate::bending::truth::extrapolated;
use crate::bending::{Element, Load, YOUNG, response_of};
use crate::load_cases::tissue;

/// Poisson's ratio of the bars: of tissue that keeps most of its volume.
pub const POISSON: f64 = 0.45;

/// The whole weight.
const WEIGHT: Load = Load::Sag(1.0);

/// The finest, by cells across: 200 000 tetrahedra.
const MOST_CELLS: usize = 20;

/// Across the meshes of quadratic tetrahedra. The last two tell the sag, the first two how well it is known.
const TRUTH_CELLS: [usize; 3] = [4, 6, 8];

/// The benchmark's name of a law, and what computes it.
const LAWS: [(&str, MaterialModel); 2] =
    [("snh", MaterialModel::StableNeoHookean), ("stvk", MaterialModel::SaintVenantKirchhoff)];

/// How far a bar's free end sinks [m].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sag {
    /// Of the body itself.
    pub value: f64,
    /// How far it lies from what coarser meshes tell.
    pub error: f64,
}

/// Of a law, with quadratic tetrahedra of so many boxes across, from coarse to fine.
pub fn sag(law: MaterialModel, cells: [usize; 3]) -> Result<Sag> {
    let tissue = tissue(law, YOUNG, POISSON)?;
    let mut responses = [0.0; 3];
    for (response, cells) in responses.iter_mut().zip(cells) {
        let body = Body::new(Shape::Bar, Filling::Five, cells)?;
        *response = response_of(&body, Element::Quadratic, WEIGHT, &tissue)?;
    }
    let [coarse, middle, fine] = responses;
    let value = extrapolated(&cells[1..], &[middle, fine]).value;
    let before = extrapolated(&cells[..2], &[coarse, middle]).value;
    Ok(Sag { value, error: (value - before).abs() })
}

/// A mesh as the benchmark's runner reads it: counts, then `x y z held` [m], then corners.
pub fn text(mesh: &TetMesh, is_held: impl Fn(usize) -> bool) -> String {
    let mut text = format!("{} {}\n", mesh.vertices().len(), mesh.tets().len());
    for (vertex, place) in mesh.vertices().iter().enumerate() {
        let [x, y, z] = place.to_array();
        text += &format!("{x:e} {y:e} {z:e} {}\n", u8::from(is_held(vertex)));
    }
    mesh.tets().iter().for_each(|[a, b, c, d]| text += &format!("{a} {b} {c} {d}\n"));
    text
}

/// Writes u2.txt and so on, and continuum.json: of each law `[sag, its error]` [m].
pub fn write_bars(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for across in 2..=MOST_CELLS {
        let mesh = Body::new(Shape::Bar, Filling::Relaxed(1), across)?.mesh;
        let file = folder.join(format!("u{across}.txt"));
        // The benchmark pins what lies in the plane x = 0 by itself.
        write_atomic(&file, text(&mesh, |_| false).as_bytes())?;
        files.push(file);
    }
    let mut entries = Vec::new();
    for (name, law) in LAWS {
        let Sag { value, error } = sag(law, TRUTH_CELLS)?;
        entries.push(format!("\"{name}\": [{value:e}, {error:e}]"));
    }
    let file = folder.join("continuum.json");
    write_atomic(&file, format!("{{{}}}\n", entries.join(", ")).as_bytes())?;
    files.push(file);
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of either law. A beam of Euler and Bernoulli sinks by `12 rho g L^4/(8 E h^2)`, 30.1 mm, and less where it turns
    /// far: its lever is shorter then.
    #[test]
    fn the_sag_is_known_to_its_error() {
        for (name, law) in LAWS {
            let coarse = sag(law, [1, 2, 3]).expect("a state of rest");
            println!("{name}: {coarse:?}");
            assert!((0.025..0.0301).contains(&coarse.value), "{name}: {coarse:?}");
            assert!(coarse.error < 0.02 * coarse.value, "{name}: {coarse:?}");
        }
    }

    #[test]
    fn texts_have_counts_vertices_and_corners() {
        let mesh = Body::new(Shape::Bar, Filling::Relaxed(1), 2).expect("a mesh").mesh;
        let text = text(&mesh, |vertex| vertex == 3);
        let lines: Vec<&str> = text.lines().collect();
        let (vertices, tets) = (mesh.vertices().len(), mesh.tets().len());
        assert_eq!(lines[0], format!("{vertices} {tets}"));
        assert_eq!(lines.len(), 1 + vertices + tets);
        let held = lines[1..=vertices].iter().position(|line| line.ends_with(" 1"));
        assert_eq!(held, Some(3));
    }
}
