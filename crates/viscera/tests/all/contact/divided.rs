//! Explicit motion under tools is the same however a frame is divided: friction, planes and work are those of small steps.

use viscera::contact::{Shape, Tool};
use viscera::scalar::rigid::{RigidTransform, rotation_matrix};
use viscera::scalar::{Vec3, vec3};
use viscera::solver::Inputs;

use super::{Block, Scene, method, ramp};

/// Forces [N] on a tool that goes to a place at a time [s], at the ends of frames of explicit steps in so many parts.
fn forces(
    block: &Block,
    held: fn(Vec3<f64>) -> bool,
    tool: Tool,
    place: fn(f64) -> Vec3<f64>,
    parts: u32,
) -> Vec<Vec3<f64>> {
    let inputs = Inputs { pins: block.pins(held), tools: vec![tool], ..Inputs::default() };
    let mut scene = Scene::<f64>::with(block, &method("explicit").0, parts, inputs);
    let frame = |_| {
        scene.run(1.0 / 60.0, |time, tools| tools[0].pose.translation = place(time));
        scene.force(0)
    };
    (0..30).map(frame).collect()
}

fn differ(a: &[Vec3<f64>], b: &[Vec3<f64>]) -> f64 {
    let largest = b.iter().map(|force| force.length()).fold(0.0, f64::max);
    let apart = a.iter().zip(b).map(|(a, b)| (*a - *b).length());
    apart.fold(0.0, f64::max) / largest
}

/// A ball goes by its radius in ten frames: a plane that stood still in a frame would be a different tool.
#[test]
fn a_ball_that_rubs_meets_the_same_force_in_frames_of_any_parts() {
    let block = Block::new([0.04, 0.03, 0.012], [8, 6, 3], [5e3, 0.45, 0.005]);
    let mut ball = Tool::new(Shape::Sphere { radius: 0.006 });
    ball.law.friction = 0.5;
    // Keys at ends of frames: in between the ball moves steadily whatever the parts.
    let place = |time: f64| {
        let frames = 60.0 * time;
        let [down, aside] = [ramp(frames, 0.0, 8.0), ramp(frames, 8.0, 24.0)];
        vec3(-0.006 + 0.0096 * aside, 0.001, 0.0195 - 0.0045 * down)
    };
    let of = |parts| forces(&block, |x| x.z < 1e-6, ball.clone(), place, parts);
    let (whole, divided) = (of(1), of(16));
    let apart = differ(&whole, &divided);
    // A small step is a thousandth of a frame, and forces change by up to a tenth in a frame.
    assert!(apart < 2e-3, "{apart}");
}

/// A blade meets a beam at rest in the middle of a frame: what it gives by rubbing is no energy of nothing.
#[test]
fn a_blade_that_meets_a_beam_meets_the_same_force_in_frames_of_any_parts() {
    let block = Block::new([0.08, 0.02, 0.016], [10, 3, 2], [5e3, 0.45, 0.01]);
    let shape = Shape::RoundedBox { half: vec3(0.004, 0.015, 0.002), radius: 0.002 };
    let mut blade = Tool::new(shape);
    let rotation = rotation_matrix(vec3(0.0, 0.1, 0.0));
    blade.pose = RigidTransform { rotation, translation: Vec3::ZERO };
    let place = |time: f64| vec3(0.03, 0.0, -0.010 + 0.02 * ramp(60.0 * time, 0.0, 20.0));
    let of = |parts| forces(&block, |x| x.x < -0.04 + 1e-6, blade.clone(), place, parts);
    let (whole, divided) = (of(2), of(16));
    let apart = differ(&whole, &divided);
    assert!(apart < 0.01, "{apart}");
}
