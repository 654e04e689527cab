//! Light on wet tissue.
//!
//! Three lights that travel with the camera: a key from the upper left, a weak fill from the right,
//! and the sky above a darker ground. Diffuse light wraps around the terminator, more in red than
//! in blue, as it does where light scatters beneath a surface. Two highlights, one broad and one
//! tight, and a Fresnel term (C. Schlick, "An inexpensive BRDF model for physically-based
//! rendering", 1994) make the surface wet:
//!
//! ```text
//! F = F0 + (1 - F0)(1 - n.v)^5
//! ```
//!
//! Hollows are darkened by what stands above them within a short reach: ambient obscurance in the
//! picture (M. McGuire et al., "The Alchemy screen-space ambient obscurance algorithm", 2011).

use viscera::scalar::Vec3;

use crate::camera::{Camera, Projected, unit};
use crate::color::{Color, map_color};
use crate::marks::Background;
use crate::raster::{NOTHING, SAMPLES, Visibility};

/// How a shape takes light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Finish {
    /// Tissue: highlights and a bright rim.
    Wet,
    /// Markers and arrows: no highlight to be mistaken for tissue.
    Matte,
    /// Tools: brushed metal, in which sky and ground are mirrored.
    Steel,
}

/// What a shape is coloured with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum FacePaint {
    Flat(Color),
    /// Places on the colour map at the three corners, 0 to 1.
    Values([f32; 3]),
}

/// A triangle ready to be shaded.
pub(crate) struct Face {
    pub at: [Projected; 3],
    pub normals: [Vec3<f64>; 3],
    pub paint: FacePaint,
    pub finish: Finish,
}

/// A sphere ready to be shaded.
pub(crate) struct Ball {
    pub at: Projected,
    /// Radius in the picture [pixels].
    pub radius: f64,
    /// Radius over the framing distance.
    pub relative_radius: f64,
    pub color: Color,
}

/// Everything that numbers in a [`Visibility`] stand for: faces first, then balls.
#[derive(Default)]
pub(crate) struct Shapes {
    pub faces: Vec<Face>,
    pub balls: Vec<Ball>,
}

/// What is known about a visible point before light falls on it.
struct Fragment {
    normal: Vec3<f64>,
    albedo: Color,
    finish: Finish,
}

impl Shapes {
    /// The fragment of a shape at a place of the picture [pixels].
    fn fragment(&self, camera: &Camera, shape: u32, x: f64, y: f64) -> Fragment {
        let index = shape as usize;
        let Some(face) = self.faces.get(index) else {
            return self.ball_fragment(camera, index - self.faces.len(), x, y);
        };
        let at = &face.at;
        let edge = |i: usize| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            (at[k].x - at[j].x) * (y - at[j].y) - (at[k].y - at[j].y) * (x - at[j].x)
        };
        let edges = [edge(0), edge(1), edge(2)];
        // Counter-clockwise in a picture whose rows go down has negative area: seen from outside.
        let outside = edges[0] + edges[1] + edges[2] < 0.0;
        let mut weights = [0.0; 3];
        for i in 0..3 {
            weights[i] = edges[i] * at[i].inverse_depth;
        }
        let sum = weights[0] + weights[1] + weights[2];
        // A sliver's weights are round-off: its middle stands for all of it.
        weights = if sum == 0.0 { [1.0 / 3.0; 3] } else { weights.map(|w| w / sum) };
        let n = &face.normals;
        let normal = unit(n[0] * weights[0] + n[1] * weights[1] + n[2] * weights[2]);
        let albedo = match face.paint {
            FacePaint::Flat(color) => color,
            FacePaint::Values(v) => {
                let w = weights.map(|w| w as f32);
                map_color(v[0] * w[0] + v[1] * w[1] + v[2] * w[2])
            }
        };
        Fragment { normal: if outside { normal } else { -normal }, albedo, finish: face.finish }
    }

    fn ball_fragment(&self, camera: &Camera, index: usize, x: f64, y: f64) -> Fragment {
        let ball = &self.balls[index];
        let (dx, dy) = ((x - ball.at.x) / ball.radius, (ball.at.y - y) / ball.radius);
        let height = (1.0 - dx * dx - dy * dy).max(0.0).sqrt();
        let normal = unit(camera.world_direction([dx, dy, height]));
        Fragment { normal, albedo: ball.color, finish: Finish::Matte }
    }
}

/// The lights, in world axes.
struct Lights {
    key: Vec3<f64>,
    fill: Vec3<f64>,
    up: Vec3<f64>,
}

const KEY: Color = Color::new(0.70, 0.68, 0.65);
const FILL: Color = Color::new(0.10, 0.11, 0.12);
const SKY: Color = Color::new(0.36, 0.37, 0.39);
const GROUND: Color = Color::new(0.17, 0.155, 0.15);
/// How far past the terminator the key light reaches, per channel.
const WRAP: [f32; 3] = [0.32, 0.24, 0.20];

impl Lights {
    fn of(camera: &Camera) -> Self {
        Self {
            key: unit(camera.world_direction([-0.50, 0.62, 0.62])),
            fill: unit(camera.world_direction([0.85, 0.05, 0.50])),
            up: unit(camera.world_direction([0.0, 0.95, 0.30])),
        }
    }

    /// Light that a point sends to the viewer; `openness` 1 in the open, 0 in a closed hollow.
    fn shade(&self, fragment: &Fragment, to_viewer: Vec3<f64>, openness: f32) -> Color {
        let n = fragment.normal;
        let key = n.dot(self.key) as f32;
        let wrapped = WRAP.map(|w| ((key + w) / (1.0 + w)).max(0.0));
        let wrapped = Color::new(wrapped[0], wrapped[1], wrapped[2]);
        let sky = 0.5 + 0.5 * n.dot(self.up) as f32;
        let light = KEY
            .times(wrapped)
            .scaled(0.45 + 0.55 * openness)
            .plus(FILL.scaled((n.dot(self.fill) as f32).max(0.0)))
            .plus(GROUND.mix(SKY, sky).scaled(openness));
        let diffuse = fragment.albedo.times(light);
        if fragment.finish == Finish::Matte {
            return diffuse;
        }
        if fragment.finish == Finish::Steel {
            return self.steel(fragment, to_viewer, diffuse, openness);
        }
        let half = (n.dot(unit(self.key + to_viewer)) as f32).max(0.0);
        let broad = power_of_two(half, 4);
        let tight = power_of_two(half, 7);
        let grazing = 1.0 - (n.dot(to_viewer) as f32).clamp(0.0, 1.0);
        let fresnel = 0.03 + 0.97 * power_of_two(grazing, 2) * grazing;
        let lit = if key > 0.0 { 0.07 * broad + 0.42 * tight } else { 0.0 };
        let mirrored = (lit + 0.20 * fresnel * sky) * (0.3 + 0.7 * openness);
        // Towards white, never past it.
        diffuse.mix(Color::new(1.0, 0.99, 0.97), mirrored.min(1.0))
    }

    /// Light that metal sends to the viewer: in part as matte things do, in part a blurred mirror.
    fn steel(&self, fragment: &Fragment, to_viewer: Vec3<f64>, diffuse: Color, open: f32) -> Color {
        let n = fragment.normal;
        let mirrored = n * (2.0 * n.dot(to_viewer)) - to_viewer;
        let sky = 0.5 + 0.5 * mirrored.dot(self.up) as f32;
        let around = GROUND.mix(SKY, sky * sky).scaled(1.6 * open);
        let half = (n.dot(unit(self.key + to_viewer)) as f32).max(0.0);
        let lit =
            (0.30 * power_of_two(half, 4) + 0.22 * power_of_two(half, 7)) * (0.3 + 0.7 * open);
        let metal = diffuse.scaled(0.62).plus(fragment.albedo.times(around));
        metal.mix(Color::new(1.0, 1.0, 1.0), lit.min(1.0))
    }
}

/// `x` to the power of `2^doublings`.
fn power_of_two(x: f32, doublings: u32) -> f32 {
    (0..doublings).fold(x, |p, _| p * p)
}

/// The background of a row, in linear light: even steps in sRGB levels.
fn background_of_row(background: Background, y: usize, height: usize) -> Color {
    let t = y as f32 / height.max(1) as f32;
    let [top, bottom] = [background.top, background.bottom].map(|c| c.to_srgb().map(f32::from));
    let level = |c: usize| (top[c] + t * (bottom[c] - top[c]) + 0.5) as u8;
    Color::from_srgb([level(0), level(1), level(2)])
}

/// Shades what is visible and averages the samples of each pixel, shape [pixel_count].
///
/// Light is worked out once for each shape in a pixel, not for each sample: edges stay smooth and
/// most pixels hold one shape.
pub(crate) fn resolve(
    camera: &Camera,
    shapes: &Shapes,
    seen: &Visibility,
    background: Background,
) -> Vec<[u8; 3]> {
    let openness = Openness::of(camera, shapes, seen);
    let lights = Lights::of(camera);
    let (width, height) = (seen.width / SAMPLES, seen.height / SAMPLES);
    let mut pixels = Vec::with_capacity(width * height);
    for y in 0..height {
        let behind = background_of_row(background, y, height);
        let behind_srgb = behind.to_srgb();
        for x in 0..width {
            let samples = seen.samples_of(x, y);
            let ids = samples.map(|s| seen.shape[s]);
            if ids == [NOTHING; SAMPLES * SAMPLES] {
                pixels.push(behind_srgb);
                continue;
            }
            let mut sum = Color::default();
            for first in 0..ids.len() {
                if ids[..first].contains(&ids[first]) {
                    continue;
                }
                let (mut count, mut px, mut py, mut depth) = (0.0, 0.0, 0.0, 0.0);
                for k in (first..ids.len()).filter(|&k| ids[k] == ids[first]) {
                    count += 1.0;
                    px += (k % SAMPLES) as f64;
                    py += (k / SAMPLES) as f64;
                    depth += f64::from(seen.inverse_depth[samples[k]]);
                }
                let color = if ids[first] == NOTHING {
                    behind
                } else {
                    let place =
                        |p: usize, offset: f64| p as f64 + (offset / count + 0.5) / SAMPLES as f64;
                    let at = Projected {
                        x: place(x, px),
                        y: place(y, py),
                        inverse_depth: depth / count,
                    };
                    let fragment = shapes.fragment(camera, ids[first], at.x, at.y);
                    let to_viewer = unit(camera.position() - camera.unproject(at));
                    lights.shade(&fragment, to_viewer, openness.at(x, y))
                };
                sum = sum.plus(color.scaled(count as f32));
            }
            pixels.push(sum.scaled(1.0 / (SAMPLES * SAMPLES) as f32).to_srgb());
        }
    }
    pixels
}

/// How open each place is to the sky around it, at half the picture's resolution.
struct Openness {
    width: usize,
    height: usize,
    /// 0 to 1, negative on the background, shape [height * width].
    values: Vec<f32>,
}

/// Places looked at around each point, in a spiral.
const SPIRAL: usize = 12;
/// Patterns in a tile; averaged away over the same tile afterwards.
const TILE: usize = 4;

impl Openness {
    fn of(camera: &Camera, shapes: &Shapes, seen: &Visibility) -> Self {
        let block = 2 * SAMPLES;
        let (width, height) = (seen.width / block, seen.height / block);
        let sample_of = |x: usize, y: usize| y * block * seen.width + x * block;
        let point = |x: usize, y: usize| {
            let sample = sample_of(x, y);
            let (px, py) = ((x * 2) as f64 + 0.25, (y * 2) as f64 + 0.25);
            let depth = f64::from(seen.inverse_depth[sample]);
            (depth > 0.0)
                .then(|| camera.unproject(Projected { x: px, y: py, inverse_depth: depth }))
        };
        let points: Vec<_> = (0..width * height).map(|i| point(i % width, i / width)).collect();

        // Reach: a fifth of the scene's radius, where folds of organs lie.
        let reach = 0.2 * camera.radius();
        let reach_pixels = (0.5 * reach * camera.pixels_per_meter()).clamp(3.0, width as f64);
        let spirals: Vec<[[f64; 2]; SPIRAL]> = (0..TILE * TILE)
            .map(|tile| {
                // Each pattern is the previous one turned by a part of the circle; 7 is coprime to 16.
                let turn = (tile * 7 % (TILE * TILE)) as f64 / (TILE * TILE) as f64;
                std::array::from_fn(|k| {
                    let radius = (k as f64 + 0.5) / SPIRAL as f64 * reach_pixels;
                    let (sin, cos) = libm::sincos(
                        (turn + k as f64 * 5.0 / SPIRAL as f64) * std::f64::consts::TAU,
                    );
                    [cos * radius, sin * radius]
                })
            })
            .collect();

        let mut raw = vec![-1.0f32; width * height];
        for y in 0..height {
            for x in 0..width {
                let Some(p) = points[y * width + x] else { continue };
                let (px, py) = ((x * 2) as f64 + 0.25, (y * 2) as f64 + 0.25);
                let n = shapes.fragment(camera, seen.shape[sample_of(x, y)], px, py).normal;
                let mut blocked = 0.0;
                for [dx, dy] in spirals[y % TILE * TILE + x % TILE] {
                    let (qx, qy) = (x as f64 + dx + 0.5, y as f64 + dy + 0.5);
                    if qx < 0.0 || qy < 0.0 || qx >= width as f64 || qy >= height as f64 {
                        continue;
                    }
                    let Some(q) = points[qy as usize * width + qx as usize] else { continue };
                    let v = q - p;
                    let squared = v.length_squared() / (reach * reach);
                    if squared > 0.0 && squared < 1.0 {
                        // Facets of a coarse mesh stand above their own smooth normal a little.
                        let above = v.dot(n) / v.length() - 0.12;
                        blocked += above.max(0.0) * (1.0 - squared);
                    }
                }
                raw[y * width + x] = (1.0 - 2.4 * blocked / SPIRAL as f64).clamp(0.15, 1.0) as f32;
            }
        }
        let values = average_tiles(&raw, &points, width, height, 0.35 * reach);
        Self { width, height, values }
    }

    /// Between the four nearest places that are not background.
    fn at(&self, x: usize, y: usize) -> f32 {
        let (u, v) = ((x as f32 - 0.25) * 0.5, (y as f32 - 0.25) * 0.5);
        let (i, j) = (u.max(0.0) as usize, v.max(0.0) as usize);
        let (s, t) = ((u - i as f32).max(0.0), (v - j as f32).max(0.0));
        let (mut sum, mut total) = (0.0, 0.0);
        for (di, dj, weight) in [
            (0, 0, (1.0 - s) * (1.0 - t)),
            (1, 0, s * (1.0 - t)),
            (0, 1, (1.0 - s) * t),
            (1, 1, s * t),
        ] {
            if i + di < self.width && j + dj < self.height {
                let value = self.values[(j + dj) * self.width + i + di];
                if value >= 0.0 {
                    sum += value * (weight + 1e-3);
                    total += weight + 1e-3;
                }
            }
        }
        if total > 0.0 { sum / total } else { 1.0 }
    }
}

/// Means over tiles of places that lie near each other in depth too, so that no dark seam leaks
/// across the outline of a fold.
fn average_tiles(
    raw: &[f32],
    points: &[Option<Vec3<f64>>],
    width: usize,
    height: usize,
    reach: f64,
) -> Vec<f32> {
    let mut values = raw.to_vec();
    for y in 0..height {
        for x in 0..width {
            let Some(p) = points[y * width + x] else { continue };
            let (mut sum, mut count) = (0.0, 0.0);
            for j in y.saturating_sub(TILE / 2)..(y + TILE / 2).min(height) {
                for i in x.saturating_sub(TILE / 2)..(x + TILE / 2).min(width) {
                    let Some(q) = points[j * width + i] else { continue };
                    if (q - p).length_squared() < reach * reach {
                        sum += raw[j * width + i];
                        count += 1.0;
                    }
                }
            }
            if count > 0.0 {
                values[y * width + x] = sum / count;
            }
        }
    }
    values
}
