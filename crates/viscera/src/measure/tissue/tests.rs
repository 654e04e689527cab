//! Sums against what they are sums of, lanes against one number at a time.

use super::*;
use crate::material::Material;
use crate::measure::summarize_deformation;
use crate::mesh::shapes::beam;
use crate::model::ModelBuilder;

/// A bar of each law, of a number of tetrahedra that fills no last group.
fn two_bars<S: Real>() -> Model<S> {
    let mesh = beam(0.2, 0.03, 0.03, 3, 0.0).expect("a bar");
    let mut builder = ModelBuilder::new();
    for law in ALL_LAWS {
        let tissue = Material::new(law, 8e3, 0.45, 1000.0).expect("a tissue");
        builder.add_body(&mesh, &tissue).expect("a body");
    }
    builder.build().expect("a model")
}

/// Twisted, stretched more and more from one end to the other, shaken by so much [m].
fn deformed<S: Real>(model: &Model<S>, twist: f64, shake: f64) -> Vec<Vec3<S>> {
    let places = model.places.iter().enumerate();
    let moved = places.map(|(v, &x)| {
        let (sin, cos) = libm::sincos(twist * x.x);
        let noise = |k: usize| libm::sin((7 * v + k) as f64 * 78.233) * shake;
        let (y, z) = (cos * x.y - sin * x.z, sin * x.y + cos * x.z);
        vec3(x.x * (1.0 + x.x) + noise(0), y + noise(1), z + noise(2)).cast()
    });
    moved.collect()
}

fn sums_are_those_of_all_tets<S: Real>() {
    let model = two_bars::<S>();
    assert!(model.tet_count() / LANES > 2 * FIRST_LOOK, "{}", model.tet_count());
    for (twist, shake) in [(0.0, 0.0), (5.0, 0.0), (20.0, 1e-4), (3.0, 2e-3), (0.0, 2e-2)] {
        let positions = match twist + shake > 0.0 {
            true => deformed(&model, twist, shake),
            false => model.rest_positions.clone(),
        };
        let mut tets = Vec::new();
        measure_tets(&model, &positions, &mut tets);
        let elastic_energy =
            tets.iter().fold(0.0, |sum, tet| sum + tet.rest_volume * tet.energy_density);
        let deformation = summarize_deformation(&tets);
        let expected = TissueMeasure { elastic_energy, deformation, is_moderate: true };
        for instructions in [Instructions::Portable, Instructions::detect()] {
            let found = measure_tissue_with(instructions, &model, &positions);
            assert_eq!(found, expected, "{} {twist} {shake}", S::NAME);
        }
        assert_eq!(deformation.inverted > 0, shake > 1e-2, "{deformation:?}");
    }
}

#[test]
fn sums_and_extremes_are_those_of_all_tets_to_the_bit() {
    sums_are_those_of_all_tets::<f32>();
    sums_are_those_of_all_tets::<f64>();
}

/// Pieces join where they meet, and the last one is as long as what is left.
#[test]
fn pieces_are_all_tets_in_their_order() {
    let model = two_bars::<f32>();
    let count = model.tet_count();
    assert!(count > LANES * PIECE && !count.is_multiple_of(LANES * PIECE), "{count}");
    let positions = deformed(&model, 20.0, 2e-3);
    let (mut whole, mut pieces) = (Vec::new(), Vec::new());
    measure_tets(&model, &positions, &mut whole);
    measure_tets_by_pieces(&model, &positions, |tets| pieces.extend_from_slice(tets));
    assert_eq!(pieces, whole);
}

/// The oracle has the shape and the singular values of every tetrahedron one by one.
#[test]
fn measures_in_lanes_are_those_of_one_tet_at_a_time() {
    let model = two_bars::<f32>();
    let positions = deformed(&model, 20.0, 2e-3);
    let mut measures = vec![TetMeasure::default(); model.tet_count()];
    let tets = Tets { model: &model, positions: &positions };
    run(Instructions::Portable, Each { tets, first: 0, measures: &mut measures });
    let mut in_lanes = Vec::new();
    measure_tets(&model, &positions, &mut in_lanes);
    assert_eq!(measures, in_lanes);
    for (tet, measure) in model.tets().zip(&measures) {
        let x = tet.vertices.map(|v| positions[v as usize].cast::<f64>());
        let f = deformation_gradient(&x, &tet.inverse_rest_shape.cast());
        assert_eq!(measure.rest_volume, tet.rest_volume.to_f64());
        assert_eq!(measure.volume_ratio, f.determinant());
        assert_eq!(measure.stretches, signed_svd(&f).sigma);
    }
}

/// Nothing is said of single precision where a stretch is a thousandfold, or is no number.
#[test]
fn what_runs_away_is_not_moderate() {
    let model = two_bars::<f64>();
    for far in [1e3, 1e300, f64::NAN] {
        let mut positions = model.rest_positions.clone();
        positions[model.vertex_count() - 1].x += far;
        assert!(!measure_tissue(&model, &positions).is_moderate, "{far}");
    }
}

#[test]
fn von_mises_of_uniaxial_stress_is_that_stress() {
    let cauchy =
        Mat3::from_columns(vec3(250.0, 0.0, 0.0), vec3(0.0, 0.0, 0.0), vec3(0.0, 0.0, 0.0));
    assert!((von_mises(&cauchy) - 250.0).abs() < 1e-12);
    assert!(von_mises(&(Mat3::IDENTITY * 40.0)) < 1e-12);
}
