//! Values that colours show, at the vertices of the surfaces.

use viscera::measure::TetMeasure;
use viscera::scalar::{Real, Vec3};
use viscera::simulation::Assembly;

use super::frame::Coloring;

/// Values of the surfaces' vertices, one body after the other; none for plain tissue. `positions` [m] of
/// the tetrahedra's vertices, the user's order; `tets` of the same state.
pub fn surface_values<S: Real>(
    assembly: &Assembly,
    coloring: Coloring,
    positions: &[Vec3<S>],
    tets: &[TetMeasure],
    values: &mut Vec<f32>,
) {
    values.clear();
    match coloring {
        Coloring::Plain => {}
        Coloring::Displacement => displacements(assembly, positions, values),
        Coloring::Strain => averages(assembly, tets, |tet| tet.stretches[0] - 1.0, values),
        Coloring::Stress => averages(assembly, tets, |tet| tet.von_mises, values),
    }
}

fn displacements<S: Real>(assembly: &Assembly, positions: &[Vec3<S>], values: &mut Vec<f32>) {
    let rest = assembly.builder.positions();
    for body in &assembly.bodies {
        let first = body.vertices.start;
        for (corners, weights) in body.embedding.corners().iter().zip(body.embedding.weights()) {
            let mut moved = Vec3::<f64>::ZERO;
            for (&corner, &weight) in corners.iter().zip(weights) {
                let v = first + corner as usize;
                moved += (positions[v].cast::<f64>() - rest[v]) * weight;
            }
            values.push(moved.length() as f32);
        }
    }
}

/// What is constant in each tetrahedron, averaged over those around a vertex by their volumes.
fn averages(
    assembly: &Assembly,
    tets: &[TetMeasure],
    of: impl Fn(&TetMeasure) -> f64,
    values: &mut Vec<f32>,
) {
    let mut sums = vec![[0.0f64; 2]; assembly.builder.positions().len()];
    for body in &assembly.bodies {
        let first = body.vertices.start;
        for (corners, tet) in body.mesh.tets().iter().zip(&tets[body.tets.clone()]) {
            for &corner in corners {
                let sum = &mut sums[first + corner as usize];
                sum[0] += tet.rest_volume * of(tet);
                sum[1] += tet.rest_volume;
            }
        }
    }
    for body in &assembly.bodies {
        let first = body.vertices.start;
        for (corners, weights) in body.embedding.corners().iter().zip(body.embedding.weights()) {
            let mut value = 0.0;
            for (&corner, &weight) in corners.iter().zip(weights) {
                let [sum, volume] = sums[first + corner as usize];
                value += weight * sum / volume.max(f64::MIN_POSITIVE);
            }
            values.push(value as f32);
        }
    }
}
