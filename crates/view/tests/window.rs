//! Drives the window as a person would, without a display: presses, drags, sliders, buttons, keys.

mod common;

use common::Window;
use eframe::egui::{Key, Modifiers, Role, vec2};
use egui_kittest::kittest::Queryable;
use std::path::Path;
use std::time::Duration;
use viscera::material::PRESETS;
use viscera::scalar::Vec3;
use viscera::scene::Scene;
use viscera::settings::{Acceleration, Colors, Count, Method};
use viscera::simulation::{Assembly, Simulation};
use viscera_view::choices::Side;

fn farthest(a: &[Vec3<f32>], b: &[Vec3<f32>]) -> f32 {
    a.iter().zip(b).fold(0.0, |most, (a, b)| most.max((*a - *b).length()))
}

#[test]
fn pressed_tissue_follows_the_pointer_and_is_let_go_cleanly() {
    let mut window = Window::running("liver_lifted", &[("time.duration", "1 s")]);
    let middle = window.view().center();
    let before = window.run(0).positions.clone();
    let still = window.pixels();
    window.harness.hover_at(middle);
    window.harness.step();
    window.harness.drag_at(middle);
    window.harness.step();
    assert_eq!(window.harness.state().holds().list().len(), 1, "a press in the middle takes hold");
    for step in 1..=8 {
        window.harness.hover_at(middle + vec2(0.0, -10.0 * step as f32));
        window.harness.step();
    }
    window.wait("a force", |app| {
        let hold = app.snapshot().and_then(|snapshot| snapshot.runs[0].held.first());
        hold.is_some_and(|hold| hold.force.length() > 0.5)
    });
    let hold = window.run(0).held[0];
    // The spring pulls upwards, as the pointer did.
    assert!(hold.force.z > 0.4 && hold.target.z > hold.place.z, "{hold:?}");
    assert!(farthest(&before, &window.run(0).positions) > 0.002);
    let changed = window.pixels().iter().zip(&still).filter(|(new, old)| new != old).count();
    assert!(changed > 1000, "{changed} pixels changed");

    window.harness.drop_at(middle + vec2(0.0, -80.0));
    window.wait("a clean release", |app| {
        app.holds().list().is_empty()
            && app.snapshot().is_some_and(|snapshot| snapshot.runs[0].held.is_empty())
    });
}

#[test]
fn what_is_kept_stays_held_until_escape() {
    let mut window = Window::running("grab", &[]);
    window.press("keep");
    let middle = window.view().center();
    window.harness.hover_at(middle);
    window.harness.step();
    window.harness.drag_at(middle);
    window.harness.step();
    window.harness.hover_at(middle + vec2(30.0, 0.0));
    window.harness.step();
    window.harness.drop_at(middle + vec2(30.0, 0.0));
    window.harness.step();
    window.wait("a hold", |app| {
        app.snapshot().is_some_and(|snapshot| snapshot.runs[0].held.len() == 1)
    });
    window.harness.key_press(Key::Escape);
    window.wait("a release", |app| {
        let is_free = app.snapshot().is_some_and(|snapshot| snapshot.runs[0].held.is_empty());
        app.holds().list().is_empty() && is_free
    });
}

#[test]
fn a_slider_changes_the_tissue_and_undo_takes_it_back() {
    let mut window = Window::running("liver_lifted", &[]);
    for young in [2.0, 20.0] {
        window.slide("stiffness E", young);
        assert_eq!(window.scene().bodies[0].material.young(), 1e3 * young);
    }
    let number = window.harness.state().snapshot().expect("a frame").number;
    window.wait("frames after the change", |app| {
        app.snapshot().is_some_and(|snapshot| snapshot.number > number + 2)
    });
    window.harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    window.harness.step();
    window.harness.step();
    assert_eq!(window.scene().bodies[0].material.young(), 2e3);
    window.press("Redo");
    assert_eq!(window.scene().bodies[0].material.young(), 20e3);
}

#[test]
fn a_typed_number_is_one_change_when_it_is_finished() {
    let mut window = Window::running("grab", &[("solver.method", "xpbd")]);
    let young = |window: &Window| window.scene().bodies[0].material.young();
    let before = young(&window);
    // Left by Escape it was never typed.
    window.type_number("stiffness E", "77", Key::Escape);
    assert_eq!(young(&window), before);
    window.type_number("stiffness E", "12.5", Key::Enter);
    assert_eq!(young(&window), 12.5e3);
    window.type_number("iterations", "7", Key::Tab);
    assert_eq!(window.scene().solver.iterations(), 7);
    assert_eq!(window.texts(), [""; 0]);
    // What the simulation saw is what it was changed to.
    let path = window.folder.path().join("typed.toml");
    let saved = window.save(&path);
    let changes: Vec<_> = saved.changes.iter().flat_map(|change| &change.settings).collect();
    let values: Vec<_> = changes.iter().map(|(_, value)| value.as_str()).collect();
    assert_eq!(values, ["12500 Pa", "7"], "{changes:?}");
    assert_eq!(window.undo_steps(), 2);
}

#[test]
fn the_quasi_newton_method_chooses_its_counts_until_a_box_is_unticked() {
    let mut window = Window::running("liver_lifted", &[]);
    window.press("Jacobi 40");
    window.press("default");
    let solver = |window: &Window| window.scene().solver.clone();
    assert_eq!(solver(&window).method, Method::Auto);
    assert_eq!((solver(&window).substeps, solver(&window).iterations), (Count::Auto, Count::Auto));
    let number = window.harness.state().snapshot().expect("a frame").number;
    window.wait("frames of the new method", |app| {
        app.snapshot().is_some_and(|snapshot| snapshot.number > number + 20)
    });
    window.picture("quasi-newton");
    window.press("automatic passes");
    assert_eq!(solver(&window).iterations, Count::Of(8));
    window.slide("passes", 12.0);
    assert_eq!(solver(&window).iterations, Count::Of(12));
    window.press("automatic passes");
    assert_eq!(solver(&window).iterations, Count::Auto);
    window.press("automatic substeps");
    assert_eq!(solver(&window).substeps, Count::Of(1));
    assert_eq!(window.texts(), [""; 0]);
}

#[test]
fn a_drag_of_a_number_acts_at_once_and_is_one_step_back() {
    let mut window = Window::running("grab", &[]);
    let young = |window: &Window| window.scene().bodies[0].material.young();
    let mut seen = vec![young(&window)];
    for role in [Role::Slider, Role::SpinButton] {
        let node = window.harness.get_by_role_and_label(role, "stiffness E");
        let start = node.rect().center();
        window.harness.hover_at(start);
        window.harness.step();
        window.harness.drag_at(start);
        window.harness.step();
        for step in 1..=3 {
            window.harness.hover_at(start + vec2(8.0 * step as f32, 0.0));
            window.harness.step();
            seen.push(young(&window));
        }
        // The last movement and the release are one event for a slow window.
        window.harness.hover_at(start + vec2(30.0, 0.0));
        window.harness.drop_at(start + vec2(30.0, 0.0));
        window.harness.step();
        window.harness.step();
    }
    seen.dedup();
    assert_eq!(seen.len(), 7, "{seen:?}");
    assert_eq!(window.undo_steps(), 2);
}

#[test]
fn what_lies_beyond_a_rail_is_kept_and_what_cannot_be_is_refused_with_its_range() {
    let mut window = Window::running(
        "grab",
        &[
            ("body.slab.material.young", "1500 kPa"),
            ("solver.substeps", "1"),
            ("solver.method", "xpbd"),
        ],
    );
    let young = |window: &Window| window.scene().bodies[0].material.young();
    let shown = |window: &Window| {
        let number = window.harness.get_by_role_and_label(Role::SpinButton, "stiffness E");
        number.value().expect("a number")
    };
    assert_eq!((young(&window), shown(&window).as_str()), (1500e3, "1500 kPa"));
    for preset in PRESETS.iter().filter(|preset| preset.young > 200e3) {
        let name = preset.name.replace('_', " ");
        let menu = window.harness.get_by_role_and_label(Role::ComboBox, "tissue");
        // Chosen without a pointer, its list stays open.
        if window.harness.query_by_label(&name).is_none() {
            menu.click();
            (0..4).for_each(|_| window.harness.step());
            window.picture("presets");
        }
        window.harness.get_by_label(&name).click_accesskit();
        window.harness.step();
        window.harness.step();
        assert_eq!(young(&window), preset.young, "{name}");
        // To go into a number and out again changes nothing.
        window.type_number("stiffness E", "", Key::Enter);
        assert_eq!(young(&window), preset.young, "{name}");
    }
    window.type_number("stiffness E", "2500.125", Key::Enter);
    assert_eq!(young(&window), 2500.125e3);
    window.type_number("stiffness E", "0.05 MPa", Key::Enter);
    assert_eq!((young(&window), shown(&window).as_str()), (50e3, "50 kPa"));
    assert_eq!(window.texts(), [""; 0]);
    for (name, typed, range) in [
        ("stiffness E", "-5", "above 0"),
        ("stiffness E", "soft", "kPa"),
        ("Poisson's ratio", "0.6", "0.499"),
        ("iterations", "0", "1"),
        ("iterations", "2.5", "whole number"),
        ("relaxation", "3", "2"),
        ("gravity", "-9", "0"),
        ("grip", "0", "1 to"),
        ("speed", "0", "0.001 to 1000"),
    ] {
        let before = window.texts();
        window.type_number(name, typed, Key::Enter);
        let texts = window.texts();
        let news: Vec<_> = texts.iter().filter(|text| !before.contains(text)).collect();
        println!("{name} {typed}: {news:?}");
        assert!(news.len() == 1 && news[0].contains(range), "{name} {typed}: {news:?}");
    }
    assert_eq!(young(&window), 50e3);
}

#[test]
fn inverted_tetrahedra_are_counted_in_words() {
    let mut window = Window::running("grab", &[("solver.substeps", "1")]);
    assert_eq!(window.harness.query_by_label_contains("inverted").map(|_| ()), None);
    window.press("stress");
    window.press("rigid");
    window.press("keep");
    // Pushed through the body and out of the side that is held.
    window.drag(vec2(0.0, 260.0));
    window.wait("inverted tetrahedra", |app| {
        app.snapshot().is_some_and(|snapshot| snapshot.runs[0].measures.inverted > 1)
    });
    window.harness.get_by_label_contains("tetrahedra are inverted");
    window.picture("inverted");
}

#[test]
fn two_solvers_run_side_by_side_from_the_same_start() {
    let mut window = Window::running("grab", &[("solver.substeps", "1")]);
    window.press("A | B");
    window.wait("two frames", |app| {
        app.snapshot().is_some_and(|snapshot| snapshot.runs.len() == 2 && snapshot.number > 3)
    });
    // Equal settings give equal bits.
    assert_eq!(window.run(0).positions, window.run(1).positions);
    window.harness.get_by_label("view A");
    window.harness.get_by_label("view B");
    window.press("reference (converged)");
    assert!(window.harness.state().messages().busy.is_some(), "the window says that it waits");
    let number = window.harness.state().snapshot().expect("a frame").number;
    window.wait("the reference", |app| {
        app.snapshot()
            .is_some_and(|snapshot| snapshot.runs.len() == 3 && snapshot.number > number + 5)
    });
    let apart = farthest(&window.run(0).positions, &window.run(2).positions);
    assert!(apart > 0.0 && apart < 0.05, "{apart} m apart");
    assert_eq!(f64::from(apart), window.run(0).distance(window.run(2)));
    assert!(window.harness.state().messages().busy.is_none());
    window.picture("compared");
}

#[test]
fn a_saved_scene_is_what_was_chosen() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("mine.toml");
    let text = viscera_resources::BUILT_IN.iter().find(|scene| scene.name == "cantilever");
    std::fs::write(&path, text.expect("a built-in scene").text).expect("a file");
    let settings = [("solver.iterations", "7"), ("solver.method", "xpbd")];
    let mut window = Window::running(&path.display().to_string(), &settings);
    window.press("with what was done by hand");
    window.slide("substeps", 3.0);
    // The file that is open may vanish.
    std::fs::remove_file(&path).expect("the file");
    let scene = window.save(&folder.path().join("mine_changed.toml"));
    assert_eq!((scene.solver.iterations(), scene.solver.substeps()), (7, 3));
    assert!(scene.changes.is_empty() && !path.exists());
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

/// Start; drag the liver; stiffen it; Jacobi with 40 iterations; Anderson beside it; a picture; save; run it
/// without a window.
#[test]
fn a_first_visit_ends_in_a_scene_that_repeats_it() {
    let mut window = Window::running("liver_lifted", &[("solver.substeps", "1")]);
    let path = window.folder.path().join("visit.toml");
    window.press("keep");
    window.drag(vec2(20.0, -60.0));
    let young = |window: &Window| window.scene().bodies[0].material.young();
    assert!(young(&window) < 10e3);
    window.slide("stiffness E", 20.0);
    assert_eq!(young(&window), 20e3);
    // Two changes within a frame are one: the next is made when the simulation has gone on with this one.
    let number = window.harness.state().snapshot().expect("a frame").number;
    window.wait("frames of the stiffer liver", |app| {
        app.snapshot().is_some_and(|snapshot| snapshot.number > number + 1)
    });
    window.press("Jacobi 40");
    assert_eq!(
        (window.scene().solver.colors, window.scene().solver.iterations()),
        (Colors::Limited(1), 40)
    );
    let number = window.harness.state().snapshot().expect("a frame").number;
    window.press("A | B");
    window.wait("a second simulation", |app| {
        app.snapshot().is_some_and(|snapshot| snapshot.runs.len() == 2 && snapshot.number > number)
    });
    // It began where the first one is, and is held by the same hand.
    let apart = farthest(&window.run(0).positions, &window.run(1).positions);
    assert!(apart < 0.01, "{apart} m");
    window.harness.get_all_by_label("Anderson 40").last().expect("one for each").click_accesskit();
    window.wait("Anderson", |app| {
        app.session().scene(Side::Second).solver.acceleration == Acceleration::Anderson
    });
    window.press("Picture");
    assert!(window.folder.path().join("pictures/liver_lifted-0001.png").exists());
    window.harness.key_press(Key::Escape);
    window.harness.step();
    window.harness.key_press(Key::Space);
    window.wait("a pause", |app| !app.is_playing());
    // What the thread had begun is finished.
    std::thread::sleep(Duration::from_millis(300));
    window.harness.step();
    window.harness.step();
    let scene = window.save(&path);
    assert_eq!((scene.motions.len(), scene.changes.len()), (2, 2));
    let snapshot = window.harness.state().snapshot().expect("a frame");
    assert_eq!(scene.frame_count(), snapshot.number);
    let repeated = run(scene);
    assert_eq!(window.run(0).positions, repeated.state().positions);
}

#[test]
fn a_picture_and_a_recording_are_whole_files() {
    let mut window = Window::running("grab", &[]);
    window.press("Picture");
    window.press("Record");
    let number = window.harness.state().snapshot().expect("a frame").number;
    window.wait("some frames", |app| {
        app.snapshot().is_some_and(|snapshot| snapshot.number > number + 8)
    });
    // Closed while it records.
    window.harness.state_mut().close();
    let pictures = window.folder.path().join("pictures");
    let png = std::fs::read(pictures.join("grab-0001.png")).expect("a picture");
    assert!(png.starts_with(b"\x89PNG") && png.len() > 5000);
    let file = std::fs::File::open(pictures.join("grab-0001.gif")).expect("a recording");
    let mut decoder = gif::DecodeOptions::new().read_info(file).expect("a GIF");
    let mut delays = Vec::new();
    while let Some(frame) = decoder.read_next_frame().expect("a whole frame") {
        delays.push(f64::from(frame.delay) / 100.0);
    }
    assert!(delays.len() >= 2, "{delays:?}");
    // As long as the window says, which rounds to hundredths.
    let texts = window.texts();
    let reported = texts.iter().find_map(|text| text.strip_suffix(" s of simulated time"));
    let reported = reported.and_then(|text| text.rsplit(' ').next()?.parse::<f64>().ok());
    let (reported, played) = (reported.expect("a time"), delays.iter().sum::<f64>());
    assert!(
        (played - reported).abs() <= 0.015 && reported > 8.0 / 60.0,
        "{played} s, reported {reported} s"
    );
}

#[test]
fn what_cannot_be_opened_is_said_and_the_first_scene_shown() {
    let window = Window::running("no_such_scene.toml", &[]);
    let texts: Vec<_> = window.harness.state().messages().texts().collect();
    assert!(texts.iter().any(|text| text.contains("no_such_scene.toml")), "{texts:?}");
    assert_eq!(window.harness.state().session().document().path, Path::new("liver_lifted"));

    let window = Window::running("grab", &[("solver.iterations", "many")]);
    let texts: Vec<_> = window.harness.state().messages().texts().collect();
    assert!(texts.iter().any(|text| text.contains("iterations")), "{texts:?}");
}

#[test]
fn without_the_device_asked_for_the_cpu_is_offered() {
    let mut window = Window::open("grab", &[("solver.device", "abacus")]);
    window.wait("a message", |app| app.messages().failure.is_some());
    let texts: Vec<_> = window.harness.state().messages().texts().collect();
    assert!(texts.iter().any(|text| text.contains("abacus")), "{texts:?}");
    window.press("Go on with the CPU");
    window.wait("frames", |app| app.snapshot().is_some_and(|snapshot| snapshot.number > 2));
    assert!(window.harness.state().messages().failure.is_none());
}

#[test]
fn the_keyboard_pauses_steps_and_begins_again() {
    let mut window = Window::running("grab", &[]);
    window.harness.key_press(Key::Space);
    window.harness.step();
    std::thread::sleep(Duration::from_millis(200));
    (0..3).for_each(|_| window.harness.step());
    let paused = window.harness.state().snapshot().expect("a frame").number;
    std::thread::sleep(Duration::from_millis(100));
    window.harness.step();
    assert_eq!(window.harness.state().snapshot().map(|snapshot| snapshot.number), Some(paused));
    window.harness.key_press(Key::Period);
    window
        .wait("a step", |app| app.snapshot().is_some_and(|snapshot| snapshot.number == paused + 1));
    window.harness.key_press(Key::R);
    window.wait("rest", |app| app.snapshot().is_some_and(|snapshot| snapshot.number == 0));
}

/// Slides to the ends of rails; every one leaves numbers, and nothing to say.
fn slide_to_ends(sliders: &[(&str, [f64; 2])]) {
    let mut window = Window::running("grab", &[("solver.method", "xpbd")]);
    for (name, ends) in sliders {
        for end in ends {
            window.slide(name, *end);
            let number = window.harness.state().snapshot().expect("a frame").number;
            window.wait("frames", |app| {
                app.snapshot().is_some_and(|snapshot| snapshot.number > number + 1)
            });
            let is_number = window.run(0).positions.iter().all(|x| x.is_finite());
            let texts = window.texts();
            assert!(is_number && texts.is_empty(), "{name} at {end}: {texts:?}");
        }
    }
}

#[test]
fn sliders_at_their_ends_leave_numbers() {
    slide_to_ends(&[("substeps", [2.0, 1.0]), ("stiffness E", [0.1, 1000.0])]);
}

#[test]
#[ignore = "slow: frames of twenty substeps and of fifty iterations"]
fn sliders_at_their_ends_leave_numbers_at_length() {
    slide_to_ends(&[
        ("stiffness E", [0.1, 1000.0]),
        ("Poisson's ratio", [0.0, 0.499]),
        ("density", [500.0, 2000.0]),
        ("viscosity", [0.0, 100.0]),
        ("gravity", [0.0, 20.0]),
        ("iterations", [1.0, 50.0]),
        ("substeps", [1.0, 20.0]),
    ]);
}

#[test]
fn without_its_device_the_window_saves_what_was_done_and_closes() {
    let mut window = Window::running("grab", &[]);
    window.press("keep");
    window.drag(vec2(0.0, -40.0));
    window.press("Record");
    window.device.destroy();
    window.wait("a last word", |app| app.viewport_lost());
    window.harness.step();
    let farewell = window.farewell.get().expect("a reason");
    let is_told = farewell.contains("lost") || farewell.contains("failed");
    assert!(is_told && farewell.contains("recovered"), "{farewell}");
    let saved = window.folder.path().join("pictures/grab-recovered-0001.toml");
    let text = std::fs::read_to_string(&saved).expect("what was done");
    let scene = Scene::parse("saved", &text, &[]).expect("a legal scene");
    assert!(scene.motions.iter().any(|motion| motion.name == "hand-1"));
}
