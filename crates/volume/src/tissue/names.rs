//! A class by the names that people give: "Left Kidney", "kidney-l", "Liver_Segment_4", "gall bladder".
//!
//! A name is cut into words, and its words into a side, a set of words, and words that say nothing. Two names
//! mean the same class if their sets are equal; sides then choose among left and right.

use super::ClassTissue;
use super::classes::{CLASSES, FURTHER};

#[derive(Clone, Copy, Debug, PartialEq)]
enum Side {
    Left,
    Right,
}

/// A name without its case, marks, side and order.
#[derive(Clone, Debug, PartialEq)]
struct Words {
    words: Vec<String>,
    side: Option<Side>,
}

/// Longer names than any organ has are not looked at.
const LONGEST_NAME: usize = 100;

/// Spellings, plurals and short forms of one word.
const SPELLINGS: &[(&str, &str)] = &[
    ("adrenals", "adrenal"),
    ("arteries", "artery"),
    ("bladders", "bladder"),
    ("bones", "bone"),
    ("bowels", "bowel"),
    ("breasts", "breast"),
    ("cancer", "tumor"),
    ("carcinoma", "tumor"),
    ("cartilages", "cartilage"),
    ("clavicle", "clavicula"),
    ("clavicles", "clavicula"),
    ("cysts", "cyst"),
    ("femurs", "femur"),
    ("glands", "gland"),
    ("gluteal", "gluteus"),
    ("glnd", "gland"),
    ("glutes", "gluteus"),
    ("gut", "bowel"),
    ("hcc", "tumor"),
    ("hips", "hip"),
    ("intestine", "bowel"),
    ("intestines", "bowel"),
    ("ivc", "inferior vein cava"),
    ("kidneys", "kidney"),
    ("lesion", "tumor"),
    ("lesions", "tumor"),
    ("lungs", "lung"),
    ("metastases", "tumor"),
    ("metastasis", "tumor"),
    ("muscles", "muscle"),
    ("neoplasm", "tumor"),
    ("nodule", "tumor"),
    ("nodules", "tumor"),
    ("oesophagus", "esophagus"),
    ("postcava", "inferior vein cava"),
    ("renal", "kidney"),
    ("ribs", "rib"),
    ("scapulae", "scapula"),
    ("svc", "superior vein cava"),
    ("tumors", "tumor"),
    ("tumour", "tumor"),
    ("tumours", "tumor"),
    ("ureters", "ureter"),
    ("veins", "vein"),
    ("vena", "vein"),
    ("venous", "vein"),
    ("vertebra", "vertebrae"),
    ("vessels", "vessel"),
];

/// Words that say nothing where the rest is known.
const EMPTY_WORDS: &[&str] = &[
    "a",
    "and",
    "bone",
    "complete",
    "gland",
    "in",
    "label",
    "lobe",
    "mask",
    "muscle",
    "of",
    "organ",
    "part",
    "roi",
    "seg",
    "segment",
    "segmentation",
    "the",
    "tissue",
    "total",
    "wall",
    "whole",
];

/// Other names, and the class or the part of its name that both sides share.
const OTHER_NAMES: &[(&str, &str)] = &[
    ("abdominal aorta", "aorta"),
    ("adipose", "fat"),
    ("adrenal", "adrenal_gland"),
    ("airway", "trachea"),
    ("arota", "aorta"), // so in the data set AMOS
    ("arm bone", "humerus"),
    ("back muscle", "autochthon"),
    ("biliary duct", "bile_duct"),
    ("bladder", "urinary_bladder"),
    ("bone", "hip"),
    ("bowel", "small_bowel"),
    ("brachiocephalic artery", "brachiocephalic_trunk"),
    ("brain stem", "brain"),
    ("brainstem", "brain"),
    ("carotid", "common_carotid_artery"),
    ("carotid artery", "common_carotid_artery"),
    ("cartilage", "costal_cartilages"),
    ("collarbone", "clavicula"),
    ("common bile duct", "bile_duct"),
    ("common iliac artery", "iliac_artery"),
    ("common iliac vein", "iliac_vena"),
    ("costal cartilage", "costal_cartilages"),
    ("cranium", "skull"),
    ("cyst", "kidney_cyst"),
    ("descending aorta", "aorta"),
    ("femur head", "femur"),
    ("erector spinae", "autochthon"),
    ("gall bladder", "gallbladder"),
    ("gas", "air"),
    ("gluteus", "gluteus_maximus"),
    ("heart atrium", "heart"),
    ("heart myocardium", "heart"),
    ("heart ventricle", "heart"),
    ("hepatic", "liver"),
    ("hepatic duct", "bile_duct"),
    ("hepatic vein", "portal_vein_and_splenic_vein"),
    ("hepatic vessel", "portal_vein_and_splenic_vein"),
    ("hip bone", "hip"),
    ("ileum", "small_bowel"),
    ("iliac vein", "iliac_vena"),
    ("ilium", "hip"),
    ("jejunum", "small_bowel"),
    ("large bowel", "colon"),
    ("kidney cortex", "kidney"),
    ("kidney medulla", "kidney"),
    ("liver vein", "portal_vein_and_splenic_vein"),
    ("liver vessel", "portal_vein_and_splenic_vein"),
    ("lung", "lung_upper_lobe"),
    ("lower lobe", "lung_lower_lobe"),
    ("mandible", "skull"),
    ("middle lobe", "lung_middle_lobe"),
    ("muscle", "skeletal_muscle"),
    ("myocardium", "heart"),
    ("parotid", "salivary_gland"),
    ("pelvis", "hip"),
    ("portal vein", "portal_vein_and_splenic_vein"),
    ("prostate uterus", "prostate"), // so in AMOS
    ("psoas", "iliopsoas"),
    ("psoas major", "iliopsoas"),
    ("pulmonary artery", "pulmonary_vein"),
    ("rib", "rib_1"),
    ("rib cartilage", "costal_cartilages"),
    ("shoulder blade", "scapula"),
    ("sigmoid", "colon"),
    ("sigmoid colon", "colon"),
    ("spine", "vertebrae_L3"),
    ("splenic vein", "portal_vein_and_splenic_vein"),
    ("subclavian", "subclavian_artery"),
    ("subcutaneous", "fat"),
    ("subcutaneous fat", "fat"),
    ("submandibular", "salivary_gland"),
    ("suprarenal", "adrenal_gland"),
    ("thigh bone", "femur"),
    ("thoracic aorta", "aorta"),
    ("thyroid", "thyroid_gland"),
    ("torso fat", "fat"),
    ("upper lobe", "lung_upper_lobe"),
    ("vein cava", "inferior_vena_cava"),
    ("vertebrae", "vertebrae_L3"),
    ("visceral fat", "fat"),
    ("windpipe", "trachea"),
];

/// The tissue of a structure, by TotalSegmentator's name or one that people and other tools use: in any
/// case, with spaces, hyphens or underscores, with the side in any place, as a word or a letter. A name
/// that fits several classes (`lung`, `rib`) gets the first of them; a tumour of any organ is a `tumor`.
/// `None` for what is not known.
pub fn tissue_of(name: &str) -> Option<&'static ClassTissue> {
    if name.len() > LONGEST_NAME {
        return None;
    }
    let mut asked = Words::of(name);
    if asked.has("tumor") {
        return class(&Words::of("tumor"), Words::clone);
    }
    if asked.has("cyst") && asked.has("kidney") {
        asked.words.retain(|word| word == "cyst" || word == "kidney");
    }
    let bare = |words: &Words| words.without(|word| EMPTY_WORDS.contains(&word));
    let with_bare_names = |asked: &Words| class(&bare(asked), bare);
    class(&asked, Words::clone)
        .or_else(|| with_bare_names(&asked))
        .or_else(|| with_bare_names(&asked.without(is_number)))
}

/// A number, or the level of a vertebra.
fn is_number(word: &str) -> bool {
    let digits = word.strip_prefix(['c', 't', 'l', 's']).unwrap_or(word);
    digits.chars().all(|c| c.is_ascii_digit())
}

/// The class that these words name, by its own name or by another, all of them seen in one way.
fn class(asked: &Words, seen: impl Fn(&Words) -> Words) -> Option<&'static ClassTissue> {
    if asked.words.is_empty() {
        return None;
    }
    let words = |name: &str| seen(&Words::of(name));
    // On their side; on any where they have none, or where the class has none.
    let on_side = |asked: &Words| {
        let all = || CLASSES.iter().chain(FURTHER);
        let same = |tissue: &&ClassTissue| words(tissue.class).words == asked.words;
        let same_side = |tissue: &&ClassTissue| words(tissue.class).side == asked.side;
        all().filter(same).find(same_side).or_else(|| all().find(same))
    };
    let other = || {
        let is_other = |(name, _): &&(&str, &str)| words(name).words == asked.words;
        let (_, class) = OTHER_NAMES.iter().find(is_other)?;
        let Words { words, side } = words(class);
        on_side(&Words { words, side: side.or(asked.side) })
    };
    on_side(asked).or_else(other)
}

impl Words {
    fn of(name: &str) -> Words {
        let mut words = Vec::new();
        let mut side = None;
        for word in split(name) {
            match word.as_str() {
                "l" | "left" | "lt" | "sin" | "sinistra" | "sinister" => side = Some(Side::Left),
                "r" | "right" | "rt" | "dex" | "dextra" | "dexter" => side = Some(Side::Right),
                _ => {
                    let spelling = SPELLINGS.iter().find(|(other, _)| *other == word);
                    let word = spelling.map_or(word.as_str(), |(_, word)| word);
                    words.extend(word.split(' ').map(str::to_owned));
                }
            }
        }
        words.sort();
        words.dedup();
        Words { words, side }
    }

    fn without(&self, is_left_out: impl Fn(&str) -> bool) -> Words {
        let words = self.words.iter().filter(|word| !is_left_out(word)).cloned().collect();
        Words { words, side: self.side }
    }

    fn has(&self, word: &str) -> bool {
        self.words.iter().any(|own| own == word)
    }
}

/// Words in small letters, cut at marks, where a capital follows a small letter, and where a number follows a
/// word; the level of a vertebra, `l5`, is one word.
fn split(name: &str) -> Vec<String> {
    let mut spaced = String::new();
    let mut before = [' '; 2];
    for c in name.chars() {
        let ends_word = before.iter().all(|c| c.is_lowercase()) && c.is_numeric();
        if ends_word || before[1].is_lowercase() && c.is_uppercase() {
            spaced.push(' ');
        }
        spaced.push(if c.is_alphanumeric() { c } else { ' ' });
        before = [before[1], c];
    }
    spaced.to_lowercase().split_whitespace().map(str::to_owned).collect()
}
