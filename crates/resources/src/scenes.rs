//! Scenes that are part of the programs: they need no file.

use anyhow::{Result, bail};
use std::path::Path;
use viscera::settings::suggest;

use crate::files;

/// A scene that is part of the program.
pub struct BuiltInScene {
    /// As `viscera run` takes it.
    pub name: &'static str,
    /// The scene file.
    pub text: &'static str,
}

macro_rules! built_in {
    ($($name:literal)*) => {
        [$(BuiltInScene { name: $name, text: include_str!(concat!("../../../scenes/", $name, ".toml")) }),*]
    };
}

/// All of them; `scenes/` holds no others that need no mesh file.
pub const BUILT_IN: [BuiltInScene; 13] = built_in!["cantilever" "cholecystectomy" "coarse_bar" "fold" "grab" "grasp" "haptic_palpation" "liver_lifted" "liver_retraction" "organs_pressed" "palpation" "stretch" "twist"];

impl BuiltInScene {
    /// The one that is meant where there is no such file.
    pub fn find(path: &Path) -> Option<&'static Self> {
        // A folder of that name, such as one with results, is no scene.
        let named = |scene: &&Self| path.as_os_str() == scene.name && !path.is_file();
        BUILT_IN.iter().find(named)
    }
}

/// The text of a scene file, or of the built-in scene of that name.
pub fn scene_text(path: &Path) -> Result<String> {
    let name = path.display().to_string();
    let bytes = match BuiltInScene::find(path) {
        Some(scene) => scene.text.as_bytes().to_vec(),
        // A word alone is no file's name, but a scene's.
        None if !path.exists() && path.components().count() == 1 && path.extension().is_none() => {
            let hint = suggest(&name, &BUILT_IN.map(|scene| scene.name));
            bail!("{name}: there is neither such a file nor a built-in scene; {hint}");
        }
        None => files::read(path)?,
    };
    match String::from_utf8(bytes) {
        Ok(text) => Ok(text),
        Err(_) => bail!(
            "{name} is neither a scene (TOML in UTF-8) nor a mesh or a scan by its ending; open one of those"
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_without_a_mesh_file_is_built_in() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
        let files = std::fs::read_dir(&folder).expect("the folder of scenes").flatten();
        let paths = files.map(|file| file.path());
        let mut names: Vec<String> = paths
            .filter(|path| path.extension().is_some_and(|e| e == "toml"))
            .filter_map(|path| Some(path.file_stem()?.to_string_lossy().into_owned()))
            .collect();
        names.sort();
        assert_eq!(names, BUILT_IN.map(|scene| scene.name));
    }
}
