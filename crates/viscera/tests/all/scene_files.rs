//! The shipped scenes, and what a scene file can say.

use viscera::material::MaterialModel;
use viscera::mesh::io::MeshNames;
use viscera::mesh::{TetMesh, shapes};
use viscera::scalar::{Vec3, vec3};
use viscera::scene::{
    BodyShape, RegionLabel, Scene, SceneError, Selector, describe_markdown, describe_text,
};
use viscera::settings::{
    Acceleration, Accuracy, AndersonGuard, Colors, Count, DeviceRequest, Method, Place, Precision,
    SolverSettings, Start,
};

const SHIPPED: [(&str, &str); 12] = [
    ("liver_retraction.toml", include_str!("../../../../scenes/liver_retraction.toml")),
    ("cantilever.toml", include_str!("../../../../scenes/cantilever.toml")),
    ("twist.toml", include_str!("../../../../scenes/twist.toml")),
    ("stretch.toml", include_str!("../../../../scenes/stretch.toml")),
    ("grab.toml", include_str!("../../../../scenes/grab.toml")),
    ("palpation.toml", include_str!("../../../../scenes/palpation.toml")),
    ("liver_lifted.toml", include_str!("../../../../scenes/liver_lifted.toml")),
    ("grasp.toml", include_str!("../../../../scenes/grasp.toml")),
    ("haptic_palpation.toml", include_str!("../../../../scenes/haptic_palpation.toml")),
    ("cholecystectomy.toml", include_str!("../../../../scenes/cholecystectomy.toml")),
    ("organs_pressed.toml", include_str!("../../../../scenes/organs_pressed.toml")),
    ("fold.toml", include_str!("../../../../scenes/fold.toml")),
];

/// Nearly every key there is, in one scene.
const EVERYTHING: &str = r#"
title = "Everything"
description = "Two bodies"
time = { duration = "1.5 s", frame = "1/50 s", velocity_factor = "90 %" }
world = { gravity = [0, "-1 m/s^2", "-9 m/s^2"] }

[[body]]
name = "organ"
mesh = "organ.msh"
unit = "32 mm"
scale = 0.5
surface = "organ.obj"
position = ["10 mm", 0, "1 cm"]
rotation_axis = [0, 0, 2]
rotation_angle = "90 deg"
material = { preset = "liver", viscosity = "20 ms" }
[[body.region]]
label = 3
young = "59 kPa"
[[body.region]]
label = 4
preset = "fat"
model = "saint_venant_kirchhoff"

[[body]]
name = "bead"
shape = "sphere"
radius = "2 cm"
[body.material]
young = "1 MPa"

[[fixing]]
body = "organ"
region = 3
stiffness = "500 N/m"

[[motion]]
name = "pull"
body = "bead"
nearest = { point = [0, 0, 0] }
about = ["1 mm", 0, 0]
interpolation = "linear"
release = "1 s"
[[motion.keys]]
time = "0.25 s"
[[motion.keys]]
time = "0.75 s"
translation = [0, 0, "40 mm"]

[contact]
self = false
friction = 0.2
thickness = "0.5 mm"

[[tie]]
from = { body = "bead", region = 0 }
to = { body = "organ", region = 3 }
stiffness = "20 kPa/mm"
strength = "9 kPa"

[[force]]
body = "bead"
sphere = { center = [0, 0, 0], radius = "5 mm" }
force = [0, 0, "0.5 N"]
keys = [{ time = "1 s", factor = 0 }, { time = "2 s", factor = "100 %" }]

[[tool]]
name = "pliers"
kind = "grasper"
jaw_size = ["8 mm", "4 mm", "16 mm"]
jaw_gap = "4 mm"
rounding = "1 mm"
position = [0, 0, "1 m"]
path = "pliers.csv"
friction = "80 %"
stiffness = 2
thickness = "0.5 mm"
jaw = [{ time = 0, angle = "40 deg" }, { time = "1 s", angle = "-10 deg" }]
lock = [{ from = "1 s", to = "1.2 s" }]

[[tool]]
kind = "half_space"
rotation_vector = ["0.1 rad", 0, 0]
begin = "0.2 s"
end = "1.4 s"

[[hand]]
tool = "pliers"
from = "0.5 s"
keys = [
  { time = "0.5 s" },
  { time = "1 s", translation = ["1 mm", 0, 0], rotation_vector = [0, "0.3 rad", 0] },
]
jaw = [{ time = "0.5 s", angle = "20 deg" }, { time = "0.7 s", angle = 0 }]
lock = [{ from = "0.8 s", to = "0.9 s" }, { from = "1 s" }]
end = "1.3 s"

[[hand]]
tool = "tool 1"
from = "0.3 s"

[[spring]]
from = { body = "organ", box = { min = [0, 0, 0], max = ["1 m", "1 m", "1 m"] } }
to = { body = "bead", half_space = { point = [0, 0, 0], normal = [0, 3, 4] } }
stiffness = "2 N/mm"
rest_length = "5 mm"

[solver]
precision = "f64"
colors = 4
acceleration = "anderson"

[output]
every = 5
picture_size = [640, 480]
"#;

#[test]
fn every_shipped_scene_is_valid_and_needs_no_file() {
    for (name, text) in SHIPPED {
        let scene = Scene::parse(name, text, &[]).unwrap_or_else(|error| panic!("{error}"));
        assert!(scene.files().is_empty(), "{name}");
        assert!(!scene.title.is_empty() && !scene.description.is_empty(), "{name}");
        assert!((60..=600).contains(&scene.frame_count()), "{name}");
        assert!(!scene.fixings.is_empty(), "{name}");
    }
}

fn mesh_of(shape: &BodyShape) -> TetMesh {
    match *shape {
        BodyShape::Beam { length, width, height, cells_across, cut } => {
            shapes::beam(length, width, height, cells_across as usize, cut).unwrap()
        }
        BodyShape::Block { size, cells } => {
            shapes::block(Vec3::from_f64(size), cells.map(|count| count as usize)).unwrap()
        }
        BodyShape::Liver { spacing, scale } => shapes::liver(spacing, scale).unwrap().tets,
        BodyShape::Capsule { radius, length, spacing } => {
            shapes::capsule(radius, length, spacing).unwrap().tets
        }
        _ => panic!("no shipped scene uses {shape:?}"),
    }
}

#[test]
fn every_patch_of_a_shipped_scene_is_found_and_no_vertex_is_held_twice() {
    for (name, text) in SHIPPED {
        let scene = Scene::parse(name, text, &[]).unwrap();
        let meshes: Vec<_> = scene.bodies.iter().map(|body| mesh_of(&body.shape)).collect();
        let fixed = scene.fixings.iter().map(|fixing| &fixing.patch);
        let moved = scene.motions.iter().map(|motion| &motion.patch);
        let mut held = std::collections::BTreeSet::new();
        for patch in fixed.chain(moved) {
            let (mesh, placement) = (&meshes[patch.body], &scene.bodies[patch.body].placement);
            let rest: Vec<_> = mesh.vertices().iter().map(|&x| placement.apply(x)).collect();
            let count = rest.len();
            let placed = TetMesh::new(rest, mesh.tets().to_vec(), mesh.regions().to_vec());
            let vertices = patch.select(&placed.unwrap().0, &MeshNames::default()).unwrap();
            println!("{name}, {}: {} of {count} vertices", patch.purpose, vertices.len());
            assert!(vertices.len() < count / 4, "{name}, {}", patch.purpose);
            for vertex in vertices {
                assert!(held.insert((patch.body, vertex)), "{name}, {}", patch.purpose);
            }
        }
    }
}

#[test]
fn every_key_arrives_in_si_units() {
    let scene = Scene::parse("everything.toml", EVERYTHING, &[]).unwrap();
    assert_eq!(scene.frame_count(), 75);
    assert_eq!(scene.time.velocity_factor, 0.9);
    assert_eq!(scene.world.gravity, vec3(0.0, -1.0, -9.0));
    assert_eq!(scene.files(), ["organ.msh", "organ.obj", "pliers.csv"]);
    let [pliers, table] = scene.tools.as_slice() else { panic!("two tools") };
    assert_eq!((pliers.parts.len(), pliers.law.friction, table.name.as_str()), (2, 0.8, "tool 1"));
    let hand = &pliers.hands[0];
    assert_eq!((hand.from, hand.end, hand.locks[1]), (0.5, Some(1.3), [1.0, f64::INFINITY]));
    assert_eq!((hand.keys[1].rotation.y, hand.jaw[1].time), (0.3, 0.7));
    // A hand that takes it keeps it.
    assert_eq!((table.begin, table.end, table.leaves()), (0.2, Some(1.4), None));

    let [organ, bead] = scene.bodies.as_slice() else { panic!("two bodies") };
    let BodyShape::File { unit, .. } = organ.shape else { panic!("a file") };
    assert_eq!(unit, 0.016);
    let moved = organ.placement.apply(vec3(1.0, 0.0, 0.0));
    assert!((moved - vec3(0.01, 1.0, 0.01)).length() <= 4.0 * f64::EPSILON);
    assert_eq!(organ.material.model(), MaterialModel::StableNeoHookean);
    assert_eq!((organ.material.young(), organ.material.viscosity()), (5100.0, 0.02));
    let [fibrotic, fat] = organ.regions.as_slice() else { panic!("two regions") };
    assert_eq!((&fibrotic.label, fibrotic.material.young()), (&RegionLabel::Number(3), 59e3));
    // What a region leaves unsaid it takes from the body, or from its own preset.
    assert_eq!(fibrotic.material.density(), organ.material.density());
    assert_eq!(fat.material.density(), 950.0);
    assert_eq!(fat.material.model(), MaterialModel::SaintVenantKirchhoff);
    assert_eq!(bead.shape, BodyShape::Sphere { radius: 0.02, spacing: 0.005 });

    assert_eq!(scene.fixings[0].name, "fixing 0");
    assert_eq!(scene.fixings[0].stiffness, Some(500.0));
    assert_eq!(scene.fixings[0].patch.selector, Selector::Region(3));
    let motion = &scene.motions[0];
    assert_eq!((motion.patch.body, motion.release), (1, Some(1.0)));
    assert_eq!(motion.pose(0.1).translation, vec3(0.0, 0.0, 0.0));
    assert!((motion.pose(0.5).translation.z - 0.02).abs() <= f64::EPSILON);
    assert_eq!(scene.forces[0].at(1.5), vec3(0.0, 0.0, 0.25));
    let spring = &scene.springs[0];
    assert_eq!((spring.from.body, spring.to.body, spring.stiffness), (0, 1, 2000.0));
    assert_eq!(spring.rest_length, Some(0.005));
    let Selector::HalfSpace { normal, .. } = spring.to.selector else { panic!("a half-space") };
    assert!((normal - vec3(0.0, 0.6, 0.8)).length() <= 2.0 * f64::EPSILON);

    assert_eq!(scene.solver.precision, Precision::F64);
    assert_eq!(scene.solver.colors, Colors::Limited(4));
    assert_eq!(scene.solver.acceleration, Acceleration::Anderson);
    assert_eq!(scene.output.picture_size, [640, 480]);
}

#[test]
fn defaults_are_those_declared() {
    let solver = SolverSettings::default();
    assert_eq!((solver.method, solver.accuracy), (Method::Auto, Accuracy::Standard));
    assert_eq!((solver.substeps, solver.iterations), (Count::Auto, Count::Auto));
    assert_eq!((solver.precision, solver.colors), (Precision::F32, Colors::Unlimited));
    assert_eq!((solver.start, solver.anderson_guard), (Start::Auto, AndersonGuard::Residual));
    assert_eq!(solver.device, DeviceRequest::Auto);
    let text = "[[body]]\nname = \"a\"\nshape = \"liver\"\nmaterial = { preset = \"liver\" }";
    let scene = Scene::parse("small.toml", text, &[]).unwrap();
    assert_eq!(scene.solver, solver);
    assert_eq!(scene.time.frame, 1.0 / 60.0);
    assert_eq!(scene.world.gravity, vec3(0.0, 0.0, -9.81));
    assert_eq!(scene.title, "small.toml");
}

/// Other numbers would change the results of every scene that does not name its own.
#[test]
fn automatic_counts_are_those_of_the_method() {
    let text = "[[body]]\nname = \"a\"\nshape = \"liver\"\nmaterial = { preset = \"liver\" }";
    let solver = |overrides: &[(&str, &str)]| {
        Scene::parse("small.toml", text, overrides).expect("a legal scene").solver
    };
    let numbers = |solver: SolverSettings| (solver.substeps(), solver.iterations());
    for method in ["xpbd", "explicit"] {
        let method = ("solver.method", method);
        assert_eq!(numbers(solver(&[method])), (10, 2));
        let (substeps, iterations) = (("solver.substeps", "auto"), ("solver.iterations", "auto"));
        let written = solver(&[method, substeps, iterations]);
        assert_eq!(written, solver(&[method]));
        assert_eq!(numbers(written), (10, 2));
        assert_eq!(numbers(solver(&[method, ("solver.substeps", "4")])), (4, 2));
        assert_eq!(numbers(solver(&[method, ("solver.iterations", "7")])), (10, 7));
    }
    let values = solver(&[("solver.iterations", "7")]).values();
    for recorded in [("substeps", "\"auto\""), ("iterations", "7")] {
        assert!(values.iter().any(|(key, value)| (*key, value.as_str()) == recorded), "{values:?}");
    }
}

#[test]
fn an_override_counts_as_if_it_were_in_the_file() {
    let parse = |overrides| Scene::parse("everything.toml", EVERYTHING, overrides);
    let scene = parse(&[
        ("solver.iterations", "20"),
        ("solver.colors", "unlimited"),
        ("solver.rebase", "true"),
        ("body.organ.material.young", "\"8 kPa\""),
        ("body.1.material.poisson", "0.3"),
        ("body.organ.region.0.young", "70 kPa"),
        ("motion.pull.keys.1.translation", "[0, 0, \"10 mm\"]"),
        ("output", "{ every = 7 }"),
    ])
    .unwrap();
    assert_eq!(scene.solver.iterations, Count::Of(20));
    assert_eq!(scene.solver.colors, Colors::Unlimited);
    assert!(scene.solver.rebase);
    assert_eq!(scene.bodies[0].material.young(), 8000.0);
    assert_eq!(scene.bodies[1].material.poisson(), 0.3);
    assert_eq!(scene.bodies[0].regions[0].material.young(), 70e3);
    assert_eq!(scene.motions[0].pose(9.0).translation.z, 0.01);
    assert_eq!(scene.output.every, 7);
}

#[test]
fn a_bad_override_is_named() {
    for (key, value, message) in [
        (
            "solver.iteratoins",
            "5",
            "override of solver.iteratoins: unknown key `iteratoins` in `solver`; did you mean \
             `iterations`?",
        ),
        (
            "solver.iterations",
            "none",
            "override of solver.iterations: iterations = \"none\": did you mean \"auto\"? Or write a whole \
             number",
        ),
        (
            "solver.iterations",
            "0",
            "override of solver.iterations: iterations = 0: out of range; it must be 1 to 10000",
        ),
        (
            "body.liver.material.young",
            "5 kPa",
            "override of body.liver.material.young: body has no item `liver`; it has: organ, bead",
        ),
        (
            "solver.device",
            "7",
            "override of solver.device: device = 7: this must be \"auto\", \"cpu\", \"gpu\" or part \
             of an adapter's name",
        ),
        (
            "solver.device",
            "\" \"",
            "override of solver.device: device = \" \": out of range; it must be a name without \
             quotes and backslashes",
        ),
        ("body.7.name", "x", "override of body.7.name: body has no item `7`; it has: organ, bead"),
        (
            "title.x",
            "5",
            "override of title.x: title is a value and has no keys; shorten the override's key",
        ),
        (
            "solver..x",
            "5",
            "override of solver..x: a key is names joined by dots, for example solver.iterations",
        ),
    ] {
        let scene = Scene::parse("everything.toml", EVERYTHING, &[(key, value)]);
        assert_eq!(scene.map_err(|error| error.to_string()), Err(message.into()));
    }
}

#[test]
fn recorded_solver_settings_read_back_as_they_were() {
    let overrides = [
        ("solver.relaxation", "1.5"),
        ("solver.acceleration", "chebyshev"),
        ("solver.device", "Radeon (TM) 780M"),
    ];
    let scene = Scene::parse("everything.toml", EVERYTHING, &overrides).unwrap();
    let recorded = scene.solver.values();
    let overrides: Vec<(String, &str)> =
        recorded.iter().map(|(key, value)| (format!("solver.{key}"), value.as_str())).collect();
    let overrides: Vec<_> = overrides.iter().map(|(key, value)| (key.as_str(), *value)).collect();
    let (name, text) = SHIPPED[1];
    assert_eq!(Scene::parse(name, text, &overrides).unwrap().solver, scene.solver);
}

/// A page lists these alone, and has no room for the others.
#[test]
fn settings_of_solver_and_world_are_described_as_among_all_keys() {
    let all = viscera::scene::describe();
    let settings = viscera::scene::describe_settings();
    for path in ["world", "solver"] {
        let of = |tables: &[viscera::settings::TableDescription]| {
            tables.iter().filter(|table| table.path == path).cloned().collect::<Vec<_>>()
        };
        assert_eq!(of(&settings).len(), 1);
        assert_eq!(of(&settings), of(&all));
    }
    assert_eq!(settings.len(), 2);
}

/// Keys are found in a scene that uses nearly all of them, not in a list kept beside the code.
#[test]
fn describe_lists_every_key_and_documents_it() {
    let (text, markdown) = (describe_text(), describe_markdown());
    let written = EVERYTHING.split(['\n', '{', ',']).filter_map(|part| part.split_once('='));
    let keys: Vec<_> = written.map(|(key, _)| key.trim()).collect();
    let solver = SolverSettings::xpbd().values();
    assert!(keys.len() > 60 && solver.len() == 28);
    for key in keys.into_iter().chain(solver.iter().map(|(key, _)| *key)) {
        assert!(text.contains(&format!("\n    {key}\n")), "{key}");
        assert!(markdown.contains(&format!("| `{key}` |")), "{key}");
    }
    for table in viscera::scene::describe() {
        assert!(!table.doc.is_empty(), "{}", table.path);
        for key in table.keys {
            assert!(!key.doc.is_empty() && !key.type_text.is_empty(), "{}", key.name);
        }
    }
}

#[test]
fn a_fixing_that_selects_nothing_says_where_the_body_is() {
    let overrides = [("fixing.wall.half_space.point", "[\"-10 mm\", 0, 0]")];
    let (name, text) = SHIPPED[1];
    let scene = Scene::parse(name, text, &overrides).unwrap();
    let bits = |i: u8| [i & 1, (i >> 1) & 1, i >> 2].map(f64::from);
    let corners: Vec<_> =
        (0..8).map(bits).map(|[x, y, z]| vec3(0.2 * x, 0.05 * y, 0.05 * z)).collect();
    let (mesh, _) = TetMesh::new(corners, vec![[0, 1, 2, 4], [7, 6, 5, 3]], vec![0; 2]).unwrap();
    let error = scene.fixings[0].patch.select(&mesh, &MeshNames::default()).unwrap_err();
    assert!(matches!(error, SceneError::Selection { .. }));
    assert_eq!(
        error.to_string(),
        "cantilever.toml, line 17, column 1: fixing `wall` selects nothing: the body reaches from \
         (0, 0, 0) mm to (200, 50, 50) mm, and its nearest vertex (0, 0, 0) mm is 10 mm away; move \
         or enlarge the half-space"
    );
}

/// The scene, wherever its patches were written.
fn without_places(mut scene: Scene) -> Scene {
    let nowhere = Place::Override { key: "nowhere".into() };
    let patches = scene.fixings.iter_mut().map(|fixing| &mut fixing.patch);
    let patches = patches.chain(scene.motions.iter_mut().map(|motion| &mut motion.patch));
    let patches = patches.chain(scene.forces.iter_mut().map(|force| &mut force.patch));
    let ends = scene.springs.iter_mut().flat_map(|spring| [&mut spring.from, &mut spring.to]);
    let ties = scene.ties.iter_mut().flat_map(|tie| [&mut tie.from, &mut tie.to]);
    patches.chain(ends).chain(ties).for_each(|patch| patch.place = nowhere.clone());
    scene.ties.iter_mut().for_each(|tie| tie.place = nowhere.clone());
    scene.tools.iter_mut().for_each(|tool| tool.place = nowhere.clone());
    scene
}

/// A scene as text says the same, with what was laid over it, and takes what was done by hand behind it.
#[test]
fn a_scene_as_text_says_the_same() {
    for (name, text) in SHIPPED.into_iter().chain([("full.toml", EVERYTHING)]) {
        let overrides = [
            ("solver.iterations", "7"),
            ("world.gravity", "1.5 m/s^2"),
            ("solver.step_guard", "false"),
        ];
        let scene = Scene::parse(name, text, &overrides).unwrap_or_else(|e| panic!("{e}"));
        let written = scene.text();
        let again = Scene::parse(name, &written, &[]).unwrap_or_else(|e| panic!("{e}\n{written}"));
        assert!(without_places(again) == without_places(scene.clone()), "{written}");
        let longer = format!("{written}{}", scene.write(&scene.motions, &[]));
        let error = Scene::parse(name, &longer, &[]).err().map(|error| error.to_string());
        // Motions of these names are there already, or there were none.
        let expected = scene.motions.first().map(|motion| motion.name.clone());
        assert_eq!(error.is_some(), expected.is_some(), "{error:?}");
        assert!(
            error
                .is_none_or(|e| e.contains("already") && e.contains(&expected.unwrap_or_default()))
        );
    }
}
