//! What a person has chosen, as overrides of the scene file, with undo and redo.

use viscera::material::Material;
use viscera::scene::Scene;

/// Keys and values as `--set` of `viscera run` takes them; the later of two equal keys holds.
pub use viscera_stage::Settings;

/// All choices that undo restores.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Choices {
    /// Hold for every solver.
    pub shared: Settings,
    /// What the second solver differs in, where two are compared.
    pub second: Option<Settings>,
    /// Whether the reference is shown as a ghost.
    pub ghost: bool,
}

/// Which solver a choice is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The only one, or the left one, and everything that is no setting of the solver.
    First,
    /// The right one of a comparison.
    Second,
}

/// The reference: steps short enough for the finest accuracy, each solved to round-off. In double precision it would cost
/// twice as much, and look the same.
const REFERENCE: [(&str, &str); 6] = [
    ("solver.method", "quasi_newton"),
    ("solver.integrator", "sdirk2"),
    ("solver.accuracy", "fine"),
    ("solver.substeps", "auto"),
    ("solver.iterations", "40"),
    ("solver.device", "cpu"),
];

impl Choices {
    /// The settings of each simulation: of the first, of the second where there is one.
    pub fn of(&self, side: Side) -> Settings {
        let mut settings = self.shared.clone();
        if side == Side::Second {
            for (key, value) in self.second.iter().flatten() {
                put(&mut settings, key, value);
            }
        }
        settings
    }

    /// The settings of the reference.
    pub fn reference(&self) -> Settings {
        let mut settings = self.shared.clone();
        for (key, value) in REFERENCE {
            put(&mut settings, key, value);
        }
        settings
    }

    /// With a setting changed.
    pub fn with(&self, side: Side, key: &str, value: &str) -> Self {
        let mut changed = self.clone();
        match (side, &mut changed.second) {
            (Side::Second, Some(second)) => put(second, key, value),
            _ => put(&mut changed.shared, key, value),
        }
        changed
    }
}

/// Sets a key, where it stands already in its place.
pub fn put(settings: &mut Settings, key: &str, value: &str) {
    match settings.iter_mut().find(|(known, _)| known == key) {
        Some((_, old)) => value.clone_into(old),
        None => settings.push((key.to_owned(), value.to_owned())),
    }
}

/// Steps that can be undone and redone. One drag of a slider is one step.
#[derive(Debug, Default)]
pub struct History {
    done: Vec<Choices>,
    undone: Vec<Choices>,
    /// The key whose slider is being dragged.
    gesture: Option<String>,
}

/// How many steps are kept.
const MOST_STEPS: usize = 500;

impl History {
    /// Notes what held before a change. Changes of one key in one `gesture`, which [`Self::settle`] ends, are
    /// one step.
    pub fn record(&mut self, before: &Choices, key: &str, gesture: bool) {
        let goes_on = gesture && self.gesture.as_deref() == Some(key);
        if !goes_on {
            self.done.push(before.clone());
            let surplus = self.done.len().saturating_sub(MOST_STEPS);
            self.done.drain(..surplus);
        }
        self.undone.clear();
        self.gesture = gesture.then(|| key.to_owned());
    }

    /// Nothing is being dragged any more: the next drag is a step of its own, of the same slider as well.
    pub fn settle(&mut self) {
        self.gesture = None;
    }

    /// What held before the last step.
    pub fn undo(&mut self, now: &Choices) -> Option<Choices> {
        self.settle();
        exchange(&mut self.done, &mut self.undone, now)
    }

    /// What held before the last undo.
    pub fn redo(&mut self, now: &Choices) -> Option<Choices> {
        exchange(&mut self.undone, &mut self.done, now)
    }

    /// Whether there is something to undo.
    pub fn can_undo(&self) -> bool {
        !self.done.is_empty()
    }

    /// Whether there is something to redo.
    pub fn can_redo(&self) -> bool {
        !self.undone.is_empty()
    }
}

fn exchange(from: &mut Vec<Choices>, to: &mut Vec<Choices>, now: &Choices) -> Option<Choices> {
    let taken = from.pop()?;
    to.push(now.clone());
    Some(taken)
}

/// What takes a running simulation from one scene to another: `None` where it has to begin anew.
pub fn difference(old: &Scene, new: &Scene) -> Option<Settings> {
    let mut settings = Vec::new();
    // What differs beyond solver, world and materials is no change of a running simulation.
    let mut rest = new.clone();
    rest.solver.clone_from(&old.solver);
    rest.world.clone_from(&old.world);
    for (body, before) in rest.bodies.iter_mut().zip(&old.bodies) {
        body.material = before.material;
        body.regions.clone_from(&before.regions);
    }
    if rest != *old || old.solver.precision != new.solver.precision {
        return None;
    }
    for ((key, before), (_, after)) in old.solver.values().iter().zip(new.solver.values()) {
        if *before != after {
            settings.push((format!("solver.{key}"), after));
        }
    }
    if old.world != new.world {
        let [x, y, z] = new.world.gravity.to_array();
        let value = format!("[\"{x} m/s^2\", \"{y} m/s^2\", \"{z} m/s^2\"]");
        settings.push(("world.gravity".to_owned(), value));
    }
    for (before, after) in old.bodies.iter().zip(&new.bodies) {
        material_difference(&before.name, &before.material, &after.material, &mut settings);
    }
    Some(settings)
}

fn material_difference(body: &str, old: &Material, new: &Material, settings: &mut Settings) {
    let mut differ = |key: &str, differs: bool, value: String| {
        if differs {
            settings.push((format!("body.{body}.material.{key}"), value));
        }
    };
    differ("model", old.model() != new.model(), law_name(new).to_owned());
    differ("young", old.young() != new.young(), pascals(new.young()));
    differ("poisson", old.poisson() != new.poisson(), new.poisson().to_string());
    differ("density", old.density() != new.density(), format!("{} kg/m^3", new.density()));
    differ("viscosity", old.viscosity() != new.viscosity(), format!("{} s", new.viscosity()));
}

/// A pressure [Pa] as a scene file has it, to the last digit.
pub fn pascals(value: f64) -> String {
    format!("{value} Pa")
}

/// The name of a material's law in a scene file.
pub fn law_name(material: &Material) -> &'static str {
    use viscera::material::MaterialModel::{SaintVenantKirchhoff, StableNeoHookean};
    match material.model() {
        SaintVenantKirchhoff => "saint_venant_kirchhoff",
        StableNeoHookean => "stable_neo_hookean",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"
        [[body]]
        name = "bar"
        shape = "beam"
        length = "0.2 m"
        width = "50 mm"
        height = "50 mm"
        material = { preset = "liver" }
    "#;

    fn scene(settings: &[(&str, &str)]) -> Scene {
        Scene::parse("bar.toml", TEXT, settings).expect("a legal scene")
    }

    #[test]
    fn every_drag_of_a_slider_is_one_step_back() {
        let (mut history, mut now) = (History::default(), Choices::default());
        for values in [["6 kPa", "7 kPa", "8 kPa"], ["9 kPa", "10 kPa", "11 kPa"]] {
            for value in values {
                history.record(&now, "body.bar.material.young", true);
                now = now.with(Side::First, "body.bar.material.young", value);
            }
            history.settle();
        }
        history.record(&now, "body.bar.material.young", false);
        now = now.with(Side::First, "body.bar.material.young", "12 kPa");
        for before in ["11 kPa", "8 kPa"] {
            now = history.undo(&now).expect("a step");
            assert_eq!(now.shared[0].1, before);
        }
        now = history.undo(&now).expect("the first drag");
        assert_eq!(now, Choices::default());
        assert!(!history.can_undo());
        now = history.redo(&now).expect("the drag again");
        assert_eq!(now.shared[0].1, "8 kPa");
    }

    #[test]
    fn a_running_simulation_takes_what_differs_and_nothing_else() {
        let settings = [("body.bar.material.young", "0.1 kPa"), ("solver.iterations", "7")];
        let changes = difference(&scene(&[]), &scene(&settings)).expect("a live change");
        let expected = [("solver.iterations", "7"), ("body.bar.material.young", "100 Pa")];
        let expected = expected.map(|(key, value)| (key.to_owned(), value.to_owned()));
        assert_eq!(changes, expected);
        let back = difference(&scene(&settings[1..]), &scene(&[])).expect("a live change");
        assert_eq!(back, [("solver.iterations".to_owned(), "\"auto\"".to_owned())]);
        assert_eq!(difference(&scene(&settings), &scene(&settings)), Some(Vec::new()));
        assert_eq!(difference(&scene(&[]), &scene(&[("body.bar.length", "0.3 m")])), None);
        assert_eq!(difference(&scene(&[]), &scene(&[("solver.precision", "f64")])), None);
    }

    #[test]
    fn the_second_solver_differs_in_its_own_settings_alone() {
        let mut choices = Choices { second: Some(Vec::new()), ..Choices::default() };
        choices = choices.with(Side::First, "solver.iterations", "40");
        choices = choices.with(Side::Second, "solver.acceleration", "anderson");
        assert_eq!(choices.of(Side::First).len(), 1);
        let second = choices.of(Side::Second);
        assert_eq!(second[0].1, "40");
        assert_eq!(second[1].1, "anderson");
    }
}
