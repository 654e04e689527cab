//! The real window without a display: what drives it in tests and in `examples/dragging.rs`.
#![allow(dead_code)]

use eframe::egui::{
    DroppedFile, DroppedFileHandle, Event, HoveredFile, Key, Modifiers, Pos2, Rect, Role, Vec2,
    vec2,
};
use eframe::egui_wgpu::WgpuSetup;
use egui_kittest::kittest::Queryable;
use egui_kittest::{Harness, wgpu};
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};
use viscera::scene::Scene;
use viscera_picture::{Image, ImageSize, write_png};
use viscera_stage::RunSnapshot;
use viscera_view::choices::Side;
use viscera_view::preferences::Preferences;
use viscera_view::{App, Options};

/// The longest that anything may take before a test fails; most take tenths of a second, and making a scene of a surface a few.
const PATIENCE: Duration = Duration::from_secs(60);

/// The test harness leaves so much black around the window [pixels].
pub const MARGIN: u32 = 8;

/// A file as the system drops it.
#[derive(Debug)]
struct Dropped(PathBuf);

impl DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        std::fs::read(&self.0).map_err(|error| error.to_string())
    }
}

/// The window, driven from outside.
pub struct Window {
    pub harness: Harness<'static, App>,
    /// Where everything is written.
    pub folder: tempfile::TempDir,
    /// What it is drawn with.
    pub device: eframe::wgpu::Device,
    /// Why it had to close.
    pub farewell: Arc<OnceLock<String>>,
}

fn owned(settings: &[(&str, &str)]) -> Vec<(String, String)> {
    settings.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect()
}

impl Window {
    /// Opens a scene in a folder of its own, drawn by a software driver where there is one: it gives the same
    /// pictures everywhere.
    pub fn open(scene: &str, settings: &[(&str, &str)]) -> Self {
        Self::open_on(wgpu::default_wgpu_setup(), scene, settings)
    }

    /// The same, drawn by the fastest hardware.
    pub fn open_on_hardware(scene: &str, settings: &[(&str, &str)]) -> Self {
        let mut setup = wgpu::default_wgpu_setup();
        if let WgpuSetup::CreateNew(new) = &mut setup {
            new.native_adapter_selector = None;
        }
        Self::open_on(setup, scene, settings)
    }

    fn open_on(setup: WgpuSetup, scene: &str, settings: &[(&str, &str)]) -> Self {
        Self::open_with(setup, scene, [settings, &[]], false)
    }

    /// Drawn in software, with simulations on the window's device.
    pub fn open_on_one_device(scene: &str, settings: &[(&str, &str)]) -> Self {
        Self::open_with(wgpu::default_wgpu_setup(), scene, [settings, &[]], true)
    }

    /// With a second solver that has these settings of its own.
    pub fn open_beside(
        setup: WgpuSetup,
        scene: &str,
        settings: &[(&str, &str)],
        beside: &[(&str, &str)],
    ) -> Self {
        Self::open_with(setup, scene, [settings, beside], false)
    }

    fn open_with(
        setup: WgpuSetup,
        scene: &str,
        [settings, beside]: [&[(&str, &str)]; 2],
        shares_software: bool,
    ) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let state =
            wgpu::create_render_state(setup, eframe::egui_wgpu::RendererOptions::PREDICTABLE);
        let farewell = Arc::default();
        let options = Options {
            scene: scene.into(),
            settings: owned(settings),
            beside: owned(beside),
            data: None,
            pictures: folder.path().join("pictures"),
            scenes: folder.path().to_owned(),
            farewell: Arc::clone(&farewell),
            shares_software,
        };
        let context = eframe::egui::Context::default();
        let preferences = Preferences::suited_to(&state.adapter);
        let app = App::new(&context, state.clone(), options, preferences).expect("a window");
        let device = state.device.clone();
        let renderer = wgpu::WgpuTestRenderer::from_render_state(state);
        let harness = Harness::builder()
            .with_size(vec2(1100.0, 760.0))
            .with_step_dt(1.0 / 60.0)
            .renderer(renderer)
            .build_ui_state(|ui, app: &mut App| app.show(ui), app);
        Self { harness, folder, device, farewell }
    }

    /// Opens a scene and waits until it moves.
    pub fn running(scene: &str, settings: &[(&str, &str)]) -> Self {
        let mut window = Self::open(scene, settings);
        window.start();
        window
    }

    /// Waits until it moves.
    pub fn start(&mut self) {
        self.wait("frames", |app| app.snapshot().is_some_and(|snapshot| snapshot.number >= 2));
    }

    /// Shows frame after frame of the window until something holds.
    pub fn wait(&mut self, what: &str, holds: impl Fn(&App) -> bool) {
        let start = Instant::now();
        while !holds(self.harness.state()) {
            let texts: Vec<_> = self.harness.state().messages().texts().collect();
            assert!(
                start.elapsed() < PATIENCE,
                "waited in vain for {what}; the window says {texts:?}"
            );
            self.harness.step();
            std::thread::sleep(Duration::from_millis(5));
        }
        self.harness.step();
    }

    pub fn press(&mut self, name: &str) {
        self.harness.get_by_label(name).scroll_to_me();
        self.harness.step();
        self.harness.get_by_label(name).click();
        self.harness.step();
        self.harness.step();
    }

    pub fn slide(&mut self, name: &str, value: f64) {
        self.harness.get_by_role_and_label(Role::Slider, name).set_value_accesskit(value);
        self.harness.step();
        self.harness.step();
    }

    /// Goes into a number, replaces it key by key, and leaves it by another key.
    pub fn type_number(&mut self, name: &str, text: &str, leave: Key) {
        self.harness.get_by_role_and_label(Role::SpinButton, name).focus();
        self.harness.step();
        self.harness.step();
        for letter in text.chars() {
            self.harness.event(Event::Text(letter.to_string()));
            // Time for the simulation to see what it should not.
            let number = self.harness.state().snapshot().map_or(0, |snapshot| snapshot.number);
            self.wait("a frame", |app| {
                app.snapshot().is_some_and(|snapshot| snapshot.number > number)
            });
        }
        self.harness.key_press(leave);
        self.harness.step();
        self.harness.step();
    }

    /// What the window says.
    pub fn texts(&self) -> Vec<String> {
        self.harness.state().messages().texts().map(str::to_owned).collect()
    }

    /// Number of undo steps.
    pub fn undo_steps(&mut self) -> usize {
        let mut steps = 0;
        while self.harness.state().session().history().can_undo() {
            self.press("Undo");
            steps += 1;
        }
        (0..steps).for_each(|_| self.press("Redo"));
        steps
    }

    /// Presses in the middle of the view, pulls so far, and lets the button go.
    pub fn drag(&mut self, way: Vec2) {
        let middle = self.view().center();
        self.harness.hover_at(middle);
        self.harness.step();
        self.harness.drag_at(middle);
        self.harness.step();
        for share in [0.25, 0.5, 0.75, 1.0] {
            self.harness.hover_at(middle + way * share);
            self.harness.step();
            let number = self.harness.state().snapshot().map_or(0, |snapshot| snapshot.number);
            self.wait("a frame", |app| {
                app.snapshot().is_some_and(|snapshot| snapshot.number > number)
            });
        }
        self.harness.drop_at(middle + way);
        self.harness.step();
    }

    /// Saves the scene there, and reads it.
    pub fn save(&mut self, path: &Path) -> Scene {
        self.harness.state_mut().save_under(path);
        self.harness.key_press_modifiers(Modifiers::COMMAND, Key::S);
        self.wait("the file", |_| path.exists());
        let text = std::fs::read_to_string(path).expect("a file");
        Scene::parse("saved", &text, &[]).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Moves files over the window, or away from it where there are none.
    pub fn hover_files(&mut self, files: &[&Path]) {
        let hovered = files
            .iter()
            .map(|file| HoveredFile { path: Some(file.to_path_buf()), ..HoveredFile::default() });
        self.harness.input_mut().hovered_files = hovered.collect();
        self.harness.step();
    }

    /// Drops files onto the window.
    pub fn drop_files(&mut self, files: &[&Path]) {
        self.harness.input_mut().hovered_files.clear();
        let dropped =
            files.iter().map(|file| -> DroppedFileHandle { Arc::new(Dropped(file.to_path_buf())) });
        self.harness.input_mut().dropped_files = dropped.collect();
        self.harness.step();
        self.harness.step();
    }

    pub fn view(&self) -> Rect {
        self.harness.get_by_label("view").rect()
    }

    /// The sum of the colours in the view, by pixels.
    pub fn pixels(&mut self) -> Vec<[u8; 3]> {
        let view = self.view();
        let image = self.harness.render().expect("a picture of the window");
        let inside = |x: u32, y: u32| view.contains(Pos2::new(x as f32, y as f32));
        let pixels = image.enumerate_pixels().filter(|(x, y, _)| inside(*x, *y));
        pixels.map(|(_, _, pixel)| [pixel[0], pixel[1], pixel[2]]).collect()
    }

    /// A picture of the whole window in the folder that VISCERA_PICTURES names, for a person to look at.
    pub fn picture(&mut self, name: &str) {
        let Some(folder) = std::env::var_os("VISCERA_PICTURES") else { return };
        self.write_picture(Path::new(&folder), name).expect("a file");
    }

    /// The same in a folder.
    pub fn write_picture(&mut self, folder: &Path, name: &str) -> std::io::Result<()> {
        let image = self.harness.render().expect("a picture of the window");
        let inside = |all: u32| MARGIN..all.saturating_sub(MARGIN);
        let (columns, rows) = (inside(image.width()), inside(image.height()));
        let size = ImageSize::new(columns.len() as u32, rows.len() as u32).expect("a size");
        let colour = |x, y| {
            let pixel = image.get_pixel(x, y);
            [pixel[0], pixel[1], pixel[2]]
        };
        let pixels =
            rows.flat_map(|y| columns.clone().map(move |x| (x, y))).map(|(x, y)| colour(x, y));
        let image = Image::from_pixels(size, pixels.collect()).expect("a picture");
        let bytes = write_png(&image).expect("a PNG");
        std::fs::write(folder.join(format!("{name}.png")), bytes)
    }

    pub fn run(&self, number: usize) -> &RunSnapshot {
        &self.harness.state().snapshot().expect("a frame").runs[number]
    }

    pub fn scene(&self) -> &Scene {
        self.harness.state().session().scene(Side::First)
    }
}
