//! What a scene says at a key, and in which unit.

use crate::hands;
use std::collections::BTreeMap;
use viscera::scene::Scene;
use viscera::settings::{KeyDescription, SettingValue};

fn described(scene: &Scene, key: &str) -> KeyDescription {
    scene.described(key).unwrap_or_else(|e| panic!("{key}: {e}")).expect("no table")
}

/// What stands at a key, in its own form: of the file, of an override, of a default.
#[test]
fn a_scene_tells_what_stands_at_a_key() {
    let text = hands::BLOCK;
    let scene = Scene::parse("s.toml", text, &[("solver.substeps", "7")]).expect("a scene");
    let setting = |key: &str| scene.setting(key).unwrap_or_else(|e| panic!("{key}: {e}"));
    let written = |text: &str| Some(SettingValue::Text(text.to_owned()));
    assert_eq!(setting("body.block.material.young"), written("10 kPa"));
    assert_eq!(setting("body.0.material.young"), written("10 kPa"));
    assert_eq!(setting("fixing.table.body"), written("block"));
    assert_eq!(setting("solver.substeps"), Some(SettingValue::Whole(7)));
    assert_eq!(setting("body.block.cells.2"), Some(SettingValue::Whole(3)));
    assert_eq!(setting("solver.method"), written("auto"));
    assert_eq!(setting("fixing.table.stiffness"), None);
    assert_eq!(setting("output"), Some(SettingValue::Table(BTreeMap::new())));
    let units = ["body.block.material.young", "time.frame", "fixing.table.half_space.point"];
    let unit = |key: &str| described(&scene, key).unit;
    assert_eq!(units.map(unit), ["Pa", "s", "m"]);
    assert_eq!((unit("solver.substeps"), unit("world.gravity")), ("", "m/s^2"));
    for (key, says) in [
        ("body.block.material.yung", "did you mean `young`?"),
        ("body.blok.material.young", "body has no item `blok`; it has: block"),
        ("solver.method.more", "unknown key `method` in `solver`"),
        ("", "unknown key"),
        ("body.block.material.young.", "unknown key"),
        ("fixing.table.stifness", "did you mean `stiffness`?"),
    ] {
        let error = scene.setting(key).map(|found| panic!("{key}: {found:?}")).unwrap_err();
        assert!(error.to_string().contains(says), "{key}: {error}");
    }
}

/// A number with the SI unit of its key is that number, to the last digit.
#[test]
fn numbers_with_their_si_unit_keep_every_digit() {
    for key in ["young", "density"] {
        for number in [1_234.567_890_123_456_7, 1.0 / 3.0 * 1e4, 9_999.999_999_999_998] {
            let path = format!("body.block.material.{key}");
            let scene = Scene::parse("s.toml", hands::BLOCK, &[]).expect("a scene");
            let unit = described(&scene, &path).unit;
            let text = format!("{number:?} {unit}");
            let scene = Scene::parse("s.toml", hands::BLOCK, &[(&path, &text)]).expect("a scene");
            let material = scene.bodies[0].material;
            let found = if key == "young" { material.young() } else { material.density() };
            assert_eq!(found, number, "{text}");
        }
    }
}

#[test]
fn an_error_is_one_line_whatever_was_written() {
    let wrong = "\"5\\n\\tkPa\\r and more of it, which is cut off\"";
    let error = Scene::parse("s.toml", hands::BLOCK, &[("body.block.material.young", wrong)]);
    let error = error.map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("young") && !error.chars().any(char::is_control), "{error:?}");
}
