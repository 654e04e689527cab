//! The energy limit of guarded steps: sweeps that stop early may not feed a motion.

use crate::common::{Run, SNH, block, material, single_body};
use viscera::measure::measure_tets;
use viscera::model::Model;
use viscera::scalar::{Vec3, vec3};
use viscera::settings::{Colors, Count, SolverSettings};
use viscera::solver::{Inputs, Pin, Tether};
use viscera::state::State;

const GRAVITY: Vec3<f64> = vec3(0.0, 0.0, -9.81);

/// Kinetic, elastic and potential energy [J] of the vertices that are not pinned, tethers included.
fn mechanical_energy(model: &Model<f64>, state: &State<f64>, inputs: &Inputs<f64>) -> f64 {
    let mut tets = Vec::new();
    measure_tets(model, &state.positions, &mut tets);
    let mut energy = 0.0;
    for tet in &tets {
        energy += tet.rest_volume * tet.energy_density;
    }
    for v in 0..model.vertex_count() {
        if inputs.pins.iter().all(|pin| pin.vertex as usize != v) {
            let mass = model.masses[v];
            energy += 0.5 * mass * state.velocities[v].length_squared();
            energy -= mass * inputs.gravity.dot(state.positions[v]);
        }
    }
    for tether in &inputs.tethers {
        let away = tether.target - state.positions[tether.vertex as usize];
        energy += 0.5 * tether.stiffness * away.length_squared();
    }
    energy
}

/// Stiff tissue in small cells, swinging on a wall: with two sweeps a substep the kept multipliers
/// trail the motion and would push it on.
#[test]
fn no_step_gains_mechanical_energy() {
    let mesh = block([0.08, 0.02, 0.02], [12, 3, 3], 0.2);
    for colors in [Colors::Unlimited, Colors::Limited(4), Colors::Limited(1)] {
        let mut grown = [0, 0];
        for step_guard in [true, false] {
            let settings = SolverSettings { colors, step_guard, ..SolverSettings::xpbd() };
            let model = single_body::<f64>(&mesh, &material(SNH, 4e5, 0.45));
            let mut inputs = Inputs { gravity: GRAVITY, ..Inputs::default() };
            for (v, x) in mesh.vertices().iter().enumerate().filter(|(_, x)| x.x < 1e-9) {
                inputs.pins.push(Pin { vertex: v as u32, target: *x });
            }
            let mut run = Run::new(&model, &settings);
            let mut before = mechanical_energy(&model, &run.state, &inputs);
            for _ in 0..600 {
                let stepped = run.solver.step(&model, &mut run.state, &inputs, run.dt);
                stepped.expect("a legal step");
                let after = mechanical_energy(&model, &run.state, &inputs);
                // The body's potential energy is its weight times its place: 0.03 J. Sums over
                // a thousand terms round that to less than this.
                if after > before + 1e-12 || after.is_nan() {
                    grown[usize::from(!step_guard)] += 1;
                }
                before = after;
            }
        }
        println!("{colors:?}: {} of 600 steps gain energy, {} unguarded", grown[0], grown[1]);
        assert_eq!(grown[0], 0, "{colors:?}");
        assert!(grown[1] > 0, "{colors:?}: the guard makes no difference");
    }
}

/// The same bar on the wall by tethers: what they store at the end of a step counts, or it could be spent
/// twice.
#[test]
fn no_step_gains_the_energy_that_tethers_store() {
    let mesh = block([0.08, 0.02, 0.02], [12, 3, 3], 0.2);
    let settings = SolverSettings::xpbd();
    let model = single_body::<f64>(&mesh, &material(SNH, 4e5, 0.45));
    let mut inputs = Inputs { gravity: GRAVITY, ..Inputs::default() };
    for (v, x) in mesh.vertices().iter().enumerate().filter(|(_, x)| x.x < 1e-9) {
        // Stretched by a millimetre: they pull from the start.
        let target = *x - vec3(1e-3, 0.0, 0.0);
        inputs.tethers.push(Tether { vertex: v as u32, target, stiffness: 2e3 });
    }
    let mut run = Run::new(&model, &settings);
    let first = mechanical_energy(&model, &run.state, &inputs);
    let (mut before, mut slowed) = (first, 0);
    for step in 0..200 {
        run.step(&inputs);
        let after = mechanical_energy(&model, &run.state, &inputs);
        assert!(after <= before + 1e-12, "step {step} gains {:e} J", after - before);
        slowed += u32::from(run.solver.last_step().expect("a guarded step").kept_speed < 1.0);
        before = after;
    }
    println!("{slowed} of 200 steps are slowed; {first:e} J at first, {before:e} J at the end");
    assert!(slowed > 0, "the limit has had nothing to do");
}

/// Pins that drag viscous tissue load its viscosity: what that gives back within the step is no gain.
/// Solved to the end, a step needs no limit.
#[test]
fn the_limit_leaves_well_solved_steps_alone() {
    let mesh = block([0.04, 0.02, 0.02], [4, 2, 2], 0.2);
    for retardation in [0.0, 0.01, 0.05] {
        let tissue = material(SNH, 1e4, 0.45).with_viscosity(retardation).expect("legal");
        let settings = SolverSettings {
            substeps: Count::Of(4),
            iterations: Count::Of(200),
            ..SolverSettings::xpbd()
        };
        let model = single_body::<f64>(&mesh, &tissue);
        let mut run = Run::new(&model, &settings);
        let mut least = 1.0f64;
        for step in 1..=24 {
            let mut inputs = Inputs { gravity: GRAVITY, ..Inputs::default() };
            for (v, x) in mesh.vertices().iter().enumerate() {
                // One end stays, the other is pulled at 0.12 m/s.
                let pull = vec3(0.12 * run.dt * f64::from(step), 0.0, 0.0);
                if x.x < 1e-9 {
                    inputs.pins.push(Pin { vertex: v as u32, target: *x });
                } else if x.x > 0.04 - 1e-9 {
                    inputs.pins.push(Pin { vertex: v as u32, target: *x + pull });
                }
            }
            run.solver.step(&model, &mut run.state, &inputs, run.dt).expect("a legal step");
            least = least.min(run.solver.last_step().expect("a guarded step").kept_speed);
        }
        println!("retardation {retardation} s: at least {least:.6} of the speed is kept");
        // What 200 sweeps leave of a step is below 1e-3 of its change, and so is its energy.
        assert!(least > 0.999, "retardation {retardation} s: {least}");
    }
}
