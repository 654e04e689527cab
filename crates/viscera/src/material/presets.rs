//! Tissue parameters from the literature, with their sources.
//!
//! All are small-strain, quasi-static stiffness of healthy tissue unless said otherwise, mostly from
//! shear-wave elastography, which measures a shear modulus and takes E as three times that. Ex vivo and
//! large-strain values differ by a factor of 2 to 10. Densities of the abdominal organs, of muscle, fat and
//! skin are from PMC3233242, table 3, of the others those of ICRU Report 46, as in PMC3859249, table 2, and
//! PMC4201780, table 1.
//!
//! A source that begins with `assumed:` is no measurement of this tissue: it names the nearest one and says
//! why.

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

/// Every preset: the abdomen first, then what else a scan shows.
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
    Preset {
        name: "adrenal_gland",
        young: 7.5e3,
        young_range: Some([5.1e3, 10e3]),
        poisson: 0.49,
        density: 1030.0,
        source: "Shear-wave elastography of 120 glands; doi:10.1590/1806-9282.20210825",
        caution: "Of newborns; no measurement of healthy adults is known here.",
    },
    Preset {
        name: "bowel_wall",
        young: 240e3,
        young_range: Some([163e3, 337e3]),
        poisson: 0.49,
        density: 1030.0,
        source: "Biaxial tension of porcine small bowel, first straight part of the curve; Terry et al. \
            2014, https://www.inderscience.com/filter.php?aid=66081",
        caution: "Mean of 180 kPa around and 307 kPa along the bowel; seven to eight times that when \
            stretched far. Human colon at large strain: 5.2 MPa, doi:10.1186/s40064-015-0922-x. The wall, \
            not the bowel.",
    },
    Preset {
        name: "prostate",
        young: 36.5e3,
        young_range: Some([30.8e3, 42.3e3]),
        poisson: 0.49,
        density: 1030.0,
        source: "Shear-wave elastography of places without cancer, two studies; \
            doi:10.3892/br.2018.1059 and doi:10.1177/03915603231167650",
        caution: "Of men who were suspected of cancer, the probe pressing; cancer has 64 to 71 kPa.",
    },
    Preset {
        name: "uterus",
        young: 6.4e3,
        young_range: Some([3.8e3, 9.0e3]),
        poisson: 0.49,
        density: 1030.0,
        source: "Shear-wave elastography of 27 women; PMC11196258",
        caution: "The muscle, not pregnant; single women 2.8 to 11.3 kPa.",
    },
    Preset {
        name: "lung",
        young: 4.2e3,
        young_range: Some([3.3e3, 5.2e3]),
        poisson: 0.43,
        density: 380.0,
        source: "Magnetic resonance elastography of ten volunteers; Mariappan et al. 2011, J. \
            Magn. Reson. Imaging 33(6), 1351",
        caution: "Between shear moduli of 1.14 kPa breathed out and 1.83 kPa breathed in, times 2 (1 + nu). \
            Poisson ratio of dog lungs, Lai-Fook et al. 1976. Density with blood, breathed out halfway; air moves freely \
            out of a slowly pressed lung, which is softer then.",
    },
    Preset {
        name: "heart",
        young: 9.0e3,
        young_range: Some([5.3e3, 12.2e3]),
        poisson: 0.49,
        density: 1050.0,
        source: "Shear-wave elastography of the left ventricle in ten volunteers, diastole; Song et al. \
            2016, https://experts.illinois.edu/en/publications/\
            quantitative-assessment-of-left-ventricular-diastolic-stiffness-u",
        caution: "Wave speeds of 1.29 to 1.96 m/s squared, times three times the density. Muscle at rest: \
            several times stiffer when it contracts; stiffer with age; anisotropic.",
    },
    Preset {
        name: "thyroid",
        young: 11e3,
        young_range: Some([7.9e3, 14.1e3]),
        poisson: 0.49,
        density: 1050.0,
        source: ARDA,
        caution: "Nodules are stiffer.",
    },
    Preset {
        name: "salivary_gland",
        young: 10.4e3,
        young_range: Some([6.9e3, 13.9e3]),
        poisson: 0.49,
        density: 1030.0,
        source: ARDA,
        caution: "The parotid gland; the submandibular one has 10.9 kPa.",
    },
    Preset {
        name: "back_muscle",
        young: 7.4e3,
        young_range: Some([4.7e3, 10.2e3]),
        poisson: 0.49,
        density: 1050.0,
        source: "Shear-wave elastography of 27 women; PMC11196258",
        caution: "Relaxed; single women 3.1 to 13.7 kPa. Anisotropic.",
    },
    Preset {
        name: "brain",
        young: 1.6e3,
        young_range: Some([1.1e3, 2.5e3]),
        poisson: 0.49,
        density: 1040.0,
        source: "Indentation of bovine slices; Budday et al. 2015, J. Mech. Behav. Biomed. Mater. 46, \
            318",
        caution: "Between white matter, 1.9 kPa, and gray matter, 1.4 kPa. Vibrated at 50 Hz a brain seems \
            several times stiffer.",
    },
    Preset {
        name: "spinal_cord",
        young: 9.35e3,
        young_range: Some([6.95e3, 11.22e3]),
        poisson: 0.49,
        density: 1040.0,
        source: "Shear-wave elastography during surgery; Al-Habib et al. 2021, in PMC11023619, table 3",
        caution: "After it was freed from pressure; while it was pressed it had 94 kPa, its dura 30 to \
            120 kPa.",
    },
    Preset {
        name: "artery",
        young: 740e3,
        young_range: Some([701e3, 983e3]),
        poisson: 0.49,
        density: 1060.0,
        source: "Ultrasound of the common carotid artery in 3321 people; Riley et al. 1992, \
            https://sites.cscc.unc.edu/aric/node/11375",
        caution: "At the age of 45 to 49, under blood pressure, around the vessel; the upper end at the \
            age of 60 to 64. The wall, not the vessel.",
    },
    Preset {
        name: "vein",
        young: 300e3,
        young_range: None,
        poisson: 0.49,
        density: 1060.0,
        source: "assumed: artery at less than half, since blood presses little on a vein and its \
            collagen is slack",
        caution: "No measurement of a human vein at its own pressure is known here. The wall, not the \
            vessel.",
    },
    Preset {
        name: "trachea",
        young: 1.1e6,
        young_range: Some([0.16e6, 2e6]),
        poisson: 0.45,
        density: 1070.0,
        source: "Compression of whole porcine windpipes, range of human ones; Soriano et al. 2021, \
            doi:10.1183/16000617.0154-2021, table 2",
        caution: "Rings, muscle and ligaments smeared into one wall. The rings alone have 16.9 MPa \
            (PMC5456771), the muscle at their back below 0.4 MPa.",
    },
    Preset {
        name: "costal_cartilage",
        young: 11.1e6,
        young_range: Some([5.5e6, 16.7e6]),
        poisson: 0.45,
        density: 1100.0,
        source: "Indentation by 5 %, twelve bodies; Weber et al. 2021, doi:10.1038/s41598-021-93176-x",
        caution: "33 MPa under plain compression; stiffer with age and where calcified. A thousand times \
            stiffer than muscle: where it hardly bends, an obstacle costs less.",
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
            // Soft tissue: heavier than fat is light, lighter than skin is heavy; lungs are full of air.
            let [lightest, softest] = if name == "lung" { [200.0, 0.4] } else { [900.0, 0.45] };
            assert!((lightest..1200.0).contains(&preset.density), "{name}");
            assert!((softest..=0.499).contains(&preset.poisson), "{name}");
            assert!(!preset.source.is_empty() && !preset.caution.is_empty());
            assert!(
                PRESETS[..index].iter().all(|other| other.name != name),
                "{name} is there twice"
            );
            // Windows tell a body's preset by its numbers.
            let numbers = |one: &Preset| (one.young, one.poisson, one.density);
            assert!(
                PRESETS[..index].iter().all(|other| numbers(other) != numbers(preset)),
                "the numbers of {name} are there twice"
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
