//! What a run says of ties.

use crate::common::Bench;

/// A plate that is lifted from a block by 2 mm; each is held as a whole, so that ties of 2 kPa/mm stretch by that way.
const TIED: &str = r#"
time = { duration = "0.6 s", velocity_factor = 0.9 }
world = { gravity = 0 }
output = { every = 36, tets = false, surface = false, picture = false }

[[body]]
name = "block"
shape = "block"
size = ["20 mm", "20 mm", "8 mm"]
cells = [2, 2, 1]
material = { young = "10 kPa" }

[[body]]
name = "plate"
shape = "block"
size = ["20 mm", "20 mm", "4 mm"]
cells = [2, 2, 1]
position = [0, 0, "9.5 mm"]
material = { young = "10 kPa" }

[[fixing]]
body = "block"
half_space = { point = [0, 0, "9 mm"], normal = [0, 0, -1] }

[[motion]]
name = "hand"
body = "plate"
half_space = { point = [0, 0, "9 mm"], normal = [0, 0, 1] }
keys = [{ time = "0.1 s" }, { time = "0.5 s", translation = [0, 0, "2 mm"] }]

[[tie]]
name = "bed"
from = { body = "plate", half_space = { point = [0, 0, "9.5 mm"], normal = [0, 0, -1] } }
to = { body = "block", half_space = { point = [0, 0, "8 mm"], normal = [0, 0, 1] } }
distance = "2 mm"
stiffness = "2 kPa/mm"
strength = "5 kPa"
"#;

#[test]
fn a_run_prints_what_ties_hold_and_how_many_points_are_torn() {
    for (strength, force) in [("5 kPa", "1.6000"), ("3 kPa", "0.0000")] {
        let bench = Bench::new(TIED);
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
