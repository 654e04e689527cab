//! What forces on tools are said to be off by, against the same scene in many small steps.

use viscera::scalar::{Vec3, vec3};
use viscera::scene::Scene;
use viscera::simulation::{Assembly, Simulation, ToolForce};

/// A ball is pressed into a viscous block at 40 mm/s and pulled aside.
const RUB: &str = r#"
world = { gravity = 0 }
time = { duration = "0.5 s" }
solver = { method = "quasi_newton", elements = "plain" }

[[body]]
name = "block"
shape = "block"
size = ["40 mm", "30 mm", "15 mm"]
cells = [8, 6, 3]
material = { young = "5 kPa", poisson = 0.45, viscosity = "10 ms" }

[[fixing]]
name = "table"
body = "block"
half_space = { point = [0, 0, 0], normal = [0, 0, -1] }

[[tool]]
name = "ball"
kind = "sphere"
radius = "6 mm"
position = ["12 mm", "14 mm", "22.5 mm"]
interpolation = "linear"
keys = [
    { time = "0.15 s", translation = [0, 0, "-5 mm"] },
    { time = "0.35 s", translation = ["10 mm", "2 mm", "-5 mm"] },
]
"#;

fn simulation(settings: &[(&str, &str)]) -> Simulation<f64> {
    let scene = Scene::parse("rub.toml", RUB, settings).unwrap_or_else(|e| panic!("{e}"));
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned()));
    Simulation::new(scene, assembly.unwrap_or_else(|e| panic!("{e}"))).expect("a simulation")
}

/// The ball's forces, frame by frame.
fn course(settings: &[(&str, &str)]) -> Vec<ToolForce> {
    let mut run = simulation(settings);
    assert!(run.report().tools[0].error.is_none());
    let frame = |_| {
        run.advance_frame().expect("a frame");
        run.report().tools[0].clone()
    };
    (0..30).map(frame).collect()
}

fn off(a: &ToolForce, b: &ToolForce) -> f64 {
    let force = |tool: &ToolForce| -> Vec3<f64> { Vec3::from_f64(tool.force) };
    (force(a) - force(b)).length()
}

/// Friction and quick motion, by every method: at most one frame in twenty is off by more than it is said to be, and what is
/// said is of the size of what is true.
#[test]
fn forces_are_off_by_no_more_than_they_are_said_to_be() {
    let fine =
        [("solver.method", "explicit"), ("solver.substeps", "16"), ("output.force_error", "false")];
    let truth = course(&fine);
    assert!(truth.iter().all(|tool| tool.error.is_none() && tool.torque_error.is_none()));
    let peak = truth.iter().map(|tool| off(tool, &ToolForce { force: [0.0; 3], ..tool.clone() }));
    let peak = peak.fold(0.0, f64::max);
    for settings in [
        &[][..],
        &[("solver.substeps", "1")],
        &[("solver.method", "xpbd"), ("solver.substeps", "4"), ("solver.iterations", "5")],
        &[("solver.method", "explicit")],
    ] {
        let course = course(settings);
        let said: Vec<f64> = course.iter().map(|tool| tool.error.expect("asked for")).collect();
        let true_ones = course.iter().zip(&truth).map(|(a, b)| off(a, b));
        // The truth's own tools move steadily in a sixteenth of a frame.
        let own = 2e-4 * peak;
        let within = true_ones.clone().zip(&said).filter(|(off, said)| *off <= **said + own);
        assert!(within.count() >= 28, "{settings:?}");
        let mut ratios: Vec<f64> =
            true_ones.zip(&said).map(|(off, said)| said / (off + own)).collect();
        ratios.sort_by(f64::total_cmp);
        assert!((0.1..8.0).contains(&ratios[15]), "{settings:?}: {ratios:?}");
        assert!(course[20].torque_error.is_some_and(|error| error > 0.0));
    }
}

/// The run beside is no part of the scene: whoever computes it, and whether it is there, the bits are the same.
#[test]
fn the_run_beside_changes_nothing() {
    let of = |settings: &[(&str, &str)]| {
        let mut run = simulation(settings);
        for _ in 0..20 {
            run.advance_frame().expect("a frame");
        }
        (run.save(), run.report().tools[0].clone())
    };
    let [alone, by_thread] = [("solver.threads", "1"), ("solver.threads", "2")].map(|at| of(&[at]));
    assert_eq!(alone.1, by_thread.1);
    let without = of(&[("output.force_error", "false")]);
    assert_eq!(without.1.force, alone.1.force);
    assert!(without.1.error.is_none() && alone.1.error.is_some());
}

/// A jump further than a tool moves in a step is reported, also where it is not in the last substep of a frame.
#[test]
fn a_tool_that_is_put_elsewhere_says_so() {
    let path = "[{ time = \"0.1 s\", translation = [0, 0, 0] }, \
                { time = \"0.11 s\", translation = [\"1 m\", 0, 0] }]";
    let course = course(&[("tool.ball.keys", path)]);
    assert_eq!(course.iter().filter(|tool| tool.has_jumped).count(), 1);
    let told = course.iter().find(|tool| tool.has_jumped).expect("one").to_string();
    assert!(told.ends_with("it was put elsewhere, further than a tool moves"), "{told}");
    assert!(vec3(course[29].force[0], course[29].force[1], course[29].force[2]) == Vec3::ZERO);
}
