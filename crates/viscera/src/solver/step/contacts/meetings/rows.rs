//! Meetings as they stand on a device, and what states and measures make of them.

use super::extents::{MEETING_VECTORS, skin_of};
use crate::contact::{Bond, Foundation, Kept, Pair};
use crate::layout::Layout;
use crate::scalar::{Vec3, vec3};

/// A row in the place of infinite strength, or of nothing.
const NONE: [f32; 4] = [0.0; 4];

/// Vectors of meetings of which this was kept.
pub fn rows(layout: &Layout<f32>, all: &[Kept]) -> Vec<[f32; 4]> {
    let Some(skin) = skin_of(layout) else { return Vec::new() };
    let mut rows = vec![NONE; MEETING_VECTORS * (skin.samples.len() + skin.ties.len())];
    let mut places = vec![0; skin.samples.len()];
    for (place, sample) in skin.samples.iter().enumerate() {
        places[sample.number as usize] = place;
    }
    for kept in all {
        // A state that the caller has changed may name what does not exist.
        let place = places.get(kept.sample as usize);
        let place = place.filter(|_| (kept.triangle as usize) < skin.parts.len());
        let Some(&place) = place else { continue };
        let row = &mut rows[MEETING_VECTORS * place..];
        row[4] = [kept.slip[0], kept.slip[1], kept.pressed, kept.energy].map(|x| x as f32);
        row[6][2] = (kept.triangle + 1) as f32;
    }
    rows
}

/// Of ties, one vector each.
pub fn torn_rows(layout: &Layout<f32>, torn: &[bool]) -> Vec<[f32; 4]> {
    let Some(skin) = skin_of(layout) else { return Vec::new() };
    let is_torn = |number: u32| torn.get(number as usize).copied().unwrap_or(false);
    skin.ties.iter().map(|(_, number)| [f32::from(is_torn(*number)), 0.0, 0.0, 0.0]).collect()
}

/// Which ties are torn, of their vectors.
pub fn torn(layout: &Layout<f32>, rows: &[[f32; 4]], torn: &mut Vec<bool>) {
    let ties = skin_of(layout).map_or(&[][..], |skin| &skin.ties);
    torn.clear();
    torn.resize(ties.len(), false);
    for ((_, number), row) in ties.iter().zip(rows) {
        torn[*number as usize] = row[0] != 0.0;
    }
}

/// What is kept of the last step, of the vectors that it has left: in the order of samples' places.
pub fn kept(layout: &Layout<f32>, rows: &[[f32; 4]]) -> Vec<Kept> {
    let samples = skin_of(layout).map_or(&[][..], |skin| &skin.samples);
    let all = samples.iter().zip(rows.chunks_exact(MEETING_VECTORS));
    let kept = all.filter(|(_, row)| row[6][2] > 0.0).map(|(sample, row)| {
        let [a, b, pressed, energy] = row[4].map(f64::from);
        Kept {
            sample: sample.number,
            triangle: row[6][2] as u32 - 1,
            slip: [a, b],
            pressed,
            energy,
        }
    });
    kept.collect()
}

fn place(row: [f32; 4]) -> Vec3<f64> {
    vec3(row[0], row[1], row[2]).cast()
}

/// The pairs of the last step, of the vectors that it has left: contact, then ties.
pub fn pairs(layout: &Layout<f32>, rows: &[[f32; 4]]) -> Vec<Pair> {
    let Some(skin) = skin_of(layout) else { return Vec::new() };
    let law = &skin.contact.law;
    let pair = |(meeting, row): (usize, &[[f32; 4]])| {
        let triangle = (row[0][3] as u32).checked_sub(1)?;
        let stiffness = f64::from(row[2][3]);
        let tie = meeting.checked_sub(skin.samples.len()).map(|tie| skin.ties[tie]);
        let bond = match tie {
            Some((_, number)) => Bond::Tie { number, stiffness, rest: place(row[3]) },
            None => Bond::Contact {
                // Only the product counts.
                foundation: Foundation { area: 1.0, stiffness, thickness: law.thickness },
                shift: row[1][3].into(),
                friction: (row[3][3] > 0.0).then(|| (stiffness, row[3][3].into())),
                coefficient: law.friction,
            },
        };
        Some(Pair {
            sample: tie.map_or(meeting as u32, |(place, _)| place),
            triangle,
            weights: [row[1][0], row[1][1], row[1][2]].map(f64::from),
            normal: place(row[2]),
            offset: if tie.is_some() { Vec3::ZERO } else { place(row[3]) },
            bond,
        })
    };
    rows.chunks_exact(MEETING_VECTORS).enumerate().filter_map(pair).collect()
}
