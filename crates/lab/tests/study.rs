//! The program `viscera-lab study`.

mod common;

use common::{lab, text};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Output;

fn quick(out: &Path, more: &[&str]) -> Output {
    let out = out.to_string_lossy();
    let mut arguments = vec!["study", "--quick", "--out", &out];
    arguments.extend(more);
    let output = lab(&arguments);
    assert!(output.status.success(), "{}", text(&output.stderr));
    output
}

/// Names and contents of the files in a folder that end so.
fn files(folder: &Path, ending: &str) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).expect("a folder").flatten();
    let named = entries.map(|entry| (entry.file_name().to_string_lossy().into_owned(), entry));
    let chosen = named.filter(|(name, _)| name.ends_with(ending));
    chosen.map(|(name, entry)| (name, fs::read(entry.path()).expect("a file"))).collect()
}

/// Everything once, and once more: what claims it makes are met, and the same numbers come out.
#[test]
fn two_quick_runs_meet_their_claims_with_the_same_numbers() {
    let folder = tempfile::tempdir().expect("a folder");
    let [first, second] = ["first", "second"].map(|name| folder.path().join(name));
    let output = quick(&first.with_extension("md"), &[]);
    let printed = text(&output.stdout);
    assert!(printed.contains("claims are met"), "{printed}");
    assert!(!printed.lines().any(|line| line.ends_with("missed")), "{printed}");
    quick(&second.with_extension("md"), &[]);
    let [ours, again] = [&first, &second].map(|folder| files(folder, ".csv"));
    assert!(ours.len() >= 7, "{:?}", ours.keys());
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
    for wanted in ["1. ", "2. ", "3. ", "4. ", "5. ", "6. ", "7. "] {
        assert!(markdown.contains(&format!("\n## {wanted}")), "no section {wanted}");
    }
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
    let block = viscera::mesh::shapes::Block {
        seed: 7,
        ..viscera::mesh::shapes::Block::new(viscera::scalar::vec3(0.3, 0.04, 0.04), [6, 2, 2])
    };
    let written = viscera::mesh::io::gmsh::write(&block.mesh().expect("a mesh"));
    fs::write(&mesh, written).expect("a file");
    let set = format!("mesh={}", mesh.display());
    let out = folder.path().join("long.md");
    quick(&out, &["--only", "coloring", "--set", &set]);
    let markdown = fs::read_to_string(&out).expect("the report");
    let tets = block.mesh().expect("a mesh").tets().len();
    assert!(markdown.contains(&format!("{tets} tetrahedra")), "{markdown}");
}

#[test]
fn changes_that_make_no_sense_are_refused_before_the_work() {
    for (change, hint) in [
        ("young", "write KEY=VALUE"),
        ("young=20 mm", "kPa"),
        ("young=0 kPa", "above zero"),
        ("poisson=0.6", "0.5"),
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
