//! Colours of bodies: organs look as surgeons know them, others take turns.

use std::ops::Range;
use viscera::simulation::Assembly;

use crate::color::Color;

/// A part of a name, and what is called so; the first that fits counts.
const KNOWN: [(&str, [u8; 3]); 33] = [
    ("tumor", [238, 226, 196]),
    ("lesion", [238, 226, 196]),
    ("gallbladder", [104, 142, 78]),
    ("bladder", [222, 190, 112]),
    ("liver", [146, 66, 50]),
    ("spleen", [116, 56, 92]),
    ("kidney", [166, 60, 54]),
    ("adrenal", [226, 170, 72]),
    ("stomach", [222, 152, 140]),
    ("pancreas", [230, 184, 128]),
    ("duodenum", [212, 158, 112]),
    ("bowel", [220, 168, 132]),
    ("colon", [204, 148, 120]),
    ("intestine", [220, 168, 132]),
    ("esophagus", [204, 132, 112]),
    ("heart", [172, 46, 46]),
    ("atri", [172, 46, 46]),
    ("lung", [224, 172, 178]),
    ("trachea", [200, 208, 206]),
    ("aorta", [194, 44, 38]),
    ("arter", [194, 44, 38]),
    ("vein", [74, 96, 158]),
    ("vena", [74, 96, 158]),
    ("brain", [208, 172, 166]),
    ("cartilage", [206, 220, 218]),
    ("vertebra", [228, 218, 192]),
    ("bone", [228, 218, 192]),
    ("rib", [228, 218, 192]),
    ("fat", [238, 216, 142]),
    ("skin", [226, 186, 162]),
    ("tongue", [206, 108, 106]),
    ("gluteus", [162, 76, 66]),
    ("muscle", [162, 76, 66]),
];

/// For bodies of other names, one after the other.
const OTHERS: [[u8; 3]; 6] = [
    [190, 96, 72],
    [96, 130, 150],
    [206, 164, 96],
    [122, 142, 96],
    [150, 104, 140],
    [204, 136, 126],
];

/// A body in a picture without a scale of colours.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyColor {
    /// Its name.
    pub name: String,
    /// Its colour where colours tell bodies apart.
    pub color: Color,
    /// Its colour as the eye sees it.
    pub tissue: Color,
    /// Its triangles, among those of all surfaces one body after the other.
    pub triangles: Range<usize>,
}

impl BodyColor {
    /// All bodies of a scene.
    pub fn of(assembly: &Assembly) -> Vec<Self> {
        let mut first = 0;
        let bodies = assembly.bodies.iter().enumerate().map(|(number, body)| {
            let triangles = first..first + body.surface.triangles.len();
            first = triangles.end;
            Self {
                name: body.name.clone(),
                color: body_color(&body.name, number),
                tissue: known_color(&body.name).unwrap_or(Color::TISSUE),
                triangles,
            }
        });
        bodies.collect()
    }
}

/// The colour of a body, the `number`-th of its scene.
pub fn body_color(name: &str, number: usize) -> Color {
    known_color(name).unwrap_or_else(|| Color::from_srgb(OTHERS[number % OTHERS.len()]))
}

/// The colour of an organ that its name tells.
fn known_color(name: &str) -> Option<Color> {
    let name = name.to_lowercase();
    let known = KNOWN.iter().find(|(part, _)| name.contains(part));
    known.map(|(_, color)| Color::from_srgb(*color))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_are_parts_of_others_have_their_own_colours() {
        assert_ne!(body_color("gallbladder", 0), body_color("urinary_bladder", 0));
        assert_eq!(body_color("kidney_left", 0), body_color("Kidney_Right", 5));
        assert_eq!(body_color("liver_tumor", 0), body_color("tumor", 1));
        assert_ne!(body_color("block", 0), body_color("block", 1));
    }
}
