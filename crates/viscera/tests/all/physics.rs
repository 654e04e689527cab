//! What the tissue must do, as statements of physics.

use crate::common::{Random, Run, SNH, STVK, block, exact, material, plain, single_body};
use viscera::elements::{deformation_gradient, green_strain, internal_forces, neo_hookean};
use viscera::material::MaterialModel;
use viscera::mesh::TetMesh;
use viscera::model::ModelBuilder;
use viscera::scalar::{Mat3, Real, Vec3, vec3};
use viscera::settings::{Acceleration, AndersonOn, Colors, Count, SolverSettings};
use viscera::solver::balance::ForceBalance;
use viscera::solver::{Inputs, Pin};
use viscera::state::State;

fn is_on_boundary(x: Vec3<f64>, size: [f64; 3]) -> bool {
    (0..3).any(|a| x[a] < 1e-9 || x[a] > size[a] - 1e-9)
}

/// Elastic forces on every vertex and the sums of magnitudes of what was added up, in `S`.
fn elastic_forces<S: Real>(
    mesh: &TetMesh,
    model: MaterialModel,
    positions: &[Vec3<S>],
) -> (Vec<Vec3<S>>, Vec<f64>) {
    let (lambda, mu) = (S::from_f64(15e3), S::from_f64(1.7e3));
    let mut forces = vec![Vec3::ZERO; positions.len()];
    let mut magnitudes = vec![0.0; positions.len()];
    for (tet, vertices) in mesh.tets().iter().enumerate() {
        let rest = mesh.corners(tet);
        let shape = viscera::mesh::edge_matrix(rest).inverse().cast::<S>();
        let volume = S::from_f64(viscera::mesh::tet_volume(rest));
        let x = vertices.map(|v| positions[v as usize]);
        let f = deformation_gradient(&x, &shape);
        let piola = match model {
            MaterialModel::SaintVenantKirchhoff => {
                green_strain::piola(&f, &green_strain::strain(&f), lambda, mu)
            }
            MaterialModel::StableNeoHookean => neo_hookean::piola(&f, lambda, mu),
        };
        for (v, force) in vertices.iter().zip(internal_forces(&piola, &shape, volume)) {
            forces[*v as usize] += force;
            magnitudes[*v as usize] += force.length().to_f64();
        }
    }
    (forces, magnitudes)
}

#[test]
fn internal_forces_of_a_body_balance() {
    let mesh = block([0.1, 0.05, 0.05], [8, 4, 4], 0.2);
    let mut random = Random(1);
    let moved: Vec<Vec3<f32>> =
        mesh.vertices().iter().map(|x| (*x + random.vector(0.002)).cast()).collect();
    for model in [STVK, SNH] {
        let (forces, magnitudes) = elastic_forces(&mesh, model, &moved);
        let (mut net, mut torque) = (Vec3::<f64>::ZERO, Vec3::<f64>::ZERO);
        let (mut size, mut lever) = (0.0, 0.0);
        for ((force, x), magnitude) in forces.iter().zip(&moved).zip(&magnitudes) {
            let (force, x) = (force.cast::<f64>(), x.cast::<f64>());
            net += force;
            torque += x.cross(force);
            size += magnitude;
            lever += magnitude * x.length();
        }
        let limit = 64.0 * f64::from(f32::EPSILON);
        println!("{model:?}: net {:e}, torque {:e}", net.length() / size, torque.length() / lever);
        assert!(net.length() < limit * size, "{model:?}: net force {net:?}");
        assert!(torque.length() < limit * lever, "{model:?}: net torque {torque:?}");
    }
}

/// An affine state has constant stress, so interior vertices feel nothing. Rest positions, cell
/// sizes and the map are dyadic, so that single precision holds the affine state exactly and
/// what is left is the arithmetic's own round-off.
#[test]
fn affine_states_load_no_interior_vertex_in_single_precision() {
    let size = [1.0, 0.5, 0.5];
    let mesh = block(size, [8, 4, 4], 0.0);
    let map = Mat3::from_columns(
        vec3(1.25, 0.125, 0.0),
        vec3(-0.125, 0.875, 0.0625),
        vec3(0.25, 0.0, 1.0),
    );
    let moved: Vec<Vec3<f32>> = mesh.vertices().iter().map(|x| (map * *x).cast()).collect();
    for model in [STVK, SNH] {
        let (forces, magnitudes) = elastic_forces(&mesh, model, &moved);
        let mut worst = 0.0f64;
        for (v, x) in mesh.vertices().iter().enumerate() {
            if !is_on_boundary(*x, size) {
                worst = worst.max(f64::from(forces[v].length()) / magnitudes[v]);
            }
        }
        println!("{model:?}: net force on interior vertices {worst:e} of the magnitudes");
        assert!(worst < 64.0 * f64::from(f32::EPSILON), "{model:?}: {worst:e}");
    }
}

/// Moves the boundary of a block affinely and settles; the largest deviation of the interior from
/// the affine map as a fraction of the largest displacement.
fn patch_error<S: Real>(stretch: f64, settings: &SolverSettings, frames: usize) -> f64 {
    let size = [0.1, 0.05, 0.05];
    let mesh = block(size, [6, 4, 4], 0.15);
    let model = single_body::<S>(&mesh, &material(STVK, 1e4, 0.3));
    let lateral = 1.0 + 0.3 * (1.0 - stretch);
    let map = Mat3::from_columns(
        vec3(stretch, 0.05, 0.0),
        vec3(0.0, lateral, 0.02),
        vec3(0.03, 0.0, lateral),
    );
    let mut inputs = Inputs::default();
    let mut largest = 0.0f64;
    for (v, x) in mesh.vertices().iter().enumerate() {
        largest = largest.max((map * *x - *x).length());
        if is_on_boundary(*x, size) {
            inputs.pins.push(Pin { vertex: v as u32, target: (map * *x).cast() });
        }
    }
    let mut run = Run::<S>::new(&model, settings);
    for _ in 0..frames {
        run.frame(&inputs, 0.9);
    }
    let deviations = mesh.vertices().iter().zip(&run.state.positions);
    deviations.fold(0.0, |worst: f64, (rest, x)| {
        worst.max((x.cast::<f64>() - map * *rest).length() / largest)
    })
}

#[test]
fn patch_test_holds_with_the_rebase_and_kept_multipliers() {
    for stretch in [0.8, 0.9, 1.1, 1.2, 1.4] {
        let double = patch_error::<f64>(stretch, &exact(10), 200);
        let single = patch_error::<f32>(stretch, &exact(10), 200);
        let published = patch_error::<f64>(stretch, &plain(1, 40), 100);
        println!(
            "stretch {stretch}: f64 {double:.1e}, f32 {single:.1e}; plain XPBD {:.1} %",
            100.0 * published
        );
        assert!(double < 1e-10, "stretch {stretch}, f64: {double:e}");
        assert!(single < 1e-5, "stretch {stretch}, f32: {single:e}");
    }
}

/// Closed form under uniaxial stress: `S22 = 0` gives `E22 = -nu E11`, so the sides contract to
/// `sqrt(1 - nu (s^2 - 1))` and the force is `A E s (s^2 - 1)/2`.
#[test]
fn uniaxial_stretch_matches_the_closed_form() {
    // Twice as long as thick: a slender bar would buckle at a stretch of 0.8.
    let size = [0.06, 0.03, 0.03];
    let young = 1e4;
    for poisson in [0.3, 0.45] {
        for stretch in [0.8f64, 0.9, 1.2, 1.4, 1.6] {
            let mesh = block(size, [4, 2, 2], 0.0);
            let model = single_body::<f64>(&mesh, &material(STVK, young, poisson));
            let squared = stretch * stretch - 1.0;
            let lateral = (1.0 - poisson * squared).sqrt();
            let force = size[1] * size[2] * young * stretch * squared / 2.0;
            // The end faces follow the closed form; sides and interior are free to disagree.
            let target = |x: Vec3<f64>, s: f64| {
                let l = (1.0 - poisson * (s * s - 1.0)).sqrt();
                vec3(s * x.x, l * (x.y - 0.015), l * (x.z - 0.015))
            };
            let mut run = Run::new(&model, &exact(20));
            let mut inputs = Inputs::default();
            for frame in 0..240 {
                let s = 1.0 + (stretch - 1.0) * (f64::from(frame + 1) / 60.0).min(1.0);
                inputs.pins.clear();
                for (v, x) in mesh.vertices().iter().enumerate() {
                    if x.x < 1e-9 || x.x > size[0] - 1e-9 {
                        inputs.pins.push(Pin { vertex: v as u32, target: target(*x, s) });
                    }
                }
                run.frame(&inputs, 0.9);
            }
            let mut balance = ForceBalance::default();
            run.solver.force_balance(&model, &run.state, &inputs, &mut balance).expect("a balance");
            let (mut pull, mut widest) = (0.0, 0.0f64);
            for (v, x) in mesh.vertices().iter().enumerate() {
                if x.x > size[0] - 1e-9 {
                    pull += balance.residual[v].x;
                }
                if (x.x - 0.5 * size[0]).abs() < 1e-9 {
                    widest = widest.max(run.state.positions[v].y);
                }
            }
            let (side, pull) = (2.0 * widest / size[1] / lateral, pull / force);
            println!("nu {poisson}, stretch {stretch}: side {side:.6}, force {pull:.6} of exact");
            assert!((side - 1.0).abs() < 1e-3, "lateral stretch {side} of the closed form");
            assert!((pull - 1.0).abs() < 1e-3, "force {pull} of the closed form");
        }
    }
}

/// Momentum and angular momentum about the centre of mass.
fn momenta(masses: &[f64], state: &State<f64>) -> (Vec3<f64>, Vec3<f64>) {
    let (mut linear, mut angular) = (Vec3::ZERO, Vec3::ZERO);
    let (mut centre, mut total) = (Vec3::ZERO, 0.0);
    for (m, x) in masses.iter().zip(&state.positions) {
        centre += *x * *m;
        total += m;
    }
    centre = centre * (1.0 / total);
    for ((m, x), v) in masses.iter().zip(&state.positions).zip(&state.velocities) {
        linear += *v * *m;
        angular += (*x - centre).cross(*v) * *m;
    }
    (linear, angular)
}

/// A spinning, squeezed block in free flight: (momentum error, angular momentum lost) after one
/// revolution.
fn free_flight(model: MaterialModel, substeps: u32, colors: Colors) -> (f64, f64) {
    let mesh = block([0.1, 0.05, 0.05], [4, 2, 2], 0.1);
    let settings = SolverSettings { colors, ..plain(substeps, 10) };
    let model = single_body::<f64>(&mesh, &material(model, 2e4, 0.4));
    let mut run = Run::new(&model, &settings);
    let omega = 2.0 * std::f64::consts::PI;
    for (v, x) in run.state.velocities.iter_mut().zip(mesh.vertices()) {
        let r = *x - vec3(0.05, 0.025, 0.025);
        *v = vec3(0.3, -0.2, 0.5) + vec3(0.0, 0.0, omega).cross(r);
    }
    let (linear, angular) = momenta(&model.masses, &run.state);
    for _ in 0..60 {
        run.frame(&Inputs::default(), 1.0);
    }
    let (linear_after, angular_after) = momenta(&model.masses, &run.state);
    let momentum_error = (linear_after - linear).length() / linear.length();
    (momentum_error, 1.0 - angular_after.z / angular.z)
}

#[test]
fn free_flight_keeps_momentum_and_loses_angular_momentum_with_the_step() {
    for model in [STVK, SNH] {
        for colors in [Colors::Unlimited, Colors::Limited(4), Colors::Limited(1)] {
            let rates = [4, 8, 16].map(|substeps| {
                let (momentum, loss) = free_flight(model, substeps, colors);
                // Each of up to 960 steps rounds positions to eps and divides by the step.
                assert!(momentum < 1e-10, "momentum drifted by {momentum:e}");
                -(1.0 - loss).ln()
            });
            println!("{model:?} {colors:?}: angular momentum decays by exp(-r), r = {rates:.4?}");
            // First order in the step; the next order still shows at four substeps, and so does
            // the path dependence of the plain neo-Hookean pair.
            let ratio = rates[1] / rates[2];
            assert!((1.8..2.2).contains(&ratio), "the loss should halve: {rates:?}");
        }
    }
}

/// A Kelvin-Voigt body released from a small affine stretch, inertia negligible, relaxes as
/// `exp(-t/eta)` for every material, because viscous and elastic stress are in proportion.
#[test]
fn viscosity_decays_with_the_retardation_time() {
    let mesh = block([0.04, 0.02, 0.02], [4, 2, 2], 0.0);
    let retardation = 0.1;
    for model in [STVK, SNH] {
        // Inertia shifts the rate by rho (2L/pi)^2/(E eta^2) = 0.07 %.
        let tissue = material(model, 1e5, 0.3).with_viscosity(retardation).expect("legal");
        let settings = SolverSettings {
            acceleration: Acceleration::Anderson,
            anderson_on: AndersonOn::Both,
            ..plain(1, 60)
        };
        let viscous = single_body::<f64>(&mesh, &tissue);
        let mut run = Run::new(&viscous, &settings);
        let (start, lateral) = (1e-3, -0.3e-3);
        for (x, rest) in run.state.positions.iter_mut().zip(mesh.vertices()) {
            *x = vec3((1.0 + start) * rest.x, (1.0 + lateral) * rest.y, (1.0 + lateral) * rest.z);
        }
        let dt = retardation / 500.0;
        for _ in 0..500 {
            run.solver
                .step(&viscous, &mut run.state, &Inputs::default(), dt)
                .expect("a legal step");
        }
        let end = |side: f64| {
            let chosen = mesh.vertices().iter().zip(&run.state.positions);
            let xs: Vec<f64> =
                chosen.filter(|(rest, _)| (rest.x - side).abs() < 1e-9).map(|(_, x)| x.x).collect();
            xs.iter().sum::<f64>() / xs.len() as f64
        };
        let strain = (end(0.04) - end(0.0)) / 0.04 - 1.0;
        let ratio = strain / start / (-1.0f64).exp();
        println!("{model:?}: strain after one retardation time {ratio:.4} of exp(-1)");
        // Implicit Euler: (1 + 1/500)^-500 is 0.1 % above exp(-1).
        assert!((ratio - 1.0).abs() < 0.01, "{model:?}: {ratio}");
    }
}

/// Two regions in series carry one force, so that at small strain they stretch in inverse proportion
/// to their stiffness. Without lateral contraction the clamped bar is a line.
#[test]
fn regions_have_materials_of_their_own() {
    let size = [0.04, 0.02, 0.02];
    let plain = block(size, [4, 2, 2], 0.0);
    let is_right = |tet: usize| plain.corners(tet).iter().map(|x| x.x).sum::<f64>() > 4.0 * 0.02;
    let regions = (0..plain.tets().len()).map(|tet| u32::from(is_right(tet))).collect();
    let mesh = TetMesh::new(plain.vertices().to_vec(), plain.tets().to_vec(), regions)
        .expect("a legal mesh")
        .0;
    for model in [STVK, SNH] {
        let mut builder = ModelBuilder::new();
        let body = builder.add_body(&mesh, &material(model, 1e4, 0.0)).expect("a body");
        let stiff = material(model, 3e4, 0.0);
        let count = builder.set_region_material(body, 1, &stiff).expect("a region");
        assert_eq!(2 * count, mesh.tets().len());
        let built = builder.build::<f64>().expect("a model");
        let stretch = 1e-4 * size[0];
        let mut inputs = Inputs::default();
        for (v, x) in mesh.vertices().iter().enumerate() {
            if x.x < 1e-9 || x.x > size[0] - 1e-9 {
                let shift = if x.x > 1e-9 { stretch } else { 0.0 };
                inputs.pins.push(Pin { vertex: v as u32, target: *x + vec3(shift, 0.0, 0.0) });
            }
        }
        let mut run = Run::new(&built, &exact(20));
        for _ in 0..120 {
            run.frame(&inputs, 0.9);
        }
        let middle = mesh.vertices().iter().zip(&run.state.positions);
        for (rest, x) in middle.filter(|(rest, _)| (rest.x - 0.02).abs() < 1e-9) {
            let share = (x.x - rest.x) / stretch;
            // The next term of both energies is of the size of the strain, 1e-4 and below.
            assert!((share - 0.75).abs() < 1e-3, "{model:?}: {share}");
        }
    }
}

/// A body hanging from a soft attachment and a spring finds the balance of their closed forms.
#[test]
fn attachments_and_springs_carry_the_weight() {
    let mesh = block([0.02, 0.02, 0.02], [2, 2, 2], 0.0);
    let tissue = material(SNH, 5e4, 0.3);
    let mut builder = ModelBuilder::new();
    builder.add_body(&mesh, &tissue).expect("a body");
    builder.add_body(&mesh, &tissue).expect("a body");
    let top: Vec<u32> = (0..27).filter(|&v| mesh.vertices()[v as usize].z > 0.0199).collect();
    for &v in &top {
        builder.add_attachment(v, mesh.vertices()[v as usize], 20.0).expect("an attachment");
        builder.add_spring([v, 27 + v], 15.0, Some(0.0)).expect("a spring");
    }
    let model = builder.build::<f64>().expect("a model");
    let inputs = Inputs { gravity: vec3(0.0, 0.0, -9.81), ..Inputs::default() };
    let mut run = Run::new(&model, &exact(20));
    for _ in 0..600 {
        run.frame(&inputs, 0.9);
    }
    let weight = 1000.0 * 0.02f64.powi(3) * 9.81;
    let (mut upper, mut lower) = (0.0, 0.0);
    for &v in &top {
        upper += mesh.vertices()[v as usize].z - run.state.positions[v as usize].z;
        lower += run.state.positions[v as usize].z - run.state.positions[27 + v as usize].z;
    }
    // Forces add up over the nine parallel elements whatever their single stretch.
    assert!((20.0 * upper / (2.0 * weight) - 1.0).abs() < 1e-6, "{upper}");
    assert!((15.0 * lower / weight - 1.0).abs() < 1e-3, "{lower}");
}

/// The same scene in both precisions, and each one to the bit from run to run.
#[test]
fn single_and_double_precision_run_the_same_scene() {
    fn tip<S: Real>(settings: &SolverSettings) -> Vec<Vec3<S>> {
        let mesh = block([0.08, 0.02, 0.02], [8, 2, 2], 0.1);
        let model = single_body::<S>(&mesh, &material(SNH, 5e4, 0.4));
        let mut inputs = Inputs { gravity: vec3(0.0, 0.0, -9.81).cast(), ..Inputs::default() };
        for (v, x) in mesh.vertices().iter().enumerate().filter(|(_, x)| x.x < 1e-9) {
            inputs.pins.push(Pin { vertex: v as u32, target: x.cast() });
        }
        let mut run = Run::<S>::new(&model, settings);
        for _ in 0..30 {
            run.frame(&inputs, 1.0);
        }
        run.state.positions
    }
    for colors in [Colors::Unlimited, Colors::Limited(4), Colors::Limited(1)] {
        let settings = SolverSettings { colors, substeps: Count::Of(10), ..exact(2) };
        let (single, double) = (tip::<f32>(&settings), tip::<f64>(&settings));
        assert_eq!(single, tip::<f32>(&settings), "two runs differ");
        let fell = double.iter().fold(0.0f64, |a, x| a.min(x.z));
        assert!(fell < -0.001, "the beam should bend, its tip is at {fell} m");
        let difference = single
            .iter()
            .zip(&double)
            .fold(0.0f64, |worst, (a, b)| worst.max((a.cast::<f64>() - *b).length()));
        println!("{colors:?}: f32 and f64 differ by {difference:e} m of {:e} m", -fell);
        // 300 steps, each rounding positions of 0.08 m to 24 bits: eps * 0.08 m * 300 / 2.
        assert!(difference < 150.0 * 0.08 * f64::from(f32::EPSILON), "{colors:?}: {difference:e}");
    }
}
