//! The classes, their tissues and walls.

use super::{ClassTissue, Kind};

const fn soft(class: &'static str, preset: &'static str, note: &'static str) -> ClassTissue {
    ClassTissue { class, kind: Kind::Soft(preset), note }
}

const fn hollow(
    class: &'static str,
    preset: &'static str,
    wall: f64,
    source: &'static str,
    note: &'static str,
) -> ClassTissue {
    ClassTissue { class, kind: Kind::Hollow { preset, wall, source }, note }
}

const fn vessel(
    class: &'static str,
    preset: &'static str,
    wall: f64,
    source: &'static str,
    note: &'static str,
) -> ClassTissue {
    ClassTissue { class, kind: Kind::Vessel { preset, wall, source }, note }
}

const fn rigid(class: &'static str) -> ClassTissue {
    ClassTissue { class, kind: Kind::Rigid, note: "" }
}

// Thickness of walls.
const JAMAL: &str = "Ultrasound of 400 adults; Jamal et al., \
    https://zjms.hmu.edu.krd/index.php/zjms/article/view/860";
const PICKHARDT: &str = "CT of the body of the stomach in 153 patients, its outlet 5.1 mm; Pickhardt and \
    Asher 2003, PMID 14500212";
const NYLUND: &str = "Ultrasound of 122 adults, jejunum to sigmoid colon 0.9 to 1.2 mm, duodenum 1.6 mm; \
    Nylund et al. 2012, doi:10.1055/s-0031-1299329";
const ZAFAR: &str = "Ultrasound of 60 adults; Zafar et al. 2022, doi:10.54393/pjhs.v3i01.42. Full 1.6 mm, \
    empty 2.8 mm: children and ten adults, Jequier and \
    Rousseau 1987, AJR 149, 563";
const MENSEL: &str = "MRI of 753 adults, 1.3 mm descending, 1.5 mm ascending; Mensel et al. 2014, \
    doi:10.1007/s00330-014-3188-8";
const DIAZ: &str = "Ultrasound of 1012 people, the two inner layers; Diaz et al. 2018, PMC5832113";
const AUGUSTIN: &str = "Three left atria, 0.7 to 1.3 mm; Augustin et al. 2020, PMC7203597. At the mouth \
    of the appendage 2.2 to 3.2 mm: doi:10.1111/jce.15157";
const ESOPHAGUS_WALL: &str =
    "assumed: below the 5 mm that radiologists take for the upper end of normal";
const TRACHEA_WALL: &str = "assumed: the thickness of a ring of cartilage, with its lining";
const ARTERY_WALL: &str = "assumed: between common carotid artery and aorta";
const VEIN_WALL: &str =
    "assumed: a large vein as a large artery, since thinner walls cannot be meshed";
const DUCT_WALL: &str = "assumed: as a small artery's";
const THIN_CYST: &str = "assumed: a plain cyst's wall is thinner than a scan shows";

// What to know.
const KIDNEY: &str =
    "The label has the cortex, and the medulla; the pelvis is stiffer: `kidney_pelvis`.";
const CYST: &str =
    "assumed: the kidney's tissue, which the cyst has stretched. Filled with liquid.";
const STOMACH: &str = "assumed: small bowel, with the same layers in its wall. The preset `stomach` was \
    measured by pressing on a whole organ (Lim et al. 2009), and suits a solid one.";
const ESOPHAGUS: &str =
    "assumed: small bowel, with the same layers in its wall, though its muscle is thicker.";
const COLON: &str = "assumed: small bowel, with the same layers in its wall. Of colon only the stiffness \
    short of tearing is known here: 5.2 MPa, doi:10.1186/s40064-015-0922-x.";
const BLADDER: &str = "assumed: small bowel, a muscular wall as well. Of bladder only the stiffness short of \
    tearing is known here: 1.9 MPa, doi:10.1007/s00192-011-1409-0.";
const HEART: &str = "The label has the blood in the chambers as well.";
const ATRIUM: &str = "assumed: the ventricle's muscle, slack. Its lining of collagen is stiffer.";
const AORTA: &str = "assumed: common carotid artery, elastic as the aorta is.";
const ARTERY: &str = "assumed: common carotid artery, of like size.";
const MUSCLE: &str = "assumed: calf and masseter muscle, relaxed.";
const TUMOR: &str = "assumed: carcinoma of the liver, the one tumour of the abdomen with a preset. Tumours \
    are as soft as the organ or, in the breast, up to thirteen times as stiff (Samani et al. 2007, \
    doi:10.1088/0031-9155/52/6/002).";
const BREAST: &str = "assumed: fat, to which healthy glands are equal (Samani et al. 2007, \
    doi:10.1088/0031-9155/52/6/002).";
const FAT: &str = "The paper that the preset cites measured fat of the breast, excised.";
const RECTUM: &str = "assumed: small bowel, with the same layers in its wall.";

/// The classes of TotalSegmentator's task `total`, version 2, in the order of
/// [`total_segmentator::NAMES`](crate::total_segmentator::NAMES).
pub static CLASSES: [ClassTissue; 117] = [
    soft("spleen", "spleen", ""),
    soft("kidney_right", "kidney_cortex", KIDNEY),
    soft("kidney_left", "kidney_cortex", KIDNEY),
    hollow("gallbladder", "gallbladder_wall", 2.5e-3, JAMAL, ""),
    soft("liver", "liver", ""),
    hollow("stomach", "bowel_wall", 2e-3, PICKHARDT, STOMACH),
    soft("pancreas", "pancreas", ""),
    soft("adrenal_gland_right", "adrenal_gland", ""),
    soft("adrenal_gland_left", "adrenal_gland", ""),
    soft("lung_upper_lobe_left", "lung", ""),
    soft("lung_lower_lobe_left", "lung", ""),
    soft("lung_upper_lobe_right", "lung", ""),
    soft("lung_middle_lobe_right", "lung", ""),
    soft("lung_lower_lobe_right", "lung", ""),
    hollow("esophagus", "bowel_wall", 3e-3, ESOPHAGUS_WALL, ESOPHAGUS),
    hollow("trachea", "trachea", 2e-3, TRACHEA_WALL, ""),
    soft("thyroid_gland", "thyroid", ""),
    hollow("small_bowel", "bowel_wall", 1e-3, NYLUND, ""),
    hollow("duodenum", "bowel_wall", 1.6e-3, NYLUND, ""),
    hollow("colon", "bowel_wall", 1e-3, NYLUND, COLON),
    hollow("urinary_bladder", "bowel_wall", 2.8e-3, ZAFAR, BLADDER),
    soft("prostate", "prostate", ""),
    hollow("kidney_cyst_left", "kidney_cortex", 1e-3, THIN_CYST, CYST),
    hollow("kidney_cyst_right", "kidney_cortex", 1e-3, THIN_CYST, CYST),
    rigid("sacrum"),
    rigid("vertebrae_S1"),
    rigid("vertebrae_L5"),
    rigid("vertebrae_L4"),
    rigid("vertebrae_L3"),
    rigid("vertebrae_L2"),
    rigid("vertebrae_L1"),
    rigid("vertebrae_T12"),
    rigid("vertebrae_T11"),
    rigid("vertebrae_T10"),
    rigid("vertebrae_T9"),
    rigid("vertebrae_T8"),
    rigid("vertebrae_T7"),
    rigid("vertebrae_T6"),
    rigid("vertebrae_T5"),
    rigid("vertebrae_T4"),
    rigid("vertebrae_T3"),
    rigid("vertebrae_T2"),
    rigid("vertebrae_T1"),
    rigid("vertebrae_C7"),
    rigid("vertebrae_C6"),
    rigid("vertebrae_C5"),
    rigid("vertebrae_C4"),
    rigid("vertebrae_C3"),
    rigid("vertebrae_C2"),
    rigid("vertebrae_C1"),
    soft("heart", "heart", HEART),
    vessel("aorta", "artery", 1.4e-3, MENSEL, AORTA),
    vessel("pulmonary_vein", "vein", 1e-3, VEIN_WALL, ""),
    vessel("brachiocephalic_trunk", "artery", 1e-3, ARTERY_WALL, ARTERY),
    vessel("subclavian_artery_right", "artery", 1e-3, ARTERY_WALL, ARTERY),
    vessel("subclavian_artery_left", "artery", 1e-3, ARTERY_WALL, ARTERY),
    vessel("common_carotid_artery_right", "artery", 0.6e-3, DIAZ, ""),
    vessel("common_carotid_artery_left", "artery", 0.6e-3, DIAZ, ""),
    vessel("brachiocephalic_vein_left", "vein", 1e-3, VEIN_WALL, ""),
    vessel("brachiocephalic_vein_right", "vein", 1e-3, VEIN_WALL, ""),
    hollow("atrial_appendage_left", "heart", 1.2e-3, AUGUSTIN, ATRIUM),
    vessel("superior_vena_cava", "vein", 1e-3, VEIN_WALL, ""),
    vessel("inferior_vena_cava", "vein", 1e-3, VEIN_WALL, ""),
    vessel("portal_vein_and_splenic_vein", "vein", 1e-3, VEIN_WALL, ""),
    vessel("iliac_artery_left", "artery", 1e-3, ARTERY_WALL, ARTERY),
    vessel("iliac_artery_right", "artery", 1e-3, ARTERY_WALL, ARTERY),
    vessel("iliac_vena_left", "vein", 1e-3, VEIN_WALL, ""),
    vessel("iliac_vena_right", "vein", 1e-3, VEIN_WALL, ""),
    rigid("humerus_left"),
    rigid("humerus_right"),
    rigid("scapula_left"),
    rigid("scapula_right"),
    rigid("clavicula_left"),
    rigid("clavicula_right"),
    rigid("femur_left"),
    rigid("femur_right"),
    rigid("hip_left"),
    rigid("hip_right"),
    soft("spinal_cord", "spinal_cord", ""),
    soft("gluteus_maximus_left", "muscle", MUSCLE),
    soft("gluteus_maximus_right", "muscle", MUSCLE),
    soft("gluteus_medius_left", "muscle", MUSCLE),
    soft("gluteus_medius_right", "muscle", MUSCLE),
    soft("gluteus_minimus_left", "muscle", MUSCLE),
    soft("gluteus_minimus_right", "muscle", MUSCLE),
    soft("autochthon_left", "back_muscle", ""),
    soft("autochthon_right", "back_muscle", ""),
    soft("iliopsoas_left", "muscle", MUSCLE),
    soft("iliopsoas_right", "muscle", MUSCLE),
    soft("brain", "brain", ""),
    rigid("skull"),
    rigid("rib_left_1"),
    rigid("rib_left_2"),
    rigid("rib_left_3"),
    rigid("rib_left_4"),
    rigid("rib_left_5"),
    rigid("rib_left_6"),
    rigid("rib_left_7"),
    rigid("rib_left_8"),
    rigid("rib_left_9"),
    rigid("rib_left_10"),
    rigid("rib_left_11"),
    rigid("rib_left_12"),
    rigid("rib_right_1"),
    rigid("rib_right_2"),
    rigid("rib_right_3"),
    rigid("rib_right_4"),
    rigid("rib_right_5"),
    rigid("rib_right_6"),
    rigid("rib_right_7"),
    rigid("rib_right_8"),
    rigid("rib_right_9"),
    rigid("rib_right_10"),
    rigid("rib_right_11"),
    rigid("rib_right_12"),
    rigid("sternum"),
    soft("costal_cartilages", "costal_cartilage", ""),
];

/// What other tools, and other tasks of TotalSegmentator, label besides.
pub static FURTHER: &[ClassTissue] = &[
    soft("tumor", "liver_carcinoma", TUMOR),
    soft("kidney_pelvis", "kidney_pelvis", ""),
    soft("uterus", "uterus", ""),
    soft("breast", "fat", BREAST),
    soft("salivary_gland", "salivary_gland", ""),
    soft("skeletal_muscle", "muscle", ""),
    soft("fat", "fat", FAT),
    soft("skin", "skin", ""),
    hollow("rectum", "bowel_wall", 1e-3, NYLUND, RECTUM),
    hollow("bile_duct", "bile_duct", 1e-3, DUCT_WALL, ""),
    vessel("hepatic_artery", "hepatic_artery", 1e-3, DUCT_WALL, ""),
    ClassTissue { class: "air", kind: Kind::Air, note: "" },
];
