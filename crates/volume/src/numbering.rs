//! Whether labels without names are numbered as by TotalSegmentator: its organs have sizes and sides.

use crate::summary::LabelSummary;
use crate::total_segmentator::name;

/// Millilitres of a structure, from a child's to an enlarged one.
const SIZES: [(&str, [f64; 2]); 29] = [
    ("spleen", [30.0, 1000.0]),
    ("kidney_right", [40.0, 500.0]),
    ("kidney_left", [40.0, 500.0]),
    ("gallbladder", [2.0, 250.0]),
    ("liver", [400.0, 4000.0]),
    ("stomach", [20.0, 1200.0]),
    ("pancreas", [10.0, 250.0]),
    ("adrenal_gland_right", [0.5, 25.0]),
    ("adrenal_gland_left", [0.5, 25.0]),
    ("lung_upper_lobe_left", [150.0, 2500.0]),
    ("lung_lower_lobe_left", [100.0, 2500.0]),
    ("lung_upper_lobe_right", [150.0, 2500.0]),
    ("lung_middle_lobe_right", [50.0, 1500.0]),
    ("lung_lower_lobe_right", [100.0, 2500.0]),
    ("esophagus", [5.0, 150.0]),
    ("trachea", [5.0, 200.0]),
    ("thyroid_gland", [2.0, 150.0]),
    ("small_bowel", [50.0, 3000.0]),
    ("duodenum", [10.0, 300.0]),
    ("colon", [80.0, 4000.0]),
    ("urinary_bladder", [5.0, 1500.0]),
    ("prostate", [5.0, 250.0]),
    ("kidney_cyst_left", [0.0, 500.0]),
    ("kidney_cyst_right", [0.0, 500.0]),
    ("heart", [150.0, 2000.0]),
    ("aorta", [20.0, 800.0]),
    ("inferior_vena_cava", [5.0, 300.0]),
    ("brain", [600.0, 2000.0]),
    ("skull", [200.0, 2000.0]),
];

/// Of the bones and muscles that have no line of their own.
const VERTEBRA: [f64; 2] = [3.0, 200.0];
const RIB: [f64; 2] = [1.0, 100.0];

/// What lies further to the patient's right, and what to the left.
const SIDES: [(&str, &str); 5] = [
    ("kidney_right", "kidney_left"),
    ("liver", "spleen"),
    ("adrenal_gland_right", "adrenal_gland_left"),
    ("lung_lower_lobe_right", "lung_lower_lobe_left"),
    ("autochthon_right", "autochthon_left"),
];

/// At least so many sizes and sides are to be right where labels count from 1, as those of every program do,
const ENOUGH: usize = 5;
/// and so many where they do not.
const FEW: usize = 2;
/// Of which so many are right: sick organs are odd.
const MOSTLY: f64 = 0.85;

fn size_of(name: &str) -> Option<[f64; 2]> {
    let listed = SIZES.iter().find(|(known, _)| *known == name).map(|(_, size)| *size);
    listed.or_else(|| match name {
        _ if name.starts_with("vertebrae_") => Some(VERTEBRA),
        _ if name.starts_with("rib_") => Some(RIB),
        _ => None,
    })
}

/// Why labels are probably not TotalSegmentator's; `has_sides` where the file says where the patient's right is.
pub(crate) fn misfit(labels: &[LabelSummary], has_sides: bool) -> Option<String> {
    let (mut right, mut wrong) = (0, Vec::new());
    let mut count = |is_right: bool, text: &dyn Fn() -> String| match is_right {
        true => right += 1,
        false => wrong.push(text()),
    };
    for label in labels {
        let Some(name) = name(label.label) else {
            return Some(format!("its labels end at 117, and here is {}", label.label));
        };
        let Some([low, high]) = size_of(name) else { continue };
        let size = label.milliliters;
        // What the image cuts may be as small as it likes.
        let is_small = size < low && label.touches_border.is_empty();
        let text = || format!("{} would be `{name}` of {size:.1} ml", label.label);
        count(!is_small && size <= high, &text);
    }
    let place = |wanted: &str| {
        let of = |label: &&LabelSummary| name(label.label) == Some(wanted);
        labels.iter().find(of).map(|label| label.world_bounds[0].x + label.world_bounds[1].x)
    };
    for (a, b) in SIDES.iter().filter(|_| has_sides) {
        if let (Some(at_a), Some(at_b)) = (place(a), place(b)) {
            count(at_a > at_b, &|| format!("`{a}` would lie to the left of `{b}`"));
        }
    }
    let counts_from_one = labels.iter().zip(1..).all(|(label, number)| label.label == number);
    let enough = if counts_from_one { ENOUGH } else { FEW };
    let all = right + wrong.len();
    if let Some(first) = wrong.first().filter(|_| (right as f64) < MOSTLY * all as f64) {
        return Some(first.clone());
    }
    (right < enough).then(|| "too few organs to tell by their sizes".to_owned())
}
