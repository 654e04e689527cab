//! `viscera haptics`.

use crate::common::{Bench, TINY};

/// A ball over the bar, which a simulated hand presses into it.
const TOOL: &str = r#"
[[tool]]
name = "ball"
kind = "sphere"
radius = "30 mm"
position = ["20 mm", "10 mm", "54 mm"]
"#;

#[test]
fn a_simulated_hand_feels_tissue_within_ticks_and_beside_them() {
    let bench = Bench::new(&format!("{TINY}{TOOL}"));
    for rate in ["1000", "100"] {
        let arguments =
            ["haptics", "scene.toml", "--seconds", "0.6", "--rate", rate, "--out", "felt"];
        let end = bench.end_of(&arguments);
        assert_eq!(end.code, Some(0), "{}", end.stderr);
        assert!(end.stdout.contains("tool `ball` on a spring of 400 N/m"), "{}", end.stdout);
        let summary: serde_json::Value =
            serde_json::from_slice(&bench.read("felt/haptics.json")).expect("JSON");
        assert_eq!(summary["ticks"], 600);
        assert_eq!(summary["finished"], true);
        // A simulation within the ticks has all frames; one beside them as many as the machine has time for.
        let frames = summary["frames"].as_u64().expect("a count");
        assert!(if rate == "1000" { frames == 600 } else { frames > 0 }, "{frames}");
        assert!(summary["largest_change"].as_f64().is_some_and(|change| change <= 0.05 + 1e-12));
        assert!(summary["least_energy"].as_f64().is_some_and(|energy| energy > -1e-4));
        let rows = String::from_utf8(bench.read("felt/haptics.csv")).expect("text");
        assert_eq!(rows.lines().count(), 601);
        let column = |line: &str, n: usize| -> f64 {
            line.split(',').nth(n).and_then(|cell| cell.parse().ok()).expect("a number")
        };
        // The hand goes down, and is pushed up.
        let deepest = rows.lines().skip(1).map(|line| column(line, 3)).fold(f64::MAX, f64::min);
        assert!(deepest < 0.052, "{deepest}");
        if rate == "1000" {
            let strongest = rows.lines().skip(1).map(|line| column(line, 6)).fold(0.0, f64::max);
            assert!(strongest > 1e-3, "{strongest}");
            assert_eq!(
                summary["strongest_force"].as_f64().map(|force| force >= strongest),
                Some(true)
            );
        }
    }
}

#[test]
fn what_cannot_be_felt_is_told() {
    let bench = Bench::new(&format!("{TINY}{TOOL}"));
    bench.write("bare.toml", TINY.as_bytes());
    for (arguments, words) in [
        (&["scene.toml", "--tool", "bal"][..], "there is no tool `bal`; there are `ball`"),
        (&["bare.toml"], "has no tool that a device could move"),
        (&["none.toml"], "none.toml"),
        (&["scene.toml", "--device", "omega"], "there is no haptic device `omega`"),
        (&["scene.toml", "--device", "ws://127.0.0.1:1"], "haply"),
        (&["scene.toml", "--seconds", "-1"], "write seconds"),
        (&["scene.toml", "--rate", "5000"], "write frames a second from 30 to 1000"),
        (&["scene.toml", "--depth", "1e9"], "write millimetres"),
        (&["scene.toml", "--set", "nix"], "write KEY=VALUE"),
    ] {
        let end = bench.end_of(&[&["haptics"], arguments].concat());
        assert!(end.code.is_some_and(|code| code != 0), "{arguments:?}: {}", end.stdout);
        let is_told = end.stderr.to_lowercase().contains(words) || end.stderr.contains(words);
        assert!(is_told, "{arguments:?}: {}", end.stderr);
    }
}
