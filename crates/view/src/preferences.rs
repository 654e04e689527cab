//! What the window remembers from one time to the next.

use eframe::wgpu;
use std::path::PathBuf;

use crate::holds::Grip;
use crate::probe::{SolverVariant, VARIANTS};
use viscera_stage::Coloring;

/// How many files are remembered.
const MOST_RECENT: usize = 10;

/// How things are shown and how one takes hold; no part of a scene.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default)]
pub struct Preferences {
    /// What the tissue's colour shows.
    pub coloring: Coloring,
    /// Whether the surface's triangles are drawn.
    pub wireframe: bool,
    /// Whether fixed vertices are marked.
    pub fixings: bool,
    /// Whether tissue throws a shadow.
    pub shadow: bool,
    /// How one takes hold.
    pub grip: Grip,
    /// Whether the panel of settings is open.
    pub settings_open: bool,
    /// Whether the curve of forces is open.
    pub curve_open: bool,
    /// Whether the plot of convergence is open.
    pub convergence_open: bool,
    /// Which of the solvers are ticked there.
    pub ticked: Vec<SolverVariant>,
    /// Scene files that were open, the newest first.
    pub recent: Vec<PathBuf>,
    /// Whether a saved scene repeats what was done by hand.
    pub save_by_hand: bool,
}

impl Preferences {
    /// Where nothing is remembered: without shadows where a processor draws, which they would keep from drawing
    /// five pictures a second.
    pub fn suited_to(adapter: &wgpu::Adapter) -> Self {
        let software = adapter.get_info().device_type == wgpu::DeviceType::Cpu;
        Self { shadow: !software, ..Self::default() }
    }

    /// A file was opened.
    pub fn remember(&mut self, file: PathBuf) {
        self.recent.retain(|known| *known != file);
        self.recent.insert(0, file);
        self.recent.truncate(MOST_RECENT);
    }

    /// Solvers by which steps are to be repeated.
    pub fn ticked_variants(&self) -> Vec<SolverVariant> {
        if self.convergence_open { self.ticked.clone() } else { Vec::new() }
    }
}

impl Default for Preferences {
    fn default() -> Self {
        Self {
            coloring: Coloring::Plain,
            wireframe: false,
            fixings: true,
            shadow: true,
            grip: Grip::default(),
            settings_open: true,
            curve_open: true,
            convergence_open: false,
            ticked: vec![VARIANTS[0].0, VARIANTS[1].0, VARIANTS[5].0],
            recent: Vec::new(),
            save_by_hand: true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_files_are_remembered_once() {
        let mut preferences = Preferences::default();
        for n in (0..=MOST_RECENT).chain([5]) {
            preferences.remember(PathBuf::from(format!("{n}.toml")));
        }
        let names = preferences.recent.iter().map(|path| path.display().to_string());
        let names: Vec<_> = names.collect();
        assert_eq!((names.len(), names[0].as_str(), names[1].as_str()), (10, "5.toml", "10.toml"));
        assert_eq!(names.iter().filter(|name| *name == "5.toml").count(), 1);
        // What an earlier version remembered has no such list.
        let earlier = serde_json::from_str(r#"{ "coloring": "Stress", "wireframe": true }"#);
        let earlier: Preferences = earlier.expect("preferences");
        assert!(earlier.wireframe && earlier.recent.is_empty());
    }
}
