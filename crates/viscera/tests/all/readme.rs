//! The forces in README.md are those of runs of their scenes.

use viscera::scalar::{Real, Vec3, vec3};
use viscera::scene::Scene;
use viscera::simulation::{Assembly, FrameReport, PatchKind, Simulation};

const README: &str = include_str!("../../../../README.md");
const LIFTED: &str = include_str!("../../../../scenes/liver_lifted.toml");
const RETRACTION: &str = include_str!("../../../../scenes/liver_retraction.toml");

/// A budget, its colours, and the force in the table as it is written there.
struct Row {
    budget: String,
    colors: &'static str,
    published: bool,
    force: String,
}

/// The lines of the table; one that lists several budgets has as many forces.
fn rows() -> Vec<Row> {
    let start = README.find("| method, substeps x iterations |").expect("the table");
    let lines = README[start..].lines().skip(2).take_while(|line| line.starts_with('|'));
    let mut rows = Vec::new();
    for line in lines {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        let [budgets, colors, forces] = cells[..] else { panic!("{line}") };
        let budgets = budgets.trim_start_matches("XPBD, ");
        let (published, budgets) = match budgets.strip_prefix("XPBD as published, ") {
            Some(budgets) => (true, budgets),
            None => (false, budgets),
        };
        let colors = match colors.split(' ').next() {
            Some("unlimited" | "-") => "unlimited",
            Some("4") => "4",
            Some("1") => "1",
            _ => panic!("{line}"),
        };
        for (budget, force) in budgets.split(", ").zip(forces.split(", ")) {
            let budget = budget.trim_end_matches(" (default)").to_owned();
            let force = force.trim_end_matches(" N").to_owned();
            rows.push(Row { budget, colors, published, force });
        }
    }
    rows
}

/// The numbers of the end of a run, and the mass [kg].
fn end_of<S: Real>(scene: &str, settings: &[(&str, &str)]) -> (FrameReport, f64) {
    let scene = Scene::parse("liver.toml", scene, settings).unwrap_or_else(|e| panic!("{e}"));
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned())).expect("an assembly");
    let frames = scene.frame_count();
    let mut simulation = Simulation::<S>::new(scene, assembly).unwrap_or_else(|e| panic!("{e}"));
    for _ in 0..frames {
        simulation.advance().unwrap_or_else(|e| panic!("{e}"));
    }
    simulation.measure().expect("measures");
    let mass = simulation.model().masses.iter().map(|mass| mass.to_f64()).sum();
    (simulation.report(), mass)
}

/// The force [N] at the end of a run.
fn lifting<S: Real>(row: &Row) -> f64 {
    let automatic = ("\"auto\"", "\"auto\"");
    let (substeps, iterations) = row.budget.split_once(" x ").unwrap_or(automatic);
    let method = if row.budget.starts_with("automatic") { "auto" } else { "xpbd" };
    let elements = if row.budget == "automatic" { "auto" } else { "plain" };
    let form = if row.published { "false" } else { "true" };
    let settings = [
        ("solver.method", method),
        ("solver.elements", elements),
        ("solver.substeps", substeps),
        ("solver.iterations", iterations),
        ("solver.colors", row.colors),
        ("solver.rebase", form),
        ("solver.keep_multipliers", form),
        ("solver.device", "cpu"),
    ];
    let (report, _) = end_of::<S>(LIFTED, &settings);
    let motion =
        report.patches.iter().find(|patch| patch.kind == PatchKind::Motion).expect("a motion");
    Vec3::from_f64(motion.force).length()
}

fn check(rows: &[Row]) {
    let mut stale = Vec::new();
    for row in rows {
        let found = format!("{:.4}", lifting::<f32>(row));
        println!("{} {} {}: {found} N", row.budget, row.colors, row.published);
        if found != row.force {
            stale.push(format!(
                "{}, colours {}: {found} N, not {} N",
                row.budget, row.colors, row.force
            ));
        }
    }
    assert!(stale.is_empty(), "README.md: {stale:#?}");
}

#[test]
fn the_force_in_the_readme_is_that_of_a_run() {
    let rows = rows();
    assert_eq!(rows.len(), 10);
    check(&rows[..2]);
}

#[test]
#[ignore = "slow: eight runs of a liver"]
fn the_force_in_the_readme_is_that_of_a_run_at_length() {
    check(&rows());
}

/// A mesh of the retractor's liver, and what README.md says of it.
struct Mesh {
    setting: (&'static str, &'static str),
    /// Between what the force on the blade is [N], where it depends on rounding.
    between: Option<[f64; 2]>,
    /// How README.md goes on after the force.
    words: &'static str,
}

const MESHES: [Mesh; 4] = [
    Mesh { setting: ("refine", "0"), between: None, words: " N on the scene's 2,940" },
    Mesh { setting: ("spacing", "24 mm"), between: None, words: " N on 1,445 tetrahedra" },
    Mesh { setting: ("spacing", "11 mm"), between: Some([7.4, 7.6]), words: " N on 13,944" },
    Mesh { setting: ("refine", "1"), between: Some([7.3, 7.7]), words: " N on 23,520" },
];

/// The blade carries what README.md says and the ligaments the rest of the weight. No tetrahedron is inside out, but of the finest.
fn check_retractor(meshes: &[Mesh]) {
    for Mesh { setting: (key, value), between, words } in meshes {
        let key = format!("body.liver.{key}");
        let settings = [(key.as_str(), *value), ("solver.device", "cpu")];
        let (report, mass) = end_of::<f32>(RETRACTION, &settings);
        let on_blade = Vec3::from_f64(report.tools[0].force);
        let force = on_blade.length();
        let told = match between {
            Some([low, high]) => format!("{low} to {high}{words}"),
            None => format!("{force:.2}{words}"),
        };
        let readme = README.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(readme.contains(&told), "README.md does not say {told}");
        let [low, high] = between.unwrap_or([force; 2]);
        assert!((low..=high).contains(&force), "{force} N, not {told}");
        let most = if key == "body.liver.refine" && *value == "1" { 10 } else { 0 };
        assert!(report.deformation.inverted <= most, "{key} {value}: {:?}", report.deformation);
        let held = Vec3::from_f64(report.patches[0].force) - on_blade;
        let weight = vec3(0.0, 0.0, 9.81 * mass);
        // Half of a percent away is at rest for a run.
        assert!((held - weight).length() < 0.005 * weight.z, "{key} {value}: {held:?}, {weight:?}");
    }
}

#[test]
fn the_retractor_bears_what_the_readme_says() {
    check_retractor(&MESHES[..1]);
}

#[test]
#[ignore = "slow: livers of up to 23,520 tetrahedra"]
fn the_retractor_bears_what_the_readme_says_at_length() {
    check_retractor(&MESHES);
}
