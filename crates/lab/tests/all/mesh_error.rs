//! What a run says of its mesh, beside the body by ten-node tetrahedra; a scene on finer meshes.

use std::process::Command;

use viscera::scene::Scene;
use viscera::simulation::{Assembly, MeshReport, Simulation};
use viscera_lab::bending::bodies::{BAR, Body, Filling, Shape};
use viscera_lab::bending::truth::extrapolated;
use viscera_lab::bending::{Element, Load, YOUNG, response};
use viscera_lab::converge::compute;

/// The bar of `viscera_lab::bending`, which sinks under its weight.
const SCENE: &str = r#"
[time]
duration = "3 s"
velocity_factor = 0.9
[[body]]
name = "bar"
shape = "block"
size = ["80 mm", "20 mm", "20 mm"]
cells = [8, 2, 2]
material = { young = "50 kPa", poisson = 0.3, density = "1000 kg/m^3" }
[[fixing]]
name = "wall"
body = "bar"
half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }
"#;

fn scene(overrides: &[(&str, &str)]) -> Scene {
    Scene::parse("bar.toml", SCENE, overrides).unwrap_or_else(|error| panic!("{error}"))
}

fn assembly(scene: &Scene) -> Assembly {
    Assembly::new(scene, &mut |file| Err(file.to_owned())).unwrap_or_else(|e| panic!("{e}"))
}

fn report(overrides: &[(&str, &str)]) -> Option<MeshReport> {
    let scene = scene(overrides);
    let assembly = assembly(&scene);
    let frames = scene.frame_count();
    let mut simulation = Simulation::<f32>::new(scene, assembly).expect("a simulation");
    assert_eq!(simulation.mesh_error(), None, "before the first frame");
    for _ in 0..frames {
        simulation.advance().expect("a frame");
    }
    simulation.mesh_error()
}

/// The truth is another program's: states of rest of the Newton reference, quadratic tetrahedra extrapolated. The end of the
/// bar goes farthest, and its error is nearly that of all of the bar.
#[test]
fn a_run_tells_how_far_its_mesh_is_from_the_body() {
    assert_eq!((BAR, YOUNG), ([0.08, 0.02, 0.02], 5e4));
    let load = Load::Sag(1.0);
    let body = |across| Body::new(Shape::Bar, Filling::Five, across).expect("a mesh");
    let [coarse, fine] = [1, 2].map(|across| {
        response(&body(across), Element::Quadratic, load, 0.3).expect("a state of rest")
    });
    let truth = extrapolated(&[1, 2], &[coarse, fine]).value;
    let linear = response(&body(2), Element::Linear, load, 0.3).expect("a state of rest");
    let error = 1.0 - linear / truth;
    assert!(error > 0.25, "{error}");
    let told = report(&[("solver.elements", "plain")]).expect("an estimate");
    println!("linear: off by {error:.3}, told {told:?}");
    assert!(told.complete && told.stiffness > 0.0);
    assert!(told.displacement > 0.5 * error && told.displacement < 2.0 * error);
    // The wall carries the weight on any mesh.
    assert!(told.force < 0.01, "{told:?}");
    let advice = told.advice().expect("too coarse");
    assert!(advice.contains("mm") && told.edge_for_five_percent < told.edge, "{advice}");
    let recovered = report(&[]).expect("an estimate");
    println!("recovered-gradient: {recovered:?}");
    assert!(recovered.displacement < 0.15 * told.displacement && recovered.advice().is_none());
}

/// Nothing holds the bar.
#[test]
fn no_estimate_is_made_where_rest_is_not_determined() {
    let wall = SCENE.find("[[fixing]]").expect("a wall");
    let free = Scene::parse("free.toml", &SCENE[..wall], &[]).expect("a scene");
    let assembly = assembly(&free);
    let mut simulation = Simulation::<f32>::new(free, assembly).expect("a simulation");
    simulation.advance().expect("a frame");
    assert_eq!(simulation.mesh_error(), None);
}

/// Refined twice, the bar is what it was, held where it was.
#[test]
fn refined_bodies_keep_place_and_patches() {
    let [coarse, fine] = ["0", "2"].map(|refine| assembly(&scene(&[("body.bar.refine", refine)])));
    let again = coarse.refined(&scene(&[])).and_then(|once| once.refined(&scene(&[])));
    let again = again.expect("finer meshes");
    assert_eq!(fine.bodies[0].mesh, again.bodies[0].mesh);
    assert_eq!(fine.fixings, again.fixings);
    assert_eq!(fine.bodies[0].mesh.tets().len(), 64 * coarse.bodies[0].mesh.tets().len());
    assert_eq!(fine.fixings[0].vertices.len(), 9 * 9);
    let is_at_wall = |&v: &u32| fine.bodies[0].mesh.vertices()[v as usize].x.abs() < 1e-12;
    assert!(fine.fixings[0].vertices.iter().all(is_at_wall));
}

/// Errors fall from mesh to mesh with both kinds of tetrahedra, and those of recovered-gradient ones are smaller.
#[test]
fn finer_meshes_lead_to_one_body() {
    let found =
        compute(&scene(&[]), &mut |file| Err(file.to_owned()), 2, None).expect("two meshes");
    let errors = found.curves.each_ref().map(|curve| {
        let errors: Vec<f64> = curve.meshes.iter().map(|mesh| found.error(mesh)).collect();
        [errors[0], errors[1]]
    });
    println!("{errors:?}");
    for [coarse, fine] in errors {
        assert!(fine < 0.7 * coarse);
    }
    assert!(errors[1][0] < 0.15 * errors[0][0] && errors[1][1] < 0.5 * errors[0][1]);
}

fn converge(arguments: &[&str]) -> (bool, String) {
    let run =
        Command::new(env!("CARGO_BIN_EXE_viscera-lab")).arg("converge").args(arguments).output();
    let run = run.expect("the program");
    let all = [run.stdout, run.stderr].concat();
    (run.status.success(), String::from_utf8_lossy(&all).into_owned())
}

#[test]
fn converge_prints_draws_and_refuses() {
    let folder = std::env::temp_dir().join(format!("viscera-converge-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let file = folder.join("bar.toml");
    std::fs::write(&file, SCENE).expect("a file");
    let (file, out) = (file.display().to_string(), folder.join("bar.svg").display().to_string());
    let coarse = "body.bar.cells=[4, 1, 1]";
    let (ended, text) = converge(&[&file, "--meshes", "2", "--set", coarse, "--out", &out]);
    assert!(ended, "{text}");
    for words in ["recovered-gradient", "off by", "wall", "the body itself", "estimated"] {
        assert!(text.contains(words), "{text}");
    }
    assert!(std::fs::read_to_string(&out).is_ok_and(|svg| svg.contains("<svg")));
    for (arguments, words) in [
        (&["nowhere.toml"][..], "nowhere.toml"),
        (&[&file, "--meshes", "9"], "2..=4"),
        (&[&file, "--out", "plot.png"], ".svg"),
        (&[&file, "--set", "body.bar.refine=3", "--meshes", "4", "--memory", "1 MB"], "memory"),
        (&[&file, "--set", "solver.elements=square"], "recovered"),
    ] {
        let (ended, text) = converge(arguments);
        assert!(!ended && text.contains(words), "{arguments:?}: {text}");
    }
    std::fs::remove_dir_all(&folder).expect("the folder");
}
