//! `viscera run --save` and `--resume`.

use crate::common::{Bench, TINY};

/// The mesh at the end is that of a run that was never stopped, to the byte.
#[test]
fn a_run_goes_on_where_it_was_saved() {
    let bench = Bench::new(TINY);
    assert_eq!(bench.run(&["--frames", "9"]).code, Some(0));
    let end_of = || std::fs::read(bench.path("out/final.vtu")).expect("a mesh");
    let whole = end_of();
    assert_eq!(bench.run(&["--frames", "4", "--save", "four.viscera"]).code, Some(0));
    assert!(end_of() != whole);
    let end = bench.run(&["--frames", "9", "--resume", "four.viscera"]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    assert!(end.stdout.contains("frames: 9 from 5 on"), "{}", end.stdout);
    assert!(end_of() == whole, "another mesh");
}

#[test]
fn what_cannot_be_resumed_is_refused_before_anything_is_written() {
    let bench = Bench::new(TINY);
    assert_eq!(bench.run(&["--frames", "2", "--save", "two.viscera"]).code, Some(0));
    std::fs::remove_dir_all(bench.path("out")).expect("results");
    for (arguments, words) in [
        (&["--resume", "two.viscera", "--frames", "2"][..], "--frames"),
        (&["--resume", "scene.toml"], "scene.toml: this is no saved simulation"),
        (&["--resume", "none.viscera"], "none.viscera"),
        (&["--resume", "two.viscera", "--set", "body.bar.cells=[3, 1, 1]"], "other vertices"),
        (&["--save", "."], "--save"),
    ] {
        let end = bench.run(arguments);
        assert!(end.code.is_some_and(|code| code != 0), "{arguments:?}");
        assert!(end.error().contains(words), "{arguments:?}: {}", end.error());
        assert!(!bench.path("out").exists(), "{arguments:?}");
    }
}
