//! The library at rest under a ball beside the reference, with the same law of contact; and a block on a plane.

use viscera::contact::ContactLaw;
use viscera::material::{Material, MaterialModel};
use viscera::scalar::vec3;
use viscera::settings::Method;
use viscera_lab::contact_cases::{Pressing, Sliding, Way};

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
        tissue: soft(1e4, 0.45),
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
