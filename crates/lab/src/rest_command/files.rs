//! The scene and its meshes from files, with messages that name the place and the next move.

use anyhow::{Result, bail};
use std::path::Path;
use viscera::scene::Scene;
use viscera::simulation::Assembly;
use viscera_resources::{MeshFiles, files};

/// Reads a scene with settings (`KEY=VALUE`) laid over it, and puts it together with its meshes:
/// those beside the scene, then those in the data folder.
pub fn load(path: &Path, settings: &[String], data: Option<&Path>) -> Result<(Scene, Assembly)> {
    let scene = read_scene(path, settings)?;
    let meshes = MeshFiles::new(path, data);
    let assembly = Assembly::new(&scene, &mut |name| meshes.load(name))?;
    Ok((scene, assembly))
}

/// Reads a scene with settings (`KEY=VALUE`) laid over it.
pub fn read_scene(path: &Path, settings: &[String]) -> Result<Scene> {
    let name = path.display().to_string();
    let Ok(text) = String::from_utf8(files::read(path)?) else {
        bail!("{name} is not a text file; a scene is TOML in UTF-8");
    };
    let mut overrides = Vec::new();
    for setting in settings {
        let Some((key, value)) = setting.split_once('=') else {
            bail!("--set {setting}: write KEY=VALUE, for example --set solver.iterations=20");
        };
        overrides.push((key.trim(), value.trim()));
    }
    Ok(Scene::parse(&name, &text, &overrides)?)
}
