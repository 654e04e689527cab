//! What lies under the pointer.

use viscera::scalar::Vec3;
use viscera::simulation::Assembly;

use crate::snapshot::RunSnapshot;

/// A point on the tissue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick {
    /// Position of the body in the scene.
    pub body: usize,
    /// Where it is [m].
    pub point: Vec3<f64>,
    /// Where it is at rest [m].
    pub rest: Vec3<f64>,
}

/// The first point of the surfaces that a ray meets, as they are in a frame. `direction` has length 1.
pub fn pick(
    assembly: &Assembly,
    run: &RunSnapshot,
    from: Vec3<f64>,
    direction: Vec3<f64>,
) -> Option<Pick> {
    nearest(assembly, run, f64::INFINITY, |corners| meet(corners, from, direction))
}

/// The point of the surfaces, as they are in a frame, that is nearest and nearer than `within` [m]. `measure` says how far a
/// triangle is, with the weights of its corners there, or nothing.
fn nearest(
    assembly: &Assembly,
    run: &RunSnapshot,
    mut within: f64,
    measure: impl Fn([Vec3<f64>; 3]) -> Option<(f64, [f64; 3])>,
) -> Option<Pick> {
    let mut found = None;
    for (number, body) in assembly.bodies.iter().enumerate() {
        let tissue = run.positions.get(body.vertices.clone())?;
        let mut surface = vec![Vec3::<f32>::ZERO; body.surface.vertices.len()];
        body.embedding.apply(tissue, &mut surface).ok()?;
        for triangle in &body.surface.triangles {
            let corners = triangle.map(|v| surface[v as usize].cast::<f64>());
            let Some((distance, weights)) = measure(corners) else { continue };
            if distance < within {
                within = distance;
                let rest = weighted(triangle.map(|v| body.surface.vertices[v as usize]), weights);
                found = Some(Pick { body: number, point: weighted(corners, weights), rest });
            }
        }
    }
    found
}

/// Distance [m] along a ray to a triangle, from whichever side, and the weights of its corners there.
///
/// ```text
/// from + t d = (1 - u - v) a + u b + v c,  solved by Cramer's rule
/// ```
fn meet(corners: [Vec3<f64>; 3], from: Vec3<f64>, d: Vec3<f64>) -> Option<(f64, [f64; 3])> {
    let [a, b, c] = corners;
    let (ab, ac) = (b - a, c - a);
    let p = d.cross(ac);
    let determinant = ab.dot(p);
    // Seen from its edge it covers nothing.
    if determinant == 0.0 || !determinant.is_finite() {
        return None;
    }
    let start = from - a;
    let u = start.dot(p) / determinant;
    let q = start.cross(ab);
    let v = d.dot(q) / determinant;
    let t = ac.dot(q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some((t, [1.0 - u - v, u, v]))
}

/// The point of the surfaces that is nearest to another one, as they are in a frame; nothing where it is not nearer
/// than `within` [m].
pub fn pick_near(
    assembly: &Assembly,
    run: &RunSnapshot,
    point: Vec3<f64>,
    within: f64,
) -> Option<Pick> {
    nearest(assembly, run, within, |corners| {
        let weights = nearest_weights(corners, point);
        Some(((weighted(corners, weights) - point).length(), weights))
    })
}

fn weighted([a, b, c]: [Vec3<f64>; 3], weights: [f64; 3]) -> Vec3<f64> {
    a * weights[0] + b * weights[1] + c * weights[2]
}

/// The weights of a triangle's corners at its point nearest to another one: at the foot of the perpendicular where that is
/// inside, else at the nearest point of an edge.
fn nearest_weights(corners: [Vec3<f64>; 3], point: Vec3<f64>) -> [f64; 3] {
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a);
    let area = normal.dot(normal);
    let share = |p: Vec3<f64>, q: Vec3<f64>| (p - point).cross(q - point).dot(normal) / area;
    let inside = [share(b, c), share(c, a), share(a, b)];
    if area > 0.0 && inside.iter().all(|weight| *weight >= 0.0) {
        return inside;
    }
    let on_edge = |from: usize, to: usize| {
        let way = corners[to] - corners[from];
        let length = way.dot(way).max(f64::MIN_POSITIVE);
        let t = ((point - corners[from]).dot(way) / length).clamp(0.0, 1.0);
        let mut weights = [0.0; 3];
        (weights[from], weights[to]) = (1.0 - t, t);
        weights
    };
    let distance = |weights: &[f64; 3]| (weighted(corners, *weights) - point).length();
    let edges = [on_edge(0, 1), on_edge(1, 2), on_edge(2, 0)];
    edges.into_iter().min_by(|p, q| distance(p).total_cmp(&distance(q))).unwrap_or(inside)
}

/// Where a ray meets the plane through a point, parallel to the picture.
pub fn meet_plane(
    from: Vec3<f64>,
    direction: Vec3<f64>,
    point: Vec3<f64>,
    normal: Vec3<f64>,
) -> Option<Vec3<f64>> {
    let distance = (point - from).dot(normal) / direction.dot(normal);
    (distance > 0.0 && distance.is_finite()).then(|| from + direction * distance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera::scalar::vec3;

    #[test]
    fn a_ray_meets_a_triangle_inside_it_and_in_front_alone() {
        let corners = [vec3(0.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0)];
        let down = vec3(0.0, 0.0, -1.0);
        let (distance, weights) = meet(corners, vec3(0.25, 0.5, 2.0), down).expect("a hit");
        assert_eq!((distance, weights), (2.0, [0.25, 0.25, 0.5]));
        assert_eq!(meet(corners, vec3(0.6, 0.6, 2.0), down), None);
        assert_eq!(meet(corners, vec3(0.25, 0.5, -2.0), down), None);
        // From behind: a surface that has turned inside out can still be taken hold of.
        assert!(meet(corners, vec3(0.25, 0.5, -2.0), -down).is_some());
        assert_eq!(meet(corners, vec3(-1.0, 0.5, 0.0), vec3(1.0, 0.0, 0.0)), None);
    }

    #[test]
    fn the_nearest_point_of_a_triangle_is_inside_on_an_edge_or_a_corner() {
        let corners = [vec3(0.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0)];
        let near = |x, y, z| nearest_weights(corners, vec3(x, y, z));
        assert_eq!(near(0.25, 0.5, 3.0), [0.25, 0.25, 0.5]);
        assert_eq!(near(0.25, -1.0, 2.0), [0.75, 0.25, 0.0]);
        assert_eq!(near(1.0, 1.0, 0.0), [0.0, 0.5, 0.5]);
        assert_eq!(near(-2.0, 4.0, 1.0), [0.0, 0.0, 1.0]);
    }

    #[test]
    fn a_drag_stays_in_the_plane_of_the_picture() {
        let from = vec3(0.0, -2.0, 0.0);
        let towards = vec3(0.6, 0.8, 0.0);
        let normal = vec3(0.0, -1.0, 0.0);
        let met = meet_plane(from, towards, vec3(5.0, 0.0, 7.0), normal).expect("in front");
        assert!((met - vec3(1.5, 0.0, 0.0)).length() < 1e-12);
        assert_eq!(meet_plane(from, -towards, vec3(5.0, 0.0, 7.0), normal), None);
    }
}
