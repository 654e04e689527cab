//! # viscera-stage
//!
//! What the window and the page share, without a user interface: simulations that are held by hand, what lies under
//! a pointer, what a picture shows.
//!
//! | to | look at |
//! |---|---|
//! | step a simulation in either precision, hold it, change it | [`Run`], [`build`] |
//! | see what it looks like after a frame | [`RunSnapshot`], [`Coloring`] |
//! | find what lies under a pointer | [`Lens`], [`pick`], [`pick_tool`], [`meet_plane`] |
//! | lead instruments by hand | [`Instruments`], [`ToolAct`], [`tray`] |
//! | see tools and the forces that they meet | [`ToolSnapshot`], [`ForceScale`] |
//! | draw it | [`RunSurface`], [`PictureContents`], [`Legend`] |

mod color;
mod contents;
mod grip;
mod hand;
mod instruments;
mod legend;
mod lens;
mod pick;
mod run;
mod snapshot;
mod tools;

pub use color::surface_values;
pub use contents::{PictureContents, RunSurface};
pub use grip::FASTEST;
pub use hand::{HandId, ToolAct, tray};
pub use instruments::{Drag, InHand, Instruments, Nudge, Surroundings};
pub use legend::{Legend, millimetres, newton_millimetres, newtons, newtons_within};
pub use lens::{Area, Lens};
pub use pick::{Pick, meet_plane, pick, pick_near};
pub use run::{GripTarget, NextStep, Run, Settings, build};
pub use snapshot::{Coloring, HeldPatch, HoldId, Measures, RunSnapshot, ScenePatch, inverted};
pub use tools::{ForceScale, ToolSnapshot, arrow_end, force_arrows, pick_tool};
