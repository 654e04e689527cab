//! The app in a window of the system.

use anyhow::{Result, anyhow, bail};
use eframe::egui::{self, ViewportBuilder};
use eframe::egui_wgpu::{WgpuConfiguration, WgpuSetup, WgpuSetupCreateNew};
use eframe::wgpu;
use std::sync::Arc;

use crate::app::{App, Options};
use crate::preferences::Preferences;

/// The window's name to the system, and the folder that its layout is remembered in.
const NAME: &str = "viscera-view";

/// Where the app's own part of what is remembered lies.
const REMEMBERED: &str = "preferences";

/// Opens the window and stays until it is closed.
pub fn open(options: Options) -> Result<()> {
    check_display()?;
    let farewell = Arc::clone(&options.farewell);
    let native = eframe::NativeOptions {
        viewport: ViewportBuilder::default()
            .with_title("viscera")
            .with_app_id(NAME)
            .with_inner_size([1280.0, 800.0])
            .with_min_inner_size([640.0, 420.0]),
        wgpu_options: WgpuConfiguration { wgpu_setup: setup(), ..Default::default() },
        ..Default::default()
    };
    let made = eframe::run_native(
        NAME,
        native,
        Box::new(move |creation| {
            let state = creation.wgpu_render_state.clone();
            let state = state.ok_or("there is no graphics device to draw with")?;
            let remembered = creation.storage.and_then(|storage| storage.get_string(REMEMBERED));
            let preferences = remembered.and_then(|text| serde_json::from_str(&text).ok());
            let suited = || Preferences::suited_to(&state.adapter);
            let preferences: Preferences = preferences.unwrap_or_else(suited);
            Ok(Box::new(App::new(&creation.egui_ctx, state, options, preferences)?))
        }),
    );
    let ended = made.map_err(|error| match error {
        eframe::Error::AppCreation(error) => anyhow!("{error}"),
        error => anyhow!(
            "cannot open a window: {error}; {HEADLESS}. Without graphics hardware a software Vulkan driver \
             draws (Debian, Ubuntu: mesa-vulkan-drivers)"
        ),
    });
    match farewell.get() {
        Some(reason) => bail!("the window had to close: {reason}"),
        None => ended,
    }
}

/// What one can do without a window.
const HEADLESS: &str = "`viscera run SCENE` needs none, computes the same and writes pictures";

/// Where windows need a display server, an error if there is none: the window library's own words name
/// the place in its source.
fn check_display() -> Result<()> {
    let servers = ["WAYLAND_DISPLAY", "WAYLAND_SOCKET", "DISPLAY"];
    let is_set = |name: &&str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    let needed = cfg!(all(unix, not(target_os = "macos")));
    if needed && !servers.iter().any(is_set) {
        bail!(
            "there is no display to open a window on (neither DISPLAY nor WAYLAND_DISPLAY is set); {HEADLESS}"
        );
    }
    Ok(())
}

/// A device that the drawing and the solver can share: with what the adapter can do.
fn setup() -> WgpuSetup {
    let mut setup = WgpuSetupCreateNew::without_display_handle();
    setup.power_preference = wgpu::PowerPreference::HighPerformance;
    setup.device_descriptor = Arc::new(|adapter| {
        let limits = adapter.limits();
        wgpu::DeviceDescriptor {
            label: Some("window"),
            required_limits: wgpu::Limits {
                max_storage_buffer_binding_size: limits.max_storage_buffer_binding_size,
                max_buffer_size: limits.max_buffer_size,
                max_texture_dimension_2d: limits.max_texture_dimension_2d,
                ..wgpu::Limits::default()
            },
            ..Default::default()
        }
    });
    WgpuSetup::CreateNew(setup)
}

impl eframe::App for App {
    fn ui(&mut self, ui: &mut egui::Ui, _: &mut eframe::Frame) {
        self.show(ui);
    }

    fn save(&mut self, storage: &mut dyn eframe::Storage) {
        if let Ok(text) = serde_json::to_string(self.preferences()) {
            storage.set_string(REMEMBERED, text);
        }
    }

    fn on_exit(&mut self) {
        self.close();
    }
}
