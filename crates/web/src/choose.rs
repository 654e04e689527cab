//! Device, mesh and accuracy for a frame rate, from what the first second has cost.

use serde::{Deserialize, Serialize};

/// What was measured, with the scene's own mesh and the accuracy "standard".
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Measured {
    /// A frame on the CPU by the method that "auto" stands for [ms].
    pub cpu_ms: f64,
    /// A frame on the graphics processor by the method that "auto" stands for there [ms]; nothing where there is none but software.
    #[serde(default)]
    pub gpu_ms: Option<f64>,
    /// What a frame may cost [ms]: 16.7 for 60 a second.
    pub budget_ms: f64,
    /// Whether the mesh can be made coarser and finer.
    #[serde(default = "yes")]
    pub can_change_mesh: bool,
}

fn yes() -> bool {
    true
}

/// What to run with.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Choice {
    /// "cpu" or "gpu".
    pub device: &'static str,
    /// "standard" or "draft".
    pub accuracy: &'static str,
    /// Factor of the element size.
    pub mesh: f64,
    /// The reason, for people.
    pub why: String,
}

/// The share of a frame's time that the simulation may take: the rest is for the picture, and for frames that cost more
/// than the usual one.
const SHARE: f64 = 0.65;

/// What the accuracy "draft" costs of "standard": half the substeps mostly, where there are several.
const DRAFT: f64 = 0.7;

/// Finer meshes are taken where they leave this much room besides.
const ROOM: f64 = 2.0;

/// From the finest to the coarsest: accuracy, factor of the element size.
const CANDIDATES: [(&str, f64); 7] = [
    ("standard", 0.8),
    ("standard", 1.0),
    ("draft", 1.0),
    ("draft", 1.25),
    ("draft", 1.6),
    ("draft", 2.0),
    ("draft", 2.5),
];

/// The finest that keeps the frame rate; a graphics processor where the CPU would need a coarser mesh. Costs are in proportion to the number of tetrahedra.
pub fn choose(measured: &Measured) -> Choice {
    let budget = SHARE * measured.budget_ms;
    let cost = |(accuracy, mesh): (&str, f64)| {
        let of_accuracy = if accuracy == "draft" { DRAFT } else { 1.0 };
        measured.cpu_ms * of_accuracy / (mesh * mesh * mesh)
    };
    let fits = |candidate: &(&'static str, f64)| {
        let room = if candidate.1 < 1.0 { ROOM } else { 1.0 };
        cost(*candidate) * room <= budget
    };
    let allowed = |(_, mesh): &(&str, f64)| measured.can_change_mesh || *mesh == 1.0;
    let mut candidates = CANDIDATES.into_iter().filter(allowed);
    let coarsest = candidates.clone().next_back().unwrap_or(("draft", 1.0));
    let (accuracy, mesh) = candidates.find(fits).unwrap_or(coarsest);
    let expected = cost((accuracy, mesh));
    let gpu = measured.gpu_ms.filter(|ms| ms.is_finite() && *ms > 0.0);
    if let Some(ms) = gpu.filter(|ms| *ms <= budget && (mesh > 1.0 || expected > budget)) {
        return Choice {
            device: "gpu",
            accuracy: "standard",
            mesh: 1.0,
            why: format!(
                "a frame takes {ms:.1} ms on the graphics processor and {:.1} ms on the CPU",
                measured.cpu_ms
            ),
        };
    }
    let rate =
        if expected <= budget { "which keeps the frame rate" } else { "the coarsest there is" };
    Choice {
        device: "cpu",
        accuracy,
        mesh,
        why: format!(
            "a frame of the usual mesh takes {:.1} ms on the CPU; with this one about {expected:.1} ms, {rate}",
            measured.cpu_ms
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(
        cpu_ms: f64,
        gpu_ms: Option<f64>,
        can_change_mesh: bool,
    ) -> (&'static str, &'static str, f64) {
        let choice = choose(&Measured { cpu_ms, gpu_ms, budget_ms: 16.7, can_change_mesh });
        (choice.device, choice.accuracy, choice.mesh)
    }

    #[test]
    fn the_finest_that_keeps_the_frame_rate_is_chosen() {
        assert_eq!(chosen(2.0, None, true), ("cpu", "standard", 0.8));
        assert_eq!(chosen(2.0, None, false), ("cpu", "standard", 1.0));
        assert_eq!(chosen(10.0, None, true), ("cpu", "standard", 1.0));
        assert_eq!(chosen(15.0, None, true), ("cpu", "draft", 1.0));
        assert_eq!(chosen(25.0, None, true), ("cpu", "draft", 1.25));
        assert_eq!(chosen(25.0, None, false), ("cpu", "draft", 1.0));
        assert_eq!(chosen(1e4, None, true), ("cpu", "draft", 2.5));
    }

    #[test]
    fn a_graphics_processor_is_chosen_where_it_spares_a_coarser_mesh() {
        assert_eq!(chosen(25.0, Some(4.0), true), ("gpu", "standard", 1.0));
        assert_eq!(chosen(25.0, Some(4.0), false), ("gpu", "standard", 1.0));
        assert_eq!(chosen(10.0, Some(1.0), true), ("cpu", "standard", 1.0));
        assert_eq!(chosen(25.0, Some(30.0), true), ("cpu", "draft", 1.25));
        assert_eq!(chosen(25.0, Some(f64::NAN), true), ("cpu", "draft", 1.25));
    }
}
