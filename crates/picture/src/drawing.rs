//! What a picture shows, as plain data.

use viscera::contact::{Shape, Tool};
use viscera::mesh::SurfaceMesh;
use viscera::scalar::{Vec3, vec3};

use crate::camera::{Camera, Projected, is_drawable, unit};
use crate::color::Color;
use crate::error::PictureError;
use crate::facets::Facets;
use crate::image::{Image, ImageSize};
use crate::lines::{ContourPixel, DepthMap, LineMask, contour_of, feature_edges, project_line};
use crate::marks::{Arrow, Background, Markers, Paint};
use crate::normals::corner_normals;
use crate::overlay::{ColorScale, Overlay};
use crate::raster::{NOTHING, Visibility};
use crate::shade::{Ball, Face, FacePaint, Finish, Shapes, resolve};

/// A shaded triangle mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface<'a> {
    /// Positions [m], shape [vertex_count].
    pub positions: &'a [Vec3<f64>],
    /// Vertex indices, counter-clockwise seen from outside, shape [triangle_count].
    pub triangles: &'a [[u32; 3]],
    /// Its colour; values in the unit of the drawing's [`ColorScale`], shape [vertex_count].
    pub paint: Paint<&'a [f64]>,
}

impl<'a> Surface<'a> {
    /// A mesh in the colour of tissue.
    pub fn of(mesh: &'a SurfaceMesh) -> Self {
        let paint = Paint::Flat(Color::TISSUE);
        Self { positions: &mesh.vertices, triangles: &mesh.triangles, paint }
    }
}

/// A shape of which only contour, sharp edges and open borders are drawn: tissue at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outline<'a> {
    /// Positions [m], shape [vertex_count].
    pub positions: &'a [Vec3<f64>],
    /// Vertex indices, shape [triangle_count].
    pub triangles: &'a [[u32; 3]],
    /// Its colour, usually [`Color::REST`].
    pub color: Color,
}

/// An outline as one camera sees it: most of the work of drawing it, done once for all pictures by that camera.
pub struct TracedOutline {
    size: ImageSize,
    color: Color,
    depth: DepthMap,
    contour: Vec<ContourPixel>,
    /// Sharp edges and open borders.
    edges: Vec<[Projected; 2]>,
    /// Triangles that cannot be drawn.
    skipped: usize,
}

/// A thin line, hidden where tissue is before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// One end [m].
    pub from: Vec3<f64>,
    /// The other end [m].
    pub to: Vec3<f64>,
    /// Width [pixels].
    pub width: f64,
    /// Its colour.
    pub color: Color,
}

/// Everything on one picture.
#[derive(Clone, Default)]
pub struct Drawing<'a> {
    /// Upper left, usually the scene's name.
    pub title: &'a str,
    /// Below the title, usually the time.
    pub caption: &'a str,
    /// Tissue.
    pub surfaces: Vec<Surface<'a>>,
    /// Tools and obstacles, in steel. Of a half-space a square patch is drawn, seen from outside only.
    pub tools: &'a [Tool],
    /// Shapes at rest.
    pub outlines: Vec<Outline<'a>>,
    /// The same, traced before. Those for pictures of another size are skipped.
    pub traced: Vec<&'a TracedOutline>,
    /// Vertices that are held or pulled.
    pub markers: Vec<Markers<'a>>,
    /// Pulls.
    pub arrows: Vec<Arrow>,
    /// Thin lines.
    pub lines: Vec<Line>,
    /// Colours of values, and the scale at the right edge.
    pub color_scale: Option<ColorScale>,
    /// Names and colours of bodies, at the right edge where there is no scale.
    pub legend: &'a [(String, Color)],
    /// Draws a bar of known length in the lower left corner; true in the middle of the scene.
    pub length_scale: bool,
    /// What lies behind.
    pub background: Background,
}

/// A finished picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// The picture.
    pub image: Image,
    /// Triangles, markers, arrows and lines that could not be drawn: not finite, or behind the
    /// camera. Zero when all is well.
    pub skipped: usize,
}

/// Strength of the rest shape's contour where tissue is before it.
const HIDDEN_CONTOUR: f32 = 0.45;
/// Strength of the rest shape's sharp edges, where no tissue is before them.
const FEATURE_EDGE: f32 = 0.4;
/// Strength of all lines of the rest shape.
const OUTLINE: f32 = 0.62;

impl Drawing<'_> {
    /// Draws the picture that a camera takes.
    pub fn draw(&self, camera: &Camera) -> Result<Drawn, PictureError> {
        self.check()?;
        let mut shapes = Shapes::default();
        let mut skipped = 0;
        for surface in &self.surfaces {
            skipped += self.add_surface(&mut shapes, camera, surface);
        }
        for tool in self.tools {
            skipped += add_tool(&mut shapes, camera, tool);
        }
        for arrow in &self.arrows {
            skipped += add_arrow(&mut shapes, camera, arrow);
        }
        for markers in &self.markers {
            skipped += add_markers(&mut shapes, camera, markers);
        }

        let mut seen = Visibility::new(camera.size());
        for (number, face) in (0..NOTHING).zip(&shapes.faces) {
            skipped += usize::from(!seen.draw_triangle(face.at, number));
        }
        let first_ball = shapes.faces.len() as u32;
        for (number, ball) in (first_ball..NOTHING).zip(&shapes.balls) {
            seen.draw_ball(ball.at, ball.radius, ball.relative_radius, number);
        }

        let mut image = Image::filled(camera.size(), [255; 3]);
        image.pixels_mut().copy_from_slice(&resolve(camera, &shapes, &seen, self.background));
        let tissue = DepthMap::of(&seen);
        for outline in &self.outlines {
            skipped += outline.traced(camera).draw(&mut image, &tissue);
        }
        for traced in &self.traced {
            skipped += traced.draw(&mut image, &tissue);
        }
        for line in &self.lines {
            skipped += draw_line(&mut image, camera, &tissue, line);
        }
        for markers in &self.markers {
            draw_hidden_markers(&mut image, camera, &tissue, markers);
        }
        let overlay = Overlay {
            title: self.title,
            caption: self.caption,
            color_scale: self.color_scale.as_ref(),
            legend: self.legend,
            pixels_per_meter: self.length_scale.then(|| camera.pixels_per_meter()),
        };
        overlay.draw(&mut image);
        Ok(Drawn { image, skipped })
    }

    fn check(&self) -> Result<(), PictureError> {
        for (index, surface) in self.surfaces.iter().enumerate() {
            let vertex_count = surface.positions.len();
            check_indices("surface", index, surface.triangles, vertex_count)?;
            if let Paint::Values(values) = surface.paint {
                let value_count = values.len();
                if value_count != vertex_count {
                    return Err(PictureError::ValueCount { index, vertex_count, value_count });
                }
                if self.color_scale.is_none() {
                    return Err(PictureError::NoColorScale { index });
                }
            }
        }
        let mut outlines = self.outlines.iter().enumerate();
        outlines.try_for_each(|(index, outline)| outline.check(index))
    }

    /// Adds a surface's triangles; the number of those that cannot be drawn.
    fn add_surface(&self, shapes: &mut Shapes, camera: &Camera, surface: &Surface) -> usize {
        let projected: Vec<_> = surface.positions.iter().map(|&p| camera.project(p)).collect();
        let normals = corner_normals(surface.positions, surface.triangles);
        let mut skipped = 0;
        for (triangle, normals) in surface.triangles.iter().zip(normals) {
            let [Some(a), Some(b), Some(c)] = triangle.map(|v| projected[v as usize]) else {
                skipped += 1;
                continue;
            };
            let paint = match (surface.paint, &self.color_scale) {
                (Paint::Values(values), Some(scale)) => {
                    FacePaint::Values(triangle.map(|v| scale.place(values[v as usize])))
                }
                (Paint::Flat(color), _) => FacePaint::Flat(color),
                (Paint::Values(_), None) => FacePaint::Flat(Color::MISSING),
            };
            shapes.faces.push(Face { at: [a, b, c], normals, paint, finish: Finish::Wet });
        }
        skipped
    }
}

fn check_indices(
    part: &'static str,
    index: usize,
    triangles: &[[u32; 3]],
    vertex_count: usize,
) -> Result<(), PictureError> {
    for (triangle, corners) in triangles.iter().enumerate() {
        if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= vertex_count) {
            return Err(PictureError::IndexOutOfRange {
                part,
                index,
                triangle,
                vertex,
                vertex_count,
            });
        }
    }
    Ok(())
}

/// Parts of tools that are nearer to the camera than this share of the framing distance are left out.
const NEAREST: f64 = 0.02;

/// Adds a tool's triangles; one where it cannot be drawn. What is behind the camera is left out.
fn add_tool(shapes: &mut Shapes, camera: &Camera, tool: &Tool) -> usize {
    let facets = match &tool.shape {
        // From below it would hide everything.
        Shape::HalfSpace if tool.distance(camera.position()).value <= 0.0 => return 0,
        Shape::HalfSpace => Facets::patch(&tool.pose, camera.target(), camera.radius()),
        shape => Facets::of(shape).placed(&tool.pose),
    };
    if !facets.positions.iter().all(|&p| is_drawable(p)) {
        return 1;
    }
    let is_seen = |at: &Projected| at.inverse_depth < 1.0 / NEAREST;
    let project = |&p: &Vec3<f64>| camera.project(p).filter(is_seen);
    let projected: Vec<_> = facets.positions.iter().map(project).collect();
    let paint = FacePaint::Flat(Color::STEEL);
    for triangle in &facets.triangles {
        if let [Some(a), Some(b), Some(c)] = triangle.map(|v| projected[v as usize]) {
            let normals = triangle.map(|v| facets.normals[v as usize]);
            shapes.faces.push(Face { at: [a, b, c], normals, paint, finish: Finish::Steel });
        }
    }
    0
}

/// Sides of an arrow's shaft: smooth at the size arrows are drawn.
const ARROW_SIDES: u32 = 24;

/// Shaft and head as a surface of revolution; the number of parts that cannot be drawn.
fn add_arrow(shapes: &mut Shapes, camera: &Camera, arrow: &Arrow) -> usize {
    let axis = arrow.to - arrow.from;
    let length = axis.length();
    let drawable = is_drawable(arrow.from) && is_drawable(arrow.to);
    if !(drawable && length > 0.0 && arrow.radius > 0.0 && arrow.radius < length * 1e3) {
        return 1;
    }
    let along = axis * (1.0 / length);
    // Any direction that is not parallel to the axis.
    let other = if along.z.abs() < 0.9 { vec3(0.0, 0.0, 1.0) } else { vec3(1.0, 0.0, 0.0) };
    let side = unit(other.cross(along));
    let across = along.cross(side);
    let head = (5.0 * arrow.radius).min(0.6 * length);
    let wide = 2.3 * arrow.radius;
    let profile = [
        (0.0, 0.0),
        (0.0, arrow.radius),
        (length - head, arrow.radius),
        (length - head, wide),
        (length, 0.0),
    ];
    let mut positions = Vec::new();
    for (height, radius) in profile {
        for k in 0..ARROW_SIDES {
            let angle = f64::from(k) / f64::from(ARROW_SIDES) * std::f64::consts::TAU;
            let (sin, cos) = libm::sincos(angle);
            positions.push(arrow.from + along * height + (side * cos + across * sin) * radius);
        }
    }
    let mut triangles = Vec::new();
    for ring in 0..profile.len() as u32 - 1 {
        for k in 0..ARROW_SIDES {
            let (a, b) = (ring * ARROW_SIDES + k, ring * ARROW_SIDES + (k + 1) % ARROW_SIDES);
            triangles.push([a, b, b + ARROW_SIDES]);
            triangles.push([a, b + ARROW_SIDES, a + ARROW_SIDES]);
        }
    }
    let projected: Vec<_> = positions.iter().map(|&p| camera.project(p)).collect();
    let normals = corner_normals(&positions, &triangles);
    let mut skipped = 0;
    for (triangle, normals) in triangles.iter().zip(normals) {
        if let [Some(a), Some(b), Some(c)] = triangle.map(|v| projected[v as usize]) {
            let paint = FacePaint::Flat(arrow.color);
            shapes.faces.push(Face { at: [a, b, c], normals, paint, finish: Finish::Matte });
        } else {
            skipped = 1;
        }
    }
    skipped
}

/// Adds spheres; the number of those that cannot be drawn.
fn add_markers(shapes: &mut Shapes, camera: &Camera, markers: &Markers) -> usize {
    let mut skipped = 0;
    for &position in markers.positions {
        let Some((at, radius)) = project_ball(camera, position, markers.radius) else {
            skipped += 1;
            continue;
        };
        let relative_radius = markers.radius / camera.distance();
        shapes.balls.push(Ball { at, radius, relative_radius, color: markers.color });
    }
    skipped
}

/// Centre and radius [pixels] of a sphere; none if it cannot be drawn or would fill the picture.
fn project_ball(camera: &Camera, center: Vec3<f64>, radius: f64) -> Option<(Projected, f64)> {
    let at = camera.project(center)?;
    let pixels = radius * camera.pixels_per_meter() * at.inverse_depth;
    let largest = f64::from(camera.size().width().max(camera.size().height()));
    (pixels > 0.0 && pixels < largest).then_some((at, pixels))
}

impl Outline<'_> {
    /// As this camera sees it, for [`Drawing::traced`].
    pub fn trace(&self, camera: &Camera) -> Result<TracedOutline, PictureError> {
        self.check(0)?;
        Ok(self.traced(camera))
    }

    fn check(&self, index: usize) -> Result<(), PictureError> {
        check_indices("outline", index, self.triangles, self.positions.len())
    }

    fn traced(&self, camera: &Camera) -> TracedOutline {
        let projected: Vec<_> = self.positions.iter().map(|&p| camera.project(p)).collect();
        let mut seen = Visibility::new(camera.size());
        let mut skipped = 0;
        for triangle in self.triangles {
            let drawn = match triangle.map(|v| projected[v as usize]) {
                [Some(a), Some(b), Some(c)] => seen.draw_triangle([a, b, c], 0),
                _ => false,
            };
            skipped += usize::from(!drawn);
        }
        let depth = DepthMap::of(&seen);
        let ends = |edge: [u32; 2]| match edge.map(|v| projected[v as usize]) {
            [Some(a), Some(b)] => Some([a, b]),
            _ => None,
        };
        let edges = feature_edges(self.positions, self.triangles).into_iter().filter_map(ends);
        TracedOutline {
            size: camera.size(),
            color: self.color,
            contour: contour_of(&seen, &depth),
            edges: edges.collect(),
            depth,
            skipped,
        }
    }
}

impl TracedOutline {
    /// Draws contour and sharp edges; the number of triangles that cannot be drawn.
    fn draw(&self, image: &mut Image, tissue: &DepthMap) -> usize {
        if self.size != image.size() {
            return 1;
        }
        let mut mask = LineMask::new(tissue.width, tissue.height);
        mask.add_contour(&self.contour, tissue, HIDDEN_CONTOUR);
        let width = f64::from(self.size.height()) / 600.0;
        for &edge in &self.edges {
            mask.add_segment(edge, width.clamp(0.8, 3.0), |x, y, depth| {
                let hidden = self.depth.hides(x, y, depth) || tissue.hides(x, y, depth);
                if hidden { 0.0 } else { FEATURE_EDGE }
            });
        }
        mask.paint(image, self.color.to_srgb(), OUTLINE);
        self.skipped
    }
}

/// Draws a line; one if it cannot be drawn.
fn draw_line(image: &mut Image, camera: &Camera, tissue: &DepthMap, line: &Line) -> usize {
    let Some(ends) = project_line(camera, line.from, line.to) else { return 1 };
    let mut mask = LineMask::new(tissue.width, tissue.height);
    mask.add_segment(ends, line.width.clamp(0.0, 100.0), |x, y, depth| {
        if tissue.hides(x, y, depth) { 0.0 } else { 1.0 }
    });
    mask.paint(image, line.color.to_srgb(), 1.0);
    0
}

/// Lets markers behind tissue shine through, as soft discs.
fn draw_hidden_markers(image: &mut Image, camera: &Camera, tissue: &DepthMap, markers: &Markers) {
    if markers.see_through.is_nan() || markers.see_through <= 0.0 {
        return;
    }
    // Through one mask, so that markers that overlap do not add up to a dark blot.
    let mut mask = LineMask::new(tissue.width, tissue.height);
    for &position in markers.positions {
        let Some((mut at, radius)) = project_ball(camera, position, markers.radius) else {
            continue;
        };
        let nearest = 1.0 / at.inverse_depth - markers.radius / camera.distance();
        at.inverse_depth = 1.0 / nearest.max(1e-6);
        mask.add_segment(
            [at, at],
            2.0 * radius,
            |x, y, depth| {
                if tissue.hides(x, y, depth) { 1.0 } else { 0.0 }
            },
        );
    }
    mask.paint(image, markers.color.to_srgb(), markers.see_through.min(1.0));
}
