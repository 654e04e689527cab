//! Every energy and constraint against central differences of the same source in double precision, and
//! what becomes of them at the edge: single precision, collapsed shapes.

use crate::common::Random;
use crate::common::tets::{Case, LAMBDA, MU, STEP, cases};
use viscera::elements::{
    attachment, deformation_gradient, green_strain, internal_forces, neo_hookean, neo_hookean_pair,
    neo_hookean_stretch, shape_gradients, singular_values, spring,
};
use viscera::material::Compliance;
use viscera::scalar::{Mat3, Scalar, Vec3, vec3};

const TOLERANCE: f64 = 1e-7;

/// Normwise relative difference between an analytic gradient and central differences of `value`.
fn gradient_error<const N: usize>(
    x: &[Vec3<f64>; N],
    step: f64,
    value: impl Fn(&[Vec3<f64>; N]) -> f64,
    gradient: &[Vec3<f64>; N],
) -> f64 {
    let (mut difference, mut norm) = (0.0, 0.0);
    for corner in 0..N {
        for axis in 0..3 {
            // Fourth order: (8 (v(h) - v(-h)) - (v(2h) - v(-2h)))/(12 h).
            let at = |multiple: f64| {
                let mut moved = *x;
                moved[corner][axis] += multiple * step;
                value(&moved)
            };
            let numeric = (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * step);
            let analytic = gradient[corner][axis];
            difference += (numeric - analytic).powi(2);
            norm += analytic.powi(2);
        }
    }
    (difference / norm).sqrt()
}

#[test]
fn forces_are_minus_the_gradient_of_each_energy() {
    let mut worst: [(f64, &str); 2] = [(0.0, ""); 2];
    for case in cases() {
        let f_of = |x: &[Vec3<f64>; 4]| deformation_gradient(x, &case.inverse_rest_shape);
        let f = f_of(&case.corners);
        let strain = green_strain::strain(&f);
        let green = green_strain::piola(&f, &strain, LAMBDA, MU);
        let neo = neo_hookean::piola(&f, LAMBDA, MU);
        let errors = [
            gradient_error(
                &case.corners,
                STEP * case.height,
                |x| {
                    let strain = green_strain::strain(&f_of(x));
                    case.volume * green_strain::energy_density(&strain, LAMBDA, MU)
                },
                &internal_forces(&green, &case.inverse_rest_shape, case.volume).map(|v| -v),
            ),
            gradient_error(
                &case.corners,
                STEP * case.height,
                |x| case.volume * neo_hookean::energy_density(&f_of(x), LAMBDA, MU),
                &internal_forces(&neo, &case.inverse_rest_shape, case.volume).map(|v| -v),
            ),
        ];
        for (worst, error) in worst.iter_mut().zip(errors) {
            if error > worst.0 {
                *worst = (error, case.name);
            }
        }
    }
    println!("energy gradients, worst: Green strain {:?}, neo-Hookean {:?}", worst[0], worst[1]);
    assert!(worst[0].0 < TOLERANCE && worst[1].0 < TOLERANCE, "{worst:?}");
}

#[test]
fn constraint_gradients_match_differences() {
    let mut worst = 0.0f64;
    for case in cases() {
        let f_of = |x: &[Vec3<f64>; 4]| deformation_gradient(x, &case.inverse_rest_shape);
        let f = f_of(&case.corners);
        let g = shape_gradients(&case.inverse_rest_shape);
        let green = g.map(|g| green_strain::gradient(&f, g));
        for p in 0..6 {
            let value = |x: &[Vec3<f64>; 4]| green_strain::strain(&f_of(x))[p];
            let gradient = green.map(|rows| rows[p]);
            let error = gradient_error(&case.corners, STEP * case.height, value, &gradient);
            worst = worst.max(error);
            assert!(error < TOLERANCE, "{} Green strain {p}: {error:e}", case.name);
        }
        let neo = g.map(|g| neo_hookean_pair::gradient(&f, g));
        for p in 0..2 {
            let value = |x: &[Vec3<f64>; 4]| neo_hookean_pair::constraints(&f_of(x), LAMBDA, MU)[p];
            let gradient = neo.map(|rows| rows[p]);
            let error = gradient_error(&case.corners, STEP * case.height, value, &gradient);
            worst = worst.max(error);
            assert!(error < TOLERANCE, "{} neo-Hookean {p}: {error:e}", case.name);
        }
    }
    println!("constraint gradients, worst: {worst:e}");
}

#[test]
fn spring_and_attachment_forces_match_differences() {
    let mut random = Random(3);
    for _ in 0..50 {
        let ends: [Vec3<f64>; 2] = std::array::from_fn(|_| random.vector(0.01));
        let forces = spring::forces(&ends, 0.004, 120.0).map(|f| -f);
        let length = (ends[1] - ends[0]).length();
        let energy = |x: &[Vec3<f64>; 2]| spring::energy(x, 0.004, 120.0);
        let error = gradient_error(&ends, STEP * length, energy, &forces);
        assert!(error < TOLERANCE, "spring: {error:e}");

        let energy = |x: &[Vec3<f64>; 1]| attachment::energy(x[0], ends[1], 80.0);
        let force = [-attachment::force(ends[0], ends[1], 80.0)];
        let error = gradient_error(&[ends[0]], STEP * length, energy, &force);
        assert!(error < TOLERANCE, "attachment: {error:e}");
    }
}

/// At small strain both materials are linear elasticity with the typed E and nu.
#[test]
fn both_materials_have_the_typed_stiffness_at_small_strain() {
    let (young, poisson): (f64, f64) = (5e3, 0.45);
    let lambda = young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson));
    let mu = young / (2.0 * (1.0 + poisson));
    let size = 1e-6;
    // Uniaxial stress: sides contract by nu.
    let lateral = 1.0 - poisson * size;
    let f = Mat3::from_columns(
        vec3(1.0 + size, 0.0, 0.0),
        vec3(0.0, lateral, 0.0),
        vec3(0.0, 0.0, lateral),
    );
    for piola in [
        green_strain::piola(&f, &green_strain::strain(&f), lambda, mu),
        neo_hookean::piola(&f, lambda, mu),
    ] {
        let expected = young * size;
        // The next term of both energies is of relative size `size` times lambda/E, about 3.
        assert!((piola.columns[0].x / expected - 1.0).abs() < 20.0 * size, "{piola:?}");
        assert!(piola.columns[1].y.abs() < 20.0 * size * expected, "{piola:?}");
    }
}

/// `F = U diag(s) V^T` with rotations, sorted, the last value carrying the sign of the determinant;
/// for random, flat, inverted, diagonal, equal and collapsed stretches.
#[test]
fn singular_values_rebuild_the_matrix() {
    fn check<S: viscera::scalar::Real>(f: &Mat3<f64>, name: &str) {
        let f = f.cast::<S>();
        let svd = singular_values::signed_svd(&f);
        let sigma = svd.sigma.map(|s| s.to_f64());
        let [u, v, f] = [svd.u.cast::<f64>(), svd.v.cast::<f64>(), f.cast::<f64>()];
        let diagonal = Mat3::from_columns(
            vec3(sigma[0], 0.0, 0.0),
            vec3(0.0, sigma[1], 0.0),
            vec3(0.0, 0.0, sigma[2]),
        );
        let size = f.norm_squared().sqrt().max(1e-30);
        // Round-off of a dozen rotations; V is off by what `F^T F` cannot resolve, which only turns
        // axes of nearly equal stretch.
        let limit = 64.0 * S::EPSILON;
        let rebuilt = (u * diagonal * v.transpose() - f).norm_squared().sqrt() / size;
        let collapsed = sigma[1].abs() < 1e-5 * sigma[0];
        assert!(collapsed || rebuilt < limit, "{name}: {} rebuilt to {rebuilt:e}", S::NAME);
        for rotation in [u, v] {
            let gap = rotation.transpose() * rotation - Mat3::IDENTITY;
            assert!(gap.norm_squared().sqrt() < limit, "{name}: {rotation:?}");
            assert!((rotation.determinant() - 1.0).abs() < limit, "{name}");
        }
        let slack = limit * size;
        assert!(sigma[0] + slack >= sigma[1] && sigma[1] + slack >= sigma[2].abs(), "{sigma:?}");
        let sign = f.determinant() * sigma[2];
        assert!(sign >= -slack * size.powi(3), "{name}: {sigma:?}");
    }
    let mut random = Random(17);
    let mut matrices: Vec<(Mat3<f64>, &str)> = cases()
        .iter()
        .map(|case| (deformation_gradient(&case.corners, &case.inverse_rest_shape), case.name))
        .collect();
    let diagonal = |a: f64, b: f64, c: f64| {
        Mat3::from_columns(vec3(a, 0.0, 0.0), vec3(0.0, b, 0.0), vec3(0.0, 0.0, c))
    };
    for (a, b, c) in
        [(1.0, 1.0, 1.0), (1.0, 2.0, 3.0), (2.0, 2.0, -1.0), (-1.0, -1.0, -1.0), (1.0, 0.0, 0.0)]
    {
        matrices.push((diagonal(a, b, c), "diagonal"));
        let turned = random.rotation() * diagonal(a, b, c) * random.rotation();
        matrices.push((turned, "turned diagonal"));
    }
    matrices.push((Mat3::ZERO, "zero"));
    for (f, name) in &matrices {
        check::<f64>(f, name);
        check::<f32>(f, name);
    }
}

/// In single precision the kernels work in the same source: their error is round-off.
#[test]
fn single_precision_follows_double() {
    for case in cases().iter().filter(|c| c.name == "random" || c.name == "rotated") {
        let strain = strains::<f64>(case);
        let rough = strains::<f32>(case);
        // Positions relative to the shortest height lose that factor of precision.
        let spread = case.corners.iter().fold(0.0f64, |a, x| a.max(x.length())) / case.height;
        for p in 0..6 {
            let difference = (strain[p] - f64::from(rough[p])).abs();
            assert!(
                difference < 32.0 * f64::from(f32::EPSILON) * spread.max(1.0),
                "{difference:e}"
            );
        }
    }
}

fn strains<S: viscera::scalar::Real>(case: &Case) -> [S; 6] {
    let x = case.corners.map(|x| x.cast::<S>());
    green_strain::strain(&deformation_gradient(&x, &case.inverse_rest_shape.cast::<S>()))
}

/// A collapsed tetrahedron, a point, a line: finite results everywhere.
#[test]
fn degenerate_shapes_give_finite_corrections() {
    let shape = Mat3::<f32>::IDENTITY;
    let material = crate::common::material(crate::common::STVK, 5e3, 0.45);
    let Compliance { normal, cross, shear } = material.compliance().scaled(6.0);
    let [normal, cross, shear] = [normal, cross, shear].map(f32::from_f64);
    let compliance = Compliance { normal, cross, shear };
    let zero = Vec3::ZERO;
    let shapes: [[Vec3<f32>; 4]; 3] = [
        [zero; 4],
        [zero, vec3(1.0, 0.0, 0.0), vec3(2.0, 0.0, 0.0), vec3(3.0, 0.0, 0.0)],
        [zero, vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), vec3(1.0, 1.0, 0.0)],
    ];
    for x in shapes {
        let w = [1.0; 4];
        let green = green_strain::solve(&x, &w, &shape, &[0.0; 6], None, &compliance);
        let neo = neo_hookean_pair::solve(&x, &w, &shape, &[0.0; 2], 1e4, 1e3, 1.0 / 6.0);
        let stretch = neo_hookean_stretch::solve(&x, &w, &shape, &[0.0; 6], 1e4, 1e3, 1.0 / 6.0);
        for moved in green.positions.iter().chain(&neo.positions).chain(&stretch.positions) {
            assert!(moved.is_finite(), "{x:?} {moved:?}");
        }
        let pair = neo_hookean_pair::corner_loads(&x, &shape, &[1.0, -1.0]);
        let six = neo_hookean_stretch::corner_loads(&x, &shape, &[1.0; 6]);
        for load in pair.into_iter().chain(six) {
            assert!(load.impulse.is_finite() && load.mass_bound.is_finite());
        }
    }
    // So small that squares of its entries are lost.
    for size in [1e-8f32, 1e-12, 1e-20, 1e-38] {
        let f = Mat3::from_columns(
            vec3(size, 0.5 * size, 0.0),
            vec3(0.5 * size, size, 0.0),
            vec3(0.0, 0.0, size),
        );
        let svd = singular_values::signed_svd(&f);
        let numbers = svd.u.columns.iter().chain(&svd.v.columns);
        assert!(numbers.clone().all(|column| column.is_finite()), "{size:e}: {svd:?}");
        assert!(svd.sigma.iter().all(|s| s.is_finite()), "{size:e}: {svd:?}");
    }
    let (change, moves) = spring::solve(&[zero; 2], &[1.0; 2], 0.0f32, 0.0, 1.0);
    assert!(change.is_finite() && moves[0].is_finite());
}
