//! An embedded surface follows its tetrahedra.

use viscera::mesh::embed::{Embedding, EmbeddingError, closest_point_on_triangle};
use viscera::mesh::shapes::{Block, sphere};
use viscera::mesh::{SurfaceMesh, TetMesh};
use viscera::scalar::{Mat3, Vec3, vec3};

fn jittered_block() -> TetMesh {
    let mut block = Block::new(vec3(1.0, 0.8, 0.6), [5, 4, 3]);
    (block.jitter, block.seed) = (0.8, 7);
    block.mesh().unwrap()
}

fn points(vertices: Vec<Vec3<f64>>) -> SurfaceMesh {
    SurfaceMesh { vertices, triangles: Vec::new() }
}

/// A grid of points from `low` to `high` along each axis.
fn grid(low: f64, high: f64, count: usize) -> Vec<Vec3<f64>> {
    let at = |i: usize| low + (high - low) * i as f64 / (count - 1) as f64;
    (0..count.pow(3))
        .map(|n| vec3(at(n % count), at(n / count % count), at(n / count / count)))
        .collect()
}

#[test]
fn affine_motions_are_reproduced_to_round_off() {
    let mesh = jittered_block();
    // Half of these points lie outside, up to 0.7 m away.
    let surface = points(grid(-0.3, 1.3, 17));
    let embedding = Embedding::new(&mesh, &surface).unwrap();
    let matrix =
        Mat3::from_columns(vec3(1.2, 0.3, -0.1), vec3(-0.4, 0.8, 0.2), vec3(0.1, 0.5, 1.1));
    let map = |x: Vec3<f64>| matrix * x + vec3(5.0, -3.0, 2.0);
    let moved: Vec<_> = mesh.vertices().iter().map(|&x| map(x)).collect();
    let mut found = vec![Vec3::ZERO; surface.vertices.len()];
    embedding.apply(&moved, &mut found).unwrap();
    for ((&x, &y), weights) in surface.vertices.iter().zip(&found).zip(embedding.weights()) {
        // Round-off of four products of weights and positions, and of the weights themselves,
        // whose solve has a condition number of some tens on these tetrahedra.
        let scale = weights.iter().map(|w| w.abs()).sum::<f64>() * 10.0;
        let error = (y - map(x)).length();
        assert!(error < 100.0 * f64::EPSILON * scale, "{error:e} at {x:?}");
    }

    let moved: Vec<Vec3<f32>> = moved.iter().map(|x| x.cast()).collect();
    let mut found_single = vec![Vec3::<f32>::ZERO; found.len()];
    embedding.apply(&moved, &mut found_single).unwrap();
    for ((single, double), weights) in found_single.iter().zip(&found).zip(embedding.weights()) {
        let scale = weights.iter().map(|w| w.abs()).sum::<f64>() * 10.0;
        let error = (single.cast::<f64>() - *double).length();
        assert!(error < 4.0 * f64::from(f32::EPSILON) * scale, "{error:e}");
    }
}

#[test]
fn the_tetrahedron_found_is_the_nearest_of_all() {
    let mesh = jittered_block();
    let surface = points(grid(-0.31, 1.27, 9));
    let embedding = Embedding::new(&mesh, &surface).unwrap();
    for (vertex, &point) in surface.vertices.iter().enumerate() {
        let nearest = (0..mesh.tets().len())
            .map(|tet| {
                let x = mesh.corners(tet);
                let weights = viscera::mesh::embed::barycentric_weights(x, point);
                if weights.iter().all(|&w| w >= 0.0) {
                    return 0.0;
                }
                [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]
                    .map(|f| (closest_point_on_triangle(f.map(|i| x[i]), point) - point).length())
                    .into_iter()
                    .fold(f64::INFINITY, f64::min)
            })
            .fold(f64::INFINITY, f64::min);
        // The tree treats distances within 1e-12 of the mesh's size as equal.
        let error = (embedding.distances()[vertex] - nearest).abs();
        assert!(error < 4e-12, "{error:e} at {point:?}");
    }
}

#[test]
fn a_point_inside_has_weights_between_zero_and_one() {
    let mesh = jittered_block();
    let surface = points(grid(0.01, 0.59, 12));
    let embedding = Embedding::new(&mesh, &surface).unwrap();
    assert_eq!(embedding.outside_count(), 0);
    for weights in embedding.weights() {
        assert!(weights.iter().all(|w| (-1e-12..=1.0 + 1e-12).contains(w)), "{weights:?}");
    }
}

#[test]
fn points_outside_report_how_far() {
    let mesh = Block::new(vec3(1.0, 1.0, 1.0), [3, 3, 3]).mesh().unwrap();
    let outside = vec![
        vec3(0.5, 0.5, 1.25),
        vec3(-0.3, -0.4, 0.5),
        vec3(1.0 + 2.0, 1.0 + 3.0, 1.0 + 6.0),
        vec3(0.5, 0.5, 0.5),
    ];
    let embedding = Embedding::new(&mesh, &points(outside)).unwrap();
    let expected = [0.25, 0.5, 7.0, 0.0];
    for (found, expected) in embedding.distances().iter().zip(expected) {
        assert!((found - expected).abs() < 1e-14 * 10.0, "{found} for {expected}");
    }
    assert_eq!(embedding.outside_count(), 3);
    assert_eq!(embedding.max_distance(), embedding.distances()[2]);
}

#[test]
fn a_fine_sphere_sticks_out_of_its_coarse_tetrahedra_by_less_than_the_sagitta() {
    let ball = sphere(0.05, 0.02).unwrap();
    let embedding = Embedding::new(&ball.tets, &ball.surface).unwrap();
    // Coarse edges are at most 1.5 spacings long after warping; a chord that long falls short of
    // the sphere by edge^2 / 8 r, and a triangle's centre by 4/3 of that.
    let sagitta = (1.5_f64 * 0.02).powi(2) / (8.0 * 0.05) * 4.0 / 3.0;
    assert!(embedding.max_distance() < sagitta, "{} m", embedding.max_distance());
    assert!(embedding.outside_count() > ball.surface.vertices.len() / 2);
}

#[test]
fn impossible_bindings_are_errors() {
    let mesh = jittered_block();
    let empty = TetMesh::default();
    assert_eq!(Embedding::new(&empty, &points(vec![])), Err(EmbeddingError::NoTets));
    let bad = points(vec![Vec3::ZERO, vec3(f64::NAN, 0.0, 0.0)]);
    assert_eq!(Embedding::new(&mesh, &bad), Err(EmbeddingError::NotFinite { vertex: 1 }));
    let embedding = Embedding::new(&mesh, &points(vec![Vec3::ZERO])).unwrap();
    let mut one = [Vec3::<f64>::ZERO];
    let error = embedding.apply(&[], &mut one).unwrap_err();
    assert_eq!(error.to_string(), "0 tetrahedron vertices; the embedding was made for 120");
}

/// Throwaway readers: vertices and tetrahedra of a version 1 Gmsh file, vertices of an OBJ file.
#[test]
fn a_real_liver_surface_embeds_in_its_coarse_mesh() {
    let Some(folder) = crate::common::data::data_folder() else { return };
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
    let text = read("liver_coarse.msh");
    let (mut vertices, mut tets, mut number) = (Vec::new(), Vec::new(), Vec::new());
    for line in text.lines() {
        let words: Vec<f64> = line.split_whitespace().map_while(|w| w.parse().ok()).collect();
        if let [id, x, y, z] = words[..] {
            number.push(id as u32);
            vertices.push(vec3(x, y, z));
        } else if words.len() == 9 && words[1] == 4.0 {
            let index = |w: f64| number.iter().position(|&n| n == w as u32).unwrap() as u32;
            tets.push([words[5], words[6], words[7], words[8]].map(index));
        }
    }
    assert_eq!((vertices.len(), tets.len()), (181, 596));
    let regions = vec![0; tets.len()];
    let (mesh, _) = TetMesh::new(vertices, tets, regions).unwrap();
    let coordinates = |line: &str| {
        let words: Vec<f64> =
            line.split_whitespace().skip(1).map_while(|w| w.parse().ok()).collect();
        vec3(words[0], words[1], words[2])
    };
    let surface = points(
        read("liver_surface.obj")
            .lines()
            .filter(|l| l.starts_with("v "))
            .map(coordinates)
            .collect(),
    );
    assert_eq!(surface.vertices.len(), 2194);
    let embedding = Embedding::new(&mesh, &surface).unwrap();
    let weight = embedding.weights().iter().flatten().fold(0.0_f64, |max, w| max.max(w.abs()));
    println!(
        "{} of {} vertices outside, by at most {:.4} units (1 unit is 32 mm); largest weight {weight:.2}",
        embedding.outside_count(),
        surface.vertices.len(),
        embedding.max_distance()
    );
    let mut rest = surface.vertices.clone();
    embedding.apply(mesh.vertices(), &mut rest).unwrap();
    for (found, expected) in rest.iter().zip(&surface.vertices) {
        assert!((*found - *expected).length() < 1e-12 * 10.0);
    }
}
