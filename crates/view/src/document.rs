//! The scene file that is open.

use anyhow::{Result, bail};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use viscera::scene::{Scene, SceneError};
use viscera_resources::{MeshFiles, scene_text};

use crate::choices::Settings;

/// A scene as a person wrote it. It is kept in memory: the file may change or vanish while it is open.
#[derive(Clone, Debug)]
pub struct Document {
    /// The file, or the name of a built-in scene.
    pub path: PathBuf,
    /// What it says.
    pub text: Arc<str>,
    /// Where mesh files are looked for that are not beside the scene.
    pub data: Option<PathBuf>,
}

impl Document {
    /// Reads a scene file, or finds a built-in scene of that name.
    pub fn open(path: &Path, data: Option<&Path>) -> Result<Self> {
        refuse_recording(path)?;
        let text = scene_text(path)?.into();
        Ok(Self { path: path.to_owned(), text, data: data.map(Path::to_owned) })
    }

    /// The scene with settings laid over it.
    pub fn scene(&self, settings: &Settings) -> Result<Scene, SceneError> {
        let overrides: Vec<(&str, &str)> =
            settings.iter().map(|(key, value)| (key.as_str(), value.as_str())).collect();
        Scene::parse(&self.path.display().to_string(), &self.text, &overrides)
    }

    /// Finds the scene's mesh files.
    pub fn mesh_files(&self) -> MeshFiles {
        MeshFiles::new(&self.path, self.data.as_deref())
    }

    /// The scene's name without folder and ending: "liver_retraction".
    pub fn stem(&self) -> String {
        let stem = self.path.file_stem().unwrap_or(self.path.as_os_str());
        stem.to_string_lossy().into_owned()
    }
}

/// Recordings are seen again by another program.
fn refuse_recording(path: &Path) -> Result<()> {
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("viscera")) {
        let shown = path.display();
        bail!("{shown} is a recording of a run; see it again with: viscera replay {shown}");
    }
    Ok(())
}
