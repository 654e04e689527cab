//! What there is to choose from: scenes, presets, settings.

use serde::Serialize;
use viscera::material::{MaterialModel, PRESETS};
use viscera::scene::{BodyShape, Scene, describe_settings};
use viscera_resources::BUILT_IN;
use viscera_stage::Settings;

/// A built-in scene.
#[derive(Debug, Serialize)]
pub struct SceneEntry {
    /// Its name.
    pub name: &'static str,
    /// Its title.
    pub title: String,
    /// What it shows.
    pub description: String,
    /// The scene file.
    pub text: &'static str,
}

/// The built-in scenes.
pub fn scenes() -> Vec<SceneEntry> {
    let parsed = |scene: &viscera_resources::BuiltInScene| {
        let read = Scene::parse(scene.name, scene.text, &[]).ok()?;
        let description = read.description.split_whitespace().collect::<Vec<_>>().join(" ");
        Some(SceneEntry { name: scene.name, title: read.title, description, text: scene.text })
    };
    BUILT_IN.iter().filter_map(parsed).collect()
}

/// A tissue of the literature.
#[derive(Debug, Serialize)]
pub struct PresetEntry {
    /// Its name.
    pub name: &'static str,
    /// What it stands for, with its source.
    pub about: String,
    /// Young's modulus [Pa].
    pub young: f64,
    /// Poisson ratio.
    pub poisson: f64,
    /// [kg/m^3].
    pub density: f64,
    /// The law.
    pub model: &'static str,
}

/// The presets.
pub fn presets() -> Vec<PresetEntry> {
    let entry = |preset: &viscera::material::Preset| PresetEntry {
        name: preset.name,
        about: preset.description(),
        young: preset.young,
        poisson: preset.poisson,
        density: preset.density,
        model: law_name(MaterialModel::StableNeoHookean),
    };
    PRESETS.iter().map(entry).collect()
}

/// The name of a law in a scene file.
pub fn law_name(model: MaterialModel) -> &'static str {
    match model {
        MaterialModel::SaintVenantKirchhoff => "saint_venant_kirchhoff",
        MaterialModel::StableNeoHookean => "stable_neo_hookean",
    }
}

/// A setting of a scene.
#[derive(Debug, Serialize)]
pub struct SettingEntry {
    /// As overrides name it: "solver.method".
    pub key: String,
    /// What it does.
    pub about: String,
    /// The names to choose from; nothing where it is no choice.
    pub values: Option<Vec<String>>,
    /// "choice", "number" or "text".
    pub kind: &'static str,
    /// As one would write it.
    pub default: String,
}

/// The settings of solver and world.
pub fn settings() -> Vec<SettingEntry> {
    describe_settings()
        .into_iter()
        .flat_map(|table| {
            let path = table.path;
            table.keys.into_iter().map(move |key| {
                let values = names_in(&key.type_text);
                let is_number = ["number", "whole"].iter().any(|word| key.type_text.contains(word));
                let kind = match (&values, is_number) {
                    (Some(_), false) => "choice",
                    (_, true) => "number",
                    (None, false) => "text",
                };
                let default = key.default.trim_matches('"').to_owned();
                SettingEntry {
                    key: format!("{path}.{}", key.name),
                    about: key.doc,
                    values,
                    kind,
                    default,
                }
            })
        })
        .collect()
}

/// The names in quotes that a description of a type lists.
fn names_in(type_text: &str) -> Option<Vec<String>> {
    let names: Vec<String> = type_text.split('"').skip(1).step_by(2).map(str::to_owned).collect();
    // An example in quotes, `such as "5 kPa"`, is no list.
    (!names.is_empty() && !type_text.contains("such as")).then_some(names)
}

/// The settings that make a scene's shapes coarser (a factor above 1) or finer; none where no body has a shape.
pub fn mesh_settings(scene: &Scene, factor: f64) -> Settings {
    let cells = |count: u32| ((f64::from(count) / factor).round() as u32).max(1);
    let mut settings = Settings::new();
    for body in &scene.bodies {
        let mut put = |key: &str, value: String| {
            settings.push((format!("body.{}.{key}", body.name), value));
        };
        match body.shape {
            BodyShape::File { .. } => {}
            BodyShape::Beam { cells_across, .. } => {
                put("cells_across", cells(cells_across).to_string());
            }
            BodyShape::Block { cells: [x, y, z], .. } => {
                put("cells", format!("[{}, {}, {}]", cells(x), cells(y), cells(z)));
            }
            BodyShape::Sphere { spacing, .. }
            | BodyShape::Capsule { spacing, .. }
            | BodyShape::Liver { spacing, .. } => {
                put("spacing", format!("{} m", spacing * factor));
            }
        }
    }
    settings
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera::simulation::Assembly;

    #[test]
    fn scenes_and_settings_are_listed_with_what_they_say() {
        let scenes = scenes();
        assert_eq!(scenes.len(), BUILT_IN.len());
        assert!(
            scenes.iter().all(|scene| !scene.title.is_empty() && !scene.description.is_empty())
        );
        let settings = settings();
        let named = |key: &str| settings.iter().find(|entry| entry.key == key).expect("a setting");
        let method = named("solver.method");
        assert_eq!(method.kind, "choice");
        let values = method.values.as_ref().expect("names");
        for value in ["auto", "xpbd", "explicit", "quasi_newton"] {
            assert!(values.iter().any(|name| name == value), "{values:?}");
        }
        assert_eq!(named("solver.iterations").kind, "number");
        assert_eq!(named("world.gravity").kind, "text");
        assert!(presets().iter().any(|preset| preset.name == "liver" && preset.young == 5100.0));
    }

    #[test]
    fn a_factor_of_the_element_size_changes_the_number_of_tetrahedra_by_its_cube() {
        for scene in scenes() {
            let count = |factor: f64| {
                let plain = Scene::parse(scene.name, scene.text, &[]).expect("a scene");
                let settings = mesh_settings(&plain, factor);
                let borrowed: Vec<(&str, &str)> =
                    settings.iter().map(|(key, value)| (key.as_str(), value.as_str())).collect();
                let mut scene = Scene::parse(scene.name, scene.text, &borrowed).expect("a scene");
                // A coarse mesh may be too coarse for a tool, or overlap another: the page says so when that mesh is chosen.
                scene.tools.clear();
                scene.ties.clear();
                (scene.contact.self_, scene.contact.bodies) = (false, false);
                let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned()));
                let assembly = assembly.unwrap_or_else(|error| panic!("{}: {error}", scene.name));
                assembly.bodies.iter().map(|body| body.tets.len()).sum::<usize>() as f64
            };
            let (usual, coarse) = (count(1.0), count(1.6));
            // Others would take a while.
            if usual < 1e4 {
                let fine = count(0.5);
                assert!((5.0..11.0).contains(&(fine / usual)), "{}: {fine} of {usual}", scene.name);
            }
            assert!(coarse < 0.6 * usual, "{}: {coarse} of {usual}", scene.name);
        }
    }
}
