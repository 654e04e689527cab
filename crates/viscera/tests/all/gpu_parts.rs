//! Connected parts on a graphics processor: whatever happens to one, another has the bits that it has in a
//! model of its own, and each is judged as on the CPU.

use crate::common::device::device;
use crate::parts::{Body, DT, Fate, GRAVITY, STEPS, TROUBLES, beam, methods, neighbour, strip};
use viscera::model::{Model, ModelBuilder};
use viscera::settings::{Method, SolverSettings};
use viscera::solver::gpu::GpuSolver;
use viscera::solver::{Inputs, Solver};
use viscera::state::State;

/// What became of a body in a step.
#[derive(Clone, Debug, PartialEq)]
struct Moment {
    /// Positions and velocities; what is no number has no bits that mean anything.
    bits: Vec<u32>,
    /// By the report of its part; potentials may be no numbers, and are compared as text.
    report: String,
}

/// Steps that were taken back for a body: on the CPU and on the device, the latter to a share and by
/// descents.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct TakenBack {
    cpu: u32,
    device: u32,
    shares: u32,
    descents: u32,
}

/// Some bodies in one model on the device; the CPU makes every step as well, from where the device is.
fn run(bodies: &[&Body], settings: &SolverSettings, steps: u32) -> Vec<(Vec<Moment>, TakenBack)> {
    let mut builder = ModelBuilder::new();
    bodies.iter().for_each(|body| body.add(&mut builder));
    let model: Model<f32> = builder.build().expect("a model");
    let mut gpu = GpuSolver::new(device(), &model, settings).expect("a model that fits");
    let mut cpu = Solver::new(&model, settings);
    let mut state = State::at_rest(&model);
    let mut tracks = vec![(Vec::new(), TakenBack::default()); bodies.len()];
    let mut rejected = 0;
    for step in 0..steps {
        let mut inputs = Inputs { gravity: GRAVITY.cast(), ..Inputs::default() };
        for (body, of) in bodies.iter().zip(&model.bodies) {
            let x = &mut state.positions[of.vertices.clone()];
            body.act(of.vertices.start as u32, step, &mut inputs, x);
        }
        gpu.write(&model, &state).expect("a state of this model");
        gpu.step(&model, &inputs, DT).expect("a legal step");
        cpu.step(&model, &mut state, &inputs, DT).expect("a legal step");
        gpu.read(&model, &mut state).expect("a device");
        let reports = gpu.part_reports().expect("a device");
        let searches = gpu.last_searches().expect("a device");
        rejected += u64::from(reports.iter().any(|report| report.rejected));
        assert_eq!(gpu.rejected_steps().expect("a device"), rejected);
        for ((moments, taken_back), of) in tracks.iter_mut().zip(&model.bodies) {
            let x = &state.positions[of.vertices.clone()];
            let v = &state.velocities[of.vertices.clone()];
            let numbers = x.iter().chain(v).flat_map(|x| x.to_array());
            let bits = numbers.map(|x| if x.is_nan() { u32::MAX } else { x.to_bits() }).collect();
            let part = model.part_of(of.vertices.start as u32);
            let report = format!("{:?}", reports.get(part));
            moments.push(Moment { bits, report });
            let Some(report) = reports.get(part) else { continue };
            // What holds no number cannot be mended.
            let is_number = report.limit.is_finite() && report.potential.is_finite();
            assert!(report.keeps_limit() || !is_number, "step {step}: {report:?}");
            taken_back.device += u32::from(report.rejected);
            taken_back.cpu += u32::from(cpu.part_reports()[part].rejected);
            let [share, descends] = searches[part];
            taken_back.shares += u32::from(report.rejected && share > 0.0);
            taken_back.descents += u32::from(report.rejected && descends > 0.0);
        }
    }
    tracks
}

fn assert_same(given: &[Moment], alone: &[Moment], what: &str) {
    for (step, (given, alone)) in given.iter().zip(alone).enumerate() {
        let differing = given.bits.iter().zip(&alone.bits).filter(|(a, b)| a != b).count();
        assert_eq!(differing, 0, "step {step}: numbers that differ from those alone; {what}");
        assert_eq!(given.report, alone.report, "step {step}, {what}");
    }
}

/// A quiet body beside others in trouble, behind them and before them, for so many steps. Returns how often
/// steps of these were taken back.
fn assert_quiet_is_left_alone(
    name: &str,
    settings: &SolverSettings,
    fates: &[Fate],
    steps: u32,
) -> Vec<TakenBack> {
    let quiet = beam(Fate::Quiet);
    let [(alone, taken_back)] = &run(&[&quiet], settings, steps)[..] else { panic!("one body") };
    assert_eq!(taken_back.device, taken_back.cpu, "{name}: the quiet body");
    let mut all = Vec::new();
    for &fate in fates {
        let troubled = neighbour(fate);
        let bodies = if fate == Fate::Overflow { [&quiet, &troubled] } else { [&troubled, &quiet] };
        for (body, (moments, taken_back)) in bodies.into_iter().zip(run(&bodies, settings, steps)) {
            if body.fate == Fate::Quiet {
                assert_same(&moments, alone, &format!("{name}, beside {fate:?}"));
            } else {
                println!("{name}, {fate:?}: {taken_back:?}");
                all.push(taken_back);
            }
        }
    }
    all
}

/// By shares and by descents, and where the CPU does.
#[test]
fn a_body_beside_one_in_trouble_has_the_bits_it_has_alone_on_a_device() {
    let settings = SolverSettings::xpbd();
    let taken_back = assert_quiet_is_left_alone("coloured", &settings, &TROUBLES, 11);
    assert!(taken_back.iter().all(|body| body.device > 0 && body.device == body.cpu));
    assert!(taken_back[0].shares > 0 && taken_back[0].descents > 0, "{taken_back:?}");
}

#[test]
fn no_method_lets_trouble_spread_on_a_device() {
    let mut all = 0;
    let chosen = [
        "Jacobi",
        "4 colours",
        "clusters",
        "Chebyshev",
        "Anderson",
        "Anderson by energy",
        "explicit",
    ];
    for (name, settings) in methods().into_iter().filter(|(name, _)| chosen.contains(name)) {
        let fate = if name == "Jacobi" { Fate::NoNumber } else { Fate::Thrown };
        for body in assert_quiet_is_left_alone(name, &settings, &[fate], 6) {
            assert_eq!(body.device, body.cpu, "{name}");
            all += body.device;
        }
    }
    assert!(all > 0, "nothing is taken back");
}

#[test]
#[ignore = "slow: every method and every trouble"]
fn no_method_lets_trouble_spread_on_a_device_at_length() {
    // Quasi-Newton steps are computed by the CPU.
    let on_device = |(_, settings): &(_, SolverSettings)| settings.method != Method::QuasiNewton;
    for (name, settings) in methods().into_iter().filter(on_device) {
        assert_quiet_is_left_alone(name, &settings, &TROUBLES, STEPS);
    }
}

/// A row of tetrahedra needs no copies, where its neighbour does; each is swept as it would be alone.
#[test]
fn a_body_without_copies_beside_one_with_copies_has_the_bits_it_has_alone_on_a_device() {
    let (row, bar) = (strip(Fate::Quiet), neighbour(Fate::Quiet));
    for (name, settings) in methods() {
        if !["5 colours", "Jacobi"].contains(&name) {
            continue;
        }
        let together = run(&[&bar, &row], &settings, 4);
        assert_same(&together[1].0, &run(&[&row], &settings, 4)[0].0, name);
        assert_same(&together[0].0, &run(&[&bar], &settings, 4)[0].0, name);
    }
}
