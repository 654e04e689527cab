//! Saves what has been chosen as a scene file that `viscera run` reproduces. What a person wrote stays as
//! it was written: comments, order, spelling of units.

use anyhow::{Context, Result, anyhow, bail};
use std::path::Path;
use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, TableLike, Value};
use viscera::scene::Scene;
use viscera_resources::files::write_atomic;

use crate::choices::Settings;
use crate::document::Document;

/// Writes the scene with its settings and, behind them, what was done by hand; atomically.
pub fn save(document: &Document, settings: &Settings, by_hand: &str, path: &Path) -> Result<()> {
    if path.extension().is_none_or(|ending| ending != "toml") {
        bail!("{}: a scene file's name ends in .toml", path.display());
    }
    let text = scene_text(document, settings)? + by_hand;
    Scene::parse(&path.display().to_string(), &text, &[])?;
    // Mesh files are named relative to the scene.
    let folder = |path: &Path| path.parent().map(Path::to_owned).unwrap_or_default();
    let scene = document.scene(settings)?;
    if !scene.files().is_empty() && folder(path) != folder(&document.path) {
        bail!(
            "{}: this scene names mesh files beside it ({}); save it in {}",
            path.display(),
            scene.files().join(", "),
            folder(&document.path).display()
        );
    }
    write_atomic(path, text.as_bytes())
}

/// The text of the scene file.
pub fn scene_text(document: &Document, settings: &Settings) -> Result<String> {
    let mut tree: DocumentMut =
        document.text.parse().with_context(|| document.path.display().to_string())?;
    for (key, value) in settings {
        put(tree.as_table_mut(), key, value).with_context(|| format!("cannot write {key}"))?;
    }
    let text = tree.to_string();
    let name = document.path.display().to_string();
    // What was written must be read as what was chosen.
    let written = Scene::parse(&name, &text, &[])?;
    let chosen = document.scene(settings)?;
    let same = written.solver == chosen.solver
        && written.world == chosen.world
        && written.time == chosen.time
        && written.bodies == chosen.bodies;
    match same {
        true => Ok(text),
        false => {
            Err(anyhow!("the text would be read as another scene; use --set with the old one"))
        }
    }
}

/// Sets a key as an override does: into a list of tables the step is a position or a `name`.
fn put(root: &mut Table, key: &str, text: &str) -> Result<()> {
    let (path, last) = key.rsplit_once('.').unwrap_or(("", key));
    let mut table: &mut dyn TableLike = root;
    let mut steps = path.split('.').filter(|step| !step.is_empty());
    while let Some(step) = steps.next() {
        let item = table.entry(step).or_insert_with(|| Item::Table(Table::new()));
        table = match item {
            Item::ArrayOfTables(list) => {
                let name = steps.next().context("a list needs the name of an item")?;
                named(list, name).with_context(|| format!("there is no {step} `{name}`"))?
            }
            other => other.as_table_like_mut().with_context(|| format!("{step} is no table"))?,
        };
    }
    let value = value_of(text);
    match table.get_mut(last).and_then(Item::as_value_mut) {
        Some(old) => {
            // A comment behind the old value stays.
            let decor = old.decor().clone();
            *old = value;
            *old.decor_mut() = decor;
        }
        None => {
            table.insert(last, Item::Value(value));
        }
    }
    Ok(())
}

fn named<'a>(list: &'a mut ArrayOfTables, name: &str) -> Option<&'a mut dyn TableLike> {
    let position = name.parse().ok().or_else(|| {
        list.iter().position(|table| table.get("name").and_then(Item::as_str) == Some(name))
    });
    list.get_mut(position?).map(|table| table as &mut dyn TableLike)
}

/// A value as an override writes it: quotes may be left out.
fn value_of(text: &str) -> Value {
    text.trim().parse().unwrap_or_else(|_| Value::from(text.trim()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera_resources::BUILT_IN;

    fn document() -> Document {
        let scene = BUILT_IN.iter().find(|scene| scene.name == "liver_lifted");
        let text = scene.expect("a built-in scene").text;
        Document { path: "liver_lifted".into(), text: text.into(), data: None }
    }

    fn settings(pairs: &[(&str, &str)]) -> Settings {
        pairs.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect()
    }

    #[test]
    fn a_saved_scene_says_what_was_chosen_and_keeps_what_was_written() {
        let document = document();
        let chosen = settings(&[
            ("body.liver.material.young", "20 kPa"),
            ("solver.colors", "4"),
            ("solver.acceleration", "anderson"),
            ("world.gravity", "0 m/s^2"),
            ("time.duration", "5 s"),
        ]);
        let text = scene_text(&document, &chosen).expect("a scene");
        let scene = Scene::parse("saved", &text, &[]).expect("a legal scene");
        assert_eq!(scene.bodies[0].material.young(), 20e3);
        assert_eq!(scene.time.duration, 5.0);
        let comments = document.text.lines().filter(|line| line.starts_with('#'));
        assert!(comments.clone().count() > 0);
        for comment in comments {
            assert!(text.contains(comment), "{comment}");
        }
    }

    #[test]
    fn without_changes_a_scene_is_saved_as_it_was() {
        let document = document();
        assert_eq!(scene_text(&document, &Vec::new()).expect("a scene"), &*document.text);
    }

    #[test]
    fn what_cannot_be_saved_leaves_no_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("scene.toml");
        let wrong = settings(&[("body.spleen.material.young", "20 kPa")]);
        let error = save(&document(), &wrong, "", &path).expect_err("no such body");
        assert!(format!("{error:#}").contains("spleen"), "{error:#}");
        assert!(save(&document(), &Vec::new(), "", &folder.path().join("scene.txt")).is_err());
        assert_eq!(std::fs::read_dir(folder.path()).expect("the folder").count(), 0);
    }
}
