//! Pins that come and go.

use crate::common::{Random, Run, SNH, STVK, block, exact, material, single_body};
use viscera::scalar::Vec3;
use viscera::settings::{Colors, SolverSettings};
use viscera::solver::balance::ForceBalance;
use viscera::solver::{Inputs, Pin};
use viscera::state::State;

const FRAME: f64 = 1.0 / 60.0;

/// Patches are taken, moved, exchanged and let go. The balance of forces bounds what is left of
/// momentum: inner forces cancel, so that its change in a free step is `dt` times the sum of
/// the residuals.
#[test]
fn pinned_vertices_change_from_step_to_step() {
    let mesh = block([0.1, 0.05, 0.05], [4, 2, 2], 0.1);
    let mut random = Random(2);
    for tissue in [STVK, SNH] {
        for colors in [Colors::Unlimited, Colors::Limited(4), Colors::Limited(1)] {
            let model = single_body::<f64>(&mesh, &material(tissue, 2e4, 0.4));
            let settings = SolverSettings { colors, ..exact(10) };
            let mut run = Run::new(&model, &settings);
            let mut balance = ForceBalance::default();
            let mut free_steps = 0;
            for frame in 0..60 {
                let mut inputs = Inputs::default();
                let taken = |v: usize| (v + frame / 5).is_multiple_of(7) && frame % 15 < 10;
                let shift = random.vector(0.002);
                for (v, x) in run.state.positions.iter().enumerate().filter(|(v, _)| taken(*v)) {
                    inputs.pins.push(Pin { vertex: v as u32, target: *x + shift });
                }
                let momentum = |state: &State<f64>| {
                    let pairs = state.velocities.iter().zip(&model.masses);
                    pairs.fold(Vec3::ZERO, |sum, (v, m)| sum + *v * *m)
                };
                let before = momentum(&run.state);
                run.frame(&inputs, 1.0);
                assert!(run.state.is_finite(), "{tissue:?} {colors:?}, frame {frame}");
                for pin in &inputs.pins {
                    assert_eq!(run.state.positions[pin.vertex as usize], pin.target);
                }
                if inputs.pins.is_empty() {
                    let measured =
                        run.solver.force_balance(&model, &run.state, &inputs, &mut balance);
                    measured.expect("a balance");
                    let change = (momentum(&run.state) - before).length();
                    let sum = balance.residual.iter().fold(Vec3::ZERO, |sum, r| sum + *r);
                    let difference = (change - FRAME * sum.length()).abs();
                    // Velocities carry the round-off of positions over the step; forces, of stress.
                    let size: f64 = model.masses.iter().sum::<f64>() * 0.1 / FRAME;
                    let limit = 64.0 * f64::EPSILON * size;
                    assert!(difference < limit, "{tissue:?} {colors:?}: {difference:e} {limit:e}");
                    free_steps += 1;
                }
            }
            assert_eq!(free_steps, 20);
        }
    }
}
