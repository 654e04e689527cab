//! Damaged meshes are mended: what comes back is the mesh from before the damage, or a better one of the same shape.

use viscera::mesh::io::{MendedFile, MeshFile, MeshNames, Patch, obj, vtu};
use viscera::mesh::mend::{Mended, mend, mend_surface};
use viscera::mesh::quality::{dihedral_angles, summarize_quality};
use viscera::mesh::shapes::block;
use viscera::mesh::topology::{connected_components, count_folded_faces, count_open_edges};
use viscera::mesh::verdict::Problem;
use viscera::mesh::{SurfaceMesh, TetMesh, boundary_surface, inspect, inspect_surface};
use viscera::scalar::{Vec3, vec3};

const SIZE: Vec3<f64> = vec3(0.04, 0.03, 0.02);

fn cube() -> TetMesh {
    block(SIZE, [4, 3, 2]).expect("a block")
}

/// Whether a place is not on the boundary of the block.
fn inside(x: &Vec3<f64>) -> bool {
    let (x, size) = (x.to_array(), SIZE.to_array());
    (0..3).all(|axis| x[axis] > 1e-9 && x[axis] < size[axis] - 1e-9)
}

/// The numbers of a mesh, to be damaged.
fn numbers(mesh: &TetMesh) -> (Vec<Vec3<f64>>, Vec<[u32; 4]>, Vec<u32>) {
    (mesh.vertices().to_vec(), mesh.tets().to_vec(), mesh.regions().to_vec())
}

fn mended((vertices, tets, regions): &(Vec<Vec3<f64>>, Vec<[u32; 4]>, Vec<u32>)) -> Mended {
    mend(vertices, tets, regions, None).unwrap_or_else(|error| panic!("{error}"))
}

/// Tetrahedra by their places, whatever numbers vertices have and however they are wound.
fn by_place(mesh: &TetMesh) -> Vec<Vec<[i64; 3]>> {
    let place = |v: &u32| mesh.vertices()[*v as usize].to_array().map(|x| (x * 1e6).round() as i64);
    let corners = |tet: &[u32; 4]| {
        let mut corners: Vec<[i64; 3]> = tet.iter().map(place).collect();
        corners.sort_unstable();
        corners
    };
    let mut all: Vec<Vec<[i64; 3]>> = mesh.tets().iter().map(corners).collect();
    all.sort_unstable();
    all
}

#[test]
fn what_is_whole_stays_as_it_is() {
    let mesh = cube();
    let after = mended(&numbers(&mesh));
    assert_eq!(after.mesh, mesh);
    assert!(after.mending.texts().is_empty(), "{:?}", after.mending);
    let same: Vec<Option<u32>> = (0..mesh.vertices().len() as u32).map(Some).collect();
    assert_eq!(after.vertices, same);
}

#[test]
fn tetrahedra_with_vertices_of_their_own_become_one_body() {
    let mesh = cube();
    // Off by what single precision rounds.
    let corner = |(n, v): (usize, &u32)| {
        mesh.vertices()[*v as usize] * (1.0 + 3e-10 * (n * 37 % 101) as f64)
    };
    let vertices: Vec<Vec3<f64>> = mesh.tets().iter().flatten().enumerate().map(corner).collect();
    let tets: Vec<[u32; 4]> =
        (0..mesh.tets().len() as u32).map(|t| [0, 1, 2, 3].map(|c| 4 * t + c)).collect();
    let after = mended(&(vertices.clone(), tets.clone(), mesh.regions().to_vec()));
    assert_eq!(connected_components(&after.mesh).count, 1);
    assert!(by_place(&after.mesh) == by_place(&mesh));
    assert_eq!(after.mending.merged_vertices, 4 * mesh.tets().len() - mesh.vertices().len());
    // Not where they are to stay apart.
    let apart = mend(&vertices, &tets, mesh.regions(), Some(1e-15)).expect("a mesh");
    assert!(connected_components(&apart.mesh).count > 1);
    // Names go with their vertices.
    let wall: Vec<u32> =
        (0..vertices.len() as u32).filter(|&v| vertices[v as usize].x < 1e-9).collect();
    let patches = vec![Patch { name: "wall".into(), vertices: wall }];
    let mut names = MeshNames { patches, regions: Vec::new() };
    names.follow(&after);
    let at: Vec<f64> =
        names.patches[0].vertices.iter().map(|&v| after.mesh.vertices()[v as usize].x).collect();
    assert_eq!(at, vec![0.0; 4 * 3]);
}

#[test]
fn what_is_no_tetrahedron_is_left_out() {
    let mesh = cube();
    let mut damaged = numbers(&mesh);
    let count = damaged.0.len() as u32;
    let first = damaged.1[0];
    let [a, b, c, _] = first;
    damaged.0.push(vec3(f64::NAN, 0.0, 0.0));
    damaged.0.push(vec3(0.01, 0.01, 0.05));
    damaged.1.extend([[a, b, c, count + 7], [a, b, c, count], [a, a, b, c]]);
    // Once more, in another order; and a third one on an inner face.
    damaged.1.push([first[2], first[0], first[3], first[1]]);
    let folded = mesh.tets().iter().position(|tet| {
        let is_face = |tet: &[u32; 4]| [a, b, c].iter().filter(|v| tet.contains(v)).count();
        is_face(tet) == 3 && *tet != first
    });
    assert!(folded.is_some(), "the face is inside");
    damaged.1.push([a, b, c, count + 1]);
    damaged.2.resize(damaged.1.len(), 0);
    let after = mended(&damaged);
    let mending = after.mending;
    let found =
        [mending.broken_tets, mending.repeated_tets, mending.crowded_tets, mending.unused_vertices];
    assert_eq!(found, [3, 1, 1, 2], "{mending:?}");
    assert!(by_place(&after.mesh) == by_place(&mesh));
    assert_eq!(mending.texts().len(), 4, "{:?}", mending.texts());
    assert!(mend(&damaged.0, &[[a, a, b, c]], &[0], None).is_err());
}

#[test]
fn tetrahedra_are_wound_alike() {
    let mesh = cube();
    let mut damaged = numbers(&mesh);
    damaged.1.iter_mut().step_by(3).for_each(|tet| tet.swap(0, 1));
    let after = mended(&damaged);
    assert_eq!(after.mending.rewound_tets, mesh.tets().len().div_ceil(3));
    assert!(by_place(&after.mesh) == by_place(&mesh));
    damaged = numbers(&mesh);
    damaged.1.iter_mut().for_each(|tet| tet.swap(0, 1));
    assert_eq!(mended(&damaged).mending.rewound_tets, mesh.tets().len());
}

/// A vertex inside that was pulled out of the star of its neighbours: tetrahedra are inside out, which no rewinding mends.
#[test]
fn what_is_inside_out_gets_a_volume_again() {
    let mesh = cube();
    let (mut vertices, tets, regions) = numbers(&mesh);
    let v = vertices.iter().position(inside).expect("a vertex inside");
    vertices[v] += vec3(0.0, 0.0, 0.03);
    let (tangled, _) =
        TetMesh::new(vertices.clone(), tets.clone(), regions.clone()).expect("a mesh");
    assert!(count_folded_faces(&tangled) > 0);
    assert!(matches!(inspect(&tangled, &Default::default()).problems()[0], Problem::Folded { .. }));
    let after = mended(&(vertices, tets, regions));
    assert_eq!(count_folded_faces(&after.mesh), 0);
    assert!(after.mending.unfolded_tets > 0 && after.mending.flat_tets == 0, "{:?}", after.mending);
    assert_eq!(after.mending.moved_vertices, 1);
    // Its boundary is where it was, and so is the sum of volumes.
    assert!((after.mesh.volume() / mesh.volume() - 1.0).abs() < 1e-12);
    let least = summarize_quality(&after.mesh).min_dihedral.to_degrees();
    assert!(least > 11.0, "{least}");
    assert!(inspect(&after.mesh, &Default::default()).problems().is_empty());
}

/// A flat tetrahedron over two triangles of the boundary, and one that would leave four faces at an edge.
#[test]
fn slivers_are_taken_off_the_boundary() {
    let mesh = cube();
    let (vertices, mut tets, mut regions) = numbers(&mesh);
    let skin = boundary_surface(&mesh);
    let global = |v: u32| skin.mesh_vertices[v as usize];
    let triangles: Vec<[u32; 3]> = skin.surface.triangles.iter().map(|t| t.map(global)).collect();
    // Two triangles of the top, which is flat: a lid on both has no volume.
    let is_top = |t: &&[u32; 3]| t.iter().all(|&v| vertices[v as usize].z > SIZE.z - 1e-9);
    let top: Vec<&[u32; 3]> = triangles.iter().filter(is_top).collect();
    let pair = top.iter().enumerate().find_map(|(i, a)| {
        let other = top[..i].iter().find(|b| a.iter().filter(|v| b.contains(v)).count() == 2)?;
        let far = other.iter().find(|v| !a.contains(v))?;
        Some([a[0], a[1], a[2], *far])
    });
    let lid = pair.expect("two triangles with a common edge");
    tets.push(lid);
    regions.push(0);
    assert!(TetMesh::new(vertices.clone(), tets.clone(), regions.clone()).is_err());
    let after = mended(&(vertices, tets, regions));
    assert_eq!((after.mending.peeled_tets, after.mending.flat_tets), (1, 0));
    assert!(by_place(&after.mesh) == by_place(&mesh));
}

/// Nothing is inside out, but a vertex nearly lies in a face of the tetrahedra around it.
#[test]
fn small_angles_become_larger() {
    let mesh = cube();
    let (mut vertices, tets, regions) = numbers(&mesh);
    let v = vertices.iter().position(inside).expect("a vertex inside");
    let around = tets.iter().find(|tet| tet.contains(&(v as u32))).expect("a tetrahedron");
    let face = around.iter().filter(|&&w| w as usize != v).map(|&w| vertices[w as usize]);
    let middle = face.fold(Vec3::ZERO, |sum, x| sum + x) * (1.0 / 3.0);
    vertices[v] = vertices[v] * 0.03 + middle * 0.97;
    let (poor, _) = TetMesh::new(vertices.clone(), tets.clone(), regions.clone()).expect("a mesh");
    let problems = inspect(&poor, &Default::default()).problems();
    let all = (0..poor.tets().len()).flat_map(|tet| dihedral_angles(poor.corners(tet)));
    let is_poor = |angle: &f64| !(5.0..175.0).contains(&angle.to_degrees());
    let angles = all.filter(is_poor).count();
    let share = angles as f64 / (6 * poor.tets().len()) as f64;
    assert!(angles > 0 && problems == [Problem::Slivers { angles, share }], "{problems:?}");
    let after = mended(&(vertices, tets, regions));
    assert_eq!((after.mending.moved_vertices, after.mending.unfolded_tets), (1, 0));
    let least = summarize_quality(&after.mesh).min_dihedral.to_degrees();
    assert!(least > 11.0, "{least}");
    assert!((after.mesh.volume() / mesh.volume() - 1.0).abs() < 1e-12);
}

/// Without the sliver between them two tetrahedra would hang together by an edge.
#[test]
fn slivers_stay_where_the_body_would_come_apart() {
    let vertices = vec![
        vec3(-0.01, 0.0, 0.0),
        vec3(0.01, 0.0, 0.0),
        vec3(0.0, -0.01, 2e-4),
        vec3(0.0, 0.01, 2e-4),
        vec3(-0.01, 0.0, 0.01),
        vec3(0.01, 0.0, 0.01),
    ];
    let tets = vec![[0, 1, 2, 3], [0, 2, 3, 4], [1, 2, 3, 5]];
    let (mesh, _) = TetMesh::new(vertices, tets, vec![0; 3]).expect("a mesh");
    let after = mended(&numbers(&mesh));
    assert_eq!((after.mending.peeled_tets, after.mesh.tets().len()), (0, 3));
}

#[test]
fn a_soup_of_triangles_becomes_a_closed_surface() {
    let skin = boundary_surface(&cube()).surface;
    let vertices: Vec<Vec3<f64>> =
        skin.triangles.iter().flatten().map(|&v| skin.vertices[v as usize]).collect();
    let mut triangles: Vec<[u32; 3]> =
        (0..skin.triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    triangles.iter_mut().step_by(4).for_each(|t| t.swap(0, 1));
    let rewound = triangles.len().div_ceil(4);
    triangles.push([1, 0, 2]);
    triangles.push([0, 0, 1]);
    triangles.push([0, 1, 9999]);
    let soup = SurfaceMesh { vertices, triangles };
    let (after, mending) = mend_surface(&soup, None).expect("a surface");
    assert_eq!(
        (after.vertices.len(), after.triangles.len()),
        (skin.vertices.len(), skin.triangles.len())
    );
    assert_eq!(count_open_edges(&after), 0);
    assert!((after.enclosed_volume() / (SIZE.x * SIZE.y * SIZE.z) - 1.0).abs() < 1e-12);
    let found = [mending.broken_triangles, mending.repeated_triangles, mending.rewound_triangles];
    assert_eq!(found, [2, 1, rewound]);
    assert_eq!(mending.merged_vertices, soup.vertices.len() - skin.vertices.len());
    // All inwards.
    let mut inwards = skin.clone();
    inwards.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    assert_eq!(
        mend_surface(&inwards, None).expect("a surface").1.rewound_triangles,
        skin.triangles.len()
    );
    let mut open = skin;
    open.triangles.pop();
    let problems = inspect_surface(&open, &Default::default()).problems();
    assert_eq!(problems, vec![Problem::Open { edges: 3 }]);
}

/// A wall around a cavity, of which both surfaces are wound as they should be.
#[test]
fn cavities_stay_cavities() {
    let outer = boundary_surface(&cube()).surface;
    let count = outer.vertices.len() as u32;
    let inner = outer.vertices.iter().map(|x| *x * 0.5 + SIZE * 0.25);
    let vertices = outer.vertices.iter().copied().chain(inner).collect();
    let inner = outer.triangles.iter().map(|&[a, b, c]| [a, c, b].map(|v| v + count));
    let triangles = outer.triangles.iter().copied().chain(inner).collect();
    let wall = SurfaceMesh { vertices, triangles };
    let (after, mending) = mend_surface(&wall, None).expect("a surface");
    assert_eq!(mending.texts(), Vec::<String>::new());
    assert!((after.enclosed_volume() / (SIZE.x * SIZE.y * SIZE.z * 0.875) - 1.0).abs() < 1e-12);
}

#[test]
fn files_are_mended_with_their_names() {
    let mesh = cube();
    let patches = vec![Patch { name: "wall".into(), vertices: vec![0, 1, 2] }];
    let names = MeshNames { patches, regions: Vec::new() };
    let bytes = vtu::write_mesh(&mesh, &names).expect("a file");
    let file = |name: &str, bytes: Vec<u8>| MeshFile { name: name.into(), bytes, beside: None };
    let Ok(MendedFile::Tets(after, found)) = file("a.vtu", bytes).mended(1e-3, None) else {
        panic!("tetrahedra");
    };
    assert_eq!(found, names);
    assert!((after.mesh.volume() / mesh.volume() / 1e-9 - 1.0).abs() < 1e-6);
    let text = obj::write(&boundary_surface(&mesh).surface, None).expect("text");
    let Ok(MendedFile::Surface(surface, _)) = file("a.obj", text.into_bytes()).mended(1.0, None)
    else {
        panic!("a surface");
    };
    assert_eq!(count_open_edges(&surface), 0);
    assert!(file("a.obj", b"v 0 0 0\n".to_vec()).mended(1.0, None).is_err());
}
