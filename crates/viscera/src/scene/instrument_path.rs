//! Paths of tools from files: rows of time [s], place [m] and rotation vector [rad], separated by commas.

use super::keys::MotionKey;
use crate::scalar::Vec3;
use std::f64::consts::TAU;

/// Numbers in a row.
const COLUMNS: usize = 7;

/// Farther from its own position no tool goes [m]: a slip of the unit.
const FARTHEST: f64 = 1e3;

/// Why a path cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{file}{}: {problem}", line.map_or(String::new(), |line| format!(", line {line}")))]
pub struct PathError {
    /// The file, as the scene names it.
    pub file: String,
    /// The line, from 1 on; nothing where all of it is meant.
    pub line: Option<usize>,
    /// What is wrong and what to write.
    pub problem: String,
}

/// Reads a path: rows of time [s], x, y, z [m], rx, ry, rz [rad], times ascending. The first row may be a header; empty
/// lines and lines that begin with `#` are left out. `file` is its name, for errors.
pub fn read_path(file: &str, bytes: &[u8]) -> Result<Vec<MotionKey>, PathError> {
    let fail =
        |line: Option<usize>, problem: String| PathError { file: file.to_owned(), line, problem };
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let text = std::str::from_utf8(bytes)
        .map_err(|_| fail(None, "it is no text; export the path as CSV".to_owned()))?;
    let mut keys: Vec<MotionKey> = Vec::new();
    let mut may_be_header = true;
    for (index, row) in text.lines().enumerate() {
        let (row, line) = (row.trim(), Some(index + 1));
        if row.is_empty() || row.starts_with('#') {
            continue;
        }
        let is_header = may_be_header && is_header(row);
        may_be_header = false;
        if is_header {
            continue;
        }
        let numbers = numbers(row).map_err(|problem| fail(line, problem))?;
        let key = key(&numbers, keys.last());
        if let Some(last) = keys.last().filter(|last| key.time <= last.time) {
            let problem = format!(
                "its time {} s follows {} s; times must ascend, so sort the rows and keep one of each time",
                key.time, last.time
            );
            return Err(fail(line, problem));
        }
        keys.push(key);
    }
    if keys.is_empty() {
        let problem = "the path is empty; write rows of time, x, y, z, rx, ry, rz in seconds, metres and radians";
        return Err(fail(None, problem.to_owned()));
    }
    Ok(keys)
}

/// Whether a row names columns: nothing in it is a number.
fn is_header(row: &str) -> bool {
    row.split(',').all(|word| {
        let word = word.trim();
        word.parse::<f64>().is_err()
            && word.starts_with(|first: char| first.is_alphabetic() || first == '"')
    })
}

fn numbers(row: &str) -> Result<[f64; COLUMNS], String> {
    let words: Vec<&str> = row.split(',').map(str::trim).collect();
    if words.len() != COLUMNS {
        return Err(format!(
            "{} values where {COLUMNS} are needed, separated by commas: time, x, y, z, rx, ry, rz",
            words.len()
        ));
    }
    let mut numbers = [0.0; COLUMNS];
    for (number, word) in numbers.iter_mut().zip(words) {
        let read = word.parse::<f64>().ok().filter(|number| number.is_finite());
        let word = crate::units::shorten(word);
        *number = read.ok_or_else(|| {
            format!("`{word}` is no finite number; leave out rows in which the tool was not seen")
        })?;
    }
    let [_, x, y, z, ..] = numbers;
    if [x, y, z].into_iter().any(|length| length.abs() > FARTHEST) {
        return Err(format!(
            "a place more than {FARTHEST} m away; write metres, such as 0.032 for 32 mm"
        ));
    }
    Ok(numbers)
}

/// Of all vectors of one rotation the one nearest to the last row's: recorded ones jump where they pass half a turn.
fn key(numbers: &[f64; COLUMNS], last: Option<&MotionKey>) -> MotionKey {
    let [time, x, y, z, rx, ry, rz] = *numbers;
    let mut rotation = Vec3 { x: rx, y: ry, z: rz };
    let angle = rotation.length();
    if let Some(last) = last.filter(|_| angle > 0.0) {
        let axis = rotation * (1.0 / angle);
        let turns = ((last.rotation.dot(axis) - angle) / TAU).round();
        if turns != 0.0 {
            rotation = axis * (angle + turns * TAU);
        }
    }
    MotionKey { time, translation: Vec3 { x, y, z }, rotation }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::vec3;

    fn error(text: &str) -> String {
        read_path("p.csv", text.as_bytes()).expect_err(text).to_string()
    }

    #[test]
    fn rows_are_keys() {
        let text = "\u{feff}time, x, y, z, rx, ry, rz\r\n# recorded\r\n\r\n0, 0,0,0, 0,0,0\r\n0.5, 0.1, -2e-3, 0, 0, 0, 1.5\r\n";
        let keys = read_path("p.csv", text.as_bytes()).expect("a path");
        assert_eq!(keys.len(), 2);
        assert_eq!((keys[1].time, keys[1].translation), (0.5, vec3(0.1, -2e-3, 0.0)));
        assert_eq!(keys[1].rotation, vec3(0.0, 0.0, 1.5));
    }

    #[test]
    fn a_turn_goes_on_where_recorded_vectors_jump() {
        let text = "0,0,0,0, 0,0,3.0\n1,0,0,0, 0,0,-3.0\n2,0,0,0, 0,0,-2.0";
        let keys = read_path("p.csv", text.as_bytes()).expect("a path");
        let turns: Vec<f64> = keys.iter().map(|key| key.rotation.z).collect();
        for (turn, wanted) in turns.iter().zip([3.0, TAU - 3.0, TAU - 2.0]) {
            assert!((turn - wanted).abs() < 1e-12, "{turns:?}");
        }
    }

    #[test]
    fn what_is_no_path_says_where_and_what_to_do() {
        for (text, message) in [
            (
                "",
                "p.csv: the path is empty; write rows of time, x, y, z, rx, ry, rz in seconds, metres and radians",
            ),
            (
                "time,x,y,z,rx,ry,rz\n",
                "p.csv: the path is empty; write rows of time, x, y, z, rx, ry, rz in seconds, metres and radians",
            ),
            (
                "0,0,0,0,0,0,0\n1,nan,0,0,0,0,0\n",
                "p.csv, line 2: `nan` is no finite number; leave out rows in which the tool was not seen",
            ),
            (
                "0,0,0,0,0,0,0\n1,0,0,0,0,0,0\n0.5,0,0,0,0,0,0\n",
                "p.csv, line 3: its time 0.5 s follows 1 s; times must ascend, so sort the rows and keep one of each time",
            ),
            (
                "0,0,0,0\n",
                "p.csv, line 1: 4 values where 7 are needed, separated by commas: time, x, y, z, rx, ry, rz",
            ),
            (
                "0,0,0,3200,0,0,0\n",
                "p.csv, line 1: a place more than 1000 m away; write metres, such as 0.032 for 32 mm",
            ),
            (
                "a,b,c,d,e,f,g\nx,1,1,1,1,1,1\n",
                "p.csv, line 2: `x` is no finite number; leave out rows in which the tool was not seen",
            ),
        ] {
            assert_eq!(error(text), message);
        }
        assert_eq!(
            read_path("p.csv", &[0xff, 0xfe]).expect_err("bytes").to_string(),
            "p.csv: it is no text; export the path as CSV"
        );
    }
}
