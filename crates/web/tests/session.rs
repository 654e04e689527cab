//! A session, as the page's worker drives it, without a browser.

use viscera::scalar::{Vec3, vec3};
use viscera::scene::Scene;
use viscera::simulation::{Assembly, Simulation};
use viscera_web::{LoadRequest, Session, catalog};

fn request(name: &str, settings: &[(&str, &str)], mesh: f64) -> LoadRequest {
    let scenes = catalog::scenes();
    let scene = scenes.iter().find(|scene| scene.name == name).expect("a built-in scene");
    let owned = |(key, value): &(&str, &str)| ((*key).to_owned(), (*value).to_owned());
    let settings = settings.iter().map(owned).collect();
    LoadRequest { name: name.to_owned(), text: scene.text.to_owned(), settings, mesh }
}

fn no_files(name: &str) -> Result<Vec<u8>, String> {
    Err(format!("{name}: there is no such file"))
}

fn session(name: &str, settings: &[(&str, &str)], mesh: f64) -> Session {
    let mut session = Session::new(None);
    session.load(&request(name, settings, mesh), &mut no_files, None).expect("a scene");
    session.resize(800, 600);
    session
}

fn frames(session: &mut Session, count: u32) {
    for _ in 0..count {
        (0..session.run_count()).for_each(|run| session.advance(run).expect("a frame"));
    }
}

/// Where the tissue of the first simulation is nearest to the viewer's line through a place: a place to grab.
fn middle(session: &Session) -> [f64; 2] {
    let places = session.vertices(0).expect("a run");
    let sum = places.iter().fold(Vec3::ZERO, |sum, x| sum + x.cast::<f64>());
    session.seen(0, sum * (1.0 / places.len() as f64)).expect("in front")
}

/// A hand that pulls and lets go, a setting that changes in between: the scene that it writes does the same to the bit, forces
/// and all.
#[test]
fn a_replay_has_the_same_bits_and_forces() {
    let mut by_hand = session("liver_lifted", &[("solver.accuracy", "draft")], 1.6);
    frames(&mut by_hand, 5);
    let place = middle(&by_hand);
    assert!(by_hand.grab(1, place).expect("a hand"), "the middle of the liver is not grabbed");
    let mut forces = Vec::new();
    for step in 0..20 {
        by_hand
            .lead(1, [place[0] + 3.0 * f64::from(step), place[1] - 2.0 * f64::from(step)])
            .expect("led");
        if step == 9 {
            let young = vec![("body.liver.material.young".to_owned(), "8 kPa".to_owned())];
            by_hand.set(0, &young).expect("a setting");
        }
        frames(&mut by_hand, 1);
        forces.push(by_hand.force(1).length());
        // What the page shows is the same number.
        let report = by_hand.report();
        let [x, y, z] = report.runs[0].held[0].force;
        assert_eq!(vec3(x, y, z), by_hand.force(1));
    }
    by_hand.release(1).expect("let go");
    frames(&mut by_hand, 10);

    let text = by_hand.replay().expect("a scene");
    let scene = Scene::parse("replay.toml", &text, &[]).unwrap_or_else(|error| panic!("{error}"));
    let assembly = Assembly::new(&scene, &mut |name| no_files(name)).expect("meshes");
    let mut replay = Simulation::<f32>::new(scene, assembly).expect("a simulation");
    for frame in 0..35usize {
        replay.advance_frame().expect("a frame");
        if let Some(force) = frame.checked_sub(5).and_then(|step| forces.get(step)) {
            let report = replay.report();
            let hand = report.patches.iter().find(|patch| patch.name == "hand-1").expect("a hand");
            let [x, y, z] = hand.force;
            let replayed = vec3(x, y, z).length();
            assert!((replayed - force).abs() < 1e-9, "{replayed} N for {force} N");
        }
    }
    assert!(forces.last().is_some_and(|last| *last > 0.05), "{forces:?}");
    assert_eq!(replay.state().positions, by_hand.vertices(0).expect("a run"));
}

/// The tissue stays under the finger, within what its springs give.
#[test]
fn a_finger_leads_what_it_has_grabbed() {
    let mut session = session("grab", &[], 1.0);
    let place = middle(&session);
    assert!(session.grab(7, place).expect("a hand"));
    let before = session.report().runs[0].held[0].place;
    let target = [place[0] + 60.0, place[1] - 40.0];
    session.lead(7, target).expect("led");
    frames(&mut session, 30);
    let report = session.report();
    let held = &report.runs[0].held[0];
    let vector = |[x, y, z]: [f64; 3]| vec3(x, y, z);
    let (moved, from_target) =
        (vector(held.place) - vector(before), vector(held.target) - vector(held.place));
    assert!(moved.length() > 0.005, "{moved:?}");
    assert!(from_target.length() < 2e-3, "{from_target:?}");
    // The hand's target moved as the finger's ray did, in the plane of the picture.
    let seen = [vector(before), vector(held.target)].map(|x| session.seen(0, x).expect("in front"));
    let way = [seen[1][0] - seen[0][0], seen[1][1] - seen[0][1]];
    // What is grabbed lies before or behind the patch's middle: as much nearer or farther in the picture.
    assert!((way[0] - 60.0).abs() < 6.0 && (way[1] + 40.0).abs() < 4.0, "{way:?}");
    session.release(7).expect("let go");
    frames(&mut session, 60);
    assert!(session.report().runs[0].held.is_empty());
}

/// A pull at one edge of a slab that lies on a table reaches the other edge as theory says, and the table's side not at all: in
/// a layer of height h that is held below, what a pull does falls with the distance d as exp(-pi d / 2 h), the lowest mode of
/// shear; at a free edge it is reflected, which doubles it.
#[test]
fn the_far_side_stays_where_it_is() {
    let mut session = session("grab", &[], 1.6);
    // The scene's own forceps have let go by then, and the slab is calm to a thousandth of a millimetre.
    frames(&mut session, 900);
    let before = session.vertices(0).expect("a run").to_vec();
    assert!(session.grab_at(2, vec3(0.0, 0.05, 0.05)).expect("a hand"), "the edge is not grabbed");
    session.lead_by(2, vec3(0.0, 0.0, 0.015)).expect("led");
    frames(&mut session, 60);
    let farthest = |is_meant: fn(&Vec3<f32>) -> bool| {
        let pairs = before.iter().zip(session.vertices(0).expect("a run"));
        let moved = pairs.filter(|(a, _)| is_meant(a)).map(|(a, b)| (*a - *b).length());
        f64::from(moved.fold(0.0, f32::max))
    };
    // The hand holds up to 35 mm from its edge, the other one is at 100 mm; the slab is 50 mm high.
    let (near, far) = (farthest(|x| x.x < 0.035), farthest(|x| x.x > 0.09));
    let share = 2.0 * (-std::f64::consts::PI * 0.065 / 0.1).exp();
    assert!(near > 0.01 && far < share * near, "{near} m beside the hand, {far} m on the far side");
    assert_eq!(farthest(|x| x.z <= 0.0), 0.0, "the table holds");
}

#[test]
fn two_methods_beside_each_other_are_held_by_one_hand() {
    let mut session = session("cantilever", &[], 1.6);
    frames(&mut session, 3);
    let other = vec![("solver.method".to_owned(), "xpbd".to_owned())];
    session.beside(Some(&other)).expect("a second one");
    assert_eq!(session.vertices(0), session.vertices(1), "it begins where the first is");
    let report = session.report();
    assert_eq!(report.runs[1].method, "xpbd");
    assert_ne!(report.runs[0].method, "xpbd");
    // The second half of a wide picture shows the second one.
    let places = session.vertices(1).expect("a run");
    let middle = places.iter().fold(Vec3::ZERO, |sum, x| sum + x.cast::<f64>())
        * (1.0 / places.len() as f64);
    let place = session.seen(1, middle).expect("in front");
    assert!(place[0] > 400.0, "{place:?}");
    assert!(session.grab(3, place).expect("a hand"));
    session.lead(3, [place[0], place[1] - 50.0]).expect("led");
    frames(&mut session, 5);
    let report = session.report();
    assert!(report.runs.iter().all(|run| run.held.len() == 1 && run.held[0].force != [0.0; 3]));
    session.beside(None).expect("alone");
    assert_eq!(session.run_count(), 1);
}

#[test]
fn what_is_wrong_is_refused_and_what_runs_goes_on() {
    let mut session = session("cantilever", &[], 1.6);
    frames(&mut session, 2);
    let before = session.vertices(0).expect("a run").to_vec();
    let huge = request("liver_lifted", &[("body.liver.spacing", "2 mm")], 1.0);
    let error = session.load(&huge, &mut no_files, None).expect_err("too large");
    assert!(error.contains("tetrahedra are more than"), "{error}");
    let mut wrong = request("cantilever", &[], 1.0);
    wrong.mesh = f64::NAN;
    assert!(session.load(&wrong, &mut no_files, None).expect_err("no factor").contains("factor"));
    wrong.mesh = 1.0;
    wrong.text = "title = ".to_owned();
    assert!(session.load(&wrong, &mut no_files, None).expect_err("no scene").contains("line 1"));
    let set = |session: &mut Session, key: &str, value: &str| {
        session.set(0, &vec![(key.to_owned(), value.to_owned())])
    };
    assert!(set(&mut session, "solver.method", "magic").expect_err("no method").contains("magic"));
    assert!(session.set(5, &Vec::new()).expect_err("no run").contains("there is no run 5"));
    assert!(session.color("rainbow").expect_err("no colours").contains("rainbow"));
    assert_eq!(session.vertices(0).expect("a run"), before);
    frames(&mut session, 1);
    assert_ne!(session.vertices(0).expect("a run"), before);
    assert!(Session::new(None).set(0, &Vec::new()).expect_err("nothing").contains("load first"));
}

/// What the solver cannot go on with is said, and does not stand still in silence.
#[test]
fn a_simulation_that_runs_away_says_so() {
    let mut session = session("cantilever", &[("solver.method", "quasi_newton")], 1.6);
    frames(&mut session, 2);
    session.set_grip(viscera_web::Grip { count: 8, stiffness: None });
    assert!(session.grab_at(1, vec3(0.2, 0.0, 0.025)).expect("a hand"), "the tip is not grabbed");
    session.lead_by(1, vec3(1e30, 0.0, 0.0)).expect("led, out of the world");
    let error = (0..10).find_map(|_| session.advance(0).err()).expect("it runs away");
    assert!(error.contains("diverged") && error.contains("substeps"), "{error}");
    session.reset().expect("from rest");
    frames(&mut session, 2);
}

#[test]
fn a_reset_begins_again_with_the_settings_as_they_are() {
    let mut session = session("cantilever", &[], 1.6);
    let rest = session.vertices(0).expect("a run").to_vec();
    let body = session.loaded().expect("a scene").bodies[0].name.clone();
    let key = format!("body.{body}.material.young");
    session.set(0, &vec![(key.clone(), "20 kPa".to_owned())]).expect("a setting");
    frames(&mut session, 4);
    session.reset().expect("from rest");
    assert_eq!(session.vertices(0).expect("a run"), rest);
    assert_eq!(session.setting(0, &key).expect("a setting"), "20000 Pa");
    frames(&mut session, 4);
    let replay = session.replay().expect("a scene");
    let scene = Scene::parse("replay.toml", &replay, &[]).unwrap_or_else(|error| panic!("{error}"));
    assert!(scene.changes.is_empty(), "what was set before the beginning is how it begins");
    assert_eq!(scene.bodies[0].material.young(), 2e4);
}

#[test]
fn pictures_without_a_device_show_tissue_where_it_is() {
    let mut session = session("liver_lifted", &[], 1.6);
    session.resize(240, 180);
    let pixels = session.pixels();
    assert_eq!(pixels.len(), 4 * 240 * 180);
    let is_flesh = |place: [f64; 2]| {
        let first = 4 * (place[1] as usize * 240 + place[0] as usize);
        let [r, g, b] = [0, 1, 2].map(|i| f64::from(pixels[first + i]));
        r > 1.3 * g && r > 1.3 * b
    };
    assert!(is_flesh(middle(&session)) && !is_flesh([2.0, 2.0]));
    // What is seen is what is grabbed.
    for (x, y) in (0..24).flat_map(|x| (0..18).map(move |y| (x, y))) {
        let place = [f64::from(10 * x) + 5.5, f64::from(10 * y) + 5.5];
        let grabbed = session.grab(1, place).expect("a hand");
        session.release(1).expect("let go");
        // At the edge a pixel is both.
        let around = [[-3.0, 0.0], [3.0, 0.0], [0.0, -3.0], [0.0, 3.0]];
        let same =
            |by: &[f64; 2]| is_flesh([place[0] + by[0], place[1] + by[1]]) == is_flesh(place);
        if around.iter().all(same) {
            assert_eq!(grabbed, is_flesh(place), "{place:?}");
        }
    }
}

/// The table of docs/web.md: what a frame of XPBD moves and sends on a graphics processor. Prints it anew where it is not
/// the one that stands there.
#[test]
fn the_budget_of_phones_is_that_of_the_plan() {
    let mut rows = Vec::new();
    for mesh in [2.0, 1.6, 1.25, 1.0, 0.8, 0.65] {
        let mut session = Session::new(None);
        let settings = [("solver.method", "xpbd"), ("solver.device", "cpu")];
        session
            .load(&request("liver_lifted", &settings, mesh), &mut no_files, None)
            .expect("a scene");
        let loaded = session.loaded().expect("a scene");
        rows.push(budget_row(&session, loaded.tets, loaded.vertices));
    }
    let table = rows.join("\n");
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/web.md");
    let document = std::fs::read_to_string(path).expect("docs/web.md");
    assert!(document.contains(&table), "docs/web.md has another table than\n{table}");
}

/// Compulsory bytes of a sweep, as docs/gpu.md counts them: 60 for each tetrahedron, each multiplier and each vertex read and
/// written once.
fn budget_row(session: &Session, tets: usize, vertices: usize) -> String {
    let [sweeps, dispatches, multipliers] = session.frame_cost().expect("XPBD");
    let bytes =
        sweeps as f64 * (60 * tets + 2 * 4 * multipliers as usize + 2 * 16 * vertices) as f64;
    let milliseconds = |bandwidth: f64| 1e3 * bytes / bandwidth;
    // A dispatch that waits for the one before it, as the library reckons.
    let waiting = dispatches as f64 * 4e-3;
    format!(
        "| {tets} | {sweeps} | {dispatches} | {:.1} MB | {waiting:.1} ms | {:.2} ms | {:.2} ms |",
        1e-6 * bytes,
        milliseconds(50e9),
        milliseconds(100e9)
    )
}

/// A probe from the tray is led by a finger into the tissue, and the scene that is written does the same to the bit.
#[test]
fn an_instrument_of_the_tray_is_led_and_repeated() {
    let settings = [
        ("solver.accuracy", "draft"),
        ("body.slab.cells", "[8, 8, 3]"),
        ("motion.forceps.release", "1 ms"),
    ];
    let mut by_hand = session("grab", &settings, 1.0);
    frames(&mut by_hand, 3);
    assert!(!by_hand.press_tool([400.0, 300.0], true).expect("nothing in hand"));
    assert_eq!(by_hand.tray()[0], "probe");
    by_hand.take_tool(0).expect("a probe");
    assert!(by_hand.take_tool(99).is_err());
    frames(&mut by_hand, 1);
    assert!(by_hand.press_tool([20.0, 20.0], true).expect("a finger leads it wherever it is"));
    assert!(!by_hand.press_tool([20.0, 20.0], false).expect("a mouse does not"));
    let mut force = 0.0;
    for _ in 0..60 {
        let way = [[400.0, 300.0], [400.0, 306.0]];
        by_hand.drag_tool(way, viscera_stage::Drag::Across).expect("led");
        frames(&mut by_hand, 1);
        let report = by_hand.report();
        let tool = &report.runs[0].tools[0];
        let [x, y, z] = tool.force;
        force = vec3(x, y, z).length();
        if force > 0.3 {
            assert!(z < 0.0 && tool.error.is_some() && report.runs[0].ledger.is_some());
            break;
        }
    }
    assert!(force > 0.3, "{force} N");
    // A place that is none leads nowhere, and is told.
    let nowhere = [[f64::NAN, 300.0], [400.0, 306.0]];
    assert!(by_hand.drag_tool(nowhere, viscera_stage::Drag::Across).is_err());
    by_hand.put_away().expect("put away");
    frames(&mut by_hand, 2);
    assert!(by_hand.report().runs[0].tools.is_empty() && by_hand.in_hand().is_empty());

    let frame = by_hand.report().frame;
    let text = by_hand.replay().expect("a scene");
    let scene = Scene::parse("replay.toml", &text, &[]).unwrap_or_else(|error| panic!("{error}"));
    let assembly = Assembly::new(&scene, &mut |name| no_files(name)).expect("meshes");
    let mut replay = Simulation::<f32>::new(scene, assembly).expect("a simulation");
    for _ in 0..frame {
        replay.advance_frame().expect("a frame");
    }
    assert_eq!(by_hand.vertices(0).expect("a run"), &replay.state().positions[..]);
}
