//! Clusters of tetrahedra on a graphics processor: one workgroup sweeps over each.

use crate::clusters::{apart, bar, clustered, hanging, rest};
use crate::common::device::{device, device_within, everything};
use crate::common::{SNH, STVK, block, exact, material, single_body};
use crate::gpu::{BRIEF, LONG, Length, assert_agreement, bits};
use viscera::mesh::shapes::Splitting;
use viscera::model::Model;
use viscera::scalar::Vec3;
use viscera::settings::{Acceleration, Clusters, Colors, Count, NeoHookean, SolverSettings};
use viscera::solver::Solver;
use viscera::solver::gpu::{GpuError, GpuSolver, baseline};
use viscera::state::State;

/// The aim: 28 dispatches a substep of the defaults, whatever the size of a large mesh; before, 90 and more.
#[test]
fn a_default_substep_of_a_hundred_thousand_tetrahedra_is_26_dispatches() {
    for (splitting, cells, before) in [(Splitting::Five, 17, 90), (Splitting::Six, 16, 70)] {
        let model = single_body::<f32>(&bar(cells, splitting), &material(SNH, 1e4, 0.4));
        let of_step = |settings: &SolverSettings| {
            let [first, each, last] = GpuSolver::dispatches_of(&model, settings);
            first + each * settings.iterations() as usize + last
        };
        let [colors, clusters] = [SolverSettings::xpbd(), clustered(512)].map(|s| of_step(&s));
        println!("{} tetrahedra: {colors} dispatches, {clusters} by clusters", model.tet_count());
        assert!(colors > before && clusters == 26, "{colors} and {clusters}");
    }
    // One cluster: one dispatch a sweep.
    let small =
        single_body::<f32>(&block([0.1, 0.05, 0.05], [6, 3, 3], 0.1), &material(SNH, 1e4, 0.4));
    let [_, each, _] = GpuSolver::dispatches_of(&small, &clustered(512));
    assert_eq!(each, 3, "loads, rebase, one cluster");
}

/// As exact at rest, as published, every form, over-relaxed, accelerated.
fn assert_clusters_agree(length: impl Fn(&str) -> Length) {
    let plain = SolverSettings { step_guard: false, iterations: Count::Of(3), ..clustered(24) };
    let published = SolverSettings { rebase: false, keep_multipliers: false, ..plain.clone() };
    let pair = SolverSettings { neo_hookean: NeoHookean::Pair, ..plain.clone() };
    let relaxed = SolverSettings { relaxation: 0.9, ..published.clone() };
    let anderson = SolverSettings { acceleration: Acceleration::Anderson, ..plain.clone() };
    for (name, settings) in [
        ("exact", plain),
        ("published", published),
        ("pair", pair),
        ("relaxed", relaxed),
        ("Anderson", anderson),
        ("guarded", clustered(24)),
        ("one cluster", clustered(512)),
    ] {
        assert_agreement(name, &settings, length(name));
    }
}

#[test]
fn clusters_agree_with_the_cpu() {
    assert_clusters_agree(|_| BRIEF);
}

#[test]
#[ignore = "slow: thirty steps in seven ways"]
fn clusters_agree_with_the_cpu_at_length() {
    assert_clusters_agree(|_| LONG);
}

/// The largest distance of the device from the CPU [m] after some steps of a hanging bar, and how far it has moved.
fn distance(model: &Model<f32>, settings: &SolverSettings, steps: u32) -> [f64; 2] {
    let inputs = hanging(model);
    let mut cpu = Solver::new(model, settings);
    let mut gpu = GpuSolver::new(device(), model, settings).expect("a model that fits");
    let mut state = State::at_rest(model);
    for _ in 0..steps {
        cpu.step(model, &mut state, &inputs, 1.0 / 600.0).expect("a legal step");
        gpu.step(model, &inputs, 1.0 / 600.0).expect("a legal step");
    }
    let mut read = State::at_rest(model);
    gpu.read(model, &mut read).expect("a device");
    let double = |x: &[Vec3<f32>]| x.iter().map(|x| x.cast::<f64>()).collect::<Vec<_>>();
    let places = double(&state.positions);
    [apart(&double(&read.positions), &places), apart(&places, &double(&model.rest_positions))]
}

/// More vertices and more tetrahedra of a colour than threads, and more clusters than colours.
#[test]
fn large_clusters_and_many_agree_with_the_cpu() {
    let viscous = material(SNH, 2e4, 0.4).with_viscosity(0.02).expect("legal");
    let model = single_body::<f32>(&block([0.1, 0.05, 0.05], [12, 6, 6], 0.1), &viscous);
    for size in [100, 512, 4096] {
        let [apart, moved] = distance(&model, &clustered(size), 3);
        println!("{size}: {apart:.1e} m apart of {moved:.1e} m");
        // Round-off of places a tenth of a metre from the origin.
        assert!(moved > 1e-4 && apart < 8.0 * 0.1 * f64::from(f32::EPSILON), "{size}: {apart:e}");
    }
}

/// A few steps for a second, slower driver.
#[test]
fn portable_clusters_agree_with_the_cpu() {
    let model =
        single_body::<f32>(&block([0.1, 0.04, 0.04], [5, 2, 2], 0.1), &material(STVK, 2e4, 0.3));
    let settings = SolverSettings { step_guard: false, ..clustered(40) };
    let [apart, moved] = distance(&model, &settings, 2);
    println!("{apart:.1e} m apart of {moved:.1e} m");
    assert!(moved > 5e-5 && apart < 4.0 * 0.1 * f64::from(f32::EPSILON), "{apart:e} of {moved:e}");
}

#[test]
fn a_device_comes_to_the_rest_of_one_level_of_colors() {
    let (mesh, tissue) = (block([0.1, 0.04, 0.04], [4, 2, 2], 0.1), material(SNH, 2e4, 0.4));
    let (known, sag) = rest(&single_body::<f64>(&mesh, &tissue), &exact(5));
    let model = single_body::<f32>(&mesh, &tissue);
    let settings = SolverSettings { clusters: Clusters::OfTets(30), ..exact(5) };
    let inputs = hanging(&model);
    let mut gpu = GpuSolver::new(device(), &model, &settings).expect("a model that fits");
    let mut state = State::at_rest(&model);
    for _ in 0..150 {
        gpu.step(&model, &inputs, 1.0 / 60.0).expect("a legal step");
        gpu.read(&model, &mut state).expect("a device");
        state.velocities.iter_mut().for_each(|v| *v = *v * 0.8);
        gpu.write(&model, &state).expect("a state that fits");
    }
    let places: Vec<_> = state.positions.iter().map(|x| x.cast::<f64>()).collect();
    let error = apart(&places, &known) / sag;
    println!("sag {sag:.4} m, of it apart {error:.1e}");
    assert!(sag > 1e-3 && error < 1e-4, "{error:e}");
}

/// Whatever the memory of the device held before.
#[test]
fn clusters_give_the_same_bits_again() {
    let (model, settings) = (everything(), clustered(24));
    let run = |left_over: f32| {
        let gpu = GpuSolver::on_used_memory(device(), &model, &settings, left_over);
        bits(&model, &mut gpu.expect("a model that fits"), 4)
    };
    let first = run(0.0);
    assert!([f32::NAN, 1e9, 0.0].into_iter().all(|left_over| run(left_over) == first));
}

#[test]
fn clusters_keep_to_the_baseline_and_to_unlimited_colors() {
    let (model, settings) = (everything(), clustered(64));
    let mut gpu = GpuSolver::new(&device_within(baseline()), &model, &settings).expect("a model");
    bits(&model, &mut gpu, 1);
    let limited = SolverSettings { colors: Colors::Limited(4), ..settings };
    let error = GpuSolver::new(device(), &model, &limited).expect_err("copies");
    assert!(
        matches!(error, GpuError::Step(_)) && error.to_string().contains("clusters = "),
        "{error}"
    );
}
