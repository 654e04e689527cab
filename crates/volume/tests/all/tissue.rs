//! The tissue of each class, names of classes, `docs/tissue.md`.

use std::path::Path;

use viscera::material::preset;
use viscera_volume::tissue::{CLASSES, FURTHER, Kind, describe_markdown, tissue_of};
use viscera_volume::total_segmentator::NAMES;

/// The class that a name finds.
fn class_of(name: &str) -> Option<&'static str> {
    tissue_of(name).map(|tissue| tissue.class)
}

#[test]
fn every_class_of_total_segmentator_has_its_tissue_in_its_place() {
    assert_eq!(CLASSES.map(|tissue| tissue.class), NAMES);
    let mut all: Vec<_> = CLASSES.iter().chain(FURTHER).map(|tissue| tissue.class).collect();
    all.sort_unstable();
    all.dedup();
    assert_eq!(all.len(), CLASSES.len() + FURTHER.len(), "a class is there twice");
}

#[test]
fn presets_exist_and_walls_and_densities_are_those_of_a_body() {
    for tissue in CLASSES.iter().chain(FURTHER) {
        let class = tissue.class;
        let (name, source) = match tissue.kind {
            Kind::Soft(preset) => (Some(preset), None),
            Kind::Hollow { preset, source, .. } | Kind::Vessel { preset, source, .. } => {
                (Some(preset), Some(source))
            }
            Kind::Rigid | Kind::Air => (None, None),
        };
        assert_eq!(tissue.preset(), name.map(|name| preset(name).expect(class)), "{class}");
        assert_eq!(tissue.wall().is_some(), source.is_some(), "{class}");
        assert!(tissue.wall().is_none_or(|wall| (0.5e-3..=3e-3).contains(&wall)), "{class}");
        assert!(source.is_none_or(|source| !source.is_empty()), "{class}");
        let density = tissue.density();
        assert_eq!(density.is_none(), tissue.kind == Kind::Air, "{class}");
        assert!(density.is_none_or(|it| (200.0..2100.0).contains(&it)), "{class}: {density:?}");
    }
}

#[test]
fn bone_is_rigid_and_nothing_else_is() {
    let bones =
        ["vertebrae", "rib_", "sacrum", "humerus", "scapula", "clavicula", "femur", "hip", "skull"];
    for tissue in CLASSES.iter().chain(FURTHER) {
        let class = tissue.class;
        let is_bone = class == "sternum" || bones.iter().any(|bone| class.starts_with(bone));
        assert_eq!(tissue.kind == Kind::Rigid, is_bone, "{class}");
    }
}

#[test]
fn tissue_stiffens_from_fat_to_muscle_to_vessels_to_cartilage() {
    let young = |name: &str| tissue_of(name).and_then(|it| it.preset()).expect(name).young;
    let order = ["brain", "fat", "muscle", "prostate", "vena cava", "aorta", "costal cartilage"];
    assert!(order.is_sorted_by(|a, b| young(a) < young(b)), "{:?}", order.map(young));
    let density = |name: &str| tissue_of(name).and_then(|it| it.density()).expect(name);
    let order = ["left lung", "fat", "liver", "cartilage", "femur"];
    assert!(order.is_sorted_by(|a, b| density(a) < density(b)), "{:?}", order.map(density));
}

#[test]
fn classes_are_found_by_their_own_names_in_any_writing() {
    for tissue in CLASSES.iter().chain(FURTHER) {
        let class = tissue.class;
        let backwards: Vec<_> = class.split('_').rev().collect();
        let camel = class.split('_').map(|word| word[..1].to_uppercase() + &word[1..]);
        let mut written = vec![
            class.to_owned(),
            class.to_uppercase(),
            class.replace('_', "-"),
            class.replace('_', " "),
            backwards.join(" "),
            camel.collect::<Vec<_>>().concat(),
        ];
        if !class.contains(char::is_numeric) {
            written.push(class.replace("left", "l").replace("right", "R"));
            written.push(format!("seg_{class}_3"));
        }
        for name in written {
            assert_eq!(class_of(&name), Some(class), "{name}");
        }
    }
}

#[test]
fn classes_are_found_by_the_names_that_people_give() {
    for (name, class) in [
        ("Left Kidney", "kidney_left"),
        ("kidney-l", "kidney_left"),
        ("Kidney (R)", "kidney_right"),
        ("renal cortex right", "kidney_right"),
        ("kidneys", "kidney_right"),
        ("renal pelvis", "kidney_pelvis"),
        ("left renal cyst", "kidney_cyst_left"),
        ("Liver_Segment_4", "liver"),
        ("left lobe of the liver", "liver"),
        ("gall bladder", "gallbladder"),
        ("Bladder", "urinary_bladder"),
        ("tumour", "tumor"),
        ("Liver tumor 2", "tumor"),
        ("lesion3", "tumor"),
        ("vena cava", "inferior_vena_cava"),
        ("SVC", "superior_vena_cava"),
        ("postcava", "inferior_vena_cava"),
        ("hepatic vessels", "portal_vein_and_splenic_vein"),
        ("portal vein", "portal_vein_and_splenic_vein"),
        ("iliac vein left", "iliac_vena_left"),
        ("carotid artery, right", "common_carotid_artery_right"),
        ("bowel", "small_bowel"),
        ("Bowel_Large", "colon"),
        ("sigmoid colon", "colon"),
        ("small intestine", "small_bowel"),
        ("oesophagus", "esophagus"),
        ("uterus", "uterus"),
        ("prostate", "prostate"),
        ("prostate/uterus", "prostate"),
        ("SpinalCord", "spinal_cord"),
        ("Glnd_Thyroid", "thyroid_gland"),
        ("Parotid_L", "salivary_gland"),
        ("right lung", "lung_upper_lobe_right"),
        ("lower lobe of left lung", "lung_lower_lobe_left"),
        ("left upper lobe", "lung_upper_lobe_left"),
        ("heart_ventricle_left", "heart"),
        ("left atrial appendage", "atrial_appendage_left"),
        ("psoas muscle left", "iliopsoas_left"),
        ("muscle", "skeletal_muscle"),
        ("subcutaneous fat", "fat"),
        ("vertebra L5", "vertebrae_L5"),
        ("vertebra L6", "vertebrae_L3"),
        ("spine", "vertebrae_L3"),
        ("left ribs", "rib_left_1"),
        ("Bone", "hip_left"),
        ("left femoral head", ""),
        ("Femur_Head_L", "femur_left"),
        ("bowel gas", ""),
        ("gas", "air"),
    ] {
        assert_eq!(class_of(name), Some(class).filter(|class| !class.is_empty()), "{name}");
    }
}

#[test]
fn what_is_not_known_has_no_tissue() {
    let long = "liver ".repeat(50);
    let unknown =
        ["", " ", "left", "12", "the", "L", "L3", "spaceship", "liverwurst", "табла", "🫀"];
    for name in unknown.into_iter().chain([long.as_str(), "kidney liver", "background"]) {
        assert_eq!(class_of(name), None, "{name}");
    }
}

#[test]
fn document_is_current() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/tissue.md");
    let printed = describe_markdown();
    if std::env::var_os("VISCERA_WRITE").is_some_and(|value| value == "1") {
        std::fs::write(&path, &printed).expect("docs/tissue.md can be written");
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default().replace("\r\n", "\n");
    assert!(
        written == printed,
        "docs/tissue.md is not what the program says; run\n\
         VISCERA_WRITE=1 cargo test -p viscera-volume --test all tissue"
    );
}

#[test]
fn document_names_every_class_and_every_assumption() {
    let text = describe_markdown();
    for tissue in CLASSES.iter().chain(FURTHER) {
        assert!(text.contains(&format!("`{}`", tissue.class)), "{}", tissue.class);
    }
    for link in ["(https://doi.org/10.2214/AJR.10.5449)", "/articles/PMC6925591/)", "/14500212/)"] {
        assert!(text.contains(link), "{link}");
    }
    let columns = |line: &str| line.matches(" | ").count();
    let rows: Vec<_> = text.lines().filter(|line| line.starts_with("| `")).collect();
    assert!(rows.len() > 60, "{} rows", rows.len());
    assert!(rows.iter().all(|row| [5, 6].contains(&columns(row))), "{rows:#?}");
}
