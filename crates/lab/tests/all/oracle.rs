//! The library's energies and forces against an independent finite element program: the numbers
//! under `tests/fixtures`, whose README says how they were made and how exact they are. The Newton
//! reference meets the same numbers in `reference_oracle.rs`.
//!
//! Tolerances. Positions near 0.1 m are stored to 1e-17 m; over edges of 5 mm that is a strain of
//! 3e-15, and with moduli of 70 kPa and areas of a few 1e-5 m^2 a force of 1e-14 N at a vertex.
//! Loads and forces below are 1e-2 N and more, so that 1e-12 leaves a factor of ten. The numbers of
//! a fixture are exact to better than that: it says how much, and the tests insist on it.

use crate::common::{
    Fixture, configurations, difference, equilibria, largest, motions, position_error,
};
use viscera::elements::{
    deformation_gradient, green_strain, internal_forces, neo_hookean, shape_gradients,
};
use viscera::material::{Material, MaterialModel};
use viscera::measure::{measure_energies, measure_tissue};
use viscera::mesh::TetMesh;
use viscera::scalar::{Mat3, Vec3};
use viscera::settings::{Acceleration, Count, SolverSettings};
use viscera::solver::{Inputs, Solver};
use viscera::state::State;

/// See the head of this file.
const ROUNDING: f64 = 1e-12;

/// Sums `tet_forces(vertices, inverse_rest_shape, rest_volume)` at the vertices.
fn sum_over_tets(
    mesh: &TetMesh,
    tet_forces: impl Fn([u32; 4], &Mat3<f64>, f64) -> [Vec3<f64>; 4],
) -> Vec<Vec3<f64>> {
    let mut forces = vec![Vec3::ZERO; mesh.vertices().len()];
    for (tet, &vertices) in mesh.tets().iter().enumerate() {
        let rest = viscera::mesh::edge_matrix(mesh.corners(tet));
        let volume = rest.determinant() / 6.0;
        for (v, force) in vertices.into_iter().zip(tet_forces(vertices, &rest.inverse(), volume)) {
            forces[v as usize] += force;
        }
    }
    forces
}

fn corners(x: &[Vec3<f64>], vertices: [u32; 4]) -> [Vec3<f64>; 4] {
    vertices.map(|v| x[v as usize])
}

/// Elastic forces [N] of the tetrahedra on the vertices.
fn elastic_forces(mesh: &TetMesh, material: &Material, x: &[Vec3<f64>]) -> Vec<Vec3<f64>> {
    let (lambda, mu) = (material.lame_lambda(), material.lame_mu());
    sum_over_tets(mesh, |vertices, shape, volume| {
        let f = deformation_gradient(&corners(x, vertices), shape);
        let piola = match material.model() {
            MaterialModel::SaintVenantKirchhoff => {
                green_strain::piola(&f, &green_strain::strain(&f), lambda, mu)
            }
            MaterialModel::StableNeoHookean => neo_hookean::piola(&f, lambda, mu),
        };
        internal_forces(&piola, shape, volume)
    })
}

/// Viscous forces [N] of a step from `start` to `end`: `-V eta/dt grad C^T D (C - C_n)`, with the
/// 6 x 6 stiffness written out, unlike the solver's own stress.
fn viscous_forces(
    mesh: &TetMesh,
    material: &Material,
    start: &[Vec3<f64>],
    end: &[Vec3<f64>],
    dt: f64,
) -> Vec<Vec3<f64>> {
    let stiffness = material.stiffness_matrix();
    sum_over_tets(mesh, |vertices, shape, volume| {
        let f = deformation_gradient(&corners(end, vertices), shape);
        let before = green_strain::strain(&deformation_gradient(&corners(start, vertices), shape));
        let after = green_strain::strain(&f);
        let stress: [f64; 6] = std::array::from_fn(|row| {
            (0..6).map(|k| stiffness[row][k] * (after[k] - before[k])).sum()
        });
        shape_gradients(shape).map(|g| {
            let gradient = green_strain::gradient(&f, g);
            let rate = -volume * material.viscosity() / dt;
            (0..6).fold(Vec3::ZERO, |force, k| force + gradient[k] * (rate * stress[k]))
        })
    })
}

fn elastic_energy(fixture: &Fixture, x: &[Vec3<f64>]) -> f64 {
    let model = fixture.model::<f64>();
    let mut state = State::at_rest(&model);
    state.positions = x.to_vec();
    let tissue = measure_tissue(&model, &state.positions);
    measure_energies(&model, &state, &Inputs::default(), &tissue).elastic
}

fn masses(fixture: &Fixture) -> Vec<f64> {
    fixture.model::<f64>().masses
}

/// Weights [N] of the vertices.
fn weights(fixture: &Fixture) -> Vec<Vec3<f64>> {
    masses(fixture).iter().map(|&mass| fixture.gravity() * mass).collect()
}

#[test]
fn energy_and_forces_of_a_deformed_body_are_the_oracles() {
    for (name, fixture) in configurations() {
        let x = fixture.vectors("positions");
        let expected = fixture.vectors("forces");
        assert!(fixture.value("force_error") < 0.1 * ROUNDING, "{name}");
        let forces = elastic_forces(&fixture.mesh(), &fixture.material(), &x);
        let force_error = largest(&difference(&forces, &expected)) / largest(&expected);
        let energy = fixture.value("elastic_energy");
        let energy_error = (elastic_energy(&fixture, &x) / energy - 1.0).abs();
        println!("{name}: forces off by {force_error:.1e}, energy by {energy_error:.1e}");
        assert!(force_error < ROUNDING && energy_error < ROUNDING);
    }
}

/// The Hessian of the oracle is checked by differences of the library's forces along a line:
/// polynomials of at most fifth order, for which the formula of sixth order is exact. Rounding of
/// the forces is divided by the step, 1 mm of the 10 mm of an edge.
#[test]
fn forces_change_as_the_oracles_hessian_says() {
    const STEP: f64 = 1e-3;
    for (name, fixture) in configurations() {
        let (mesh, material) = (fixture.mesh(), fixture.material());
        let (x, direction) = (fixture.vectors("positions"), fixture.vectors("direction"));
        let along = |steps: f64| {
            let moved: Vec<_> =
                x.iter().zip(&direction).map(|(&x, &d)| x + d * (steps * STEP)).collect();
            elastic_forces(&mesh, &material, &moved)
        };
        let mut change = vec![Vec3::ZERO; x.len()];
        for (steps, weight) in [(1.0, 45.0), (2.0, -9.0), (3.0, 1.0)] {
            for (change, rise) in change.iter_mut().zip(difference(&along(-steps), &along(steps))) {
                *change += rise * (weight / (60.0 * STEP));
            }
        }
        let expected = fixture.vectors("hessian_times_direction");
        assert!(fixture.value("hessian_error") < 0.1 * ROUNDING, "{name}");
        let error = largest(&difference(&change, &expected)) / largest(&expected);
        println!("{name}: Hessian times a direction off by {error:.1e}");
        assert!(error < 10.0 * ROUNDING);
    }
}

#[test]
fn elastic_forces_balance_gravity_at_the_oracles_equilibrium() {
    for (name, fixture) in equilibria() {
        let x = fixture.vectors("positions");
        assert!(fixture.value("position_error") < 0.1 * ROUNDING, "{name}");
        assert!(fixture.value("position_error_other_starts") < 0.1 * ROUNDING, "{name}");
        let forces = elastic_forces(&fixture.mesh(), &fixture.material(), &x);
        let balance: Vec<_> =
            forces.iter().zip(weights(&fixture)).map(|(&force, weight)| force + weight).collect();
        let reactions = fixture.vectors("reactions");
        let load = reactions.iter().fold(0.0, |sum, reaction| sum + reaction.length());
        let free: Vec<_> = fixture
            .free()
            .iter()
            .zip(&balance)
            .filter(|(free, _)| **free)
            .map(|(_, &r)| r)
            .collect();
        let unbalanced = largest(&free) / load;
        let held: Vec<_> = fixture.pins().iter().map(|pin| -balance[pin.vertex as usize]).collect();
        let reaction_error = largest(&difference(&held, &reactions)) / largest(&reactions);
        let energy = fixture.value("elastic_energy");
        let energy_error = (elastic_energy(&fixture, &x) / energy - 1.0).abs();
        println!(
            "{name}: unbalanced {unbalanced:.1e}, reactions off by {reaction_error:.1e}, energy by \
             {energy_error:.1e}"
        );
        assert!(unbalanced < ROUNDING && reaction_error < ROUNDING && energy_error < ROUNDING);
    }
}

/// `M (x - xt)/dt^2 = f(x)` at the free vertices, `xt` from the step before.
#[test]
fn the_oracles_steps_satisfy_implicit_euler() {
    for (name, fixture) in motions() {
        let (mesh, material) = (fixture.mesh(), fixture.material());
        let dt = fixture.value("step");
        let (free, weights, masses) = (fixture.free(), weights(&fixture), masses(&fixture));
        let load = weights.iter().fold(0.0, |sum, weight| sum + weight.length());
        let rest = mesh.vertices().to_vec();
        let [first, second] = ["positions_1", "positions_2"].map(|key| fixture.vectors(key));
        let mut worst = 0.0f64;
        for [before, start, end] in [[&rest, &rest, &first], [&rest, &first, &second]] {
            let elastic = elastic_forces(&mesh, &material, end);
            let viscous = viscous_forces(&mesh, &material, start, end, dt);
            for v in (0..rest.len()).filter(|&v| free[v]) {
                let acceleration = (end[v] - start[v]) - (start[v] - before[v]);
                let inertia = acceleration * (masses[v] / (dt * dt));
                let residual = inertia - elastic[v] - viscous[v] - weights[v];
                worst = worst.max(residual.length() / load);
            }
        }
        println!("{name}: residual {worst:.1e} of the weight");
        assert!(fixture.value("position_error") < 0.1 * ROUNDING, "{name}");
        assert!(worst < ROUNDING, "{name}");
    }
}

/// With the rebase a step converges to implicit Euler, so that very many sweeps are the exact step.
/// The bounds are what 2000 sweeps leave: round-off of elastic tissue; viscous tissue, two blocks on
/// each tetrahedron, gains a digit in about 250 sweeps.
#[test]
fn many_sweeps_are_the_oracles_steps() {
    let settings = SolverSettings {
        substeps: Count::Of(1),
        iterations: Count::Of(2000),
        acceleration: Acceleration::Anderson,
        ..SolverSettings::xpbd()
    };
    for (name, fixture) in motions() {
        let tolerance = if fixture.value("viscosity") > 0.0 { 1e-7 } else { ROUNDING };
        let model = fixture.model::<f64>();
        let (mut state, mut solver) = (State::at_rest(&model), Solver::new(&model, &settings));
        for step in 1..=2 {
            solver
                .step(&model, &mut state, &fixture.inputs(), fixture.value("step"))
                .expect("a legal step");
            let expected = fixture.vectors(&format!("positions_{step}"));
            let error = position_error(&state.positions, &expected, &model.rest_positions);
            println!("{name}, step {step}: off by {error:.1e} of the displacement");
            assert!(error < tolerance, "{name}, step {step}: {error:e}");
        }
    }
}
