//! Tools that springs hold move before a step, against tissue as the last one has left it.

use crate::contact::held::Pressing;
use crate::contact::held::carry;
use crate::contact::{HeldMotion, Tool, Touch};
use crate::layout::{LaidSample, Layout};
use crate::scalar::Real;
use crate::state::ContactState;

/// Moves every body that a spring holds, and puts its parts where it is.
pub(super) fn lead<S: Real>(
    layout: &Layout<S>,
    contact: &mut ContactState,
    tools: &mut [Tool],
    dt: f64,
) {
    if tools.iter().all(|tool| tool.held.is_none()) {
        contact.held.clear();
        return;
    }
    let mut motions = std::mem::take(&mut contact.held);
    motions.resize(tools.len(), HeldMotion::default());
    let mut first = 0;
    while first < tools.len() {
        let Some(held) = tools[first].held else {
            first += 1;
            continue;
        };
        let is_part = |tool: &&Tool| tool.held.is_some_and(|other| other.body == held.body);
        let count = tools[first..].iter().take_while(is_part).count();
        let parts = &mut tools[first..first + count];
        let motion = &mut motions[first];
        let is_known = contact.poses.len() >= first + count;
        let before = motion.poses.filter(|_| is_known).map(|[_, hand]| hand);
        let has_jumped = before.is_none_or(|before| {
            let way = (held.hand.translation - before.translation).length();
            parts.iter().any(|part| part.jumps(way, dt))
        });
        if has_jumped {
            motion.put(&held.hand);
        } else if let Some([pose, _]) = motion.poses {
            let kept = &*contact;
            motion.step(&held.spring, &held.hand, dt, |act| {
                let pressed = kept.touches.iter().filter_map(|touch| {
                    let part = (touch.tool as usize).checked_sub(first)?;
                    let tool = parts.get(part)?;
                    let sample = sample_of(layout, touch)?;
                    let at = (&kept.poses[first + part], pose.translation);
                    let of_tissue = sample.area * sample.stiffness;
                    let foundation = sample.foundation(&tool.law);
                    Some(Pressing::new(tool, at, (foundation, of_tissue), touch))
                });
                for pressing in pressed {
                    act(&pressing);
                }
            });
            if let Some([pose, _]) = motion.poses {
                carry(parts, &pose);
            }
        }
        first += count;
    }
    contact.held = motions;
}

/// The sample that was touched.
fn sample_of<'a, S: Real>(layout: &'a Layout<S>, touch: &Touch) -> Option<&'a LaidSample> {
    let part = layout.part_of_sample(touch.sample);
    let of_part = &layout.samples[layout.samples_of(part)];
    let place = of_part.binary_search_by_key(&touch.sample, |sample| sample.number).ok()?;
    of_part.get(place)
}
