//! Camera, lights and shadow as shaders have them.

use bytemuck::{Pod, Zeroable};
use viscera::scalar::Vec3;

use crate::drawing::{BoundingSphere, GpuDrawing, across};
use crate::orbit::Orbit;

/// Towards the key light: right, up, towards the viewer.
const KEY: [f64; 3] = [-0.45, 0.65, 0.6];
/// Towards the fill light, likewise.
const FILL: [f64; 3] = [0.8, 0.1, 0.45];

/// Places looked up in the shadow map are this far apart [texels]: wider is softer, and shows its steps from two on.
const SHADOW_STEP: f64 = 1.5;
/// They lie this far before the surface [texels]: nearer, and its own triangles throw spots on it; farther, and the
/// shadow of what touches it begins too late.
const SHADOW_LIFT: f64 = 2.5;

/// `View` of view.wgsl.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct View {
    position: [f32; 4],
    right: [f32; 4],
    up: [f32; 4],
    backward: [f32; 4],
    lens: [f32; 4],
    key: [f32; 4],
    fill: [f32; 4],
    shadow_across: [f32; 4],
    shadow_up: [f32; 4],
    shadow_depth: [f32; 4],
    shadow: [f32; 4],
    top: [f32; 4],
    bottom: [f32; 4],
}

impl View {
    /// Of a drawing for a picture of this width over height, with a shadow map of this edge [texels].
    pub fn of(drawing: &GpuDrawing<'_>, aspect: f64, shadow_edge: Option<u32>) -> Self {
        let orbit = &drawing.orbit;
        let [right, up, backward] = orbit.axes();
        let [x, y] = Orbit::lens(aspect);
        let towards = |[x, y, z]: [f64; 3]| unit(right * x + up * y + backward * z);
        let (top, bottom) = (drawing.background.top, drawing.background.bottom);
        let view = Self {
            position: four(orbit.position(), 0.0),
            right: four(right, 0.0),
            up: four(up, 0.0),
            backward: four(backward, 0.0),
            lens: [x, y, 0.01 * orbit.distance, 100.0 * orbit.distance].map(|v| v as f32),
            key: four(towards(KEY), 0.0),
            fill: four(towards(FILL), 0.0),
            top: [top.r, top.g, top.b, 1.0],
            bottom: [bottom.r, bottom.g, bottom.b, 1.0],
            ..Self::default()
        };
        match drawing.shadow.zip(shadow_edge) {
            Some((sphere, edge)) => view.shadowed(&sphere, edge, towards(KEY), orbit.position()),
            None => view,
        }
    }

    pub fn has_shadow(&self) -> bool {
        self.shadow[2] > 0.0
    }

    /// A parallel light that just sees the whole sphere.
    fn shadowed(
        self,
        sphere: &BoundingSphere,
        edge: u32,
        key: Vec3<f64>,
        viewer: Vec3<f64>,
    ) -> Self {
        let side = across(key);
        let center = sphere.center - viewer;
        let row = |axis: Vec3<f64>, scale: f64, offset: f64| {
            let axis = axis * (scale / sphere.radius);
            four(axis, offset - axis.dot(center))
        };
        // The picture's width in the map is twice the radius.
        let texel = 1.0 / f64::from(edge);
        let lift = SHADOW_LIFT * 2.0 * sphere.radius * texel;
        Self {
            shadow_across: row(side, 1.0, 0.0),
            shadow_up: row(key.cross(side), 1.0, 0.0),
            shadow_depth: row(key, -0.5, 0.5),
            shadow: [(SHADOW_STEP * texel) as f32, lift as f32, 1.0, 0.0],
            ..self
        }
    }
}

fn unit(v: Vec3<f64>) -> Vec3<f64> {
    v * (1.0 / v.length())
}

fn four(v: Vec3<f64>, last: f64) -> [f32; 4] {
    [v.x, v.y, v.z, last].map(|v| v as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera::scalar::vec3;

    #[test]
    fn the_shadow_map_holds_the_whole_sphere() {
        let sphere = BoundingSphere { center: vec3(0.3, -0.2, 0.1), radius: 0.05 };
        let mut orbit = Orbit::framing(&[vec3(0.25, -0.25, 0.05), vec3(0.35, -0.15, 0.15)]);
        orbit.turn(33.0, 20.0);
        let drawing = GpuDrawing { shadow: Some(sphere), ..GpuDrawing::from(orbit) };
        let view = View::of(&drawing, 1.5, Some(512));
        let at = |row: [f32; 4], x: Vec3<f64>| {
            let v = four(x - orbit.position(), 1.0);
            (0..4).map(|i| f64::from(row[i]) * f64::from(v[i])).sum::<f64>()
        };
        let key = vec3(view.key[0], view.key[1], view.key[2]).cast::<f64>();
        // Single precision of distances of half a metre over a sphere of five centimetres.
        let near = |a: f64, b: f64| (a - b).abs() < 1e-5;
        assert!(near(at(view.shadow_depth, sphere.center), 0.5));
        assert!(near(at(view.shadow_depth, sphere.center + key * sphere.radius), 0.0));
        assert!(near(at(view.shadow_across, sphere.center), 0.0));
        let edge = sphere.center + across(key) * sphere.radius;
        assert!(near(at(view.shadow_across, edge), 1.0) && near(at(view.shadow_up, edge), 0.0));
        assert!(!View::of(&drawing, 1.5, None).has_shadow());
    }
}
