//! What a picture shows, as plain data.

use viscera::scalar::{Vec3, vec3};
use viscera::solver::gpu::GpuSurface;
use viscera_picture::{Arrow, Color};

use crate::orbit::Orbit;
use crate::values::ValueBuffer;

/// Everything in one picture.
#[derive(Clone, Debug)]
pub struct Drawing<'a> {
    /// Where the viewer is.
    pub orbit: Orbit,
    /// Tissue. See-through bodies lie over all others, in this order.
    pub bodies: Vec<BodyView<'a>>,
    /// Little balls: fixings, picked points.
    pub markers: Vec<Markers>,
    /// Pulls, paler where tissue hides them.
    pub arrows: Vec<Arrow>,
    /// What lies behind.
    pub background: Background,
    /// The room in which bodies throw shadows on themselves and each other; without one, no shadow.
    pub shadow: Option<Room>,
}

impl Drawing<'_> {
    /// The background, seen from somewhere.
    pub fn from(orbit: Orbit) -> Self {
        Self {
            orbit,
            bodies: Vec::new(),
            markers: Vec::new(),
            arrows: Vec::new(),
            background: Background::default(),
            shadow: None,
        }
    }
}

/// Surfaces and how they are shown.
#[derive(Clone, Copy, Debug)]
pub struct BodyView<'a> {
    /// Where it is.
    pub surface: &'a GpuSurface,
    /// Its colours.
    pub paint: Paint<'a>,
    /// Whether the edges of its triangles are drawn.
    pub wireframe: bool,
    /// 1 is solid; below, a ghost of which only the nearest layer is seen, and which throws no shadow.
    pub opacity: f32,
}

impl<'a> BodyView<'a> {
    /// Solid, in the colour of tissue.
    pub fn of(surface: &'a GpuSurface) -> Self {
        Self { surface, paint: Paint::Plain(Color::TISSUE), wireframe: false, opacity: 1.0 }
    }
}

/// What a surface is coloured with.
#[derive(Clone, Copy, Debug)]
pub enum Paint<'a> {
    /// Wet tissue of one colour.
    Plain(Color),
    /// The colours of [`viscera_picture::map_color`] for values between two ends.
    Values {
        /// One for each vertex of the surface.
        buffer: &'a ValueBuffer,
        /// The value of the first colour.
        low: f32,
        /// The value of the last colour.
        high: f32,
    },
}

/// Little balls of one size and colour.
#[derive(Clone, Debug, PartialEq)]
pub struct Markers {
    /// Centres [m], shape [marker_count].
    pub positions: Vec<Vec3<f64>>,
    /// Radius [m].
    pub radius: f64,
    /// Colour, usually [`Color::FIXED`] or [`Color::PULLED`].
    pub color: Color,
}

/// What lies behind: from one colour above to another below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Background {
    /// At the upper edge.
    pub top: Color,
    /// At the lower edge.
    pub bottom: Color,
}

impl Default for Background {
    /// That of the software renderer.
    fn default() -> Self {
        let [top, bottom] = [[252, 252, 253], [232, 236, 241]].map(Color::from_srgb);
        Self { top, bottom }
    }
}

/// A ball of space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Room {
    /// Its middle [m].
    pub center: Vec3<f64>,
    /// Its radius [m].
    pub radius: f64,
}

impl Room {
    /// Around positions [m]; those that are not finite are left out. Nothing around nothing.
    pub fn around(positions: impl Iterator<Item = Vec3<f64>>) -> Option<Self> {
        let both = |x: Vec3<f64>| [x, x];
        let [low, high] = positions
            .filter(|x| x.is_finite())
            .map(both)
            .reduce(|[low, high], [x, y]| [Vec3::min(low, x), Vec3::max(high, y)])?;
        let radius = 0.5 * (high - low).length();
        (radius > 0.0).then_some(Self { center: (low + high) * 0.5, radius })
    }
}

/// Some direction of length 1 across another of length 1.
pub(crate) fn across(along: Vec3<f64>) -> Vec3<f64> {
    let other = if along.z.abs() < 0.9 { vec3(0.0, 0.0, 1.0) } else { vec3(1.0, 0.0, 0.0) };
    let side = other.cross(along);
    side * (1.0 / side.length())
}
