//! Markers and arrows as balls, rods and cones: three small meshes, each drawn many times.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use viscera::scalar::Vec3;
use viscera::solver::gpu::Device;
use viscera_picture::{Arrow, Color, Markers};

use crate::buffers::filled;
use crate::drawing::across;

/// Sides of what is round, and rings of a ball: 200 triangles, round enough for a tenth of the picture.
const SIDES: u32 = 16;
const RINGS: u32 = 7;

/// Head of an arrow, in radii of its shaft: length and radius.
const HEAD: [f64; 2] = [5.0, 2.3];

/// How strongly an arrow shines through tissue before it, 0 to 1.
const ARROW_SEE_THROUGH: f32 = 0.4;

/// A shorter arrow than this is drawn thinner, so that it stays an arrow [radii].
const SHORTEST: f64 = 9.0;

/// `Solid` of solid.wgsl.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Solid {
    center: [f32; 4],
    axes: [[f32; 4]; 3],
    /// Linear light, and how strongly it shines through tissue before it.
    color: [f32; 4],
}

impl Solid {
    pub fn new(center: Vec3<f64>, axes: [Vec3<f64>; 3], color: Color, see_through: f32) -> Self {
        let four = |v: Vec3<f64>| [v.x as f32, v.y as f32, v.z as f32, 0.0];
        let color = [color.r, color.g, color.b, see_through];
        Self { center: four(center), axes: axes.map(four), color }
    }

    fn ball(center: Vec3<f64>, markers: &Markers<'_>) -> Self {
        let axis = |x, y, z| Vec3 { x, y, z } * markers.radius;
        let axes = [axis(1.0, 0.0, 0.0), axis(0.0, 1.0, 0.0), axis(0.0, 0.0, 1.0)];
        Self::new(center, axes, markers.color, strength(markers))
    }
}

/// How strongly markers shine through tissue before them, 0 to 1.
fn strength(markers: &Markers<'_>) -> f32 {
    // A comparison with NaN is false.
    if markers.see_through > 0.0 { markers.see_through.min(1.0) } else { 0.0 }
}

/// Shaft and head, of a length above zero.
fn shaft_and_head(arrow: &Arrow) -> [Solid; 2] {
    let length = (arrow.to - arrow.from).length();
    let along = (arrow.to - arrow.from) * (1.0 / length);
    let radius = arrow.radius.min(length / SHORTEST);
    let x = across(along);
    let y = along.cross(x);
    let neck = length - HEAD[0] * radius;
    let (from, wide) = (arrow.from, HEAD[1] * radius);
    let part = |center, axes| Solid::new(center, axes, arrow.color, ARROW_SEE_THROUGH);
    [
        part(from, [x * radius, y * radius, along * neck]),
        part(from + along * neck, [x * wide, y * wide, along * (length - neck)]),
    ]
}

/// A corner of a mesh: its place and normal, as vertices of surfaces.
type Corner = [[f32; 4]; 2];

/// Radius, height, and both of the normal.
type Profile = [f64; 4];

/// Turns a profile around the z axis: rings of corners, from the lower end to the upper.
fn revolve(profile: &[Profile]) -> (Vec<Corner>, Vec<[u32; 3]>) {
    let mut corners = Vec::new();
    for &[radius, height, n_radius, n_height] in profile {
        for k in 0..SIDES {
            let (sin, cos) = libm::sincos(f64::from(k) / f64::from(SIDES) * std::f64::consts::TAU);
            let at = |r: f64, h: f64, last: f64| [r * cos, r * sin, h, last].map(|v| v as f32);
            corners.push([at(radius, height, 1.0), at(n_radius, n_height, 0.0)]);
        }
    }
    let mut triangles = Vec::new();
    for ring in 1..profile.len() as u32 {
        for k in 0..SIDES {
            let below = (ring - 1) * SIDES;
            let (a, b) = (below + k, below + (k + 1) % SIDES);
            triangles.push([a, b, b + SIDES]);
            triangles.push([a, b + SIDES, a + SIDES]);
        }
    }
    (corners, triangles)
}

/// Of radius 1 around the origin; from 0 to 1 along z with radius 1; likewise, and pointed above.
fn profiles() -> [Vec<Profile>; 3] {
    let ring = |i: u32| {
        let (sin, cos) = libm::sincos(f64::from(i) / f64::from(RINGS) * std::f64::consts::PI);
        [sin, -cos, sin, -cos]
    };
    let slope = std::f64::consts::FRAC_1_SQRT_2;
    let cap = [[0.0, 0.0, 0.0, -1.0], [1.0, 0.0, 0.0, -1.0]];
    let rod = [[1.0, 0.0, 1.0, 0.0], [1.0, 1.0, 1.0, 0.0]];
    let cone = [[1.0, 0.0, slope, slope], [0.0, 1.0, slope, slope]];
    [(0..=RINGS).map(ring).collect(), [cap, rod].concat(), [cap, cone].concat()]
}

/// The meshes on the device, one behind the other.
#[derive(Debug)]
pub(crate) struct Meshes {
    corners: wgpu::Buffer,
    indices: wgpu::Buffer,
    /// Indices and first corner of each.
    parts: [(Range<u32>, i32); 3],
}

impl Meshes {
    pub fn new(device: &Device) -> Self {
        let (mut corners, mut triangles) = (Vec::new(), Vec::<[u32; 3]>::new());
        let parts = profiles().map(|profile| {
            let (own, faces) = revolve(&profile);
            let (first, begin) = (corners.len() as i32, 3 * triangles.len() as u32);
            corners.extend(own);
            triangles.extend(faces);
            (begin..3 * triangles.len() as u32, first)
        });
        let buffer = |contents, usage| filled(device, "solids", contents, usage);
        Self {
            corners: buffer(bytemuck::cast_slice(&corners), wgpu::BufferUsages::VERTEX),
            indices: buffer(bytemuck::cast_slice(&triangles), wgpu::BufferUsages::INDEX),
            parts,
        }
    }

    /// How places of solids lie in memory: after those of the mesh.
    pub fn layout() -> wgpu::VertexBufferLayout<'static> {
        const ATTRIBUTES: [wgpu::VertexAttribute; 5] = wgpu::vertex_attr_array![
            2 => Float32x4, 3 => Float32x4, 4 => Float32x4, 5 => Float32x4, 6 => Float32x4
        ];
        wgpu::VertexBufferLayout {
            array_stride: size_of::<Solid>() as u64,
            step_mode: wgpu::VertexStepMode::Instance,
            attributes: &ATTRIBUTES,
        }
    }
}

/// The solids of one picture.
#[derive(Debug)]
pub(crate) struct Solids {
    places: wgpu::Buffer,
    /// Balls, rods and cones among the places.
    ranges: [Range<u32>; 3],
    /// Whether any ball shines through tissue.
    balls_shine_through: bool,
}

impl Solids {
    /// What cannot be drawn is left out: places that are not finite, arrows of no length. Nothing where
    /// nothing is left.
    pub fn new(device: &Device, markers: &[Markers<'_>], arrows: &[Arrow]) -> Option<Self> {
        let there = |radius: f64| radius.is_finite() && radius > 0.0;
        let of = |m: &Markers<'_>| -> Vec<Solid> {
            let finite = m.positions.iter().filter(|x| x.is_finite());
            finite.map(|x| Solid::ball(*x, m)).collect()
        };
        let balls = markers.iter().filter(|m| there(m.radius)).flat_map(of);
        let drawable = |a: &&Arrow| there(a.radius) && there((a.to - a.from).length());
        let pairs: Vec<_> = arrows.iter().filter(drawable).map(shaft_and_head).collect();
        let mut all: Vec<Solid> = balls.collect();
        let (first, count) = (all.len() as u32, pairs.len() as u32);
        all.extend(pairs.iter().map(|pair| pair[0]));
        all.extend(pairs.iter().map(|pair| pair[1]));
        let bytes = (!all.is_empty()).then(|| bytemuck::cast_slice(&all))?;
        let places = filled(device, "places of solids", bytes, wgpu::BufferUsages::VERTEX);
        let ranges = [0..first, first..first + count, first + count..first + 2 * count];
        let balls_shine_through = markers.iter().any(|m| strength(m) > 0.0);
        Some(Self { places, ranges, balls_shine_through })
    }

    /// Draws all, or those that tissue may hide and that shine through it.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>, meshes: &Meshes, hidden: bool) {
        pass.set_vertex_buffer(0, meshes.corners.slice(..));
        pass.set_vertex_buffer(1, self.places.slice(..));
        pass.set_index_buffer(meshes.indices.slice(..), wgpu::IndexFormat::Uint32);
        let parts = meshes
            .parts
            .iter()
            .zip(&self.ranges)
            .skip(usize::from(hidden && !self.balls_shine_through));
        for ((indices, first), range) in parts.filter(|(_, range)| !range.is_empty()) {
            pass.draw_indexed(indices.clone(), *first, range.clone());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera::scalar::vec3;

    #[test]
    fn solids_are_wound_outwards() {
        for profile in profiles() {
            let (corners, triangles) = revolve(&profile);
            for triangle in triangles {
                let at = triangle.map(|v| {
                    let [x, y, z, _] = corners[v as usize][0];
                    vec3(x, y, z)
                });
                let face = (at[1] - at[0]).cross(at[2] - at[0]);
                let [x, y, z, _] = corners[triangle[0] as usize][1];
                // Those around a point have no area.
                assert!(face.length() < 1e-6 || face.dot(vec3(x, y, z)) > 0.0);
            }
        }
    }

    #[test]
    fn an_arrow_ends_where_it_points_however_short() {
        let (from, color) = (vec3(1.0, 2.0, 3.0), Color::PULLED);
        for length in [1.0, 0.001] {
            let to = from + vec3(0.0, 0.6, 0.8) * length;
            let [shaft, head] = shaft_and_head(&Arrow { from, to, radius: 0.01, color });
            for i in 0..3 {
                let tip = head.center[i] + head.axes[2][i];
                let end = [to.x, to.y, to.z][i] as f32;
                assert!((tip - end).abs() < 1e-6, "{tip} for {end}");
                assert!((shaft.center[i] + shaft.axes[2][i] - head.center[i]).abs() < 1e-6);
            }
        }
    }
}
