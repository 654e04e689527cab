//! Names of the labels of TotalSegmentator's task `total`, version 2 (its class list, Apache-2.0):
//! label 1 is the spleen, label 117 the costal cartilages.

use crate::error::VolumeProblem;
use crate::error::unsupported;
use crate::label_map::LabelMap;
use crate::numbering::misfit;
use crate::report::{NamesFrom, Note, VolumeReport, WorldSpace};
use crate::summary::LabelSummary;

/// Names by label, less 1: `NAMES[0]` is that of label 1.
pub const NAMES: [&str; 117] = [
    "spleen",
    "kidney_right",
    "kidney_left",
    "gallbladder",
    "liver",
    "stomach",
    "pancreas",
    "adrenal_gland_right",
    "adrenal_gland_left",
    "lung_upper_lobe_left",
    "lung_lower_lobe_left",
    "lung_upper_lobe_right",
    "lung_middle_lobe_right",
    "lung_lower_lobe_right",
    "esophagus",
    "trachea",
    "thyroid_gland",
    "small_bowel",
    "duodenum",
    "colon",
    "urinary_bladder",
    "prostate",
    "kidney_cyst_left",
    "kidney_cyst_right",
    "sacrum",
    "vertebrae_S1",
    "vertebrae_L5",
    "vertebrae_L4",
    "vertebrae_L3",
    "vertebrae_L2",
    "vertebrae_L1",
    "vertebrae_T12",
    "vertebrae_T11",
    "vertebrae_T10",
    "vertebrae_T9",
    "vertebrae_T8",
    "vertebrae_T7",
    "vertebrae_T6",
    "vertebrae_T5",
    "vertebrae_T4",
    "vertebrae_T3",
    "vertebrae_T2",
    "vertebrae_T1",
    "vertebrae_C7",
    "vertebrae_C6",
    "vertebrae_C5",
    "vertebrae_C4",
    "vertebrae_C3",
    "vertebrae_C2",
    "vertebrae_C1",
    "heart",
    "aorta",
    "pulmonary_vein",
    "brachiocephalic_trunk",
    "subclavian_artery_right",
    "subclavian_artery_left",
    "common_carotid_artery_right",
    "common_carotid_artery_left",
    "brachiocephalic_vein_left",
    "brachiocephalic_vein_right",
    "atrial_appendage_left",
    "superior_vena_cava",
    "inferior_vena_cava",
    "portal_vein_and_splenic_vein",
    "iliac_artery_left",
    "iliac_artery_right",
    "iliac_vena_left",
    "iliac_vena_right",
    "humerus_left",
    "humerus_right",
    "scapula_left",
    "scapula_right",
    "clavicula_left",
    "clavicula_right",
    "femur_left",
    "femur_right",
    "hip_left",
    "hip_right",
    "spinal_cord",
    "gluteus_maximus_left",
    "gluteus_maximus_right",
    "gluteus_medius_left",
    "gluteus_medius_right",
    "gluteus_minimus_left",
    "gluteus_minimus_right",
    "autochthon_left",
    "autochthon_right",
    "iliopsoas_left",
    "iliopsoas_right",
    "brain",
    "skull",
    "rib_left_1",
    "rib_left_2",
    "rib_left_3",
    "rib_left_4",
    "rib_left_5",
    "rib_left_6",
    "rib_left_7",
    "rib_left_8",
    "rib_left_9",
    "rib_left_10",
    "rib_left_11",
    "rib_left_12",
    "rib_right_1",
    "rib_right_2",
    "rib_right_3",
    "rib_right_4",
    "rib_right_5",
    "rib_right_6",
    "rib_right_7",
    "rib_right_8",
    "rib_right_9",
    "rib_right_10",
    "rib_right_11",
    "rib_right_12",
    "sternum",
    "costal_cartilages",
];

/// The name of a label; `None` for background and for labels above 117.
pub fn name(label: u16) -> Option<&'static str> {
    NAMES.get(usize::from(label).checked_sub(1)?).copied()
}

/// Gives a label map TotalSegmentator's names where its labels have the sizes and sides of TotalSegmentator's organs, and else
/// says in the report why not. `labels` are those of [`summarize`](crate::summarize). True where it has names then.
pub fn name_likely_labels(
    map: &mut LabelMap,
    report: &mut VolumeReport,
    labels: &[LabelSummary],
) -> bool {
    let has_sides = report.space != WorldSpace::Unnamed;
    let misfit = misfit(labels, has_sides);
    let reason = misfit.or_else(|| name_labels(map, report).err().map(|error| error.to_string()));
    let is_named = reason.is_none();
    report.notes.extend(reason.map(|reason| Note::OtherNumbers { reason }));
    is_named
}

/// Gives a label map TotalSegmentator's names, and says so in its report. The reader does not do so by
/// itself: label 5 of another program may be any organ.
///
/// # Errors
/// A voxel has a label above 117, which the task `total` does not give; nothing is changed then.
pub fn name_labels(map: &mut LabelMap, report: &mut VolumeReport) -> Result<(), VolumeProblem> {
    let highest = map.labels().iter().copied().max().unwrap_or(0);
    if usize::from(highest) > NAMES.len() {
        let found = format!("label {highest} in a label map of TotalSegmentator (1 to 117)");
        let advice = "leave the labels without names, or save the names with the file";
        return Err(unsupported(found, advice));
    }
    map.set_names((1..).zip(NAMES.map(str::to_owned)).collect());
    report.names_from = NamesFrom::TotalSegmentator;
    Ok(())
}
