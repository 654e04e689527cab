//! Bodies that nothing holds: a rigid motion strains nothing, and no method may slow it or take it back.

use crate::common::{Run, SNH, STVK, block, colored, material, single_body};
use viscera::material::MaterialModel;
use viscera::scalar::{Real, vec3};
use viscera::settings::{Acceleration, Colors, Count, NeoHookean, SolverSettings, Start};
use viscera::solver::Inputs;

const JACOBI: Colors = Colors::Limited(1);
const ANY: Colors = Colors::Unlimited;

/// How far the centre of mass has fallen after some free frames, as a share of what implicit Euler
/// gives: g dt^2 (1 + 2 + ... + n).
fn share_of_fall(run: &mut Run<'_, f64>, frames: u32) -> f64 {
    let height = |run: &Run<'_, f64>| {
        let pairs = run.state.positions.iter().zip(&run.model.masses);
        let (moment, mass) = pairs.fold((0.0, 0.0), |(z, sum), (x, m)| (z + m * x.z, sum + m));
        moment / mass
    };
    let gravity = vec3(0.0, 0.0, -9.81);
    let before = height(run);
    for _ in 0..frames {
        run.frame(&Inputs { gravity, ..Inputs::default() }, 1.0);
    }
    let steps = f64::from(frames * run.solver.settings().substeps());
    (before - height(run)) / (9.81 * run.dt * run.dt * steps * (steps + 1.0) / 2.0)
}

/// A rigid motion strains nothing, so that nothing may slow it: a body that nothing holds starts its step where
/// its center of mass will be, so that it falls exactly, guarded or not. Started at `x + dt v`, the default
/// forms do so only where the rebase is applied in full, and by `1 - (1 - theta)^iterations` where a share
/// theta of it is.
#[test]
fn a_dropped_body_falls_with_gravity() {
    let mesh = block([0.02, 0.01, 0.01], [4, 2, 2], 0.2);
    for (tissue, neo_hookean) in
        [(STVK, NeoHookean::Auto), (SNH, NeoHookean::Auto), (SNH, NeoHookean::Pair)]
    {
        for (colors, step_guard) in [(ANY, false), (JACOBI, false), (ANY, true), (JACOBI, true)] {
            for start in [Start::Auto, Start::Inertial] {
                let settings = SolverSettings { neo_hookean, step_guard, start, ..colored(colors) };
                let model = single_body::<f64>(&mesh, &material(tissue, 1e4, 0.45));
                let share = share_of_fall(&mut Run::new(&model, &settings), 10);
                println!(
                    "{tissue:?} {neo_hookean:?} {colors:?} {start:?}, guard {step_guard}: falls \
                     {share:.9} of the way"
                );
                // Only round-off strains the body.
                let is_part = colors == JACOBI && !step_guard && start == Start::Inertial;
                let theta: f64 = if is_part { 0.25 } else { 1.0 };
                let expected = 1.0 - (1.0 - theta).powi(settings.iterations() as i32);
                // The published pair balances two stresses at rest, and their geometric stiffness makes the
                // rebase move a vertex as if it were heavier.
                let is_heavier = neo_hookean == NeoHookean::Pair && start == Start::Inertial;
                let is_right = is_heavier || (share - expected).abs() < 1e-9;
                assert!(is_right, "{tissue:?} {colors:?} {start:?}: {share}");
            }
        }
    }
}

/// Steps of 1/600 s in free fall; returns how many of them are taken back.
fn fall<S: Real>(settings: &SolverSettings, tissue: MaterialModel, steps: u32) -> u64 {
    let mesh = block([0.04, 0.02, 0.02], [4, 2, 2], 0.2);
    let model = single_body::<S>(&mesh, &material(tissue, 1e4, 0.45));
    let mut run = Run::new(&model, settings);
    run.dt = 1.0 / 600.0;
    let inputs = Inputs { gravity: vec3(0.0, 0.0, -9.81).cast(), ..Inputs::default() };
    for _ in 0..steps {
        run.step(&inputs);
    }
    let count = f64::from(steps * (steps + 1)) / 2.0;
    let truth = 9.81 * run.dt * run.dt * count;
    // A place is rounded once per operation; over the step that is a velocity, which goes on.
    let rounding = 4.0 * S::EPSILON * (truth + 0.04) * count;
    for (x, rest) in run.state.positions.iter().zip(&model.rest_positions) {
        let fallen = (rest.z - x.z).to_f64();
        assert!((fallen - truth).abs() < rounding, "{} {settings:?}: {fallen} m", S::NAME);
    }
    run.solver.rejected_steps()
}

/// Few colours and accelerations find the motion of a rigid body in part, or overshoot it; they need not find
/// what the start of the step knows.
#[test]
fn a_falling_body_is_hardly_ever_taken_back() {
    let few = |colors| colored(Colors::Limited(colors));
    let accelerated = |acceleration, colors| SolverSettings {
        acceleration,
        chebyshev_delay: 1,
        iterations: Count::Of(6),
        ..colored(colors)
    };
    let steps = 150;
    for settings in [
        few(1),
        few(4),
        few(5),
        accelerated(Acceleration::Chebyshev, ANY),
        accelerated(Acceleration::Chebyshev, JACOBI),
        accelerated(Acceleration::Anderson, ANY),
        accelerated(Acceleration::Anderson, JACOBI),
    ] {
        for tissue in [STVK, SNH] {
            let rejected = [fall::<f32>, fall::<f64>].map(|fall| fall(&settings, tissue, steps));
            let SolverSettings { colors, acceleration, .. } = settings;
            println!("{tissue:?} {colors:?} {acceleration:?}: {rejected:?} of {steps} taken back");
            assert!(rejected.iter().all(|rejected| 20 * rejected < u64::from(steps)));
        }
    }
}
