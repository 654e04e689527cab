//! Meshes and surfaces as scenes.

use viscera::mesh::distance::{SignedDistance, Sphere};
use viscera::mesh::io::{MeshNames, Patch, gmsh, obj, vtk, vtu};
use viscera::mesh::shapes::block;
use viscera::mesh::tetrahedralize::{surface, tetrahedralize};
use viscera::mesh::topology::count_open_edges;
use viscera::mesh::{SurfaceMesh, TetMesh, boundary_surface};
use viscera::scalar::{Vec3, vec3};
use viscera::scene::Scene;
use viscera::simulation::Assembly;
use viscera_import::{Import, Options, Place, open, parts};

const RADIUS: f64 = 50.0;

/// A torus, by its distance: the tube's middle is a circle of 40 mm, the tube has 15 mm.
struct Torus;

impl SignedDistance for Torus {
    fn distance(&self, x: Vec3<f64>) -> f64 {
        let out = (x.x * x.x + x.y * x.y).sqrt() - 40.0;
        (out * out + x.z * x.z).sqrt() - 15.0
    }
    fn bounds(&self) -> (Vec3<f64>, Vec3<f64>) {
        (vec3(-55.0, -55.0, -15.0), vec3(55.0, 55.0, 15.0))
    }
}

fn import(name: &str, bytes: Vec<u8>, options: &Options) -> Import {
    let found = open(name, |_| Ok(bytes.clone())).unwrap_or_else(|error| panic!("{error}"));
    parts(name, found, options, &mut |_| ()).unwrap_or_else(|error| panic!("{error}"))
}

fn file(surface: &SurfaceMesh) -> Vec<u8> {
    obj::write(surface, None).expect("a surface").into_bytes()
}

/// Without one triangle of twenty.
fn holed(mut surface: SurfaceMesh) -> SurfaceMesh {
    let mut number = 0u32;
    surface.triangles.retain(|_| {
        number += 1;
        (f64::from(number) * 0.618034) % 1.0 > 0.05
    });
    surface
}

#[test]
fn surfaces_with_holes_are_closed_with_their_volume() {
    let ball = Sphere { center: Vec3::ZERO, radius: RADIUS };
    let pi = std::f64::consts::PI;
    let shapes: [(&dyn SignedDistance, f64); 2] =
        [(&ball, 4.0 / 3.0 * pi * RADIUS.powi(3)), (&Torus, 2.0 * pi * pi * 40.0 * 15.0 * 15.0)];
    for (shape, volume) in shapes {
        let whole = surface(shape, 4.0).expect("a surface");
        for part in [whole.clone(), holed(whole)] {
            let is_holed = count_open_edges(&part) > 0;
            let made = import("part.obj", file(&part), &Options::default());
            let body = &made.parts[0];
            let ratio = body.mesh.volume() / (volume * 1e-9);
            assert!((ratio - 1.0).abs() < 0.02, "{ratio}, holes: {is_holed}");
            assert_eq!(count_open_edges(&boundary_surface(&body.mesh).surface), 0);
            assert!(made.notes[0].contains("1 mm"), "{:?}", made.notes);
        }
    }
}

#[test]
fn a_mesh_is_scaled_as_its_name_and_size_suggest() {
    let ball = Sphere { center: Vec3::ZERO, radius: 2.0 };
    let (mesh, _) = tetrahedralize(&ball, 0.5).expect("a ball");
    let made = import("my liver.msh", gmsh::write(&mesh).into_bytes(), &Options::default());
    let body = &made.parts[0];
    assert_eq!(body.name, "my_liver");
    assert_eq!(body.tissue.preset, Some("liver"));
    // An adult's, to the two digits of the unit: 3 times 1.5 %.
    assert!((body.mesh.volume() / 1.5e-3 - 1.0).abs() < 0.05, "{}", body.mesh.volume());
    assert!(made.notes[0].contains("no liver"), "{:?}", made.notes);
    let unit = Some(0.03);
    let made = import(
        "my liver.msh",
        gmsh::write(&mesh).into_bytes(),
        &Options { unit, ..Options::default() },
    );
    assert!((made.parts[0].mesh.volume() / mesh.volume() / 0.03f64.powi(3) - 1.0).abs() < 1e-12);
    assert!(made.warnings.is_empty(), "{:?}", made.warnings);
    // One that makes no liver of it is taken, and doubted.
    let options = Options { unit: Some(1.0), ..Options::default() };
    let made = import("my liver.msh", gmsh::write(&mesh).into_bytes(), &options);
    let [told] = &made.warnings[..] else { panic!("{:?}", made.warnings) };
    assert!(told.contains("an adult's liver has 1.50 l; with --unit \"36 mm\""), "{told}");
}

#[test]
fn an_open_sheet_is_refused() {
    let sheet = SurfaceMesh {
        vertices: vec![vec3(0.0, 0.0, 0.0), vec3(90.0, 0.0, 0.0), vec3(0.0, 90.0, 0.0)],
        triangles: vec![[0, 1, 2]],
    };
    let found = open("sheet.obj", |_| Ok(file(&sheet))).expect("a surface");
    let error = parts("sheet.obj", found, &Options::default(), &mut |_| ()).err().expect("open");
    assert!(error.to_string().starts_with("sheet.obj: "), "{error}");
}

/// Named patches come along, and a person sees how to use them.
#[test]
fn patches_of_a_mesh_are_kept_and_shown() {
    let ball = Sphere { center: Vec3::ZERO, radius: 0.05 };
    let (mesh, _) = tetrahedralize(&ball, 0.02).expect("a ball");
    let low = (0u32..).zip(mesh.vertices()).filter(|(_, x)| x.z < -0.03).map(|(v, _)| v).collect();
    let patches = vec![Patch { name: "the \"wall\"".into(), vertices: low }];
    let names = MeshNames { patches, regions: vec![(0, "all".into())] };
    let bytes = vtk::write(&mesh, &names).expect("a file");
    let made = import("ball.vtk", bytes, &Options { unit: Some(1.0), ..Options::default() });
    assert_eq!(made.parts[0].names, names);
    let written = made.scene("ball").files;
    let text = std::str::from_utf8(&written[0].1).expect("text");
    let lines = "# [[fixing]]\n# body = \"ball\"\n# patch = \"the \\\"wall\\\"\"\n";
    assert!(text.contains(lines), "{text}");
    let on = text.replace(lines, &lines.replace("# ", ""));
    let scene = Scene::parse("scene.toml", &on, &[]).unwrap_or_else(|error| panic!("{error}"));
    let load = &mut |name: &str| {
        let file = written.iter().find(|(known, _)| known == name).expect("a file");
        Ok(file.1.clone())
    };
    let assembly = Assembly::new(&scene, load).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(assembly.fixings[1].vertices, names.patches[0].vertices);
    assert_eq!(assembly.bodies[0].names, names);
    // Beside it a picture of its angles.
    let (_, svg) = written.iter().find(|(name, _)| name == "ball_angles.svg").expect("a picture");
    let svg = std::str::from_utf8(svg).expect("text");
    assert!(
        svg.contains("<svg") && svg.contains("dihedral angle") && svg.contains(">\nball\n<"),
        "{svg}"
    );
}

/// Two balls apart, one with a lump of another region that has a name, one without.
#[test]
fn every_part_is_held_and_regions_with_names_are_kept() {
    let ball = |x: f64, z: f64| {
        let ball = Sphere { center: vec3(x, 0.0, z), radius: 0.03 };
        tetrahedralize(&ball, 0.01).expect("a ball").0
    };
    let (low, high) = (ball(0.0, 0.0), ball(0.1, 0.2));
    let first = low.vertices().len() as u32;
    let vertices = [low.vertices(), high.vertices()].concat();
    let mut tets = low.tets().to_vec();
    tets.extend(high.tets().iter().map(|tet| tet.map(|v| v + first)));
    let middle = |tet: &[u32; 4]| {
        tet.iter().map(|&v| vertices[v as usize]).fold(Vec3::ZERO, |sum, x| sum + x) * 0.25
    };
    let region = |tet: &[u32; 4]| match middle(tet) {
        x if x.length() < 0.015 => 7,
        x if (x - vec3(0.1, 0.0, 0.2)).length() < 0.015 => 8,
        _ => 3,
    };
    let regions = tets.iter().map(region).collect();
    let (mesh, _) = TetMesh::new(vertices, tets, regions).expect("a mesh");
    let regions = vec![(3, "liver".to_owned()), (7, "Tumor".to_owned())];
    let names = MeshNames { regions, ..MeshNames::default() };
    let bytes = gmsh::write_binary(&mesh, &names).expect("a file");
    let made = import("organs.msh", bytes, &Options { unit: Some(1.0), ..Options::default() });
    let part = &made.parts[0];
    assert_eq!(part.inner.len(), 1);
    assert_eq!((part.inner[0].region, part.inner[0].name.as_str()), (7, "tumor"));
    assert!(made.notes.iter().any(|note| note.contains("label 8")), "{:?}", made.notes);
    assert_eq!(part.holds.len(), 2);
    for (hold, [x, z]) in part.holds.iter().zip([[0.0, 0.0], [0.1, 0.2]]) {
        let Place::Within(bounds) = &hold.place else { panic!("{hold:?}") };
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
        assert!(near(bounds.center().x, x) && near(bounds.min.z, z - 0.03), "{hold:?}");
        // The lowest 15 % of 60 mm.
        assert!(near(bounds.size().z, 0.009), "{hold:?}");
    }
}

/// Plates of 160 x 120 mm: what is too thin for the edges of 20,000 tetrahedra is refused with edges that fill it.
#[test]
fn thin_plates_keep_their_volume_or_are_told_how() {
    let plate = |z: f64| {
        let corner = |n: usize| {
            let far = |axis: usize| f64::from((n >> axis & 1) as u8);
            vec3(160.0 * far(0), 120.0 * far(1), z * far(2))
        };
        let sides =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        file(&SurfaceMesh { vertices: (0..8).map(corner).collect(), triangles })
    };
    let shapes = Options { shapes_only: true, ..Options::default() };
    for z in [2.0, 3.0, 5.0] {
        let made = import("plate.obj", plate(z), &shapes);
        let ratio = made.parts[0].mesh.volume() / (160.0 * 120.0 * z * 1e-9);
        assert_eq!((ratio - 1.0).abs() > 0.02, !made.warnings.is_empty(), "{z}: {ratio}");
        assert!((ratio - 1.0).abs() < 0.02, "{z}: {ratio}");
    }
    let found = open("plate.obj", |_| Ok(plate(1.0))).expect("a surface");
    let error = parts("plate.obj", found, &shapes, &mut |_| ()).err().expect("thin");
    let text = error.to_string();
    let edge = text.split("--edge \"").nth(1).and_then(|rest| rest.split(" mm\"").next());
    let edge: f64 = edge.and_then(|edge| edge.parse().ok()).unwrap_or_else(|| panic!("{text}"));
    let fineness = Some(viscera_import::Fineness::Edge(1e-3 * edge));
    let made = import("plate.obj", plate(1.0), &Options { fineness, ..shapes });
    assert!((made.parts[0].mesh.volume() / 19.2e-6 - 1.0).abs() < 0.02);
}

/// A block of liver that stands on its end [m].
fn standing(width: f64, height: f64) -> Import {
    let cells = [2, 2, (2.0 * height / width) as usize];
    let mesh = block(vec3(width, width, height), cells).expect("a block");
    let bytes = vtu::write_mesh(&mesh, &MeshNames::default()).expect("a file");
    import("liver.vtu", bytes, &Options { unit: Some(1.0), ..Options::default() })
}

/// Of 60 mm in width it falls over above 105 mm at most (7.84 E I/(rho g A), the cube of its length, less what shear takes). Vertices
/// are held in whole layers: of these heights, 80, 97.5 and 96 mm are left.
#[test]
fn soft_tissue_is_held_by_as_much_as_it_needs() {
    for (height, share) in [(0.08, "15 %"), (0.13, "30 %"), (0.16, "45 %")] {
        let made = standing(0.06, height);
        let part = &made.parts[0];
        assert!(part.is_balanced, "{height}: {:?}", part.notes);
        let [hold] = &part.holds[..] else { panic!("{:?}", part.holds) };
        assert!(hold.reason.starts_with(&format!("the lowest {share} of it")), "{hold:?}");
        let Place::Within(bounds) = &hold.place else { panic!("{hold:?}") };
        let held: f64 = share.trim_end_matches(" %").parse().expect("a share");
        assert!((bounds.max.z - 0.01 * held * height).abs() < 1e-6, "{height}: {bounds:?}");
        assert_eq!(part.notes.len(), usize::from(share != "15 %"), "{:?}", part.notes);
        let text = String::from_utf8(made.scene("liver").files[0].1.clone()).expect("text");
        assert!(text.contains("balanced = true"), "{text}");
    }
    // A strand of 20 mm stands in no way; it sags, which is said.
    let made = standing(0.02, 0.2);
    let part = &made.parts[0];
    assert!(!part.is_balanced);
    assert!(part.holds[0].reason.starts_with("the lowest 15 %"), "{:?}", part.holds);
    let [note] = &part.notes[..] else { panic!("{:?}", part.notes) };
    assert!(note.starts_with("it sags at first: body `liver` cannot rest"), "{note}");
    let text = String::from_utf8(made.scene("liver").files[0].1.clone()).expect("text");
    assert!(!text.contains("balanced = true"), "{text}");
    assert!(Scene::parse("liver.toml", &text, &[]).is_ok());
}
