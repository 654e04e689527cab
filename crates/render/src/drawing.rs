//! What a picture shows, as plain data; tissue and its values are on the device.

use viscera::scalar::{Vec3, vec3};
use viscera::solver::gpu::GpuSurface;
use viscera_picture::{Arrow, Background, Color, Markers, Paint};

use crate::orbit::Orbit;
use crate::tools::ToolView;
use crate::values::ValueBuffer;

/// Everything in one picture whose surfaces are on the device.
#[derive(Clone, Debug)]
pub struct GpuDrawing<'a> {
    /// Where the viewer is.
    pub orbit: Orbit,
    /// Tissue. See-through bodies lie over all others, in this order.
    pub bodies: Vec<BodyView<'a>>,
    /// Parts of tools.
    pub tools: Vec<ToolView<'a>>,
    /// Fixings, picked points.
    pub markers: Vec<Markers<'a>>,
    /// Pulls, paler where tissue hides them.
    pub arrows: Vec<Arrow>,
    /// What lies behind.
    pub background: Background,
    /// Encloses the bodies that throw shadows on themselves and each other; without it, no shadow.
    pub shadow: Option<BoundingSphere>,
}

impl GpuDrawing<'_> {
    /// The background, seen from somewhere.
    pub fn from(orbit: Orbit) -> Self {
        Self {
            orbit,
            bodies: Vec::new(),
            tools: Vec::new(),
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
    /// Which of its triangles are drawn: from the first on, before the second. Edges are those of all.
    pub triangles: [u32; 2],
    /// Its colours.
    pub paint: Paint<ScaledValues<'a>>,
    /// Whether the edges of its triangles are drawn.
    pub wireframe: bool,
    /// 1 is solid; below, a ghost of which only the nearest layer is seen, and which throws no shadow.
    pub opacity: f32,
}

impl<'a> BodyView<'a> {
    /// Solid, in the colour of tissue.
    pub fn of(surface: &'a GpuSurface) -> Self {
        let triangles = [0, surface.index_count() / 3];
        let paint = Paint::Flat(Color::TISSUE);
        Self { surface, triangles, paint, wireframe: false, opacity: 1.0 }
    }
}

/// Values of a surface's vertices on the device, and the ends of the scale that colours them.
#[derive(Clone, Copy, Debug)]
pub struct ScaledValues<'a> {
    /// One for each vertex of the surface.
    pub buffer: &'a ValueBuffer,
    /// The value of the first colour.
    pub low: f32,
    /// The value of the last colour.
    pub high: f32,
}

/// A sphere around things.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundingSphere {
    /// Its centre [m].
    pub center: Vec3<f64>,
    /// Its radius [m].
    pub radius: f64,
}

impl BoundingSphere {
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
