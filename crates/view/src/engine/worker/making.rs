//! Scenes of meshes, surfaces and scans.

use std::path::{Path, PathBuf};
use viscera_import::{Part, scene_of};

use super::{Event, Worker};
use crate::engine::MadeScene;

impl Worker {
    /// Makes the scene of a file in a folder. What runs stands still meanwhile, and goes on afterwards.
    pub(super) fn make(&mut self, file: PathBuf, folder: &Path) {
        let made = scene_of(&file, folder, &mut |doing| self.tell(Event::Making(doing)));
        let made = made.map(|(import, made)| {
            let of_part = |part: &Part| -> Vec<String> {
                part.notes.iter().map(|note| format!("{}: {note}", part.name)).collect()
            };
            let tets = import.parts.iter().map(|part| part.mesh.tets().len()).sum();
            MadeScene {
                text: format!("{}{}", import.describe(), made.text()),
                scene: made.scene,
                bodies: import.parts.len(),
                tets,
                of_bodies: import.parts.iter().flat_map(of_part).collect(),
                warnings: import.warnings,
                notes: import.notes.into_iter().chain(made.notes).collect(),
            }
        });
        self.tell(Event::Made(file, made.map_err(|error| format!("{error:#}"))));
    }
}
