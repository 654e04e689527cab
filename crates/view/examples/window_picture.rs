//! Makes the picture of the window that README.md shows: the liver lifted by springs and pulled by a hand, in the
//! real window without a display, drawn by a software driver.
//!
//! `cargo run --release -p viscera-view --example window_picture -- docs/images` writes `window.png` into that folder.

#[path = "../tests/common/mod.rs"]
mod common;

use common::{MARGIN, Window};
use eframe::egui::vec2;
use std::process::ExitCode;

/// The size that the window opens with [points].
const SIZE: [u32; 2] = [1280, 800];

/// Simulated times [s]: springs have lifted the liver and it has come to rest; the hand has pulled; and rests.
const LIFTED: f64 = 5.5;
const PULLED: f64 = 8.5;
const RESTS: f64 = 12.0;

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
    let view = window.view();
    advance(&mut window, LIFTED);
    // A place on the right lobe, and the way that the hand goes.
    let from = view.min + vec2(0.31, 0.41) * view.size();
    let way = vec2(-76.0, -50.0);
    window.harness.hover_at(from);
    window.harness.step();
    window.harness.drag_at(from);
    window.harness.step();
    let begun = time(&window);
    while time(&window) < PULLED {
        let share = ((time(&window) - begun) / (PULLED - begun)) as f32;
        window.harness.hover_at(from + way * share.min(1.0));
        wait_a_frame(&mut window);
    }
    window.harness.hover_at(from + way);
    advance(&mut window, RESTS);
    match window.write_picture(std::path::Path::new(&folder), "window") {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {folder}: {error}");
            ExitCode::FAILURE
        }
    }
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
