//! `viscera mesh inspect` says what is wrong and what to do about it, and `viscera mesh repair` does it.

use crate::common::{Bench, TINY};

/// A cube of 20 mm of five tetrahedra, whose last one is there twice; the sixth is flat on a face of the cube.
const DAMAGED: &str = "\
$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
8
1 0 0 0
2 0.02 0 0
3 0.02 0.02 0
4 0 0.02 0
5 0 0 0.02
6 0.02 0 0.02
7 0.02 0.02 0.02
8 0 0.02 0.02
$EndNodes
$Elements
7
1 4 2 1 1 1 2 4 5
2 4 2 1 1 3 4 2 7
3 4 2 1 1 6 5 7 2
4 4 2 1 1 8 7 5 4
5 4 2 1 1 2 4 5 7
6 4 2 1 1 7 5 4 2
7 4 2 1 1 5 6 7 8
$EndElements
";

#[test]
fn a_mesh_that_is_refused_is_mended_by_the_command_that_the_error_names() {
    let bench = Bench::new(TINY);
    bench.write("cube.msh", DAMAGED.as_bytes());
    for arguments in [&["mesh", "inspect", "cube.msh"][..], &["run", "cube.msh"]] {
        let end = bench.end_of(arguments);
        let error = end.error();
        assert!(error.contains("`viscera mesh repair`"), "{error}");
    }
    let end = bench.end_of(&["mesh", "repair", "cube.msh", "whole.vtu"]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    for part in ["1 tetrahedra left out that repeat others", "1 slivers taken off", "wrote"] {
        assert!(end.stdout.contains(part), "{}", end.stdout);
    }
    assert!(end.stdout.contains("can be simulated as it is"), "{}", end.stdout);
    assert!(!end.stdout.contains("mesh repair"), "{}", end.stdout);
    let inspect = ["mesh", "inspect", "whole.vtu", "--unit", "1 m", "--plot", "angles.svg"];
    let end = bench.end_of(&inspect);
    assert!(end.stdout.contains("8.000 ml"), "{}", end.stdout);
    let next = "next               viscera scene new whole.vtu --unit \"1 m\"\n";
    assert!(end.stdout.ends_with(next), "{}", end.stdout);
    let svg = String::from_utf8(bench.read("angles.svg")).expect("text");
    assert!(svg.contains("<svg") && svg.contains("dihedral angle"), "{svg}");
    let json = bench.end_of(&["mesh", "inspect", "whole.vtu", "--json"]).stdout;
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(json["verdict"]["good"], true);
    // Of four corners of a cube three angles are right ones and three acos(1/sqrt(3)) = 54.7; six of a regular one are 70.5.
    let angles: Vec<u64> =
        json["angles"].as_array().expect("a list").iter().filter_map(|n| n.as_u64()).collect();
    let at = |degrees: usize| angles[degrees / 5];
    assert_eq!((angles.len(), at(54), at(70), at(90)), (36, 12, 6, 12));
    let again = bench.end_of(&["mesh", "repair", "whole.vtu", "again.vtu"]);
    assert!(again.stdout.contains("nothing to mend"), "{}", again.stdout);
}

/// A cube of 20 mm of twelve triangles as a soup; without its last one it has a hole.
fn cube(triangles: usize) -> String {
    let corner = |n: usize| [n & 1, n >> 1 & 1, n >> 2 & 1].map(|x| 0.02 * x as f64);
    let sides =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let all = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).take(triangles);
    let (mut vertices, mut faces) = (String::new(), String::new());
    for (index, triangle) in all.enumerate() {
        for [x, y, z] in triangle.map(corner) {
            vertices.push_str(&format!("v {x} {y} {z}\n"));
        }
        faces.push_str(&format!("f {} {} {}\n", 3 * index + 1, 3 * index + 2, 3 * index + 3));
    }
    vertices + &faces
}

#[test]
fn surfaces_are_closed() {
    let bench = Bench::new(TINY);
    for (name, triangles) in [("soup.obj", 12), ("hole.obj", 11)] {
        bench.write(name, cube(triangles).as_bytes());
        let inspect = bench.end_of(&["mesh", "inspect", name, "--unit", "1 m"]).stdout;
        assert!(inspect.contains("do not have exactly two triangles"), "{inspect}");
        let command =
            format!("viscera mesh repair {name} {}_repaired.obj", name.trim_end_matches(".obj"));
        assert!(inspect.contains(&command), "{inspect}");
        let end = bench.end_of(&["mesh", "repair", name, "closed.obj", "--edge", "2 mm"]);
        assert_eq!(end.code, Some(0), "{}", end.stderr);
        assert!(end.stdout.contains("vertices in the place of others"), "{}", end.stdout);
        assert_eq!(end.stdout.contains("closed, with"), triangles == 11, "{}", end.stdout);
        let json =
            bench.end_of(&["mesh", "inspect", "closed.obj", "--unit", "1 m", "--json"]).stdout;
        let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
        assert_eq!(json["open_edge_count"], 0);
        let volume = json["volume"].as_f64().expect("a volume");
        assert!((volume / 8e-6 - 1.0).abs() < 0.02, "{volume}");
    }
}

#[test]
fn slivers_that_stay_are_filled_anew() {
    let bench = Bench::new(TINY);
    // A plate of 20 mm that is .2 mm thick, of one cell.
    bench.write("plate.msh", DAMAGED.replace("0.02\n", "0.0002\n").as_bytes());
    let end = bench.end_of(&["mesh", "repair", "plate.msh", "plate.vtu"]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    let refill = "viscera mesh repair plate.msh plate.vtu --refill\n";
    assert!(
        end.stdout.contains("below 5 degrees") && end.stdout.ends_with(refill),
        "{}",
        end.stdout
    );
    bench.write("cube.msh", DAMAGED.as_bytes());
    let end =
        bench.end_of(&["mesh", "repair", "cube.msh", "fine.vtu", "--refill", "--edge", "4 mm"]);
    assert!(end.stdout.contains("filled anew with"), "{}", end.stdout);
    let json = bench.end_of(&["mesh", "inspect", "fine.vtu", "--unit", "1 m", "--json"]).stdout;
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert!(json["tet_count"].as_u64() > Some(200), "{json}");
    assert!((json["volume"].as_f64().expect("a volume") / 8e-6 - 1.0).abs() < 0.02, "{json}");
}

#[test]
fn what_cannot_be_mended_is_refused() {
    let bench = Bench::new(TINY);
    bench.write("cube.msh", DAMAGED.as_bytes());
    bench.write("soup.obj", cube(12).as_bytes());
    bench.write("flat.obj", b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
    bench.write("open.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    for (arguments, expected) in [
        (&["cube.msh", "cube.obj"][..], "tetrahedra are written as .vtu, .vtk, .msh"),
        (&["soup.obj", "soup.vtu"], "surfaces are written as .obj, .stl, .ply"),
        (&["soup.obj", "other.obj", "--refill"], "viscera mesh tetrahedralize soup.obj"),
        (&["cube.msh", "cube.msh"], "is the file that is read"),
        (&["cube.msh", "new.vtu", "--weld", "0 mm"], "--weld"),
        (&["absent.msh", "new.vtu"], "absent.msh"),
        (&["flat.obj", "new.obj"], "flat.obj"),
        (&["open.obj", "new.obj"], "open.obj: inside and outside of the surface cannot be told"),
        (&["cube.msh", "new.vtu", "--refill", "--edge", "1 um"], "cube.msh: a spacing of"),
    ] {
        let end = bench.end_of(&[&["mesh", "repair"], arguments].concat());
        assert!(end.error().contains(expected), "{arguments:?}: {}", end.stderr);
    }
    assert!(!bench.path("new.vtu").exists() && !bench.path("new.obj").exists());
    let plot = ["mesh", "inspect", "soup.obj", "--plot", "a.svg"];
    assert!(bench.end_of(&plot).error().contains("tetrahedralize"));
}
