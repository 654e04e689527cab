//! Labels of scans: their names, which are taken, and what is done with those that lie in others.

use std::collections::BTreeMap;

use viscera::mesh::tet_volume;
use viscera_import::{Fineness, Found, Import, ImportError, Options, Part, open, parts};
use viscera_volume::NamesFrom;

/// Voxels of 5 mm in an image of 40 x 30 x 30: an NRRD file with these keys.
fn file(keys: &str, label: impl Fn([usize; 3]) -> u16) -> Vec<u8> {
    let mut text = format!(
        "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 40 30 30\nencoding: text\nspace: right-anterior-superior\n\
         space directions: (5,0,0) (0,5,0) (0,0,5)\nspace origin: (0,0,0)\n{keys}\n"
    );
    for n in 0..40 * 30 * 30 {
        text.push_str(&format!("{} ", label([n % 40, n / 40 % 30, n / 1200])));
    }
    text.into_bytes()
}

fn segments(names: &[(u16, &str)]) -> String {
    let segment = |(n, (label, name)): (usize, &(u16, &str))| {
        format!("Segment{n}_LabelValue:={label}\nSegment{n}_Name:={name}\n")
    };
    names.iter().enumerate().map(segment).collect()
}

/// Whether a voxel is in a cube.
fn is_in([x, y, z]: [usize; 3], first: [usize; 3], size: usize) -> bool {
    let within = |at: usize, first: usize| (first..first + size).contains(&at);
    within(x, first[0]) && within(y, first[1]) && within(z, first[2])
}

/// 1: a cube of 22 voxels, 1.3 l. 2: one of 6 in it, 27 ml. 3: one of 10 beside it, 125 ml. 4: one of 2, 1 ml.
fn scan(at: [usize; 3]) -> u16 {
    match at {
        at if is_in(at, [9, 9, 9], 6) => 2,
        at if is_in(at, [2, 2, 2], 22) => 1,
        at if is_in(at, [28, 4, 4], 10) => 3,
        at if is_in(at, [30, 24, 24], 2) => 4,
        _ => 0,
    }
}

fn make(keys: &str, options: &Options) -> Result<Import, ImportError> {
    let bytes = file(keys, scan);
    let found = open("data/scan.nrrd", |_| Ok(bytes.clone())).unwrap_or_else(|e| panic!("{e}"));
    let fineness = options.fineness.or(Some(Fineness::Edge(0.02)));
    parts("data/scan.nrrd", found, &Options { fineness, ..options.clone() }, &mut |_| ())
}

fn made(keys: &str, options: &Options) -> Import {
    make(keys, options).unwrap_or_else(|error| panic!("{error}"))
}

fn labels(labels: &[&str]) -> Options {
    Options { labels: labels.iter().map(|l| (*l).to_owned()).collect(), ..Options::default() }
}

fn names(import: &Import) -> Vec<&str> {
    import.parts.iter().map(|part| part.name.as_str()).collect()
}

fn is_told(lines: &[String], parts: &[&str]) -> bool {
    lines.iter().any(|line| parts.iter().all(|part| line.contains(part)))
}

/// A body was made of so many voxels, and has their volume within 2 %.
fn has_voxels(part: &Part, voxels: f64) -> bool {
    let of_voxels = part.wanted.unwrap_or_default() / (voxels * 125e-9);
    let of_mesh = part.mesh.volume() / (voxels * 125e-9);
    (of_voxels - 1.0).abs() < 1e-9 && (of_mesh - 1.0).abs() < 0.02
}

#[test]
fn labels_without_names_are_no_organs_of_total_segmentator_by_themselves() {
    // A liver and its tumour, as LiTS numbers them.
    let import = made("", &labels(&["1", "2"]));
    assert_eq!(names(&import), ["label_1"]);
    assert_eq!(import.parts[0].tissue.preset, None);
    assert!(is_told(&import.notes, &["label_1", "--names 1=liver"]), "{:?}", import.notes);
    // Who knows says so.
    let given = vec![(1, "liver".to_owned()), (2, "tumor".to_owned())];
    let import = made("", &Options { names: given.clone(), ..labels(&["liver", "tumor"]) });
    assert_eq!(names(&import), ["liver"]);
    assert_eq!(import.parts[0].tissue.preset, Some("liver"));
    assert_eq!(import.parts[0].inner[0].name, "tumor");
    assert!(!is_told(&import.notes, &["label_1"]), "{:?}", import.notes);
    // Names in the file stay where no others are given.
    let keys = segments(&[(1, "spleen"), (3, "kidney")]);
    let import = made(&keys, &Options { names: given, ..labels(&["1", "3"]) });
    assert_eq!(names(&import), ["liver", "kidney"]);
    let wrong = Options { names: vec![(9, "liver".to_owned())], ..Options::default() };
    let error = make("", &wrong).err().expect("no such label").to_string();
    assert!(error.contains("no label `9`; labels are 1, 2, 3, 4"), "{error}");
    // Sizes and sides of a liver and a spleen.
    let numbered = file("", |at| match scan([39 - at[0], at[1], at[2]]) {
        1 | 2 => 5,
        3 => 1,
        _ => 0,
    });
    let found = open("scan.nrrd", |_| Ok(numbered.clone())).expect("a map");
    let Found::Labels(map, report) = found else { panic!("no scan") };
    assert_eq!((map.name(5), report.names_from), (Some("liver"), NamesFrom::TotalSegmentator));
}

#[test]
fn what_lies_in_an_organ_is_no_hole() {
    let keys = segments(&[(1, "liver"), (2, "liver lesion"), (3, "spleen"), (4, "Clip")]);
    let alone = made(&keys, &labels(&["liver"]));
    assert!(has_voxels(&alone.parts[0], 22.0f64.powi(3)), "{}", alone.parts[0].mesh.volume());
    assert!(alone.parts[0].inner.is_empty());
    assert!(
        is_told(&alone.warnings, &["liver lesion", "27 ml", "--labels 1,2"]),
        "{:?}",
        alone.warnings
    );
    // As it says.
    let both = made(&keys, &labels(&["1", "2"]));
    assert!(both.warnings.is_empty() && both.parts[0].inner.len() == 1, "{:?}", both.warnings);
    let part = &both.parts[0];
    let of_lesion = (0..part.mesh.tets().len()).filter(|&t| part.mesh.regions()[t] == 2);
    let volume: f64 = of_lesion.map(|t| tet_volume(part.mesh.corners(t))).sum();
    assert!((0.4..1.6).contains(&(volume / 27e-6)), "{volume}");
    // Bone in an organ is not soft.
    let keys = segments(&[(1, "gluteus maximus"), (2, "femur"), (3, "spleen")]);
    let around = made(&keys, &labels(&["1"]));
    assert!(
        has_voxels(&around.parts[0], 22.0f64.powi(3) - 216.0),
        "{}",
        around.parts[0].mesh.volume()
    );
    assert!(is_told(&around.warnings, &["`femur`", "hole"]), "{:?}", around.warnings);
}

#[test]
fn unknown_names_beside_known_ones_are_told_with_what_takes_them() {
    let keys = segments(&[(1, "Leber"), (2, "Metastase"), (3, "spleen"), (4, "Clip")]);
    let import = made(&keys, &Options::default());
    assert_eq!(names(&import), ["spleen"]);
    let parts =
        ["`Leber` (label 1, 1304 ml)", "`Metastase`", "--labels 3,1,2,4 ", "--names 1=liver"];
    assert!(is_told(&import.warnings, &parts), "{:?}", import.warnings);
    let all = made(&keys, &labels(&["3", "1", "2", "4"]));
    assert_eq!(names(&all)[..2], ["spleen", "leber"]);
    let named = made(&keys, &Options { names: vec![(1, "liver".into())], ..Options::default() });
    assert_eq!(names(&named), ["liver", "spleen"]);
    // Beside bones only, they are what there is.
    let keys = segments(&[(1, "Leber"), (2, "Metastase"), (3, "sternum"), (4, "rib_left_1")]);
    assert_eq!(names(&made(&keys, &Options::default())), ["leber"]);
}

#[test]
fn bones_are_no_soft_tissue() {
    let keys = segments(&[(1, "liver"), (3, "rib_left_1"), (4, "air")]);
    let error = make(&keys, &labels(&["liver", "rib_left_1"])).err().expect("bone").to_string();
    for part in
        ["`rib_left_1` is bone", "--labels 3 --out rib_left_1.vtu", "[[tool]]", "--names 3="]
    {
        assert!(error.contains(part), "{part}: {error}");
    }
    assert!(make(&keys, &labels(&["4"])).is_err());
    let shape = made(&keys, &Options { shapes_only: true, ..labels(&["3"]) });
    assert!(has_voxels(&shape.parts[0], 1000.0), "{}", shape.parts[0].mesh.volume());
    // What it is called is what it is.
    let muscle = Options { names: vec![(3, "muscle".into())], ..labels(&["3"]) };
    assert_eq!(made(&keys, &muscle).parts[0].tissue.preset, Some("muscle"));
}

#[test]
fn one_label_without_a_shape_is_left_out() {
    let keys = segments(&[(1, "liver"), (3, "spleen")]);
    let one_voxel = |at: [usize; 3]| match at {
        [24, 25, 25] => 3,
        at if is_in(at, [8, 8, 8], 12) => 1,
        _ => 0,
    };
    let cubes = file(&keys, one_voxel);
    let text = String::from_utf8(cubes.clone()).expect("text");
    // Voxels that are as thin as a fine lattice's edges.
    let slices = text.replace("(5,0,0) (0,5,0) (0,0,5)", "(5,0,0) (0,0.2,0) (0,0,5)");
    let make = |bytes: &[u8], labels: &[&str]| {
        let found = open("scan.nrrd", |_| Ok(bytes.to_vec())).expect("a map");
        let labels = labels.iter().map(|l| (*l).to_owned()).collect();
        parts("scan.nrrd", found, &Options { labels, ..Options::default() }, &mut |_| ())
    };
    let both = make(slices.as_bytes(), &["1", "3"]).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(names(&both), ["liver"]);
    assert!(is_told(&both.warnings, &["`spleen` is left out: 1 voxel"]), "{:?}", both.warnings);
    let error = make(slices.as_bytes(), &["3"]).err().expect("no shape").to_string();
    assert!(error.starts_with("scan.nrrd: `spleen`: 1 voxel is too little"), "{error}");
    // A single voxel that is a cube has a shape, if not its volume.
    let both = make(&cubes, &["1", "3"]).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(names(&both), ["liver", "spleen"]);
}

#[test]
fn labels_of_one_name_are_told() {
    let keys = segments(&[(1, "liver"), (3, "Liver"), (4, "spleen")]);
    let import = made(&keys, &Options::default());
    assert_eq!(names(&import), ["liver", "liver_3"]);
    assert!(
        is_told(&import.warnings, &["labels 1,3", "--names 3=liver_2"]),
        "{:?}",
        import.warnings
    );
    assert_eq!(names(&made(&keys, &labels(&["liver"]))), ["liver", "liver_3"]);
}

#[test]
fn options_that_a_file_does_not_use_are_refused() {
    let with = |options: Options| make("", &options).err().map(|error| error.to_string());
    let error =
        with(Options { unit: Some(1e-3), ..Options::default() }).expect("a scan has its own");
    assert!(error.contains("--unit is for meshes"), "{error}");
    let ball =
        viscera::mesh::distance::Sphere { center: viscera::scalar::Vec3::ZERO, radius: 40.0 };
    let (mesh, _) = viscera::mesh::tetrahedralize::tetrahedralize(&ball, 15.0).expect("a ball");
    let files: BTreeMap<&str, Vec<u8>> = [
        ("a.msh", viscera::mesh::io::gmsh::write(&mesh).into_bytes()),
        ("a.stl", viscera::mesh::io::stl::write(&viscera::mesh::boundary_surface(&mesh).surface)),
    ]
    .into();
    let error = |file: &str, options: &Options| {
        let found = open(file, |_| Ok(files[file].clone())).expect("a mesh");
        parts(file, found, options, &mut |_| ()).err().map(|error| error.to_string())
    };
    let hollow = Options { hollow: true, ..Options::default() };
    let graded = Options { graded: true, ..Options::default() };
    let named = Options { names: vec![(1, "liver".into())], ..Options::default() };
    let sized = |fineness| Options { fineness: Some(fineness), ..Options::default() };
    for (file, options, told) in [
        ("a.msh", &labels(&["2"]), "viscera mesh convert a.msh part.vtu --region"),
        ("a.msh", &hollow, "--hollow is for the labels"),
        ("a.msh", &named, "--names is for the labels"),
        ("a.msh", &sized(Fineness::Edge(0.01)), "--edge says how"),
        ("a.msh", &sized(Fineness::Count(100)), "--count says how"),
        ("a.msh", &graded, "--graded says how"),
        ("a.stl", &labels(&["2"]), "--labels is for the labels"),
        ("a.stl", &hollow, "--hollow"),
    ] {
        let error = error(file, options).unwrap_or_else(|| panic!("{file}: {told}"));
        assert!(error.contains(told), "{error}");
    }
    assert_eq!(error("a.msh", &Options { unit: Some(1e-3), ..Options::default() }), None);
    assert_eq!(error("a.stl", &sized(Fineness::Count(500))), None);
}
