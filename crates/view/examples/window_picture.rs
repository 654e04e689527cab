//! Makes the picture of the window that README.md shows: the liver lifted by springs, a probe that presses on it and a
//! grasper that waits, in the real window without a display, drawn by a software driver.
//!
//! `cargo run --release -p viscera-view --example window_picture -- docs/images` writes `window.png` into that folder.

#[path = "../tests/common/mod.rs"]
mod common;

use common::{MARGIN, Window};
use eframe::egui::{Key, Vec2, vec2};
use std::process::ExitCode;

/// The size that the window opens with [points].
const SIZE: [u32; 2] = [1280, 800];

/// Simulated time [s] at which springs have lifted the liver and it has come to rest, and how long the probe stays.
const LIFTED: f64 = 5.5;
const STAYS: f64 = 1.5;

/// The force that the probe presses with [N].
const PRESSED: f64 = 1.5;

fn main() -> ExitCode {
    let Some(folder) = std::env::args().nth(1) else {
        eprintln!("error: name the folder for window.png");
        return ExitCode::FAILURE;
    };
    let mut window = Window::open("liver_lifted", &[]);
    let [width, height] = SIZE.map(|all| (all + 2 * MARGIN) as f32);
    window.harness.set_size(vec2(width, height));
    window.harness.set_render_cursor(false);
    window.start();
    // Off at first where a processor draws; here a frame may take its time.
    window.press("shadow");
    advance(&mut window, LIFTED);
    window.press("grasper");
    wait_a_frame(&mut window);
    lead(&mut window, vec2(190.0, 30.0));
    window.press("probe");
    wait_a_frame(&mut window);
    // Before the liver, down to its right lobe, and into it.
    hold_key(&mut window, Key::PageDown, 70);
    lead(&mut window, vec2(-120.0, 190.0));
    while force(&window) < PRESSED && time(&window) < 4.0 * LIFTED {
        hold_key(&mut window, Key::PageUp, 2);
        wait_until_there(&mut window);
    }
    let until = time(&window) + STAYS;
    advance(&mut window, until);
    match window.write_picture(std::path::Path::new(&folder), "window") {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {folder}: {error}");
            ExitCode::FAILURE
        }
    }
}

/// The force on the tool that is in hand [N].
fn force(window: &Window) -> f64 {
    let hand = window.harness.state().instruments().active().map(|held| held.id);
    let tool = window.run(0).tools.iter().find(|tool| tool.hand == hand);
    tool.map_or(0.0, viscera_stage::ToolSnapshot::force)
}

/// Drags the instrument in hand by a way [points] and waits until it is there.
fn lead(window: &mut Window, way: Vec2) {
    let app = window.harness.state();
    let held = app.instruments().active().expect("an instrument in hand");
    let from = app.place(held.pose.translation).expect("in front of the viewer");
    window.harness.hover_at(from);
    window.harness.step();
    window.harness.drag_at(from);
    window.harness.step();
    window.harness.hover_at(from + way);
    window.harness.step();
    window.harness.drop_at(from + way);
    window.harness.step();
    wait_until_there(window);
}

/// Holds a key down for so many frames of the window.
fn hold_key(window: &mut Window, key: Key, frames: usize) {
    window.harness.key_down(key);
    (0..frames).for_each(|_| window.harness.step());
    window.harness.key_up(key);
    window.harness.step();
}

/// Waits until the instrument in hand is where it is led.
fn wait_until_there(window: &mut Window) {
    let hand = window.harness.state().instruments().active().map(|held| held.id);
    window.wait("an instrument that arrives", |app| {
        let held = app.instruments().active().map(|held| held.pose.translation);
        let run = app.snapshot().and_then(|snapshot| snapshot.runs.first());
        let tool = run.and_then(|run| run.tools.iter().find(|tool| tool.hand == hand));
        held.zip(tool).is_some_and(|(to, tool)| (to - tool.pose.translation).length() < 1e-6)
    });
}

fn time(window: &Window) -> f64 {
    window.harness.state().snapshot().map_or(0.0, |snapshot| snapshot.time)
}

fn wait_a_frame(window: &mut Window) {
    let before = time(window);
    window.wait("a frame", |app| app.snapshot().is_some_and(|snapshot| snapshot.time > before));
}

/// Shows frames until so much time [s] is simulated.
fn advance(window: &mut Window, until: f64) {
    while time(window) < until {
        wait_a_frame(window);
    }
}
