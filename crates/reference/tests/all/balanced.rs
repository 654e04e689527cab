//! Bodies that rest under gravity as they were given, before an independent solution.

use viscera::mesh::TetMesh;
use viscera::mesh::shapes::beam;
use viscera::model::ModelBuilder;
use viscera::rest::{TooSoft, Unloaded};
use viscera::scalar::{Vec3, vec3};
use viscera::scene::Scene;
use viscera::settings::Elements;
use viscera::simulation::{Assembly, Simulation};
use viscera::solver::{Inputs, Pin};
use viscera_reference::Reference;

use viscera::material::{Material, MaterialModel};

const GRAVITY: Vec3<f64> = vec3(0.0, 0.0, -9.81);

fn farthest(a: &[Vec3<f64>], b: &[Vec3<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max)
}

/// Held by its end at x = 0.
fn inputs(places: &[Vec3<f64>], rest: &[Vec3<f64>]) -> Inputs<f64> {
    let held = (0u32..).zip(rest).filter(|(_, x)| x.x < 1e-9);
    let pins = held.map(|(vertex, _)| Pin { vertex, target: places[vertex as usize] });
    Inputs { gravity: GRAVITY, pins: pins.collect(), ..Inputs::default() }
}

/// A bar that sags by a third of its length, by the reference, is straight again without load: to what is left of forces
/// over the stiffness, a thousandth of the way at most.
#[test]
fn a_body_that_was_loaded_is_unloaded_to_what_it_was() {
    for law in [MaterialModel::StableNeoHookean, MaterialModel::SaintVenantKirchhoff] {
        let straight = beam(0.12, 0.03, 0.03, 3, 0.0).expect("a bar");
        let material = Material::new(law, 30e3, 0.4, 1050.0).expect("a material");
        let mut builder = ModelBuilder::new();
        builder.add_body(&straight, &material).expect("a body");
        let model = builder.build::<f64>().expect("a model");
        let held = inputs(straight.vertices(), straight.vertices());
        let loaded = Reference::new(&model).settle(straight.vertices(), &held).expect("rest");
        let sag = farthest(&loaded.positions, straight.vertices());
        assert!(sag > 0.03, "{sag}");

        let given = TetMesh::new(
            loaded.positions.clone(),
            straight.tets().to_vec(),
            straight.regions().to_vec(),
        );
        let mut builder = ModelBuilder::new();
        builder.add_body(&given.expect("a mesh").0, &material).expect("a body");
        let mut bent = builder.build::<f64>().expect("a model");
        // Volumes have changed a little; tissue has not been lost.
        bent.masses.clone_from(&model.masses);
        let held = inputs(&loaded.positions, straight.vertices());
        let found = Unloaded::find(&bent, &held, Elements::Plain).expect("a shape without load");
        let off = farthest(&found.positions, straight.vertices());
        assert!(off < 1e-3 * sag, "{law:?}: {off:e} m of {sag:e} m");
        assert!((found.sag - sag).abs() < 1e-3 * sag);
        assert!(found.unbalanced < 1e-6);
    }
}

const BAR: &str = r#"
[[body]]
name = "bar"
shape = "beam"
length = "120 mm"
width = "40 mm"
height = "40 mm"
cells_across = 3
balanced = true
material = { young = "15 kPa", poisson = 0.45, density = "1050 kg/m^3" }

[[body.region]]
label = 7
sphere = { center = ["60 mm", 0, 0], radius = "15 mm" }
young = "60 kPa"

[[fixing]]
name = "wall"
body = "bar"
half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }
"#;

fn simulation(text: &str, settings: &[(&str, &str)]) -> Simulation<f64> {
    let scene = Scene::parse("scene.toml", text, settings).expect("a legal scene");
    let assembly = Assembly::new(&scene, &mut |_| Err("no files".to_owned())).expect("meshes");
    Simulation::new(scene, assembly).expect("a simulation")
}

/// Forces at the given shape, and the way that is left to rest, as the reference has them. Without a balance it sags by
/// 40 mm.
#[test]
fn what_is_balanced_is_at_rest_before_the_reference() {
    for elements in ["plain", "recovered"] {
        let settings = [("solver.elements", elements)];
        let balanced = simulation(BAR, &settings);
        let (model, inputs) = (balanced.model(), balanced.inputs_at(0.0));
        let mut reference = Reference::with_elements(model, balanced.solver().elements);
        let start = &model.rest_positions;
        let standing = reference.standing(start, &inputs).expect("forces");
        let left = standing.gradient / standing.load;
        assert!(left < 1e-5, "{elements}: {left:e}");
        let rest = reference.settle(start, &inputs).expect("rest");
        let way = farthest(&rest.positions, start);
        assert!(way < 1e-6, "{elements}: {way:e} m");

        let settings = [settings[0], ("body.bar.balanced", "false")];
        let plain = simulation(BAR, &settings);
        let mut reference = Reference::with_elements(plain.model(), plain.solver().elements);
        let rest = reference.settle(&plain.model().rest_positions, &inputs).expect("rest");
        assert!(farthest(&rest.positions, &plain.model().rest_positions) > 0.02);
    }
}

/// A column that stands on its end falls over above `7.84 E I/(rho g A)`, the cube of its length (Greenhill, 1881), though
/// forces are in balance while it is straight; one that hangs does not.
#[test]
fn what_would_fall_over_is_too_soft() {
    let column = beam(0.15, 0.02, 0.02, 3, 0.0).expect("a column");
    let material = Material::new(MaterialModel::StableNeoHookean, 30e3, 0.4, 1000.0);
    let mut builder = ModelBuilder::new();
    builder.add_body(&column, &material.expect("a material")).expect("a body");
    let model = builder.build::<f64>().expect("a model");
    let find = |along: f64| {
        let held = inputs(column.vertices(), column.vertices());
        let inputs = Inputs { gravity: vec3(along, 0.0, 0.0), ..held };
        Unloaded::find(&model, &inputs, Elements::Recovered)
    };
    let critical = 7.84 * 30e3 * 0.02 * 0.02 / 12.0 / (1000.0 * 9.81 * 0.15f64.powi(3));
    let Err(TooSoft { share }) = find(-9.81) else { panic!("it stands on a share of {critical}") };
    assert!(share > 0.5 * critical && share < 1.2 * critical, "{share} of {critical}");
    assert!(find(9.81).is_ok());
}

/// A density that is said to work does, and twice as much does not.
#[test]
fn what_cannot_be_carried_is_told_with_what_can() {
    let bar = beam(0.2, 0.02, 0.02, 2, 0.0).expect("a bar");
    let find = |density: f64| {
        let material = Material::new(MaterialModel::StableNeoHookean, 50e3, 0.4, density);
        let mut builder = ModelBuilder::new();
        builder.add_body(&bar, &material.expect("a material")).expect("a body");
        let model = builder.build::<f64>().expect("a model");
        Unloaded::find(&model, &inputs(bar.vertices(), bar.vertices()), Elements::Plain)
    };
    let Err(TooSoft { share }) = find(1000.0) else {
        panic!("a bar this soft does not carry itself")
    };
    assert!(share > 0.05 && share < 0.8, "{share}");
    assert!(find(1000.0 * share).is_ok());
}
