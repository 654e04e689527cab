//! Bad scene files: each is one error with its place and the next move; none is a panic.

use proptest::prelude::*;
use viscera::scene::{Scene, SceneError};

const GOOD: &str = r#"[time]
frame = "1/60 s"

[[body]]
name = "bar"
shape = "beam"
length = "200 mm"
width = "50 mm"
height = "50 mm"
material = { young = "5 kPa", poisson = 0.45 }

[[fixing]]
body = "bar"
half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }

[[motion]]
body = "bar"
nearest = { point = ["200 mm", 0, 0], count = 4 }
keys = [{ time = "1 s", translation = [0, 0, "40 mm"] }]
"#;

/// The error of the good scene with one text replaced.
fn error(old: &str, new: &str) -> String {
    assert!(GOOD.contains(old), "{old}");
    let text = GOOD.replacen(old, new, 1);
    Scene::parse("s.toml", &text, &[]).expect_err(new).to_string()
}

#[test]
fn a_good_scene_is_accepted() {
    Scene::parse("s.toml", GOOD, &[]).unwrap();
}

#[test]
fn an_unknown_key_gets_line_column_and_the_nearest_name() {
    for (old, new, message) in [
        (
            "width =",
            "widht =",
            "s.toml, line 8, column 1: unknown key `widht` in `body`; did you mean `width`?",
        ),
        (
            "[time]",
            "[tmie]",
            "s.toml, line 1, column 2: unknown key `tmie` in the scene; did you mean `time`?",
        ),
        (
            "count = 4",
            "cuont = 4",
            "s.toml, line 18, column 39: unknown key `cuont` in `nearest`; did you mean `count`?",
        ),
        (
            "young = ",
            "stiffness = \"1 Pa\", young = ",
            "s.toml, line 10, column 14: unknown key `stiffness` in `material`; valid: preset, \
             model, young, poisson, density, viscosity",
        ),
    ] {
        assert_eq!(error(old, new), message);
    }
}

#[test]
fn a_bad_value_says_why_and_what_to_write() {
    for (old, new, message) in [
        (
            "\"beam\"",
            "\"baem\"",
            "s.toml, line 6, column 1: shape = \"baem\": did you mean `beam`? Valid: beam, block, \
             sphere, capsule, liver",
        ),
        (
            "\"1/60 s\"",
            "\"-16 ms\"",
            "s.toml, line 2, column 1: frame = \"-16 ms\": out of range; it must be at least 1 us \
             and at most 1 s",
        ),
        (
            "0.45",
            "0.5",
            "s.toml, line 10, column 31: poisson = 0.5: Poisson ratio 0.5 is incompressible; use at \
             most 0.499",
        ),
        (
            "\"5 kPa\"",
            "\"5 mm\"",
            "s.toml, line 10, column 14: young = \"5 mm\": a length where a pressure is \
             needed, for example \"5 kPa\"",
        ),
        (
            "\"5 kPa\"",
            "5000",
            "s.toml, line 10, column 14: young = 5000: write a unit, for example \"5 kPa\"",
        ),
        (
            "\"5 kPa\"",
            "0",
            "s.toml, line 10, column 14: young = 0: Young's modulus 0 Pa cannot hold a shape; it \
             must be above 0, for example 5 kPa",
        ),
        (
            "\"40 mm\"]",
            "\"40 mm\", 0]",
            "s.toml, line 19, column 25: translation = [...]: this must be a list of three such as \
             [\"32 mm\", 0, 0]",
        ),
    ] {
        assert_eq!(error(old, new), message);
    }
}

#[test]
fn another_bad_value_says_why_and_what_to_write() {
    for (old, new, message) in [
        (
            "normal = [-1, 0, 0]",
            "normal = [0, 0, 0]",
            "s.toml, line 14, column 35: normal = [...]: a direction needs a component that is not \
             zero, for example [0, 0, 1]",
        ),
        (
            "young = \"5 kPa\"",
            "preset = \"livre\"",
            "s.toml, line 10, column 14: preset = \"livre\": no preset of this name; did you mean \
             `liver`?",
        ),
        (
            "count = 4",
            "count = 99999999999999999999",
            "s.toml, line 18, column 39: count = 100000000000000000000: this must be a whole number",
        ),
        (
            "[[fixing]]",
            "[solver]\nthreads = 0\n[[fixing]]",
            "s.toml, line 13, column 1: threads = 0: out of range; it must be 1 to 1024",
        ),
        (
            "[[fixing]]",
            "[solver]\nthreads = 10000\n[[fixing]]",
            "s.toml, line 13, column 1: threads = 10000: out of range; it must be 1 to 1024",
        ),
        (
            "[[fixing]]",
            "[solver]\nthreads = \"all\"\n[[fixing]]",
            "s.toml, line 13, column 1: threads = \"all\": did you mean \"auto\"? Or write a whole \
             number",
        ),
        (
            "[[fixing]]",
            "[solver]\nsubsteps = 0\n[[fixing]]",
            "s.toml, line 13, column 1: substeps = 0: out of range; it must be 1 to 1000",
        ),
        (
            "[[fixing]]",
            "[solver]\nsubsteps = \"fuor\"\n[[fixing]]",
            "s.toml, line 13, column 1: substeps = \"fuor\": did you mean \"auto\"? Or write a whole \
             number",
        ),
        (
            "[[fixing]]",
            "[solver]\niterations = 10001\n[[fixing]]",
            "s.toml, line 13, column 1: iterations = 10001: out of range; it must be 1 to 10000",
        ),
        (
            "0.45",
            "nan",
            "s.toml, line 10, column 31: poisson = NaN: Poisson ratio NaN is unstable; it must be \
             above -1, and about 0.45 for most tissue",
        ),
    ] {
        assert_eq!(error(old, new), message);
    }
}

#[test]
fn keys_that_do_not_go_together_are_refused() {
    for (old, new, message) in [
        (
            "body = \"bar\"\nhalf",
            "body = \"bra\"\nhalf",
            "s.toml, line 13, column 1: there is no body `bra`; did you mean `bar`?",
        ),
        (
            "half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }",
            "",
            "s.toml, line 12, column 1: fixing 0 has 0 selectors; write exactly one of box, sphere, \
             half_space, nearest, region, patch",
        ),
        (
            "half_space",
            "region = 3\nhalf_space",
            "s.toml, line 12, column 1: fixing 0 has 2 selectors; write exactly one of box, sphere, \
             half_space, nearest, region, patch",
        ),
        (
            "half_space = { point = [0, 0, 0], normal = [-1, 0, 0] }",
            "box = { min = [0, \"2 mm\", 0], max = [0, 0, 0] }",
            "s.toml, line 12, column 1: fixing 0: the box's min is beyond its max along y; swap \
             them",
        ),
        (
            "height = \"50 mm\"\n",
            "",
            "s.toml, line 4, column 1: body `bar`: `height` is missing, for example height = \"50 \
             mm\"",
        ),
        (
            "height =",
            "radius = \"1 mm\"\nheight =",
            "s.toml, line 4, column 1: body `bar`: `radius` means nothing for a beam, which takes \
             length, width, height, cells_across, cut",
        ),
        (
            "shape = \"beam\"",
            "shape = \"beam\"\nmesh = \"bar.msh\"",
            "s.toml, line 4, column 1: body `bar`: `mesh` and `shape` exclude each other; keep one",
        ),
    ] {
        assert_eq!(error(old, new), message);
    }
}

#[test]
fn more_keys_that_do_not_go_together_are_refused() {
    for (old, new, message) in [
        (
            "young = \"5 kPa\", ",
            "",
            "s.toml, line 4, column 1: body `bar` needs a `young` or a `preset`, for example preset \
             = \"liver\"",
        ),
        (
            "material = { young = \"5 kPa\", poisson = 0.45 }",
            "",
            "s.toml, line 4, column 1: `body` needs the key `material`, a table",
        ),
        (
            "{ time = \"1 s\", translation = [0, 0, \"40 mm\"] }",
            "",
            "s.toml, line 16, column 1: motion 0: it needs a key, for example keys = [{ time = \"1 \
             s\", translation = [0, 0, \"40 mm\"] }]",
        ),
        (
            "{ time = \"1 s\"",
            "{ time = \"1 s\" }, { time = \"1 s\"",
            "s.toml, line 19, column 27: motion 0: its key at 1 s follows one at 1 s; times must \
             ascend",
        ),
        (
            "\"200 mm\"\nwidth",
            "\"90 m\"\ncells_across = 200\nwidth",
            "s.toml, line 4, column 1: body `bar`: about 1.4e10 lattice cells are too many (at most \
             2e6); make `spacing` larger or `cells` fewer",
        ),
        (
            "\"1/60 s\"",
            "\"1 us\"\nduration = \"1 min\"",
            "s.toml: 6.0e7 frames are too many; shorten time.duration or lengthen time.frame",
        ),
        (
            "[[fixing]]",
            "[[body]]\nname = \"bar\"\nshape = \"liver\"\nmaterial = { preset = \"liver\" }\n\
             [[fixing]]",
            "s.toml, line 12, column 1: there is already a body named `bar`; give this one another \
             name",
        ),
    ] {
        assert_eq!(error(old, new), message);
    }
}

#[test]
fn a_scene_without_a_body_or_that_is_not_toml_is_refused() {
    let message = |text: &str| Scene::parse("s.toml", text, &[]).unwrap_err().to_string();
    assert_eq!(
        message(""),
        "s.toml, line 1, column 1: the scene needs the key `body`, a list of tables"
    );
    assert!(matches!(Scene::parse("s.toml", "body = []", &[]), Err(SceneError::NoBody { .. })));
    assert!(message("[time\nframe = 1").starts_with("s.toml, line 1, column 6: "));
    assert!(message("\u{e4} = 1").starts_with("s.toml, line 1, column 1: "));
}

/// Single precision holds what a step makes of a legal number; the others are slips of the unit.
#[test]
fn numbers_that_no_tissue_has_are_refused_with_the_legal_range() {
    for (key, value, range) in [
        ("body.bar.material.young", "1e-30 Pa", "at least 1 mPa and at most 1000 GPa"),
        ("body.bar.material.young", "1e30 Pa", "at least 1 mPa and at most 1000 GPa"),
        ("body.bar.material.density", "1e-40 kg/m^3", "at least 0.001 kg/m^3"),
        ("fixing.0.stiffness", "1e-50 N/m", "at least 1e-6 N/m"),
        ("time.frame", "1e-25 s", "at least 1 us"),
        ("output.picture_size", "[8192, 600]", "16 to 4096"),
    ] {
        let message = Scene::parse("s.toml", GOOD, &[(key, value)]).unwrap_err().to_string();
        assert!(message.contains(range), "{message}");
    }
}

/// One line: the setting, what it was given, the legal range.
#[test]
fn threads_that_no_machine_has_are_refused_as_an_override_too() {
    for value in ["0", "10000"] {
        let message = Scene::parse("s.toml", GOOD, &[("solver.threads", value)]).unwrap_err();
        let start = "override of solver.threads: threads = ";
        let expected = format!("{start}{value}: out of range; it must be 1 to 1024");
        assert_eq!(message.to_string(), expected);
    }
    for value in ["auto", "1", "1024"] {
        Scene::parse("s.toml", GOOD, &[("solver.threads", value)]).unwrap();
    }
}

/// Tables nested as deep as the key has dots would overflow the stack.
#[test]
fn an_override_with_endless_dots_is_refused() {
    let key = vec!["a"; 100_000].join(".");
    let message = Scene::parse("s.toml", GOOD, &[(&key, "1")]).unwrap_err().to_string();
    assert!(message.contains("names joined by dots"), "{message}");
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_text_never_panics(text in "\\PC*", key in "\\PC*", value in "\\PC*") {
        let _ = Scene::parse("s.toml", &text, &[(&key, &value)]);
        let _ = Scene::parse("s.toml", GOOD, &[(&key, &value)]);
    }

    /// Cut, doubled and overwritten files.
    #[test]
    fn mutated_scenes_never_panic(
        edits in prop::collection::vec(
            (0usize..GOOD.len(), 0usize..8, "[-0-9.eE\"\\[\\]{}=, a-z\n]{0,6}"),
            1..6,
        )
    ) {
        let mut text: Vec<char> = GOOD.chars().collect();
        for (start, length, insert) in edits {
            let start = start.min(text.len());
            let end = (start + length).min(text.len());
            text.splice(start..end, insert.chars());
        }
        let text: String = text.into_iter().collect();
        if let Err(error) = Scene::parse("s.toml", &text, &[]) {
            let message = error.to_string();
            prop_assert!(message.lines().count() == 1, "{message}");
            prop_assert!(message.starts_with("s.toml"), "{message}");
        }
    }

    /// Any number in any quantity, however wild: an error or a finite scene.
    #[test]
    fn wild_numbers_never_panic(number in prop::num::f64::ANY, which in 0usize..7) {
        let (written, unit) = [
            ("\"1/60 s\"", "s"), ("\"200 mm\"", "mm"), ("\"5 kPa\"", "kPa"), ("0.45", ""),
            ("\"1 s\"", "s"), ("\"40 mm\"", "mm"), ("[-1,", ""),
        ][which];
        let wild = match unit {
            "" => format!("{}{number:e}", if written.starts_with('[') { "[" } else { "" }),
            unit => format!("\"{number:e} {unit}\""),
        };
        let wild = if written.ends_with(',') { wild + "," } else { wild };
        let parsed = Scene::parse("s.toml", &GOOD.replacen(written, &wild, 1), &[]);
        if number.is_nan() {
            prop_assert!(parsed.is_err());
        }
        if let Ok(scene) = parsed {
            prop_assert!(scene.time.frame > 0.0);
            prop_assert!(scene.bodies[0].material.lame_lambda().is_finite());
            prop_assert!(scene.motions[0].pose(0.5).translation.is_finite());
        }
    }

    #[test]
    fn overrides_of_every_key_take_any_value(which in 0usize..1000, value in "\\PC{0,12}") {
        let key_of = |path: &str, key: &str| match path {
            "" => key.to_owned(),
            path => {
                let path = path.replace("body", "body.0").replace("keys", "keys.0");
                let path = path.replace("motion", "motion.0").replace("fixing", "fixing.0");
                format!("{path}.{key}")
            }
        };
        let tables = viscera::scene::describe();
        let keys: Vec<String> = tables
            .iter()
            .flat_map(|table| table.keys.iter().map(|key| key_of(&table.path, key.name)))
            .collect();
        let key = &keys[which % keys.len()];
        let _ = Scene::parse("s.toml", GOOD, &[(key, &value)]);
    }
}
