//! Values as text.

use crate::collect::Values;
use crate::error::{VolumeProblem, bad_field};

/// Reads all values; true where more follow.
pub(super) fn read_values(data: &[u8], values: &mut Values) -> Result<bool, VolumeProblem> {
    let mut words = data
        .split(|byte| byte.is_ascii_whitespace() || *byte == b',')
        .filter(|word| !word.is_empty());
    let announced = values.announced();
    while values.came() < announced {
        let Some(word) = words.next() else {
            let found = format!("{} of {announced}", values.came());
            let expected = "as many numbers as there are voxels";
            return Err(bad_field("voxels", expected, found));
        };
        let text = String::from_utf8_lossy(&word[..word.len().min(80)]);
        let Ok(value) = text.parse() else {
            return Err(bad_field("voxels", "a number", &text));
        };
        values.reserve(1)?;
        values.push(value);
    }
    Ok(words.next().is_some())
}
