//! What may become a tetrahedral mesh, and how meshes hang together.

use viscera::mesh::io::ReadReport;
use viscera::mesh::topology::{self, BoundingBox};
use viscera::mesh::{MeshError, MeshPlace, TetMesh, boundary_surface, inspect, tet_volume};
use viscera::scalar::{Vec3, vec3};

/// A cube of edge 1 m as six tetrahedra around its diagonal.
fn cube() -> (Vec<Vec3<f64>>, Vec<[u32; 4]>) {
    let vertices =
        (0..8).map(|i| vec3(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2))).collect();
    // Each walks from corner 0 to corner 7 along the three axes in one of their six orders.
    let tets = [[1, 2, 4], [2, 4, 1], [4, 1, 2], [2, 1, 4], [1, 4, 2], [4, 2, 1]]
        .map(|[a, b, _]| [0, a, a + b, 7])
        .to_vec();
    (vertices, tets)
}

fn build(vertices: Vec<Vec3<f64>>, tets: Vec<[u32; 4]>) -> Result<TetMesh, MeshError> {
    let regions = vec![0; tets.len()];
    TetMesh::new(vertices, tets, regions).map(|(mesh, _)| mesh)
}

fn corner_tet() -> Vec<Vec3<f64>> {
    vec![vec3(0., 0., 0.), vec3(1., 0., 0.), vec3(0., 1., 0.), vec3(0., 0., 1.)]
}

#[test]
fn inverted_tets_are_rewound_and_counted() {
    let (vertices, tets) = cube();
    let (mesh, repairs) = TetMesh::new(vertices.clone(), tets, vec![0; 6]).unwrap();
    let inverted = mesh.tets().iter().map(|&[a, b, c, d]| [b, a, c, d]).collect();
    let (repaired, all) = TetMesh::new(vertices, inverted, vec![0; 6]).unwrap();
    assert_eq!(repairs.rewound_tets, 3);
    assert_eq!(all.rewound_tets, 6);
    for tet in 0..6 {
        assert!(tet_volume(repaired.corners(tet)) > 0.0);
    }
    // Six sixths, exact in binary up to the sum of six rounded terms.
    assert!((repaired.volume() - 1.0).abs() < 6.0 * f64::EPSILON);
}

#[test]
fn unused_vertices_are_removed_and_mapped() {
    let mut vertices = corner_tet();
    vertices.insert(0, vec3(9., 9., 9.));
    vertices.insert(3, vec3(8., 8., 8.));
    vertices.push(vec3(7., 7., 7.));
    let (mesh, repairs) = TetMesh::new(vertices.clone(), vec![[1, 2, 4, 5]], vec![3]).unwrap();
    assert_eq!(mesh.vertices(), corner_tet());
    assert_eq!(repairs.removed_vertices, [0, 3, 6]);
    for (given, position) in vertices.iter().enumerate() {
        match repairs.vertex_after(given as u32) {
            Some(kept) => assert_eq!(mesh.vertices()[kept as usize], *position),
            None => assert!([0, 3, 6].contains(&given)),
        }
    }
}

#[test]
fn empty_mesh_is_refused() {
    assert_eq!(build(vec![], vec![]), Err(MeshError::Empty));
}

#[test]
fn region_labels_must_match_the_tets() {
    let error = TetMesh::new(corner_tet(), vec![[0, 1, 2, 3]], vec![]).unwrap_err();
    assert_eq!(error, MeshError::RegionCount { regions: 0, tets: 1 });
}

#[test]
fn nan_coordinate_is_refused() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut vertices = corner_tet();
        vertices[2].y = bad;
        let error = build(vertices, vec![[0, 1, 2, 3]]).unwrap_err();
        assert_eq!(error, MeshError::NonFinite { vertex: 2 });
        assert_eq!(error.place(), MeshPlace::Vertex(2));
    }
}

#[test]
fn index_out_of_range_is_refused() {
    for vertex in [4, u32::MAX] {
        let error = build(corner_tet(), vec![[0, 1, 2, vertex]]).unwrap_err();
        assert_eq!(error, MeshError::IndexOutOfRange { tet: 0, vertex, vertex_count: 4 });
        assert_eq!(error.place(), MeshPlace::Tet(0));
    }
}

#[test]
fn tet_that_names_a_vertex_twice_is_refused() {
    let error = build(corner_tet(), vec![[0, 1, 2, 1]]).unwrap_err();
    assert_eq!(error, MeshError::RepeatedVertex { tet: 0, vertex: 1 });
}

#[test]
fn repeated_tet_is_refused_in_any_winding() {
    let (vertices, mut tets) = cube();
    let [a, b, c, d] = tets[4];
    tets.push([d, a, c, b]);
    let error = build(vertices, tets).unwrap_err();
    assert_eq!(error, MeshError::RepeatedTet { tet: 6, first: 4 });
}

#[test]
fn flat_is_measured_against_the_tets_own_size() {
    for size in [1e-6, 1e-3, 1.0, 1e6] {
        let with_height = |height: f64| {
            let mut vertices = corner_tet();
            vertices[3] = vec3(0.3, 0.3, height);
            build(vertices.iter().map(|&x| x * size).collect(), vec![[0, 1, 2, 3]])
        };
        // Six edges of about 1: quality is about 5 times the height.
        assert!(with_height(1e-3).is_ok());
        for height in [0.0, 1e-8, -1e-8] {
            let error = with_height(height).unwrap_err();
            assert!(matches!(error, MeshError::FlatTet { tet: 0, .. }), "{error}");
        }
    }
}

#[test]
fn lengths_that_leave_single_precision_are_refused() {
    let scaled = |size: f64| {
        build(corner_tet().iter().map(|&x| x * size).collect(), vec![[0, 1, 2, 3]]).unwrap_err()
    };
    assert!(matches!(scaled(1e10), MeshError::TooFar { vertex: 1, .. }));
    assert!(matches!(scaled(1e-10), MeshError::TooSmall { tet: 0, .. }));
    assert!(matches!(scaled(1e-200), MeshError::TooSmall { tet: 0, .. }));
    assert!(matches!(scaled(0.0), MeshError::TooSmall { tet: 0, .. }));
}

#[test]
fn face_of_three_tets_is_refused() {
    let mut vertices = corner_tet();
    vertices.push(vec3(0.2, 0.2, 2.0));
    vertices.push(vec3(0.2, 0.2, -1.0));
    let error = build(vertices, vec![[0, 1, 2, 3], [0, 1, 2, 4], [0, 1, 2, 5]]).unwrap_err();
    assert_eq!(error, MeshError::CrowdedFace { tet: 2, face: [0, 1, 2] });
}

#[test]
fn tets_on_the_same_side_of_a_face_are_reported() {
    let mut vertices = corner_tet();
    vertices.push(vec3(0.2, 0.2, 2.0));
    let mesh = build(vertices, vec![[0, 1, 2, 3], [0, 1, 2, 4]]).unwrap();
    assert_eq!(topology::count_folded_faces(&mesh), 1);
    let (vertices, tets) = cube();
    assert_eq!(topology::count_folded_faces(&build(vertices, tets).unwrap()), 0);
}

#[test]
fn boundary_encloses_the_volume_and_points_outwards() {
    let (vertices, tets) = cube();
    let mesh = build(vertices, tets).unwrap();
    let boundary = boundary_surface(&mesh);
    let surface = &boundary.surface;
    assert_eq!(surface.triangles.len(), 12);
    assert_eq!(topology::count_open_edges(surface), 0);
    assert!((surface.enclosed_volume() - mesh.volume()).abs() < 32.0 * f64::EPSILON);
    assert!((surface.area() - 6.0).abs() < 32.0 * f64::EPSILON);
    for (triangle, &tet) in surface.triangles.iter().zip(&boundary.tets) {
        let [a, b, c] = triangle.map(|v| surface.vertices[v as usize]);
        let [p, q, r, s] = mesh.corners(tet as usize);
        let center = (p + q + r + s) * 0.25;
        assert!((b - a).cross(c - a).dot(center - a) < 0.0);
    }
    for (&vertex, position) in boundary.mesh_vertices.iter().zip(&surface.vertices) {
        assert_eq!(mesh.vertices()[vertex as usize], *position);
    }
}

#[test]
fn boundary_does_not_depend_on_the_order_of_vertices_in_a_tet() {
    let (vertices, tets) = cube();
    let turned = tets.iter().map(|&[a, b, c, d]| [b, c, a, d]).collect();
    let normalized = |mesh: &TetMesh| {
        let mut triangles = boundary_surface(mesh).surface.triangles;
        for triangle in &mut triangles {
            while triangle[0] > triangle[1] || triangle[0] > triangle[2] {
                triangle.rotate_left(1);
            }
        }
        triangles.sort_unstable();
        triangles
    };
    let straight = build(vertices.clone(), tets).unwrap();
    assert_eq!(normalized(&straight), normalized(&build(vertices, turned).unwrap()));
}

#[test]
fn two_components_are_told_apart() {
    let (mut vertices, mut tets) = cube();
    let first = vertices.len() as u32;
    vertices.extend(corner_tet().iter().map(|&x| x + vec3(5.0, 0.0, 0.0)));
    tets.push([first, first + 1, first + 2, first + 3]);
    let mesh = build(vertices, tets).unwrap();
    let parts = topology::connected_components(&mesh);
    assert_eq!(parts.count, 2);
    assert_eq!(parts.labels, [0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1]);
    let summary = inspect(&mesh, &ReadReport::default());
    let sizes: Vec<_> = summary.components.iter().map(|c| (c.vertex_count, c.tet_count)).collect();
    assert_eq!(sizes, [(8, 6), (4, 1)]);
}

#[test]
fn every_vertex_knows_its_tets() {
    let (vertices, tets) = cube();
    let mesh = build(vertices, tets).unwrap();
    let lists = topology::vertex_tets(&mesh);
    for vertex in 0..mesh.vertices().len() {
        let expected: Vec<u32> = (0..mesh.tets().len() as u32)
            .filter(|&tet| mesh.tets()[tet as usize].contains(&(vertex as u32)))
            .collect();
        assert_eq!(lists.around(vertex), expected);
    }
}

#[test]
fn cube_obeys_euler() {
    let (vertices, tets) = cube();
    let mesh = build(vertices, tets).unwrap();
    let boundary_faces = boundary_surface(&mesh).surface.triangles.len();
    let faces = (4 * mesh.tets().len() + boundary_faces) / 2;
    // A ball: V - E + F - T = 1.
    let characteristic = mesh.vertices().len() as i64 - topology::edges(&mesh).len() as i64
        + faces as i64
        - mesh.tets().len() as i64;
    assert_eq!(characteristic, 1);
}

#[test]
fn bounding_box_holds_all_points_and_no_more() {
    let bounds = BoundingBox::around(&[vec3(1., -2., 3.), vec3(-1., 5., 0.), vec3(0., 0., 9.)]);
    assert_eq!(bounds, BoundingBox { min: vec3(-1., -2., 0.), max: vec3(1., 5., 9.) });
    assert_eq!(bounds.size(), vec3(2., 7., 9.));
}

#[test]
fn summary_shows_units_that_suit_an_organ_and_serializes() {
    let (vertices, tets) = cube();
    let decimeter = vertices.iter().map(|&x| x * 0.1).collect();
    let (mesh, repairs) = TetMesh::new(decimeter, tets, vec![1, 1, 1, 2, 2, 2]).unwrap();
    let summary = inspect(&mesh, &ReadReport { repairs, ..Default::default() });
    let table = summary.to_string();
    for part in ["100.0 x 100.0 x 100.0 mm", "500.0 ml", "3 tetrahedra rewound"] {
        assert!(table.contains(part), "{part} is not in\n{table}");
    }
    let json = serde_json::to_value(&summary).unwrap();
    assert_eq!(json["tet_count"], 6);
    assert_eq!(json["quality"]["worst_tet"], summary.quality.worst_tet);
    assert_eq!(json["regions"][1]["region"], 2);
}
