//! With several threads a step takes no memory either, on any of them, but for a block of the queue
//! through which a step is handed to the threads.
//!
//! The counter is one for all threads, and other tests would count too: this one has a process of its own.

use crate::common::alone;
use crate::common::counting::requests_of_all_threads;
use crate::common::{SNH, block, material, single_body};
use viscera::scalar::vec3;
use viscera::settings::{Acceleration, AndersonGuard, Colors, SolverSettings, Threads};
use viscera::solver::{Inputs, Pin, Solver};
use viscera::state::State;

/// Rayon's queue of work from outside is a list of blocks with room for 63 entries, and a step is one
/// entry: every 63rd step takes a block and gives one back. Within a step, work goes through queues that
/// are there from the start and that the depth of the halving never fills.
const STEPS_PER_BLOCK: usize = 63;

#[test]
fn steps_of_two_threads_take_a_block_of_the_queue_now_and_then() {
    if !alone("allocation_threads::steps_of_two_threads_take_a_block_of_the_queue_now_and_then") {
        return;
    }
    // More than 64 blocks of each colour and several pieces of every sum, so that work is shared in all
    // stages that share it: strain, loads, sweep, rebase, joining copies, potential, forces.
    let mesh = block([0.08, 0.04, 0.04], [16, 12, 12], 0.2);
    let base = SolverSettings { threads: Threads::Count(2), ..SolverSettings::xpbd() };
    let tissue = material(SNH, 1e4, 0.45).with_viscosity(0.01).expect("legal");
    let mut rejected = 0;
    for (colors, acceleration) in [
        (Colors::Unlimited, Acceleration::None),
        (Colors::Limited(4), Acceleration::Anderson),
        (Colors::Limited(1), Acceleration::Chebyshev),
    ] {
        let anderson_guard = AndersonGuard::Energy;
        let settings = SolverSettings { colors, acceleration, anderson_guard, ..base.clone() };
        let model = single_body::<f32>(&mesh, &tissue);
        let mut solver = Solver::new(&model, &settings);
        assert_eq!(solver.thread_count(), 2);
        let mut state = State::at_rest(&model);
        let mut inputs = Inputs { gravity: vec3(0.0, 0.0, -9.81), ..Inputs::default() };
        for (v, x) in mesh.vertices().iter().enumerate().filter(|(_, x)| x.x < 1e-9) {
            inputs.pins.push(Pin { vertex: v as u32, target: x.cast() });
        }
        let mut step = || solver.step(&model, &mut state, &inputs, 1e-3).expect("a legal step");
        // The threads take what they need of their own when they first work; on a busy machine the first
        // steps may be over before the second thread has woken up.
        for _ in 0..STEPS_PER_BLOCK {
            step();
        }
        let mut by_step = [0; STEPS_PER_BLOCK];
        for requests in &mut by_step {
            *requests = requests_of_all_threads(&mut step);
        }
        let busy: Vec<_> =
            by_step.iter().enumerate().filter(|(_, requests)| **requests > 0).collect();
        println!("{colors:?}, {acceleration:?}: steps with requests: {busy:?}");
        assert!(busy.len() <= 2, "{colors:?}, {acceleration:?}: {busy:?}");
        assert!(by_step.iter().sum::<usize>() <= 2, "{colors:?}, {acceleration:?}: {busy:?}");

        // A jump that is taken back, and a new history.
        let last = mesh.vertices().len() as u32 - 1;
        inputs.pins.push(Pin { vertex: last, target: vec3(0.0, 0.1, 0.05) });
        let requests = requests_of_all_threads(|| {
            for _ in 0..3 {
                solver.step(&model, &mut state, &inputs, 1e-3).expect("a legal step");
            }
            solver.restart(&model, &mut state, &inputs, 1e-3).expect("a new history");
        });
        rejected += solver.rejected_steps();
        assert!(requests <= 2, "{colors:?}, {acceleration:?}: {requests} after a jump");
    }
    assert!(rejected > 0, "the guard has had nothing to do");
}
