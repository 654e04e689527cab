//! Whether tissue is inside tissue, by the solid angles that closed surfaces take up around a point.

use viscera::scalar::{Real, Vec3};
use viscera::simulation::Simulation;

/// So far outside its own surface a sample is looked at [m].
const OFF: f64 = 1e-5;

/// A body's surface where it is.
struct Surface {
    points: Vec<Vec3<f64>>,
    triangles: Vec<[u32; 3]>,
    low: Vec3<f64>,
    high: Vec3<f64>,
    /// Samples, a little outside.
    samples: Vec<Vec3<f64>>,
}

/// Samples of all bodies that are inside another body, or somewhere else inside their own.
pub fn count<S: Real>(simulation: &Simulation<S>) -> usize {
    let bodies = &simulation.assembly().bodies;
    let surfaces: Vec<Surface> = bodies
        .iter()
        .map(|body| {
            let positions = &simulation.state().positions[body.vertices.clone()];
            let place = |(corners, weights): (&[u32; 4], &[f64; 4])| {
                let all = corners.iter().zip(weights);
                all.fold(Vec3::ZERO, |sum, (&v, &w)| sum + positions[v as usize].cast::<f64>() * w)
            };
            let bound = body.embedding.corners().iter().zip(body.embedding.weights());
            let points: Vec<Vec3<f64>> = bound.map(place).collect();
            Surface::new(points, body.surface.triangles.clone(), body.has_fine_surface)
        })
        .collect();
    let samples = surfaces.iter().flat_map(|surface| &surface.samples);
    samples.filter(|sample| surfaces.iter().any(|surface| surface.has_inside(**sample))).count()
}

impl Surface {
    /// Samples are the points of a fine surface, otherwise the middles of triangles.
    fn new(points: Vec<Vec3<f64>>, triangles: Vec<[u32; 3]>, is_fine: bool) -> Self {
        let corners = |triangle: &[u32; 3]| triangle.map(|point| points[point as usize]);
        let normal = |triangle: &[u32; 3]| {
            let [a, b, c] = corners(triangle);
            (b - a).cross(c - a)
        };
        let off = |at: Vec3<f64>, normal: Vec3<f64>| at + normal * (OFF / normal.length());
        let samples = if is_fine {
            let mut normals = vec![Vec3::ZERO; points.len()];
            for triangle in &triangles {
                triangle.iter().for_each(|&point| normals[point as usize] += normal(triangle));
            }
            points.iter().zip(normals).map(|(at, normal)| off(*at, normal)).collect()
        } else {
            let middle = |triangle: &[u32; 3]| {
                let [a, b, c] = corners(triangle);
                off((a + b + c) * (1.0 / 3.0), normal(triangle))
            };
            triangles.iter().map(middle).collect()
        };
        let low = points.iter().fold(Vec3::splat(f64::MAX), |low, x| low.min(*x));
        let high = points.iter().fold(Vec3::splat(f64::MIN), |high, x| high.max(*x));
        Self { points, triangles, low, high, samples }
    }

    /// How often the surface is wound around a point: van Oosterom and Strackee, "The solid angle of a plane triangle", 1983.
    fn has_inside(&self, p: Vec3<f64>) -> bool {
        if p.max(self.low) != p || p.min(self.high) != p {
            return false;
        }
        let angle = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|point| self.points[point as usize] - p);
            let [x, y, z] = [a, b, c].map(Vec3::length);
            let below = x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y;
            2.0 * libm::atan2(a.dot(b.cross(c)), below)
        };
        let whole = 4.0 * std::f64::consts::PI;
        self.triangles.iter().map(angle).sum::<f64>() > 0.5 * whole
    }
}

#[test]
fn what_is_inside_is_counted() {
    let text = |way: &str| {
        format!(
            "[[body]]\nname = \"a\"\nshape = \"block\"\nsize = [\"30 mm\", \"30 mm\", \"10 mm\"]\ncells = [3, 3, 1]\n\
             material = {{ preset = \"liver\" }}\n\
             [[body]]\nname = \"b\"\nshape = \"sphere\"\nradius = \"10 mm\"\nspacing = \"5 mm\"\n\
             position = [\"15 mm\", \"15 mm\", \"{way} mm\"]\nmaterial = {{ preset = \"liver\" }}\n\
             [contact]\nself = false\nbodies = false\n"
        )
    };
    let inside = |way: &str| {
        let scene = viscera::scene::Scene::parse("two", &text(way), &[]).expect("a scene");
        let assembly = viscera::simulation::Assembly::new(&scene, &mut |file| Err(file.to_owned()));
        count(&Simulation::<f64>::new(scene, assembly.expect("meshes")).expect("a simulation"))
    };
    assert_eq!(inside("20.1"), 0);
    assert!(inside("19") > 0);
}
