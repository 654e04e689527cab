//! Segmented scans as scenes.

use std::collections::BTreeMap;

use viscera::mesh::tetrahedralize::surface;
use viscera::mesh::topology::connected_components;
use viscera::mesh::winding::Solid;
use viscera::mesh::{TetMesh, quality::summarize_quality};
use viscera::scalar::{Mat3, Vec3, vec3};
use viscera::scene::Scene;
use viscera::simulation::{AssembleError, Assembly};
use viscera_import::{Fineness, Found, Import, Options, open, parts};
use viscera_volume::{Affine, LabelMap, Organ};

/// Voxels of 3 mm; two balls side by side, a lump in the first, a bone, and a crumb.
fn map() -> LabelMap {
    let dims = [40, 30, 30];
    let to_world = Affine {
        matrix: Mat3::from_columns(
            vec3(3e-3, 0.0, 0.0),
            vec3(0.0, 3e-3, 0.0),
            vec3(0.0, 0.0, 3e-3),
        ),
        translation: Vec3::ZERO,
    };
    let mut labels = Vec::new();
    for z in 0..30 {
        for y in 0..30 {
            for x in 0..40 {
                let at = vec3(f64::from(x), f64::from(y), f64::from(z)) * 3e-3;
                let near = |c: [f64; 3], r: f64| (at - vec3(c[0], c[1], c[2])).length() < r;
                labels.push(match () {
                    () if near([0.036, 0.042, 0.045], 0.008) => 9,
                    () if near([0.036, 0.042, 0.045], 0.026) => 5,
                    () if near([0.086, 0.042, 0.045], 0.024) => 1,
                    () if x > 36 && y > 26 => 30,
                    _ => 0,
                });
            }
        }
    }
    let names = [(5, "liver"), (9, "liver_tumor"), (1, "spleen"), (30, "rib_left_1")];
    let names: BTreeMap<u16, String> = names.map(|(l, name)| (l, name.to_owned())).into();
    LabelMap::new(dims, labels, to_world, names).expect("a map")
}

fn report() -> viscera_volume::VolumeReport {
    let text =
        "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 1 1 1\nencoding: text\nspacings: 1 1 1\n\n1";
    viscera_volume::read("a.nrrd", text.as_bytes(), viscera_volume::Limits::default())
        .expect("a map")
        .1
}

fn made(options: &Options) -> Import {
    let found = Found::Labels(map(), report());
    parts("scan.nii.gz", found, options, &mut |_| ()).unwrap_or_else(|error| panic!("{error}"))
}

fn coarse() -> Options {
    Options { fineness: Some(Fineness::Edge(0.009)), ..Options::default() }
}

fn volume_of(mesh: &TetMesh, region: u32) -> f64 {
    let of = (0..mesh.tets().len()).filter(|&tet| mesh.regions()[tet] == region);
    of.map(|tet| viscera::mesh::tet_volume(mesh.corners(tet))).sum()
}

#[test]
fn soft_organs_become_bodies_with_their_volume() {
    let import = made(&coarse());
    let names: Vec<&str> = import.parts.iter().map(|part| part.name.as_str()).collect();
    assert_eq!(names, ["spleen", "liver"], "bone is none, and the lump is a part of the liver");
    let voxels = |labels: &[u16]| {
        map().labels().iter().filter(|label| labels.contains(label)).count() as f64 * 27e-9
    };
    for (part, labels) in import.parts.iter().zip([&[1][..], &[5, 9]]) {
        let ratio = part.mesh.volume() / voxels(labels);
        assert!((ratio - 1.0).abs() < 0.01, "{}: {ratio}", part.name);
        let skin = part.skin.as_ref().expect("a surface");
        let ratio = skin.enclosed_volume() / voxels(labels);
        assert!((ratio - 1.0).abs() < 0.02, "{}: {ratio}", part.name);
        assert_eq!(connected_components(&part.mesh).count, 1);
        assert!(summarize_quality(&part.mesh).min_dihedral.to_degrees() > 10.7);
    }
    let liver = &import.parts[1];
    assert_eq!(liver.inner.len(), 1);
    assert_eq!((liver.inner[0].region, liver.inner[0].name.as_str()), (9, "liver_tumor"));
    // By the middles of tetrahedra: to a share of an edge over the lump's radius.
    let lump = volume_of(&liver.mesh, 9) / voxels(&[9]);
    assert!((0.6..1.5).contains(&lump), "{lump}");
    assert!(import.notes.iter().any(|note| note.contains("rib_left_1")), "{:?}", import.notes);
}

#[test]
fn a_written_scene_is_read_and_comes_to_rest() {
    let written = made(&coarse()).scene("a \"scan\"\n");
    let file = |name: &str| {
        let found = written.files.iter().find(|(known, _)| known == name);
        found.map(|(_, bytes)| bytes.clone()).ok_or_else(|| format!("no {name}"))
    };
    let text = String::from_utf8(file("scan.toml").expect("a scene")).expect("text");
    for part in ["# left out, choose by --labels: rib_left_1", "preset = \"liver\"", "label = 9"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let scene = Scene::parse("scene.toml", &text, &[]).unwrap_or_else(|e| panic!("{e}\n{text}"));
    assert_eq!(scene.title, "a scan");
    let assembly = Assembly::new(&scene, &mut |name| file(name));
    let assembly = assembly.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(assembly.bodies.len(), 2);
    assert!(assembly.bodies.iter().all(|body| body.has_fine_surface));
    // Downwards is to the patient's back.
    assert!(scene.world.gravity.y < -9.8 && scene.world.gravity.z == 0.0);
}

#[test]
fn labels_are_chosen_by_name_or_number() {
    let choose = |labels: &[&str]| {
        let labels = labels.iter().map(|&label| label.to_owned()).collect();
        let found = Found::Labels(map(), report());
        parts("scan.nii.gz", found, &Options { labels, ..coarse() }, &mut |_| ())
    };
    let names = |import: Import| -> Vec<String> {
        import.parts.into_iter().map(|part| part.name).collect()
    };
    assert_eq!(names(choose(&["Liver", "9"]).expect("both")), ["liver"]);
    let error = choose(&["kidney"]).map(names).expect_err("no kidney").to_string();
    assert!(error.contains("no label `kidney`") && error.contains("5 liver"), "{error}");
}

#[test]
fn hollow_organs_get_a_wall() {
    let mut map = map();
    let names = [(5, "stomach"), (1, "spleen")].map(|(label, name)| (label, name.to_owned()));
    map.set_names(names.into());
    let make = |hollow: bool| {
        let labels = vec!["stomach".to_owned(), "9".to_owned()];
        let fineness = Some(Fineness::Edge(0.003));
        let options = Options { labels, hollow, fineness, ..coarse() };
        let found = Found::Labels(map.clone(), report());
        let mut import = parts("scan.nrrd", found, &options, &mut |_| ()).expect("a stomach");
        import.parts.remove(0)
    };
    let (filled, hollow) = (make(false), make(true));
    // Edges of 3 mm resolve a wall of 3.9 mm around a ball of 26 mm.
    let ball = |radius: f64| 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
    let ratio = hollow.mesh.volume() / (ball(0.026) - ball(0.0221));
    assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
    assert!((filled.mesh.volume() / ball(0.026) - 1.0).abs() < 0.02);
    // Along the wall it is as stiff as one of 2 mm; what is filled has the share of it that the wall is.
    let wall =
        viscera::material::preset(filled.tissue.preset.expect("known")).expect("known").young;
    let young = |part: &viscera_import::Part| part.tissue.young.expect("a share") / wall;
    assert!((young(&hollow) - 2.0 / 3.9).abs() < 1e-3);
    assert!((young(&filled) - (1.0 - ball(0.024) / ball(0.026))).abs() < 0.01);
}

/// A surface that meets others has no more points than it takes to show what the scan does.
#[test]
fn surfaces_are_as_coarse_as_the_scan_allows() {
    let voxel = 3e-3;
    let options = Options { fineness: Some(Fineness::Edge(0.015)), ..Options::default() };
    for part in made(&options).parts {
        let labels: &[u16] = if part.name == "spleen" { &[1] } else { &[5, 9] };
        let (organ, _) = Organ::new(&map(), labels).expect("an organ");
        let fine = surface(&organ, voxel).expect("a surface");
        let skin = part.skin.expect("a surface");
        println!("{}: {} of {} points", part.name, skin.vertices.len(), fine.vertices.len());
        // Edges of three voxels have nine times fewer points, those at its volume a little more.
        assert!(8 * skin.vertices.len() < fine.vertices.len(), "{}", part.name);
        let solid = Solid::new(&skin).expect("a body");
        let off: Vec<f64> = fine.vertices.iter().map(|x| solid.nearest(*x) / voxel).collect();
        let far = off.iter().filter(|off| **off > 0.25).count();
        assert!(far as f64 <= 0.05 * off.len() as f64, "{}: {far}", part.name);
        assert!(off.iter().all(|off| *off < 1.5), "{}", part.name);
        let ratio = skin.enclosed_volume() / part.wanted.expect("a volume");
        assert!((ratio - 1.0).abs() < 0.04, "{}: {ratio}", part.name);
    }
}

/// Coarse voxels make surfaces that overlap by more than contact is thick: it begins farther off then.
#[test]
fn organs_that_overlap_make_a_scene_that_runs() {
    let size = 6e-3;
    let (dims, columns) =
        ([24; 3], [vec3(size, 0.0, 0.0), vec3(0.0, size, 0.0), vec3(0.0, 0.0, size)]);
    let matrix = Mat3::from_columns(columns[0], columns[1], columns[2]);
    let mut labels = Vec::new();
    for (z, y, x) in
        (0..24).flat_map(|z| (0..24).flat_map(move |y| (0..24).map(move |x| (z, y, x))))
    {
        let at = vec3(f64::from(x), f64::from(y), f64::from(z)) * size;
        let near = |c: [f64; 3], r: f64| (at - vec3(c[0], c[1], c[2])).length() < r;
        // One lies in a hollow of the other.
        labels.push(match () {
            () if near([0.07, 0.07, 0.11], 0.017) => 2,
            () if near([0.07, 0.07, 0.065], 0.048) => 1,
            () => 0,
        });
    }
    let names = [(1, "liver"), (2, "gallbladder")].map(|(label, name)| (label, name.to_owned()));
    let to_world = Affine { matrix, translation: Vec3::ZERO };
    let map = LabelMap::new(dims, labels, to_world, names.into()).expect("a map");
    let options = Options { fineness: Some(Fineness::Edge(0.012)), ..Options::default() };
    let found = Found::Labels(map, report());
    let import = parts("scan.nii.gz", found, &options, &mut |_| ()).expect("two organs");
    assert_eq!(import.warnings, [""; 0]);
    let thickness = import.thickness.expect("they overlap");
    let told = format!(
        "contact begins {:.1} mm off surfaces, since gallbladder and liver",
        1e3 * thickness
    );
    assert!(import.notes.iter().any(|note| note.starts_with(&told)), "{:?}", import.notes);
    let files: BTreeMap<String, Vec<u8>> = import.scene("scan").files.into_iter().collect();
    let text = std::str::from_utf8(&files["scan.toml"]).expect("text");
    let scene = |settings: &[(&str, &str)]| {
        let scene = Scene::parse("scan.toml", text, settings).expect("a legal scene");
        let mut load = |name: &str| Ok(files[name].clone());
        Assembly::with_balance(&scene, &mut load, import.balance.clone())
    };
    let error = scene(&[("contact.thickness", "1 mm")]).map(|_| ()).expect_err("an overlap");
    let AssembleError::BodiesOverlap { depth, .. } = error else { panic!("{error}") };
    assert!(thickness > 1.1 * depth && thickness < 1.3 * depth + 1e-4, "{thickness}, {depth}");
    let assembly = scene(&[]).unwrap_or_else(|error| panic!("{error}"));
    assert!(!assembly.sags());
}

/// The surface stays as fine, and there are fewer tetrahedra.
#[test]
fn graded_organs_have_the_same_surface() {
    let make = |graded: bool| {
        let fineness = Some(Fineness::Edge(0.003));
        let options = Options { labels: vec!["spleen".into()], graded, fineness, ..coarse() };
        let found = Found::Labels(map(), report());
        parts("scan.nrrd", found, &options, &mut |_| ()).expect("a spleen").parts.remove(0).mesh
    };
    let (uniform, graded) = (make(false), make(true));
    let outside = |mesh| viscera::mesh::boundary_surface(mesh).surface.triangles.len();
    assert_eq!(outside(&graded), outside(&uniform));
    assert!((graded.volume() / uniform.volume() - 1.0).abs() < 1e-9);
    let ratio = graded.tets().len() as f64 / uniform.tets().len() as f64;
    println!("{} of {} tetrahedra", graded.tets().len(), uniform.tets().len());
    assert!(ratio < 0.8, "{ratio}");
}

#[test]
fn what_is_no_mesh_and_no_scan_is_told() {
    let error = open("a.nii.gz", |_| Ok(b"\x1f\x8b\x08\0".to_vec())).err().expect("cut short");
    assert!(error.to_string().starts_with("a.nii.gz"), "{error}");
    let error = open("a.stl", |_| Err("a.stl: there is no such file".into())).err().expect("none");
    assert_eq!(error.to_string(), "a.stl: there is no such file");
}

#[test]
fn a_mask_of_one_organ_is_named_after_its_file() {
    let mut text = String::from(
        "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 8 8 8\nencoding: text\nspacings: 5 5 5\n\n",
    );
    for n in 0..512 {
        let is_inside = [n % 8, n / 8 % 8, n / 64].iter().all(|at| (1..7).contains(at));
        text.push_str(if is_inside { "1 " } else { "0 " });
    }
    // Label 1 of TotalSegmentator is a spleen.
    let found = open("data/liver.nrrd", |_| Ok(text.clone().into_bytes())).expect("a map");
    let import = parts("data/liver.nrrd", found, &coarse(), &mut |_| ()).expect("a liver");
    assert_eq!(import.parts[0].name, "liver");
}

/// Voxels of 3 mm: a box of 1.2 l and, apart from it, a plate of so many voxels' thickness.
fn plate(thickness: usize) -> LabelMap {
    let dims = [80, 50, 40];
    let columns = [vec3(3e-3, 0.0, 0.0), vec3(0.0, 3e-3, 0.0), vec3(0.0, 0.0, 3e-3)];
    let matrix = Mat3::from_columns(columns[0], columns[1], columns[2]);
    let to_world = Affine { matrix, translation: Vec3::ZERO };
    let label = |n: usize| match [n % 80, n / 80 % 50, n / 4000] {
        [x, y, z] if (2..40).contains(&x) && (2..40).contains(&y) && (2..34).contains(&z) => 5,
        [x, y, z] if (60..60 + thickness).contains(&x) && y > 3 && y < 44 && z > 3 && z < 34 => 117,
        _ => 0,
    };
    let labels = (0..80 * 50 * 40).map(label).collect();
    let names = [(5, "liver"), (117, "costal_cartilages")].map(|(l, name)| (l, name.to_owned()));
    LabelMap::new(dims, labels, to_world, names.into()).expect("a map")
}

#[test]
fn a_thin_plate_beside_a_thick_organ_keeps_its_volume() {
    for thickness in [1, 2, 3] {
        let found = Found::Labels(plate(thickness), report());
        let made = parts("plate.nii", found, &Options::default(), &mut |_| ()).expect("bodies");
        assert_eq!(made.warnings, Vec::<String>::new(), "{thickness}");
        for part in &made.parts {
            let ratio = part.mesh.volume() / part.wanted.expect("a volume");
            assert!((ratio - 1.0).abs() < 0.02, "{thickness} {}: {ratio}", part.name);
            let skin = part.skin.as_ref().expect("a surface").enclosed_volume();
            let ratio = skin / part.wanted.expect("a volume");
            assert!((ratio - 1.0).abs() < 0.03, "{thickness} skin of {}: {ratio}", part.name);
            assert_eq!(connected_components(&part.mesh).count, 1, "{thickness} {}", part.name);
        }
        let plate = &made.parts[1];
        assert!(
            plate.notes.iter().any(|note| note.contains("so that it keeps")),
            "{:?}",
            plate.notes
        );
        // Vertices inside of it: its thickness is resolved.
        let skin = viscera::mesh::boundary_surface(&plate.mesh).surface;
        assert!(plate.mesh.vertices().len() > skin.vertices.len() + 100, "{thickness}");
    }
}

/// As much as the plate could have would need more tetrahedra than all were to have.
#[test]
fn what_cannot_keep_its_volume_is_named() {
    let mut labels = plate(1).labels().to_vec();
    // A sieve: every second row of the plate is gone.
    for (n, label) in labels.iter_mut().enumerate() {
        if *label == 117 && (n / 80) % 2 == 0 {
            *label = 0;
        }
        // And the rest is one piece by its rim.
        if n % 80 == 60 && n / 4000 == 4 && (4..44).contains(&(n / 80 % 50)) {
            *label = 117;
        }
    }
    let map = plate(1);
    let names = map.names().clone();
    let map = LabelMap::new(map.dims(), labels, *map.to_world(), names).expect("a map");
    let found = Found::Labels(map.clone(), report());
    let shapes = Options { shapes_only: true, ..Options::default() };
    let made = parts("plate.nii", found, &shapes, &mut |_| ()).expect("bodies");
    let ratio = made.parts[1].mesh.volume() / made.parts[1].wanted.expect("a volume");
    assert!((ratio - 1.0).abs() > 0.02, "{ratio}");
    let [warning] = &made.warnings[..] else { panic!("{:?}", made.warnings) };
    assert!(warning.starts_with("`costal_cartilages` has 13 ml of the 17 ml"), "{warning}");
    // What it says helps.
    let found = Found::Labels(map, report());
    let words: Vec<&str> = warning.split(' ').rev().take(4).collect();
    let [count, "--count", label, "--labels"] = words[..] else { panic!("{warning}") };
    let fineness = Some(Fineness::Count(count.parse().expect("a number")));
    let options = Options { fineness, labels: vec![label.to_owned()], ..shapes };
    let made = parts("plate.nii", found, &options, &mut |_| ()).expect("a plate");
    assert_eq!(made.warnings, Vec::<String>::new());
}
