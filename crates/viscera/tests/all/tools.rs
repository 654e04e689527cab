//! Tools in scenes: the forces that they meet, jaws that follow a force, frames that are divided, and what is kept of them.

use viscera::contact::Shape;
use viscera::scalar::{Real, Vec3, vec3};
use viscera::scene::Scene;
use viscera::simulation::{Assembly, PatchForce, Simulation, SimulationError, ToolForce, advice};
use viscera::solver::StepError;

const PALPATION: &str = include_str!("../../../../scenes/palpation.toml");
const GRASP: &str = include_str!("../../../../scenes/grasp.toml");

/// A block on a table, and a ball that is pressed into it off its middle.
const BLOCK: &str = r#"
world = { gravity = 0 }
time = { duration = "0.6 s", velocity_factor = 0.9 }

[[body]]
name = "block"
shape = "block"
size = ["30 mm", "30 mm", "15 mm"]
cells = [6, 6, 3]
material = { young = "10 kPa", poisson = 0.4 }

[[fixing]]
name = "table"
body = "block"
half_space = { point = [0, 0, 0], normal = [0, 0, -1] }

[[tool]]
name = "ball"
kind = "sphere"
radius = "6 mm"
position = ["11 mm", "16 mm", "23 mm"]
keys = [{ time = "0.3 s", translation = ["1 mm", 0, "-4 mm"] }]
"#;

/// A slab between two jaws that close by a force; the slab is fixed at the far end.
const SQUEEZE: &str = r#"
world = { gravity = 0 }
time = { duration = "1 s", velocity_factor = 0.9 }
solver = { substeps = 2 }

[[body]]
name = "slab"
shape = "block"
size = ["20 mm", "6 mm", "12 mm"]
cells = [8, 2, 4]
material = { young = "20 kPa", poisson = 0.4 }

[[fixing]]
name = "clamp"
body = "slab"
half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }

[[tool]]
name = "grasper"
kind = "grasper"
jaw_size = ["16 mm", "4 mm", "16 mm"]
jaw_gap = "4 mm"
position = ["26 mm", "3 mm", "6 mm"]
rotation_axis = [0, 1, 0]
rotation_angle = "90 deg"
closing_force = [{ time = 0, force = "1.5 N" }]
closing_time = "0.3 s"
"#;

fn parsed(text: &str, settings: &[(&str, &str)]) -> (Scene, Assembly) {
    let scene = Scene::parse("tools.toml", text, settings).unwrap_or_else(|e| panic!("{e}"));
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned()));
    (scene, assembly.unwrap_or_else(|e| panic!("{e}")))
}

fn simulation<S: Real>(text: &str, settings: &[(&str, &str)]) -> Simulation<S> {
    let (scene, assembly) = parsed(text, settings);
    Simulation::new(scene, assembly).unwrap_or_else(|e| panic!("{e}"))
}

fn advance<S: Real>(simulation: &mut Simulation<S>, time: f64) {
    while simulation.time() < time - 1e-9 {
        simulation.advance_frame().unwrap_or_else(|e| panic!("{e}"));
    }
}

fn refused(text: &str, settings: &[(&str, &str)]) -> SimulationError {
    let (scene, assembly) = parsed(text, settings);
    Simulation::<f32>::new(scene, assembly).map(|_| ()).expect_err("a refusal")
}

/// The only tool's.
fn on_tool<S: Real>(simulation: &Simulation<S>) -> ToolForce {
    simulation.report().tools.first().expect("a tool").clone()
}

fn patch<S: Real>(simulation: &Simulation<S>) -> PatchForce {
    simulation.report().patches.first().expect("a fixing").clone()
}

fn is_close(a: [f64; 3], b: [f64; 3], most: f64) -> bool {
    (Vec3::<f64>::from_f64(a) - Vec3::from_f64(b)).length() <= most
}

/// At rest, without weight, tissue hands the tool's force and torque on to what holds it, whichever method computes it.
#[test]
fn what_a_tool_meets_is_what_the_table_holds() {
    for method in ["quasi_newton", "xpbd"] {
        let settings =
            [("solver.method", method), ("solver.precision", "f64"), ("solver.substeps", "3")];
        let mut run = simulation::<f64>(BLOCK, &settings);
        advance(&mut run, 0.6);
        let (tool, table) = (on_tool(&run), patch(&run));
        assert!(tool.force[2] > 0.1 && tool.touches >= 4 && tool.pinned == 0, "{tool:?}");
        let force = Vec3::from_f64(tool.force);
        assert!(is_close(tool.force, table.force, 5e-3 * force.length()), "{tool:?}, {table:?}");
        // Both about the middle of the table's patch.
        let arm = vec3(12e-3, 16e-3, 19e-3) - vec3(15e-3, 15e-3, 0.0);
        let torque = (Vec3::from_f64(tool.torque) + arm.cross(force)).to_array();
        let most = 5e-3 * force.length() * arm.length();
        assert!(is_close(torque, table.torque, most), "{torque:?}, {table:?}");
        assert!((0.0..1e-3).contains(&tool.depth), "{}", tool.depth);
    }
}

/// The torque about the tool's origin is that of all its parts: of two rods of a hook as of one that is elsewhere.
#[test]
fn the_torque_of_several_parts_is_about_the_tools_origin() {
    let rod = r#"kind = "hook"
radius = "6 mm"
length = "40 mm"
tip_length = "12 mm"
rotation_axis = [0, 0, 1]
rotation_angle = "-90 deg"
friction = 0
"#;
    let text = BLOCK.replace("kind = \"sphere\"\nradius = \"6 mm\"\n", rod);
    let mut run =
        simulation::<f64>(&text, &[("solver.precision", "f64"), ("solver.substeps", "3")]);
    advance(&mut run, 0.6);
    let (tool, table) = (on_tool(&run), patch(&run));
    let force = Vec3::from_f64(tool.force);
    let arm = vec3(12e-3, 16e-3, 19e-3) - vec3(15e-3, 15e-3, 0.0);
    let torque = (Vec3::from_f64(tool.torque) + arm.cross(force)).to_array();
    assert!(force.z > 0.2 && Vec3::<f64>::from_f64(tool.torque).length() > 5e-4, "{tool:?}");
    assert!(is_close(torque, table.torque, 5e-3 * force.length() * 20e-3), "{torque:?}, {table:?}");
}

#[test]
fn jaws_close_until_tissue_holds_against_their_force() {
    let mut run = simulation::<f32>(SQUEEZE, &[]);
    let open = run.jaw_angle(0).expect("jaws");
    assert!((open - std::f64::consts::FRAC_PI_3).abs() < 1e-12);
    advance(&mut run, 0.1);
    // In the air they close at their speed.
    let angle = run.jaw_angle(0).expect("jaws");
    assert!((angle - open * (1.0 - 0.1 / 0.3)).abs() < 1e-9, "{angle}");
    advance(&mut run, 1.0);
    let angle = run.jaw_angle(0).expect("jaws");
    assert!(angle > 0.0 && angle < 0.3 * open, "{angle}");
    // About the hinge, along z of the world, each jaw meets what closes it: 1.5 N at 8 mm.
    let hinge = vec3(26e-3, 3e-3, 6e-3);
    let mut torques = [0.0; 2];
    for touch in &run.state().contact.touches {
        torques[touch.tool as usize] += (touch.place - hinge).cross(-touch.force).z;
    }
    for torque in torques {
        assert!((torque.abs() / (1.5 * 8e-3) - 1.0).abs() < 0.02, "{torques:?}");
    }
    assert!(torques[0] * torques[1] < 0.0);
    // Forces of the two are nearly opposite, so that the grasper as a whole meets little.
    assert!(Vec3::<f64>::from_f64(on_tool(&run).force).length() < 0.3);
}

/// With a force eighty times as large jaws close to where tissue no longer gives way, and come to rest there.
#[test]
fn jaws_that_press_hard_come_to_rest() {
    let settings = [("tool.grasper.closing_force", "[{ time = 0, force = \"20 N\" }]")];
    let mut run = simulation::<f32>(SQUEEZE, &settings);
    advance(&mut run, 0.7);
    let before = run.jaw_angle(0).expect("jaws");
    advance(&mut run, 0.8);
    let moved = (run.jaw_angle(0).expect("jaws") - before).abs();
    assert!(moved < 0.01, "{moved}");
}

#[test]
fn a_grasp_pulls_and_twists_and_leaves_nothing_behind() {
    let mut run = simulation::<f32>(GRASP, &[]);
    advance(&mut run, 1.85);
    let pulled = on_tool(&run);
    // 20 kPa on 72 mm^2 by about 16 mm of 50 mm.
    assert!(pulled.force[0] < -0.25 && pulled.force[0] > -0.6, "{pulled:?}");
    let clamp = patch(&run);
    assert!(is_close(clamp.force, pulled.force, 0.02), "{clamp:?}, {pulled:?}");
    advance(&mut run, 2.5);
    // Torsion of the strip, G J/L by 30 degrees: 5e-5 N m.
    let torque = on_tool(&run).torque[0];
    assert!((-7e-5..-3e-5).contains(&torque), "{torque}");
    advance(&mut run, 4.0);
    let left = on_tool(&run);
    assert_eq!((left.touches, left.force), (0, [0.0; 3]));
    assert!(run.state().contact.touches.is_empty());
    let energy = run.report().energy;
    assert!(energy.elastic + energy.kinetic < 1e-6, "{energy:?}");
}

/// Locked jaws hold without friction; open, they let all go.
#[test]
fn locked_jaws_hold_without_friction() {
    let force_at_the_end_of_the_pull = |settings: &[(&str, &str)]| {
        let mut run =
            simulation::<f32>(GRASP, &[&[("tool.grasper.friction", "0")], settings].concat());
        advance(&mut run, 2.0);
        let held = on_tool(&run).force[0];
        assert!(run.tool_parts().iter().all(|part| part.is_locked != settings.is_empty()));
        if !settings.is_empty() {
            advance(&mut run, 3.0);
            assert!(run.state().contact.touches.is_empty());
        }
        held
    };
    let locked = [("tool.grasper.lock", "[{ from = \"1.1 s\", to = \"2.6 s\" }]")];
    let (loose, locked) =
        (force_at_the_end_of_the_pull(&[]), force_at_the_end_of_the_pull(&locked));
    assert!(locked < -0.3 && loose > -0.15, "{locked}, {loose}");
}

#[test]
fn a_grasp_is_resumed_and_repeated_to_the_bit() {
    let mut run = simulation::<f32>(GRASP, &[]);
    advance(&mut run, 1.0);
    let (saved, angle) = (run.save(), run.jaw_angle(0));
    advance(&mut run, 1.6);
    // What forces are said to be off by begins anew with whoever goes on.
    let report = |run: &Simulation<f32>| {
        let mut report = run.report();
        for tool in &mut report.tools {
            (tool.error, tool.torque_error) = (None, None);
        }
        report
    };
    let end = (run.save(), report(&run));
    let mut resumed = simulation::<f32>(GRASP, &[]).resume(&saved).expect("the same scene");
    assert_eq!(resumed.jaw_angle(0), angle);
    advance(&mut resumed, 1.6);
    assert!(resumed.save() == end.0 && report(&resumed) == end.1);
    run.reset().expect("the same scene");
    assert_eq!(on_tool(&run).touches, 0);
    advance(&mut run, 1.6);
    assert!(run.save() == end.0 && report(&run) == end.1);
    let other = simulation::<f32>(BLOCK, &[]).resume(&saved).map(|_| ());
    assert!(other.is_err());
}

#[test]
fn a_setting_that_changes_leaves_what_tools_hold() {
    let text = format!("{GRASP}\n[[change]]\ntime = \"2 s\"\nset = [\"solver.accuracy = fine\"]\n");
    let mut run = simulation::<f32>(&text, &[]);
    advance(&mut run, 1.99);
    let before = on_tool(&run).force[0];
    advance(&mut run, 2.1);
    let after = on_tool(&run).force[0];
    assert!((after / before - 1.0).abs() < 0.05, "{before}, {after}");
}

#[test]
fn frames_are_divided_where_a_tool_would_jump() {
    // 20 mm in 1/60 s: with a radius of 2 mm in three times as many substeps, so that each is at most 8 mm.
    let fast = r#"kind = "probe"
radius = "2 mm"
length = "30 mm"
interpolation = "linear"
"#;
    let keys = "keys = [{ time = \"1/60 s\", translation = [0, 0, \"20 mm\"] }]";
    let text = BLOCK.replace("kind = \"sphere\"\nradius = \"6 mm\"\n", fast);
    let (head, _) = text.split_once("keys =").expect("keys");
    let mut run = simulation::<f32>(&format!("{head}{keys}"), &[("solver.substeps", "1")]);
    assert_eq!(run.report().divided, 1);
    run.advance_frame().expect("a frame");
    assert_eq!((run.substeps(), run.report().divided), (1, 3));
    run.advance_frame().expect("a frame");
    assert_eq!(run.report().divided, 1);
    // Half a metre in a frame is put elsewhere, which no division helps.
    let keys = keys.replace("20 mm", "500 mm");
    let mut run = simulation::<f32>(&format!("{head}{keys}"), &[("solver.substeps", "1")]);
    run.advance_frame().expect("a frame");
    assert_eq!(run.report().divided, 1);
}

#[test]
fn contact_is_where_it_is_asked_for_and_in_the_rebase() {
    let run = simulation::<f32>(BLOCK, &[("solver.method", "xpbd")]);
    assert_eq!(
        run.device_choice(),
        "CPU: contact with tools, which no GPU is known to compute faster"
    );
    let on_device = [("solver.device", "gpu"), ("solver.method", "quasi_newton")];
    let [by_sweeps, explicit] = ["xpbd", "explicit"].map(|m| [on_device[0], ("solver.method", m)]);
    // "auto" is the quasi-Newton method there.
    for settings in [&on_device[..], &on_device[..1], &by_sweeps, &explicit] {
        let mut run = simulation::<f32>(BLOCK, settings);
        assert!(run.is_on_device());
        run.advance_frame().expect("a frame");
    }
    let published = [("solver.method", "xpbd"), ("solver.rebase", "false")];
    let error = refused(BLOCK, &published);
    assert_eq!(error, SimulationError::Step(StepError::ContactNeedsRebase));
}

#[test]
fn stiff_contact_of_xpbd_is_advised_against() {
    let advised = |settings: &[(&str, &str)]| {
        advice::stiff_contact(&simulation::<f32>(BLOCK, settings).scene_in_force())
    };
    let xpbd = ("solver.method", "xpbd");
    let words = advised(&[xpbd]).expect("advice");
    assert!(words.starts_with("tool \"ball\": ") && words.contains("`stiffness` to 2"), "{words}");
    assert_eq!(advised(&[xpbd, ("tool.ball.stiffness", "2")]), None);
    assert_eq!(advised(&[("solver.method", "quasi_newton")]), None);
}

#[test]
fn samples_suit_tools_and_stay_where_meshes_are_refined() {
    let (scene, assembly) = parsed(BLOCK, &[]);
    // Tools below three edges meet four samples of each triangle.
    let triangles = assembly.bodies[0].surface.triangles.len();
    assert_eq!(assembly.builder.samples().len(), 4 * triangles);
    let finer = assembly.refined(&scene).expect("a finer mesh");
    let area = |assembly: &Assembly| -> f64 {
        assembly.builder.samples().iter().map(|sample| sample.area).sum()
    };
    let whole = 2.0 * (30.0 * 30.0 + 2.0 * 30.0 * 15.0) * 1e-6;
    assert!((area(&assembly) - whole).abs() < 1e-12 && (area(&finer) - whole).abs() < 1e-12);
    assert!(finer.builder.samples().len() >= 4 * triangles);
    let (_, assembly) =
        parsed(BLOCK, &[("tool.ball.radius", "60 mm"), ("tool.ball.position", "[0, 0, \"1 m\"]")]);
    assert_eq!(assembly.builder.samples().len(), triangles);
    let (_, assembly) = parsed(BLOCK.split("[[tool]]").next().expect("a block"), &[]);
    assert!(assembly.builder.samples().is_empty());
    // Where a body has a finer surface, its vertices.
    let body = BLOCK.replace(
        "shape = \"block\"\nsize = [\"30 mm\", \"30 mm\", \"15 mm\"]\ncells = [6, 6, 3]",
        "shape = \"sphere\"\nradius = \"15 mm\"\nposition = [0, 0, \"-40 mm\"]",
    );
    let (body, tool) = body.split_once("[[fixing]]").expect("a fixing");
    let tool = tool.split_once("[[tool]]").expect("a tool").1;
    let (_, assembly) = parsed(&format!("{body}[[tool]]{tool}"), &[]);
    let samples = assembly.builder.samples().len();
    assert_eq!(samples, assembly.bodies[0].surface.vertices.len());
}

#[test]
fn shapes_are_where_the_scene_puts_them() {
    let place = "rotation_axis = [1, 0, 0]\nrotation_angle = \"90 deg\"\n";
    for (kind, thin, behind) in [
        // A point on its surface, in its own frame.
        ("kind = \"half_space\"", f64::INFINITY, [0.3, 0.2, 0.0]),
        ("kind = \"capsule\"\nradius = \"6 mm\"\nlength = \"20 mm\"", 6e-3, [0.0, 0.0, 26e-3]),
        ("kind = \"probe\"\nradius = \"6 mm\"\nlength = \"20 mm\"", 6e-3, [0.0, 0.0, -6e-3]),
        ("kind = \"box\"\nsize = [\"20 mm\", \"24 mm\", \"28 mm\"]", 10e-3, [0.0, 0.0, -14e-3]),
        ("kind = \"blade\"\nsize = [\"20 mm\", \"8 mm\", \"60 mm\"]", 4e-3, [0.0, 0.0, 60e-3]),
        (
            "kind = \"hook\"\nradius = \"4 mm\"\nlength = \"60 mm\"\ntip_length = \"10 mm\"",
            4e-3,
            [0.0, 14e-3, 0.0],
        ),
    ] {
        let own = format!("{kind}\n{place}");
        let text = BLOCK.replace("kind = \"sphere\"\nradius = \"6 mm\"\n", &own);
        let (text, _) = text.split_once("keys =").expect("keys");
        let far = [("tool.ball.position", "[0, \"1 m\", 0]")];
        let run = simulation::<f32>(text, &far);
        let parts = run.tool_parts();
        // A quarter of a turn about x: y goes to z, z to -y.
        let [x, y, z] = behind;
        let point = vec3(x, 1.0 - z, y);
        let distance = parts.iter().map(|part| part.distance(point).value).fold(1.0, f64::min);
        assert!(distance.abs() < 1e-12, "{kind}: {distance}");
        let thinnest = parts.iter().map(|part| part.shape.thinnest()).fold(f64::INFINITY, f64::min);
        assert!(thinnest == thin || (thinnest - thin).abs() < 1e-15, "{kind}: {thinnest}");
        assert!(parts.iter().all(|part| part.shape != Shape::HalfSpace) || thin.is_infinite());
    }
}

/// The largest force at each of the five places of the shipped scene.
fn palpated(settings: &[(&str, &str)]) -> [f64; 5] {
    let mut run = simulation::<f32>(PALPATION, settings);
    [0.4, 1.0, 1.6, 2.2, 2.8].map(|time| {
        advance(&mut run, time);
        on_tool(&run).force[2]
    })
}

/// The force [N] over the lump is so many times as large as elsewhere, where there is some too.
fn assert_felt(lump: f64, elsewhere: &[f64], times: f64) {
    let is_less = |force: &f64| *force > 0.2 && lump > times * force;
    assert!(elsewhere.iter().all(is_less), "{lump} and {elsewhere:?}");
}

#[test]
#[ignore = "slow: two runs of 3 s"]
fn a_probe_feels_a_lump_at_length() {
    let forces = palpated(&[]);
    let others = [0, 1, 3, 4].map(|place| forces[place]);
    assert_felt(forces[2], &others, 1.8);
    let even = palpated(&[("body.tissue.region.0.young", "8 kPa")]);
    let mean = even.iter().sum::<f64>() / 5.0;
    assert!(even.into_iter().all(|force| (force / mean - 1.0).abs() < 0.03), "{even:?}");
}

/// The same at the lump and at one other place, on a coarser mesh.
#[test]
fn a_probe_feels_a_lump() {
    let force = |x: &str| {
        let keys = "[{ time = \"0.3 s\", translation = [0, 0, \"-6 mm\"] }]";
        let position = format!("[\"{x} mm\", \"40 mm\", \"38 mm\"]");
        let settings = [
            ("tool.probe.position", &*position),
            ("tool.probe.keys", keys),
            ("body.tissue.cells", "[8, 8, 4]"),
            ("body.tissue.region.0.sphere.radius", "10 mm"),
            ("solver.substeps", "2"),
        ];
        let mut run = simulation::<f32>(PALPATION, &settings);
        advance(&mut run, 0.4);
        on_tool(&run).force[2]
    };
    let (lump, beside) = (force("40"), force("20"));
    assert_felt(lump, &[beside], 1.4);
}
