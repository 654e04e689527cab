//! Pictures of deformed tissue, drawn in software: no GPU, no display, the same bytes on every
//! machine.
//!
//! Describe what is there in a [`Drawing`], frame it once with a [`Camera`] (over all frames of an
//! animation), then [`Drawing::draw`] each frame into an [`Image`]. [`write_png`] makes a file of
//! it; an [`Animation`] takes frames one by one and makes a GIF. A [`Subject`] does all that for a running simulation.
//!
//! ```
//! use viscera::mesh::SurfaceMesh;
//! use viscera::scalar::vec3;
//! use viscera_picture::{Bounds, Camera, Drawing, ImageSize, Surface, ViewDirection, write_png};
//!
//! let vertices =
//!     vec![vec3(0.0, 0.0, 0.0), vec3(0.1, 0.0, 0.0), vec3(0.0, 0.1, 0.0), vec3(0.0, 0.0, 0.1)];
//! let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
//! let mesh = SurfaceMesh { vertices, triangles };
//!
//! let size = ImageSize::new(320, 240)?;
//! let camera = Camera::framing(&Bounds::of(&mesh.vertices), ViewDirection::default(), size);
//! let drawing = Drawing {
//!     title: "Tetrahedron",
//!     surfaces: vec![Surface::of(&mesh)],
//!     length_scale: true,
//!     ..Drawing::default()
//! };
//! let png = write_png(&drawing.draw(&camera)?.image)?;
//! assert!(png.starts_with(b"\x89PNG"));
//! # Ok::<(), viscera_picture::PictureError>(())
//! ```

mod animation;
mod camera;
mod color;
mod drawing;
mod error;
mod facets;
mod image;
mod lines;
mod marks;
mod normals;
mod organs;
mod overlay;
mod raster;
mod shade;
mod shots;

pub use animation::Animation;
pub use camera::{Bounds, Camera, HALF_OPENING, STEEPEST, ViewDirection};
pub use color::{Color, map_color};
pub use drawing::{Drawing, Drawn, Line, Outline, Surface, TracedOutline};
pub use error::PictureError;
pub use facets::Facets;
pub use image::{Image, ImageSize, write_png};
pub use marks::{Arrow, Background, Markers, Paint};
pub use organs::{BodyColor, body_color};
pub use overlay::{ColorScale, Overlay};
pub use shots::{Look, Medium, Seen, Shot, Subject};
