//! The program `viscera-lab study`.

use crate::common::{lab, text};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Output;
use viscera::mesh::shapes::Block;
use viscera::mesh::{TetMesh, io::gmsh};
use viscera::scalar::vec3;
use viscera_lab::{sections::Changes, study::PROGRAM};

fn quick(out: &Path, more: &[&str]) -> Output {
    let out = out.to_string_lossy();
    let mut arguments = vec!["study", "--quick", "--out", &out];
    arguments.extend(more);
    let output = lab(&arguments);
    assert!(output.status.success(), "{}", text(&output.stderr));
    output
}

/// Names and contents of the files in a folder that end so, but for hidden ones.
fn files(folder: &Path, ending: &str) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).expect("a folder").flatten();
    let named = entries.map(|entry| (entry.file_name().to_string_lossy().into_owned(), entry));
    let chosen = named.filter(|(name, _)| name.ends_with(ending) && !name.starts_with('.'));
    chosen.map(|(name, entry)| (name, fs::read(entry.path()).expect("a file"))).collect()
}

/// Sections once, and once more: what claims they make are met, and the same numbers come out.
fn assert_two_runs_agree(sections: Option<&str>, least_tables: usize, headings: usize) {
    let folder = tempfile::tempdir().expect("a folder");
    let [first, second] = ["first", "second"].map(|name| folder.path().join(name));
    let only: Vec<&str> = sections.iter().flat_map(|&sections| ["--only", sections]).collect();
    let output = quick(&first.with_extension("md"), &only);
    let printed = text(&output.stdout);
    assert!(printed.contains("claims are met"), "{printed}");
    assert!(!printed.lines().any(|line| line.ends_with("missed")), "{printed}");
    quick(&second.with_extension("md"), &only);
    let [ours, again] = [&first, &second].map(|folder| files(folder, ".csv"));
    assert!(ours.len() >= least_tables, "{:?}", ours.keys());
    assert!(ours == again, "the numbers of two runs differ");
    assert_eq!(files(&first, ".png"), files(&second, ".png"));

    let markdown = fs::read_to_string(first.with_extension("md")).expect("the report");
    for name in files(&first, "").keys() {
        assert!(markdown.contains(&format!("(first/{name})")), "{name} is not shown");
    }
    // Every figure tells what to see, and the command that made it.
    let figures: Vec<_> = markdown.split("\n![").skip(1).collect();
    for figure in &figures {
        let caption = figure.lines().nth(2).unwrap_or_default();
        assert!(
            caption.starts_with('*') && caption.contains("viscera-lab study --only"),
            "{caption}"
        );
    }
    for number in 1..=headings {
        assert!(markdown.contains(&format!("\n## {number}. ")), "no section {number}");
    }
}

#[test]
fn two_quick_runs_meet_their_claims_with_the_same_numbers() {
    assert_two_runs_agree(Some("coloring,bodies,quasi-newton"), 3, 1);
}

#[test]
#[ignore = "slow: all sections, twice"]
fn two_quick_runs_meet_their_claims_with_the_same_numbers_at_length() {
    assert_two_runs_agree(None, 9, 8);
}

#[test]
fn changed_scenes_change_the_figures() {
    let folder = tempfile::tempdir().expect("a folder");
    let [usual, soft] = ["usual", "soft"].map(|name| folder.path().join(name));
    quick(&usual.with_extension("md"), &["--only", "coloring"]);
    let change = ["--only", "coloring", "--set", "young=20 kPa", "--set", "poisson=0.4"];
    quick(&soft.with_extension("md"), &change);
    let [ours, theirs] = [&usual, &soft].map(|folder| files(folder, ".csv"));
    assert_eq!(ours.len(), theirs.len());
    assert!(ours != theirs, "--set changed nothing");
    let markdown = fs::read_to_string(soft.with_extension("md")).expect("the report");
    assert!(markdown.contains("--set \"young=20 kPa\" --set poisson=0.4"), "{markdown}");
}

#[test]
fn a_mesh_of_the_users_takes_the_place_of_the_bar() {
    let folder = tempfile::tempdir().expect("a folder");
    let mesh = folder.path().join("bar.msh");
    let block = Block { seed: 7, ..Block::new(vec3(0.3, 0.04, 0.04), [6, 2, 2]) };
    write_mesh(&mesh, &block.mesh().expect("a mesh"));
    let set = format!("mesh={}", mesh.display());
    let out = folder.path().join("long.md");
    quick(&out, &["--only", "coloring", "--set", &set]);
    let markdown = fs::read_to_string(&out).expect("the report");
    let tets = block.mesh().expect("a mesh").tets().len();
    assert!(markdown.contains(&format!("{tets} tets")), "{markdown}");

    // It has one size: what the full study does on a finer mesh is left out.
    let cost = PROGRAM.sections.iter().find(|section| section.name == "cost").expect("a section");
    let cases = |texts: &[String], quick| {
        (cost.cases)(quick, &Changes::parse(texts).expect("changes that make sense"))
    };
    let ours = [set];
    assert_eq!(cases(&ours, true), cases(&[], true));
    assert_eq!(2 * cases(&ours, false), cases(&[], false));
}

fn write_mesh(path: &Path, mesh: &TetMesh) {
    fs::write(path, gmsh::write(mesh)).expect("a file");
}

/// A tetrahedron with these distances [m] of its corners along x.
fn tet(along: [f64; 4]) -> TetMesh {
    let corners = [[0.0, 0.0], [0.1, 0.0], [0.0, 0.1], [0.1, 0.1]];
    let places = (0..4).map(|k| vec3(along[k], corners[k][0], corners[k][1])).collect();
    TetMesh::new(places, vec![[0, 1, 2, 3]], vec![0]).expect("a mesh").0
}

#[test]
fn meshes_that_cannot_take_the_place_of_the_bar_are_refused_before_the_work() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("body.msh");
    let refusal = |hint: &str| {
        let set = format!("mesh={}", path.display());
        let out = folder.path().join("report.md");
        let output = lab(&["study", "--quick", "--set", &set, "--out", &out.to_string_lossy()]);
        let error = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{error}");
        assert!(error.starts_with(&format!("error: --set {set}: ")), "{error}");
        assert!(error.contains(hint) && error.lines().count() == 1, "{hint}: {error}");
        assert!(output.stdout.is_empty() && !out.exists());
    };
    for content in ["", "no mesh\n", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"] {
        fs::write(&path, content).expect("a file");
        refusal("body.msh");
    }
    let sound = gmsh::write(&tet([0.0, 0.1, 0.1, 0.1]));
    for number in ["1e300", "nan", "inf"] {
        fs::write(&path, sound.replacen("1 0.0 0.0 0.0", &format!("1 {number} 0 0"), 1))
            .expect("a file");
        refusal("line 6");
    }
    for (mesh, hint) in [
        (tet([0.0, 0.1, 0.1, 0.12]), "the low end along x"),
        (tet([0.0, 0.1, 0.1, 0.0]), "the low end along x"),
        (tet([0.0, 0.0, 0.0, 0.1]), "the high end along x"),
        (Block::new(vec3(0.3, 0.04, 0.04), [1, 2, 2]).mesh().expect("a mesh"), "refine it"),
    ] {
        write_mesh(&path, &mesh);
        refusal(hint);
        refusal("turn the body so that");
    }
}

#[test]
fn changes_that_make_no_sense_are_refused_before_the_work() {
    for (change, hint) in [
        ("young", "write KEY=VALUE"),
        ("young=20 mm", "kPa"),
        ("young=0 kPa", "above zero"),
        ("poisson=0.6", "at most 0.499"),
        ("poisson=soft", "no number"),
        ("yuong=20 kPa", "young, poisson or mesh"),
        ("mesh=nowhere.msh", "no file nowhere.msh"),
    ] {
        let output = lab(&["study", "--quick", "--set", change]);
        let error = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{change}: {error}");
        assert!(error.starts_with("error: --set") && error.contains(hint), "{change}: {error}");
        assert!(output.stdout.is_empty());
    }
}

#[test]
fn sections_are_listed_and_misspelt_ones_answered() {
    let printed = text(&lab(&["study", "--list"]).stdout);
    assert!(printed.lines().any(|line| line.starts_with("coloring")), "{printed}");
    let output = lab(&["study", "--only", "colouring"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("'coloring'"), "{}", text(&output.stderr));
}
