//! Values that colours show, at the vertices of the surfaces.

use viscera::contact::{Touch, VertexPressures};
use viscera::measure::TetMeasure;
use viscera::scalar::{Real, Vec3};
use viscera::simulation::Assembly;

use crate::snapshot::Coloring;

/// Values of the surfaces' vertices, one body after the other; none for plain tissue. `positions` [m] of
/// the tetrahedra's vertices, the user's order; `tets` of the same state, where the colours need them. Strain and stress of an inverted
/// tetrahedron mean nothing, and its stress is as large as one likes where it is nearly flat: its vertices have no
/// value there (NaN). `touches` of the same state, where colours show the pressure of tools.
pub fn surface_values<S: Real>(
    assembly: &Assembly,
    coloring: Coloring,
    positions: &[Vec3<S>],
    tets: &[TetMeasure],
    touches: &[Touch],
    values: &mut Vec<f32>,
) {
    values.clear();
    match coloring {
        Coloring::Plain | Coloring::Bodies => {}
        Coloring::Displacement => displacements(assembly, positions, values),
        Coloring::Strain => averages(assembly, tets, |tet| tet.stretches[0] - 1.0, values),
        Coloring::Stress => averages(assembly, tets, |tet| tet.von_mises, values),
        Coloring::Pressure => pressures(assembly, touches, values),
    }
}

/// Of contact, at vertices of the tetrahedra, and between them as they are.
fn pressures(assembly: &Assembly, touches: &[Touch], values: &mut Vec<f32>) {
    let count = assembly.builder.positions().len();
    let found = VertexPressures::of(assembly.builder.samples(), touches, count);
    for body in &assembly.bodies {
        let of_body = &found.pressures[body.vertices.clone()];
        for (corners, weights) in body.embedding.corners().iter().zip(body.embedding.weights()) {
            let bound = corners.iter().zip(weights);
            let value: f64 = bound.map(|(&v, weight)| weight * of_body[v as usize]).sum();
            values.push(value as f32);
        }
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
                sum[0] += if tet.is_inverted() { f64::NAN } else { tet.rest_volume * of(tet) };
                sum[1] += tet.rest_volume;
            }
        }
    }
    for body in &assembly.bodies {
        let first = body.vertices.start;
        for (corners, weights) in body.embedding.corners().iter().zip(body.embedding.weights()) {
            let mut value = 0.0;
            // A corner that is not counted may have no value.
            let counted = corners.iter().zip(weights).filter(|(_, weight)| **weight != 0.0);
            for (&corner, &weight) in counted {
                let [sum, volume] = sums[first + corner as usize];
                value += weight * sum / volume.max(f64::MIN_POSITIVE);
            }
            values.push(value as f32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera::scene::Scene;

    #[test]
    fn an_inverted_tetrahedron_has_no_stress_and_leaves_that_of_others_alone() {
        let text = r#"
            [[body]]
            name = "bar"
            shape = "beam"
            length = "0.2 m"
            width = "50 mm"
            height = "50 mm"
            material = { preset = "liver" }
        "#;
        let scene = Scene::parse("bar.toml", text, &[]).expect("a legal scene");
        let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned())).expect("a bar");
        let body = &assembly.bodies[0];
        let tet = TetMeasure {
            rest_volume: 1e-6,
            volume_ratio: 1.0,
            von_mises: 2e3,
            ..TetMeasure::default()
        };
        let mut tets = vec![tet; body.tets.len()];
        let positions = assembly.builder.positions().to_vec();
        let mut values = Vec::new();
        let mut color = |tets: &[TetMeasure]| {
            surface_values(&assembly, Coloring::Stress, &positions, tets, &[], &mut values);
            values.clone()
        };
        assert!(color(&tets).iter().all(|value| (value - 2e3).abs() < 1e-3));
        // Nearly flat: divided by so small a volume its stress is anything.
        tets[0] = TetMeasure { volume_ratio: -1e-9, von_mises: 1e15, ..tet };
        let with_one = color(&tets);
        let gaps = with_one.iter().filter(|value| value.is_nan()).count();
        assert!((1..=4).contains(&gaps), "{gaps} vertices of a tetrahedron");
        let others = with_one.iter().filter(|value| !value.is_nan());
        assert!(others.clone().count() > 20);
        assert!(others.into_iter().all(|value| (value - 2e3).abs() < 1e-3));
    }
}
