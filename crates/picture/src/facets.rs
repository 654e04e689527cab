//! Triangles of tools' shapes.
//!
//! Sphere, capsule and rounded box are one family: a ball swept over a core, which is a point, a segment or a box. The
//! ball's octants move to the core's corners, and bands between them become the flat and the cylindrical faces:
//!
//! ```text
//! x = m + (s_x c_x, s_y c_y, s_z c_z) + r n        n: direction in the octant of signs s;  c: half extents of the core
//! ```
//!
//! The direction `n` is the exact normal there, at sharp edges (`r = 0`) too: each face has corners of its own. A mesh has its
//! own triangles.

use viscera::contact::Shape;
use viscera::mesh::SurfaceMesh;
use viscera::scalar::rigid::RigidTransform;
use viscera::scalar::{Vec3, vec3};

/// A shape's surface as triangles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facets {
    /// Positions [m], shape [vertex_count]. Faces that meet at an edge have vertices of their own there.
    pub positions: Vec<Vec3<f64>>,
    /// Outward normals of length 1, shape [vertex_count].
    pub normals: Vec<Vec3<f64>>,
    /// Vertex indices, counter-clockwise seen from outside, shape [triangle_count].
    pub triangles: Vec<[u32; 3]>,
}

/// Steps of a quarter of a circle: 11 degrees each, smooth where a tool is a third of a picture.
const STEPS: u32 = 8;

/// Columns of vertices around the z axis: each quarter has its own at both ends.
const COLUMNS: u32 = 4 * (STEPS + 1);

/// Shafts are divided along z, so that what is behind the viewer can be left out; into so many at most.
const MOST_BANDS: f64 = 64.0;

/// Half the side of a half-space's patch, as a share of the radius of what is around it.
const PATCH: f64 = 0.8;

/// Cosine of the angle at which triangles of a surface meet with an edge: those of a round rod of a dozen sides do not.
const CREASE: f64 = 0.8;

/// A ring of vertices: height of its core's corners [m], and the direction's parts across and along z.
struct Row {
    height: f64,
    across: f64,
    along: f64,
}

impl Facets {
    /// Of a shape in its own frame; inscribed, within 1 % of its radius. Empty for a half-space, which has no end
    /// ([`Facets::patch`]).
    pub fn of(shape: &Shape) -> Self {
        let (middle, core, radius) = match *shape {
            Shape::HalfSpace => return Self::default(),
            Shape::Mesh(ref grid) => return Self::of_surface(grid.surface()),
            Shape::Sphere { radius } => (Vec3::ZERO, Vec3::ZERO, radius),
            Shape::Capsule { length, radius } => {
                let half = vec3(0.0, 0.0, 0.5 * length);
                (half, half, radius)
            }
            Shape::RoundedBox { half, radius } => (Vec3::ZERO, half - Vec3::splat(radius), radius),
        };
        let rows = rows(core.z, radius);
        let mut facets = Self::default();
        let quarter = quarter();
        for row in &rows {
            for turns in 0..4 {
                for (cos, sin) in quarter {
                    let (x, y) = turned((cos, sin), turns);
                    // The middle of a quarter, of which both parts are 1 or -1.
                    let (right, back) = turned((1.0, 1.0), turns);
                    let corner = vec3(right * core.x, back * core.y, row.height);
                    let normal = vec3(x * row.across, y * row.across, row.along);
                    facets.positions.push(middle + corner + normal * radius);
                    facets.normals.push(normal);
                }
            }
        }
        let count = rows.len() as u32;
        for row in 1..count {
            for column in 0..COLUMNS {
                let below = (row - 1) * COLUMNS;
                let (a, b) = (below + column, below + (column + 1) % COLUMNS);
                facets.add([a, b, b + COLUMNS]);
                facets.add([a, b + COLUMNS, a + COLUMNS]);
            }
        }
        // Below and above the core's flat faces.
        let [low, high] = [0, (count - 1) * COLUMNS]
            .map(|first| [0, 1, 2, 3].map(|turns: u32| first + turns * (STEPS + 1)));
        facets.add([low[0], low[2], low[1]]);
        facets.add([low[0], low[3], low[2]]);
        facets.add([high[0], high[1], high[2]]);
        facets.add([high[0], high[2], high[3]]);
        facets
    }

    /// Of a closed surface: round where its triangles meet at less than the angle of a crease, with an edge elsewhere.
    pub fn of_surface(surface: &SurfaceMesh) -> Self {
        let corners = |t: usize| surface.triangles[t].map(|v| surface.vertices[v as usize]);
        let areas: Vec<Vec3<f64>> = (0..surface.triangles.len())
            .map(|t| {
                let [a, b, c] = corners(t);
                (b - a).cross(c - a)
            })
            .collect();
        let mut around = vec![Vec::new(); surface.vertices.len()];
        for (t, triangle) in surface.triangles.iter().enumerate() {
            triangle.iter().for_each(|&v| around[v as usize].push(t));
        }
        let mut facets = Self::default();
        for (t, triangle) in surface.triangles.iter().enumerate() {
            let own = areas[t];
            if own.length() == 0.0 {
                continue;
            }
            let first = facets.positions.len() as u32;
            for (&v, position) in triangle.iter().zip(corners(t)) {
                let neighbours = around[v as usize].iter().map(|&other| areas[other]);
                let is_round =
                    |other: &Vec3<f64>| own.dot(*other) > CREASE * own.length() * other.length();
                let sum = neighbours.filter(is_round).fold(Vec3::ZERO, |sum, other| sum + other);
                facets.positions.push(position);
                facets.normals.push(sum * (1.0 / sum.length()));
            }
            facets.triangles.push([first, first + 1, first + 2]);
        }
        facets
    }

    /// A square on the plane of a half-space at `pose`, across from a ball of this middle and radius [m].
    pub fn patch(pose: &RigidTransform, middle: Vec3<f64>, radius: f64) -> Self {
        let below = pose.undo(middle);
        let half = PATCH * radius;
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let at = |(x, y): (f64, f64)| vec3(below.x + x * half, below.y + y * half, 0.0);
        let own = Self {
            positions: corners.map(at).to_vec(),
            normals: vec![vec3(0.0, 0.0, 1.0); 4],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        };
        own.placed(pose)
    }

    /// Moved from its own frame to the world.
    pub fn placed(mut self, pose: &RigidTransform) -> Self {
        self.positions.iter_mut().for_each(|x| *x = pose.apply(*x));
        self.normals.iter_mut().for_each(|n| *n = pose.turn(*n));
        self
    }

    /// Adds a triangle, unless two of its corners are one point.
    fn add(&mut self, triangle: [u32; 3]) {
        let [a, b, c] = triangle.map(|v| self.positions[v as usize]);
        if a != b && b != c && c != a {
            self.triangles.push(triangle);
        }
    }
}

/// Rings from the lower pole to the upper, `half` [m] of a core's height.
fn rows(half: f64, radius: f64) -> Vec<Row> {
    let quarter = quarter();
    let lower = quarter.map(|(cos, sin)| Row { height: -half, across: sin, along: -cos });
    let upper = quarter.map(|(cos, sin)| Row { height: half, across: sin, along: cos });
    let bands = (half / radius.max(1e-3 * half)).ceil().clamp(1.0, MOST_BANDS) as u32;
    let between = (1..bands).map(|band| {
        let height = half * (2.0 * f64::from(band) / f64::from(bands) - 1.0);
        Row { height, across: 1.0, along: 0.0 }
    });
    lower.into_iter().chain(between).chain(upper.into_iter().rev()).collect()
}

/// Cosine and sine of the steps of a quarter of a circle, exact at both ends.
fn quarter() -> [(f64, f64); STEPS as usize + 1] {
    std::array::from_fn(|step| match step as u32 {
        0 => (1.0, 0.0),
        STEPS => (0.0, 1.0),
        step => {
            let (sin, cos) =
                libm::sincos(f64::from(step) / f64::from(STEPS) * std::f64::consts::FRAC_PI_2);
            (cos, sin)
        }
    })
}

/// Turned by so many quarters of a circle, to the bit.
fn turned((x, y): (f64, f64), turns: u32) -> (f64, f64) {
    match turns {
        0 => (x, y),
        1 => (-y, x),
        2 => (-x, -y),
        _ => (y, -x),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;
    use std::f64::consts::PI;

    /// A shape, and half extents of its core and radius of its ball [m].
    const SHAPES: [(Shape, [f64; 3], f64); 6] = [
        (Shape::Sphere { radius: 0.4 }, [0.0; 3], 0.4),
        (Shape::Capsule { length: 1.0, radius: 0.2 }, [0.0, 0.0, 0.5], 0.2),
        (Shape::Capsule { length: 0.0, radius: 0.2 }, [0.0; 3], 0.2),
        (
            Shape::RoundedBox { half: vec3(0.3, 0.5, 0.75), radius: 0.125 },
            [0.175, 0.375, 0.625],
            0.125,
        ),
        // A blade: its core is flat.
        (Shape::RoundedBox { half: vec3(0.25, 0.5, 0.75), radius: 0.25 }, [0.0, 0.25, 0.5], 0.25),
        (Shape::RoundedBox { half: vec3(0.3, 0.5, 0.2), radius: 0.0 }, [0.3, 0.5, 0.2], 0.0),
    ];

    fn corners(facets: &Facets, triangle: [u32; 3]) -> [Vec3<f64>; 3] {
        triangle.map(|v| facets.positions[v as usize])
    }

    #[test]
    fn area_and_volume_are_those_of_the_shape() {
        for (shape, [a, b, c], r) in SHAPES {
            let facets = Facets::of(&shape);
            let (mut area, mut volume) = (0.0, 0.0);
            for &triangle in &facets.triangles {
                let [x, y, z] = corners(&facets, triangle);
                area += 0.5 * (y - x).cross(z - x).length();
                volume += x.dot(y.cross(z)) / 6.0;
            }
            // Steiner's formula for a box swept by a ball.
            let (faces, edges) = (a * b + b * c + c * a, 2.0 * (a + b + c));
            let true_area = 8.0 * faces + 2.0 * PI * r * edges + 4.0 * PI * r * r;
            let true_volume =
                8.0 * a * b * c + 8.0 * r * faces + PI * r * r * edges + 4.0 / 3.0 * PI * r * r * r;
            for (found, truth) in [(area, true_area), (volume, true_volume)] {
                let missing = 1.0 - found / truth;
                // Inscribed: never more, and less by what chords of 11 degrees cut off.
                assert!((-1e-12..0.02).contains(&missing), "{shape:?}: {found} for {truth}");
                assert!(r > 0.0 || missing.abs() < 1e-12);
            }
        }
    }

    #[test]
    fn surface_is_closed() {
        for (shape, ..) in SHAPES {
            let facets = Facets::of(&shape);
            // Vertices at one point are one vertex. Adding zero makes one of both zeros.
            let key = |v: u32| facets.positions[v as usize].to_array().map(|x| (x + 0.0).to_bits());
            let mut balance = BTreeMap::<_, i32>::new();
            for &[a, b, c] in &facets.triangles {
                for [from, to] in [[a, b], [b, c], [c, a]] {
                    let (from, to) = (key(from), key(to));
                    *balance.entry((from, to)).or_default() += 1;
                    *balance.entry((to, from)).or_default() -= 1;
                }
            }
            assert!(!balance.is_empty());
            assert!(balance.values().all(|&sum| sum == 0), "{shape:?}");
        }
    }

    #[test]
    fn normals_point_outwards_and_are_the_distances_gradient() {
        for (shape, _, radius) in SHAPES {
            let facets = Facets::of(&shape);
            for &triangle in &facets.triangles {
                let [a, b, c] = corners(&facets, triangle);
                let face = (b - a).cross(c - a);
                for v in triangle {
                    let normal = facets.normals[v as usize];
                    assert!(face.dot(normal) > 0.95 * face.length(), "{shape:?}");
                    let here = shape.distance(facets.positions[v as usize]);
                    assert!(here.value.abs() < 1e-12, "{shape:?}: {} m off", here.value);
                    assert!(radius == 0.0 || (here.normal - normal).length() < 1e-9, "{shape:?}");
                }
            }
        }
    }

    #[test]
    fn patch_of_a_half_space_lies_on_its_plane_across_from_the_scene() {
        let pose = RigidTransform::about(Vec3::ZERO, vec3(0.3, -0.2, 0.1), vec3(0.1, 0.2, -0.3));
        let middle = vec3(0.05, -0.02, 0.04);
        let patch = Facets::patch(&pose, middle, 0.5);
        let up = pose.turn(vec3(0.0, 0.0, 1.0));
        let mut mean = Vec3::ZERO;
        for (x, n) in patch.positions.iter().zip(&patch.normals) {
            assert!(pose.undo(*x).z.abs() < 1e-12 && (*n - up).length() < 1e-12);
            mean += *x * 0.25;
        }
        assert!((mean - middle).cross(up).length() < 1e-12);
        assert_eq!(Facets::of(&Shape::HalfSpace), Facets::default());
    }
}
