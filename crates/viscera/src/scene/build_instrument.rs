//! From the tables of tools in a scene file to instruments: their sizes, and keys that go together.

use super::build_parts::{Built, build_parts, jaw_size};
use super::checks::{check_name, check_times, name_or_number, purpose};
use super::instrument::{Course, Instrument, JawDrive, Jaws, ToolKind};
use super::instrument_tables::{ToolTable, WIDEST};
use super::keys::{JawKey, MotionKey};
use super::{SceneError, Written};
use crate::contact::{ContactLaw, Spring};
use crate::scalar::Vec3;
use crate::scalar::rigid::RigidTransform;
use crate::settings::{Choice, Placed};
use crate::units::Dimension;
use std::f64::consts::FRAC_PI_3;

/// The tools of a scene, by their order.
pub(super) fn build_instruments(
    tables: &[Placed<ToolTable>],
) -> Result<Vec<Instrument>, SceneError> {
    let mut tools: Vec<Instrument> = Vec::new();
    for (index, table) in tables.iter().enumerate() {
        let name = name_or_number(&table.value.name, "tool", index);
        check_name(&tools, |tool| &tool.name, &name, "tool", &table.place)?;
        let purpose = purpose("tool", &table.value.name, index);
        tools.push(build_instrument(name, &purpose, table)?);
    }
    Ok(tools)
}

fn build_instrument(
    name: String,
    purpose: &str,
    Placed { place, value }: &Placed<ToolTable>,
) -> Result<Instrument, SceneError> {
    let fail = |problem: String| SceneError::Tool {
        place: place.clone(),
        purpose: purpose.to_owned(),
        problem,
    };
    refuse_foreign_keys(value).map_err(fail)?;
    if value.path.is_some() && !value.keys.is_empty() {
        return Err(fail("`keys` and `path` exclude each other; keep one".to_owned()));
    }
    let Built { parts, solids } = build_parts(value).map_err(fail)?;
    if let Some(words) = parts.iter().find_map(|part| part.shape.complaint()) {
        return Err(fail(words.to_owned()));
    }
    let rotation = match value.rotation_vector {
        Some(_) if value.rotation_angle != 0.0 => {
            let problem = "`rotation_vector` and `rotation_angle` exclude each other; keep one";
            return Err(fail(problem.to_owned()));
        }
        Some(rotation) => rotation,
        None => value.rotation_axis * value.rotation_angle,
    };
    if let Some(end) = value.end.filter(|end| *end < value.begin) {
        let problem =
            format!("its end at {end} s is before its begin at {} s; swap the two", value.begin);
        return Err(fail(problem));
    }
    let law = ContactLaw {
        stiffness: value.stiffness,
        thickness: value.thickness,
        friction: value.friction,
    };
    let jaws = match value.kind {
        ToolKind::Grasper | ToolKind::AtraumaticGrasper => Some(build_jaws(value).map_err(fail)?),
        _ => None,
    };
    if let Some(jaws) = &jaws {
        check_jaws(value, jaws, purpose)?;
    }
    Ok(Instrument {
        name,
        kind: value.kind,
        parts,
        solids,
        placement: RigidTransform::about(Vec3::ZERO, rotation, value.position),
        course: build_course(value, purpose)?,
        law,
        spring: build_spring(value).map_err(fail)?,
        jaws,
        begin: value.begin,
        end: value.end,
        hands: Vec::new(),
        place: place.clone(),
        table: Written::default(),
    })
}

/// How a hand holds it.
fn build_spring(table: &ToolTable) -> Result<Option<Spring>, String> {
    match (table.spring, table.mass) {
        (None, Some(_)) => Err(
            "`mass` means nothing without `spring`: keys move the tool rigidly; leave it out, or \
                                give `spring = \"400 N/m\"`"
                .to_owned(),
        ),
        (None, None) => Ok(None),
        (Some(stiffness), mass) => {
            let mass = mass.unwrap_or(Spring::default().mass);
            let spring = Spring { stiffness, mass };
            spring.complaint().map_or(Ok(Some(spring)), |words| Err(words.to_owned()))
        }
    }
}

fn build_course(table: &ToolTable, purpose: &str) -> Result<Course, SceneError> {
    if let Some(path) = &table.path {
        return Ok(Course::File { path: path.clone() });
    }
    let times = table.keys.iter().map(|key| (&key.place, key.value.time));
    check_times(times, purpose)?;
    let own = MotionKey { time: 0.0, translation: Vec3::ZERO, rotation: Vec3::ZERO };
    let before = table.keys.first().filter(|first| first.value.time > 0.0).map(|_| own);
    let written = table.keys.iter().map(|key| MotionKey {
        time: key.value.time,
        translation: key.value.translation,
        rotation: key.value.rotation_axis * key.value.rotation_angle,
    });
    let keys = before.into_iter().chain(written).collect();
    Ok(Course::Keys { keys, interpolation: table.interpolation })
}

/// Keys that each kind takes besides those of all.
fn own_keys(kind: ToolKind) -> &'static [&'static str] {
    match kind {
        ToolKind::HalfSpace => &[],
        ToolKind::Sphere => &["radius"],
        ToolKind::Capsule | ToolKind::Probe => &["radius", "length"],
        ToolKind::Box | ToolKind::Blade => &["size", "rounding"],
        ToolKind::Hook => &["radius", "length", "tip_length", "tip_angle"],
        ToolKind::Grasper => &[
            "jaw_size",
            "jaw_mesh",
            "unit",
            "jaw_gap",
            "rounding",
            "jaw",
            "closing_force",
            "jaw_open",
            "closing_time",
            "lock",
        ],
        ToolKind::Mesh => &["mesh", "unit"],
        ToolKind::AtraumaticGrasper => &[
            "radius",
            "length",
            "jaw_size",
            "jaw_gap",
            "rounding",
            "ridge_height",
            "ridge_spacing",
            "jaw",
            "closing_force",
            "jaw_open",
            "closing_time",
            "lock",
        ],
        ToolKind::FanRetractor => &["radius", "length", "size", "rounding", "fingers", "spread"],
        ToolKind::SuctionTip => &["radius", "inner_radius", "length"],
    }
}

/// A key that the kind does not take would silently do nothing.
fn refuse_foreign_keys(table: &ToolTable) -> Result<(), String> {
    let taken = own_keys(table.kind);
    let written = [
        ("radius", table.radius.is_some()),
        ("length", table.length.is_some()),
        ("size", table.size.is_some()),
        ("rounding", table.rounding.is_some()),
        ("tip_length", table.tip_length.is_some()),
        ("tip_angle", table.tip_angle.is_some()),
        ("jaw_size", table.jaw_size.is_some()),
        ("jaw_gap", table.jaw_gap.is_some()),
        ("jaw", !table.jaw.is_empty()),
        ("closing_force", !table.closing_force.is_empty()),
        ("jaw_open", table.jaw_open.is_some()),
        ("closing_time", table.closing_time.is_some()),
        ("lock", !table.lock.is_empty()),
        ("mesh", table.mesh.is_some()),
        ("jaw_mesh", table.jaw_mesh.is_some()),
        ("unit", table.unit.is_some()),
        ("ridge_height", table.ridge_height.is_some()),
        ("ridge_spacing", table.ridge_spacing.is_some()),
        ("fingers", table.fingers.is_some()),
        ("spread", table.spread.is_some()),
        ("inner_radius", table.inner_radius.is_some()),
    ];
    match written.iter().find(|(key, is_written)| *is_written && !taken.contains(key)) {
        None => Ok(()),
        Some((key, _)) => {
            let known = ToolKind::ALL.iter().find(|(kind, ..)| *kind == table.kind);
            let kind = known.map_or("", |(_, name, _)| name);
            let takes = if taken.is_empty() { "no sizes".to_owned() } else { taken.join(", ") };
            Err(format!("`{key}` means nothing for a {kind}, which takes {takes}"))
        }
    }
}

fn build_jaws(table: &ToolTable) -> Result<Jaws, String> {
    let drive = match (table.jaw.is_empty(), table.closing_force.is_empty()) {
        (false, false) => {
            return Err("`jaw` and `closing_force` exclude each other; keep one".into());
        }
        (true, true) => {
            return Err(
                "a grasper needs `jaw` or `closing_force`, for example jaw = [{ time = 0, angle = \
                        \"40 deg\" }]"
                    .into(),
            );
        }
        (false, true) => JawDrive::Angle,
        (true, false) => JawDrive::Force,
    };
    let of_force =
        [("jaw_open", table.jaw_open.is_some()), ("closing_time", table.closing_time.is_some())];
    if drive == JawDrive::Angle
        && let Some((key, _)) = of_force.iter().find(|(_, is_written)| *is_written)
    {
        return Err(format!("`{key}` means nothing for jaws with `jaw`; leave it out"));
    }
    let angles = table.jaw.iter().map(|key| (key.value.time, key.value.angle));
    let forces = table.closing_force.iter().map(|key| (key.value.time, key.value.force));
    let keys = angles.chain(forces).map(|(time, value)| JawKey { time, value });
    Ok(Jaws {
        length: jaw_size(table).map_or(0.0, |size| size[2]),
        gap: table.jaw_gap.unwrap_or(0.0),
        drive,
        keys: keys.collect(),
        interpolation: table.interpolation,
        open: table.jaw_open.unwrap_or(FRAC_PI_3),
        closing_time: table.closing_time.unwrap_or(0.5),
        locks: table.lock.iter().map(|lock| [lock.value.from, lock.value.to]).collect(),
    })
}

/// Times ascend, and no jaw is in another.
fn check_jaws(table: &ToolTable, jaws: &Jaws, purpose: &str) -> Result<(), SceneError> {
    let fail = |place: &crate::settings::Place, problem: String| SceneError::Keys {
        place: place.clone(),
        purpose: purpose.to_owned(),
        problem,
    };
    check_times(table.jaw.iter().map(|key| (&key.place, key.value.time)), purpose)?;
    check_times(table.closing_force.iter().map(|key| (&key.place, key.value.time)), purpose)?;
    for Placed { place, value } in &table.jaw {
        check_angle(jaws, value.angle).map_err(|problem| fail(place, problem))?;
    }
    for Placed { place, value } in &table.lock {
        if value.from >= value.to {
            let problem =
                format!("its lock ends at {} s, before it begins; swap the two", value.to);
            return Err(fail(place, problem));
        }
    }
    Ok(())
}

/// Whether jaws can have an angle [rad]; otherwise what to do.
pub(crate) fn check_angle(jaws: &Jaws, angle: f64) -> Result<(), String> {
    let least = jaws.least_angle();
    let degrees = |angle: f64| Dimension::Angle.format(angle);
    if angle < least {
        return Err(format!(
            "at {} its jaws overlap; close them to {} at most, or give them a larger `jaw_gap`",
            degrees(angle),
            degrees(least + 0.0)
        ));
    }
    if angle > WIDEST {
        let (angle, widest) = (degrees(angle), degrees(WIDEST));
        return Err(format!("{angle} is no angle of jaws; open them to {widest} at most"));
    }
    Ok(())
}
