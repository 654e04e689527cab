//! Tools in the window, without a display: what is seen of them.

mod common;

use common::Window;
use eframe::egui::{Key, Pos2, Role, Vec2, vec2};
use egui_kittest::kittest::Queryable;
use std::path::{Path, PathBuf};
use std::time::Duration;
use viscera::record::Recording;
use viscera::scalar::Vec3;
use viscera::scalar::rigid::RigidTransform;
use viscera::scene::Scene;
use viscera::simulation::{Assembly, Simulation};
use viscera::solver::FrameReading;
use viscera_stage::{Coloring, ToolAct};
use viscera_view::app::App;
use viscera_view::controller::{News, Sticks};
use viscera_view::curves::Source;

#[test]
fn tools_of_a_scene_are_seen_with_their_forces() {
    let mut window = Window::running("palpation", &[]);
    let still = window.pixels();
    window.wait("a touch", |app| {
        let run = app.snapshot().and_then(|snapshot| snapshot.runs.first());
        run.is_some_and(|run| {
            run.tools.iter().any(|tool| tool.met.touches > 0 && tool.force() > 0.2)
        })
    });
    let tool = window.run(0).tools[0].clone();
    assert!(tool.met.error.is_some_and(|error| error > 0.0 && error < tool.force()), "{tool:?}");
    assert!(window.run(0).ledger.is_some_and(|ledger| ledger.work > 0.0));
    // Steel is grey, and moves.
    let grey = |[r, g, b]: [u8; 3]| r.abs_diff(g) < 16 && b >= r && r < 170;
    let pixels = window.pixels();
    let changed = pixels.iter().zip(&still).filter(|(new, old)| new != old && grey(**new)).count();
    assert!(changed > 200, "{changed} pixels of steel");
    let source = Source::Tool(tool.met.name.clone());
    let last = window.harness.state().forces().last(&source).expect("a curve");
    assert!(last.forces[0] > 0.2 && last.error.is_some());
    window.picture("palpation");
}

/// Some drivers compile kernels for seconds: the window says what it waits for, and goes on with the tools there.
#[test]
fn a_graphics_processor_that_is_chosen_computes_tools_as_well() {
    let few = [("solver.method", "quasi_newton"), ("solver.iterations", "4")];
    let mut window = Window::running("grasp", &few);
    let menu = window.harness.get_by_role_and_label(Role::ComboBox, "device");
    menu.scroll_to_me();
    (0..4).for_each(|_| window.harness.step());
    window.harness.get_by_role_and_label(Role::ComboBox, "device").click_accesskit();
    (0..4).for_each(|_| window.harness.step());
    window.harness.get_by_label("GPU").click_accesskit();
    window.wait("a message", |app| {
        app.messages().busy.as_ref().is_some_and(|text| text.contains("kernels"))
    });
    window.wait("the device", |app| app.messages().busy.is_none());
    let number = window.harness.state().snapshot().expect("a frame").number;
    window
        .wait("frames", |app| app.snapshot().is_some_and(|snapshot| snapshot.number > number + 1));
    assert!(window.texts().is_empty(), "{:?}", window.texts());
    assert!(!window.run(0).tools.is_empty());
    assert!(window.harness.query_by_label_contains("as asked for").is_some());
}

/// A coarse slab under a probe, computed by the graphics processor.
const ON_DEVICE: &[(&str, &str)] = &[
    ("solver.device", "gpu"),
    ("solver.method", "quasi_newton"),
    ("solver.iterations", "3"),
    ("solver.substeps", "1"),
    ("body.tissue.cells", "[8, 4, 2]"),
];

/// Colours of values by their names.
const COLORS: [(&str, Coloring); 4] = [
    ("displacement", Coloring::Displacement),
    ("strain", Coloring::Strain),
    ("contact", Coloring::Pressure),
    ("stress", Coloring::Stress),
];

/// The picture after so many frames from the beginning, one by one.
fn stepped(window: &mut Window, frames: u64) -> Vec<[u8; 3]> {
    window.press("Pause");
    window.press("Reset");
    let number = |app: &App| app.snapshot().map(|snapshot| snapshot.number);
    window.wait("the beginning", |app| number(app) == Some(0));
    for frame in 1..=frames {
        window.press("Step");
        window.wait("a frame", |app| number(app) == Some(frame));
    }
    window.pixels()
}

/// Tissue that stays on the window's device is drawn from there: the same picture, and the mouse finds it where it is.
#[test]
fn tissue_that_stays_on_the_device_is_seen_and_taken() {
    let mut apart = Window::open("palpation", ON_DEVICE);
    apart.start();
    assert!(apart.run(0).on_device.is_none() && apart.run(0).unread == 0);
    let expected = stepped(&mut apart, 24);
    let mut window = Window::open_on_one_device("palpation", ON_DEVICE);
    window.start();
    assert!(window.run(0).on_device.is_some());
    assert!(stepped(&mut window, 24) == expected, "another picture");
    assert!(
        apart.run(0).tools[0].force() > 0.0 && apart.run(0).positions == window.run(0).positions
    );
    // No account is kept there: none is shown.
    assert!(window.run(0).ledger.is_none());
    assert!(window.harness.query_by_label_contains("work of tools").is_none());
    window.picture("stays-on-the-device");
    for (label, coloring) in COLORS {
        let [expected, found] = [&mut apart, &mut window].map(|window| {
            window.press(label);
            let is_shown = |app: &App| app.snapshot().is_some_and(|s| s.coloring == coloring);
            window.wait("its colours", is_shown);
            window.pixels()
        });
        window.picture(&format!("stays-{label}"));
        // Colours are steps of values, and values of both sides are rounded.
        let differs = |(a, b): &(&[u8; 3], &[u8; 3])| (0..3).any(|i| a[i].abs_diff(b[i]) > 4);
        let count = expected.iter().zip(&found).filter(differs).count();
        assert!(count * 1000 < found.len(), "{label}: {count} of {} pixels", found.len());
    }

    // While it runs, most frames are not read; a press is answered once positions are known.
    window.press("Run");
    let is_unread = |app: &App| app.snapshot().is_some_and(|snapshot| snapshot.runs[0].unread > 0);
    window.wait("a frame that stays", is_unread);
    let middle = window.view().center();
    window.harness.hover_at(middle);
    window.harness.step();
    window.harness.drag_at(middle);
    window.harness.step();
    window.wait("a grip", |app| app.holds().list().len() == 1);
    window.harness.hover_at(middle + vec2(0.0, -40.0));
    window.wait("a hold", |app| {
        app.snapshot().is_some_and(|snapshot| {
            let run = &snapshot.runs[0];
            run.unread == 0 && run.held.first().is_some_and(|hold| hold.force.length() > 1e-3)
        })
    });
    window.harness.drop_at(middle + vec2(0.0, -40.0));
    window.wait("a clean release", |app| {
        app.holds().list().is_empty()
            && app.snapshot().is_some_and(|snapshot| snapshot.runs[0].unread > 0)
    });
    assert!(window.texts().is_empty(), "{:?}", window.texts());
}

/// The working end of the tool in a hand, in the window.
fn end_of(window: &Window, hand: u64) -> Pos2 {
    let run = window.run(0);
    let tool = run.tools.iter().find(|tool| tool.hand == Some(hand)).expect("a tool in hand");
    window.harness.state().place(tool.pose.translation).expect("in front of the viewer")
}

/// Drags an instrument by a way [points], frame by frame, and holds it there until it has arrived.
fn lead(window: &mut Window, hand: u64, way: Vec2) {
    let from = end_of(window, hand);
    drag(window, from, way);
    arrive(window, hand);
}

fn drag(window: &mut Window, from: Pos2, way: Vec2) {
    window.harness.hover_at(from);
    window.harness.step();
    window.harness.drag_at(from);
    window.harness.step();
    for step in 1..=3 {
        window.harness.hover_at(from + way * (step as f32 / 3.0));
        window.harness.step();
    }
    window.harness.drop_at(from + way);
    window.harness.step();
}

/// Waits until a hand's instrument is where it is led to.
fn arrive(window: &mut Window, hand: u64) {
    window.wait("an instrument that arrives", |app| {
        let held = app.instruments().list().iter().find(|held| held.id == hand);
        let run = app.snapshot().and_then(|snapshot| snapshot.runs.first());
        let tool = run.and_then(|run| run.tools.iter().find(|tool| tool.hand == Some(hand)));
        held.zip(tool).is_some_and(|(held, tool)| {
            (held.pose.translation - tool.pose.translation).length() < 1e-9
        })
    });
}

/// Takes an instrument from the tray by its button; the legend of curves may have its name as well.
fn take(window: &mut Window, name: &str) -> u64 {
    window.harness.get_by_role_and_label(Role::Button, name).click();
    window.harness.step();
    window.harness.step();
    let hand = window.harness.state().instruments().active().map_or(0, |held| held.id);
    window.wait("an instrument", |app| {
        let run = app.snapshot().and_then(|snapshot| snapshot.runs.first());
        run.is_some_and(|run| run.tools.iter().any(|tool| tool.hand == Some(hand)))
    });
    hand
}

fn force(window: &Window, hand: u64) -> f64 {
    let tool = window.run(0).tools.iter().find(|tool| tool.hand == Some(hand));
    tool.map_or(0.0, viscera_stage::ToolSnapshot::force)
}

/// What a debug build computes many frames of, without what the scene itself does.
const FAST: &[(&str, &str)] = &[
    ("solver.accuracy", "draft"),
    ("body.slab.cells", "[9, 9, 3]"),
    ("motion.forceps.release", "1 ms"),
];

/// Takes a probe from the tray, presses it into the tissue and puts it away.
fn palpate(window: &mut Window) {
    let probe = take(window, "probe");
    window.picture("taken");
    press_down(window, probe, 0.3);
    window.picture("palpated");
    window.press("put away");
    window.wait("an empty hand", |app| {
        let run = app.snapshot().and_then(|snapshot| snapshot.runs.first());
        app.instruments().list().is_empty() && run.is_some_and(|run| run.tools.is_empty())
    });
    // Its curve stays.
    let source = Source::Tool("probe".into());
    assert!(window.harness.state().forces().last(&source).is_some());
    assert_eq!(window.texts(), [""; 0]);
}

/// Ends the recording and saves the scene: both do the same once more, to the bit.
fn repeat(window: &mut Window, tools: usize) {
    let recording = end_recording(window);
    pause(window);
    let path = window.folder.path().join("way.toml");
    let scene = window.save(&path);
    assert_eq!(scene.tools.len(), tools);
    let snapshot = window.harness.state().snapshot().expect("a frame");
    assert_eq!(scene.frame_count(), snapshot.number);
    let repeated = run(scene);
    assert_eq!(window.run(0).positions, repeated.state().positions);
    replay(&recording);
}

#[test]
fn a_new_users_way() {
    let mut window = Window::running("grab", FAST);
    window.press("Record run");
    palpate(&mut window);
    repeat(&mut window, 1);
}

/// Holds a key down for so many frames of the window.
fn hold_key(window: &mut Window, key: Key, frames: usize) {
    window.harness.key_down(key);
    for _ in 0..frames {
        window.harness.step();
    }
    window.harness.key_up(key);
    window.harness.step();
}

fn frames(window: &mut Window, count: u64) {
    let number = window.harness.state().snapshot().map_or(0, |snapshot| snapshot.number);
    window.wait("frames", |app| {
        app.snapshot().is_some_and(|snapshot| snapshot.number >= number + count)
    });
}

fn pose_of(window: &Window, hand: u64) -> Vec3<f64> {
    let list = window.harness.state().instruments().list();
    list.iter().find(|held| held.id == hand).expect("in hand").pose.translation
}

/// The surfaces' highest point [m].
fn height(window: &Window) -> f32 {
    window.run(0).positions.iter().fold(f32::MIN, |most, x| most.max(x.z))
}

/// Leads an instrument down until it meets a force [N].
fn press_down(window: &mut Window, hand: u64, wanted: f64) {
    for _ in 0..40 {
        if force(window, hand) > wanted {
            break;
        }
        let way = if force(window, hand) > 0.0 { 8.0 } else { 16.0 };
        lead(window, hand, vec2(0.0, way));
    }
    assert!(force(window, hand) > wanted, "{} N", force(window, hand));
}

/// Palpates, grasps, pulls, has a second instrument, lets go; saves, and what is saved does the same.
#[test]
#[ignore = "slow: many frames of the window"]
fn a_new_users_way_at_length() {
    let mut window = Window::running("grab", FAST);
    window.press("Record run");
    palpate(&mut window);
    let grasper = take(&mut window, "grasper");
    window.picture("way-1-grasper");
    hold_key(&mut window, Key::V, 40);
    press_down(&mut window, grasper, 1.5);
    window.picture("way-2-down");
    hold_key(&mut window, Key::C, 90);
    frames(&mut window, 40);
    window.press("lock");
    frames(&mut window, 2);
    window.picture("way-3-closed");
    let before = height(&window);
    lead(&mut window, grasper, vec2(0.0, -60.0));
    frames(&mut window, 10);
    window.picture("way-4-pulled");
    let pulled = force(&window, grasper);
    println!("pulled: {pulled} N, {} m", height(&window) - before);
    assert!(pulled > 0.5, "{pulled} N");
    // A second instrument, led by other keys while the first one holds.
    let probe = take(&mut window, "probe");
    window.harness.key_press(Key::Tab);
    window.harness.step();
    let active = window.harness.state().instruments().active().map(|held| held.id);
    assert_eq!(active, Some(grasper));
    let (held, led) = (pose_of(&window, grasper), pose_of(&window, probe));
    hold_key(&mut window, Key::K, 40);
    assert!((pose_of(&window, probe) - led).length() > 1e-3);
    assert_eq!(pose_of(&window, grasper), held);
    arrive(&mut window, probe);
    window.picture("way-5-two");
    window.press("lock");
    hold_key(&mut window, Key::V, 90);
    frames(&mut window, 60);
    window.picture("way-6-open");
    assert_eq!(force(&window, grasper), 0.0);
    assert_eq!(window.texts(), [""; 0]);
    repeat(&mut window, 3);
}

fn pause(window: &mut Window) {
    window.harness.key_press(Key::Space);
    window.wait("a pause", |app| !app.is_playing());
    // What the thread had begun is finished.
    std::thread::sleep(Duration::from_millis(500));
    window.harness.step();
    window.harness.step();
}

/// Ends a recording of the run and waits for its file.
fn end_recording(window: &mut Window) -> PathBuf {
    window.press("Stop recording the run");
    window.wait("a recording", |app| {
        app.messages().texts().any(|text| text.contains("viscera replay"))
    });
    let path = window.folder.path().join("pictures/grab-0001.viscera");
    assert!(path.exists());
    path
}

/// Has a recorded run once more: every frame has the same bits.
fn replay(path: &Path) -> u64 {
    let bytes = std::fs::read(path).expect("a recording");
    let recording = Recording::read(&bytes).expect("a whole recording");
    let scene = recording.scene(0, &[]).expect("a legal scene");
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned())).expect("an assembly");
    let simulation = Simulation::<f32>::new(scene, assembly).expect("a simulation");
    let started = recording.start(0, simulation, &[]);
    let (mut simulation, mut player) = started.unwrap_or_else(|error| panic!("{error}"));
    let mut frames = 0;
    while player.step(&mut simulation).unwrap_or_else(|error| panic!("{error}")) {
        frames += 1;
    }
    assert_eq!(frames, recording.frame_count());
    frames
}

/// What `viscera run` computes of a scene.
fn run(scene: Scene) -> Simulation<f32> {
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned())).expect("an assembly");
    let frames = scene.frame_count();
    let mut simulation = Simulation::new(scene, assembly).expect("a simulation");
    for _ in 0..frames {
        simulation.advance_frame().expect("a frame");
    }
    simulation
}

#[test]
fn a_window_that_is_closed_while_it_records_leaves_a_recording() {
    let mut window = Window::running("grab", FAST);
    window.press("Record run");
    let probe = take(&mut window, "probe");
    hold_key(&mut window, Key::ArrowDown, 12);
    arrive(&mut window, probe);
    window.harness.state_mut().close();
    let Window { harness, folder, .. } = window;
    drop(harness);
    let path = folder.path().join("pictures/grab-0001.viscera");
    assert!(replay(&path) > 3);
}

#[test]
fn an_unplugged_controller_is_told_and_its_instrument_stands_still() {
    let mut window = Window::running("grab", FAST);
    let probe = take(&mut window, "probe");
    let before = pose_of(&window, probe);
    let app = window.harness.state_mut();
    app.hear_controller(&[News::Connected("a pad".into())]);
    app.hear_controller(&[News::Sticks(Sticks { left: [1.0, 0.0], ..Sticks::default() })]);
    frames(&mut window, 4);
    let led = pose_of(&window, probe);
    assert!((led - before).length() > 1e-3, "{led:?}");
    window.harness.state_mut().hear_controller(&[News::Unplugged]);
    let gone = pose_of(&window, probe);
    frames(&mut window, 4);
    assert_eq!(pose_of(&window, probe), gone);
    let texts = window.texts();
    assert!(texts.iter().any(|text| text.contains("a pad was unplugged")), "{texts:?}");
}

#[test]
fn an_instrument_that_is_thrown_through_tissue_follows_at_a_hands_speed() {
    let mut window = Window::running("grab", FAST);
    let probe = take(&mut window, "probe");
    let from = end_of(&window, probe);
    // Across all of the view between two frames of the window.
    window.harness.hover_at(from);
    window.harness.step();
    window.harness.drag_at(from);
    window.harness.step();
    window.harness.hover_at(from + vec2(-60.0, 380.0));
    window.harness.step();
    window.harness.drop_at(from + vec2(-60.0, 380.0));
    window.harness.step();
    let mut places = Vec::new();
    for _ in 0..12 {
        frames(&mut window, 1);
        let snapshot = window.harness.state().snapshot().expect("a frame");
        places.push((snapshot.number, snapshot.runs[0].tools[0].pose.translation));
    }
    for two in places.windows(2) {
        let time = (two[1].0 - two[0].0) as f64 / 60.0;
        let speed = (two[1].1 - two[0].1).length() / time;
        assert!(speed < 1.001 * viscera_stage::FASTEST, "{speed} m/s");
    }
    assert!(window.harness.state().messages().failure.is_none());
    assert!(window.run(0).positions.iter().all(|x| x.is_finite()));
    // It goes on: nothing is lost of the hand.
    window.press("put away");
}

/// Takes every instrument of the tray in these scenes, larger where the mesh is coarse.
fn take_all_in(names: impl Fn(&str) -> bool) {
    for built_in in viscera_resources::BUILT_IN.iter().filter(|scene| names(scene.name)) {
        let scene = Scene::parse(built_in.name, built_in.text, &[]).expect("a legal scene");
        let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned())).expect("meshes");
        let mut run = viscera_stage::build(scene, assembly, None).expect("a simulation");
        for (hand, instrument) in (1..).zip(viscera_stage::tray().expect("a legal tray")) {
            let name = instrument.name.clone();
            let above = Vec3 { x: 0.0, y: 0.0, z: 0.5 };
            let pose = RigidTransform::about(Vec3::ZERO, Vec3::ZERO, above);
            let take = ToolAct::Take { hand, instrument: Box::new(instrument), pose };
            let taken = run.act(&take).and_then(|()| run.advance(FrameReading::State));
            assert!(taken.is_ok(), "{}: {name}: {taken:?}", built_in.name);
        }
    }
}

#[test]
fn every_instrument_can_be_taken_in_every_scene() {
    take_all_in(|name| ["cantilever", "grasp"].contains(&name));
}

#[test]
#[ignore = "slow: meshes of all scenes"]
fn every_instrument_can_be_taken_in_every_scene_at_length() {
    take_all_in(|_| true);
}
