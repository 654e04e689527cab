//! Patches and regions of scenes by the names that mesh files have for them.

use viscera::model::{ModelBuilder, Tet};
use viscera::scene::{Scene, Selector};
use viscera::simulation::{AssembleError, Assembly, Simulation};

/// Two tetrahedra. No element has the first node, so that vertices move up by one.
const MESH: &str = "*NODE\n1, 9, 9, 9\n2, 0, 0, 0\n3, 1, 0, 0\n4, 0, 1, 0\n5, 0, 0, 1\n6, 1, 1, 1\n\
    *ELEMENT, TYPE=C3D4, ELSET=base\n1, 2, 3, 4, 5\n*ELEMENT, TYPE=C3D4, ELSET=top lobe\n2, 3, 4, 5, 6\n\
    *NSET, NSET=wall\n1, 2, 3, 4\n*NSET, NSET=tip \\ 'a'\n6\n";

const SCENE: &str = r#"
[[body]]
name = "organ"
mesh = "organ.inp"
unit = "100 mm"
material = { young = "5 kPa" }
[[body.region]]
label = "top lobe"
young = "50 kPa"

[[fixing]]
name = "wall"
body = "organ"
patch = "wall"

[[force]]
name = "lift"
body = "organ"
region = "top lobe"
force = [0, 0, "1 mN"]

[[spring]]
name = "ligament"
stiffness = "1 N/m"
from = { body = "organ", patch = "wall" }
to = { body = "organ", patch = "tip \\ 'a'" }

[[motion]]
name = "pull"
body = "organ"
patch = "tip \\ 'a'"
keys = [{ time = "0.1 s", translation = ["5 mm", 0, 0] }]
"#;

fn scene(overrides: &[(&str, &str)]) -> Scene {
    Scene::parse("organ.toml", SCENE, overrides).unwrap_or_else(|error| panic!("{error}"))
}

fn assemble(scene: &Scene, mesh: &str) -> Result<Assembly, AssembleError> {
    Assembly::new(scene, &mut |_| Ok(mesh.as_bytes().to_vec()))
}

fn assembly(scene: &Scene) -> Assembly {
    assemble(scene, MESH).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn names_stand_for_vertices_wherever_a_scene_selects_some() {
    let scene = scene(&[]);
    let found = assembly(&scene);
    // The node that no element has is in the file's patch only.
    assert_eq!(found.fixings[0].vertices, [0, 1, 2]);
    assert_eq!(found.motions[0].vertices, [4]);
    assert_eq!(found.forces[0].vertices, [1, 2, 3, 4]);
    let mut simulation = Simulation::<f64>::new(scene, found).expect("a simulation");
    for _ in 0..6 {
        simulation.advance().expect("a frame");
    }
    let report = simulation.report();
    let at = |v: usize| simulation.state().positions[v];
    assert!((at(4).x - 0.105).abs() < 1e-12 && at(0).length() == 0.0, "{report:?}");
}

#[test]
fn a_region_by_its_name_has_its_material() {
    let scene = scene(&[]);
    let found = assembly(&scene);
    let ratio = |builder: &ModelBuilder| {
        let model = builder.build::<f64>().expect("a model");
        let of = |tet: Tet<f64>| model.materials[tet.material as usize].lame_mu;
        let stiffness: Vec<f64> = model.tets().map(of).collect();
        stiffness[1] / stiffness[0]
    };
    assert!((ratio(&found.builder) - 10.0).abs() < 1e-12);
    let mut changed = scene.clone();
    let soft = [("body.organ.region.0.young".to_owned(), "\"20 kPa\"".to_owned())];
    changed.change(&soft).expect("a change");
    let builder = found.with_materials(&changed).expect("materials");
    assert!((ratio(&builder) - 4.0).abs() < 1e-12);
}

#[test]
fn refined_meshes_keep_their_patches() {
    let scene = scene(&[("body.organ.refine", "1")]);
    let once = assembly(&scene);
    let again = assembly(&self::scene(&[])).refined(&self::scene(&[])).expect("a finer mesh");
    for finer in [&once, &again] {
        let vertices = finer.bodies[0].mesh.vertices();
        let of_wall = &finer.fixings[0].vertices;
        // Three corners, and the middles of the edges between them.
        assert_eq!(of_wall.len(), 6);
        assert!(of_wall.iter().all(|&v| vertices[v as usize].z == 0.0));
        assert_eq!(finer.motions[0].vertices, [4]);
    }
}

#[test]
fn names_that_a_mesh_does_not_have_are_refused() {
    let message = |key: &str, value: &str, mesh: &str| {
        assemble(&scene(&[(key, value)]), mesh).expect_err("an unknown name").to_string()
    };
    let found = message("fixing.wall.patch", "wal", MESH);
    assert_eq!(
        found,
        "organ.toml, line 11, column 1: fixing `wall` selects nothing: the body's mesh has no patch `wal`; its patches are \
         `tip \\ 'a'`, `wall`; did you mean `wall`?"
    );
    let found = message("body.organ.region.0.label", "\"lobe\"", MESH);
    assert_eq!(found, "body `organ` has no region `lobe`; its regions are 1 `base`, 2 `top lobe`");
    let (without, _) = MESH.split_once("*NSET").expect("sets");
    let found = message("solver.iterations", "2", without);
    assert!(
        found.contains("fixing `wall` selects nothing: the body's mesh has no named patches"),
        "{found}"
    );
    let ball = ("body.organ.region.0.sphere", "{ center = [0, 0, 0], radius = \"10 mm\" }");
    let error = Scene::parse("organ.toml", SCENE, &[ball]).expect_err("a name for a ball");
    assert!(error.to_string().contains("which is a number"), "{error}");
}

/// Holds are written into scene files and recordings, whatever selects their vertices.
#[test]
fn names_are_written_as_they_were_read() {
    let scene = scene(&[]);
    let (rest, _) = SCENE.split_once("[[motion]]").expect("a motion");
    let mut motion = scene.motions[0].clone();
    for selector in [motion.patch.selector.clone(), Selector::NamedRegion("top lobe".into())] {
        motion.patch.selector = selector.clone();
        let text = rest.to_owned() + &scene.write(std::slice::from_ref(&motion), &[]);
        let back = Scene::parse("organ.toml", &text, &[]).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(back.motions[0].patch.selector, selector);
        let bytes = postcard::to_allocvec(&selector).expect("bytes");
        assert_eq!(postcard::from_bytes::<Selector>(&bytes).as_ref(), Ok(&selector));
    }
    // Recordings of earlier versions say so.
    assert_eq!(postcard::to_allocvec(&Selector::Region(3)).expect("bytes"), [4, 3]);
}
