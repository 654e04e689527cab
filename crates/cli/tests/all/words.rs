//! What commands print, and where.

use crate::common::{Bench, TINY};

#[test]
fn words_are_a_table_or_every_frame_or_json() {
    let bench = Bench::new(TINY);
    let rows = |text: &str| {
        text.lines().filter(|line| line.contains(" s ") && line.contains("J ")).count()
    };
    let usual = bench.run(&[]).stdout;
    assert!(usual.contains("16.0 g"), "{usual}");
    assert_eq!(rows(&usual), 6, "{usual}");
    let verbose = bench.run(&["-v"]).stdout;
    assert_eq!(rows(&verbose), 12, "{verbose}");
    // Each once, and the end as usual.
    let end = |text: &str| text.rsplit("wall:").next().expect("a patch").to_owned();
    assert!(end(&verbose).contains("results: ") && end(&usual).contains("results: "));
    let json = bench.run(&["--json"]).stdout;
    let printed: serde_json::Value = serde_json::from_str(&json).expect("nothing but JSON");
    let written: serde_json::Value =
        serde_json::from_slice(&bench.read("out/summary.json")).expect("JSON");
    assert_eq!(printed, written);
    assert_eq!(bench.run(&["--json", "-v"]).code, Some(2));
}

/// Where results lie in a folder of the scene's name the scene is still meant.
#[test]
fn a_folder_of_its_name_does_not_hide_a_scene() {
    let bench = Bench::new(TINY);
    std::fs::create_dir(bench.path("stretch")).expect("a folder");
    let end = bench.end_of(&["run", "stretch", "--frames", "1", "--out", "out"]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
}

#[test]
fn shells_complete_commands_and_options() {
    let bench = Bench::new(TINY);
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let end = bench.end_of(&["completions", shell]);
        assert_eq!(end.code, Some(0), "{}", end.stderr);
        for word in ["haptics", "resume", "tetrahedralize"] {
            assert!(end.stdout.contains(word), "{shell}: {word}");
        }
    }
}
