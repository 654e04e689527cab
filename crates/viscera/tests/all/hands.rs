//! Tools in hands: taken up, moved, locked and put away in a running simulation, and that a scene file repeats it.

use viscera::scalar::rigid::{RigidTransform, rotation_matrix};
use viscera::scalar::{Real, Vec3, vec3};
use viscera::scene::{Instrument, Patch, Scene, Selector, read_tray};
use viscera::simulation::{
    AssembleError, Assembly, Holder, Live, LiveError, Simulation, SimulationError,
};

/// A block on a table, and nothing that touches it.
pub const BLOCK: &str = r#"
world = { gravity = 0 }
time = { duration = "2 s", velocity_factor = 0.95 }

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
"#;

/// Beside it tools of the scene's own: one moves, one comes and goes, one is squeezed by a force.
pub const TOOLS: &str = r#"
[[tool]]
name = "ball"
kind = "sphere"
radius = "6 mm"
position = ["8 mm", "8 mm", "22 mm"]
keys = [{ time = "0.5 s", translation = ["1 mm", 0, "-4 mm"], rotation_angle = "1 rad" }]

[[tool]]
name = "guest"
kind = "sphere"
radius = "5 mm"
position = ["24 mm", "24 mm", "21.5 mm"]
begin = "0.1 s"
end = "0.6 s"
keys = [{ time = "0.4 s", translation = [0, 0, "-3 mm"] }]
"#;

const TRAY: &str = r#"
[[tool]]
name = "probe"
kind = "probe"
radius = "8 mm"
length = "60 mm"
position = [0, 0, "100 mm"]

[[tool]]
name = "needle"
kind = "probe"
radius = "2 mm"
length = "60 mm"
friction = 0.4

[[tool]]
name = "pliers"
kind = "grasper"
jaw_size = ["8 mm", "3 mm", "14 mm"]
jaw_gap = "2 mm"
rotation_axis = [1, 1, 0]
rotation_angle = "20 deg"
friction = 0.6
jaw = [{ time = 0, angle = "50 deg" }, { time = "1 s", angle = "10 deg" }]

[[tool]]
name = "clamp"
kind = "grasper"
jaw_size = ["8 mm", "3 mm", "14 mm"]
closing_force = [{ time = 0, force = "1 N" }]
closing_time = "0.3 s"
"#;

fn tray(name: &str) -> Instrument {
    let tray = read_tray("tray.toml", TRAY).unwrap_or_else(|e| panic!("{e}"));
    tray.into_iter().find(|tool| tool.name == name).expect("an instrument")
}

/// An instrument from the tray, put somewhere.
pub fn at(name: &str, place: Vec3<f64>) -> Instrument {
    let mut tool = tray(name);
    tool.placement.translation = place;
    tool
}

pub fn simulation<S: Real>(text: &str, settings: &[(&str, &str)]) -> Simulation<S> {
    let scene =
        Scene::parse("hands.toml", text, settings).unwrap_or_else(|e| panic!("{e}\n{text}"));
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned()));
    let assembly = assembly.unwrap_or_else(|e| panic!("{e}"));
    Simulation::new(scene, assembly).unwrap_or_else(|e| panic!("{e}"))
}

pub fn frames<S: Real>(run: &mut Simulation<S>, count: u32) {
    for _ in 0..count {
        run.advance_frame().unwrap_or_else(|e| panic!("{e}"));
    }
}

pub fn pose<S: Real>(run: &Simulation<S>, tool: usize) -> RigidTransform {
    run.tools()[tool].pose
}

/// Moves a tool on by a way and a turn, in so many frames.
pub fn go<S: Real>(
    run: &mut Simulation<S>,
    tool: usize,
    way: Vec3<f64>,
    turn: Vec3<f64>,
    count: u32,
) {
    for _ in 0..count {
        let now = pose(run, tool);
        let share = 1.0 / f64::from(count);
        let next = RigidTransform {
            rotation: rotation_matrix(turn * share) * now.rotation,
            translation: now.translation + way * share,
        };
        run.move_tool(tool, next).expect("a pose");
        frames(run, 1);
    }
}

/// Presses with a probe, grasps with pliers, which need finer samples, while it does so, and takes a needle.
fn operate<S: Real>(run: &mut Simulation<S>) {
    frames(run, 3);
    let probe = run.take_tool(at("probe", vec3(0.008, 0.02, 0.024))).expect("a probe");
    go(run, probe, vec3(0.002, 0.0, -0.003), vec3(0.1, 0.0, 0.3), 6);
    let mut pliers = at("pliers", vec3(0.022, 0.012, 0.0325));
    pliers.placement.rotation = rotation_matrix(vec3(0.0, 0.05, 1.2));
    let pliers = run.take_tool(pliers).expect("pliers");
    let settings = [("body.block.material.young".to_owned(), "12 kPa".to_owned())];
    run.change(&settings).expect("a change");
    go(run, pliers, vec3(0.0, 0.0, -0.004), Vec3::ZERO, 4);
    for step in 1..=8 {
        let angle = 0.87 * (1.0 - f64::from(step) / 8.0);
        run.open_jaws(pliers, angle).expect("an angle");
        frames(run, 1);
    }
    run.lock_jaws(pliers, true).expect("a lock");
    go(run, pliers, vec3(0.001, 0.0, 0.002), vec3(0.0, 0.0, 0.2), 4);
    let needle = run.take_tool(at("needle", vec3(0.025, 0.025, 0.018))).expect("a needle");
    go(run, needle, vec3(0.0, 0.0, -0.002), vec3(0.0, 0.3, 0.0), 3);
    // It stands still.
    frames(run, 3);
    let again = run.take_tool(at("probe", vec3(0.1, 0.0, 0.05))).expect("another probe");
    run.put_away(again).expect("it was not there yet");
    run.lock_jaws(pliers, false).expect("no lock");
    run.put_away(probe).expect("the probe");
    go(run, needle, vec3(0.001, 0.001, 0.001), Vec3::ZERO, 3);
    run.open_jaws(pliers, 0.6).expect("an angle");
    frames(run, 4);
}

/// The scene with what was done by hand behind it gives all the bits that are saved.
fn repeats<S: Real>(
    text: &str,
    settings: &[(&str, &str)],
    act: impl FnOnce(&mut Simulation<S>),
) -> Live {
    let mut run: Simulation<S> = simulation(text, settings);
    act(&mut run);
    let live = run.live();
    let written = format!("{text}{}", live.text(run.scene()));
    let mut again: Simulation<S> = simulation(&written, settings);
    frames(&mut again, run.frame() as u32);
    assert_eq!(run.state().positions, again.state().positions, "{written}");
    assert_eq!(run.state().contact, again.state().contact);
    assert!(run.save() == again.save(), "{written}");
    assert_eq!(run.report(), again.report());
    for (done, read) in run.scene().tools.iter().zip(&again.scene().tools) {
        assert_eq!((&done.name, &done.hands), (&read.name, &read.hands));
        assert_eq!(
            (&done.parts, &done.placement, &done.law),
            (&read.parts, &read.placement, &read.law)
        );
        assert_eq!((done.begin, done.end), (read.begin, read.end));
    }
    live
}

#[test]
fn a_scene_file_repeats_what_hands_did_to_the_bit() {
    let live = repeats::<f32>(BLOCK, &[], operate);
    assert_eq!((live.tools.len(), live.hands.len(), live.changes.len()), (4, 4, 1));
    let both = format!("{BLOCK}{TOOLS}");
    repeats::<f32>(&both, &[("output.force_error", "false")], operate);
}

/// What hands had done stays theirs where a simulation is resumed: they go on, and a reset takes all of it back.
#[test]
fn hands_go_on_where_another_simulation_was_saved() {
    let text = format!("{BLOCK}{TOOLS}");
    let settings = [("output.force_error", "false")];
    let mut run: Simulation<f32> = simulation(&text, &settings);
    operate(&mut run);
    let written = format!("{text}{}", run.live().text(run.scene()));
    let again: Simulation<f32> = simulation(&written, &settings);
    let base = Scene::parse("hands.toml", &text, &settings).expect("a scene");
    let again = again.resume(&run.save()).expect("the same scene");
    let mut again = again.with_hands_since(base).expect("its own scene");
    let text_of = |run: &Simulation<f32>| run.live().text(run.scene());
    assert!(text_of(&run) == text_of(&again), "{}", text_of(&again));
    assert_eq!(run.first_taken(), again.first_taken());
    for run in [&mut run, &mut again] {
        let needle = run.tools().len() - 2;
        go(run, needle, vec3(0.0, 0.0, -0.002), vec3(0.0, 0.1, 0.0), 3);
        // Another one than was changed before: a reset keeps both.
        let settings = [("body.block.material.poisson".to_owned(), "0.3".to_owned())];
        run.change(&settings).expect("a change");
        frames(run, 2);
        run.put_away(needle).expect("the needle");
        frames(run, 2);
    }
    assert!(run.save() == again.save() && run.report() == again.report());
    assert!(text_of(&run) == text_of(&again), "{}", text_of(&again));
    for run in [&mut run, &mut again] {
        run.reset().expect("a beginning");
        assert_eq!((run.tools().len(), run.live()), (2, Live::default()));
        frames(run, 3);
    }
    assert!(run.save() == again.save());
}

/// The same simulation goes back to a moment and on from there, also where hands went on in between.
fn goes_back<S: Real>(method: &str) {
    let both = format!("{BLOCK}{TOOLS}");
    let precision = if size_of::<S>() == 8 { "f64" } else { "f32" };
    let off = ("output.force_error", "false");
    let settings = [("solver.method", method), ("solver.precision", precision), off];
    let mut run: Simulation<S> = simulation(&both, &settings);
    operate(&mut run);
    let patch = |run: &Simulation<S>| Patch { body: 0, ..run.scene().fixings[0].patch.clone() };
    let nearest = Selector::Nearest { point: vec3(0.03, 0.0, 0.015), count: 2 };
    let held = Patch { selector: nearest, ..patch(&run) };
    let hold = run.take_hold("hand", held.clone(), Some(20.0)).expect("a hold");
    run.lead(hold, vec3(0.001, 0.0, 0.002)).expect("a place");
    frames(&mut run, 2);
    let moment = run.checkpoint();
    let (at, report, place) = (run.save(), run.report(), run.state().positions.as_ptr());
    let pliers = run.tools().iter().position(|tool| tool.name == "pliers").expect("pliers");
    let on = |run: &mut Simulation<S>| {
        run.lead(hold, vec3(0.0, 0.001, 0.002)).expect("a place");
        go(run, pliers, vec3(0.001, 0.0, 0.001), vec3(0.0, 0.1, 0.0), 3);
        (run.save(), run.report(), run.live())
    };
    let after = on(&mut run);
    // What comes later is forgotten: a hold that is let go, another one, jaws.
    run.let_go(hold).expect("a hold");
    run.take_hold("hand", held, None).expect("another");
    run.open_jaws(pliers, 0.3).expect("an angle");
    frames(&mut run, 2);
    run.restore(&moment).expect("its own moment");
    assert!(run.save() == at);
    assert_eq!((run.report(), run.state().positions.as_ptr()), (report, place));
    let again = on(&mut run);
    assert!(again.0 == after.0, "{method}");
    assert_eq!((again.1, again.2), (after.1, after.2));
    // Of other settings of the same model, then of another model.
    run.change(&[("solver.substeps".to_owned(), "3".to_owned())]).expect("a change");
    assert_eq!(run.restore(&moment), Err(LiveError::OtherModel));
    run.change(&[("body.block.material.young".to_owned(), "7 kPa".to_owned())]).expect("a change");
    assert_eq!(run.restore(&moment), Err(LiveError::OtherModel));
}

#[test]
fn a_simulation_goes_back_to_a_moment_and_on_to_the_bit() {
    goes_back::<f32>("explicit");
    goes_back::<f32>("quasi_newton");
    goes_back::<f64>("xpbd");
}

#[test]
fn tools_of_the_scene_are_taken_over_and_the_rest_of_their_keys_is_dropped() {
    let text = format!("{BLOCK}{TOOLS}");
    let live = repeats::<f32>(&text, &[], |run| {
        frames(run, 15);
        assert_eq!(
            run.tools().iter().map(|tool| tool.holder).collect::<Vec<_>>(),
            [Holder::Scene; 2]
        );
        let there = pose(run, 0);
        run.move_tool(0, there).expect("the ball");
        // The guest stays, though the scene would have it leave.
        run.lock_jaws(1, true).expect_err("it has no jaws");
        let up = RigidTransform {
            translation: pose(run, 1).translation + vec3(0.0, 0.0, 1e-3),
            ..there
        };
        run.move_tool(1, up).expect("the guest");
        frames(run, 25);
        assert_eq!(run.tools()[0].holder, Holder::Hand);
        assert!((pose(run, 0).translation - there.translation).length() < 1e-15);
        assert!((pose(run, 1).translation - up.translation).length() < 1e-15);
        assert!(run.tools()[1].is_there && run.tool_parts().len() == 2);
        assert!(run.report().tools[0].touches > 0);
        run.put_away(1).expect("the guest");
        assert!(!run.tools()[1].is_there && run.tool_parts().len() == 1);
        assert_eq!(run.move_tool(1, up), Err(LiveError::NoTool { tool: 1 }));
        frames(run, 2);
    });
    assert_eq!((live.tools.len(), live.hands.len()), (0, 2));
}

/// Samples are refined under a tool that presses: what it meets goes on as it was.
#[test]
fn a_thinner_tool_leaves_what_another_one_meets() {
    let run = || {
        let mut run: Simulation<f64> =
            simulation(BLOCK, &[("solver.precision", "f64"), ("world.gravity", "1 m/s^2")]);
        let probe = run.take_tool(at("probe", vec3(0.015, 0.015, 0.024))).expect("a probe");
        go(&mut run, probe, vec3(0.0, 0.0, -0.004), Vec3::ZERO, 10);
        // Friction holds it to the side.
        go(&mut run, probe, vec3(0.003, 0.0, 0.0), Vec3::ZERO, 8);
        frames(&mut run, 20);
        run
    };
    let (mut alone, mut joined) = (run(), run());
    let before = joined.assembly().builder.samples().len();
    joined.take_tool(at("needle", vec3(0.1, 0.0, 0.05))).expect("a needle");
    frames(&mut alone, 1);
    frames(&mut joined, 1);
    assert_eq!(joined.assembly().builder.samples().len(), 4 * before);
    let [alone, joined] = [&alone, &joined].map(|run| run.report().tools[0].clone());
    let force = Vec3::<f64>::from_f64(alone.force);
    let off = (Vec3::from_f64(joined.force) - force).length();
    let side = force.x.abs();
    assert!(side > 0.1 * force.length(), "{alone:?}");
    assert!(off < 0.1 * force.length(), "{alone:?}, {joined:?}");
    assert!((joined.force[0] - alone.force[0]).abs() < 0.2 * side, "{alone:?}, {joined:?}");
}

/// Without tools, and after all of them have left, nothing is different from a scene that never had any.
#[test]
fn a_tool_that_touches_nothing_changes_nothing() {
    let falls = [("world.gravity", "3 m/s^2")];
    let mut alone: Simulation<f32> = simulation(BLOCK, &falls);
    let mut visited: Simulation<f32> = simulation(BLOCK, &falls);
    frames(&mut alone, 20);
    frames(&mut visited, 5);
    let probe = visited.take_tool(at("probe", vec3(0.1, 0.1, 0.1))).expect("a probe");
    go(&mut visited, probe, vec3(0.0, 0.0, 0.02), vec3(1.0, 0.0, 0.0), 8);
    visited.put_away(probe).expect("a probe");
    frames(&mut visited, 7);
    assert_eq!(alone.state(), visited.state());
}

#[test]
fn a_force_drives_jaws_until_a_hand_turns_them() {
    repeats::<f32>(BLOCK, &[("solver.method", "xpbd")], |run| {
        frames(run, 2);
        let clamp = run.take_tool(at("clamp", vec3(0.015, 0.015, 0.05))).expect("a clamp");
        let wide = run.tools()[clamp].jaw_angle.expect("jaws");
        frames(run, 1);
        assert!(run.tools()[clamp].jaw_angle.expect("jaws") < wide, "it closes at once");
        frames(run, 5);
        let closing = run.tools()[clamp].jaw_angle.expect("jaws");
        assert!(closing < wide - 0.1, "{closing} rad of {wide} rad");
        run.open_jaws(clamp, 0.9).expect("an angle");
        frames(run, 1);
        assert_eq!(run.tools()[clamp].jaw_angle, Some(0.9));
        frames(run, 3);
        assert_eq!(run.tools()[clamp].jaw_angle, Some(0.9));
    });
}

#[test]
fn a_tool_that_stands_still_needs_no_keys() {
    let mut run: Simulation<f32> = simulation(BLOCK, &[]);
    let probe = run.take_tool(at("probe", vec3(0.1, 0.1, 0.1))).expect("a probe");
    let there = pose(&run, probe);
    for _ in 0..30 {
        run.move_tool(probe, there).expect("a pose");
        frames(&mut run, 1);
    }
    assert_eq!(run.scene().tools[probe].hands[0].keys.len(), 2);
    assert_eq!(pose(&run, probe), there);
}

#[test]
fn reset_fork_and_resume_know_tools_in_hands() {
    let text = format!("{BLOCK}{TOOLS}");
    let quiet = [("output.force_error", "false")];
    let mut run: Simulation<f32> = simulation(&text, &quiet);
    frames(&mut run, 4);
    let pliers = run.take_tool(at("pliers", vec3(0.022, 0.012, 0.034))).expect("pliers");
    go(&mut run, pliers, vec3(0.0, 0.0, -0.004), Vec3::ZERO, 4);
    run.open_jaws(pliers, 0.3).expect("an angle");
    let there = pose(&run, 0);
    run.move_tool(0, there).expect("the ball");
    frames(&mut run, 4);
    // Taken, and not there yet: that is saved as well.
    run.take_tool(at("needle", vec3(0.1, 0.0, 0.05))).expect("a needle");
    let mut fork: Simulation<f32> = run.fork(&[]).expect("a fork");
    assert_eq!(fork.live(), run.live());
    let saved = run.save();
    let written = format!("{text}{}", run.live().text(run.scene()));
    let mut resumed = simulation::<f32>(&written, &quiet).resume(&saved).expect("the same scene");
    frames(&mut run, 8);
    frames(&mut fork, 8);
    frames(&mut resumed, 8);
    assert_eq!(run.state(), fork.state());
    assert!(run.save() == resumed.save());
    run.reset().expect("a reset");
    let mut fresh: Simulation<f32> = simulation(&text, &quiet);
    assert_eq!((run.frame(), run.live()), (0, Live::default()));
    assert_eq!((run.state(), run.report()), (fresh.state(), fresh.report()));
    assert_eq!(run.model().samples.len(), fresh.model().samples.len());
    frames(&mut run, 12);
    frames(&mut fresh, 12);
    assert!(run.save() == fresh.save());
}

#[test]
fn what_tools_cannot_do_says_what_to_do() {
    let mut run: Simulation<f32> = simulation(BLOCK, &[]);
    let inside = run.take_tool(at("probe", vec3(0.015, 0.015, 0.012))).expect_err("tissue");
    assert!(matches!(inside, LiveError::Patch(AssembleError::ToolInside { .. })), "{inside}");
    let thin = read_tray("tray.toml", &TRAY.replace("2 mm\"\nlength", "0.2 mm\"\nlength"));
    let mut thin = thin.expect("a tray").swap_remove(1);
    thin.placement.translation = vec3(0.1, 0.1, 0.1);
    let thin = run.take_tool(thin).expect_err("a needle between samples");
    assert!(matches!(thin, LiveError::Patch(AssembleError::ThinTool { .. })), "{thin}");
    let mut bent = at("probe", vec3(0.1, 0.1, 0.1));
    bent.placement.rotation = bent.placement.rotation * 2.0;
    assert!(matches!(run.take_tool(bent), Err(LiveError::Pose { .. })));
    let probe = run.take_tool(at("probe", vec3(0.1, 0.1, 0.1))).expect("a probe");
    let far = RigidTransform { translation: vec3(f64::NAN, 0.0, 0.0), ..pose(&run, probe) };
    assert!(matches!(run.move_tool(probe, far), Err(LiveError::Pose { .. })));
    assert!(matches!(run.open_jaws(probe, 0.3), Err(LiveError::NoJaws { .. })));
    assert!(matches!(run.lock_jaws(probe, true), Err(LiveError::NoJaws { .. })));
    let pliers = run.take_tool(at("pliers", vec3(0.1, 0.1, 0.1))).expect("pliers");
    for angle in [-1.0, 3.0, f64::NAN] {
        assert!(matches!(run.open_jaws(pliers, angle), Err(LiveError::Jaws { .. })), "{angle}");
    }
    assert_eq!(run.put_away(7), Err(LiveError::NoTool { tool: 7 }));
    run.put_away(probe).expect("a probe");
    assert_eq!(run.put_away(probe), Err(LiveError::NoTool { tool: probe }));
    assert_eq!(run.scene().tools.len(), 2);
    let fixed = [("solver.method", "xpbd"), ("solver.rebase", "false")];
    let mut run: Simulation<f32> = simulation(BLOCK, &fixed);
    let error = run.take_tool(at("probe", vec3(0.1, 0.1, 0.1))).expect_err("no contact");
    assert!(matches!(error, LiveError::Simulation(SimulationError::Step(_))), "{error}");
}

#[test]
fn hands_that_cannot_be_are_told_before_the_run() {
    let both = format!("{BLOCK}{TOOLS}");
    let hand = |rest: &str| format!("{both}\n[[hand]]\ntool = \"ball\"\nfrom = \"1 s\"\n{rest}");
    for (text, expected) in [
        (hand("").replace("tool = \"ball\"", "tool = \"bal\""), "did you mean `ball`?"),
        (hand("keys = [{ time = 0 }]"), "before it takes the tool"),
        (hand("keys = [{ time = \"2 s\" }, { time = \"2 s\" }]"), "times must ascend"),
        (hand("jaw = [{ time = \"2 s\", angle = 0 }]"), "without jaws"),
        (hand("end = 0"), "before it takes the tool"),
        (hand(&hand("")[both.len()..].replace("1 s", "0.5 s")), "put this one above it"),
        (both.replace("end = \"0.6 s\"", "end = \"0.05 s\""), "swap the two"),
        (
            both.replace(
                "begin =",
                "rotation_vector = [\"1 rad\", 0, 0]\nrotation_angle = \"1 rad\"\nbegin =",
            ),
            "exclude",
        ),
    ] {
        let error = Scene::parse("hands.toml", &text, &[]).expect_err(expected).to_string();
        assert!(error.contains("hands.toml, line") && error.contains(expected), "{error}");
    }
}
