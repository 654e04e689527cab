//! Tissue parameters from the literature, with their sources.
//!
//! All are small-strain, quasi-static stiffness of healthy tissue unless said otherwise, mostly from
//! shear-wave elastography, which measures a shear modulus and takes E as three times that. Ex vivo and
//! large-strain values differ by a factor of 2 to 10. Densities are from PMC3233242, table 3.

use super::{Material, MaterialError, MaterialModel};
use crate::settings::suggest;
use crate::units::{Dimension, shorten};

/// Notes that hold for every preset.
pub const PRESET_CAUTION: &str = "A preset is a starting point, not a measurement of a patient: \
    published values for one tissue differ by a factor of 2 to 10 with method, strain and health.";

/// Typical parameters of a tissue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Preset {
    /// The name in a scene file.
    pub name: &'static str,
    /// Typical Young's modulus [Pa].
    pub young: f64,
    /// Published range of Young's modulus [Pa], lowest and highest, where the source gives one.
    pub young_range: Option<[f64; 2]>,
    /// Poisson ratio to use [-].
    pub poisson: f64,
    /// Density [kg/m^3].
    pub density: f64,
    /// Where the stiffness comes from.
    pub source: &'static str,
    /// Its limits.
    pub caution: &'static str,
}

/// A preset's name that does not exist.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("no preset of this name; {hint}")]
pub struct UnknownPreset {
    /// The name.
    pub name: String,
    /// The nearest valid name, or all of them.
    pub hint: String,
}

const LIVER_STUDY: &str = "PMC6925591, table 1";
const ARDA: &str = "Arda et al. 2011, doi:10.2214/AJR.10.5449, shear-wave elastography";

/// Every preset, softest organs of the abdomen first.
pub const PRESETS: &[Preset] = &[
    Preset {
        name: "liver",
        young: 5.1e3,
        young_range: Some([2.4e3, 8.7e3]),
        poisson: 0.45,
        density: 1060.0,
        source: "Shear-wave elastography of 502 healthy livers; PMC6925591, table 1",
        caution: "Poisson ratio 0.45 to 0.49. Fails at 0.27 MPa, true strain 0.38.",
    },
    Preset {
        name: "liver_fibrotic",
        young: 59e3,
        young_range: None,
        poisson: 0.49,
        density: 1060.0,
        source: LIVER_STUDY,
        caution: "Shear modulus 19.8 kPa tripled.",
    },
    Preset {
        name: "liver_carcinoma",
        young: 70e3,
        young_range: None,
        poisson: 0.49,
        density: 1060.0,
        source: LIVER_STUDY,
        caution: "Shear modulus 23.4 kPa tripled.",
    },
    Preset {
        name: "kidney_cortex",
        young: 5.0e3,
        young_range: Some([2.1e3, 7.9e3]),
        poisson: 0.49,
        density: 1050.0,
        source: ARDA,
        caution: "The spread is more than half of the value.",
    },
    Preset {
        name: "kidney_pelvis",
        young: 23.6e3,
        young_range: Some([18.2e3, 29e3]),
        poisson: 0.49,
        density: 1050.0,
        source: ARDA,
        caution: "Much stiffer than the cortex.",
    },
    Preset {
        name: "spleen",
        young: 2.9e3,
        young_range: Some([1.1e3, 23e3]),
        poisson: 0.49,
        density: 1054.0,
        source: ARDA,
        caution: "Among the least certain: newer devices measure 19 to 23 kPa.",
    },
    Preset {
        name: "pancreas",
        young: 4.8e3,
        young_range: Some([1.8e3, 7.8e3]),
        poisson: 0.49,
        density: 1050.0,
        source: ARDA,
        caution: "Later studies give 5.2 to 7.6 kPa.",
    },
    Preset {
        name: "muscle",
        young: 10.7e3,
        young_range: Some([6.4e3, 15.1e3]),
        poisson: 0.49,
        density: 1050.0,
        source: ARDA,
        caution: "Relaxed skeletal muscle; in truth anisotropic, weakest at 45 degrees to the \
            fibre, and strain dependent (Van Loocke 2006).",
    },
    Preset {
        name: "fat",
        young: 3.0e3,
        young_range: Some([1.8e3, 4.2e3]),
        poisson: 0.49,
        density: 950.0,
        source: "Aspiration in vivo; Samani et al. 2007, doi:10.1088/0031-9155/52/6/002",
        caution: "Among the least certain.",
    },
    Preset {
        name: "skin",
        young: 130e3,
        young_range: Some([56e3, 260e3]),
        poisson: 0.48,
        density: 1090.0,
        source: "Aspiration and suction studies; Geerligs et al. 2011",
        caution: "Among the least certain. The epidermis alone has 1 to 2 MPa.",
    },
    Preset {
        name: "gallbladder_wall",
        young: 255e3,
        young_range: Some([231e3, 279e3]),
        poisson: 0.49,
        density: 1060.0,
        source: LIVER_STUDY,
        caution: "Shear modulus 85 kPa tripled. Fails at 2.5 MPa, strain 0.43.",
    },
    Preset {
        name: "hepatic_artery",
        young: 630e3,
        young_range: Some([489e3, 771e3]),
        poisson: 0.49,
        density: 1050.0,
        source: LIVER_STUDY,
        caution: "Shear modulus 210 kPa tripled; the wall, not the vessel.",
    },
    Preset {
        name: "bile_duct",
        young: 498e3,
        young_range: Some([297e3, 699e3]),
        poisson: 0.49,
        density: 1060.0,
        source: LIVER_STUDY,
        caution: "Shear modulus 166 kPa tripled; the wall, not the duct.",
    },
    Preset {
        name: "stomach",
        young: 1.92e3,
        young_range: None,
        poisson: 0.49,
        density: 1058.0,
        source: LIVER_STUDY,
        caution: "Shear modulus 0.64 kPa tripled.",
    },
];

/// Finds a preset by name.
///
/// ```
/// use viscera::material::preset;
/// assert_eq!(preset("liver").map(|liver| liver.density), Ok(1060.0));
/// assert!(preset("livre").unwrap_err().to_string().contains("`liver`"));
/// ```
pub fn preset(name: &str) -> Result<&'static Preset, UnknownPreset> {
    PRESETS.iter().find(|preset| preset.name == name).ok_or_else(|| {
        let names: Vec<_> = PRESETS.iter().map(|preset| preset.name).collect();
        UnknownPreset { name: shorten(name), hint: suggest(name, &names) }
    })
}

impl Preset {
    /// The preset as a material.
    pub fn material(&self, model: MaterialModel) -> Result<Material, MaterialError> {
        Material::new(model, self.young, self.poisson, self.density)
    }

    /// One paragraph: numbers, source and caution; [`PRESET_CAUTION`] holds besides.
    pub fn description(&self) -> String {
        let pressure = |value| Dimension::Pressure.format(value);
        let range = match self.young_range {
            Some([low, high]) => format!("published {} to {}", pressure(low), pressure(high)),
            None => "no range published".to_owned(),
        };
        format!(
            "E {} ({range}), nu {}, {}. {}. {}",
            pressure(self.young),
            self.poisson,
            Dimension::Density.format(self.density),
            self.source,
            self.caution,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_is_a_possible_material_inside_its_published_range() {
        for (index, preset) in PRESETS.iter().enumerate() {
            let name = preset.name;
            assert!(preset.material(MaterialModel::StableNeoHookean).is_ok(), "{name}");
            let inside = |[low, high]: [f64; 2]| low < preset.young && preset.young < high;
            assert!(preset.young_range.is_none_or(inside), "{name}");
            // Soft tissue: heavier than fat is light, lighter than skin is heavy.
            assert!((900.0..1200.0).contains(&preset.density), "{name}");
            assert!((0.45..=0.499).contains(&preset.poisson), "{name}");
            assert!(!preset.source.is_empty() && !preset.caution.is_empty());
            assert!(
                PRESETS[..index].iter().all(|other| other.name != name),
                "{name} is there twice"
            );
        }
    }

    #[test]
    fn a_misspelt_preset_gets_the_nearest_name() {
        let hint = |name| preset(name).map_err(|error| error.hint);
        assert_eq!(hint("sploen"), Err("did you mean `spleen`?".into()));
        assert!(hint("xylophone").is_err_and(|hint| hint.contains("liver, liver_fibrotic")));
    }
}
