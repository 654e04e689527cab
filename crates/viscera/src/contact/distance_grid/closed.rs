//! Whether a surface is that of a solid: closed, wound outwards, and not through itself.

use super::error::{SolidError, Spot};
use super::tree::{Tree, bounds, corners_of, crossing};
use crate::mesh::SurfaceMesh;
use crate::scalar::Vec3;

/// Triangles at most: seconds and some hundred megabytes while a grid is made.
pub const MOST_TRIANGLES: usize = 2_000_000;

/// A volume below this share of what its area could enclose is none.
const FLAT: f64 = 1e-9;

/// A solid's surface without repeated vertices, and its triangles.
#[derive(Debug)]
pub struct Closed {
    pub surface: SurfaceMesh,
    /// Corners [m], shape [triangle_count].
    pub triangles: Vec<[Vec3<f64>; 3]>,
    pub tree: Tree,
}

impl Closed {
    /// Vertices in one place become one; triangles without three corners are left out.
    pub fn new(given: &SurfaceMesh) -> Result<Self, SolidError> {
        check_numbers(given)?;
        let surface = weld(given);
        if surface.triangles.is_empty() {
            return Err(SolidError::Empty);
        }
        check_edges(&surface)?;
        let volume = surface.enclosed_volume();
        let area = surface.area();
        if volume.abs() <= FLAT * area * area.sqrt() {
            return Err(SolidError::Flat);
        }
        if volume < 0.0 {
            return Err(SolidError::InsideOut);
        }
        let triangles = corners_of(&surface.vertices, &surface.triangles);
        let tree = Tree::new(&triangles);
        check_crossings(&surface, &triangles, &tree)?;
        Ok(Self { surface, triangles, tree })
    }
}

fn check_numbers(given: &SurfaceMesh) -> Result<(), SolidError> {
    let SurfaceMesh { vertices, triangles } = given;
    if triangles.is_empty() {
        return Err(SolidError::Empty);
    }
    if triangles.len() > MOST_TRIANGLES {
        let (count, allowed) = (triangles.len(), MOST_TRIANGLES);
        return Err(SolidError::TooManyTriangles { count, allowed });
    }
    if let Some(vertex) = vertices.iter().position(|x| !x.is_finite()) {
        return Err(SolidError::NonFinite { vertex });
    }
    let vertex_count = vertices.len();
    for (triangle, corners) in triangles.iter().enumerate() {
        if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= vertex_count) {
            return Err(SolidError::UnknownVertex { triangle, vertex, vertex_count });
        }
    }
    Ok(())
}

/// Vertices in the same place become the first of them, and those without a triangle go.
fn weld(given: &SurfaceMesh) -> SurfaceMesh {
    // Zero has two signs.
    let key = |v: u32| (given.vertices[v as usize] + Vec3::ZERO).to_array();
    let mut order: Vec<u32> = given.triangles.iter().flatten().copied().collect();
    order.sort_unstable_by(|&a, &b| {
        let (x, y) = (key(a), key(b));
        let of = |axis: usize| x[axis].total_cmp(&y[axis]);
        of(0).then(of(1)).then(of(2)).then(a.cmp(&b))
    });
    order.dedup();
    let mut first = vec![0; given.vertices.len()];
    for same in order.chunk_by(|&a, &b| key(a) == key(b)) {
        same.iter().for_each(|&v| first[v as usize] = same[0]);
    }
    let mut kept: Vec<u32> = order.iter().map(|&v| first[v as usize]).collect();
    kept.sort_unstable();
    kept.dedup();
    let mut number = vec![0; given.vertices.len()];
    kept.iter().zip(0..).for_each(|(&v, new)| number[v as usize] = new);
    let triangles =
        given.triangles.iter().map(|corners| corners.map(|v| number[first[v as usize] as usize]));
    SurfaceMesh {
        vertices: kept.iter().map(|&v| given.vertices[v as usize] + Vec3::ZERO).collect(),
        triangles: triangles.filter(|[a, b, c]| a != b && b != c && c != a).collect(),
    }
}

/// Along every edge as many triangles go one way as the other.
fn check_edges(surface: &SurfaceMesh) -> Result<(), SolidError> {
    let mut sides: Vec<(u32, u32, bool)> = surface
        .triangles
        .iter()
        .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
        .map(|(a, b)| (a.min(b), a.max(b), a < b))
        .collect();
    sides.sort_unstable();
    let place = |v: u32| surface.vertices[v as usize];
    let (mut open, mut wound) = (0, 0);
    let (mut first_open, mut first_wound) = (None, None);
    for edge in sides.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        let ahead = edge.iter().filter(|side| side.2).count();
        if !edge.len().is_multiple_of(2) {
            open += 1;
            first_open.get_or_insert((edge[0].0, edge[0].1));
        } else if 2 * ahead != edge.len() {
            wound += 1;
            first_wound.get_or_insert((edge[0].0, edge[0].1));
        }
    }
    if let Some((from, to)) = first_open {
        let (from, to) = (Spot(place(from)), Spot(place(to)));
        return Err(SolidError::Open { edges: open, from, to });
    }
    match first_wound {
        Some((a, b)) => {
            Err(SolidError::Wound { edges: wound, at: Spot((place(a) + place(b)) * 0.5) })
        }
        None => Ok(()),
    }
}

/// No triangle goes through another. Neighbours along an edge do not, but where they are folded onto each other.
fn check_crossings(
    surface: &SurfaceMesh,
    triangles: &[[Vec3<f64>; 3]],
    tree: &Tree,
) -> Result<(), SolidError> {
    for (own, triangle) in triangles.iter().enumerate() {
        let corners = surface.triangles[own];
        let found = tree.find_in_box(bounds(triangle), |other, of_other| {
            let shared = surface.triangles[other as usize];
            let is_neighbour = shared.iter().filter(|&v| corners.contains(v)).count() > 1;
            if other as usize <= own || is_neighbour {
                return None;
            }
            crossing(triangle, of_other).map(|at| (other as usize, at))
        });
        if let Some((second, at)) = found {
            return Err(SolidError::Crossing { first: own, second, at: Spot(at) });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::sphere;
    use crate::scalar::vec3;

    fn ball() -> SurfaceMesh {
        sphere(0.01, 0.003).expect("a ball").surface
    }

    fn moved(surface: &SurfaceMesh, by: Vec3<f64>) -> SurfaceMesh {
        let vertices = surface.vertices.iter().map(|x| *x + by).collect();
        SurfaceMesh { vertices, triangles: surface.triangles.clone() }
    }

    fn with(mut one: SurfaceMesh, other: &SurfaceMesh) -> SurfaceMesh {
        let first = one.vertices.len() as u32;
        one.vertices.extend(&other.vertices);
        one.triangles.extend(other.triangles.iter().map(|corners| corners.map(|v| v + first)));
        one
    }

    fn complaint(surface: &SurfaceMesh) -> String {
        Closed::new(surface).expect_err("a refusal").to_string()
    }

    /// Each triangle with corners of its own, as STL has them.
    #[test]
    fn vertices_in_one_place_become_one() {
        let ball = ball();
        let vertices = ball.triangles.iter().flatten().map(|&v| ball.vertices[v as usize]);
        let loose = SurfaceMesh {
            vertices: vertices.collect(),
            triangles: (0..ball.triangles.len() as u32)
                .map(|t| [0, 1, 2].map(|k| 3 * t + k))
                .collect(),
        };
        let closed = Closed::new(&loose).expect("closed").surface;
        assert_eq!(closed.vertices.len(), ball.vertices.len());
        assert_eq!(closed.triangles.len(), ball.triangles.len());
        assert!((closed.enclosed_volume() - ball.enclosed_volume()).abs() < 1e-18);
    }

    #[test]
    fn what_is_no_solid_is_refused_with_the_next_move() {
        let whole = ball();
        let mut open = whole.clone();
        open.triangles.pop();
        assert!(complaint(&open).starts_with("its surface is open at 3 edges, one of them from ("));
        let mut wound = whole.clone();
        wound.triangles[7].swap(0, 1);
        assert!(
            complaint(&wound).starts_with("its triangles are wound against each other at 3 edges")
        );
        let mut inside_out = whole.clone();
        inside_out.triangles.iter_mut().for_each(|corners| corners.swap(0, 1));
        assert_eq!(Closed::new(&inside_out).expect_err("inwards"), SolidError::InsideOut);
        let mut flat = whole.clone();
        flat.vertices.iter_mut().for_each(|x| x.z = 0.0);
        assert_eq!(Closed::new(&flat).expect_err("flat"), SolidError::Flat);
        let crossed = with(whole.clone(), &moved(&whole, vec3(0.011, 0.001, 0.002)));
        assert!(complaint(&crossed).starts_with("it goes through itself: triangle "));
        // Beside each other they are two solids, and one instrument.
        let apart = with(whole.clone(), &moved(&whole, vec3(0.03, 0.0, 0.0)));
        assert!(Closed::new(&apart).is_ok());
    }

    #[test]
    fn numbers_that_no_surface_has_are_refused() {
        assert_eq!(Closed::new(&SurfaceMesh::default()).expect_err("nothing"), SolidError::Empty);
        let mut bad = ball();
        bad.vertices[3].y = f64::NAN;
        assert_eq!(Closed::new(&bad).expect_err("NaN"), SolidError::NonFinite { vertex: 3 });
        let mut bad = ball();
        bad.triangles[2][1] = 100_000;
        let message = complaint(&bad);
        assert!(
            message.starts_with("its triangle 2 names vertex 100000, and there are "),
            "{message}"
        );
        let many = SurfaceMesh { triangles: vec![[0, 0, 0]; MOST_TRIANGLES + 1], ..ball() };
        let message =
            "it has 2000001 triangles, of which 2000000 are allowed; decimate it to that number";
        assert_eq!(complaint(&many), message);
        let none = SurfaceMesh { triangles: vec![[0, 0, 0]; 2], ..ball() };
        assert_eq!(Closed::new(&none).expect_err("no corners"), SolidError::Empty);
    }
}
