//! Which tissue each structure of a label map is made of: what turns a segmented scan into a scene in which
//! every organ has a material.
//!
//! [`CLASSES`] has the 117 classes of TotalSegmentator's task `total`, [`FURTHER`] what other tools label
//! besides. [`tissue_of`] finds either by the names that people give.
//!
//! ```
//! use viscera_volume::tissue::{Kind, tissue_of};
//!
//! let kidney = tissue_of("Left Kidney").expect("a known organ");
//! assert_eq!((kidney.class, kidney.kind), ("kidney_left", Kind::Soft("kidney_cortex")));
//! assert_eq!(kidney.preset().map(|preset| preset.young), Some(5e3));
//! assert!(tissue_of("spaceship").is_none());
//! ```
//!
//! | file | what |
//! |---|---|
//! | `classes` | the classes, their tissues and walls |
//! | `names` | a class by the names that people give |
//! | `describe` | both tables as a document, `docs/tissue.md` |

mod classes;
mod describe;
mod names;

pub use classes::{CLASSES, FURTHER};
pub use describe::describe_markdown;
pub use names::tissue_of;

use viscera::material::{Preset, preset};

/// Density of the mineral part of bone [kg/m^3]; PMC4201780, table 1. Whole bones have 1200 to 1600.
pub const BONE_DENSITY: f64 = 1920.0;

/// The tissue of a structure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClassTissue {
    /// TotalSegmentator's name of the class; for those of [`FURTHER`] one of the same style.
    pub class: &'static str,
    /// What it is made of.
    pub kind: Kind,
    /// What to know, or nothing. Begins with `assumed:` where the preset is that of another tissue, and
    /// says why that one.
    pub note: &'static str,
}

/// What a structure is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// Tissue all through, with the name of its preset.
    Soft(&'static str),
    /// A wall around contents that the label includes.
    Hollow {
        /// Name of the wall's preset.
        preset: &'static str,
        /// Typical thickness of the wall [m].
        wall: f64,
        /// Where the thickness comes from.
        source: &'static str,
    },
    /// A blood vessel: a wall around blood, which the label includes.
    Vessel {
        /// Name of the wall's preset.
        preset: &'static str,
        /// Typical thickness of the wall [m].
        wall: f64,
        /// Where the thickness comes from.
        source: &'static str,
    },
    /// Bone: a million times stiffer than an organ. An obstacle, or what tissue is fixed to, never tissue.
    Rigid,
    /// A gas: neither tissue nor obstacle.
    Air,
}

impl ClassTissue {
    /// The preset of the tissue or of the wall; `None` for bone and air.
    pub fn preset(&self) -> Option<&'static Preset> {
        match self.kind {
            Kind::Soft(name)
            | Kind::Hollow { preset: name, .. }
            | Kind::Vessel { preset: name, .. } => preset(name).ok(),
            Kind::Rigid | Kind::Air => None,
        }
    }

    /// Typical thickness of the wall [m]; `None` for what has none.
    pub fn wall(&self) -> Option<f64> {
        match self.kind {
            Kind::Hollow { wall, .. } | Kind::Vessel { wall, .. } => Some(wall),
            Kind::Soft(_) | Kind::Rigid | Kind::Air => None,
        }
    }

    /// Density of the tissue or of the wall [kg/m^3], without contents; `None` for air.
    pub fn density(&self) -> Option<f64> {
        match self.kind {
            Kind::Rigid => Some(BONE_DENSITY),
            _ => self.preset().map(|preset| preset.density),
        }
    }
}
