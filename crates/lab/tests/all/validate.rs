//! The program `viscera-lab validate`.

use crate::common::{lab, text};
use std::fs;
use std::path::Path;
use std::process::Output;

fn quick_patch(out: &Path) -> Output {
    lab(&["validate", "--quick", "--only", "patch", "--out", &out.to_string_lossy()])
}

#[test]
fn the_quick_patch_test_writes_its_report_twice_the_same() {
    let folder = tempfile::tempdir().expect("a folder");
    let report = folder.path().join("patch.md");
    let output = quick_patch(&report);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let printed = text(&output.stdout);
    assert!(printed.contains("2 of 2 claims are met"), "{printed}");
    assert!(printed.contains(&format!("report: {}", report.display())), "{printed}");
    // Not a terminal: one plain line per section, with its seconds.
    let progress = text(&output.stderr);
    assert!(progress.starts_with("patch: ") && progress.ends_with(" s\n"), "{progress}");

    let markdown = fs::read_to_string(&report).expect("the report");
    let verdicts = markdown.find("| what").expect("a table of verdicts");
    let section = markdown.find("## Patch test").expect("the section");
    assert!(verdicts < section, "verdicts come first");
    assert!(markdown.contains("This is the quick run"), "{markdown}");
    assert!(markdown.contains("(patch/patch-iterations.svg)"), "{markdown}");
    let figure = folder.path().join("patch/patch-iterations.svg");
    let svg = fs::read_to_string(&figure).expect("the figure");

    quick_patch(&report);
    assert_eq!(markdown, fs::read_to_string(&report).expect("the report"));
    assert_eq!(svg, fs::read_to_string(&figure).expect("the figure"));
    // Nothing else is left behind; beside the figure lies the list of what the report put there.
    assert_eq!(fs::read_dir(folder.path()).expect("the folder").count(), 2);
    assert_eq!(fs::read_dir(folder.path().join("patch")).expect("the folder").count(), 2);
}

/// Runs sections quickly: all their claims are met, and their figures are there.
fn assert_sections_hold(sections: &str, figures: &[&str]) {
    let folder = tempfile::tempdir().expect("a folder");
    let report = folder.path().join("report.md");
    let output =
        lab(&["validate", "--quick", "--only", sections, "--out", &report.to_string_lossy()]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    all_are_met(&text(&output.stdout));
    let markdown = fs::read_to_string(&report).expect("the report");
    assert!(!markdown.contains("| another minimum"), "{markdown}");
    assert!(!markdown.contains("not a number"), "{markdown}");
    for figure in figures {
        assert!(markdown.contains(&format!("(report/{figure}.svg)")), "no {figure} in {markdown}");
    }
}

/// What compares states of rest and the bending frequency, on small meshes.
#[test]
fn the_library_rests_where_the_reference_does() {
    assert_sections_hold("uniaxial,twist,frequency", &["uniaxial-force", "twist-torque"]);
}

#[test]
#[ignore = "slow: larger bodies come to rest by Newton's method"]
fn the_library_rests_where_the_reference_does_at_length() {
    let figures = [
        "uniaxial-force",
        "cantilever-locking",
        "locking-errors",
        "twist-torque",
        "frequency-error",
        "frequency-amplitude",
        "indentation-force",
        "organ-iterations",
    ];
    assert_sections_hold("uniaxial,cantilever,locking,twist,frequency,indentation,organ", &figures);
}

/// What is new here: stiffness does not depend on the iterations, steps keep their limits, motion follows.
#[test]
fn stiffness_does_not_depend_on_the_iterations() {
    assert_sections_hold("independence,stress", &["independence-iterations"]);
}

#[test]
#[ignore = "slow: many bodies come to rest, and a drop is followed by Newton's method"]
fn stiffness_does_not_depend_on_the_iterations_at_length() {
    let figures = ["rest-bodies", "independence-iterations", "motion-drop", "motion-path"];
    assert_sections_hold("rest,independence,motion,stress", &figures);
}

#[test]
fn organs_move_and_rest_as_they_should_and_viscous_bars_die_down() {
    assert_sections_hold("decay,organs", &["decay"]);
}

#[test]
fn contact_is_the_references_and_friction_is_coulombs() {
    assert_sections_hold("friction", &[]);
}

#[test]
#[ignore = "slow: balls are pressed into blocks and blocks slide, by every method"]
fn contact_is_the_references_and_friction_is_coulombs_at_length() {
    assert_sections_hold("contact,friction", &["contact-hertz", "contact-depth"]);
}

/// Known failures: five sweeps of one colour do not unscramble a bar, Anderson's default guard follows a drop a
/// little less closely than is asked, and so do two substeps of the quasi-Newton method; XPBD's default leaves much
/// of the viscous stress unsolved. Where a ball begins to touch, four samples of a triangle are not enough for 1.5 %.
/// XPBD's default follows a quick probe a little less closely than is asked. What forces are said to be off by is more than
/// four times what they are off by where runs in half as many steps are much worse, or the run better than a thousandth.
const KNOWN_FAILURES: [&str; 7] = [
    "scrambles, Jacobi",
    "Anderson guarded by residual",
    "quasi-Newton, 2 substeps",
    "viscous bar, XPBD, beside",
    "force with 4 samples per triangle",
    "largest error of its force, XPBD",
    "tools in motion, what forces are said to be off by over the truth",
];

fn all_are_met(printed: &str) {
    assert!(printed.contains("claims are met"), "{printed}");
    for line in printed.lines().filter(|line| line.ends_with("missed")) {
        assert!(KNOWN_FAILURES.iter().any(|known| line.contains(known)), "{line}");
    }
}

#[test]
fn an_unwritable_report_fails_before_the_work() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("file");
    fs::write(&file, "").expect("a file");
    let output = quick_patch(&file.join("report.md"));
    assert_eq!(output.status.code(), Some(1));
    // A section that has run says so with a line of its own.
    let error = text(&output.stderr);
    assert!(error.starts_with("error: cannot write to "), "{error}");
    assert!(error.contains("--out") && error.lines().count() == 1, "{error}");
    assert!(output.stdout.is_empty());
}

#[test]
fn sections_are_listed_with_their_cases() {
    let output = lab(&["validate", "--list"]);
    assert!(output.status.success());
    let printed = text(&output.stdout);
    assert!(printed.starts_with("section"), "{printed}");
    assert!(printed.lines().any(|line| line.starts_with("patch")), "{printed}");
}

#[test]
fn an_unknown_section_is_answered_with_the_nearest() {
    let output = lab(&["validate", "--only", "patsh"]);
    assert_eq!(output.status.code(), Some(2));
    let error = text(&output.stderr);
    assert!(
        error.contains("'patsh'") && error.contains("similar value exists: 'patch'"),
        "{error}"
    );
}

#[test]
fn help_teaches_by_examples() {
    let output = lab(&["validate", "--help"]);
    let help = text(&output.stdout);
    for part in ["--quick", "docs/validation.md", "Examples:", "viscera-lab validate --only patch"]
    {
        assert!(help.contains(part), "the help lacks {part}: {help}");
    }
}
