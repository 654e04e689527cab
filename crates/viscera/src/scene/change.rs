//! Settings that change while a scene runs.

use super::build::build_scene;
use super::{Scene, SceneError};
use crate::settings::{Choice, Precision, apply_override};
use crate::units::shorten;

impl Scene {
    /// Changes settings of the solver, of the world and of materials; keys and values are those of
    /// [`Scene::parse`]'s overrides. On an error nothing is changed.
    pub fn change(&mut self, settings: &[(String, String)]) -> Result<(), SceneError> {
        let mut tree = self.tree.0.clone();
        for (key, value) in settings {
            if !may_change(key) {
                return Err(SceneError::FixedKey { key: shorten(key) });
            }
            apply_override(&mut tree, key, value)?;
        }
        // What else stands in the tree has been tried already, and the list of changes would be tried again.
        tree.remove("change");
        let changed = build_scene(&self.name, tree)?;
        if changed.solver.precision != self.solver.precision {
            return Err(SceneError::FixedKey { key: "solver.precision".to_owned() });
        }
        self.solver = changed.solver;
        self.world = changed.world;
        for (body, changed) in self.bodies.iter_mut().zip(changed.bodies) {
            body.material = changed.material;
            body.regions = changed.regions;
        }
        self.tree = changed.tree;
        Ok(())
    }
}

impl Scene {
    /// The same scene in another precision: for another simulation of it.
    pub(crate) fn set_precision(&mut self, precision: Precision) -> Result<(), SceneError> {
        let known = Precision::ALL.iter().find(|(value, ..)| *value == precision);
        let name = known.map_or("f32", |(_, name, _)| name);
        apply_override(&mut self.tree.0, "solver.precision", name)?;
        self.solver.precision = precision;
        Ok(())
    }
}

/// `body.NAME.material...` and `body.NAME.region.I...`, with more below each, and all of solver and world but the
/// precision, which is a matter of the types that a simulation is made of.
fn may_change(key: &str) -> bool {
    let steps: Vec<&str> = key.split('.').map(str::trim).collect();
    match steps.as_slice() {
        ["solver", rest @ ..] => !rest.is_empty() && *rest != ["precision"],
        ["world", _, ..] | ["body", _, "material", _, ..] => true,
        ["body", _, "region", _, last, ..] => *last != "label",
        _ => false,
    }
}
