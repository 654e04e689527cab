//! The tables of hands in a scene file, and what they do to the scene's tools.

use super::SceneError;
use super::build_instrument::check_angle;
use super::checks::check_times;
use super::hand::Hand;
use super::instrument::Instrument;
use super::instrument_tables::JawKeyTable;
use super::keys::{JawKey, MotionKey};
use crate::scalar::Vec3;
use crate::settings::{
    Place, Placed, at_least, optional, placed, quantity, settings_table, suggest, tables, text,
    vector,
};
use crate::units::Dimension;

settings_table! {
    /// A hand that takes a tool: from then on the tool's own keys, path, jaws and locks no longer count. Programs write it
    /// of what was done by hand.
    pub(super) struct HandTable {
        /// The tool.
        tool: Placed<String> = required, placed(text());
        /// When it takes the tool, which stops there.
        from: f64 = required, quantity(Dimension::Time, at_least(0.0));
        /// Poses in the order of their times, the first where the tool is then. Between them it moves at constant speed,
        /// after the last it stays.
        keys: Vec<Placed<HandKeyTable>> = (Vec::new()), tables::<HandKeyTable>();
        /// Opening angles of its jaws in the order of their times, the first as they are then. Until the first they stay
        /// as they were.
        jaw: Vec<Placed<JawKeyTable>> = (Vec::new()), tables::<JawKeyTable>();
        /// Times at which its jaws are locked.
        lock: Vec<Placed<HandLockTable>> = (Vec::new()), tables::<HandLockTable>();
        /// When the tool is put away: what it held is free. It stays where unset.
        end: Option<f64> = None, optional(quantity(Dimension::Time, at_least(0.0)));
    }
}

settings_table! {
    /// A pose of a tool at a time, relative to its own. Turned first, then moved, in axes of the world.
    pub(super) struct HandKeyTable {
        /// When.
        time: f64 = required, quantity(Dimension::Time, at_least(0.0));
        /// Displacement from its own position.
        translation: Vec3<f64> = (Vec3::ZERO), vector(Dimension::Length);
        /// Axis of the rotation times its angle. Between keys the tool turns about one axis, by half a turn at most.
        rotation_vector: Vec3<f64> = (Vec3::ZERO), vector(Dimension::Angle);
    }
}

settings_table! {
    /// A time at which jaws in a hand are locked.
    pub(super) struct HandLockTable {
        /// Its begin.
        from: f64 = required, quantity(Dimension::Time, at_least(0.0));
        /// Its end; nothing unlocks them where unset.
        to: Option<f64> = None, optional(quantity(Dimension::Time, at_least(0.0)));
    }
}

/// Gives tools to the hands that take them.
pub(super) fn hand_over(
    tools: &mut [Instrument],
    tables: &[Placed<HandTable>],
) -> Result<(), SceneError> {
    for Placed { place, value } in tables {
        let wanted = &value.tool.value;
        let Some(number) = tools.iter().position(|tool| tool.name == *wanted) else {
            let names: Vec<_> = tools.iter().map(|tool| tool.name.as_str()).collect();
            return Err(SceneError::UnknownTool {
                place: value.tool.place.clone(),
                tool: crate::units::shorten(wanted),
                hint: suggest(wanted, &names),
            });
        };
        let hand = build_hand(value, &tools[number], place)?;
        tools[number].hands.push(hand);
    }
    Ok(())
}

fn build_hand(table: &HandTable, tool: &Instrument, place: &Place) -> Result<Hand, SceneError> {
    let purpose = format!("hand on tool `{}`", tool.name);
    let fail = |place: &Place, problem: String| SceneError::Keys {
        place: place.clone(),
        purpose: purpose.clone(),
        problem,
    };
    let from = table.from;
    if let Some(last) = tool.hands.last().filter(|last| last.from > from) {
        let problem = format!(
            "it takes the tool at {from} s, before the hand above, which does so at {} s; put this one above it",
            last.from
        );
        return Err(fail(place, problem));
    }
    check_times(table.keys.iter().map(|key| (&key.place, key.value.time)), &purpose)?;
    check_times(table.jaw.iter().map(|key| (&key.place, key.value.time)), &purpose)?;
    let of_keys = table.keys.iter().map(|key| (&key.place, key.value.time));
    let of_jaws = table.jaw.iter().map(|key| (&key.place, key.value.time));
    let of_locks = table.lock.iter().map(|lock| (&lock.place, lock.value.from));
    let of_end = table.end.iter().map(|end| (place, *end));
    let mut times = of_keys.chain(of_jaws).chain(of_locks).chain(of_end);
    if let Some((place, time)) = times.find(|(_, time)| *time < from) {
        let problem = format!("{time} s is before it takes the tool at {from} s; move one of them");
        return Err(fail(place, problem));
    }
    let foreign = table.jaw.first().map(|key| (&key.place, "jaw"));
    let foreign = foreign.or(table.lock.first().map(|lock| (&lock.place, "lock")));
    match (&tool.jaws, foreign) {
        (None, Some((place, key))) => {
            return Err(fail(
                place,
                format!("`{key}` means nothing for a tool without jaws; leave it out"),
            ));
        }
        (Some(jaws), _) => {
            for Placed { place, value } in &table.jaw {
                check_angle(jaws, value.angle).map_err(|problem| fail(place, problem))?;
            }
        }
        (None, None) => {}
    }
    let mut locks = Vec::new();
    for Placed { place, value } in &table.lock {
        if let Some(to) = value.to.filter(|to| *to < value.from) {
            let problem = format!("its lock ends at {to} s, before it begins; swap the two");
            return Err(fail(place, problem));
        }
        locks.push([value.from, value.to.unwrap_or(f64::INFINITY)]);
    }
    let key = |key: &Placed<HandKeyTable>| MotionKey {
        time: key.value.time,
        translation: key.value.translation,
        rotation: key.value.rotation_vector,
    };
    let jaw = |key: &Placed<JawKeyTable>| JawKey { time: key.value.time, value: key.value.angle };
    Ok(Hand {
        from,
        keys: table.keys.iter().map(key).collect(),
        jaw: table.jaw.iter().map(jaw).collect(),
        locks,
        end: table.end,
    })
}
