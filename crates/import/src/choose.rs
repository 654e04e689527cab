//! Which labels of a scan become bodies.

use std::collections::BTreeMap;

use viscera_volume::{LabelMap, summarize};

use crate::ImportError;
use crate::bodies::Options;
use crate::name::name_of;
use crate::tissue::{Kind, kind_of};
use crate::unit::millilitres;

/// A label that is enclosed by another to this share of its faces is a part of it: a tumour in a liver.
const ENCLOSED: f64 = 0.8;

/// Smaller ones have no shape that a scan could show, and are taken where asked for.
pub const FEWEST_VOXELS: u64 = 64;

/// A body in the making.
pub struct Chosen {
    pub label: u16,
    pub name: String,
    /// Labels in it that are regions of their own, the largest first.
    pub inner: Vec<(u16, String)>,
    /// Labels in it that are filled with the same.
    pub filled: Vec<u16>,
}

/// Bodies, and what to say of the choice.
pub struct Choice {
    pub organs: Vec<Chosen>,
    pub warnings: Vec<String>,
    pub notes: Vec<String>,
}

/// A label that voxels have.
struct Label {
    label: u16,
    name: String,
    voxels: u64,
    /// [m^3]
    volume: f64,
    kind: Kind,
}

/// Chooses the labels that are asked for, or all soft ones.
pub fn choose(file: &str, map: &LabelMap, options: &Options) -> Result<Choice, ImportError> {
    let all: Vec<Label> = summarize(map)
        .into_iter()
        .map(|label| {
            let name = label.name.unwrap_or_else(|| format!("label_{}", label.label));
            let (volume, kind) = (1e-6 * label.milliliters, kind_of(&name));
            Label { label: label.label, name, voxels: label.voxels, volume, kind }
        })
        .collect();
    let names = all.iter().map(|label| (label.label, label.name.as_str()));
    let (mut warnings, mut notes) = (same_names(names), Vec::new());
    let chosen = match options.labels.is_empty() {
        true => soft(file, &all, &mut notes)?,
        false => wanted(file, &all, options)?,
    };
    let parents = parents(map, &all);
    let host = |label: u16| {
        let is_chosen = |label: &u16| chosen.contains(label);
        above(label, &parents).into_iter().rfind(is_chosen)
    };
    let of = |label: u16| all.iter().find(|known| known.label == label);
    let mut organs = Vec::new();
    for label in chosen.iter().filter(|label| host(**label).is_none()).filter_map(|l| of(*l)) {
        let mut inside: Vec<&Label> =
            all.iter().filter(|other| host(other.label) == Some(label.label)).collect();
        inside.sort_by_key(|other| (std::cmp::Reverse(other.voxels), other.label));
        let (inner, others): (Vec<&Label>, Vec<&Label>) =
            inside.into_iter().partition(|other| chosen.contains(&other.label));
        let (holes, filled): (Vec<&Label>, Vec<&Label>) =
            others.into_iter().partition(|other| other.kind == Kind::Bone);
        warnings.extend(filled.iter().map(|other| told_filled(label, other, &chosen)));
        warnings.extend(holes.iter().map(|hole| {
            format!("`{}` lies in `{}`, and is left out as a hole", hole.name, label.name)
        }));
        organs.push(Chosen {
            label: label.label,
            name: label.name.clone(),
            inner: inner.iter().map(|other| (other.label, other.name.clone())).collect(),
            filled: filled.iter().map(|other| other.label).collect(),
        });
    }
    if options.labels.is_empty() {
        let is_left = |label: &&Label| {
            let is_in_another = organs.iter().any(|organ| organ.filled.contains(&label.label));
            !chosen.contains(&label.label) && !is_in_another && label.kind == Kind::Unknown
        };
        warnings.extend(told_unknown(&chosen, all.iter().filter(is_left).collect()));
    }
    Ok(Choice { organs, warnings, notes })
}

/// Labels with their names, as people look for them.
fn list(all: &[Label]) -> String {
    let text = |label: &Label| match label.name.contains(',') {
        // `--labels` would take it for two: its number does, or its name as a body.
        true => format!("{} {} (\"{}\")", label.label, name_of(&label.name), label.name),
        false => format!("{} {}", label.label, label.name),
    };
    let names: Vec<String> = all.iter().map(text).collect();
    names.join(", ")
}

/// Numbers as `--labels` takes them.
fn numbers<'a>(labels: impl IntoIterator<Item = &'a u16>) -> String {
    let labels: Vec<String> = labels.into_iter().map(u16::to_string).collect();
    labels.join(",")
}

/// What to know of names that several labels have, a line each.
pub fn same_names<'a>(names: impl IntoIterator<Item = (u16, &'a str)>) -> Vec<String> {
    let mut by_name: BTreeMap<String, Vec<u16>> = BTreeMap::new();
    for (label, name) in names {
        by_name.entry(name_of(name)).or_default().push(label);
    }
    by_name.retain(|_, labels| labels.len() > 1);
    let told = |(name, labels): (&String, &Vec<u16>)| {
        format!(
            "labels {} have the same name, `{name}`, which chooses all of them; choose by number, or give one another name by --names {}={name}_2",
            numbers(labels),
            labels[1]
        )
    };
    by_name.iter().map(told).collect()
}

/// All soft organs; of labels of which nothing is known all.
fn soft(file: &str, all: &[Label], notes: &mut Vec<String>) -> Result<Vec<u16>, ImportError> {
    let is_shape = |label: &&Label| label.voxels >= FEWEST_VOXELS;
    let organs: Vec<u16> =
        all.iter().filter(is_shape).filter(|l| l.kind.is_organ()).map(|l| l.label).collect();
    let unknown: Vec<u16> =
        all.iter().filter(|l| l.kind == Kind::Unknown).map(|l| l.label).collect();
    let chosen = if organs.is_empty() { unknown } else { organs };
    if chosen.is_empty() {
        return Err(ImportError::NoTissue { file: file.into(), labels: list(all) });
    }
    let left: Vec<&str> = all
        .iter()
        .filter(|label| !chosen.contains(&label.label) && label.kind != Kind::Unknown)
        .map(|label| label.name.as_str())
        .collect();
    if !left.is_empty() {
        notes.push(format!("left out, choose by --labels: {}", left.join(", ")));
    }
    Ok(chosen)
}

/// Those that are asked for.
fn wanted(file: &str, all: &[Label], options: &Options) -> Result<Vec<u16>, ImportError> {
    let mut chosen = Vec::new();
    for wanted in &options.labels {
        let by_number = all.iter().filter(|label| wanted.parse() == Ok(label.label));
        let by_name = all.iter().filter(|label| name_of(&label.name) == name_of(wanted));
        let mut found: Vec<&Label> = by_number.collect();
        if found.is_empty() {
            found = by_name.collect();
        }
        if found.is_empty() {
            let (file, wanted) = (file.to_owned(), wanted.clone());
            let hint = format!("labels are {}", list(all));
            return Err(ImportError::UnknownLabel { file, wanted, hint });
        }
        for label in found {
            refuse_bone(file, label, options)?;
            if !chosen.contains(&label.label) {
                chosen.push(label.label);
            }
        }
    }
    Ok(chosen)
}

/// Refuses what has no material of soft tissue, unless only its shape is asked for.
fn refuse_bone(file: &str, label: &Label, options: &Options) -> Result<(), ImportError> {
    let what = match label.kind {
        Kind::Bone => "is bone, a million times stiffer than an organ, and no body of soft tissue",
        Kind::Air => "is a gas, and no tissue",
        _ => return Ok(()),
    };
    if options.shapes_only {
        return Ok(());
    }
    let (number, name) = (label.label, name_of(&label.name));
    let rename = format!("if it is none, say what it is: --names {number}=muscle");
    let advice = match label.kind {
        Kind::Bone => format!(
            "leave it out of --labels and hold what hangs on it by a [[fixing]]; or make an obstacle of it, by `viscera mesh \
             tetrahedralize {file} --labels {number} --out {name}.vtu`, `viscera mesh convert {name}.vtu {name}.stl` and a [[tool]] with \
             kind = \"mesh\", mesh = \"{name}.stl\", unit = \"1 m\"; {rename}"
        ),
        _ => format!("leave it out of --labels; {rename}"),
    };
    let (file, name) = (file.to_owned(), label.name.clone());
    Err(ImportError::NoSoftTissue { file, name, what, advice })
}

/// That a label in an organ has the organ's tissue, and how it gets its own.
fn told_filled(organ: &Label, label: &Label, chosen: &[u16]) -> String {
    let size = millilitres(label.volume);
    format!(
        "`{}` (label {}, {size} ml) lies in `{}` and is filled with the same tissue; --labels {} makes it a region of its own",
        label.name,
        label.label,
        organ.name,
        numbers(chosen.iter().chain([&label.label]))
    )
}

/// That labels are left out because nothing is known of their names, and how to take them.
fn told_unknown(chosen: &[u16], unknown: Vec<&Label>) -> Option<String> {
    let first = unknown.first()?;
    let text = |label: &&Label| {
        format!("`{}` (label {}, {} ml)", label.name, label.label, millilitres(label.volume))
    };
    let texts: Vec<String> = unknown.iter().map(text).collect();
    Some(format!(
        "left out, since nothing is known of the name: {}; --labels {} takes them too, --names {}=liver says what one is",
        texts.join(", "),
        numbers(chosen.iter().chain(unknown.iter().map(|label| &label.label))),
        first.label
    ))
}

/// The label that encloses a label, by label.
fn parents(map: &LabelMap, all: &[Label]) -> BTreeMap<u16, u16> {
    let dims = map.dims();
    let steps = [1, dims[0], dims[0] * dims[1]];
    let labels = map.labels();
    let mut faces: BTreeMap<(u16, u16), usize> = BTreeMap::new();
    for place in 0..labels.len() {
        let own = labels[place];
        if own == 0 {
            continue;
        }
        for axis in 0..3 {
            let index = place / steps[axis] % dims[axis];
            let before = (index > 0).then(|| labels[place - steps[axis]]);
            let behind = (index + 1 < dims[axis]).then(|| labels[place + steps[axis]]);
            for other in [before, behind] {
                // Beyond the image there is nothing.
                let other = other.unwrap_or(0);
                if other != own {
                    *faces.entry((own, other)).or_default() += 1;
                }
            }
        }
    }
    let mut parents = BTreeMap::new();
    for label in all.iter().map(|label| label.label) {
        let of_label = faces.range((label, 0)..=(label, u16::MAX));
        let count: usize = of_label.clone().map(|(_, count)| count).sum();
        let most = of_label.filter(|((_, other), _)| *other != 0).max_by_key(|(_, count)| **count);
        if let Some((&(_, host), &most)) = most
            && most as f64 >= ENCLOSED * count as f64
        {
            parents.insert(label, host);
        }
    }
    // Of two that touch little else the smaller lies in the larger.
    let voxels = |label: u16| all.iter().find(|l| l.label == label).map_or(0, |l| l.voxels);
    let is_mutual = |(label, host): &(u16, u16)| parents.get(host) == Some(label);
    let pairs: Vec<(u16, u16)> = parents.iter().map(|(a, b)| (*a, *b)).filter(is_mutual).collect();
    for (label, host) in pairs {
        if (voxels(label), label) > (voxels(host), host) {
            parents.remove(&label);
        }
    }
    parents
}

/// Labels that enclose a label, from the inside out.
fn above(label: u16, parents: &BTreeMap<u16, u16>) -> Vec<u16> {
    let mut above = Vec::new();
    let mut at = label;
    while let Some(&host) = parents.get(&at) {
        // Rings of labels that enclose each other do not occur, but files may say anything.
        if above.contains(&host) || host == label {
            break;
        }
        above.push(host);
        at = host;
    }
    above
}
