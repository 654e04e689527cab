//! # viscera-render
//!
//! Draws tissue with wgpu and no user interface: a fine surface from the solver's own buffers, lit as
//! wet tissue is, without a copy to the host.
//!
//! | to | look at |
//! |---|---|
//! | look around | [`Orbit`] |
//! | draw into a texture of one's own | [`Renderer`] |
//! | make a picture without a window | [`Offscreen`] |

mod offscreen;
mod orbit;
mod renderer;

pub use offscreen::{Offscreen, RenderError};
pub use orbit::Orbit;
pub use renderer::{DEPTH_FORMAT, Look, Renderer};
