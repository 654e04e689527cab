//! Presets and classes as a document.

use std::fmt::Write;

use viscera::material::{PRESETS, Preset};
use viscera::units::{Dimension, format_number};

use super::classes::{CLASSES, FURTHER};
use super::{ClassTissue, Kind};

const HEAD: &str = "\
# Tissue: stiffness and density, with sources

Which material each organ of a segmented scan gets. The first table has the presets, which a scene names by
`material.preset` ([scene.md](scene.md)), the second the 117 classes of TotalSegmentator's task `total`, version 2, with the
tissue of each, the third what other tools label besides. `viscera_volume::tissue::tissue_of` finds a class by the names
that people give.

**How to read it.** E is Young's modulus at small strain, slowly pressed, typical of healthy adults; the range is that of the
source, mostly one standard deviation to both sides. A source or note that begins with *assumed* is no measurement of this
tissue: it names the nearest one and says why. Everything else is what the source says, or is computed from it as the
caution tells.

**Why one organ has many numbers.** Values differ by a factor of 2 to 10 with the method, the strain, the rate, the person,
age and health. Shear waves measure at 50 to 500 Hz, where tissue seems stiffer; they see a shear modulus mu, which
devices triple to E. Tissue stiffens as it is stretched: short of tearing, gut and bladder are seven to twenty times
stiffer than here. Much was measured on the dead or on animals. A preset is a starting point, not a patient; what was
measured on one can be fitted (`viscera.fit`).

**Nearly incompressible.** Tissue is mostly water and keeps its volume: its Poisson ratio is near 0.5, and sources assume so.
Most presets have 0.49, with which a body loses little volume under any load and still can be solved; 0.5 itself cannot.
Lungs let their air go.

**Densities** of the abdominal organs, of muscle, fat and skin are from PMC3233242, table 3, the others from ICRU Report 46, as
in PMC3859249, table 2, and PMC4201780, table 1.

**Hollow organs and vessels** are labelled with their contents. The table has the thickness of their walls; a solid body of
the wall's stiffness is far too stiff. **Bones**, with gigapascals a million times as stiff as organs, are rigid: obstacles,
or what tissue is fixed to.

This page is written by the program; a test compares it. To write it again:
`VISCERA_WRITE=1 cargo test -p viscera-volume --test all tissue`.
";

/// The document `docs/tissue.md`: every preset, every class.
pub fn describe_markdown() -> String {
    let mut text = HEAD.to_owned();
    text.push_str("\n## Presets\n\n");
    text.push_str("| preset | E | range | nu | density | source | caution |\n");
    text.push_str("|---|---|---|---|---|---|---|\n");
    PRESETS.iter().for_each(|preset| push_preset(&mut text, preset));
    text.push_str("\n## Classes of TotalSegmentator\n\n");
    push_classes(&mut text, &CLASSES);
    text.push_str("\n## Other structures\n\n");
    push_classes(&mut text, FURTHER);
    // Cautions and notes name presets as well: links last, over all.
    text.lines().map(|line| linked(line) + "\n").collect()
}

fn push_preset(text: &mut String, preset: &Preset) {
    let pressure = |value| Dimension::Pressure.format(value);
    let range = match preset.young_range {
        Some([low, high]) => format!("{} to {}", pressure(low), pressure(high)),
        None => "-".to_owned(),
    };
    push_row(
        text,
        &[
            &format!("`{}`", preset.name),
            &pressure(preset.young),
            &range,
            &format_number(preset.poisson),
            &Dimension::Density.format(preset.density),
            preset.source,
            preset.caution,
        ],
    );
}

/// A row for all classes with the same tissue and the same note, in the order of the first of them.
fn push_classes(text: &mut String, classes: &[ClassTissue]) {
    push_row(text, &["class", "kind", "preset", "wall", "source of the wall", "note"]);
    push_row(text, &["---"; 6]);
    for (index, first) in classes.iter().enumerate() {
        let same = |other: &ClassTissue| (other.kind, other.note) == (first.kind, first.note);
        if classes[..index].iter().any(same) {
            continue;
        }
        let all: Vec<_> = classes.iter().filter(|other| same(other)).collect();
        let names: Vec<_> = all.iter().map(|tissue| format!("`{}`", tissue.class)).collect();
        let (kind, preset, wall, source) = match first.kind {
            Kind::Soft(preset) => ("soft", preset, None, ""),
            Kind::Hollow { preset, wall, source } => ("hollow", preset, Some(wall), source),
            Kind::Vessel { preset, wall, source } => ("vessel", preset, Some(wall), source),
            Kind::Rigid => ("rigid", "", None, ""),
            Kind::Air => ("air", "", None, ""),
        };
        let preset = if preset.is_empty() { String::new() } else { format!("`{preset}`") };
        let wall = wall.map_or(String::new(), |wall| Dimension::Length.format(wall));
        push_row(text, &[&names.join(", "), kind, &preset, &wall, source, first.note]);
    }
}

fn push_row(text: &mut String, cells: &[&str]) {
    let cells: Vec<_> = cells.iter().map(|cell| cell.replace('|', "\\|")).collect();
    // Writing to a string cannot fail.
    let _ = writeln!(text, "| {} |", cells.join(" | "));
}

/// Links in the place of digital object identifiers, addresses, and numbers of PubMed.
fn linked(line: &str) -> String {
    let mut after_pmid = false;
    let link = |word: &str| {
        let bare = word.trim_matches(|c: char| "(),.;:".contains(c));
        let target = if let Some(number) = bare.strip_prefix("doi:") {
            format!("https://doi.org/{number}")
        } else if bare.starts_with("https://") {
            return word.replace(bare, &format!("<{bare}>"));
        } else if bare.starts_with("PMC") {
            format!("https://pmc.ncbi.nlm.nih.gov/articles/{bare}/")
        } else if std::mem::replace(&mut after_pmid, bare == "PMID") {
            format!("https://pubmed.ncbi.nlm.nih.gov/{bare}/")
        } else {
            return word.to_owned();
        };
        word.replace(bare, &format!("[{bare}]({target})"))
    };
    let words: Vec<_> = line.split(' ').map(link).collect();
    words.join(" ")
}
