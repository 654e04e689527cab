//! Sizes of the image, and where its voxels are: `space`, `space directions` and `space origin`, or
//! `spacings` alone.

use viscera::scalar::{Mat3, Vec3, vec3};

use crate::affine::Affine;
use crate::error::{Fault, VolumeProblem, bad_field, unsupported};
use crate::read::Place;
use crate::report::{Note, Orientation, WorldSpace};

use super::header::{Field, Header};

const THREE: &str = "label maps have three; save one volume, for example with 3D Slicer";

/// The axes of the array, fastest first: three of space, and perhaps a list of layers before them.
pub(super) struct Axes {
    pub sizes: [u64; 3],
    /// Length of the list; 1 without one.
    pub layers: u64,
    /// Which axis is the list.
    list: Option<usize>,
}

impl Axes {
    pub fn read(header: &Header) -> Result<Self, Fault> {
        let Field { line, text } = header.needed("dimension")?;
        let count: usize = text.parse().map_err(|_| {
            Fault::at(*line, bad_field("dimension", "the number of axes, a whole number", text))
        })?;
        if !(3..=4).contains(&count) {
            return Err(Fault::at(
                *line,
                unsupported(format!("an image of {count} dimensions"), THREE),
            ));
        }
        let all = sizes(header, count)?;
        let list = list_axis(header, &all)?;
        if list.is_none() != (all.len() == 3) {
            let found = format!("an image of {count} dimensions that are not three of space");
            return Err(header.fault("dimension", unsupported(found, THREE)));
        }
        let layers = list.map_or(1, |axis| all[axis]);
        if layers != 1 && list != Some(0) {
            let found = format!("an image of {count} dimensions ({layers} volumes)");
            return Err(header.fault("sizes", unsupported(found, THREE)));
        }
        let mut sizes = [0; 3];
        let in_space = all.iter().enumerate().filter(|(axis, _)| Some(*axis) != list);
        for (to, (_, from)) in sizes.iter_mut().zip(in_space) {
            *to = *from;
        }
        Ok(Self { sizes, layers, list })
    }

    /// Those entries of a list with one entry per axis that are of space.
    fn of_space<T: Copy>(&self, entries: &[T]) -> Option<[T; 3]> {
        let kept = entries.iter().enumerate().filter(|(axis, _)| Some(*axis) != self.list);
        let kept: Vec<T> = kept.map(|(_, entry)| *entry).collect();
        kept.try_into().ok()
    }
}

fn sizes(header: &Header, count: usize) -> Result<Vec<u64>, Fault> {
    let Field { line, text } = header.needed("sizes")?;
    let numbers = text.split_whitespace().map(str::parse).collect::<Result<Vec<u64>, _>>();
    numbers.ok().filter(|numbers| numbers.len() == count).ok_or_else(|| {
        Fault::at(*line, bad_field("sizes", "as many whole numbers as dimensions", text))
    })
}

/// The axis that is not of space: the one without a direction, else by its kind, else by its length.
fn list_axis(header: &Header, sizes: &[u64]) -> Result<Option<usize>, Fault> {
    if let Some(field) = header.field("spacedirections") {
        let directions = directions(field, sizes.len())?;
        return Ok(directions.iter().position(Option::is_none));
    }
    if let Some(field) = header.field("kinds") {
        let is_space = |kind: &str| {
            ["domain", "space", "???", "none"].contains(&kind.to_ascii_lowercase().as_str())
        };
        if let Some(axis) = field.text.split_whitespace().position(|kind| !is_space(kind)) {
            return Ok((axis < sizes.len()).then_some(axis));
        }
    }
    let one_long = || [0, 3].into_iter().find(|&axis| sizes.get(axis) == Some(&1));
    Ok(if sizes.len() == 4 { one_long() } else { None })
}

/// Where voxels are.
pub(super) fn place(header: &Header, axes: &Axes, notes: &mut Vec<Note>) -> Result<Place, Fault> {
    let (affine, orientation) = match header.field("spacedirections") {
        Some(field) => (directed(header, field, axes, notes)?, Orientation::NrrdDirections),
        None => (spaced(header, axes, notes)?, Orientation::NrrdSpacings),
    };
    let space = match orientation {
        Orientation::NrrdDirections => world_space(header)?,
        _ => WorldSpace::Unnamed,
    };
    let to_world = affine.flipped(space.flips());
    let field = match orientation {
        Orientation::NrrdDirections => "spacedirections",
        _ => "spacings",
    };
    to_world.check(orientation.name()).map_err(|problem| header.fault(field, problem))?;
    Ok(Place { to_world, orientation, space })
}

/// From `space directions` and `space origin`, in metres.
fn directed(
    header: &Header,
    field: &Field,
    axes: &Axes,
    notes: &mut Vec<Note>,
) -> Result<Affine, Fault> {
    let count = 3 + usize::from(axes.list.is_some());
    let directions: Vec<Vec3<f64>> = directions(field, count)?.into_iter().flatten().collect();
    let [a, b, c] = directions[..] else {
        let expected = "a vector of three numbers for each of three axes";
        return Err(Fault::at(field.line, bad_field("space directions", expected, &field.text)));
    };
    let mut translation = Vec3::ZERO;
    match header.field("spaceorigin") {
        Some(Field { line, text }) => {
            let vectors = vectors(text).filter(|vectors| vectors.len() == 1);
            translation = vectors.and_then(|vectors| vectors[0]).ok_or_else(|| {
                Fault::at(*line, bad_field("space origin", "a vector such as (0,0,0)", text))
            })?;
        }
        None => notes.push(Note::NoOrigin),
    }
    // Units of the axes of the world.
    let unit = match header.field("spaceunits") {
        Some(field) => {
            let units = quoted(&field.text);
            unit_of(field, "space units", <[&str; 3]>::try_from(units).ok(), notes)?
        }
        None => {
            notes.push(Note::UnitAssumed);
            1e-3
        }
    };
    Ok(Affine { matrix: Mat3::from_columns(a, b, c), translation }.in_meters(unit))
}

/// From `spacings` alone, in metres.
fn spaced(header: &Header, axes: &Axes, notes: &mut Vec<Note>) -> Result<Affine, Fault> {
    let Some(Field { line, text }) = header.field("spacings") else {
        let advice = "the size of voxels is unknown; set the spacing in 3D Slicer and save it";
        let field = "space directions";
        return Err(VolumeProblem::MissingField { field, advice }.into());
    };
    let numbers = text.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>();
    let spacing = numbers
        .ok()
        .and_then(|numbers| axes.of_space(&numbers))
        .ok_or_else(|| Fault::at(*line, bad_field("spacings", "one number for each axis", text)))?;
    let unit = match header.field("units") {
        Some(field) => {
            let units = axes.of_space(&quoted(&field.text));
            unit_of(field, "units", units, notes)?
        }
        None => {
            notes.push(Note::UnitAssumed);
            1e-3
        }
    };
    let [x, y, z] = spacing.map(f64::abs);
    let matrix = Mat3::from_columns(vec3(x, 0.0, 0.0), vec3(0.0, y, 0.0), vec3(0.0, 0.0, z));
    Ok(Affine { matrix, translation: Vec3::ZERO }.in_meters(unit))
}

/// The frame of positions. Those of the world's axes that run through time have a fourth number.
fn world_space(header: &Header) -> Result<WorldSpace, Fault> {
    let Some(Field { line, text }) = header.field("space") else { return Ok(WorldSpace::Unnamed) };
    match text.to_ascii_lowercase().as_str() {
        "right-anterior-superior" | "ras" => Ok(WorldSpace::RightAnteriorSuperior),
        "left-posterior-superior" | "lps" => Ok(WorldSpace::LeftPosteriorSuperior),
        "left-anterior-superior" | "las" => Ok(WorldSpace::LeftAnteriorSuperior),
        // The scanner's axes, or any: how the patient lay in them is not told.
        "scanner-xyz" | "scanner" | "3d-right-handed" | "3drh" => Ok(WorldSpace::Unnamed),
        _ => {
            let expected = "left-posterior-superior, right-anterior-superior, \
                left-anterior-superior or scanner-xyz";
            Err(Fault::at(*line, bad_field("space", expected, text)))
        }
    }
}

/// The directions of all axes; none for those that are not of space.
fn directions(field: &Field, count: usize) -> Result<Vec<Option<Vec3<f64>>>, Fault> {
    vectors(&field.text).filter(|vectors| vectors.len() == count).ok_or_else(|| {
        let expected = "for each axis a vector such as (3,0,0), or `none`";
        Fault::at(field.line, bad_field("space directions", expected, &field.text))
    })
}

/// Vectors as in `(1,0,0) none (0, 1, 0)`.
fn vectors(text: &str) -> Option<Vec<Option<Vec3<f64>>>> {
    let mut vectors = Vec::new();
    let mut rest = text.trim_start();
    while !rest.is_empty() {
        if let Some(behind) = rest.strip_prefix("none") {
            vectors.push(None);
            rest = behind.trim_start();
            continue;
        }
        let (inside, behind) = rest.strip_prefix('(')?.split_once(')')?;
        let numbers = inside.split(',').map(|number| number.trim().parse());
        let numbers: Vec<f64> = numbers.collect::<Result<_, _>>().ok()?;
        let [x, y, z] = numbers[..] else { return None };
        vectors.push(Some(vec3(x, y, z)));
        rest = behind.trim_start();
    }
    Some(vectors)
}

/// Words in quotes.
fn quoted(text: &str) -> Vec<&str> {
    text.split('"').skip(1).step_by(2).collect()
}

/// A unit that all three axes share `[m]`.
fn unit_of(
    field: &Field,
    name: &str,
    units: Option<[&str; 3]>,
    notes: &mut Vec<Note>,
) -> Result<f64, Fault> {
    let bad = || {
        let expected = "three times the same unit: \"mm\", \"cm\", \"m\" or \"um\"";
        Fault::at(field.line, bad_field(name, expected, &field.text))
    };
    let [x, y, z] = units.ok_or_else(bad)?;
    if x != y || y != z {
        return Err(bad());
    }
    match x.to_ascii_lowercase().as_str() {
        "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => Ok(1e-3),
        "cm" | "centimeter" | "centimeters" | "centimetre" | "centimetres" => Ok(1e-2),
        "m" | "meter" | "meters" | "metre" | "metres" => Ok(1.0),
        "um" | "\u{b5}m" | "micron" | "microns" | "micrometer" | "micrometre" => Ok(1e-6),
        "" => {
            notes.push(Note::UnitAssumed);
            Ok(1e-3)
        }
        _ => Err(bad()),
    }
}
