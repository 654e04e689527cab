//! Hands on the tissue: mouse, fingers, keys.

use crate::browser::{Kind, Tab, View};
use crate::page::{BAR, dismiss, farthest, number, numbers, open, open_in, wait_for_tissue};

/// A slab on a table: it is in the middle of the picture.
const SLAB: &str = "#scene=grab&mesh=1.6&solver.device=cpu&solver.accuracy=draft";

/// A place of the window where tissue is, also some pixels around it, near the bar's free end.
fn place_of_tissue(tab: &Tab) -> [f64; 2] {
    let search = "(async () => { let last = null; for (let u = 0.05; u < 0.96; u += 0.05) \
                  for (let v = 0.05; v < 0.96; v += 0.05) { const { x, y } = viscera.pointAt(u, v); \
                  let all = true; for (const [dx, dy] of [[0, 0], [5, 0], [-5, 0], [0, 5], [0, -5]]) \
                  all = all && await viscera.isTissue(x + dx, y + dy); if (all) last = [x, y]; } \
                  return last; })()";
    let place = tab.evaluate(search);
    let place = place.as_array().expect("tissue is somewhere in the picture");
    [number(&place[0]), number(&place[1])]
}

/// Waits until the press has taken hold of tissue.
fn wait_for_pull(tab: &Tab) {
    tab.wait("viscera.worker.post('report').then(() => viscera.state().pull.hold > 0)", 5.0);
}

/// Steps until it hardly moves.
fn rest(tab: &Tab) -> Vec<f64> {
    tab.evaluate("viscera.step(240)");
    numbers(tab, "viscera.vertices(0)")
}

fn bar_at_rest(kind: Kind, view: View) -> Option<(Tab, Vec<f64>)> {
    at_rest(kind, view, BAR)
}

fn at_rest(kind: Kind, view: View, link: &str) -> Option<(Tab, Vec<f64>)> {
    let tab = open_in(kind, view, link)?;
    tab.evaluate("viscera.pause()");
    dismiss(&tab);
    let vertices = rest(&tab);
    Some((tab, vertices))
}

#[test]
fn a_drag_pulls_the_tissue_and_it_comes_back() {
    let Some((tab, before)) = bar_at_rest(Kind::Gpu, View::DESK) else { return };
    let [x, y] = place_of_tissue(&tab);
    tab.mouse("mouseMoved", [x, y], "none");
    tab.mouse("mousePressed", [x, y], "left");
    wait_for_pull(&tab);
    for part in 1..=8 {
        tab.mouse("mouseMoved", [x, y - 15.0 * f64::from(part)], "left");
    }
    // Browsers hand moves on frame by frame: the last one before the steps.
    let frame = "new Promise((done) => requestAnimationFrame(() => done(true)))";
    (0..2).for_each(|_| drop(tab.wait(frame, 5.0)));
    tab.evaluate("viscera.step(30)");
    let held = tab.evaluate("viscera.state().report.runs[0].held");
    let force: f64 =
        held[0]["force"].as_array().expect("a hold").iter().map(number).map(|f| f * f).sum();
    let pulled = farthest(&before, &numbers(&tab, "viscera.vertices(0)"));
    tab.look().save("pulled");
    assert!(force.sqrt() > 0.05, "it takes {} N", force.sqrt());
    assert!(pulled > 5e-3, "it moves by {pulled} m");
    assert!(tab.evaluate("document.querySelector('#tag').textContent").to_string().contains('N'));
    tab.mouse("mouseReleased", [x, y - 120.0], "left");
    let after = farthest(&before, &rest(&tab));
    assert_eq!(tab.evaluate("viscera.state().report.runs[0].held.length"), 0);
    assert!(after < 0.05 * pulled, "{after} m of {pulled} m are left");
}

#[test]
fn a_drag_beside_the_tissue_turns_the_view() {
    let Some((tab, before)) = bar_at_rest(Kind::Plain, View::DESK) else { return };
    let picture = wait_for_tissue(&tab);
    let corner =
        tab.evaluate("(() => { const { x, y } = viscera.pointAt(0.03, 0.1); return [x, y]; })()");
    let [x, y] = [number(&corner[0]), number(&corner[1])];
    tab.mouse("mousePressed", [x, y], "left");
    tab.mouse("mouseMoved", [x + 200.0, y - 60.0], "left");
    tab.mouse("mouseReleased", [x + 200.0, y - 60.0], "left");
    tab.wait("new Promise((done) => setTimeout(() => done(true), 300))", 5.0);
    let area = crate::page::stage(&tab);
    let turned = wait_for_tissue(&tab);
    assert!(turned.difference(&picture, area) > 0.02, "{}", turned.difference(&picture, area));
    let vertices = numbers(&tab, "viscera.vertices(0)");
    assert!(farthest(&before, &vertices) < 1e-9, "the tissue itself stays");
}

#[test]
fn a_finger_pulls_on_a_phone() {
    let Some((tab, before)) = bar_at_rest(Kind::Gpu, View::PHONE) else { return };
    let [x, y] = place_of_tissue(&tab);
    tab.touch("touchStart", &[[x, y]]);
    wait_for_pull(&tab);
    for part in 1..=8 {
        tab.touch("touchMove", &[[x, y - 8.0 * f64::from(part)]]);
    }
    tab.evaluate("viscera.step(30)");
    let pulled = farthest(&before, &numbers(&tab, "viscera.vertices(0)"));
    tab.look().save("phone");
    assert!(pulled > 5e-3, "it moves by {pulled} m");
    tab.touch("touchEnd", &[]);
    let after = farthest(&before, &rest(&tab));
    assert!(after < 0.05 * pulled, "{after} m of {pulled} m are left");
    let scroll = "[document.documentElement.scrollWidth - innerWidth, scrollX, scrollY, \
                  visualViewport.scale].join()";
    assert_eq!(tab.evaluate(scroll), "0,0,0,1", "the page itself stays where it is");
}

#[test]
fn two_fingers_zoom_the_view_and_not_the_page() {
    let Some((tab, before)) = at_rest(Kind::Plain, View::PHONE, SLAB) else { return };
    let share = |tab: &Tab| tab.look().share([0, 0, 780, 1688], crate::page::is_flesh);
    let small = share(&tab);
    let [left, top, width, height] = tab.area("#canvas");
    let (x, y) = (left + width / 2.0, top + height / 2.0);
    tab.touch("touchStart", &[[x - 30.0, y], [x + 30.0, y]]);
    for part in 1..=6 {
        let spread = 30.0 + 8.0 * f64::from(part);
        tab.touch("touchMove", &[[x - spread, y], [x + spread, y]]);
    }
    tab.touch("touchEnd", &[]);
    tab.wait("new Promise((done) => setTimeout(() => done(true), 300))", 5.0);
    let large = share(&tab);
    assert!(large > 1.3 * small, "{small} of the screen before, {large} after");
    assert_eq!(tab.evaluate("visualViewport.scale"), 1);
    assert!(farthest(&before, &numbers(&tab, "viscera.vertices(0)")) < 1e-9);
}

#[test]
fn keys_hold_and_pull() {
    let Some((tab, _)) = at_rest(Kind::Plain, View::DESK, SLAB) else { return };
    // The scene's own forceps have let go by now.
    let before = rest(&tab);
    tab.evaluate("document.getElementById('canvas-frame').focus()");
    tab.key("Enter", 0);
    wait_for_pull(&tab);
    for _ in 0..12 {
        tab.key("ArrowUp", 0);
    }
    tab.evaluate("viscera.step(30)");
    let pulled = farthest(&before, &numbers(&tab, "viscera.vertices(0)"));
    assert!(pulled > 2e-3, "it moves by {pulled} m");
    tab.key("Enter", 0);
    let after = farthest(&before, &rest(&tab));
    assert!(after < 0.05 * pulled, "{after} m of {pulled} m are left");
}

#[test]
fn everything_can_be_reached_at_three_times_the_size() {
    let Some(tab) = open_in(Kind::Plain, View::ZOOMED, BAR) else { return };
    tab.look().save("zoomed");
    let wide = tab.evaluate("document.documentElement.scrollWidth - innerWidth");
    assert_eq!(wide, 0, "nothing has to be scrolled sideways");
    for id in ["play", "reset", "settings", "help", "canvas"] {
        let [left, top, width, height] = tab.area(&format!("#{id}"));
        let is_seen = left >= 0.0 && top >= 0.0 && left + width <= 480.5 && top + height <= 300.5;
        assert!(is_seen && width >= 24.0 && height >= 24.0, "{id}: {left} {top} {width} {height}");
    }
}

#[test]
fn the_keyboard_reaches_every_control() {
    let Some(tab) = open(Kind::Plain, BAR) else { return };
    let mut reached = std::collections::BTreeSet::new();
    for _ in 0..12 {
        tab.key("Tab", 0);
        let id = tab.evaluate("document.activeElement.id");
        reached.insert(id.as_str().unwrap_or_default().to_owned());
    }
    for id in
        ["skip", "play", "step", "reset", "beside", "settings", "share", "save", "canvas-frame"]
    {
        assert!(reached.contains(id), "{id} is not among {reached:?}");
    }
}
