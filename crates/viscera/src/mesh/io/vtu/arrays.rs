//! Data arrays of a file: numbers as text in their element, or as bytes behind the XML.

use roxmltree::Node;

use crate::mesh::io::error::{Fault, ReadProblem};
use crate::mesh::io::lines::{bad_word, parse_word};

pub(super) const ASCII_ADVICE: &str = "in ParaView save it with \"Data Mode\" set to \"Ascii\", or with \
    meshio run `meshio ascii FILE`";

/// A fault at the line where an XML element begins.
pub(super) fn fault_at(node: Node, problem: ReadProblem) -> Fault {
    let position = node.document().text_pos_at(node.range().start);
    Fault::at(position.row as usize, problem)
}

fn unsupported_at(node: Node, found: String) -> Fault {
    fault_at(node, ReadProblem::Unsupported { found, advice: ASCII_ADVICE })
}

/// The bytes behind the XML.
#[derive(Clone, Copy)]
pub(super) struct Appended<'a> {
    /// From behind the underscore on.
    pub bytes: &'a [u8],
    /// Bytes of the number of bytes before each array.
    pub header: usize,
}

impl<'a> Appended<'a> {
    /// Of a document whose bytes stand as they are.
    pub fn of(root: Node, bytes: &'a [u8]) -> Result<Self, Fault> {
        let refuse = |found: &str| Err(unsupported_at(root, found.into()));
        if root.attribute("compressor").is_some() {
            return refuse("compressed VTU data");
        }
        if root.attribute("byte_order").is_some_and(|order| order != "LittleEndian") {
            return refuse("VTU data in big-endian order");
        }
        match root.attribute("header_type") {
            Some("UInt64") => Ok(Self { bytes, header: 8 }),
            Some("UInt32") | None => Ok(Self { bytes, header: 4 }),
            Some(_) => refuse("VTU data with an unknown `header_type`"),
        }
    }

    /// The bytes of the array at an offset.
    fn array(&self, node: Node<'_, '_>) -> Result<&'a [u8], Fault> {
        let offset = node.attribute("offset").unwrap_or_default();
        let Some(offset) = parse_word::<usize>(offset.trim().as_bytes()) else {
            return Err(fault_at(node, bad_word("an offset of appended data", offset.as_bytes())));
        };
        let rest = self.bytes.get(offset..).unwrap_or_default();
        let cut = || {
            let reading = format!("array `{}`", node.attribute("Name").unwrap_or("points"));
            fault_at(node, ReadProblem::UnexpectedEnd { reading })
        };
        let (header, rest) = rest.split_at_checked(self.header).ok_or_else(cut)?;
        let length = header.iter().rev().fold(0u64, |sum, &byte| sum << 8 | u64::from(byte));
        let length = usize::try_from(length).map_err(|_| cut())?;
        rest.get(..length).ok_or_else(cut)
    }
}

/// A number of a mesh.
pub(super) trait Number: std::str::FromStr {
    /// Nothing where it has to be whole.
    fn from_float(value: f64) -> Option<Self>;
    /// Nothing where it is out of range.
    fn from_whole(value: i128) -> Option<Self>;
}

impl Number for f64 {
    fn from_float(value: f64) -> Option<Self> {
        Some(value)
    }
    fn from_whole(value: i128) -> Option<Self> {
        Some(value as f64)
    }
}

macro_rules! whole_numbers {
    ($($type:ident)*) => {
        $(impl Number for $type {
            fn from_float(_: f64) -> Option<Self> {
                None
            }
            fn from_whole(value: i128) -> Option<Self> {
                value.try_into().ok()
            }
        })*
    };
}
whole_numbers!(u8 u32 usize);

/// A data array as it stands in the file.
pub(super) struct DataArray<'a, 'input> {
    pub node: Node<'a, 'input>,
    /// Its bytes, where they stand behind the XML.
    bytes: Option<&'a [u8]>,
}

impl<'a, 'input> DataArray<'a, 'input> {
    pub fn new(node: Node<'a, 'input>, appended: Option<Appended<'a>>) -> Result<Self, Fault> {
        match (node.attribute("format"), appended) {
            (Some("ascii") | None, _) => Ok(Self { node, bytes: None }),
            (Some("appended"), Some(appended)) => {
                Ok(Self { node, bytes: Some(appended.array(node)?) })
            }
            (Some(format), _) => {
                Err(unsupported_at(node, format!("VTU data in the format `{format}`")))
            }
        }
    }

    /// The words and the pieces of text they stand in; comments may split the text.
    fn words(&self) -> impl Iterator<Item = (Node<'a, 'input>, &'a str)> {
        self.node.children().filter(Node::is_text).flat_map(|piece| {
            piece.text().unwrap_or_default().split_ascii_whitespace().map(move |w| (piece, w))
        })
    }

    pub fn numbers<T: Number>(&self, expected: &'static str) -> Result<Vec<T>, Fault> {
        if let Some(bytes) = self.bytes {
            return self.decode(bytes, expected);
        }
        let mut numbers = Vec::new();
        for (index, (_, word)) in self.words().enumerate() {
            let number = parse_word(word.as_bytes()).ok_or_else(|| Fault {
                line: self.line_of(index),
                problem: bad_word(expected, word.as_bytes()),
            })?;
            numbers.push(number);
        }
        Ok(numbers)
    }

    fn decode<T: Number>(&self, bytes: &[u8], expected: &'static str) -> Result<Vec<T>, Fault> {
        let refused = |found: &dyn std::fmt::Display| {
            fault_at(self.node, bad_word(expected, found.to_string().as_bytes()))
        };
        macro_rules! numbers {
            ($type:ident $make:ident $wide:ident) => {{
                let (words, rest) = bytes.as_chunks::<{ size_of::<$type>() }>();
                if !rest.is_empty() {
                    return Err(refused(&"part of a number at the end"));
                }
                let number = |word: &[u8; _]| {
                    let value = $type::from_le_bytes(*word);
                    T::$make($wide::from(value)).ok_or_else(|| refused(&value))
                };
                words.iter().map(number).collect()
            }};
        }
        match self.node.attribute("type").unwrap_or_default() {
            "Float32" => numbers!(f32 from_float f64),
            "Float64" => numbers!(f64 from_float f64),
            "Int8" => numbers!(i8 from_whole i128),
            "UInt8" => numbers!(u8 from_whole i128),
            "Int16" => numbers!(i16 from_whole i128),
            "UInt16" => numbers!(u16 from_whole i128),
            "Int32" => numbers!(i32 from_whole i128),
            "UInt32" => numbers!(u32 from_whole i128),
            "Int64" => numbers!(i64 from_whole i128),
            "UInt64" => numbers!(u64 from_whole i128),
            other => Err(unsupported_at(self.node, format!("VTU data of type `{other}`"))),
        }
    }

    /// The line of the file in which a number stands; those behind the XML have none.
    pub fn line_of(&self, index: usize) -> Option<usize> {
        let (piece, word) = self.words().nth(index)?;
        let text = piece.text()?;
        // The parser keeps every line end, so lines can be counted from the start of the text.
        let before = (word.as_ptr() as usize).checked_sub(text.as_ptr() as usize)?;
        let newlines = text.as_bytes().get(..before)?.iter().filter(|&&b| b == b'\n').count();
        let start = piece.document().text_pos_at(piece.range().start);
        Some(start.row as usize + newlines)
    }
}
