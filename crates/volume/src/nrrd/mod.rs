//! NRRD with its data behind the header, see "Definition of NRRD File Format" of Teem; segmentations
//! of 3D Slicer (`.seg.nrrd`) are NRRD files with keys of their own.

mod header;
mod segments;
mod space;
mod text;

use crate::collect::{SegmentPlaces, Values};
use crate::error::{Fault, VolumeProblem, bad_field, unsupported};
use crate::read::{Limits, Parsed};
use crate::report::{NamesFrom, Note, VolumeFormat};
use crate::source::{Part, Source};
use crate::values::{ByteOrder, ValueType, read_values};

use header::{Field, Header};
use segments::Segments;
use space::Axes;

/// Reads a file that begins with NRRD's magic.
pub(crate) fn read(bytes: &[u8], limits: Limits) -> Result<Parsed, Fault> {
    let header = Header::parse(bytes)?;
    header.refuse_detached()?;
    let encoding = encoding(&header)?;
    let value_type = value_type(&header)?;
    let axes = Axes::read(&header)?;
    let segments = Segments::read(&header)?;
    let mut notes = Vec::new();
    let place = space::place(&header, &axes, &mut notes)?;
    let mut values = Values::new(axes.sizes, axes.layers, limits)?;
    let layers = values.announced() / axes.sizes.iter().product::<u64>().max(1);
    let layers = usize::try_from(layers).unwrap_or(usize::MAX);
    if layers > 1 {
        values = values.with_layers(layers, layer_places(&header, &segments, layers)?);
    }

    let data = header.data(bytes)?;
    let goes_on = match encoding {
        Encoding::Text => text::read_values(data, &mut values)?,
        Encoding::Raw | Encoding::Gzip => {
            let order = byte_order(&header, value_type)?;
            let source = binary(&header, encoding, data, &values, value_type)?;
            read_values(source, value_type, order, &mut values)?
        }
    };
    notes.extend(goes_on.then_some(Note::GoesOn));
    let dims = values.dims();
    let collected = values.finish()?;
    if layers > 1 {
        let (overlaps, strays) = (collected.overlaps, collected.strays);
        notes.push(Note::LayersMerged { layers, overlaps, strays });
    }
    let names = segments.names(layers > 1);
    let names_from = if names.is_empty() { NamesFrom::None } else { NamesFrom::Segments };
    let gzip = encoding == Encoding::Gzip;
    let format = VolumeFormat::Nrrd;
    Ok(Parsed { format, gzip, dims, collected, place, names, names_from, notes })
}

/// Which segment a value in a layer stands for.
fn layer_places(
    header: &Header,
    segments: &Segments,
    layers: usize,
) -> Result<SegmentPlaces, Fault> {
    if segments.is_empty() {
        let found = format!("an image of {layers} layers without segments");
        let advice = "save one of its volumes, or in 3D Slicer the segmentation as .seg.nrrd";
        return Err(header.fault("sizes", unsupported(found, advice)));
    }
    segments.places(layers)
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Raw,
    Gzip,
    Text,
}

fn encoding(header: &Header) -> Result<Encoding, Fault> {
    const ADVICE: &str = "save it with encoding gzip or raw, for example with 3D Slicer";
    let Field { line, text } = header.needed("encoding")?;
    match text.to_ascii_lowercase().as_str() {
        "raw" => Ok(Encoding::Raw),
        "gz" | "gzip" => Ok(Encoding::Gzip),
        "txt" | "text" | "ascii" => Ok(Encoding::Text),
        "bz2" | "bzip2" => Err(Fault::at(*line, unsupported("encoding bzip2", ADVICE))),
        "hex" => Err(Fault::at(*line, unsupported("encoding hex", ADVICE))),
        _ => {
            let expected = "raw, gzip or text";
            Err(Fault::at(*line, bad_field("encoding", expected, text)))
        }
    }
}

fn value_type(header: &Header) -> Result<ValueType, Fault> {
    let Field { line, text } = header.needed("type")?;
    let words: Vec<String> = text.split_whitespace().map(str::to_ascii_lowercase).collect();
    Ok(match words.join(" ").as_str() {
        "signed char" | "int8" | "int8_t" => ValueType::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => ValueType::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => {
            ValueType::I16
        }
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => {
            ValueType::U16
        }
        "int" | "signed int" | "int32" | "int32_t" => ValueType::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => ValueType::U32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => ValueType::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => {
            ValueType::U64
        }
        "float" => ValueType::F32,
        "double" => ValueType::F64,
        _ => {
            let expected = "a type of numbers, such as uint8 or unsigned short";
            return Err(Fault::at(*line, bad_field("type", expected, text)));
        }
    })
}

fn byte_order(header: &Header, value_type: ValueType) -> Result<ByteOrder, Fault> {
    let Some(Field { line, text }) = header.field("endian") else {
        if value_type.size() == 1 {
            return Ok(ByteOrder::Little);
        }
        let advice = "add the line `endian: little`, which all usual computers write";
        return Err(VolumeProblem::MissingField { field: "endian", advice }.into());
    };
    match text.to_ascii_lowercase().as_str() {
        "little" => Ok(ByteOrder::Little),
        "big" => Ok(ByteOrder::Big),
        _ => Err(Fault::at(*line, bad_field("endian", "little or big", text))),
    }
}

/// The bytes of values, after `line skip` and `byte skip`.
fn binary<'a>(
    header: &Header,
    encoding: Encoding,
    mut data: &'a [u8],
    values: &Values,
    value_type: ValueType,
) -> Result<Source<'a>, Fault> {
    const LARGEST_SKIP: u64 = 1 << 26;
    if let Some(Field { line, text }) = header.field("lineskip") {
        let bad =
            || Fault::at(*line, bad_field("line skip", "a number of lines that are there", text));
        let mut skip: u64 = text.parse().map_err(|_| bad())?;
        while skip > 0 {
            let end = data.iter().position(|&byte| byte == b'\n').ok_or_else(bad)?;
            data = &data[end + 1..];
            skip -= 1;
        }
    }
    let mut skip = 0;
    if let Some(Field { line, text }) = header.field("byteskip") {
        // -1: raw values are the last bytes of the file.
        if text == "-1" && encoding == Encoding::Raw {
            let size = values.announced().saturating_mul(value_type.size() as u64);
            skip = (data.len() as u64).saturating_sub(size);
        } else {
            // What is skipped inside gzip must be inflated: not without end.
            let asked = text.parse().ok().filter(|&skip: &u64| skip <= LARGEST_SKIP);
            let expected = "a whole number of bytes up to 64 MiB";
            skip = asked.ok_or_else(|| Fault::at(*line, bad_field("byte skip", expected, text)))?;
        }
    }
    let mut source = match encoding {
        Encoding::Gzip => Source::gzip(data),
        Encoding::Raw | Encoding::Text => Source::plain(data),
    };
    source.skip(&mut Part::new("the bytes before the voxels (byte skip)", skip))?;
    Ok(source)
}
