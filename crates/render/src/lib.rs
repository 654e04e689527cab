//! # viscera-render
//!
//! Draws tissue with wgpu and no user interface: fine surfaces from the solver's own buffers, lit as
//! wet tissue is or coloured by values, without a copy to the host.
//!
//! | to | look at |
//! |---|---|
//! | say what a picture shows | [`GpuDrawing`], [`BodyView`], [`ToolView`]; [`Markers`], [`Arrow`], [`Paint`], [`Background`] are those of `viscera-picture` |
//! | look around | [`Orbit`] |
//! | draw it, for a window or without one | [`Canvas`] |
//! | choose between fine and fast | [`Quality`] |
//! | colour a surface by values | [`ValueBuffer`] |

mod buffers;
mod canvas;
mod drawing;
mod error;
mod orbit;
mod pipelines;
mod quality;
mod shadow;
mod solids;
mod target;
mod tools;
mod values;
mod view;

pub use canvas::Canvas;
pub use drawing::{BodyView, BoundingSphere, GpuDrawing, ScaledValues};
pub use error::RenderError;
pub use orbit::Orbit;
pub use quality::Quality;
pub use tools::{ToolMesh, ToolView};
pub use values::ValueBuffer;
pub use viscera_picture::{Arrow, Background, Markers, Paint};
