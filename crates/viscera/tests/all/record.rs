//! Recordings: replayed to the bit at any number of threads, cut anywhere, edited anywhere.

use crate::hands::{BLOCK, TOOLS, at, frames, go, pose, simulation};
use proptest::prelude::*;
use std::sync::OnceLock;
use viscera::record::{
    Ending, Player, Quantity, RecordError, RecordedFile, Recorder, Recording, ReplayError,
};
use viscera::scalar::rigid::{RigidTransform, rotation_matrix};
use viscera::scalar::{Real, Vec3, vec3};
use viscera::scene::{Patch, Scene, Selector};
use viscera::settings::Place;
use viscera::simulation::{Assembly, ResumeError, Simulation};

/// Records what `act` does between frames, for so many of them; the file and the simulation at its end.
fn record<S: Real>(
    mut run: Simulation<S>,
    count: u64,
    mut act: impl FnMut(&mut Simulation<S>, u64),
) -> (Vec<u8>, Simulation<S>) {
    let (mut recorder, mut file) = Recorder::begin(&mut run, Vec::new());
    for frame in 0..count {
        act(&mut run, frame);
        run.advance_frame().unwrap_or_else(|e| panic!("{e}"));
        file.extend(recorder.frame(&mut run));
    }
    file.extend(recorder.end());
    (file, run)
}

fn start<'a, S: Real>(
    recording: &'a Recording,
    from: u64,
    settings: &[(&str, &str)],
) -> Result<(Simulation<S>, Player<'a>), RecordError> {
    let scene = recording.scene(from, settings)?;
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned()));
    let simulation = Simulation::new(scene, assembly.unwrap_or_else(|e| panic!("{e}")));
    recording.start(from, simulation.unwrap_or_else(|e| panic!("{e}")), settings)
}

fn replay<S: Real>(
    recording: &Recording,
    from: u64,
    settings: &[(&str, &str)],
) -> Result<Simulation<S>, ReplayError> {
    let (mut simulation, mut player) =
        start(recording, from, settings).unwrap_or_else(|e| panic!("{e}"));
    while player.step(&mut simulation)? {}
    assert_eq!(player.played(), recording.frame_count());
    Ok(simulation)
}

/// Presses with one tool, grasps and pulls with another, drags a corner, changes a setting, puts things away.
fn two_instruments<S: Real>(run: &mut Simulation<S>, frame: u64, count: u64) {
    let share = frame as f64 / count as f64;
    let is_at = |part: f64| frame == (part * count as f64) as u64;
    let wave = |speed: f64| libm::sin(speed * share);
    if is_at(0.02) {
        run.take_tool(at("probe", vec3(0.008, 0.02, 0.024))).expect("a probe");
    }
    if share > 0.05 {
        let place = vec3(0.008 + 2e-3 * wave(9.0), 0.02, 0.024 - 0.004 * wave(17.0).abs());
        let rotation = rotation_matrix(vec3(0.1 * wave(5.0), 0.0, share));
        run.move_tool(0, RigidTransform { rotation, translation: place }).expect("a pose");
    }
    if is_at(0.1) {
        run.take_tool(at("pliers", vec3(0.022, 0.012, 0.0345))).expect("pliers");
    }
    if (0.15..0.3).contains(&share) {
        let place = vec3(0.022, 0.012, 0.0345 - 0.005 * (share - 0.15) / 0.15);
        let turned = pose(run, 1);
        run.move_tool(1, RigidTransform { translation: place, ..turned }).expect("a pose");
    }
    if (0.3..0.5).contains(&share) {
        run.open_jaws(1, 0.8 * (1.0 - (share - 0.3) / 0.2)).expect("an angle");
    }
    if is_at(0.5) {
        run.lock_jaws(1, true).expect("jaws");
    }
    if (0.5..0.8).contains(&share) {
        let up = vec3(0.022, 0.012, 0.0295 + 0.004 * wave(20.0).abs());
        let turned = pose(run, 1);
        run.move_tool(1, RigidTransform { translation: up, ..turned }).expect("a pose");
    }
    if is_at(0.6) {
        let place = Place::Override { key: "hand".into() };
        let selector = Selector::Nearest { point: vec3(0.03, 0.03, 0.015), count: 2 };
        let patch = Patch { body: 0, selector, purpose: "hand".into(), place };
        run.take_hold("hand", patch, Some(60.0)).expect("a hold");
    }
    if (0.6..0.7).contains(&share) {
        run.lead(0, vec3(0.0, 0.0, 0.004 * wave(30.0))).expect("a hold");
    }
    if is_at(0.7) {
        run.let_go(0).expect("a hold");
        let softer = [("body.block.material.young".to_owned(), "8 kPa".to_owned())];
        run.change(&softer).expect("a change");
    }
    if is_at(0.85) {
        run.lock_jaws(1, false).expect("jaws");
        run.open_jaws(1, 0.5).expect("jaws");
    }
    if is_at(0.9) {
        run.put_away(1).expect("pliers");
    }
}

fn replays_at_threads(count: u64, settings: &[(&str, &str)]) {
    let settings = [settings, &[("output.force_error", "false")]].concat();
    let run = simulation::<f32>(BLOCK, &settings);
    let (file, end) = record(run, count, |run, frame| two_instruments(run, frame, count));
    let recording = Recording::read(&file).expect("a recording");
    assert_eq!((recording.ending(), recording.frame_count()), (Ending::Complete, count));
    assert!(end.report().tools[0].touches > 0 || end.live().tools.len() == 2);
    for threads in ["1", "3", "8"] {
        let replayed = replay::<f32>(&recording, 0, &[("solver.threads", threads)]);
        let replayed = replayed.unwrap_or_else(|e| panic!("{threads} threads: {e}"));
        assert!(replayed.save() == end.save(), "{threads} threads");
        let written = |run: &Simulation<f32>| run.live().text(run.scene());
        assert!(written(&replayed) == written(&end));
    }
    println!("{count} frames: {} bytes", file.len());
}

#[test]
fn a_recording_replays_to_the_bit_at_any_number_of_threads() {
    replays_at_threads(60, &[("solver.method", "xpbd")]);
}

/// 30 s.
#[test]
#[ignore = "slow: 30 s of two instruments, four times"]
fn a_recording_replays_to_the_bit_at_any_number_of_threads_at_length() {
    replays_at_threads(1800, &[("solver.substeps", "1")]);
}

/// A recording with snapshots on the way, of frames of a tenth of a second.
fn short() -> &'static (Vec<u8>, Vec<u8>) {
    static FILE: OnceLock<(Vec<u8>, Vec<u8>)> = OnceLock::new();
    FILE.get_or_init(|| {
        let settings = [("time.frame", "0.25 s"), ("output.force_error", "false")];
        let (ball, _) = TOOLS.split_once("\n[[tool]]\nname = \"guest\"").expect("two tools");
        let text = format!("{BLOCK}{ball}").replace("[5, 5, 3]", "[2, 2, 1]");
        let mut run = simulation::<f32>(&text, &settings);
        // Something was done before it begins to be recorded.
        let probe = run.take_tool(at("probe", vec3(0.1, 0.02, 0.04))).expect("a probe");
        go(&mut run, probe, vec3(0.0, 0.001, 0.0), vec3(0.2, 0.0, 0.0), 2);
        let (file, end) = record(run, 50, |run, frame| {
            let turned = pose(run, 1);
            let translation = turned.translation + vec3(1e-4, 0.0, 0.0);
            run.move_tool(1, RigidTransform { translation, ..turned }).expect("a pose");
            if frame == 30 {
                run.reset().expect("a reset");
                run.take_tool(at("probe", vec3(0.1, 0.02, 0.04))).expect("a probe");
            }
        });
        (file, end.save())
    })
}

/// From its beginning and from the snapshot before any frame, with what was done by hand before that.
#[test]
fn a_recording_goes_on_from_a_snapshot() {
    let (file, end) = short();
    let recording = Recording::read(file).expect("a recording");
    for from in [0, 39, 40, 49] {
        let (_, player) = start::<f32>(&recording, from, &[]).expect("a start");
        assert_eq!(player.played(), if from < 40 { 0 } else { 40 });
        assert!(replay::<f32>(&recording, from, &[]).expect("the same bits").save() == *end);
    }
}

/// Frames that a file opens up to; nothing where there is nothing to play.
fn opens(file: &[u8]) -> Option<(u64, Ending)> {
    match Recording::read(file) {
        Ok(recording) => Some((recording.frame_count(), recording.ending())),
        Err(RecordError::Empty { .. }) => None,
        Err(error) => panic!("{error}"),
    }
}

/// At every byte; each frame is there as soon as its chunk is.
#[test]
fn a_recording_that_was_cut_anywhere_opens_up_to_there() {
    let (file, _) = short();
    let mut before = 0;
    for at in 0..file.len() {
        let Some((frames, ending)) = opens(&file[..at]) else {
            assert_eq!(before, 0, "byte {at}");
            continue;
        };
        assert_eq!(ending, Ending::Cut { at });
        // A chunk has half a second, of frames of a quarter.
        assert!(frames == before || frames == before + 2, "byte {at}: {frames} after {before}");
        before = frames;
    }
    assert_eq!(opens(file), Some((50, Ending::Complete)));
    // What is there is the recording, to its last frame.
    for at in [file.len() / 2, file.len() - 1] {
        let recording = Recording::read(&file[..at]).expect("a recording");
        replay::<f32>(&recording, 0, &[]).expect("the same bits");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn an_edited_byte_is_found(place in any::<prop::sample::Index>(), change in 1u8..) {
        let (file, _) = short();
        assert_found(file, place.index(file.len()), change);
    }
}

/// Random places seldom come so near to the beginning.
#[test]
fn an_edited_byte_of_the_beginning_is_found() {
    let (file, _) = short();
    for place in 0..40 {
        (1..=u8::MAX).for_each(|change| assert_found(file, place, change));
    }
}

/// One byte that is another is noticed, wherever it is, and all before its chunk is played.
fn assert_found(file: &[u8], place: usize, change: u8) {
    let mut edited = file.to_vec();
    edited[place] ^= change;
    match Recording::read(&edited) {
        Ok(recording) => {
            let Ending::Damaged { at } = recording.ending() else {
                panic!("byte {place}: {:?}", recording.ending());
            };
            assert!(at <= place, "byte {place} is in what begins at {at}");
            let before = opens(&file[..at]).map(|(frames, _)| frames);
            assert_eq!(before, Some(recording.frame_count()), "byte {place}");
        }
        Err(RecordError::Damaged { at }) => assert!(at <= place, "byte {place}, told as {at}"),
        // Of the first bytes.
        Err(error) => assert!(place < 13, "byte {place}: {error}"),
    }
}

/// Chunks that were swapped, left out or are another recording's are told, though each of them is whole.
#[test]
fn chunks_belong_where_they_are() {
    let (file, _) = short();
    let ends: Vec<usize> = (0..=file.len())
        .filter(|&at| opens(&file[..at]).is_some_and(|(frames, _)| frames >= 4))
        .scan(2, |last, at| {
            let frames = opens(&file[..at]).map_or(0, |(frames, _)| frames);
            let is_new = frames > *last;
            *last = frames;
            Some(is_new.then_some(at))
        })
        .flatten()
        .take(3)
        .collect();
    let [a, b, c] = ends[..] else { panic!("three chunks") };
    let without = [&file[..a], &file[b..]].concat();
    let twice = [&file[..b], &file[a..]].concat();
    let swapped = [&file[..a], &file[b..c], &file[a..b], &file[c..]].concat();
    for changed in [without, twice, swapped] {
        let recording = Recording::read(&changed).expect("a recording");
        assert!(matches!(recording.ending(), Ending::Damaged { at } if at == a || at == b));
    }
    let longer = [&file[..], b"more"].concat();
    let recording = Recording::read(&longer).expect("a recording");
    assert_eq!(recording.ending(), Ending::Damaged { at: file.len() });
}

#[test]
fn another_version_says_what_to_do() {
    let (file, _) = short();
    assert_eq!(Recording::read(b"[[body]]"), Err(RecordError::NotRecording));
    let mut newer = file.clone();
    newer[8] = 200;
    let error = Recording::read(&newer).expect_err("another format").to_string();
    assert!(
        error.contains("in format 200") && error.contains("replay it with that version"),
        "{error}"
    );
    assert!(error.contains(env!("CARGO_PKG_VERSION")), "{error}");
    // A saved simulation is none.
    let saved = simulation::<f32>(BLOCK, &[]).save();
    assert_eq!(Recording::read(&saved), Err(RecordError::Saved));
}

/// Another start, another number of passes, another push: the first frame and quantity are told.
#[test]
fn a_replay_with_other_bits_says_where() {
    let text = format!("{BLOCK}{TOOLS}");
    let quiet = [("output.force_error", "false"), ("solver.method", "xpbd")];
    let (file, _) = record(simulation::<f32>(&text, &quiet), 20, |run, frame| {
        let ball = pose(run, 0);
        if frame == 7 {
            let translation = ball.translation + vec3(0.0, 0.0, -4e-3);
            run.move_tool(0, RigidTransform { translation, ..ball }).expect("a pose");
        }
    });
    let recording = Recording::read(&file).expect("a recording");
    let differs =
        |settings: &[(&str, &str)]| match replay::<f32>(&recording, 0, settings).map(|_| ()) {
            Err(ReplayError::Differs { frame, quantity, .. }) => Some((frame, *quantity)),
            Err(error) => panic!("{error}"),
            Ok(()) => None,
        };
    assert_eq!(differs(&[]), None);
    // The guest comes at 0.1 s.
    let (frame, quantity) = differs(&[("tool.guest.friction", "0.9")]).expect("a difference");
    assert!(frame > 6, "{frame}, {quantity}");
    let (frame, quantity) = differs(&[("solver.iterations", "30")]).expect("a difference");
    assert!(frame == 1 && quantity.to_string().contains("of body `block`"), "{frame}, {quantity}");
    let error = start::<f32>(&recording, 0, &[("solver.method", "explicit")]).map(|_| ());
    let Err(RecordError::Resume(error)) = error else { panic!("{error:?}") };
    assert!(matches!(*error, ResumeError::Method { .. }), "{error}");
    let error = start::<f32>(&recording, 0, &[("solver.substeps", "7")]).map(|_| ());
    let error = error.expect_err("other substeps").to_string();
    assert!(
        error.contains("recorded with substeps") && error.contains("replay it with"),
        "{error}"
    );
}

/// What a person reads of it.
#[test]
fn quantities_have_names() {
    let body = || "liver".to_owned();
    for (quantity, expected) in [
        (
            Quantity::Positions { body: body(), vertices: 4..5 },
            "the position of vertex 4 of body `liver`",
        ),
        (Quantity::Positions { body: body(), vertices: 4..9 }, "among its vertices 4 to 8"),
        (Quantity::Velocities { body: body() }, "velocities of body `liver`"),
        (Quantity::Tool { tool: "probe".into() }, "tool `probe`"),
    ] {
        assert!(quantity.to_string().contains(expected), "{quantity}");
    }
}

/// Files are in it where they are small; others have to be those that were recorded.
#[test]
fn files_of_the_scene_are_those_recorded() {
    let path = "time,x,y,z,rx,ry,rz\n0,0,0,0,0,0,0\n1,0,0,-0.004,0,0,0\n";
    let text = format!(
        "{BLOCK}\n[[tool]]\nname = \"ball\"\nkind = \"sphere\"\nradius = \"6 mm\"\n\
                        position = [\"8 mm\", \"8 mm\", \"22 mm\"]\npath = \"way.csv\"\n"
    );
    let scene = Scene::parse("files.toml", &text, &[]).expect("a scene");
    let assembly = Assembly::new(&scene, &mut |_| Ok(path.as_bytes().to_vec())).expect("files");
    let mut run = Simulation::<f32>::new(scene, assembly).expect("a model");
    for (file, found, is_found) in [
        (RecordedFile::new("way.csv", path.as_bytes()), None, true),
        (
            RecordedFile { content: None, ..RecordedFile::new("way.csv", path.as_bytes()) },
            Some(path),
            true,
        ),
        (
            RecordedFile { content: None, ..RecordedFile::new("way.csv", path.as_bytes()) },
            Some("0,0,0,0,0,0,0\n"),
            false,
        ),
    ] {
        let (_, bytes) = Recorder::begin(&mut run, vec![file]);
        let recording = Recording::read(&bytes).expect("a recording");
        let mut load =
            |_: &str| found.map(|text| text.as_bytes().to_vec()).ok_or("no file".to_owned());
        let read = recording.file("way.csv", &mut load);
        assert_eq!(read.is_ok(), is_found, "{read:?}");
        assert!(is_found || read.expect_err("another file").contains("`way.csv` is not the one"));
    }
    frames(&mut run, 1);
    assert!(run.report().tools[0].force != [f64::NAN; 3] && Vec3::<f64>::ZERO.is_finite());
}
