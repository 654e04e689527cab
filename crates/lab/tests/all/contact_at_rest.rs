//! The library at rest under a ball beside the reference, with the same law of contact; and a block on a plane, at rest,
//! sliding, and step by step.

use viscera::contact::ContactLaw;
use viscera::material::{Material, MaterialModel};
use viscera::scalar::vec3;
use viscera::settings::{Count, Integrator, Method, SolverSettings};
use viscera::solver::Solver;
use viscera::state::State;
use viscera_lab::contact_cases::{Held, Pressed, Pressing, Sliding, Way};
use viscera_reference::Reference;

fn soft(young: f64, poisson: f64) -> Material {
    Material::new(MaterialModel::StableNeoHookean, young, poisson, 1000.0).expect("a material")
}

/// Forces within 0.1 % of the reference's, shapes within 0.01 % of the largest displacement, and forces by two methods
/// within 0.2 % of each other.
fn assert_rests(cells: [usize; 3], youngs: &[f64], ways: &[Way]) {
    for &young in youngs {
        let mut pressing =
            Pressing::on_block(cells, 0.005, 0.015, soft(young, 0.45)).expect("a block");
        pressing.depth = 4e-3;
        let truth = pressing.truth().expect("a state of rest");
        let mut forces = Vec::new();
        for way in ways {
            let rest = pressing.settle(way).expect("steps");
            let force = rest.force() / truth.force();
            let shape = pressing.shape_error(&truth, &rest);
            println!(
                "{young:e} Pa, {way}: force off by {:.1e}, shape by {shape:.1e}, {} rejected",
                force - 1.0,
                rest.effort
            );
            assert!((force - 1.0).abs() < 1e-3, "{young:e} Pa, {way}: {force}");
            assert!(shape < 1e-4, "{young:e} Pa, {way}: {shape:e}");
            assert_eq!(rest.wrench.touches, truth.wrench.touches, "{young:e} Pa, {way}");
            let torque = (rest.wrench.torque - truth.wrench.torque).length();
            assert!(torque < 1e-3 * truth.force() * pressing.radius, "{young:e} Pa, {way}");
            forces.push(force);
        }
        let most = forces.iter().copied().fold(0.0, f64::max);
        let least = forces.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(most - least < 2e-3, "{young:e} Pa: {least} to {most}");
    }
}

#[test]
fn every_method_rests_under_a_ball_as_newtons() {
    let ways = [Method::Xpbd, Method::QuasiNewton, Method::Explicit].map(Way::of);
    let single = ways[1].in_single();
    assert_rests([4, 4, 2], &[1e4], &[ways[0], ways[1], ways[2], single]);
}

#[test]
#[ignore = "slow: stiff tissue, and a finer block in both precisions"]
fn every_method_rests_under_a_ball_as_newtons_at_length() {
    let ways = [Method::Xpbd, Method::QuasiNewton, Method::Explicit].map(Way::of);
    let all: Vec<_> = ways.into_iter().chain(ways.map(Way::in_single)).collect();
    assert_rests([8, 8, 4], &[1e4, 1e5], &all);
}

fn incline(degrees: f64) -> Sliding {
    let law = ContactLaw { friction: 0.5, ..ContactLaw::default() };
    Sliding {
        size: vec3(0.02, 0.02, 0.01),
        cells: [2, 2, 1],
        // Without any viscosity an elastic block flutters.
        tissue: soft(1e4, 0.45).with_viscosity(5e-3).expect("a viscosity"),
        law,
        angle: 0.5f64.atan() + degrees.to_radians(),
        frames: 36,
    }
}

#[test]
fn a_block_holds_below_the_angle_of_friction_and_slides_above() {
    let ways = [Way::of(Method::QuasiNewton), Way::of(Method::Explicit)];
    let holding = incline(-0.3);
    let truth = holding.truth(1).expect("steps");
    assert!(truth.way.abs() < 1e-8, "the reference: {truth:?}");
    let sliding = incline(5.0);
    let truth = sliding.truth(1).expect("steps");
    assert!((truth.acceleration / sliding.exact() - 1.0).abs() < 1e-3, "{truth:?}");
    assert!((truth.ratio - 0.5).abs() < 1e-3, "{truth:?}");
    for way in ways {
        let rest = holding.slide(&way).expect("steps");
        println!("{way}: {rest:?}");
        assert!(rest.way.abs() < 1e-6, "{way}: {rest:?}");
        let slide = sliding.slide(&way).expect("steps");
        println!("{way}: {slide:?}, exact {}", sliding.exact());
        assert!((slide.acceleration / sliding.exact() - 1.0).abs() < 0.01, "{way}: {slide:?}");
        assert!((slide.ratio - 0.5).abs() < 0.005, "{way}: {slide:?}");
    }
}

/// Steps of implicit Euler that are solved to the end are the reference's, with the anchors and normal forces that each
/// step leaves to the next: while gravity turns samples stick, then slide one after the other. A plane is its own tangent
/// plane, so that touch planes make no difference.
#[test]
fn converged_steps_with_friction_are_newtons() {
    let scene = incline(8.0);
    let model = scene.model::<f64>().expect("a model");
    let settings = SolverSettings {
        method: Method::QuasiNewton,
        integrator: Integrator::ImplicitEuler,
        substeps: Count::Of(1),
        iterations: Count::Of(600),
        history: 10,
        ..SolverSettings::xpbd()
    };
    let mut solver = Solver::new(&model, &settings);
    let mut reference = Reference::new(&model);
    let (mut ours, mut exact) = (State::at_rest(&model), State::at_rest(&model));
    let mut touched = Vec::new();
    let dt = 1.0 / 60.0;
    let (mut largest, mut slid) = (0.0f64, 0);
    for step in 1..=60 {
        let inputs = scene.inputs(f64::from(step) / 30.0);
        solver.step(&model, &mut ours, &inputs, dt).expect("a step");
        reference.step_touching(&mut exact, &inputs, &touched, dt).expect("a step");
        let wrench = reference.wrenches(&exact.positions, &inputs, &touched).expect("legal")[0];
        let after = reference.touched_after(&exact.positions, &inputs, &touched).expect("legal");
        let error = (ours.positions.iter().zip(&exact.positions))
            .map(|(a, b)| (*a - *b).length())
            .fold(0.0, f64::max);
        // Both go on from their own last step: errors add up along the way.
        let way = (exact.positions.iter().zip(&model.rest_positions))
            .map(|(a, b)| (*a - *b).length())
            .fold(0.0, f64::max);
        let difference = (solver.wrenches()[0].force - wrench.force).length();
        let weight = 9.81 * model.masses.iter().sum::<f64>();
        assert!(error < 3e-6 * way, "step {step}: {error:e} m of {way:e} m");
        assert!(difference < 1e-5 * weight, "step {step}: {difference:e} N of {weight:e} N");
        assert_eq!(ours.contact.touches.len(), after.len(), "step {step}");
        for theirs in &after {
            let is_same = |touch: &&viscera::contact::Touch| touch.sample == theirs.sample;
            let touch = ours.contact.touches.iter().find(is_same).expect("the same samples");
            assert!((touch.anchor - theirs.anchor).length() < 5e-6 * way, "step {step}");
        }
        let moves =
            touched.iter().zip(&after).filter(|(a, b)| (a.anchor - b.anchor).length() > 1e-6);
        slid = slid.max(moves.count());
        (touched, largest) = (after, largest.max(error / way));
    }
    println!(
        "off by {largest:.1e} of the way at most; up to {slid} of {} samples slide",
        touched.len()
    );
    assert!(slid > 10);
}

/// A block that meets its mirror image is at rest as it is on the plane between the two, which the reference has as a tool.
fn assert_mirrored(cells: usize, held: Held, ways: &[Way]) {
    let pressed = Pressed::mirrored(cells, held, 1e4, 4e-3).expect("two blocks");
    let truth = pressed.truth().expect("a state of rest");
    for way in ways {
        let ours = pressed.settle(way).expect("steps");
        let shape = pressed.shape_error(&truth, &ours);
        let [lower, upper] = ours.forces;
        let force = lower / truth.forces[0] - 1.0;
        println!(
            "{held:?}, {way}: {:.4} N, off by {force:.1e}, holders by {:.1e}, shape by {shape:.1e}",
            truth.forces[0],
            upper / lower - 1.0
        );
        // Surfaces tilted by less than a tenth: half of its square.
        assert!(force.abs() < 5e-3 && shape < 5e-3, "{held:?}, {way}: {force:e}, {shape:e}");
        assert!((upper / lower - 1.0).abs() < 1e-4, "{held:?}, {way}: {lower} and {upper}");
    }
}

#[test]
fn tissue_on_tissue_rests_as_on_the_plane_between() {
    assert_mirrored(3, Held::Middle, &[Way::of(Method::QuasiNewton)]);
}

#[test]
#[ignore = "slow: finer blocks"]
fn tissue_on_tissue_rests_as_on_the_plane_between_at_length() {
    assert_mirrored(4, Held::Middle, &[Way::of(Method::QuasiNewton)]);
}
