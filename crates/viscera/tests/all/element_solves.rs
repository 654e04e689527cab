//! Every local solve against the linear system that defines it; where it rests, and what bounds it.

use crate::common::Random;
use crate::common::tets::{Case, LAMBDA, MU, STEP, cases};
use viscera::elements::{
    attachment, deformation_gradient, green_strain, internal_forces, neo_hookean, neo_hookean_pair,
    neo_hookean_stretch, shape_gradients, singular_values, spring,
};
use viscera::scalar::{Mat3, Vec3};

/// `A dl = b` with A assembled entry by entry from the gradients that `elements.rs` checks.
#[test]
fn green_strain_solve_satisfies_its_linear_system() {
    let mut random = Random(11);
    let material = crate::common::material(crate::common::STVK, 5e3, 0.45);
    let compliance = material.compliance_matrix();
    for case in cases() {
        let w: [f64; 4] = std::array::from_fn(|_| 1.0 / random.uniform(1e-6, 1e-4));
        let multipliers: [f64; 6] = std::array::from_fn(|_| random.uniform(-1e-9, 1e-9));
        let target: [f64; 6] = std::array::from_fn(|_| random.uniform(-0.1, 0.1));
        let scale = 1.0 / (case.volume * 1e-4);
        let change = green_strain::solve(
            &case.corners,
            &w,
            &case.inverse_rest_shape,
            &multipliers,
            Some(&target),
            &material.compliance().scaled(scale),
        );
        let f = deformation_gradient(&case.corners, &case.inverse_rest_shape);
        let c = green_strain::strain(&f);
        let rows = shape_gradients(&case.inverse_rest_shape).map(|g| green_strain::gradient(&f, g));
        for p in 0..6 {
            let (mut left, mut size) = (0.0, 0.0);
            for q in 0..6 {
                let mut entry = scale * compliance[p][q];
                for i in 0..4 {
                    entry += w[i] * rows[i][p].dot(rows[i][q]);
                }
                left += entry * change.multipliers[q];
                size += (entry * change.multipliers[q]).abs();
            }
            let mut right = -(c[p] - target[p]);
            for q in 0..6 {
                right -= scale * compliance[p][q] * multipliers[q];
                size += (scale * compliance[p][q] * multipliers[q]).abs();
            }
            // Backward error of a 6 x 6 factorisation: a few n eps of the terms summed.
            let tolerance = 200.0 * f64::EPSILON * (size + c[p].abs() + target[p].abs());
            assert!((left - right).abs() < tolerance, "{}: {left:e} {right:e}", case.name);
        }
        for i in 0..4 {
            let mut expected = Vec3::ZERO;
            let mut size = 0.0;
            for p in 0..6 {
                expected += rows[i][p] * (w[i] * change.multipliers[p]);
                size += rows[i][p].length() * w[i] * change.multipliers[p].abs();
            }
            assert!((change.positions[i] - expected).length() < 64.0 * f64::EPSILON * size);
        }
    }
}

#[test]
fn neo_hookean_solve_satisfies_its_linear_system() {
    let mut random = Random(12);
    for case in cases() {
        let w: [f64; 4] = std::array::from_fn(|_| 1.0 / random.uniform(1e-6, 1e-4));
        let multipliers = [random.uniform(-1e-9, 1e-9), random.uniform(-1e-9, 0.0)];
        let step_volume = case.volume * 1e-4;
        let shape = &case.inverse_rest_shape;
        let change = neo_hookean_pair::solve(
            &case.corners,
            &w,
            shape,
            &multipliers,
            LAMBDA,
            MU,
            step_volume,
        );
        let f = deformation_gradient(&case.corners, shape);
        let c = neo_hookean_pair::constraints(&f, LAMBDA, MU);
        let rows = shape_gradients(shape).map(|g| neo_hookean_pair::gradient(&f, g));
        let compliance = [1.0 / ((LAMBDA + MU) * step_volume), 1.0 / (MU * step_volume)];
        for p in 0..2 {
            let (mut left, mut size) = (0.0, 0.0);
            for q in 0..2 {
                let mut entry = if p == q { compliance[p] } else { 0.0 };
                for i in 0..4 {
                    entry += w[i] * rows[i][p].dot(rows[i][q]);
                }
                left += entry * change.multipliers[q];
                size += (entry * change.multipliers[q]).abs();
            }
            let right = -c[p] - compliance[p] * multipliers[p];
            size += c[p].abs() + (compliance[p] * multipliers[p]).abs();
            let error = (left - right).abs() / size;
            assert!(error < 200.0 * f64::EPSILON, "{}: {error:e}", case.name);
        }
    }
}

/// `(C + sum_i w_i B_i B_i^T) d = -C r`, multiplied by `C^-1` (the stiffness times `V dt^2`), which is
/// derived here once more from the energy. Where the stiffness is far from indefinite and far from
/// the floor of the shears, so that no clamp acts.
#[test]
fn stretch_solve_satisfies_its_linear_system() {
    let mut random = Random(14);
    let lh = LAMBDA + MU;
    let mut checked = 0;
    for case in cases() {
        let shape = &case.inverse_rest_shape;
        // Scaled to about the volume at which the second term of the energy vanishes.
        let volume_ratio = deformation_gradient(&case.corners, shape).determinant();
        let wanted = (1.0 + MU / lh) * random.uniform(0.98, 1.02);
        let corners = case.corners.map(|x| x * (wanted / volume_ratio).abs().cbrt());
        let f = deformation_gradient(&corners, shape);
        let singular_values::SignedSvd { u, sigma: s, v } = singular_values::signed_svd(&f);
        let e = lh * (s[0] * s[1] * s[2] - 1.0) - MU;
        // Gershgorin on the part that may be negative. Flat rest shapes multiply round-off by the
        // square of their thousandfold gradients.
        if case.name == "flat at rest" || e.abs() * s[0].max(s[1].abs() + s[2].abs()) > 0.5 * MU {
            continue;
        }
        checked += 1;
        let w: [f64; 4] = std::array::from_fn(|_| 1.0 / random.uniform(1e-6, 1e-4));
        let multipliers: [f64; 6] = std::array::from_fn(|_| random.uniform(-1e-9, 1e-9));
        let step_volume = case.volume * 1e-4;
        let change =
            neo_hookean_stretch::solve(&corners, &w, shape, &multipliers, LAMBDA, MU, step_volume);
        let principal = |l: &[f64; 6]| {
            let turned = v.transpose() * green_strain::symmetric(l) * v;
            let [a, b, c] = turned.columns;
            [a.x, b.y, c.z, b.z, a.z, a.y]
        };
        let (l, d) = (principal(&multipliers), principal(&change.multipliers));
        // d^2 W/(ds_a ds_b), and half of mu - e s_c for the shear of the other two.
        let stiffness = |p: usize, q: usize| match (p < 3, q < 3) {
            (true, true) => {
                let others = |k: usize| s[(k + 1) % 3] * s[(k + 2) % 3];
                let coupling = if p == q { MU } else { e * s[3 - p - q] };
                lh * others(p) * others(q) + coupling
            }
            (false, false) if p == q => 0.5 * (MU - e * s[p - 3]),
            _ => 0.0,
        };
        let rows = shape_gradients(shape).map(|g| {
            let g = v.transpose() * g;
            green_strain::PAIRS.map(|(a, b)| {
                let (u, same) = (u.columns, a == b);
                if same { u[a] * g[a] } else { u[a] * g[b] + u[b] * g[a] }
            })
        });
        let moved: [f64; 6] = std::array::from_fn(|p| {
            let product =
                |q: usize| (0..4).map(|i| w[i] * rows[i][p].dot(rows[i][q])).sum::<f64>() * d[q];
            (0..6).map(product).sum()
        });
        for p in 0..6 {
            let stress = if p < 3 { MU * s[p] + e * s[(p + 1) % 3] * s[(p + 2) % 3] } else { 0.0 };
            let residual = l[p] + step_volume * stress;
            let (mut left, mut size) = (d[p] + residual, d[p].abs() + residual.abs());
            for q in 0..6 {
                let term = step_volume * stiffness(p, q) * moved[q];
                left += term;
                size += term.abs();
            }
            // The block is solved in compliances: its condition number, below 1e4 here, comes in.
            assert!(left.abs() < 1e-10 * size, "{} {p}: {left:e} of {size:e}", case.name);
        }
        for i in 0..4 {
            let expected = (0..6).fold(Vec3::ZERO, |sum, p| sum + rows[i][p] * (w[i] * d[p]));
            let error = (change.positions[i] - expected).length();
            let size: f64 = (0..6).map(|p| rows[i][p].length() * w[i] * d[p].abs()).sum();
            assert!(error < 1e-12 * size, "{}: {error:e}", case.name);
        }
    }
    println!("{checked} cases without a clamp");
    assert!(checked > 100, "only {checked} cases without a clamp");
}

/// Each solve leaves its constitutive multipliers alone, and their load is `dt^2` times the force.
#[test]
fn constitutive_multipliers_leave_no_residual_and_carry_the_force() {
    let mut random = Random(15);
    let material = crate::common::material(crate::common::STVK, 5e3, 0.45);
    let (lambda, mu) = (material.lame_lambda(), material.lame_mu());
    let (mut worst_change, mut worst_force) = ([0.0f64; 4], [0.0f64; 4]);
    for case in cases() {
        let (x, shape) = (&case.corners, &case.inverse_rest_shape);
        let w: [f64; 4] = std::array::from_fn(|_| 1.0 / random.uniform(1e-6, 1e-4));
        let f = deformation_gradient(x, shape);
        let s = case.volume * 1e-4;
        let mut check = |form: usize, before: &[f64], change: &[f64], piola: Mat3<f64>, loads| {
            let norm = |l: &[f64]| l.iter().map(|l| l * l).sum::<f64>().sqrt();
            worst_change[form] = worst_change[form].max(norm(change) / norm(before));
            let loads: [viscera::elements::CornerLoad<f64>; 4] = loads;
            let forces = internal_forces(&piola, shape, s);
            let size = s * (piola.norm_squared() * shape.norm_squared()).sqrt();
            for (load, force) in loads.iter().zip(forces) {
                let error = (load.impulse - force).length() / size;
                worst_force[form] = worst_force[form].max(error);
            }
        };

        let (rest, start) = ([0.0; 6], std::array::from_fn(|_| random.uniform(-0.1, 0.1)));
        for (form, target) in [(0, rest), (1, start)] {
            let strain = green_strain::strain(&f);
            let c = std::array::from_fn(|p| strain[p] - target[p]);
            let l = green_strain::constitutive_multipliers(&c, lambda, mu, s);
            let compliance = material.compliance().scaled(1.0 / s);
            let d = green_strain::solve(x, &w, shape, &l, Some(&target), &compliance);
            let piola = green_strain::piola(&f, &c, lambda, mu);
            let loads = green_strain::corner_loads(x, shape, &l);
            check(form, &l, &d.multipliers, piola, loads);
        }
        let piola = neo_hookean::piola(&f, lambda, mu);
        let l = neo_hookean_pair::constitutive_multipliers(&f, lambda, mu, s);
        let d = neo_hookean_pair::solve(x, &w, shape, &l, lambda, mu, s);
        let loads = neo_hookean_pair::corner_loads(x, shape, &l);
        check(2, &l, &d.multipliers, piola, loads);
        let l = neo_hookean_stretch::constitutive_multipliers(&f, lambda, mu, s);
        let d = neo_hookean_stretch::solve(x, &w, shape, &l, lambda, mu, s);
        let loads = neo_hookean_stretch::corner_loads(x, shape, &l);
        check(3, &l, &d.multipliers, piola, loads);
    }
    println!("changes {worst_change:?}, loads {worst_force:?}");
    // The condition number of D is (3 lambda + 2 mu)/mu = 29; it enters in the residual and once
    // more in the solve.
    let tolerance = 29.0 * 29.0 * 8.0 * f64::EPSILON;
    assert!(worst_change.iter().all(|change| *change < tolerance), "{worst_change:?}");
    assert!(worst_force.iter().all(|error| *error < tolerance), "{worst_force:?}");

    let ends: [Vec3<f64>; 2] = std::array::from_fn(|_| random.vector(0.01));
    let (stiffness, squared) = (120.0, 1e-4);
    let compliance_tilde = 1.0 / (stiffness * squared);
    let l = spring::constitutive_multiplier(&ends, 0.004, compliance_tilde);
    let (change, _) = spring::solve(&ends, &[1e4, 2e4], 0.004, l, compliance_tilde);
    assert!(change.abs() < 8.0 * f64::EPSILON * l.abs(), "{change:e} of {l:e}");
    let forces = spring::forces(&ends, 0.004, stiffness);
    for (load, force) in spring::corner_loads(&ends, l).iter().zip(forces) {
        let error = (load.impulse - force * squared).length();
        assert!(error < 8.0 * f64::EPSILON * squared * force.length(), "{error:e}");
    }
    let l = attachment::constitutive_multipliers(ends[0], ends[1], compliance_tilde);
    let (change, _) = attachment::solve(ends[0], 1e4, ends[1], l, compliance_tilde);
    assert!(change.length() < 8.0 * f64::EPSILON * l.length(), "{change:?} of {l:?}");
    let force = attachment::force(ends[0], ends[1], stiffness) * squared;
    assert!((l - force).length() < 8.0 * f64::EPSILON * force.length(), "{l:?} {force:?}");
}

/// With `D` the diagonal of the mass bounds and `K = d(J^T l)/dx` (by differences), `-D <= K <= D`:
/// what makes the rebase stable. Checked as the spectral radius of `D^-1/2 K D^-1/2`.
#[test]
fn mass_bounds_cover_the_geometric_stiffness() {
    let mut random = Random(13);
    for case in cases() {
        let six: [f64; 6] = std::array::from_fn(|_| random.uniform(-1.0, 1.0));
        let two = [random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0)];
        let shape = &case.inverse_rest_shape;
        // With the multipliers fixed, J^T l is linear (Green strain) or smooth in x.
        let green = |x: &[Vec3<f64>; 4]| green_strain::corner_loads(x, shape, &six);
        let neo = |x: &[Vec3<f64>; 4]| neo_hookean_pair::corner_loads(x, shape, &two);
        check_bound(&case, green, "Green strain");
        check_bound(&case, neo, "neo-Hookean pair");
        // Through inversion, where two stretches cancel, the bound of the stretch form is a choice.
        let f = deformation_gradient(&case.corners, shape);
        let [_, s2, s3] = singular_values::signed_svd(&f).sigma;
        if s2 + s3 > 0.3 {
            let stretch = |x: &[Vec3<f64>; 4]| neo_hookean_stretch::corner_loads(x, shape, &six);
            check_bound(&case, stretch, "neo-Hookean stretch");
        }
    }
}

fn check_bound(
    case: &Case,
    loads: impl Fn(&[Vec3<f64>; 4]) -> [viscera::elements::CornerLoad<f64>; 4],
    name: &str,
) {
    let step = STEP * case.height;
    let scale = loads(&case.corners).map(|load| 1.0 / load.mass_bound.sqrt());
    let mut matrix = [[0.0; 12]; 12];
    for column in 0..12 {
        let (b, axis) = (column / 3, column % 3);
        let moved = |sign: f64| {
            let mut x = case.corners;
            x[b][axis] += sign * step;
            loads(&x)
        };
        let (plus, minus) = (moved(1.0), moved(-1.0));
        for i in 0..4 {
            let derivative = (plus[i].impulse - minus[i].impulse) * (0.5 / step);
            for row in 0..3 {
                matrix[3 * i + row][column] = derivative[row] * scale[i] * scale[b];
            }
        }
    }
    let mut vector: [f64; 12] = std::array::from_fn(|i| 1.0 + 0.1 * i as f64);
    let mut radius = 0.0;
    for _ in 0..300 {
        let image: [f64; 12] =
            std::array::from_fn(|i| (0..12).map(|j| matrix[i][j] * vector[j]).sum());
        let norm = |v: &[f64; 12]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        radius = norm(&image) / norm(&vector);
        vector = image.map(|x| x / norm(&image));
    }
    // Differences of J^T l are good to about 1e-8 of their size.
    assert!(radius <= 1.0 + 1e-6, "{} {name}: {radius}", case.name);
    assert!(radius > 1e-3, "{} {name}: the bound is empty, {radius}", case.name);
}

/// With the multipliers at their constitutive value `-V dt^2` times the Biot stress, the corner
/// loads are the internal forces times `dt^2`, and the local solve moves nothing.
#[test]
fn stretch_form_rests_where_the_energy_does() {
    for case in cases() {
        let shape = &case.inverse_rest_shape;
        let f = deformation_gradient(&case.corners, shape);
        let svd = singular_values::signed_svd(&f);
        // Close stretches are told apart to round-off over their gap only; the stress is smooth.
        let piola = neo_hookean::piola(&f, LAMBDA, MU);
        let biot = svd.v * svd.u.transpose() * piola;
        let step_volume = case.volume * 1e-4;
        let [a, b, c] = biot.columns;
        let multipliers = [a.x, b.y, c.z, 0.5 * (b.z + c.y), 0.5 * (a.z + c.x), 0.5 * (a.y + b.x)]
            .map(|t| -t * step_volume);
        let loads = neo_hookean_stretch::corner_loads(&case.corners, shape, &multipliers);
        let forces = internal_forces(&piola, shape, case.volume);
        let size = forces.iter().fold(0.0f64, |m, f| m.max(f.length())) * 1e-4;
        for (load, force) in loads.iter().zip(forces) {
            let error = (load.impulse - force * 1e-4).length() / size;
            assert!(error < 1e-10, "{}: {error:e}", case.name);
        }
        let w = [1e5; 4];
        let change = neo_hookean_stretch::solve(
            &case.corners,
            &w,
            shape,
            &multipliers,
            LAMBDA,
            MU,
            step_volume,
        );
        let largest = multipliers.iter().fold(0.0f64, |m, l| m.max(l.abs()));
        for change in change.multipliers {
            assert!(change.abs() < 1e-9 * largest, "{}: {change:e} of {largest:e}", case.name);
        }
    }
}
