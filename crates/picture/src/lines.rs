//! Thin lines over the shaded picture: contours of the rest shape, and single lines.
//!
//! The contour of a shape is the border of the area it covers. With `m` the covered part of a
//! pixel, smoothed over its neighbours, `4 m (1 - m)` is one exactly on the border and zero a
//! little away from it on both sides: a smooth line of even width, however the triangles lie.

use std::ops::Range;

use viscera::scalar::Vec3;

use crate::camera::{Camera, Projected, unit};
use crate::image::Image;
use crate::raster::{NOTHING, SAMPLES, Visibility};

/// Relative depth within which two things count as equally near: lines on a surface would
/// otherwise flicker in and out of it.
const SAME_DEPTH: f32 = 4e-3;

/// Inverse depth of the nearest shape at each pixel.
pub(crate) struct DepthMap {
    pub width: usize,
    pub height: usize,
    pub values: Vec<f32>,
}

impl DepthMap {
    pub fn of(seen: &Visibility) -> Self {
        Self {
            width: seen.width / SAMPLES,
            height: seen.height / SAMPLES,
            values: seen.nearest_per_pixel(),
        }
    }

    /// True where something stands clearly before a place at that inverse depth.
    pub fn hides(&self, x: usize, y: usize, inverse_depth: f32) -> bool {
        self.values[y * self.width + x] > inverse_depth * (1.0 + SAME_DEPTH)
    }
}

/// A pixel on the border of the area that a shape covers.
pub(crate) struct ContourPixel {
    /// Column and row.
    at: [u32; 2],
    /// Strength of the line, 0 to 1.
    line: f32,
    /// Inverse depth of the shape.
    inverse_depth: f32,
}

/// The border of the area that a shape covers; `depth` is that of the shape itself.
pub(crate) fn contour_of(shape: &Visibility, depth: &DepthMap) -> Vec<ContourPixel> {
    let DepthMap { width, height, .. } = *depth;
    let smooth = smoothed_coverage(shape, 1 + height / 1000);
    let mut contour = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let m = smooth[y * width + x];
            let line = (4.0 * m * (1.0 - m)).clamp(0.0, 1.0);
            if line < 0.02 {
                continue;
            }
            // Half of the line lies outside the shape: its depth is a neighbour's.
            let mut inverse_depth = 0.0f32;
            for j in y.saturating_sub(2)..(y + 3).min(height) {
                for i in x.saturating_sub(2)..(x + 3).min(width) {
                    inverse_depth = inverse_depth.max(depth.values[j * width + i]);
                }
            }
            contour.push(ContourPixel { at: [x as u32, y as u32], line, inverse_depth });
        }
    }
    contour
}

/// How much of each pixel a drawing of lines covers.
pub(crate) struct LineMask {
    width: usize,
    height: usize,
    /// 0 to 1, shape [height * width].
    coverage: Vec<f32>,
    /// The pixels from the first to the last that is covered.
    touched: Range<usize>,
}

impl LineMask {
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, coverage: vec![0.0; width * height], touched: 0..0 }
    }

    /// Adds a line with round ends, `line_width` [pixels]. Where the line runs at a pixel, with its
    /// inverse depth there, `opacity` says how strong it is.
    pub fn add_segment(
        &mut self,
        [a, b]: [Projected; 2],
        line_width: f64,
        opacity: impl Fn(usize, usize, f32) -> f32,
    ) {
        let reach = 0.5 * line_width + 1.0;
        let (dx, dy) = (b.x - a.x, b.y - a.y);
        let squared = dx * dx + dy * dy;
        // Float-to-integer casts saturate, so far outside is simply an empty range.
        let range = |u: f64, v: f64, count: usize| {
            let last = count as f64;
            let low = (u.min(v) - reach).clamp(0.0, last) as usize;
            low..(u.max(v) + reach).ceil().clamp(0.0, last) as usize
        };
        for y in range(a.y, b.y, self.height) {
            for x in range(a.x, b.x, self.width) {
                let (px, py) = (x as f64 + 0.5 - a.x, y as f64 + 0.5 - a.y);
                let t = if squared > 0.0 {
                    ((px * dx + py * dy) / squared).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                let (ex, ey) = (px - t * dx, py - t * dy);
                let distance = (ex * ex + ey * ey).sqrt();
                let covered = (0.5 * line_width + 0.5 - distance).clamp(0.0, 1.0) as f32;
                if covered > 0.0 {
                    let depth = a.inverse_depth + t * (b.inverse_depth - a.inverse_depth);
                    self.raise(y * self.width + x, covered * opacity(x, y, depth as f32));
                }
            }
        }
    }

    /// Adds the border of the area that a shape covers. Fainter where `tissue` is before it.
    pub fn add_contour(&mut self, contour: &[ContourPixel], tissue: &DepthMap, hidden: f32) {
        for pixel in contour {
            let [x, y] = pixel.at.map(|place| place as usize);
            let opacity = if tissue.hides(x, y, pixel.inverse_depth) { hidden } else { 1.0 };
            self.raise(y * self.width + x, pixel.line * opacity);
        }
    }

    fn raise(&mut self, pixel: usize, coverage: f32) {
        self.coverage[pixel] = self.coverage[pixel].max(coverage);
        self.touched = if self.touched.is_empty() {
            pixel..pixel + 1
        } else {
            self.touched.start.min(pixel)..self.touched.end.max(pixel + 1)
        };
    }

    /// Lays the lines over a picture of the same size.
    pub fn paint(&self, image: &mut Image, srgb: [u8; 3], opacity: f32) {
        for pixel in self.touched.clone() {
            let coverage = self.coverage[pixel];
            if coverage > 0.0 {
                let (x, y) = (pixel % self.width, pixel / self.width);
                image.blend(x as i32, y as i32, srgb, coverage * opacity);
            }
        }
    }
}

/// The covered part of each pixel, smoothed `passes` times with the weights 1/4, 1/2, 1/4.
fn smoothed_coverage(shape: &Visibility, passes: usize) -> Vec<f32> {
    let (width, height) = (shape.width / SAMPLES, shape.height / SAMPLES);
    let mut values = Vec::with_capacity(width * height);
    for y in 0..height {
        for x in 0..width {
            let count =
                shape.samples_of(x, y).iter().filter(|&&s| shape.shape[s] != NOTHING).count();
            values.push(count as f32 / (SAMPLES * SAMPLES) as f32);
        }
    }
    let mut other = values.clone();
    for _ in 0..passes {
        for (i, value) in other.iter_mut().enumerate() {
            let x = i % width;
            let (left, right) =
                (values[i - usize::from(x > 0)], values[i + usize::from(x + 1 < width)]);
            *value = 0.5 * values[i] + 0.25 * (left + right);
        }
        for (i, value) in values.iter_mut().enumerate() {
            let up = other[if i >= width { i - width } else { i }];
            let down = other[if i + width < width * height { i + width } else { i }];
            *value = 0.5 * other[i] + 0.25 * (up + down);
        }
    }
    values
}

/// Cosine between neighbouring triangles from which an edge of the rest shape is drawn: 53 degrees.
const SHARP_COSINE: f64 = 0.6;

/// Edges that a contour alone would miss: open borders and sharp edges. Sorted, as pairs of vertex
/// indices. All indices must be in range.
pub(crate) fn feature_edges(positions: &[Vec3<f64>], triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let mut sides = Vec::with_capacity(3 * triangles.len());
    for (t, triangle) in triangles.iter().enumerate() {
        for c in 0..3 {
            let (a, b) = (triangle[c], triangle[(c + 1) % 3]);
            sides.push(([a.min(b), a.max(b)], t));
        }
    }
    sides.sort_unstable();
    let normal = |t: usize| {
        let x = triangles[t].map(|v| positions[v as usize]);
        unit((x[1] - x[0]).cross(x[2] - x[0]))
    };
    sides
        .chunk_by(|a, b| a.0 == b.0)
        .filter(|sides| match sides {
            [_] => true,
            [a, b] => normal(a.1).dot(normal(b.1)) < SHARP_COSINE,
            _ => false,
        })
        .map(|sides| sides[0].0)
        .collect()
}

/// Both ends of a line in the picture; none if one of them cannot be drawn.
pub(crate) fn project_line(
    camera: &Camera,
    from: Vec3<f64>,
    to: Vec3<f64>,
) -> Option<[Projected; 2]> {
    Some([camera.project(from)?, camera.project(to)?])
}
