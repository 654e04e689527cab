//! Closed surfaces as tools: the forces of the shapes that they are, and gaps that stay open.

use std::sync::Arc;

use viscera::contact::{DistanceGrid, Shape, Tool};
use viscera::mesh::SurfaceMesh;
use viscera::mesh::shapes::{lofted, turned};
use viscera::scalar::rigid::RigidTransform;
use viscera::scalar::{Vec3, vec3};
use viscera::solver::Inputs;
use viscera::state::ContactState;

use super::{Block, Scene, ramp};

/// Quarters of circles are cut in so many: a thousandth of the radius within.
const STEPS: u32 = 36;

/// Triangles of a sphere, a capsule or a rounded box, inscribed.
pub fn surface(shape: &Shape) -> SurfaceMesh {
    let quarter = |step: u32| {
        let (sin, cos) =
            libm::sincos(0.5 * std::f64::consts::PI * f64::from(step) / f64::from(STEPS));
        if step == STEPS { [0.0, 1.0] } else { [cos, sin] }
    };
    match *shape {
        Shape::Sphere { radius } => surface(&Shape::Capsule { length: 0.0, radius }),
        Shape::Capsule { length, radius } => {
            let lower = (0..=STEPS).rev().map(&quarter).map(|[cos, sin]| [cos, -sin]);
            let upper = (u32::from(length == 0.0)..=STEPS).map(quarter);
            let lower = lower.map(|[across, along]| [radius * across, radius * along]);
            let upper = upper.map(|[across, along]| [radius * across, length + radius * along]);
            turned(&lower.chain(upper).collect::<Vec<_>>(), 4 * STEPS)
        }
        Shape::RoundedBox { half, radius } => {
            let core = half - Vec3::splat(radius);
            let section = |height: f64, radius: f64| -> Vec<Vec3<f64>> {
                let around = (0..4).flat_map(|turns| (0..=8).map(move |step| (turns, step)));
                around
                    .map(|(turns, step)| {
                        let angle =
                            0.5 * std::f64::consts::PI * (f64::from(turns) + f64::from(step) / 8.0);
                        let (sin, cos) = libm::sincos(angle);
                        let right = if turns == 0 || turns == 3 { core.x } else { -core.x };
                        let back = if turns < 2 { core.y } else { -core.y };
                        vec3(right + radius * cos, back + radius * sin, height)
                    })
                    .collect()
            };
            let of = |side: f64, step: u32| {
                let [cos, sin] = quarter(step);
                section(side * (core.z + radius * sin), radius * cos)
            };
            let lower = (0..=STEPS).rev().step_by(4).map(|step| of(-1.0, step));
            lofted(
                &lower.chain((0..=STEPS).step_by(4).map(|step| of(1.0, step))).collect::<Vec<_>>(),
            )
        }
        _ => panic!("no surface"),
    }
}

fn mesh(surface: &SurfaceMesh) -> Shape {
    Shape::Mesh(Arc::new(DistanceGrid::new(surface, 1e-3).expect("a solid")))
}

/// The force [N] of a tool that is pressed 4 mm into tissue of 7 kPa, at rest. Turned by a vector, its lowest point is so
/// far below its origin [m].
fn pressed(name: &str, shape: Shape, (turn, low): (Vec3<f64>, f64)) -> Scene<f64> {
    let block = Block::new([0.06, 0.06, 0.03], [10, 10, 5], [7e3, 0.45, 0.01]);
    let mut tool = Tool::new(shape);
    tool.law.friction = 0.0;
    let inputs = Inputs { pins: block.fixed_below(), tools: vec![tool], ..Inputs::default() };
    let mut scene = Scene::<f64>::new(&block, name, inputs);
    scene.run(1.2, |time, tools| {
        let height = 0.031 + low - 0.005 * ramp(time, 0.0, 0.1);
        tools[0].pose = RigidTransform::about(Vec3::ZERO, turn, vec3(0.0, 0.0, height));
    });
    scene
}

/// Names, shapes, how they are turned, and how far their lowest point is then below the origin [m].
/// Its name, the shape itself, where it goes down [m] and how deep [m].
type Case = (&'static str, Shape, (Vec3<f64>, f64));

fn shapes() -> [Case; 3] {
    let half = vec3(0.008, 0.006, 0.004);
    [
        ("sphere", Shape::Sphere { radius: 8e-3 }, (vec3(0.3, 0.2, 0.1), 8e-3)),
        ("capsule", Shape::Capsule { length: 0.03, radius: 4e-3 }, (vec3(0.5, 0.0, 0.3), 4e-3)),
        ("box", Shape::RoundedBox { half, radius: 2e-3 }, (vec3(0.0, 0.0, 0.4), 4e-3)),
    ]
}

fn compare(name: &str, shapes: &[Case]) {
    for (what, shape, place) in shapes {
        let truth = pressed(name, shape.clone(), *place);
        let ours = pressed(name, mesh(&surface(shape)), *place);
        let [truth_force, force] = [&truth, &ours].map(|scene| scene.force(0));
        let off = (force - truth_force).length() / truth_force.length();
        let [of_truth, rejected] = [&truth, &ours]
            .map(|scene| scene.solver.rejected_steps() as f64 / f64::from(scene.steps));
        println!(
            "{name}, {what}: {:.5} N, as a mesh {:.5} N, {:.2} % off, {rejected:.3} of its steps rejected, {of_truth:.3}",
            truth_force.z,
            force.z,
            1e2 * off
        );
        assert!(truth_force.z > 0.05 && off < 0.01, "{name}, {what}: {off}");
        assert!(rejected < of_truth + 0.1, "{name}, {what}: {rejected}");
    }
}

/// At cells of half of the contact's thickness, in tissue of 7 kPa.
#[test]
fn a_mesh_meets_the_force_of_the_shape_that_it_is() {
    compare("quasi_newton", &shapes()[1..2]);
    compare("xpbd", &shapes()[..1]);
}

#[test]
#[ignore = "slow: three shapes, each with three methods, twice"]
fn a_mesh_meets_the_force_of_the_shape_that_it_is_at_length() {
    for name in super::METHODS {
        compare(name, &shapes());
    }
}

/// Two prongs of 4 x 4 mm along -z, 24 mm long and 12 mm apart, which are one above: a U upside down.
fn fork() -> SurfaceMesh {
    let turns = 12;
    let section = |middle: Vec3<f64>, out: Vec3<f64>| {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(a, b)| middle + out * (2e-3 * a) + vec3(0.0, 2e-3 * b, 0.0))
            .to_vec()
    };
    let mut sections = vec![section(vec3(8e-3, 0.0, -0.024), vec3(1.0, 0.0, 0.0))];
    for turn in 0..=turns {
        let (sin, cos) = libm::sincos(std::f64::consts::PI * f64::from(turn) / f64::from(turns));
        let out = vec3(cos, 0.0, sin);
        sections.push(section(out * 8e-3, out));
    }
    sections.push(section(vec3(-8e-3, 0.0, -0.024), vec3(-1.0, 0.0, 0.0)));
    lofted(&sections)
}

/// A strip of tissue stands between the prongs: it feels nothing, however fast they come, until one of them is there.
#[test]
fn between_the_prongs_of_a_fork_there_is_no_wall() {
    let block = Block::new([0.006, 0.02, 0.03], [2, 6, 9], [7e3, 0.45, 0.01]);
    let mut tool = Tool::new(mesh(&fork()));
    tool.law.friction = 0.3;
    // From 20 mm above, where no prong is, to 15 mm deep around it; and then 3 mm aside, against it.
    for (name, time) in [("quasi_newton", 0.1), ("xpbd", 0.02)] {
        let inputs =
            Inputs { pins: block.fixed_below(), tools: vec![tool.clone()], ..Inputs::default() };
        let mut scene = Scene::<f64>::new(&block, name, inputs);
        let mut most = 0.0_f64;
        let place = |now: f64| {
            let (down, aside) = (ramp(now, 0.0, time), ramp(now, 0.2, 0.4));
            vec3(4e-3 * aside, 0.0, 0.075 - 0.036 * down)
        };
        while f64::from(scene.steps) * scene.dt < 0.18 {
            let dt = scene.dt;
            step(&mut scene, dt, place);
            most = most.max(scene.force(0).length());
        }
        assert!(scene.state.is_finite());
        assert_eq!(most, 0.0, "{name}: there is a wall");
        while f64::from(scene.steps) * scene.dt < 0.5 {
            let dt = scene.dt;
            step(&mut scene, dt, place);
        }
        let force = scene.force(0);
        assert!(force.x < -1e-3 && force.x.abs() > 2.0 * force.z.abs(), "{name}: {force:?}");
    }
}

fn step(scene: &mut Scene<f64>, dt: f64, place: impl Fn(f64) -> Vec3<f64>) {
    if scene.steps == 0 {
        scene.inputs.tools[0].pose.translation = place(0.0);
        scene.state.contact = ContactState::of(&scene.inputs.tools);
    }
    scene.steps += 1;
    scene.inputs.tools[0].pose.translation = place(f64::from(scene.steps) * dt);
    let Scene { model, state, solver, inputs, .. } = scene;
    solver.step(model, state, inputs, dt).expect("a step");
}
