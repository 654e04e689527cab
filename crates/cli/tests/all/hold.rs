//! Whether tissue holds still on tools that stand still, as a run says at its end.

use crate::common::Bench;
use serde_json::Value;

/// A bar that swings and comes to rest, or bends onto a ball that comes from below.
const BAR: &str = r#"
time = { duration = "2.5 s", velocity_factor = 0.9 }
output = { every = 150, tets = false, surface = false, picture = false }

[[body]]
name = "bar"
shape = "block"
size = ["60 mm", "10 mm", "10 mm"]
cells = [12, 2, 2]
material = { young = "10 kPa" }

[[fixing]]
name = "wall"
body = "bar"
half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }

[[tool]]
name = "ball"
kind = "sphere"
radius = "6 mm"
position = ["50 mm", "5 mm", "-20 mm"]
keys = [{ time = "0.5 s", translation = [0, 0, "10 mm"] }]
"#;

/// What a run with these settings prints, and what it writes.
fn ended(bench: &Bench, settings: &[&str]) -> (String, Value) {
    let arguments: Vec<&str> = settings.iter().flat_map(|setting| ["--set", setting]).collect();
    let printed = bench.run(&arguments).stdout;
    (printed, bench.summary("out"))
}

/// Force on the ball in each frame, as `tools.csv` has it [N].
fn forces(bench: &Bench) -> Vec<[f64; 3]> {
    let table = String::from_utf8(bench.read("out/tools.csv")).expect("text");
    let number = |text: &str| text.parse::<f64>().expect("a number");
    let rows = table.lines().skip(1).map(|row| row.split(',').collect::<Vec<_>>());
    rows.map(|row| [number(row[1]), number(row[2]), number(row[3])]).collect()
}

#[test]
fn tissue_that_rests_on_a_tool_holds_still() {
    let bench = Bench::new(BAR);
    let (printed, summary) = ended(&bench, &[]);
    assert!(printed.contains("\nholds still: over the last 0.5 s"), "{printed}");
    let hold = &summary["hold"];
    let [distance, error, change] =
        ["distance", "error", "force_error"].map(|key| hold[key].as_f64().expect(key));
    assert!(error < 0.005 && distance < 0.005 * 0.06, "{hold}");
    // From the table, 30 frames apart.
    let forces = forces(&bench);
    let length = |force: [f64; 3]| force.map(|x| x * x).iter().sum::<f64>().sqrt();
    let (before, now) = (forces[119], forces[149]);
    let apart = length([now[0] - before[0], now[1] - before[1], now[2] - before[2]]);
    assert!(length(now) > 0.01, "the bar lies on the ball: {now:?}");
    assert!((change - apart / length(now)).abs() < 1e-9, "{change} {apart}");
}

#[test]
fn what_swings_beside_a_tool_does_not_hold_still() {
    let bench = Bench::new(BAR);
    let still = ["tool.ball.position=[0, 0, \"-1 m\"]", "time.velocity_factor=1"];
    let (printed, summary) = ended(&bench, &still);
    assert!(printed.contains("\nnot at rest yet: over the last 0.5 s"), "{printed}");
    assert!(summary["hold"]["error"].as_f64().is_some_and(|error| error > 0.005));
}

#[test]
fn of_tools_that_move_to_the_end_nothing_is_said() {
    let bench = Bench::new(BAR);
    let (printed, summary) = ended(&bench, &["time.duration=0.8 s"]);
    assert!(summary["hold"].is_null() && !printed.contains("holds still"), "{printed}");
    assert!(!printed.contains("not at rest yet"), "{printed}");
}
