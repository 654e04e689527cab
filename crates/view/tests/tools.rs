//! Tools in the window, without a display: what is seen of them.

mod common;

use common::Window;
use viscera_view::curves::Source;

#[test]
fn tools_of_a_scene_are_seen_with_their_forces() {
    let mut window = Window::running("palpation", &[]);
    let still = window.pixels();
    window.wait("a touch", |app| {
        let run = app.snapshot().and_then(|snapshot| snapshot.runs.first());
        run.is_some_and(|run| run.tools.iter().any(|tool| tool.met.touches > 0 && tool.force() > 0.2))
    });
    let tool = window.run(0).tools[0].clone();
    assert!(tool.met.error.is_some_and(|error| error > 0.0 && error < tool.force()), "{tool:?}");
    assert!(window.run(0).ledger.work > 0.0);
    // Steel is grey, and moves.
    let grey = |[r, g, b]: [u8; 3]| r.abs_diff(g) < 16 && b >= r && r < 170;
    let pixels = window.pixels();
    let changed = pixels.iter().zip(&still).filter(|(new, old)| new != old && grey(**new)).count();
    assert!(changed > 200, "{changed} pixels of steel");
    let source = Source::Tool(tool.met.name.clone());
    let last = window.harness.state().forces().last(&source).expect("a curve");
    assert!(last.forces[0] > 0.2 && last.error.is_some());
    window.picture("palpation");
}
