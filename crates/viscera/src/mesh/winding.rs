//! The inside of a triangle surface that may have holes, gaps and parts that cross: by its generalised winding number.
//!
//! ```text
//! w(p) = sum over triangles of  Omega(p)/4 pi,   tan(Omega/2) = det(a, b, c) / (abc + (a.b) c + (b.c) a + (c.a) b)
//! far from a group of triangles:  Omega = N.(x - p)/|x - p|^3,   N, x: sum of area normals, their mean place
//! inside: w > 1/2;   distance: to the nearest triangle, whatever side it is seen from
//! ```
//!
//! Jacobson, Kavan and Sorkine-Hornung, "Robust inside-outside segmentation using generalized winding numbers", 2013; the tree of
//! dipoles from Barill, Dickson, Schmidt, Levin and Jacobson, "Fast winding numbers for soups and clouds", 2018; a triangle's angle
//! from Van Oosterom and Strackee, 1983. Across a hole the surface goes where the number is one half.

use super::corners::BoundingBox;
use super::distance::{Offset, SignedDistance};
use super::nearest::nearest_weights;
use super::tetrahedralize::{
    Spacing, TetrahedralizeError, TetrahedralizeReport, tetrahedralize, tetrahedralize_to,
};
use super::topology::count_open_edges;
use super::{SurfaceMesh, TetMesh, boundary_surface, check_vertex};
use crate::scalar::{Vec3, vec3};

/// A group is far where it is so many of its radii away: the error of a winding number is about a hundredth then.
const FAR: f64 = 2.5;

/// Triangles of a leaf.
const LEAF: usize = 8;

/// Why a surface has no inside.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoInside {
    /// There is no triangle with an area.
    #[error("the surface has no triangles")]
    Empty,
    /// A vertex is not finite or out of range.
    #[error("vertex {vertex} of the surface is not a usable place; export it again")]
    Vertex {
        /// Its number, counting from 0.
        vertex: usize,
    },
    /// Triangles face both ways, or it is a sheet.
    #[error(
        "inside and outside of the surface cannot be told apart: no place is surrounded by it (winding number {highest:.2} \
         at most, 1 where a surface is closed); close it, or turn all triangles outwards"
    )]
    Open {
        /// The largest winding number near it.
        highest: f64,
    },
    /// Too much of the boundary would lie where no triangle is.
    #[error(
        "{percent:.0} % of the boundary would lie where the surface has no triangles: its holes are too large to be \
         closed by a guess; close them, for example with Blender's or MeshLab's hole filling"
    )]
    Invented {
        /// Percent of the area.
        percent: f64,
    },
}

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: BoundingBox,
    /// Sum of area normals [m^2], their mean place, and how far any corner is from it [m].
    normal: Vec3<f64>,
    center: Vec3<f64>,
    radius: f64,
    /// Triangles of a leaf, in the tree's order.
    first: u32,
    count: u32,
    /// The node behind all that are below this one; the first child comes right behind it.
    end: u32,
}

/// A surface that can be asked what is inside.
#[derive(Clone, Debug)]
pub struct Solid {
    /// Corners of triangles in the tree's order.
    triangles: Vec<[Vec3<f64>; 3]>,
    nodes: Vec<Node>,
    /// -1 where triangles are wound inwards.
    turn: f64,
    bounds: BoundingBox,
}

impl Solid {
    /// Of a surface, wound either way.
    pub fn new(surface: &SurfaceMesh) -> Result<Self, NoInside> {
        for (vertex, &x) in surface.vertices.iter().enumerate() {
            check_vertex(vertex, x).map_err(|_| NoInside::Vertex { vertex })?;
        }
        let corners = |t: &[u32; 3]| t.map(|v| surface.vertices[v as usize]);
        let mut triangles: Vec<[Vec3<f64>; 3]> = surface.triangles.iter().map(corners).collect();
        triangles.retain(|&[a, b, c]| (b - a).cross(c - a).length_squared() > 0.0);
        if triangles.is_empty() {
            return Err(NoInside::Empty);
        }
        let mut solid = Self {
            bounds: BoundingBox::around(triangles.as_flattened()),
            triangles,
            nodes: Vec::new(),
            turn: 1.0,
        };
        solid.split(0, solid.triangles.len());
        if surface.enclosed_volume() < 0.0 {
            solid.turn = -1.0;
        }
        Ok(solid)
    }

    /// Makes the node of a range of triangles, and those below it.
    fn split(&mut self, first: usize, count: usize) {
        let place = self.nodes.len();
        let own = &mut self.triangles[first..first + count];
        let bounds = BoundingBox::around(own.as_flattened());
        let (mut normal, mut center, mut area) = (Vec3::ZERO, Vec3::ZERO, 0.0);
        for &[a, b, c] in own.iter() {
            let n = (b - a).cross(c - a) * 0.5;
            let size = n.length();
            normal += n;
            center += (a + b + c) * (size / 3.0);
            area += size;
        }
        let center = center * (1.0 / area);
        let far = own.as_flattened().iter().map(|&x| (x - center).length_squared());
        let radius = far.fold(0.0, f64::max).sqrt();
        let (leaf, end) = (if count <= LEAF { count as u32 } else { 0 }, 0);
        self.nodes.push(Node {
            bounds,
            normal,
            center,
            radius,
            first: first as u32,
            count: leaf,
            end,
        });
        if count > LEAF {
            let size = (bounds.max - bounds.min).to_array();
            let axis =
                (0..3).fold(0, |most, axis| if size[axis] > size[most] { axis } else { most });
            let middle = |t: &[Vec3<f64>; 3]| t[0][axis] + t[1][axis] + t[2][axis];
            own.select_nth_unstable_by(count / 2, |a, b| middle(a).total_cmp(&middle(b)));
            self.split(first, count / 2);
            self.split(first + count / 2, count - count / 2);
        }
        self.nodes[place].end = self.nodes.len() as u32;
    }

    /// The winding number of a point: 1 inside a closed surface, 0 outside.
    pub fn winding(&self, p: Vec3<f64>) -> f64 {
        let (mut place, mut sum) = (0, 0.0);
        while let Some(node) = self.nodes.get(place) {
            let way = node.center - p;
            let squared = way.length_squared();
            if squared > (FAR * node.radius) * (FAR * node.radius) {
                sum += node.normal.dot(way) / (squared * squared.sqrt());
                place = node.end as usize;
                continue;
            }
            let own = node.first as usize..(node.first + node.count) as usize;
            sum += self.triangles[own].iter().map(|triangle| solid_angle(p, triangle)).sum::<f64>();
            place += 1;
        }
        self.turn * sum / (4.0 * std::f64::consts::PI)
    }

    /// How far the nearest triangle is [m].
    pub fn nearest(&self, p: Vec3<f64>) -> f64 {
        let (mut place, mut least) = (0, f64::INFINITY);
        while let Some(node) = self.nodes.get(place) {
            if node.bounds.distance_squared(p) >= least {
                place = node.end as usize;
                continue;
            }
            let own = node.first as usize..(node.first + node.count) as usize;
            for &[a, b, c] in &self.triangles[own] {
                let [u, v, w] = nearest_weights(p, [a, b, c]);
                least = least.min((a * u + b * v + c * w - p).length_squared());
            }
            place += 1;
        }
        least.sqrt()
    }

    /// The largest winding number of a coarse grid of points.
    fn highest_winding(&self) -> f64 {
        let size = self.bounds.max - self.bounds.min;
        let at =
            |n: usize, axis: usize| (n as f64 + 0.5) / 16.0 * size[axis] + self.bounds.min[axis];
        let point = |n: usize| vec3(at(n % 16, 0), at(n / 16 % 16, 1), at(n / 256, 2));
        (0..4096).map(|n| self.winding(point(n))).fold(0.0, f64::max)
    }

    /// The share of a boundary's area that is further than `reach` [m] from all triangles: what fills holes.
    pub fn invented(&self, boundary: &SurfaceMesh, reach: f64) -> f64 {
        let (mut all, mut invented) = (0.0, 0.0);
        for triangle in &boundary.triangles {
            let [a, b, c] = triangle.map(|v| boundary.vertices[v as usize]);
            let area = (b - a).cross(c - a).length();
            all += area;
            if self.nearest((a + b + c) * (1.0 / 3.0)) > reach {
                invented += area;
            }
        }
        if all > 0.0 { invented / all } else { 0.0 }
    }
}

impl SignedDistance for Solid {
    fn distance(&self, point: Vec3<f64>) -> f64 {
        let distance = self.nearest(point);
        if self.winding(point) > 0.5 { -distance } else { distance }
    }

    fn bounds(&self) -> (Vec3<f64>, Vec3<f64>) {
        // Over a hole at its rim the boundary may bulge.
        let more = (self.bounds.max - self.bounds.min) * 0.02;
        (self.bounds.min - more, self.bounds.max + more)
    }
}

/// Most of the boundary that may lie where no triangle is.
const MOST_INVENTED: f64 = 0.15;

/// Why a surface cannot be filled.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FillError {
    /// It has no inside.
    #[error(transparent)]
    Inside(#[from] NoInside),
    /// The filling failed.
    #[error(transparent)]
    Fill(#[from] TetrahedralizeError),
}

/// A filled surface.
#[derive(Clone, Debug)]
pub struct Filled {
    /// The tetrahedra.
    pub mesh: TetMesh,
    /// Numbers of the filling.
    pub report: TetrahedralizeReport,
    /// The share of the boundary's area that lies where the surface has no triangles.
    pub invented: f64,
}

/// Fills a surface with tetrahedra whose longest edges are `spacing` [m] long, see [`tetrahedralize`]. Of a closed surface they
/// have the volume.
pub fn fill(surface: &SurfaceMesh, spacing: impl Into<Spacing>) -> Result<Filled, FillError> {
    let spacing = spacing.into();
    let solid = Solid::new(surface)?;
    let volume = surface.enclosed_volume().abs();
    let made = if count_open_edges(surface) == 0 && volume > 0.0 {
        tetrahedralize_to(|by| Offset { shape: &solid, by }, spacing, volume)
    } else {
        tetrahedralize(&solid, spacing)
    };
    let (mesh, report) = made.map_err(|error| match error {
        TetrahedralizeError::Empty => NoInside::Open { highest: solid.highest_winding() }.into(),
        other => FillError::from(other),
    })?;
    let invented = solid.invented(&boundary_surface(&mesh).surface, 0.5 * spacing.surface);
    if invented > MOST_INVENTED {
        return Err(NoInside::Invented { percent: 100.0 * invented }.into());
    }
    Ok(Filled { mesh, report, invented })
}

/// The solid angle of a triangle as seen from a point; positive where its outside is turned away.
fn solid_angle(p: Vec3<f64>, &[a, b, c]: &[Vec3<f64>; 3]) -> f64 {
    let (a, b, c) = (a - p, b - p, c - p);
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let volume = a.dot(b.cross(c));
    let sides = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    // Zero on a corner, where both are zero.
    2.0 * libm::atan2(volume, sides)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::distance::Sphere;
    use crate::mesh::tetrahedralize::surface;
    use crate::scalar::vec3;

    fn ball() -> SurfaceMesh {
        let sphere = Sphere { center: vec3(0.01, 0.0, 0.0), radius: 0.05 };
        surface(&sphere, 0.006).expect("a sphere")
    }

    fn points() -> impl Iterator<Item = Vec3<f64>> {
        let at = |i: usize| (i as f64 + 0.37) / 12.0 * 0.2 - 0.1;
        (0..1728).map(move |n| vec3(at(n % 12), at(n / 12 % 12), at(n / 144)))
    }

    /// Against the sum over all triangles, which is 0 or 1 to rounding.
    #[test]
    fn a_closed_surface_winds_once_around_its_inside() {
        let ball = ball();
        let solid = Solid::new(&ball).expect("a ball");
        for p in points() {
            let corners = |t: &[u32; 3]| t.map(|v| ball.vertices[v as usize]);
            let exact = ball.triangles.iter().map(|t| solid_angle(p, &corners(t))).sum::<f64>();
            let exact = exact / (4.0 * std::f64::consts::PI);
            assert!((exact - exact.round()).abs() < 1e-12);
            assert!((solid.winding(p) - exact).abs() < 0.03, "{p:?} {} {exact}", solid.winding(p));
        }
    }

    #[test]
    fn distances_are_those_of_the_nearest_triangle() {
        let solid = Solid::new(&ball()).expect("a ball");
        for p in points() {
            let exact = (p - vec3(0.01, 0.0, 0.0)).length() - 0.05;
            // Triangles of 6 mm lie below the sphere by up to 0.1 mm.
            assert!((solid.distance(p) - exact).abs() < 2e-4, "{p:?}");
        }
    }

    #[test]
    fn a_surface_that_is_wound_inwards_has_the_same_inside() {
        let mut turned = ball();
        turned.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        let [a, b] = [Solid::new(&ball()), Solid::new(&turned)].map(|s| s.expect("a ball"));
        for p in points() {
            assert!((a.winding(p) - b.winding(p)).abs() < 1e-12);
        }
    }

    /// A number between 0 and 1 of a fixed sequence.
    fn share(i: usize) -> f64 {
        (i as f64 * 0.618034) % 1.0
    }

    /// One triangle of twenty is gone.
    #[test]
    fn a_ball_with_holes_is_filled() {
        let mut holes = ball();
        let mut number = 0;
        holes.triangles.retain(|_| {
            number += 1;
            share(number) > 0.05
        });
        assert!(count_open_edges(&holes) > 50);
        let Filled { mesh, report, invented } = fill(&holes, 0.01).expect("a ball");
        let volume = 4.0 / 3.0 * std::f64::consts::PI * 0.05f64.powi(3);
        // A filling of 10 mm lies below the sphere by about 0.8 %.
        assert!((mesh.volume() / volume - 1.0).abs() < 0.02, "{}", mesh.volume() / volume);
        assert_eq!((report.components, report.non_manifold_edges), (1, 0));
        assert!(invented < 0.01, "{invented}");
    }

    #[test]
    fn what_is_open_is_refused_with_a_reason() {
        let mut half = ball();
        let high = |t: &[u32; 3]| t.iter().all(|&v| half.vertices[v as usize].z > 0.0);
        let kept = half.triangles.iter().copied().filter(high).collect();
        half.triangles = kept;
        let error = fill(&half, 0.01).expect_err("open").to_string();
        assert!(
            error.contains("too large to be closed") || error.contains("cannot be told apart"),
            "{error}"
        );
        let mut mixed = ball();
        for (number, triangle) in mixed.triangles.iter_mut().enumerate() {
            if number % 2 == 0 {
                triangle.swap(0, 1);
            }
        }
        let error = fill(&mixed, 0.01).expect_err("both ways").to_string();
        assert!(error.contains("turn all triangles outwards"), "{error}");
    }

    #[test]
    fn what_has_no_area_has_no_inside() {
        let x = vec3(0.0, 0.0, 0.0);
        let flat = SurfaceMesh { vertices: vec![x; 3], triangles: vec![[0, 1, 2]] };
        assert_eq!(Solid::new(&flat).expect_err("no area"), NoInside::Empty);
        let nan = vec3(f64::NAN, 0.0, 0.0);
        let broken = SurfaceMesh { vertices: vec![nan; 3], triangles: vec![[0, 1, 2]] };
        assert_eq!(Solid::new(&broken).expect_err("NaN"), NoInside::Vertex { vertex: 0 });
    }
}
