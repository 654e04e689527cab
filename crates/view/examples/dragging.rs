//! Drags the procedural liver about for minutes, in the real window without a display, and reports what that takes:
//! frames simulated and drawn per second, memory, from the movement of the mouse to moved tissue.
//!
//! `cargo run --release -p viscera-view --example dragging -- 10` drags for ten minutes. More arguments change
//! settings, as in `body.liver.spacing="5 mm" solver.device=gpu`; with `--hardware` the graphics card draws instead of a
//! software driver.

#[path = "../tests/common/mod.rs"]
mod common;

use common::Window;
use eframe::egui::vec2;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// How often the tissue is let go of and taken elsewhere.
const REGRASPED_EVERY: Duration = Duration::from_secs(5);

fn main() -> ExitCode {
    let minutes: f64 = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(1.0);
    let settings: Vec<String> = std::env::args().skip(2).collect();
    let on_hardware = settings.iter().any(|setting| setting == "--hardware");
    let settings: Vec<_> = settings.iter().filter_map(|setting| setting.split_once('=')).collect();
    let open = if on_hardware { Window::open_on_hardware } else { Window::open };
    let mut window = open("liver_lifted", &settings);
    window.start();
    let view = window.view();
    let begun = Instant::now();
    let (mut drawn, mut grasp, mut reported) = (0u32, 0u32, Instant::now());
    let (mut number, mut first_memory) = (0, None);
    let mut latency: Vec<Duration> = Vec::new();
    println!("minute  simulated/s  drawn/s  memory  holds  mouse to tissue (median)");
    while begun.elapsed().as_secs_f64() < 60.0 * minutes {
        let start = Instant::now();
        let from = view.center() + vec2(12.0 * (grasp % 5) as f32 - 24.0, 6.0 * (grasp % 3) as f32);
        grasp += 1;
        window.harness.hover_at(from);
        window.harness.step();
        window.harness.drag_at(from);
        window.harness.step();
        while start.elapsed() < REGRASPED_EVERY {
            let angle = 2.0 * start.elapsed().as_secs_f32();
            let to = from + vec2(60.0 * angle.sin(), 50.0 * (angle.cos() - 1.0));
            let before = window.run(0).positions.clone();
            let moved = Instant::now();
            window.harness.hover_at(to);
            window.harness.step();
            if window.harness.render().is_err() {
                eprintln!("error: the window cannot be drawn");
                return ExitCode::FAILURE;
            }
            drawn += 1;
            if window.run(0).positions != before {
                latency.push(moved.elapsed());
            }
            if !window.run(0).positions.iter().all(|x| x.is_finite()) {
                eprintln!("error: positions that are NaN");
                return ExitCode::FAILURE;
            }
        }
        window.harness.drop_at(from);
        window.harness.step();
        if reported.elapsed().as_secs() >= 30 || begun.elapsed().as_secs_f64() >= 60.0 * minutes {
            let seconds = reported.elapsed().as_secs_f64();
            let now = window.harness.state().snapshot().map_or(0, |snapshot| snapshot.number);
            let memory = resident_megabytes();
            first_memory = first_memory.or(memory);
            latency.sort();
            println!(
                "{:6.1}  {:11.1}  {:7.1}  {:>4} MB  {:5}  {:?}",
                begun.elapsed().as_secs_f64() / 60.0,
                (now - number) as f64 / seconds,
                f64::from(drawn) / seconds,
                memory.map_or("?".to_owned(), |megabytes| format!("{megabytes:.0}")),
                grasp,
                latency.get(latency.len() / 2).copied().unwrap_or_default(),
            );
            (number, drawn, reported) = (now, 0, Instant::now());
            latency.clear();
        }
    }
    ExitCode::SUCCESS
}

/// What the process has in memory, where the system tells.
fn resident_megabytes() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find(|line| line.starts_with("VmRSS"))?;
    let kilobytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes / 1024.0)
}
