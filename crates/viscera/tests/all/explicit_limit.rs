//! The largest stable small step of the explicit method, where it is known in closed form.
//!
//! ```text
//! regular tetrahedron of edge a, free, alone:  omega^2 = 8 (3 lambda + 2 mu)/(rho a^2)       it swells
//! with a spring k to its place at each corner: omega^2 + k/m,  m = rho V/4
//! h = (2/Omega) (sqrt(1 + xi^2) - xi),  xi = eta omega^2/(2 Omega)                           leapfrog
//! ```
//!
//! `omega` is the frequency of the tissue, `Omega` that with the springs, which have no viscosity. The solver
//! takes them for viscous as well, and steps that are shorter than needed where there are both.
//!
//! The shape gradients `g` of a regular tetrahedron have `sum g_i g_i^T = (4/3) |g|^2 I` and
//! `|g|^2 = 3/(2 a^2)`; swelling, `u_i = g_i`, is the stiffest mode, and all corners are of one mass, so that
//! the solver's bound of the frequency is the frequency.

use crate::common::{SNH, STVK, material, single_body};
use viscera::material::MaterialModel;
use viscera::mesh::TetMesh;
use viscera::model::Model;
use viscera::scalar::vec3;
use viscera::settings::{Method, SolverSettings};
use viscera::solver::{Inputs, Solver, Tether};
use viscera::state::State;

const EDGE: f64 = 0.01;
const YOUNG: f64 = 5e3;
const POISSON: f64 = 0.4;
const DENSITY: f64 = 1000.0;

/// How much a corner is away from its place at first.
const AMPLITUDE: f64 = 1e-6 * EDGE;

fn regular() -> TetMesh {
    let s = EDGE / 8.0f64.sqrt();
    let corners = [(1.0, 1.0, 1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0)];
    let corners = corners.map(|(x, y, z)| vec3(x, y, z) * s).to_vec();
    TetMesh::new(corners, vec![[0, 1, 2, 3]], vec![0]).expect("a legal mesh").0
}

/// The mass of a corner [kg].
fn corner_mass() -> f64 {
    DENSITY * EDGE.powi(3) / 72.0f64.sqrt() / 4.0
}

/// [1/s], with a spring [N/m] at each corner.
fn frequency(spring: f64) -> f64 {
    let lambda = YOUNG * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON));
    let mu = YOUNG / (2.0 * (1.0 + POISSON));
    let swelling = 8.0 * (3.0 * lambda + 2.0 * mu) / (DENSITY * EDGE * EDGE);
    (swelling + spring / corner_mass()).sqrt()
}

/// [s].
fn limit(viscosity: f64, spring: f64) -> f64 {
    let omega = frequency(spring);
    let xi = 0.5 * viscosity * frequency(0.0).powi(2) / omega;
    (2.0 / omega) * ((1.0 + xi * xi).sqrt() - xi)
}

fn model(law: MaterialModel, viscosity: f64) -> Model<f64> {
    let tissue = material(law, YOUNG, POISSON).with_viscosity(viscosity).expect("legal");
    single_body(&regular(), &tissue)
}

fn settings(explicit_safety: f64) -> SolverSettings {
    SolverSettings { method: Method::Explicit, explicit_safety, ..SolverSettings::xpbd() }
}

/// Viscosities [s] and springs [N/m]: none, either, both; each of them halves the step or more.
fn cases() -> [(f64, f64); 4] {
    let heavy = 4.0 * corner_mass() * frequency(0.0).powi(2);
    let viscous = 2.0 / frequency(0.0);
    [(0.0, 0.0), (viscous, 0.0), (0.0, heavy), (viscous, heavy)]
}

#[test]
fn the_stable_step_is_that_of_the_closed_form() {
    assert!((corner_mass() * 4.0 - DENSITY * regular().volume()).abs() < 1e-12);
    for law in [STVK, SNH] {
        for (viscosity, _) in cases() {
            let model = model(law, viscosity);
            let found = Solver::new(&model, &settings(0.7)).stable_step();
            let expected = 0.7 * limit(viscosity, 0.0);
            // The power method stops short of the largest eigenvalue: 1 % of it.
            assert!((found / expected - 1.0).abs() < 0.01, "{law:?}, {viscosity} s: {found:e}");
        }
    }
}

/// How far corners are from their places after 60 steps of `share` times the limit, over how far they were.
fn growth(law: MaterialModel, case: (f64, f64), share: f64, safety: f64) -> f64 {
    let (viscosity, spring) = case;
    let model = model(law, viscosity);
    let mut solver = Solver::new(&model, &settings(safety));
    let mut state = State::at_rest(&model);
    for (x, rest) in state.positions.iter_mut().zip(&model.rest_positions) {
        *x += *rest * (AMPLITUDE / rest.length());
    }
    let rest = (0u32..).zip(&model.rest_positions).filter(|_| spring > 0.0);
    let tether = |(vertex, &target)| Tether { vertex, target, stiffness: spring };
    let inputs = Inputs { tethers: rest.map(tether).collect(), ..Inputs::default() };
    for _ in 0..60 {
        let dt = share * limit(viscosity, spring);
        solver.step(&model, &mut state, &inputs, dt).expect("a legal step");
    }
    let pairs = state.positions.iter().zip(&model.rest_positions);
    let away = pairs.map(|(x, rest)| (*x - *rest).length());
    away.map(|a| if a.is_finite() { a } else { f64::INFINITY }).fold(0.0, f64::max) / AMPLITUDE
}

/// At `h = s 2/omega` a step multiplies by the roots of `z^2 - (2 - 4 s^2) z + 1`: on the unit circle below the
/// limit, where the amplitude is at most `1/sqrt(1 - s^2)` times the first; 2.4 at a tenth above it. Beyond it a
/// margin of the test's own makes the step as long as it likes; below, the solver divides long steps itself. Steps that end
/// with more energy than they had are taken again in shorter ones: nothing blows up.
#[test]
fn a_run_above_the_stable_step_stays_in_bounds_and_one_below_goes_on() {
    let bound = 1.01 / (1.0f64 - 0.95 * 0.95).sqrt();
    for law in [STVK, SNH] {
        for case @ (viscosity, spring) in cases() {
            let above = growth(law, case, 1.1, 100.0);
            assert!(above < 100.0, "{law:?} {case:?}: grows by {above:e}");
            for share in [0.94, 40.0] {
                let below = growth(law, case, share, 0.95);
                assert!(below < bound, "{law:?} {case:?}, {share}: grows by {below:e}");
                // Held bodies lose what comes and goes within a step near the limit.
                let goes_on = viscosity > 0.0 || spring > 0.0 || below > 0.5;
                assert!(goes_on, "{law:?} {case:?}, {share}: {below:e} is left");
            }
        }
    }
}
