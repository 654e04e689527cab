//! Organs of few vertices, nearly all of them on the surface, against the bodies that they stand for.

use viscera::layout::Smoothing;
use viscera::mesh::TetMesh;
use viscera::mesh::io::read_tet_mesh;
use viscera::mesh::shapes;
use viscera_lab::bending::bodies::Body;
use viscera_lab::bending::truth::of_own_mesh;
use viscera_lab::bending::{Element, Load, response};

/// Recovered-gradient tetrahedra err at most half as much as linear ones, and less still where each tetrahedron is split
/// into eight.
fn check(mesh: &TetMesh, poissons: &[f64]) {
    let load = Load::SMALL[0];
    let recovered = Element::Smooth(Smoothing::RECOVERED);
    let body = Body::organ(mesh).expect("an organ");
    let fine = body.split().expect("an organ");
    for &poisson in poissons {
        let truth = of_own_mesh(&body, load, poisson).expect("a truth");
        let error = |body: &Body, element: Element| {
            response(body, element, load, poisson).expect("a state of rest") / truth.value - 1.0
        };
        let [linear, coarse] = [Element::Linear, recovered].map(|element| error(&body, element));
        let split = error(&fine, recovered);
        println!(
            "{} vertices, nu {poisson}: linear {linear:+.3}, recovered {coarse:+.3}, split {split:+.3}, \
             the truth to {:.3}",
            mesh.vertices().len(),
            truth.error
        );
        assert!(linear < 0.0 && coarse.abs() < 0.5 * linear.abs(), "{linear} {coarse}");
        assert!(split.abs() < coarse.abs() + truth.error, "{coarse} {split}");
    }
}

#[test]
fn organs_of_few_vertices_err_half_as_much() {
    check(&shapes::liver(0.06, 1.0).expect("a liver").tets, &[0.45]);
}

#[test]
#[ignore = "slow: Newton's method on thousands of quadratic tetrahedra"]
fn organs_of_few_vertices_err_half_as_much_at_length() {
    check(&shapes::liver(0.033, 1.0).expect("a liver").tets, &[0.3, 0.49]);
    let Some(folder) = crate::data::data_folder() else { return };
    let bytes = std::fs::read(folder.join("liver_coarse.msh")).expect("a mesh");
    // A unit is 32 mm.
    let mesh = read_tet_mesh("liver_coarse.msh", &bytes, 0.032).expect("a mesh").0;
    check(&mesh, &[0.3, 0.45, 0.49]);
}
