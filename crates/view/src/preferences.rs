//! What the window remembers from one time to the next.

use eframe::wgpu;

use crate::holds::Grip;
use crate::probe::{SolverVariant, VARIANTS};
use viscera_stage::Coloring;

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
            save_by_hand: true,
        }
    }
}
