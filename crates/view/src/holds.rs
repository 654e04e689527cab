//! What a person holds: points of the tissue, and where they are pulled to.

use viscera::scalar::Vec3;

use viscera_stage::{HoldId, Pick};

use crate::engine::Command;

/// How one takes hold.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default)]
pub struct Grip {
    /// How many vertices.
    pub count: u32,
    /// Total stiffness [N/m] of the springs between hand and tissue.
    pub stiffness: f64,
    /// Hold rigidly, without springs.
    pub rigid: bool,
    /// Hold on when the button of the mouse is released.
    pub keep: bool,
}

impl Default for Grip {
    fn default() -> Self {
        Self { count: 8, stiffness: 200.0, rigid: false, keep: false }
    }
}

/// One point that is held.
#[derive(Debug)]
pub struct Held {
    /// Its number, which the simulations know it by.
    pub id: HoldId,
    /// Where it was taken [m].
    pub taken: Vec3<f64>,
    /// How far it is led from there [m].
    pub translation: Vec3<f64>,
}

/// Everything held.
#[derive(Debug, Default)]
pub struct Holds {
    list: Vec<Held>,
    taken_so_far: HoldId,
    drag: Option<Drag>,
}

#[derive(Clone, Copy, Debug)]
struct Drag {
    hold: HoldId,
    /// A point of the plane in which it is dragged [m].
    plane: Vec3<f64>,
    /// The place of the pointer in that plane at which its translation would be zero [m]; known from the first
    /// movement on.
    origin: Option<Vec3<f64>>,
}

impl Holds {
    /// All of them, in the order in which they were taken.
    pub fn list(&self) -> &[Held] {
        &self.list
    }

    /// A point of the plane in which something is dragged [m].
    pub fn drag_plane(&self) -> Option<Vec3<f64>> {
        self.drag.map(|drag| drag.plane)
    }

    /// Takes hold where the tissue was pressed, and drags it.
    pub fn take(&mut self, pick: &Pick, grip: &Grip) -> Command {
        self.taken_so_far += 1;
        let id = self.taken_so_far;
        self.drag = Some(Drag { hold: id, plane: pick.point, origin: Some(pick.point) });
        self.list.push(Held { id, taken: pick.point, translation: Vec3::ZERO });
        let stiffness = (!grip.rigid).then_some(grip.stiffness);
        Command::Take { hold: id, body: pick.body, rest: pick.rest, count: grip.count, stiffness }
    }

    /// Drags what is held already, from where it is led to now. False where there is no such hold.
    pub fn resume(&mut self, id: HoldId) -> bool {
        let held = self.list.iter().find(|held| held.id == id);
        if let Some(held) = held {
            self.drag = Some(Drag { hold: id, plane: held.taken + held.translation, origin: None });
        }
        held.is_some()
    }

    /// Leads what is dragged to a point of its plane [m].
    pub fn lead(&mut self, point: Vec3<f64>) -> Option<Command> {
        let drag = self.drag.as_mut()?;
        let held = self.list.iter_mut().find(|held| held.id == drag.hold)?;
        let origin = *drag.origin.get_or_insert(point - held.translation);
        held.translation = point - origin;
        Some(Command::Lead(held.id, held.translation))
    }

    /// Ends a drag: holds on, or lets go.
    pub fn release(&mut self, keep: bool) -> Option<Command> {
        let Drag { hold, .. } = self.drag.take()?;
        if keep { None } else { self.let_go(hold) }
    }

    /// Lets go of one.
    pub fn let_go(&mut self, id: HoldId) -> Option<Command> {
        if self.drag.is_some_and(|drag| drag.hold == id) {
            self.drag = None;
        }
        let position = self.list.iter().position(|held| held.id == id)?;
        self.list.remove(position);
        Some(Command::LetGo(id))
    }

    /// Forgets everything: the simulations have begun anew. What was taken since, before this was known, is let
    /// go.
    pub fn clear(&mut self) -> Vec<Command> {
        self.drag = None;
        self.list.drain(..).map(|held| Command::LetGo(held.id)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera::scalar::vec3;

    fn pick() -> Pick {
        Pick { body: 0, point: vec3(1.0, 2.0, 3.0), rest: vec3(1.0, 2.0, 2.5) }
    }

    #[test]
    fn a_release_is_clean_unless_it_is_kept() {
        let mut holds = Holds::default();
        holds.take(&pick(), &Grip::default());
        let led = holds.lead(vec3(1.0, 2.0, 4.0));
        assert!(matches!(led, Some(Command::Lead(1, moved)) if moved == vec3(0.0, 0.0, 1.0)));
        assert!(holds.release(true).is_none());
        assert_eq!(holds.list().len(), 1);
        // Taken up again, wherever it is pressed, it goes on from where it was led to.
        assert!(holds.resume(1) && !holds.resume(7));
        assert_eq!(holds.drag_plane(), Some(vec3(1.0, 2.0, 4.0)));
        let led = holds.lead(vec3(1.5, 2.0, 4.0));
        assert!(matches!(led, Some(Command::Lead(1, moved)) if moved == vec3(0.0, 0.0, 1.0)));
        let led = holds.lead(vec3(1.5, 2.25, 4.0));
        assert!(matches!(led, Some(Command::Lead(1, moved)) if moved == vec3(0.0, 0.25, 1.0)));
        assert!(matches!(holds.release(false), Some(Command::LetGo(1))));
        assert!(holds.list().is_empty() && holds.lead(Vec3::ZERO).is_none());
    }
}
