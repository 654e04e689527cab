//! `viscera run --record` and `viscera replay`.

use crate::common::{Bench, TINY};

/// A ball that presses on the bar on its way.
const TOOL: &str = r#"
[[tool]]
name = "ball"
kind = "sphere"
radius = "30 mm"
position = ["20 mm", "10 mm", "60 mm"]
keys = [{ time = "0.2 s", translation = [0, 0, "-14 mm"] }]
"#;

#[test]
fn a_recorded_run_is_replayed_and_told_apart() {
    let bench = Bench::new(&format!("{TINY}{TOOL}"));
    let end = bench.run(&["--frames", "40", "--record", "run.replay"]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    let results = ["out/final.vtu", "out/tools.csv"].map(|file| bench.read(file));
    for threads in ["1", "3"] {
        let end = bench.end_of(&["replay", "run.replay", "--threads", threads]);
        assert_eq!(end.code, Some(0), "{}", end.stderr);
        assert!(end.stdout.contains("replayed 40 frames, 0.67 s: all with the recorded bits"));
    }
    let end = bench.end_of(&["replay", "run.replay", "--output", "again"]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    assert!(results == ["again/final.vtu", "again/tools.csv"].map(|file| bench.read(file)));
    let end = bench.end_of(&["replay", "run.replay", "--until", "0.05"]);
    assert!(end.stdout.contains("replayed 3 frames"), "{}", end.stdout);

    let whole = bench.read("run.replay");
    bench.write("cut.replay", &whole[..whole.len() - 40]);
    let end = bench.end_of(&["replay", "cut.replay"]);
    assert!(end.stderr.contains("cut off at byte"), "{}", end.stderr);
    assert!(end.code == Some(0) && end.stdout.contains("replayed 30 frames"), "{}", end.stdout);
    let mut edited = whole.clone();
    let place = whole.len() - 30;
    edited[place] ^= 4;
    bench.write("edited.replay", &edited);
    edited[60] ^= 4;
    bench.write("early.replay", &edited);
    for (arguments, words) in [
        (&["edited.replay"][..], "is damaged at byte"),
        (&["early.replay"], "before its first frame"),
        (&["cut.replay", "--until", "0"], "has no frames"),
        (&["scene.toml"], "this is no recording"),
        (&["run.replay", "--until", "soon"], "write seconds"),
        (&["none.replay"], "none.replay"),
    ] {
        let end = bench.end_of(&[&["replay"], arguments].concat());
        assert!(end.code.is_some_and(|code| code != 0), "{arguments:?}");
        assert!(end.stderr.contains(words), "{arguments:?}: {}", end.stderr);
    }
}
