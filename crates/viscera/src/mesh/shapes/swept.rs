//! Closed surfaces that a curve sweeps: around an axis, or from section to section.

use crate::mesh::SurfaceMesh;
use crate::scalar::{Vec3, vec3};
use std::f64::consts::TAU;

/// The surface of a solid of revolution around the z axis.
///
/// `profile` has pairs of radius and height [m]; the first and the last are on the axis, radius zero, the others are not.
/// The solid is to the left of the profile: from its lower end up along its outer side. `sides` around, at least three.
pub fn turned(profile: &[[f64; 2]], sides: u32) -> SurfaceMesh {
    let mut mesh = SurfaceMesh::default();
    let [first, rings @ .., last] = profile else { return mesh };
    let sides = sides.max(3);
    for &[radius, height] in rings {
        for side in 0..sides {
            let (sin, cos) = libm::sincos(TAU * f64::from(side) / f64::from(sides));
            mesh.vertices.push(vec3(radius * cos, radius * sin, height));
        }
    }
    add_bands(&mut mesh, sides, rings.len() as u32);
    add_cap(&mut mesh, vec3(0.0, 0.0, first[1]), 0, sides, true);
    let top = (rings.len() as u32).saturating_sub(1) * sides;
    add_cap(&mut mesh, vec3(0.0, 0.0, last[1]), top, sides, false);
    mesh
}

/// The surface between sections, closed by a fan at both ends.
///
/// `sections` [m], shape [section_count][corner_count]: each counter-clockwise seen from the next one, all with as many
/// corners; the first and the last are seen whole from the mean of their corners.
pub fn lofted(sections: &[Vec<Vec3<f64>>]) -> SurfaceMesh {
    let mut mesh = SurfaceMesh::default();
    let (Some(first), Some(last)) = (sections.first(), sections.last()) else { return mesh };
    let sides = first.len() as u32;
    for section in sections {
        mesh.vertices.extend(section.iter().take(first.len()));
    }
    let middle = |section: &[Vec3<f64>]| {
        let sum = section.iter().fold(Vec3::ZERO, |sum, x| sum + *x);
        sum * (1.0 / section.len().max(1) as f64)
    };
    add_bands(&mut mesh, sides, sections.len() as u32);
    add_cap(&mut mesh, middle(first), 0, sides, true);
    add_cap(&mut mesh, middle(last), (sections.len() as u32 - 1) * sides, sides, false);
    mesh
}

/// Triangles between rings of vertices, one after the other.
fn add_bands(mesh: &mut SurfaceMesh, sides: u32, rings: u32) {
    for ring in 1..rings {
        let (below, above) = ((ring - 1) * sides, ring * sides);
        for side in 0..sides {
            let next = (side + 1) % sides;
            mesh.triangles.push([below + side, below + next, above + next]);
            mesh.triangles.push([below + side, above + next, above + side]);
        }
    }
}

/// A fan from a point [m] to the ring that begins with this vertex.
fn add_cap(mesh: &mut SurfaceMesh, middle: Vec3<f64>, first: u32, sides: u32, is_lower: bool) {
    let own = mesh.vertices.len() as u32;
    mesh.vertices.push(middle);
    for side in 0..sides {
        let (a, b) = (first + side, first + (side + 1) % sides);
        mesh.triangles.push(if is_lower { [own, b, a] } else { [own, a, b] });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::topology::count_open_edges;
    use std::f64::consts::PI;

    #[test]
    fn a_turned_surface_is_closed_and_has_its_volume() {
        // A tube of radius 3 with a bore of radius 2 to half of its length 4.
        let profile = [[0.0, 2.0], [2.0, 2.0], [2.0, 0.0], [3.0, 0.0], [3.0, 4.0], [0.0, 4.0]];
        let mesh = turned(&profile, 400);
        assert_eq!(count_open_edges(&mesh), 0);
        let wanted = PI * (9.0 * 4.0 - 4.0 * 2.0);
        assert!((mesh.enclosed_volume() / wanted - 1.0).abs() < 1e-3, "{}", mesh.enclosed_volume());
    }

    #[test]
    fn a_lofted_surface_is_closed_and_has_its_volume() {
        let section = |z: f64, half: f64| {
            [(-half, -half), (half, -half), (half, half), (-half, half)]
                .map(|(x, y)| vec3(x, y, z))
                .to_vec()
        };
        // A cube and a pyramid's stump on it.
        let mesh = lofted(&[section(0.0, 1.0), section(2.0, 1.0), section(3.0, 0.5)]);
        assert_eq!(count_open_edges(&mesh), 0);
        let wanted = 8.0 + (4.0 + 1.0 + 2.0) / 3.0;
        assert!((mesh.enclosed_volume() - wanted).abs() < 1e-12, "{}", mesh.enclosed_volume());
        assert_eq!(lofted(&[]), SurfaceMesh::default());
        assert_eq!(turned(&[], 8), SurfaceMesh::default());
    }
}
