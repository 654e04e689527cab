//! Data arrays of a file: numbers as text or as bytes.

use std::borrow::Cow;

use roxmltree::Node;

use super::codec::Codec;
use super::places::{LineIndex, fault_at};

use crate::mesh::io::error::{Fault, Place};
use crate::mesh::io::lines::{bad_word, parse_word};

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
whole_numbers!(u8 u32 i64 usize);

/// A data array as it stands in the file.
pub(super) struct DataArray<'a, 'input> {
    pub node: Node<'a, 'input>,
    /// Its bytes, where it is not text.
    bytes: Option<Cow<'a, [u8]>>,
    is_big_endian: bool,
    lines: &'a LineIndex<'a>,
}

/// Whether numbers of an array are whole by their type.
pub(super) fn is_whole(node: Node) -> bool {
    let kind = node.attribute("type").unwrap_or_default();
    kind.starts_with("Int") || kind.starts_with("UInt")
}

impl<'a, 'input> DataArray<'a, 'input> {
    pub fn new(node: Node<'a, 'input>, codec: Codec<'a>) -> Result<Self, Fault> {
        let bytes = match node.attribute("format") {
            Some("ascii") | None => None,
            Some("appended") => Some(codec.appended(node)?),
            Some("binary") => Some(Cow::Owned(codec.inline(node)?)),
            Some(other) => {
                let expected = "a format of data: ascii, binary or appended";
                return Err(fault_at(node, bad_word(expected, other.as_bytes())));
            }
        };
        Ok(Self { node, bytes, is_big_endian: codec.is_big_endian, lines: codec.lines })
    }

    /// The words and the pieces of text they stand in; comments may split the text.
    fn words(&self) -> impl Iterator<Item = (Node<'a, 'input>, &'a str)> {
        self.node.children().filter(Node::is_text).flat_map(|piece| {
            piece.text().unwrap_or_default().split_ascii_whitespace().map(move |w| (piece, w))
        })
    }

    pub fn numbers<T: Number>(&self, expected: &'static str) -> Result<Vec<T>, Fault> {
        if let Some(bytes) = &self.bytes {
            return self.decode(bytes, expected);
        }
        let mut numbers = Vec::new();
        for (index, (_, word)) in self.words().enumerate() {
            let number = parse_word(word.as_bytes()).ok_or_else(|| Fault {
                place: self.line_of(index),
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
                    let value = match self.is_big_endian {
                        true => $type::from_be_bytes(*word),
                        false => $type::from_le_bytes(*word),
                    };
                    T::$make($wide::from(value)).ok_or_else(|| refused(&value))
                };
                // A collection of results has no length to begin with.
                let mut numbers = Vec::with_capacity(words.len());
                for word in words {
                    numbers.push(number(word)?);
                }
                Ok(numbers)
            }};
        }
        match self.node.attribute("type").unwrap_or_default() {
            "Float32" => numbers!(f32 from_float f64),
            "Float64" => numbers!(f64 from_float f64),
            "Int8" => numbers!(i8 from_whole i128),
            "UInt8" | "String" => numbers!(u8 from_whole i128),
            "Int16" => numbers!(i16 from_whole i128),
            "UInt16" => numbers!(u16 from_whole i128),
            "Int32" => numbers!(i32 from_whole i128),
            "UInt32" => numbers!(u32 from_whole i128),
            "Int64" => numbers!(i64 from_whole i128),
            "UInt64" => numbers!(u64 from_whole i128),
            other => {
                let expected = "a type of numbers such as Float32 or Int64";
                Err(fault_at(self.node, bad_word(expected, other.as_bytes())))
            }
        }
    }

    /// The line of the file in which a number stands, where it is text.
    pub fn line_of(&self, index: usize) -> Option<Place> {
        self.lines_of(std::iter::once(index)).pop().map(Place::Line)
    }

    /// The lines in which numbers stand, by ascending index; none where they are not text.
    pub fn lines_of(&self, indices: impl Iterator<Item = usize>) -> Vec<usize> {
        let mut lines = Vec::new();
        let mut indices = indices.peekable();
        // The parser keeps every line end, so lines can be counted from the start of a piece of text.
        let (mut piece, mut counted, mut line) = (None, 0, 0);
        for (index, (node, word)) in self.words().enumerate() {
            if indices.peek().is_none() {
                break;
            }
            let text = node.text().unwrap_or_default().as_bytes();
            if piece != Some(node.id()) {
                let start = self.lines.line_at(node.range().start);
                (piece, counted, line) = (Some(node.id()), 0, start);
            }
            let before = (word.as_ptr() as usize).saturating_sub(text.as_ptr() as usize);
            let passed = text.get(counted..before).unwrap_or_default();
            line += passed.iter().filter(|&&byte| byte == b'\n').count();
            counted = before.max(counted);
            while indices.next_if(|&wanted| wanted <= index).is_some() {
                lines.push(line);
            }
        }
        lines
    }
}
