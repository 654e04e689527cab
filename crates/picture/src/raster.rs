//! Which shape is seen where: a z-buffer over samples finer than pixels.
//!
//! Corners are snapped to 1/256 of a sample and edges tested in integers, so two triangles that
//! share an edge leave no gap and claim no sample twice. Inverse depth is linear across the
//! picture, so it is what the buffer interpolates and compares:
//!
//! ```text
//! E_i(p) = (x_k - x_j)(p.y - y_j) - (y_k - y_j)(p.x - x_j)      i, j, k cyclic; inside: all >= 0
//! 1/z(p) = sum_i E_i(p) / z_i / sum_i E_i(p)
//! ```

use crate::camera::Projected;
use crate::image::ImageSize;

/// Samples along each side of a pixel.
pub(crate) const SAMPLES: usize = 2;

/// In place of a shape's number where there is only background.
pub(crate) const NOTHING: u32 = u32::MAX;

/// Positions within a sample that a corner can take, along each axis.
const STEPS: f64 = 256.0;

/// Corners farther outside [samples] would overflow the integers; such triangles are not drawn.
const FARTHEST: f64 = 1e6;

/// The nearest shape at each sample.
pub(crate) struct Visibility {
    /// Samples in a row.
    pub width: usize,
    /// Rows of samples.
    pub height: usize,
    /// Zero where there is nothing, shape [height * width].
    pub inverse_depth: Vec<f32>,
    /// The shape's number, shape [height * width].
    pub shape: Vec<u32>,
}

impl Visibility {
    /// Nothing anywhere.
    pub fn new(size: ImageSize) -> Self {
        let (width, height) = (size.width() as usize * SAMPLES, size.height() as usize * SAMPLES);
        let count = width * height;
        Self { width, height, inverse_depth: vec![0.0; count], shape: vec![NOTHING; count] }
    }

    /// Draws a triangle, seen from either side. False if it lies too far outside to be drawn.
    pub fn draw_triangle(&mut self, mut at: [Projected; 3], shape: u32) -> bool {
        let scale = SAMPLES as f64;
        if at.iter().any(|p| p.x.abs().max(p.y.abs()) * scale > FARTHEST) {
            return false;
        }
        let snap = |v: f64| (v * scale * STEPS).round() as i64;
        let mut x = at.map(|p| snap(p.x));
        let mut y = at.map(|p| snap(p.y));
        let mut area = (x[1] - x[0]) * (y[2] - y[0]) - (y[1] - y[0]) * (x[2] - x[0]);
        if area < 0 {
            x.swap(1, 2);
            y.swap(1, 2);
            at.swap(1, 2);
            area = -area;
        }
        if area == 0 {
            return true;
        }
        let columns = covered(x, self.width);
        let rows = covered(y, self.height);
        let step = STEPS as i64;
        let (x0, y0) =
            (columns.start as i64 * step + step / 2, rows.start as i64 * step + step / 2);
        let (mut edge, mut dx, mut dy) = ([0; 3], [0; 3], [0; 3]);
        let (mut depth, mut depth_dx, mut depth_dy) = (0.0, 0.0, 0.0);
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let (along_x, along_y) = (x[k] - x[j], y[k] - y[j]);
            let value = along_x * (y0 - y[j]) - along_y * (x0 - x[j]);
            let weight = at[i].inverse_depth / area as f64;
            depth += value as f64 * weight;
            depth_dx -= (along_y * step) as f64 * weight;
            depth_dy += (along_x * step) as f64 * weight;
            // A sample exactly on an edge belongs to one side: the neighbour's edge is reversed.
            let owns_edge = along_y > 0 || (along_y == 0 && along_x > 0);
            edge[i] = value - i64::from(!owns_edge);
            dx[i] = -along_y * step;
            dy[i] = along_x * step;
        }
        for row in rows {
            let mut here = edge;
            let mut depth_here = depth;
            let samples = row * self.width + columns.start..row * self.width + columns.end;
            let depths = self.inverse_depth[samples.clone()].iter_mut();
            let mut was_inside = false;
            for (depth, seen) in depths.zip(&mut self.shape[samples]) {
                // The sign bit of the union is clear only if all three are inside.
                if (here[0] | here[1] | here[2]) >= 0 {
                    was_inside = true;
                    if depth_here as f32 > *depth {
                        *depth = depth_here as f32;
                        *seen = shape;
                    }
                } else if was_inside {
                    // A row meets a triangle once.
                    break;
                }
                for i in 0..3 {
                    here[i] += dx[i];
                }
                depth_here += depth_dx;
            }
            for i in 0..3 {
                edge[i] += dy[i];
            }
            depth += depth_dy;
        }
        true
    }

    /// Draws a sphere, small enough that its outline is a circle. `radius` [pixels] and
    /// `relative_radius`, its radius over the framing distance.
    pub fn draw_ball(&mut self, at: Projected, radius: f64, relative_radius: f64, shape: u32) {
        let scale = SAMPLES as f64;
        let (cx, cy, r) = (at.x * scale, at.y * scale, radius * scale);
        let range = |center: f64, count: usize| {
            let last = count as f64;
            (center - r).clamp(0.0, last) as usize..((center + r).ceil().clamp(0.0, last)) as usize
        };
        for row in range(cy, self.height) {
            for column in range(cx, self.width) {
                let (dx, dy) = (column as f64 + 0.5 - cx, row as f64 + 0.5 - cy);
                let height = 1.0 - (dx * dx + dy * dy) / (r * r);
                if height > 0.0 {
                    let depth = 1.0 / at.inverse_depth - relative_radius * height.sqrt();
                    self.put(row * self.width + column, (1.0 / depth) as f32, shape);
                }
            }
        }
    }

    fn put(&mut self, sample: usize, inverse_depth: f32, shape: u32) {
        if inverse_depth > self.inverse_depth[sample] {
            self.inverse_depth[sample] = inverse_depth;
            self.shape[sample] = shape;
        }
    }

    /// The samples of a pixel.
    pub fn samples_of(&self, x: usize, y: usize) -> [usize; SAMPLES * SAMPLES] {
        let first = y * SAMPLES * self.width + x * SAMPLES;
        [first, first + 1, first + self.width, first + self.width + 1]
    }

    /// Inverse depth of the nearest sample of each pixel, shape [pixel_count].
    pub fn nearest_per_pixel(&self) -> Vec<f32> {
        let (width, height) = (self.width / SAMPLES, self.height / SAMPLES);
        let mut nearest = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let depths = self.samples_of(x, y).map(|s| self.inverse_depth[s]);
                nearest.push(depths.into_iter().fold(0.0, f32::max));
            }
        }
        nearest
    }
}

/// The samples between the smallest and the largest of three snapped coordinates.
fn covered(corners: [i64; 3], count: usize) -> std::ops::Range<usize> {
    let step = STEPS as i64;
    let low = corners[0].min(corners[1]).min(corners[2]);
    let high = corners[0].max(corners[1]).max(corners[2]);
    let index = |v: i64| v.div_euclid(step).clamp(0, count as i64) as usize;
    index(low)..index(high + step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_around_a_vertex_claim_every_sample_exactly_once() {
        let size = ImageSize::new(32, 32).unwrap();
        let corner = |x, y| Projected { x, y, inverse_depth: 1.0 };
        let hub = corner(13.37, 17.5);
        // Half-integers put sample centres exactly on edges.
        let ring = [
            corner(2.25, 2.25),
            corner(17.5, 1.25),
            corner(30.25, 2.25),
            corner(30.25, 30.25),
            corner(2.25, 30.25),
        ];
        let mut claims = vec![0; 64 * 64];
        for i in 0..ring.len() {
            let mut one = Visibility::new(size);
            one.draw_triangle([hub, ring[i], ring[(i + 1) % ring.len()]], 0);
            for (claim, &shape) in claims.iter_mut().zip(&one.shape) {
                *claim += u32::from(shape != NOTHING);
            }
        }
        assert!(claims.iter().all(|&c| c <= 1));
        let inside = claims[6 * 64..60 * 64].chunks(64).map(|row| &row[6..60]);
        assert!(inside.flatten().all(|&c| c == 1));
    }

    #[test]
    fn interpolated_depth_is_that_of_the_plane() {
        let size = ImageSize::new(16, 16).unwrap();
        let plane = |x: f64, y: f64| Projected { x, y, inverse_depth: 0.5 + 0.01 * x + 0.02 * y };
        let mut seen = Visibility::new(size);
        seen.draw_triangle([plane(-3.0, -5.0), plane(40.0, 0.0), plane(0.0, 40.0)], 7);
        for sample in (0..32 * 32).filter(|&s| seen.shape[s] == 7) {
            let (x, y) = ((sample % 32) as f64 * 0.5 + 0.25, (sample / 32) as f64 * 0.5 + 0.25);
            let error = f64::from(seen.inverse_depth[sample]) - plane(x, y).inverse_depth;
            // Snapping moves corners by at most 1/1024 pixel; the rest is f32.
            assert!(error.abs() < 0.03 / 1024.0 + 1e-6, "{error}");
        }
    }
}
