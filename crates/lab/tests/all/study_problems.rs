//! What settles the open problems, each by a test that turns red without it.

use viscera::material::{Material, MaterialModel};
use viscera::settings::{Acceleration, AndersonGuard, AndersonOn, Count, SolverSettings, Threads};
use viscera_lab::load_cases::{LoadCase, Size, tissue};
use viscera_lab::settling::{Error, compare, settle, truth};
use viscera_lab::stress::{self, FRAMES, Kind, Run};
use viscera_reference::Reference;

fn one_thread(iterations: u32) -> SolverSettings {
    SolverSettings {
        substeps: Count::Of(1),
        iterations: Count::Of(iterations),
        threads: Threads::Count(1),
        ..SolverSettings::xpbd()
    }
}

fn rest(name: &'static str, tissue: Material, settings: &SolverSettings) -> Error {
    let load_case = LoadCase::new(name, Size::Tiny, tissue).expect("a scene");
    let settled = settle::<f64>(&load_case, settings).expect("a rest");
    compare(&load_case, &truth(&load_case).expect("a reference"), &settled.positions)
        .expect("an error")
}

/// Mixed with the same weights, positions and multipliers come where plain sweeps come, sooner; positions
/// alone run ahead of the forces that hold them.
#[test]
fn anderson_mixes_multipliers_with_positions() {
    let tissue = tissue(MaterialModel::SaintVenantKirchhoff, 1e5, 0.45).expect("a tissue");
    let published = SolverSettings {
        rebase: false,
        keep_multipliers: false,
        anderson_guard: AndersonGuard::None,
        ..one_thread(50)
    };
    let stiffness = |settings: &SolverSettings| rest("cantilever", tissue, settings).stiffness;
    let mixed = |anderson_on| {
        let acceleration = Acceleration::Anderson;
        stiffness(&SolverSettings { acceleration, anderson_on, ..published.clone() })
    };
    let [both, positions] = [AndersonOn::Both, AndersonOn::Positions].map(mixed);
    let plain = stiffness(&SolverSettings { iterations: Count::Of(400), ..published.clone() });
    println!("apparent stiffness: plain {plain:.4}, both {both:.4}, positions {positions:.4}");
    assert!((both / plain - 1.0).abs() < 0.1, "on both: {both}, plain: {plain}");
    assert!(positions > 1.5 * plain, "on positions alone: {positions}, plain: {plain}");
}

/// Without a guard that would cover it up: where geometric stiffness exceeds the mass, positions pulled
/// back by the mass alone overshoot.
#[test]
fn the_mass_bound_lets_the_rebase_settle_deformed_bodies() {
    let tissue = tissue(MaterialModel::StableNeoHookean, 1e5, 0.45).expect("a tissue");
    let settings = SolverSettings { step_guard: false, ..one_thread(20) };
    for load_case in ["twist", "grab"] {
        let Error { rms, stiffness, .. } = rest(load_case, tissue, &settings);
        println!("{load_case}: {rms:.1e} from its rest, apparent stiffness {stiffness:.6}");
        assert!(rms < 1e-3, "{load_case}: {rms:e}");
    }
}

/// The incremental potential is computed outside the solver, which is not asked for its own verdict.
#[test]
fn the_step_guard_lets_no_step_raise_the_potential() {
    let tissue = tissue(MaterialModel::StableNeoHookean, 1e4, 0.45).expect("a tissue");
    let load_case = stress::bar(tissue).expect("a bar");
    let guarded = SolverSettings { acceleration: Acceleration::Anderson, ..one_thread(5) };
    let free = SolverSettings { step_guard: false, ..guarded.clone() };
    let steps_above = |settings: &SolverSettings, kind, seed| {
        let mut run = Run::new(&load_case, kind, seed, settings).expect("a run");
        let reference = Reference::new(&run.model);
        let mut above = 0;
        for _ in 0..FRAMES {
            let before = run.state.clone();
            run.step().expect("a step");
            let (x, inputs) = (&run.state.positions, &run.inputs);
            let [start, end] =
                reference.incremental(&before, x, inputs, Run::DT).expect("a potential");
            above += u32::from(end > start * (1.0 + 1e-9));
        }
        assert!(run.state.is_finite());
        above
    };
    for kind in [Kind::Grab, Kind::Scramble] {
        for seed in 0..3 {
            let [with, without] =
                [&guarded, &free].map(|settings| steps_above(settings, kind, seed));
            println!("{kind} {seed}: {with} steps above, {without} without the guard");
            assert_eq!(with, 0, "{kind} {seed}");
            assert!(kind == Kind::Scramble || without > 0, "{kind} {seed}: nothing to guard");
        }
    }
}
