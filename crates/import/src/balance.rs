//! Which bodies of a scene can rest under gravity as they are.

use viscera::scene::Scene;
use viscera::simulation::{AssembleError, Assembly, BalanceError};

use crate::bodies::{Import, Part};
use crate::hold::{Hold, LARGER_BACKS, at_the_back};

/// Contact begins so much farther off than bodies overlap at most, in steps of a tenth of a millimetre,
const OVERLAP: f64 = 1.2;
const TENTH: f64 = 1e-4;
/// and no farther than this [m]: what overlaps more is not what a scan shows.
const THICKEST: f64 = 8e-3;
/// How the note of it begins.
const BEGINS: &str = "contact begins";

impl Import {
    /// Tries the scene. A body that is too soft for its weight is held by more of its back; where that does not do, it
    /// begins without load, and sags, with a note that says what it would need. Calls `observe` with what is being done.
    pub(crate) fn balance(&mut self, observe: &mut dyn FnMut(&str)) {
        // How often more was held, and what was before.
        let mut tries = vec![0; self.parts.len()];
        let guessed: Vec<(Vec<Hold>, usize)> =
            self.parts.iter().map(|part| (part.holds.clone(), part.notes.len())).collect();
        loop {
            let errors = self.try_balance(observe);
            if errors.is_empty() {
                return;
            }
            for error in errors {
                let (BalanceError::NotHeld { body }
                | BalanceError::Turns { body }
                | BalanceError::TooSoft { body, .. }) = &error
                else {
                    return;
                };
                let index = self.parts.iter().position(|part| part.name == *body);
                let Some(index) = index else { return };
                let is_soft = matches!(error, BalanceError::TooSoft { .. });
                let larger = LARGER_BACKS.get(tries[index]).filter(|_| is_soft);
                tries[index] += 1;
                let more = larger.and_then(|&share| self.hold_more(index, share));
                let part = &mut self.parts[index];
                let (holds, notes) = &guessed[index];
                // Of several tries the last one counts.
                part.notes.truncate(*notes);
                part.notes.push(more.unwrap_or_else(|| {
                    part.holds.clone_from(holds);
                    part.is_balanced = false;
                    format!("it sags at first: {error}")
                }));
            }
        }
    }

    /// Bodies that cannot rest as they are; none where the scene has another fault.
    fn try_balance(&mut self, observe: &mut dyn FnMut(&str)) -> Vec<BalanceError> {
        if !self.parts.iter().any(|part| part.is_balanced) {
            self.balance = None;
            return Vec::new();
        }
        observe("the shape without gravity");
        let files = self.scene("scene").files;
        let text = files.first().map_or("".into(), |(_, text)| String::from_utf8_lossy(text));
        let Ok(scene) = Scene::parse("scene.toml", &text, &[]) else { return Vec::new() };
        let mut load = |name: &str| {
            let known = files.iter().find(|(known, _)| known == name);
            known.map(|(_, bytes)| bytes.clone()).ok_or_else(|| format!("{name}: not there"))
        };
        match Assembly::try_balance(&scene, &mut load, self.balance.as_ref()) {
            Ok((balance, errors)) => {
                self.balance = Some(balance);
                errors
            }
            Err(AssembleError::BodiesOverlap { one, other, depth, .. })
                if self.thickness.is_none_or(|thickness| thickness < depth)
                    && OVERLAP * depth <= THICKEST =>
            {
                // What is looked for farther may be found deeper: the last of several counts.
                self.notes.retain(|note| !note.starts_with(BEGINS));
                let thickness = (OVERLAP * depth / TENTH).ceil() * TENTH;
                self.thickness = Some(thickness);
                self.notes.push(format!(
                    "{BEGINS} {:.1} mm off surfaces, since {one} and {other} overlap by up to {:.1} mm",
                    1e3 * thickness,
                    1e3 * depth
                ));
                self.try_balance(observe)
            }
            Err(error) => {
                self.warnings.push(error.to_string());
                Vec::new()
            }
        }
    }

    /// Holds more of a body's back, where a guess holds it there.
    fn hold_more(&mut self, index: usize, share: f64) -> Option<String> {
        let down = self.down;
        let Part { name, mesh, holds, .. } = &mut self.parts[index];
        for side in ["back", "lowest"] {
            let larger = at_the_back(name, mesh, down, (side, share));
            let is_of_side = |known: &str| larger.iter().any(|hold| hold.name == known);
            let count = holds.len();
            holds.retain(|hold| !is_of_side(&hold.name));
            if holds.len() < count {
                holds.extend(larger);
                return Some(format!(
                    "held by the {side} {:.0} % of it, so that it can rest as it is: less carries no tissue this soft",
                    100.0 * share
                ));
            }
        }
        None
    }
}
