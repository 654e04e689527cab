//! Which bodies of a scene can rest under gravity as they are.

use viscera::scene::Scene;
use viscera::simulation::{AssembleError, Assembly, BalanceError};

use crate::bodies::Import;

impl Import {
    /// Tries the scene; a body that is too soft for that begins at rest without load, and sags, with a note that says what
    /// it would need. Calls `observe` with what is being done.
    pub(crate) fn balance(&mut self, observe: &mut dyn FnMut(&str)) {
        for _ in 0..self.parts.len() {
            observe("the shape without gravity");
            let written = self.scene("scene");
            let file = |name: &str| {
                let known = written.files.iter().find(|(known, _)| known == name);
                known.map(|(_, bytes)| bytes.clone()).ok_or_else(|| format!("{name}: not there"))
            };
            let text = written.files.first().map(|(_, bytes)| String::from_utf8_lossy(bytes));
            let scene = Scene::parse("scene.toml", &text.unwrap_or_default(), &[]);
            // Any other fault is told where the scene is read.
            let Ok(scene) = scene else { return };
            let Err(AssembleError::Balance(error)) = Assembly::new(&scene, &mut |name| file(name))
            else {
                return;
            };
            let (BalanceError::NotHeld { body }
            | BalanceError::Turns { body }
            | BalanceError::TooSoft { body, .. }) = &error
            else {
                return;
            };
            let Some(part) = self.parts.iter_mut().find(|part| part.name == *body) else { return };
            part.is_balanced = false;
            part.notes.push(format!("it will sag at first: {error}"));
        }
    }
}
