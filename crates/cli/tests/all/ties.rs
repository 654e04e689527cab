//! What a run says of ties.

use crate::common::Bench;
use crate::tied::held;

#[test]
fn a_run_prints_what_ties_hold_and_how_many_points_are_torn() {
    for (strength, force) in [("5 kPa", "1.6000"), ("3 kPa", "0.0000")] {
        let bench = Bench::new(&held());
        let printed = bench.run(&["--set", &format!("tie.bed.strength={strength}")]).stdout;
        let summary = bench.summary("out");
        let frames = summary["frames"].as_array().expect("frames");
        let tie = &frames.last().expect("a frame")["ties"][0];
        let [points, torn] = ["points", "torn"].map(|key| tie[key].as_u64().expect(key));
        assert!(points > 4 && torn == if strength == "3 kPa" { points } else { 0 }, "{tie}");
        let line = format!("\nbed: {torn} of {points} points torn, force {force} N\n");
        assert!(printed.contains(&line), "{line}{printed}");
    }
}
