//! What is said of a state, where the truth is a closed form: stress and volume of a tetrahedron whose
//! deformation is known, and the stiffness of a bar whose displacement is known.
//!
//! ```text
//! F = R diag(s):  E_i = (s_i^2 - 1)/2,  J = s_1 s_2 s_3
//! Saint Venant-Kirchhoff  P_i = s_i (2 mu E_i + lambda sum E)
//! stable neo-Hookean      P_i = mu s_i + lh (J - a) J/s_i,  lh = lambda + mu,  a = 1 + mu/lh
//! sigma_i = P_i s_i/J,   von Mises^2 = ((s1 - s2)^2 + (s2 - s3)^2 + (s3 - s1)^2)/2  of the sigma_i
//! ```

use crate::common::{Random, SNH, STVK, block, material, single_body};
use viscera::measure::{measure_tets, summarize_deformation};
use viscera::mesh::TetMesh;
use viscera::model::Model;
use viscera::scalar::{Mat3, Vec3, vec3};
use viscera::settings::{Count, SolverSettings};
use viscera::solver::balance::ForceBalance;
use viscera::solver::{Inputs, Pin, Solver};
use viscera::state::State;

const YOUNG: f64 = 5e3;
const POISSON: f64 = 0.4;

/// Cauchy stresses along the axes [Pa].
fn cauchy(is_green: bool, s: [f64; 3]) -> [f64; 3] {
    let lambda = YOUNG * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON));
    let mu = YOUNG / (2.0 * (1.0 + POISSON));
    let j = s[0] * s[1] * s[2];
    let green = s.map(|s| 0.5 * (s * s - 1.0));
    let piola = |i: usize| match is_green {
        true => s[i] * (2.0 * mu * green[i] + lambda * green.iter().sum::<f64>()),
        false => {
            let lh = lambda + mu;
            mu * s[i] + lh * (j - 1.0 - mu / lh) * j / s[i]
        }
    };
    std::array::from_fn(|i| piola(i) * s[i] / j)
}

fn von_mises([a, b, c]: [f64; 3]) -> f64 {
    (0.5 * ((a - b).powi(2) + (b - c).powi(2) + (c - a).powi(2))).sqrt()
}

#[test]
fn stress_and_volume_of_a_tetrahedron_are_those_of_its_deformation() {
    let corners = [vec3(0.1, 0.2, 0.3), vec3(0.11, 0.2, 0.3), vec3(0.1, 0.21, 0.3)];
    let mut corners = corners.to_vec();
    corners.push(vec3(0.1, 0.2, 0.31));
    let mesh = TetMesh::new(corners, vec![[0, 1, 2, 3]], vec![0]).expect("a legal mesh").0;
    let mut random = Random(11);
    for law in [STVK, SNH] {
        let tissue = material(law, YOUNG, POISSON);
        let model: Model<f64> = single_body(&mesh, &tissue);
        for stretches in [
            [2.0, 1.0, 1.0],
            [1.5, 0.8, 0.7],
            [0.4, 1.0, 1.0],
            [0.5, 0.6, 0.7],
            [1.0, 1.0, -0.5],
            [1.3, 0.9, -0.2],
        ] {
            let [a, b, c] = stretches;
            let diagonal =
                Mat3::from_columns(vec3(a, 0.0, 0.0), vec3(0.0, b, 0.0), vec3(0.0, 0.0, c));
            let f = random.rotation() * diagonal;
            let positions: Vec<Vec3<f64>> = mesh.vertices().iter().map(|x| f * *x).collect();
            let mut tets = Vec::new();
            measure_tets(&model, &positions, &mut tets);
            let what = format!("{law:?} {stretches:?}: {:?}", tets[0]);
            assert!((tets[0].volume_ratio - a * b * c).abs() < 1e-12, "{what}");
            let expected = von_mises(cauchy(law == STVK, stretches));
            assert!((tets[0].von_mises / expected - 1.0).abs() < 1e-11, "{what}, not {expected}");
            assert_eq!(summarize_deformation(&tets).inverted, usize::from(c < 0.0), "{what}");
        }
    }
}

/// `1 - s` where the displacement is `1/s` times the solution. So little weight that the answer is linear up to
/// strains of 1e-3, and a step so long that inertia is nothing.
#[test]
fn a_bar_displaced_by_a_share_of_its_solution_is_said_to_be_softer_by_that_share() {
    const LONG: f64 = 1e4;
    const DT: f64 = 1.0 / 60.0;
    let mesh = block([0.06, 0.02, 0.02], [3, 1, 1], 0.1);
    let settings = SolverSettings { iterations: Count::Of(20), ..SolverSettings::xpbd() };
    for law in [STVK, SNH] {
        let model: Model<f64> = single_body(&mesh, &material(law, YOUNG, POISSON));
        let wall = (0u32..).zip(mesh.vertices()).filter(|(_, x)| x.x < 1e-9);
        let inputs = Inputs {
            gravity: vec3(0.0, 0.0, -1e-2),
            pins: wall.map(|(vertex, &target)| Pin { vertex, target }).collect(),
            ..Inputs::default()
        };
        let mut state = State::at_rest(&model);
        let mut solver = Solver::new(&model, &settings);
        for _ in 0..150 {
            solver.step(&model, &mut state, &inputs, DT).expect("a legal step");
            state.velocities.iter_mut().for_each(|v| *v = *v * 0.8);
        }
        let solution = state.positions.clone();
        // Only for the equations that the balance is of.
        state.velocities.fill(Vec3::ZERO);
        solver.step(&model, &mut state, &inputs, LONG).expect("a legal step");
        for stiffness in [0.5, 0.9, 1.0, 1.02, 1.25, 4.0] {
            for (v, x) in state.positions.iter_mut().enumerate() {
                let rest = model.rest_positions[v];
                *x = rest + (solution[v] - rest) * (1.0 / stiffness);
            }
            let mut balance = ForceBalance::default();
            solver.force_balance(&model, &state, &inputs, &mut balance).expect("a balance");
            let found = balance.stiffness_error();
            assert!(
                (found - (1.0 - stiffness)).abs() < 2e-3 * stiffness,
                "{law:?} {stiffness}: {found}"
            );
        }
    }
}
