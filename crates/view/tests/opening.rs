//! Files of all kinds in the window: scenes, meshes and scans by name and dropped onto it, and bodies in their colours.

mod common;

use common::Window;
use eframe::egui::Role;
use egui_kittest::kittest::Queryable;
use std::path::{Path, PathBuf};
use viscera_stage::Coloring;
use viscera_view::choices::Side;

/// A cube of 60 mm in millimetres, wound outwards.
const CUBE: &str = "v 0 0 0\nv 60 0 0\nv 60 60 0\nv 0 60 0\nv 0 0 60\nv 60 0 60\nv 60 60 60\nv 0 60 60\n\
    f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

const TWO: &str = r#"
    [world]
    gravity = [0, 0, 0]

    [output]
    view_from = [0, -1, 0]

    [[body]]
    name = "liver"
    shape = "block"
    size = ["40 mm", "40 mm", "40 mm"]
    cells = [2, 2, 2]
    material = { preset = "liver" }

    [[body]]
    name = "gallbladder"
    shape = "block"
    size = ["40 mm", "40 mm", "40 mm"]
    cells = [2, 2, 2]
    position = ["50 mm", 0, 0]
    material = { preset = "liver" }
"#;

/// A label map of voxels of 6 mm: a liver and a spleen beside it.
fn scan() -> String {
    let mut text = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 16 10 10\nencoding: text\nspace: right-anterior-superior\n\
         space directions: (6,0,0) (0,6,0) (0,0,6)\nspace origin: (0,0,0)\n\
         Segment0_LabelValue:=5\nSegment0_Name:=liver\nSegment1_LabelValue:=6\nSegment1_Name:=spleen\n\n"
        .to_owned();
    for n in 0..16 * 10 * 10 {
        let at = [n % 16, n / 16 % 10, n / 160];
        let inside = (2..8).contains(&at[1]) && (2..8).contains(&at[2]);
        text.push_str(match at[0] {
            2..=8 if inside => "5 ",
            10..=13 if inside => "6 ",
            _ => "0 ",
        });
    }
    text
}

/// A file in a folder of its own.
fn file(name: &str, text: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    std::fs::write(&path, text).expect("a file");
    (folder, path)
}

/// Waits until frames of a scene of this name are shown.
fn wait_for(window: &mut Window, name: &str) {
    let ends = format!("{name}.toml");
    window.wait(name, |app| {
        let is_open = app.session().document().path.ends_with(&ends);
        is_open && app.setup().is_some_and(|setup| setup.scene.name.ends_with(&ends))
    });
    window.start();
}

fn has(window: &Window, part: &str) -> bool {
    window.texts().iter().any(|text| text.contains(part))
}

#[test]
fn a_surface_is_opened_with_settings_of_the_command_line() {
    let (_folder, path) = file("spleen.obj", CUBE);
    let young = ("body.spleen.material.young", "9 kPa");
    let mut window = Window::open(&path.display().to_string(), &[young]);
    window.harness.step();
    assert!(window.harness.state().messages().making.is_some(), "the window says what it does");
    assert!(window.harness.state().setup().is_none(), "nothing else runs meanwhile");
    window.picture("making");
    wait_for(&mut window, "spleen");
    assert!(window.harness.state().messages().making.is_none());
    assert_eq!(window.scene().bodies[0].material.young(), 9e3);
    assert_eq!(window.scene().title, "spleen");
    let made = window.folder.path().join("out/spleen/scene/spleen.toml");
    assert!(made.exists() && has(&window, "1 body") && has(&window, "1 in the file as 1 mm"));
    window.picture("made");
    // Once more: the scene is the same, and stays.
    window.drop_files(&[&path]);
    window.wait("the end", |app| app.messages().making.is_none());
    assert!(!has(&window, "there is another"), "{:?}", window.texts());
    // One that was changed stays as well, and is named.
    let text = std::fs::read_to_string(&made).expect("a scene");
    std::fs::write(&made, text + "# mine\n").expect("a file");
    window.drop_files(&[&path]);
    window.wait("the end", |app| app.messages().making.is_none());
    assert!(has(&window, "changed by hand"), "{:?}", window.texts());
}

#[test]
fn what_becomes_no_scene_is_told_and_the_first_scene_shown() {
    let (_folder, path) = file("broken.obj", "v 0 0\n");
    let mut window = Window::open(&path.display().to_string(), &[]);
    window.start();
    assert!(has(&window, "broken.obj"), "{:?}", window.texts());
    assert_eq!(window.harness.state().session().document().path, Path::new("liver_lifted"));
}

#[test]
fn files_are_dropped_onto_the_window() {
    let mut window = Window::running("grab", &[]);
    let (_kept, scan) = file("scan.nrrd", &scan());
    window.hover_files(&[&scan]);
    window.harness.step();
    window.harness.get_by_label("Drop to open scan.nrrd");
    window.picture("hovering");
    window.hover_files(&[]);
    assert!(window.harness.query_by_label("Drop to open scan.nrrd").is_none());
    window.drop_files(&[&scan]);
    wait_for(&mut window, "scan");
    let names: Vec<_> = window.scene().bodies.iter().map(|body| body.name.as_str()).collect();
    assert_eq!(names, ["liver", "spleen"]);
    assert_eq!(window.harness.state().preferences().coloring, Coloring::Bodies);
    window.picture("scan");
    // A message says why a file cannot be opened, and the running simulation goes on.
    let (_kept, picture) = file("picture.png", "\u{fffd}");
    std::fs::write(&picture, b"\x89PNG\xff").expect("a file");
    let (_kept, recording) = file("liver-0001.viscera", "");
    let (_kept, broken) = file("broken.obj", "v 0 0\n");
    for (path, told) in [
        (&picture, "picture.png is neither a scene"),
        (&recording, "viscera replay"),
        (&broken, "broken.obj"),
        (&window.folder.path().join("gone.toml"), "no such file"),
    ] {
        window.drop_files(&[path]);
        window.wait("an answer", |app| app.messages().texts().any(|text| text.contains(told)));
        assert!(window.harness.state().messages().making.is_none());
    }
    assert!(window.harness.state().session().document().path.ends_with("scan.toml"));
    assert!(window.harness.state().is_playing());
}

#[test]
fn a_scene_goes_before_the_meshes_that_are_dropped_with_it() {
    let mut window = Window::running("grab", &[]);
    let (folder, scene) = file("two.toml", TWO);
    let mesh = folder.path().join("cube.obj");
    std::fs::write(&mesh, CUBE).expect("a file");
    window.drop_files(&[&mesh, &scene]);
    assert!(has(&window, "of 2 files"), "{:?}", window.texts());
    wait_for(&mut window, "two");
    // What was open can be opened again; built-in scenes have a menu of their own.
    assert_eq!(window.harness.state().preferences().recent, std::slice::from_ref(&scene));
    // Another scene that is opened while one is made is what stays open.
    window.drop_files(&[&mesh]);
    window.drop_files(&[&scene]);
    window.wait("what was made", |app| {
        app.messages().texts().any(|text| text.contains("left it closed"))
    });
    wait_for(&mut window, "two");
}

/// Pixels of the view that are rather green, as a gallbladder is.
fn green(window: &mut Window) -> usize {
    let pixels = window.pixels();
    pixels.iter().filter(|p| p[1] > p[0].saturating_add(15) && p[1] > p[2]).count()
}

#[test]
fn bodies_have_colours_of_their_own_from_the_beginning() {
    let (_folder, path) = file("two.toml", TWO);
    let mut window = Window::running(&path.display().to_string(), &[("solver.substeps", "1")]);
    assert_eq!(window.harness.state().preferences().coloring, Coloring::Bodies);
    window.picture("bodies");
    let own = green(&mut window);
    assert!(own > 5000, "a gallbladder is green: {own}");
    // Triangles' edges are drawn once for all bodies.
    window.press("wireframe");
    assert!(green(&mut window) > own / 2);
    window.picture("bodies-wireframe");
    window.press("wireframe");
    window.press("Picture");
    // A menu of materials has the same name.
    window.harness.get_by_role_and_label(Role::Button, "tissue").click();
    window.harness.step();
    let shown = |app: &viscera_view::App| app.snapshot().map(|snapshot| snapshot.coloring);
    window.wait("another colour", |app| shown(app) == Some(Coloring::Plain));
    assert_eq!(green(&mut window), 0);
    window.press("bodies");
    window.wait("the colours", |app| shown(app) == Some(Coloring::Bodies));
    assert!(green(&mut window) > own / 2);
    window.press("A | B");
    window.wait("two", |app| app.snapshot().is_some_and(|snapshot| snapshot.runs.len() == 2));
    window.picture("bodies-compared");
    // One body has the colour of tissue, and values stay what is shown.
    let (_kept, one) = file("one.toml", TWO.rsplit_once("[[body]]").expect("two bodies").0);
    window.drop_files(&[&one]);
    wait_for(&mut window, "one");
    assert_eq!(window.harness.state().preferences().coloring, Coloring::Plain);
    window.press("stress");
    window.drop_files(&[&path]);
    wait_for(&mut window, "two");
    assert_eq!(window.harness.state().preferences().coloring, Coloring::Stress);
    assert_eq!(window.harness.state().session().scene(Side::First).bodies.len(), 2);
}
