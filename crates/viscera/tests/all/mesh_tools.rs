//! Instruments of any shape in scenes: from files, from code, and those that cannot be.

use viscera::contact::Shape;
use viscera::mesh::SurfaceMesh;
use viscera::mesh::io::obj;
use viscera::mesh::shapes::turned;
use viscera::scalar::{Vec3, vec3};
use viscera::scene::{RidgedJaw, Scene};
use viscera::simulation::{Assembly, Simulation};

const BODY: &str = r#"
world = { gravity = 0 }
time = { duration = "1 s", velocity_factor = 0.9 }
solver = { substeps = 2 }

[[body]]
name = "strip"
shape = "block"
size = ["40 mm", "6 mm", "12 mm"]
cells = [14, 2, 4]
material = { young = "20 kPa", poisson = 0.45, viscosity = "20 ms" }

[[fixing]]
name = "clamp"
body = "strip"
half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }
"#;

/// Jaws that close on the strip's free end, and pull.
const GRASPER: &str = r#"
[[tool]]
name = "grasper"
kind = "atraumatic_grasper"
length = "60 mm"
position = ["52 mm", "3 mm", "6 mm"]
rotation_axis = [0, 1, 0]
rotation_angle = "90 deg"
friction = 0.8
jaw = [{ time = 0, angle = "36 deg" }, { time = "0.3 s", angle = "8 deg" }]
keys = [{ time = "0.3 s" }, { time = "0.7 s", translation = ["6 mm", 0, 0] }]
"#;

fn assembled(text: &str, file: &SurfaceMesh) -> Result<(Scene, Assembly), String> {
    let scene = Scene::parse("t.toml", text, &[]).map_err(|error| error.to_string())?;
    let bytes = obj::write(file, None).expect("a surface");
    let assembly = Assembly::new(&scene, &mut |_| Ok(bytes.clone().into_bytes()));
    assembly.map(|assembly| (scene, assembly)).map_err(|error| error.to_string())
}

fn run(text: &str, file: &SurfaceMesh) -> Simulation<f64> {
    let text = text.replace("substeps = 2", "substeps = 2, precision = \"f64\"");
    let (scene, assembly) = assembled(&text, file).unwrap_or_else(|e| panic!("{e}"));
    Simulation::new(scene, assembly).unwrap_or_else(|e| panic!("{e}"))
}

/// A rod of 3 mm radius along +z with a flat end at the origin; in millimetres.
fn rod() -> SurfaceMesh {
    turned(&[[0.0, 0.0], [3.0, 0.0], [3.0, 40.0], [0.0, 40.0]], 48)
}

fn mesh_tool(keys: &str) -> String {
    format!(
        "{BODY}\n[[tool]]\nname = \"rod\"\nkind = \"mesh\"\n{keys}\nposition = [\"30 mm\", \"3 mm\", \"20 mm\"]\n"
    )
}

#[test]
fn a_file_is_a_tool() {
    let text = mesh_tool("mesh = \"rod.obj\"\nunit = \"1 mm\"");
    let (scene, assembly) = assembled(&text, &rod()).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(scene.files(), ["rod.obj"]);
    let [part] = &assembly.tools[0].parts[..] else { panic!("one part") };
    let Shape::Mesh(grid) = &part.shape else { panic!("a mesh") };
    assert!(
        (grid.cell() - 0.5e-3).abs() < 1e-12
            && grid.surface().triangles.len() == rod().triangles.len()
    );
    assert!((part.shape.distance(vec3(0.0, 0.0, -2e-3)).value - 2e-3).abs() < 1e-5);
    assert!((part.shape.thinnest() - 3e-3).abs() < 1e-4);
}

#[test]
fn files_that_are_no_tool_say_what_to_do() {
    let good = "mesh = \"rod.obj\"\nunit = \"1 mm\"";
    for (keys, message) in [
        ("", "`mesh` is missing, for example mesh = \"hook.obj\" and unit = \"1 mm\""),
        (
            "mesh = \"rod.obj\"",
            "`unit` is missing, for example unit = \"1 mm\" where 1 in the mesh file is a millimetre",
        ),
        (
            "mesh = \"rod.obj\"\nunit = \"1 mm\"\nradius = \"1 mm\"",
            "`radius` means nothing for a mesh, which takes mesh, unit",
        ),
    ] {
        let found = assembled(&mesh_tool(keys), &rod()).map(|_| ()).expect_err(message);
        assert_eq!(found, format!("t.toml, line 18, column 1: tool `rod`: {message}"));
    }
    let refused = |surface: &SurfaceMesh, message: &str| {
        let found = assembled(&mesh_tool(good), surface).map(|_| ()).expect_err(message);
        assert!(found.starts_with("t.toml, line 18, column 1: tool `rod`: rod.obj: "), "{found}");
        assert!(found.contains(message), "{found}");
    };
    let mut open = rod();
    open.triangles.pop();
    refused(&open, "its surface is open at 3 edges, one of them from (");
    let mut inside_out = rod();
    inside_out.triangles.iter_mut().for_each(|corners| corners.swap(0, 1));
    refused(&inside_out, "it is inside out: its triangles are wound inwards; flip its normals");
    let mut flat = rod();
    flat.vertices.iter_mut().for_each(|x| x.z = 0.0);
    refused(&flat, "it encloses no volume");
    // In metres it would be forty metres long.
    let large = good.replace("1 mm", "1 m");
    let found = assembled(&mesh_tool(&large), &rod()).map(|_| ()).expect_err("too large");
    assert!(found.contains("MiB at cells of 0.500 mm"), "{found}");
}

/// A grasper of the library holds what it squeezes: the strip's end comes along.
#[test]
fn ridged_jaws_hold_what_they_pinch() {
    let mut run = run(&format!("{BODY}{GRASPER}"), &rod());
    assert_eq!(run.assembly().tools[0].parts.len(), 3);
    let rest: Vec<Vec3<f64>> = run.state().positions.clone();
    while run.time() < 0.9 - 1e-9 {
        run.advance_frame().unwrap_or_else(|e| panic!("{e}"));
    }
    assert!(run.state().is_finite());
    let report = run.report();
    let tool = report.tools.first().expect("a tool");
    assert!(tool.touches > 20 && tool.force[0] < -0.02, "{tool:?}");
    let ends = rest.iter().zip(&run.state().positions).filter(|(x, _)| x.x > 0.0399);
    let ways: Vec<f64> = ends.map(|(x, now)| now.x - x.x).collect();
    let mean = ways.iter().sum::<f64>() / ways.len() as f64;
    assert!(mean > 4e-3, "the end has come {mean} m of 6 mm");
}

/// Two instruments that are driven through each other with tissue in between: finite, and told.
#[test]
fn instruments_that_are_driven_into_each_other_are_told() {
    let other = GRASPER
        .replace("name = \"grasper\"", "name = \"suction\"")
        .replace("atraumatic_grasper", "suction_tip")
        .replace("[\"52 mm\", \"3 mm\", \"6 mm\"]", "[\"36 mm\", \"3 mm\", \"18 mm\"]");
    let own: Vec<&str> = other
        .lines()
        .filter(|line| !["jaw", "rotation", "keys"].iter().any(|key| line.starts_with(key)))
        .collect();
    let keys =
        "keys = [{ time = \"0.3 s\" }, { time = \"0.6 s\", translation = [0, 0, \"-14 mm\"] }]";
    let still = GRASPER.replace("translation = [\"6 mm\", 0, 0]", "translation = [0, 0, 0]");
    let mut run = run(&format!("{BODY}{still}{}\n{keys}\n", own.join("\n")), &rod());
    let mut told = 0;
    while run.time() < 0.8 - 1e-9 {
        run.advance_frame().unwrap_or_else(|e| panic!("{e}"));
        let forces = run.tool_forces();
        assert!(forces.iter().flat_map(|tool| tool.force).all(f64::is_finite));
        told += usize::from(forces.iter().any(|tool| tool.crossed.is_some()));
    }
    assert!(run.state().is_finite());
    let forces = run.tool_forces();
    let crossed = forces[1].crossed.as_ref().expect("it is told");
    assert!(crossed.tool == "grasper" && crossed.depth > 5e-4, "{crossed:?}");
    assert!(forces[1].to_string().contains("mm inside `grasper`"), "{}", forces[1]);
    assert!(told > 5 && told < 40, "{told}");
}

#[test]
fn a_fan_retractor_spreads_its_fingers_from_its_hinge() {
    let text =
        format!("{BODY}\n[[tool]]\nkind = \"fan_retractor\"\nposition = [0, 0, \"50 mm\"]\n");
    let (_, assembly) = assembled(&text, &rod()).unwrap_or_else(|e| panic!("{e}"));
    let mut parts = Vec::new();
    assembly.tools[0].parts_at(0.0, 0.0, &mut parts);
    assert_eq!(parts.len(), 6);
    let nearest =
        |x: Vec3<f64>| parts.iter().map(|part| part.distance(x).value).fold(f64::MAX, f64::min);
    // The middle of the middle finger's end, the hinge, and the ends of the outer fingers at 30 degrees.
    let base = vec3(0.0, 0.0, 0.05);
    assert!(nearest(base).abs() < 1e-9 && nearest(base + vec3(0.0, 0.0, 0.06)) < -1e-3);
    for side in [1.0, -1.0] {
        let (sin, cos) = libm::sincos(std::f64::consts::PI / 6.0);
        let end = base + vec3(side * 0.06 * sin, 0.0, 0.06 * (1.0 - cos));
        assert!(nearest(end).abs() < 1e-9, "{}", nearest(end));
    }
    // Between two fingers there is room.
    assert!(nearest(base + vec3(7.5e-3, 0.0, 2e-3)) > 3e-3);
}

/// Jaws from a file: as long as it says, one on each side.
#[test]
fn jaws_may_come_from_a_file() {
    let jaw = |away: f64| {
        let size = [5.0, 3.0, 20.0];
        let (rounding, height, spacing) = (0.4, 0.5, 2.0);
        RidgedJaw { size, away, rounding, height, spacing, is_other: false }.surface()
    };
    let tool = GRASPER.replace("atraumatic_grasper", "grasper").replace(
        "length = \"60 mm\"",
        "jaw_mesh = \"jaw.obj\"\nunit = \"1 mm\"\njaw_gap = \"1 mm\"",
    );
    let (scene, assembly) =
        assembled(&format!("{BODY}{tool}"), &jaw(0.0)).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(scene.files(), ["jaw.obj"]);
    let grasper = &assembly.tools[0];
    let jaws = grasper.jaws.as_ref().expect("jaws");
    assert!((jaws.length - 0.02).abs() < 1e-9);
    let [Shape::Mesh(a), Shape::Mesh(b)] = [&grasper.parts[0].shape, &grasper.parts[1].shape]
    else {
        panic!("meshes")
    };
    assert!(std::sync::Arc::ptr_eq(a, b), "one grid for both");
    let message = assembled(&format!("{BODY}{tool}"), &jaw(-1.0)).map(|_| ()).expect_err("beyond");
    assert!(
        message.ends_with(
            "its jaw reaches 1.000 mm beyond the plane between both; move the mesh along y by that"
        ),
        "{message}"
    );
    let closed = tool.replace("angle = \"8 deg\"", "angle = \"-9 deg\"");
    let message =
        assembled(&format!("{BODY}{closed}"), &jaw(0.0)).map(|_| ()).expect_err("overlap");
    assert!(message.contains("at -9 deg its jaws overlap; close them to -2.864"), "{message}");
}
