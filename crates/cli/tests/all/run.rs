//! `viscera run`: what it writes, and that numbers and files can be believed.

use crate::common::{Bench, End, TINY, last_frame, numbers, patch_force};
use std::process::Stdio;
use viscera::mesh::io;

#[test]
fn a_run_writes_what_it_promises() {
    let bench = Bench::new(TINY);
    let summary = bench.summary_of(&[]);
    let mut expected: Vec<String> = (0..=12).map(|k| format!("frames/tets_{k:06}.vtu")).collect();
    let files = ["final.vtu", "final_surface.obj", "motion.gif", "picture.png", "summary.json"];
    expected.extend(files.map(String::from));
    expected.push("tissue.pvd".into());
    expected.sort();
    assert_eq!(bench.files("out").into_iter().collect::<Vec<_>>(), expected);
    bench.assert_series_is_whole("out");
    assert_eq!(bench.read("out/final.vtu"), bench.read("out/frames/tets_000012.vtu"));
    let surface = bench.read("out/final_surface.obj");
    let (surface, _) = io::read_surface("final_surface.obj", &surface, 1.0).expect("a surface");
    assert!(surface.enclosed_volume() > 16e-6, "the bar has 16 ml and only grows");

    let (size, pixels) = bench.decode_png("out/picture.png");
    assert_eq!(size, [160, 120]);
    assert!(pixels.iter().any(|value| *value != pixels[0]), "an empty picture");
    bench.assert_gif_keeps_time("out", &summary);

    assert_eq!(summary["finished"], true);
    assert_eq!(summary["title"], "Tiny");
    assert_eq!(summary["model"]["tets"], 10);
    // Few small steps do in a coarse bar.
    assert_eq!(summary["solver"]["method"], "explicit");
    assert_eq!(summary["solver"]["asked_method"], "auto");
    assert_eq!(summary["solver"]["asked_elements"], "auto");
    assert_eq!(summary["solver"]["elements"], "recovered");
    let mesh = &summary["mesh"];
    assert!(mesh["edge"].as_f64().is_some_and(|edge| (0.01..0.05).contains(&edge)), "{mesh}");
    assert!(mesh["force"].as_f64().is_some_and(|error| (0.0..0.5).contains(&error)), "{mesh}");
    assert_eq!(summary["solver"]["accuracy"], "standard");
    let substeps = summary["solver"]["substeps"].as_u64().expect("a count");
    assert!((1..=10).contains(&substeps), "{substeps}");
    let frames = summary["frames"].as_array().expect("frames");
    assert_eq!(frames.len(), 12);
    for (index, frame) in frames.iter().enumerate() {
        assert_eq!(frame["frame"], index + 1);
        let time = (index + 1) as f64 / 60.0;
        assert!((frame["time"].as_f64().expect("a time") - time).abs() < 1e-12);
        for key in ["relative_residual", "wall_seconds"] {
            assert!(frame[key].as_f64().is_some_and(|value| value >= 0.0), "{key}");
        }
        assert!(frame["energy"]["elastic"].as_f64().is_some_and(|value| value > 0.0));
        assert_eq!(frame["deformation"]["inverted"], 0);
        assert_eq!(patch_force(frame, "wall").len(), 3);
    }
    // Half as long again, and with a Poisson ratio below one half larger in volume.
    let deformation = &last_frame(&summary)["deformation"];
    assert!(deformation["largest_stretch"].as_f64().is_some_and(|s| s > 1.4 && s < 1.7));
    assert!(deformation["volume_ratio"].as_f64().is_some_and(|v| v > 1.0 && v < 1.5));
}

/// What a method chooses by itself is written as it was chosen: a stiff bar swings fast and takes several substeps.
const TOOLS: &str = r#"
time = { duration = "0.2 s" }
world = { gravity = 0 }
output = { every = 4, tets = false, surface = false, picture = false }
solver = { substeps = 2 }

[[body]]
name = "block"
shape = "block"
size = ["20 mm", "20 mm", "10 mm"]
cells = [5, 5, 2]
material = { young = "10 kPa" }

[[fixing]]
name = "table"
body = "block"
half_space = { point = [0, 0, 0], normal = [0, 0, -1] }

[[tool]]
name = "ball"
kind = "sphere"
radius = "4 mm"
position = ["10 mm", "10 mm", "15 mm"]
keys = [{ time = "0.15 s", translation = [0, 0, "-3 mm"] }]

[[tool]]
name = "far"
kind = "half_space"
position = [0, 0, "-50 mm"]
"#;

/// Forces on tools are in a table, a row per frame, in the record, and at the end of the run; without tools there is none.
#[test]
fn forces_on_tools_are_written() {
    let bench = Bench::new(TOOLS);
    let end = bench.run(&[]);
    let printed = end.stdout.clone();
    let summary = bench.summary("out");
    let table = String::from_utf8(bench.read("out/tools.csv")).expect("text");
    let rows: Vec<Vec<&str>> = table.lines().map(|row| row.split(',').collect()).collect();
    assert_eq!(rows.len(), 1 + 12);
    assert_eq!((rows[0][0], rows[0][3], rows[0][13]), ("time [s]", "ball fz [N]", "far fx [N]"));
    let frames = summary["frames"].as_array().expect("frames");
    for (row, frame) in rows[1..].iter().zip(frames) {
        assert_eq!(row.len(), 25);
        let tool = &frame["tools"][0];
        assert_eq!((&tool["name"], &frame["divided"]), (&"ball".into(), &2.into()));
        // Reading JSON rounds the last digit.
        let force = tool["force"][2].as_f64().expect("a force");
        let written: f64 = row[3].parse().expect("a number");
        assert!((written - force).abs() <= 1e-12 * force.abs(), "{written}, {force}");
        assert_eq!(row[7].parse::<u64>().ok(), tool["touches"].as_u64());
        let error = tool["error"].as_f64().expect("an error");
        let written: f64 = row[10].parse().expect("a number");
        assert!((written - error).abs() <= 1e-12 * error, "{written}, {error}");
        assert_eq!((row[12], tool["has_jumped"].as_bool()), ("0", Some(false)));
    }
    let force = last_frame(&summary)["tools"][0]["force"][2].as_f64().expect("a force");
    assert!(force > 0.05, "{force}");
    assert!(
        printed.contains("\nball: force 0.") && printed.contains("\nfar: force 0.0000 +- 0.0000 N"),
        "{printed}"
    );
    // The same folder without tools.
    let (without, _) = TOOLS.split_once("[[tool]]").expect("tools");
    bench.write("scene.toml", without.as_bytes());
    bench.run(&[]);
    assert!(!bench.files("out").contains("tools.csv"));
}

#[test]
fn counts_that_the_method_chooses_are_told() {
    let bench = Bench::new(TINY);
    let run = |young: &str, more: &[&str]| {
        let young = format!("body.bar.material.young={young}");
        let mut arguments =
            vec!["--set", "solver.method=quasi_newton", "--set", &young, "--frames", "1"];
        arguments.extend(more);
        let solver = &bench.summary_of(&arguments)["solver"];
        (solver["substeps"].as_u64(), solver["iterations"].as_u64())
    };
    let (soft, passes) = run("100 Pa", &[]);
    let (stiff, _) = run("1 MPa", &[]);
    assert!(soft < stiff && stiff <= Some(10), "{soft:?} {stiff:?}");
    assert!(passes >= Some(8), "{passes:?}");
    let set = ["--set", "solver.substeps=3", "--set", "solver.iterations=5"];
    assert_eq!(run("1 MPa", &set), (Some(3), Some(5)));
}

#[test]
fn frames_and_every_are_honoured() {
    let bench = Bench::new(TINY);
    let summary = bench.summary_of(&["--frames", "7", "--every", "3"]);
    assert_eq!(summary["frames"].as_array().map(Vec::len), Some(7));
    // The beginning, every third and the end.
    let listed = bench.listed("out/tissue.pvd");
    assert_eq!(listed, [0, 3, 6, 7].map(|k| format!("frames/tets_{k:06}.vtu")));
    bench.assert_series_is_whole("out");
}

#[test]
fn overrides_reach_the_settings_and_the_record() {
    let bench = Bench::new(TINY);
    let soft = bench.summary_of(&[]);
    let arguments = ["--set", "solver.iterations=5", "--set", "body.bar.material.young=\"20 kPa\""];
    let stiff = bench.summary_of(&arguments);
    assert_eq!(stiff["solver"]["iterations"], 5);
    assert_eq!(stiff["overrides"]["body.bar.material.young"], "\"20 kPa\"");
    let material = stiff["materials"]["bar"].as_str().expect("a material");
    assert!(material.contains("E 20 kPa, nu 0.45, 1000 kg/m^3"), "{material}");
    // Held and pulled by the same lengths, with little weight: force is in proportion to Young's
    // modulus. The weight is 0.16 N of some 4 N and the bar at rest to within 1 %.
    let force = |summary| patch_force(last_frame(summary), "grip")[0];
    assert!((force(&stiff) / force(&soft) - 2.0).abs() < 0.05, "{}", force(&stiff) / force(&soft));
}

#[test]
fn a_later_run_leaves_nothing_of_an_earlier_one() {
    let bench = Bench::new(TINY);
    bench.summary_of(&[]);
    bench.write("out/notes.txt", b"mine");
    let arguments = ["--frames", "2", "--set", "output.picture=false", "--set", "output.tets=true"];
    bench.summary_of(&arguments);
    bench.assert_series_is_whole("out");
    let files = bench.files("out");
    assert!(!files.contains("picture.png") && !files.contains("motion.gif"), "{files:?}");
    assert!(files.contains("notes.txt"));
}

#[test]
fn double_precision_agrees_with_single() {
    let bench = Bench::new(TINY);
    let single = bench.summary_of(&[]);
    let double = bench.summary_of(&["--set", "solver.precision=f64"]);
    assert_eq!(double["solver"]["precision"], "f64");
    // Rounding to 24 bits, magnified by the ratio of edge to strain and by the sweeps of twelve
    // frames: four digits are left.
    for key in ["largest_stretch", "smallest_stretch", "volume_ratio"] {
        let [a, b] = [&single, &double]
            .map(|s| last_frame(s)["deformation"][key].as_f64().expect("a number"));
        assert!((a - b).abs() < 1e-4, "{key}: {a} and {b}");
    }
}

#[test]
fn the_same_run_gives_the_same_bytes() {
    let bench = Bench::new(TINY);
    bench.summary_of(&[]);
    let files = ["final.vtu", "final_surface.obj", "picture.png", "motion.gif", "tissue.pvd"];
    let first = files.map(|name| bench.read(&format!("out/{name}")));
    bench.summary_of(&[]);
    for (name, bytes) in files.iter().zip(first) {
        assert!(bench.read(&format!("out/{name}")) == bytes, "{name} differs");
    }
}

/// The tiny bar hung from its end, with nothing pulling.
fn hanging() -> String {
    let scene = TINY.replace("\"0.2 s\"", "\"3 s\"");
    let (before, rest) = scene.split_once("[[motion]]").expect("a motion");
    let output = rest.split_once("[output]").map_or("", |(_, output)| output);
    format!("{before}[world]\ngravity = [\"9.81 m/s^2\", 0, 0]\n[output]{output}")
}

/// To rest, without a picture.
const DAMPED: [&str; 6] =
    ["--every", "60", "--set", "output.picture=false", "--set", "time.velocity_factor=0.9"];

/// 40 x 20 x 20 mm of 1000 kg/m^3 in 9.81 m/s^2 [N].
const WEIGHT: f64 = 0.016 * 9.81;

#[test]
fn the_force_that_holds_a_hanging_body_is_its_weight() {
    let bench = Bench::new(&hanging());
    // Held rigidly, and by an elastic fixing.
    for stiffness in ["", "stiffness = \"200 N/m\"\n"] {
        let scene =
            hanging().replace("name = \"wall\"\n", &format!("name = \"wall\"\n{stiffness}"));
        bench.write("scene.toml", scene.as_bytes());
        let summary = bench.summary_of(&DAMPED);
        let force = patch_force(last_frame(&summary), "wall");
        println!("held with {force:?} N, weight {WEIGHT} N along x");
        assert!((force[0] + WEIGHT).abs() < 0.01 * WEIGHT, "{force:?}");
        assert!(force[1].abs() < 0.01 * WEIGHT && force[2].abs() < 0.01 * WEIGHT, "{force:?}");
    }
}

/// Twelve frames of a sixtieth: the last is at 0.2 s.
#[test]
fn the_picture_shows_the_moment_asked_for() {
    let bench = Bench::new(TINY);
    let picture = |wish: &[&str]| {
        bench.summary_of(wish);
        bench.read("out/picture.png")
    };
    let last = picture(&[]);
    assert_eq!(picture(&["--set", "output.picture_time=9 s"]), last);
    assert_ne!(picture(&["--set", "output.picture_time=0.1 s"]), last);
}

/// Strain is round-off then, and says nothing of the stiffness. A number of iterations that slows the fall is still
/// named.
#[test]
fn a_falling_body_is_not_called_stiff() {
    let scene = hanging();
    let (before, rest) = scene.split_once("[[fixing]]").expect("a fixing");
    let world = rest.split_once("[world]").map_or("", |(_, world)| world);
    let bench = Bench::new(&format!("{before}[world]{world}"));
    let run = |settings: &[&str]| {
        let sets = settings.iter().flat_map(|&setting| ["--set", setting]);
        let arguments = ["--set", "output.picture=false"].into_iter().chain(sets);
        bench.summary_of(&arguments.collect::<Vec<_>>())["warnings"].clone()
    };
    assert_eq!(run(&[]), serde_json::json!([]));
    for colors in ["solver.colors=unlimited", "solver.colors=1"] {
        assert_eq!(run(&["solver.method=xpbd", colors]), serde_json::json!([]));
    }
    // From where it would be without gravity, sweeps of one colour leave forces behind.
    let settings = [
        "solver.method=xpbd",
        "solver.colors=1",
        "solver.step_guard=false",
        "solver.start=inertial",
    ];
    let warnings = run(&settings).to_string();
    assert!(warnings.contains("unbalanced forces") && !warnings.contains("stiffer"), "{warnings}");
}

/// Internal forces add up to nothing, so at rest patches carry exactly the weight; what is missing
/// is the unbalanced force on free vertices, which the residual bounds: some 1e-6 of the loads here.
#[test]
fn forces_on_patches_and_weight_balance_at_rest() {
    let scene = format!(
        "{}\n[[force]]\nname = \"hook\"\nbody = \"bar\"\n\
         box = {{ min = [\"19 mm\", \"-1 m\", \"-1 m\"], max = [\"21 mm\", \"1 m\", \"1 m\"] }}\n\
         force = [0, \"0.3 N\", 0]\n",
        TINY.replace("\"0.2 s\"", "\"3 s\"")
    );
    let bench = Bench::new(&scene);
    let summary = bench.summary_of(&DAMPED);
    let frame = last_frame(&summary);
    let mut total = [0.0, 0.0, -WEIGHT];
    let mut loads = WEIGHT;
    for name in ["wall", "grip", "hook"] {
        let force = patch_force(frame, name);
        loads += force.iter().map(|f| f * f).sum::<f64>().sqrt();
        total.iter_mut().zip(force).for_each(|(sum, f)| *sum += f);
    }
    println!("left over: {total:?} N of {loads} N");
    assert!(patch_force(frame, "hook") == [0.0, 0.3, 0.0]);
    assert!(total.iter().all(|f| f.abs() < 1e-4 * loads), "{total:?} N of {loads} N");
}

/// The grip leaves the world after some good frames.
fn diverging() -> String {
    let keys = "{ time = \"0.15 s\", translation = [\"20 mm\", 0, 0] }, \
                { time = \"0.2 s\", translation = [\"1e30 m\", 0, 0] }]";
    TINY.replace("\"20 mm\", 0, 0] }]", &format!("\"20 mm\", 0, 0] }}, {keys}"))
}

#[test]
fn a_diverging_scene_says_so_and_keeps_what_was_finished() {
    let bench = Bench::new(&diverging());
    let end = bench.run(&["--set", "solver.method=quasi_newton"]);
    let message = end.error();
    assert!(message.contains("diverged at 0.1"), "{message}");
    assert!(message.contains("raise solver.substeps"), "{message}");
    let summary = bench.summary("out");
    assert_eq!(summary["finished"], false);
    assert!(summary["stopped"].as_str().is_some_and(|text| text.contains("diverged")));
    let kept = summary["frames"].as_array().map_or(0, Vec::len);
    assert!(kept >= 8, "{kept} frames");
    assert!(message.contains(&format!("{kept} frames")), "{message}");
    bench.assert_series_is_whole("out");
    assert_eq!(bench.listed("out/tissue.pvd").len(), kept + 1);
    assert!(!bench.files("out").contains("final.vtu"), "there is no final state");
    bench.decode_png("out/picture.png");
}

/// The disk may be full long after the run began: frames are written by a thread of their own.
#[test]
fn a_frame_that_cannot_be_written_ends_the_run_and_says_so_once() {
    let bench = Bench::new(&TINY.replace("\"0.2 s\"", "\"3600 s\""));
    std::fs::create_dir(bench.path("out")).expect("a folder");
    bench.write("out/frames", b"in the way");
    let message = bench.run(&[]).error().to_owned();
    assert!(message.contains("cannot write out/frames/tets_000000.vtu: "), "{message}");
    let summary = bench.summary("out");
    assert_eq!(summary["finished"], false);
    let stopped = summary["stopped"].as_str().expect("a reason");
    assert!(message.starts_with(stopped), "{message}: {stopped}");
    let files = bench.files("out");
    assert!(!files.iter().any(|name| name.ends_with(".part")), "{files:?}");
    assert!(!files.contains("tissue.pvd") && !files.contains("final.vtu"), "{files:?}");
}

#[test]
fn a_reader_that_has_seen_enough_is_no_error() {
    let bench = Bench::new(TINY);
    for arguments in [&["run", "scene.toml", "--out", "out"][..], &["scene", "describe"]] {
        let mut child = bench
            .viscera(arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("viscera starts");
        drop(child.stdout.take());
        let end = End::of(&child.wait_with_output().expect("viscera ends"));
        assert_eq!((end.code, end.stderr.as_str()), (Some(0), ""));
    }
    assert_eq!(bench.summary("out")["finished"], true);
}

/// Ctrl-C, and what schedulers and containers send.
#[cfg(unix)]
#[test]
fn interrupting_keeps_what_is_finished() {
    interrupt("-INT");
    interrupt("-TERM");
}

#[cfg(unix)]
fn interrupt(signal: &str) {
    use std::process::Command;
    use std::time::{Duration, Instant};

    let bench = Bench::new(&TINY.replace("\"0.2 s\"", "\"3600 s\""));
    let child = bench
        .viscera(&["run", "scene.toml", "--out", "out", "--every", "2"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("viscera starts");
    let start = Instant::now();
    while !bench.path("out/frames/tets_000004.vtu").exists() {
        assert!(start.elapsed() < Duration::from_secs(20), "no fourth frame");
        std::thread::sleep(Duration::from_millis(2));
    }
    let id = child.id().to_string();
    let sent = Command::new("kill").args([signal, &id]).status().expect("a kill command");
    assert!(sent.success());
    let end = End::of(&child.wait_with_output().expect("viscera ends"));
    assert_eq!(end.code, Some(130), "{}", end.stderr);
    assert!(end.stderr.contains("interrupted after"), "{}", end.stderr);

    let summary = bench.summary("out");
    assert_eq!(summary["finished"], false);
    assert_eq!(summary["stopped"], "interrupted");
    let last = last_frame(&summary)["frame"].as_u64().expect("a frame number");
    assert!(last >= 4);
    bench.assert_series_is_whole("out");
    let listed = bench.listed("out/tissue.pvd");
    assert_eq!(listed.last(), Some(&format!("frames/tets_{last:06}.vtu")));
    let parts: Vec<String> =
        bench.files("out").into_iter().filter(|name| name.ends_with(".part")).collect();
    assert!(parts.is_empty(), "{parts:?}");
    assert_eq!(
        bench.read("out/final.vtu"),
        bench.read(&format!("out/{}", listed[listed.len() - 1]))
    );
    bench.decode_png("out/picture.png");
    assert!(bench.gif_seconds("out/motion.gif") >= 1.5);
}

#[test]
fn mesh_inspect_prints_json() {
    let bench = Bench::new(TINY);
    bench.summary_of(&["--frames", "1"]);
    let end = bench.end_of(&["mesh", "inspect", "out/final.vtu", "--json"]);
    let summary: serde_json::Value = serde_json::from_str(&end.stdout).expect("JSON");
    assert_eq!(summary["tet_count"], 10);
    assert_eq!(summary["components"].as_array().map(Vec::len), Some(1));
    // 16 ml, hardly deformed after one frame.
    let volume = summary["volume"].as_f64().expect("a volume");
    assert!((volume / 16e-6 - 1.0).abs() < 0.05, "{volume}");
    assert_eq!(numbers(&summary["box_min"]).len(), 3);
    let table = bench.end_of(&["mesh", "inspect", "out/final.vtu"]);
    assert!(table.stdout.starts_with("out/final.vtu\n") && table.stdout.contains("ml\n"));
}

#[test]
fn scenes_that_are_listed_run_without_their_files() {
    let bench = Bench::new(TINY);
    let listed = bench.end_of(&["scene", "list"]).stdout;
    let names: Vec<&str> =
        listed.lines().skip(1).filter_map(|line| line.split_whitespace().next()).collect();
    assert!(names.len() >= 5 && names.contains(&"liver_retraction"), "{listed}");
    let end =
        bench.end_of(&["run", "cantilever", "--frames", "1", "--set", "output.picture=false"]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    assert_eq!(bench.summary("out/cantilever")["title"], "Cantilever");
}

#[test]
fn a_file_goes_before_a_built_in_scene_of_its_name() {
    let bench = Bench::new("");
    bench.write("twist", TINY.as_bytes());
    let plain = ["--frames", "1", "--set", "output.picture=false", "--out", "out"];
    let end = bench.end_of(&[&["run", "twist"], &plain[..]].concat());
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    assert_eq!(bench.summary("out")["title"], "Tiny");
}

/// A run says what its tetrahedra are, how far the mesh is off, and which edges would do; XPBD has linear ones.
#[test]
fn a_run_says_how_far_its_mesh_is_off() {
    let bench = Bench::new(TINY);
    let said = |more: &[&str]| {
        let end = bench.run(more);
        assert_eq!(end.code, Some(0), "{}", end.stderr);
        (end.stdout, bench.summary("out"))
    };
    let (text, summary) = said(&["--set", "solver.method=xpbd", "--set", "solver.device=cpu"]);
    assert!(text.contains("tetrahedra: linear, which bend too little"), "{text}");
    assert_eq!(summary["solver"]["elements"], "plain");
    let (text, _) = said(&[]);
    assert!(text.contains("tetrahedra: recovered-gradient"), "{text}");
    let line =
        text.lines().find(|line| line.starts_with("mesh: its own error is")).expect("a line");
    assert!(line.contains("of the displacement") && line.contains("of the forces"), "{line}");
    let (_, finer) = said(&["--set", "body.bar.refine=1"]);
    assert_eq!(finer["model"]["tets"], 80);
}

#[test]
fn a_refinement_that_is_too_fine_is_refused() {
    let bench = Bench::new(TINY);
    let end = bench.run(&["--set", "body.bar.refine=4"]);
    assert!(end.code != Some(0) && end.stderr.contains("0 to 3"), "{}", end.stderr);
    let fine = ["--set", "body.bar.refine=3", "--set", "body.bar.cells=[40, 40, 40]"];
    let end = bench.run(&fine);
    let names = end.stderr.contains("`bar`") && end.stderr.contains("lower it");
    assert!(end.code != Some(0) && names, "{}", end.stderr);
}
