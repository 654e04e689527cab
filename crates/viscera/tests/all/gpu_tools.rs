//! Scenes with tools on a graphics processor: hands that take and leave them, settings that change, devices that are lost.

use crate::common::device::{device, own_device};
use viscera::scalar::rigid::RigidTransform;
use viscera::scalar::{Vec3, vec3};
use viscera::scene::{Scene, read_tray};
use viscera::simulation::{Assembly, Simulation, ToolForce};
use viscera::solver::FrameReading;

/// A block on a table and a ball that is pressed into it, stays, and is dragged aside.
pub const SCENE: &str = r#"
world = { gravity = 0 }
time = { duration = "1 s" }
solver = { method = "quasi_newton" }

[[body]]
name = "block"
shape = "block"
size = ["30 mm", "30 mm", "15 mm"]
cells = [5, 5, 3]
material = { young = "10 kPa", poisson = 0.4 }

[[fixing]]
name = "table"
body = "block"
half_space = { point = [0, 0, 0], normal = [0, 0, -1] }

[[tool]]
name = "ball"
kind = "sphere"
radius = "6 mm"
friction = 0.5
position = ["15 mm", "15 mm", "23 mm"]
keys = [
    { time = "0.1 s", translation = [0, 0, "-5 mm"] },
    { time = "0.2 s", translation = ["2 mm", 0, "-5 mm"] },
]
"#;

fn parsed(settings: &[(&str, &str)]) -> (Scene, Assembly) {
    parsed_text(SCENE, settings)
}

fn parsed_text(text: &str, settings: &[(&str, &str)]) -> (Scene, Assembly) {
    let scene = Scene::parse("tools.toml", text, settings).unwrap_or_else(|e| panic!("{e}"));
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned()));
    (scene, assembly.unwrap_or_else(|e| panic!("{e}")))
}

fn on_cpu() -> Simulation<f32> {
    let (scene, assembly) = parsed(&[("solver.device", "cpu")]);
    Simulation::new(scene, assembly).unwrap_or_else(|e| panic!("{e}"))
}

fn on_device() -> Simulation<f32> {
    let (scene, assembly) = parsed(&[]);
    Simulation::on_device(scene, assembly, device()).unwrap_or_else(|e| panic!("{e}"))
}

fn advance(run: &mut Simulation<f32>, frames: u32) {
    (0..frames).for_each(|_| run.advance_frame().unwrap_or_else(|e| panic!("{e}")));
}

/// How far forces are apart, of the larger.
fn apart(a: &ToolForce, b: &ToolForce) -> f64 {
    let [a, b] = [a, b].map(|tool| vec3(tool.force[0], tool.force[1], tool.force[2]));
    (a - b).length() / a.length().max(b.length())
}

pub fn setting(key: &str, value: &str) -> [(String, String); 1] {
    [(key.to_owned(), value.to_owned())]
}

#[test]
fn a_scene_with_tools_reports_what_the_processor_does() {
    let (mut cpu, mut gpu) = (on_cpu(), on_device());
    for _ in 0..4 {
        advance(&mut cpu, 4);
        advance(&mut gpu, 4);
        let (here, there) = (&cpu.tool_forces()[0], &gpu.tool_forces()[0]);
        assert!(there.force[2] > 0.02 && there.touches > 0, "{there:?}");
        // With the passes that are chosen.
        assert!(apart(here, there) < 0.03, "{here} and {there}");
        assert!(gpu.report().relative_residual < 0.1, "{}", gpu.report().relative_residual);
    }
}

/// What forces are said to be off by, by a second run on the same device, is what the processor says: of viscous tissue that
/// swings before a ball touches it. Forces have the same bits without it.
#[test]
fn forces_are_said_to_be_off_by_what_the_processor_says() {
    let text = SCENE.replace("[5, 5, 3]", "[3, 3, 2]");
    let shared = [("body.block.material.viscosity", "2 ms"), ("world.gravity", "9.81 m/s^2")];
    let xpbd = [("solver.method", "xpbd"), ("solver.substeps", "4"), ("solver.iterations", "8")];
    let explicit = [("solver.method", "explicit")];
    for settings in [&[("solver.method", "quasi_newton")][..], &xpbd, &explicit] {
        let is_explicit = settings == explicit;
        let settings = |more: &[_]| parsed_text(&text, &[settings, &shared, more].concat());
        let (scene, assembly) = settings(&[("solver.device", "cpu")]);
        let mut cpu = Simulation::<f32>::new(scene, assembly).expect("a simulation");
        let [mut gpu, mut alone] = [&[("output.force_error", "true")][..], &[]].map(|more| {
            let (scene, assembly) = settings(more);
            Simulation::<f32>::on_device(scene, assembly, device()).expect("a simulation")
        });
        for frame in 0..9 {
            advance(&mut cpu, 1);
            advance(&mut alone, 1);
            // Forces alone, with and without waiting for them.
            if frame % 2 == 0 {
                gpu.advance_reading(FrameReading::Forces).expect("a frame");
            } else {
                gpu.send_frame(FrameReading::Forces).expect("a frame");
                while !gpu.take_frame().expect("a frame") {}
            }
            let [here, there, bare] = [&cpu, &gpu, &alone].map(|run| run.tool_forces()[0].clone());
            assert_eq!((there.force, bare.error), (bare.force, None), "{there}, {bare}");
            let [said, expected] = [&there, &here].map(|tool| tool.error.expect("asked for"));
            // Explicit steps take contact in another way there, which is off by less (docs/gpu.md).
            let size = Vec3::<f64>::from_f64(there.force).length();
            let (least, most) = match is_explicit {
                true => (0.99e-3 * size, 2.0 * expected + 2e-3 * size),
                false => (0.9 * expected - 1e-4, 1.1 * expected + 1e-4),
            };
            assert!((least..=most).contains(&said), "{there} and {here}");
        }
    }
}

/// Soft tissue swings for a while before it is touched. The second run, whose longer steps make it swing otherwise, has gone on
/// from the first until then.
#[test]
fn a_second_run_has_no_past_before_anything_is_touched() {
    let text = SCENE.replace("[5, 5, 3]", "[3, 3, 2]").replace("10 kPa", "1 kPa");
    let text = text.replace("23 mm", "27 mm").replace("-5 mm", "-11 mm");
    let settings = [("world.gravity", "9.81 m/s^2"), ("output.force_error", "true")];
    let (scene, assembly) =
        parsed_text(&text, &[&settings[..], &[("solver.device", "cpu")]].concat());
    let mut cpu = Simulation::<f32>::new(scene, assembly).expect("a simulation");
    let (scene, assembly) = parsed_text(&text, &settings);
    let mut gpu = Simulation::<f32>::on_device(scene, assembly, device()).expect("a simulation");
    for _ in 0..8 {
        advance(&mut cpu, 1);
        advance(&mut gpu, 1);
        let [here, there] = [&cpu, &gpu].map(|run| run.tool_forces()[0].clone());
        let [expected, said] = [&here, &there].map(|tool| tool.error.expect("asked for"));
        assert!((said - expected).abs() < 0.1 * expected + 1e-4, "{there} and {here}");
    }
    let there = &gpu.tool_forces()[0];
    assert!(there.touches > 0, "{there}");
}

/// The same by sweeps.
#[test]
fn sweeps_report_what_the_processors_do() {
    let xpbd = [("solver.method", "xpbd"), ("solver.substeps", "2"), ("solver.iterations", "8")];
    let (scene, assembly) = parsed(&[&xpbd[..], &[("solver.device", "cpu")]].concat());
    let mut cpu = Simulation::<f32>::new(scene, assembly).expect("a simulation");
    let (scene, assembly) = parsed(&xpbd);
    let mut gpu = Simulation::<f32>::on_device(scene, assembly, device()).expect("a simulation");
    for _ in 0..5 {
        advance(&mut cpu, 4);
        advance(&mut gpu, 4);
        let (here, there) = (&cpu.tool_forces()[0], &gpu.tool_forces()[0]);
        println!("{} and {}: {:.1e}", here.force[2], there.force[2], apart(here, there));
        assert!(there.force[2] > 0.02 && there.touches > 0, "{there:?}");
        assert!(apart(here, there) < 0.01, "{here} and {there}");
    }
    // Another method, whose tetrahedra bend more easily, goes on from the same place.
    gpu.change(&setting("solver.method", "quasi_newton")).expect("a method");
    assert!(gpu.is_on_device());
    advance(&mut gpu, 2);
    let after = &gpu.tool_forces()[0];
    assert!(!after.has_jumped && after.touches > 0 && after.force[2] > 0.02, "{after}");
}

/// What a hand takes and leaves again touches, and leaves what others have touched as it was.
#[test]
fn tools_come_and_go_on_a_device() {
    let (scene, assembly) = parsed(&[("output.force_error", "true")]);
    let mut gpu = Simulation::<f32>::on_device(scene, assembly, device()).expect("a simulation");
    let mut cpu = on_cpu();
    let tray = read_tray(
        "tray.toml",
        "[[tool]]\nname = \"probe\"\nkind = \"sphere\"\nradius = \"5 mm\"\n",
    );
    let mut probe = tray.unwrap_or_else(|e| panic!("{e}")).remove(0);
    probe.placement.translation = vec3(0.006, 0.006, 0.024);
    for run in [&mut cpu, &mut gpu] {
        advance(run, 12);
        let number = run.take_tool(probe.clone()).expect("a probe");
        for step in 1..=6 {
            let down = vec3(0.0, 0.0, -1e-3) * f64::from(step);
            let pose = RigidTransform {
                translation: probe.placement.translation + down,
                ..probe.placement
            };
            run.move_tool(number, pose).expect("a pose");
            advance(run, 1);
        }
    }
    assert!(gpu.is_on_device());
    for (here, there) in cpu.tool_forces().iter().zip(&gpu.tool_forces()) {
        assert!(there.force[2] > 0.02, "{there}");
        assert!(apart(here, there) < 0.05, "{here} and {there}");
    }
    // The ball goes: the probe is the first part of a tool then, and what it has touched stays.
    for run in [&mut cpu, &mut gpu] {
        run.put_away(0).expect("the ball");
        advance(run, 4);
        assert_eq!(run.tool_forces()[0].touches, 0);
    }
    let (here, there) = (&cpu.tool_forces()[1], &gpu.tool_forces()[1]);
    assert!(there.force[2] > 0.02 && apart(here, there) < 0.05, "{here} and {there}");
    // The second run has seen it go as well.
    let [expected, said] = [here, there].map(|tool| tool.error.expect("asked for"));
    assert!((said - expected).abs() < 0.15 * expected, "{here} and {there}");
}

/// A moment that was kept is gone on from within the error of a solve; friction's anchors are part of it.
#[test]
fn a_kept_moment_has_its_contact() {
    let mut run = on_device();
    advance(&mut run, 14);
    let kept = run.checkpoint();
    advance(&mut run, 3);
    let first = run.tool_forces()[0].clone();
    assert!(first.force[0].abs() > 0.02, "it is dragged: {first}");
    run.restore(&kept).expect("a moment of this run");
    advance(&mut run, 3);
    let again = run.tool_forces()[0].clone();
    assert!(apart(&first, &again) < 0.02, "{first} and {again}");
}

/// Settings may change to what computes the contact, and to nothing else.
#[test]
pub fn settings_change_while_tools_touch() {
    let mut run = on_device();
    advance(&mut run, 13);
    let without = [setting("solver.method", "xpbd"), setting("solver.rebase", "false")].concat();
    let refused = run.change(&without).expect_err("no contact");
    assert!(refused.to_string().contains("rebase"), "{refused}");
    advance(&mut run, 1);
    let before = run.tool_forces()[0].clone();
    assert!(before.force[0].abs() > 0.01, "it is dragged: {before}");
    // Another number of passes: the same places, the same anchors.
    run.change(&setting("solver.iterations", "30")).expect("a setting");
    assert!(run.is_on_device());
    let mut cpu = on_cpu();
    advance(&mut cpu, 14);
    for run in [&mut run, &mut cpu] {
        advance(run, 2);
    }
    let (here, there) = (&cpu.tool_forces()[0], &run.tool_forces()[0]);
    assert!(apart(here, there) < 0.05, "{here} and {there}");
    run.change(&setting("solver.device", "cpu")).expect("a device");
    assert!(!run.is_on_device());
    advance(&mut run, 1);
    advance(&mut cpu, 1);
    let (here, there) = (&cpu.tool_forces()[0], &run.tool_forces()[0]);
    assert!(apart(here, there) < 0.05, "{here} and {there}");
}

/// The processor goes on where the device was lost: the tool has not jumped, and presses on.
#[test]
fn a_lost_device_leaves_tools_where_they_are() {
    let device = own_device();
    let (scene, assembly) = parsed(&[]);
    let mut run = Simulation::<f32>::on_device(scene, assembly, &device).expect("a simulation");
    advance(&mut run, 8);
    device.wgpu().0.destroy();
    advance(&mut run, 4);
    assert!(!run.is_on_device());
    let mut cpu = on_cpu();
    advance(&mut cpu, 12);
    let (here, there) = (&cpu.tool_forces()[0], &run.tool_forces()[0]);
    assert!(!there.has_jumped && apart(here, there) < 0.05, "{here} and {there}");
}
