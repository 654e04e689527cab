//! The scene and its meshes from files, with messages that name the place and the next move.

use anyhow::{Result, anyhow, bail};
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use viscera::scene::Scene;
use viscera::simulation::Assembly;

/// Reads a scene with settings (`KEY=VALUE`) laid over it, and puts it together with its meshes:
/// those beside the scene, then those in the data folder.
pub fn load(path: &Path, settings: &[String], data: Option<&Path>) -> Result<(Scene, Assembly)> {
    let name = path.display().to_string();
    let Ok(text) = String::from_utf8(read(path)?) else {
        bail!("{name} is not a text file; a scene is TOML in UTF-8");
    };
    let mut overrides = Vec::new();
    for setting in settings {
        let Some((key, value)) = setting.split_once('=') else {
            bail!("--set {setting}: write KEY=VALUE, for example --set solver.iterations=20");
        };
        overrides.push((key.trim(), value.trim()));
    }
    let scene = Scene::parse(&name, &text, &overrides)?;
    let beside = path.parent().unwrap_or(Path::new(".")).to_owned();
    let folders: Vec<PathBuf> = std::iter::once(beside).chain(data.map(Path::to_owned)).collect();
    let assembly = Assembly::new(&scene, &mut |name| find(&folders, name))?;
    Ok((scene, assembly))
}

/// The bytes of a mesh file as a scene names it.
fn find(folders: &[PathBuf], name: &str) -> Result<Vec<u8>, String> {
    match folders.iter().map(|folder| folder.join(name)).find(|path| path.exists()) {
        Some(path) => read(&path).map_err(|error| error.to_string()),
        None => {
            let shown = |folder: &PathBuf| match folder.as_os_str().is_empty() {
                true => "this folder".to_owned(),
                false => folder.display().to_string(),
            };
            let places: Vec<String> = folders.iter().map(shown).collect();
            let places = places.join(" or ");
            Err(format!(
                "{name}: there is no such file in {places}; put it there, or name its folder with \
                 --data"
            ))
        }
    }
}

fn read(path: &Path) -> Result<Vec<u8>> {
    let shown = path.display();
    if path.is_dir() {
        bail!("{shown} is a folder; name a file in it");
    }
    fs::read(path).map_err(|error| match error.kind() {
        ErrorKind::NotFound => anyhow!("{shown}: there is no such file; check the name"),
        ErrorKind::PermissionDenied => anyhow!("{shown}: no permission to read it"),
        _ => anyhow!("{shown}: {error}"),
    })
}
