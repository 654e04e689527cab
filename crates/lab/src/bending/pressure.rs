//! How rough the pressure of a body at rest is, from tetrahedron to tetrahedron.
//!
//! ```text
//! p = -tr(sigma)/3;   roughness = sqrt(sum_f A_f (p_a - p_b)^2 / sum_f A_f) / (sum_t V_t |p_t| / sum_t V_t)
//! ```
//!
//! over the faces `f` between tetrahedra `a` and `b`. A smooth field has some as well, as meshes have a size: that of
//! quadratic tetrahedra on the same mesh is what to compare with.

use anyhow::Result;
use viscera::mesh::tet_volume;
use viscera::mesh::topology::TET_FACES;
use viscera::scalar::Vec3;

use super::bodies::Body;
use super::{Element, Load, Loaded};
use viscera_reference::problem::{Problem, TetElements};
use viscera_reference::tissue::pressure;

/// Of a body at rest under a load.
pub fn roughness(body: &Body, element: Element, load: Load, poisson: f64) -> Result<f64> {
    let mut loaded = Loaded::new(body, element, poisson)?;
    let x = loaded.settle(load, None)?;
    let mesh = &body.mesh;
    let volumes: Vec<f64> = (0..mesh.tets().len()).map(|t| tet_volume(mesh.corners(t))).collect();
    let pressures = pressures(loaded.reference.problem(), &volumes, &x);
    let mean = pressures.iter().zip(&volumes).map(|(p, volume)| p.abs() * volume).sum::<f64>()
        / volumes.iter().sum::<f64>();
    let mut faces: Vec<([u32; 3], usize)> = Vec::with_capacity(4 * mesh.tets().len());
    for (t, tet) in mesh.tets().iter().enumerate() {
        for face in TET_FACES {
            let mut key = face.map(|corner| tet[corner]);
            key.sort_unstable();
            faces.push((key, t));
        }
    }
    faces.sort_unstable();
    let (mut squares, mut areas) = (0.0, 0.0);
    for pair in faces.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        let [a, b, c] = pair[0].0.map(|v| mesh.vertices()[v as usize]);
        let area = 0.5 * (b - a).cross(c - a).length();
        squares += area * (pressures[pair[0].1] - pressures[pair[1].1]).powi(2);
        areas += area;
    }
    Ok((squares / areas).sqrt() / mean)
}

/// Of each tetrahedron [Pa]: the mean of its points, or of recovered-gradient ones what the tetrahedron, its domains and
/// its clusters say.
fn pressures(problem: &Problem, volumes: &[f64], x: &[Vec3<f64>]) -> Vec<f64> {
    if !problem.recovered.nodes.is_empty() {
        return problem.recovered.pressures_at(x, volumes);
    }
    match problem.quadratic.nodes.is_empty() {
        true => of_points(problem, &problem.linear, x),
        false => of_points(problem, &problem.quadratic, x),
    }
}

fn of_points<const N: usize>(
    problem: &Problem,
    elements: &TetElements<N>,
    x: &[Vec3<f64>],
) -> Vec<f64> {
    let per_tet = elements.points_per_tet;
    let of_tet = |t: usize| {
        let tissue = &problem.tissues[elements.tissue[t] as usize];
        let points = t * per_tet..(t + 1) * per_tet;
        let of_point = |point: usize| {
            let f = elements.deformation_gradient(point, x);
            pressure(&tissue.piola(&f, None), &f)
        };
        points.map(of_point).sum::<f64>() / per_tet as f64
    };
    (0..elements.nodes.len()).map(of_tet).collect()
}
