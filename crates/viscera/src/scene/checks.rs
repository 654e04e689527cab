//! Checks that tables of several kinds have in common.

use super::SceneError;
use crate::settings::Place;
use crate::units::shorten;

/// The name that is written, or one of the kind and its place in the list.
pub(super) fn name_or_number(name: &Option<String>, kind: &str, index: usize) -> String {
    name.clone().unwrap_or_else(|| format!("{kind} {index}"))
}

/// What something is for, in messages.
pub(super) fn purpose(kind: &str, name: &Option<String>, index: usize) -> String {
    match name {
        Some(name) => format!("{kind} `{name}`"),
        None => format!("{kind} {index}"),
    }
}

/// No two of a kind have one name.
pub(super) fn check_name<T>(
    others: &[T],
    name_of: impl Fn(&T) -> &String,
    name: &str,
    kind: &'static str,
    place: &Place,
) -> Result<(), SceneError> {
    if others.iter().any(|other| name_of(other) == name) {
        return Err(SceneError::NameTaken { place: place.clone(), kind, name: shorten(name) });
    }
    Ok(())
}

/// Times must ascend: two keys at one time would be a jump.
pub(super) fn check_times<'a>(
    times: impl Iterator<Item = (&'a Place, f64)>,
    purpose: &str,
) -> Result<(), SceneError> {
    let mut last = f64::NEG_INFINITY;
    for (place, time) in times {
        if time <= last {
            return Err(SceneError::Keys {
                place: place.clone(),
                purpose: purpose.to_owned(),
                problem: format!("its key at {time} s follows one at {last} s; times must ascend"),
            });
        }
        last = time;
    }
    Ok(())
}
