//! Bytes of data arrays: in their element, or behind the XML; as they are, in Base64, compressed by zlib.
//!
//! ```text
//! plain:       [bytes] data                                                            one of `header_type` in brackets
//! compressed:  [blocks] [size of a block] [size of the last, 0 if whole] [compressed size of each ...] blocks of zlib
//! ```
//!
//! In Base64 some programs encode the numbers in front and the data one by one, others together: `=` may stand in the middle.

use std::borrow::Cow;
use std::cell::Cell;
use std::io::Read;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::bufread::ZlibDecoder;
use roxmltree::{Document, Node};

use super::places::{LineIndex, fault_at};
use crate::mesh::io::error::{Fault, ReadProblem};
use crate::mesh::io::lines::{bad_word, parse_word};
use crate::mesh::io::text::shorten;

/// What a file says of the bytes of its arrays.
#[derive(Clone, Copy)]
pub(super) struct Codec<'a> {
    /// Bytes of the numbers in front of an array.
    header: usize,
    pub is_big_endian: bool,
    is_compressed: bool,
    appended: Option<&'a Appended<'a>>,
    pub lines: &'a LineIndex<'a>,
}

/// The bytes of all arrays behind the XML.
pub(super) struct Appended<'a> {
    /// From behind the underscore on.
    bytes: &'a [u8],
    is_base64: bool,
    /// Where arrays begin, ascending.
    offsets: Vec<usize>,
    /// How many bytes may still be read: arrays that begin at the same byte would be read again and again.
    room: Cell<usize>,
}

impl<'a> Appended<'a> {
    pub fn new((bytes, is_base64): (&'a [u8], bool), document: &Document) -> Self {
        // Those of text have a name of their own.
        let is_array = |node: &Node| ["DataArray", "Array"].contains(&node.tag_name().name());
        let arrays = document.descendants().filter(is_array);
        let offsets = arrays.filter_map(|array| array.attribute("offset")?.trim().parse().ok());
        let mut offsets: Vec<usize> = offsets.collect();
        // Only Base64 asks where an array ends.
        offsets.sort_unstable();
        // Some arrays may be read twice.
        Self { bytes, is_base64, offsets, room: Cell::new(2 * bytes.len()) }
    }

    fn take(&self, node: Node, bytes: usize) -> Result<(), Fault> {
        let Some(room) = self.room.get().checked_sub(bytes) else {
            let found = "appended data that are shared by several arrays".to_owned();
            let advice = "export the file again";
            return Err(fault_at(node, ReadProblem::Unsupported { found, advice }));
        };
        self.room.set(room);
        Ok(())
    }
}

impl<'a> Codec<'a> {
    pub fn of(
        root: Node,
        appended: Option<&'a Appended<'a>>,
        lines: &'a LineIndex<'a>,
    ) -> Result<Self, Fault> {
        let refuse =
            |found: String, advice| Err(fault_at(root, ReadProblem::Unsupported { found, advice }));
        let is_compressed = match root.attribute("compressor") {
            None | Some("") => false,
            Some("vtkZLibDataCompressor") => true,
            Some(other) => {
                let advice =
                    "in ParaView save it with \"Compressor Type\" set to \"None\" or \"ZLib\"";
                let other = shorten(other.as_bytes());
                return refuse(format!("VTK data compressed by `{other}`"), advice);
            }
        };
        let header = match root.attribute("header_type") {
            Some("UInt64") => 8,
            Some("UInt32") | None => 4,
            Some(other) => {
                let advice = "known are UInt32 and UInt64; export the file again";
                let other = shorten(other.as_bytes());
                return refuse(format!("VTK data with a `header_type` of `{other}`"), advice);
            }
        };
        let is_big_endian = root.attribute("byte_order") == Some("BigEndian");
        Ok(Self { header, is_big_endian, is_compressed, appended, lines })
    }

    /// The bytes of an array that stand behind the XML.
    pub fn appended(&self, node: Node<'_, '_>) -> Result<Cow<'a, [u8]>, Fault> {
        let Some(appended) = self.appended else {
            let what = "element <AppendedData>".to_owned();
            return Err(fault_at(node, ReadProblem::Missing { what }));
        };
        let offset = node.attribute("offset").unwrap_or_default();
        let Some(offset) = parse_word::<usize>(offset.trim().as_bytes()) else {
            return Err(fault_at(node, bad_word("an offset of appended data", offset.as_bytes())));
        };
        let rest = appended.bytes.get(offset..).ok_or_else(|| cut(node))?;
        if !appended.is_base64 {
            let (data, length) = self.unpack(node, Cow::Borrowed(rest))?;
            appended.take(node, length)?;
            return Ok(data);
        }
        // The array ends where the next one begins.
        let next = appended.offsets.partition_point(|&other| other <= offset);
        let end = appended.offsets.get(next);
        let rest = end.and_then(|end| rest.get(..end - offset)).unwrap_or(rest);
        appended.take(node, rest.len())?;
        Ok(self.unpack(node, Cow::Owned(decode(node, rest)?))?.0)
    }

    /// The bytes of an array that stand in its element.
    pub fn inline(&self, node: Node<'_, '_>) -> Result<Vec<u8>, Fault> {
        let text: String = node.children().filter(Node::is_text).filter_map(|n| n.text()).collect();
        let bytes = decode(node, text.as_bytes())?;
        Ok(self.unpack(node, Cow::Owned(bytes))?.0.into_owned())
    }

    /// The data behind the numbers in front of them, and how many bytes both are in the file.
    fn unpack<'b>(
        &self,
        node: Node<'_, '_>,
        bytes: Cow<'b, [u8]>,
    ) -> Result<(Cow<'b, [u8]>, usize), Fault> {
        // Programs write no bytes at all for an array without entries.
        if bytes.is_empty() {
            return Ok((bytes, 0));
        }
        if !self.is_compressed {
            let length = self.number(node, &bytes, 0)?;
            let end = self.header.checked_add(length).filter(|end| *end <= bytes.len());
            let end = end.ok_or_else(|| cut(node))?;
            let data = match bytes {
                Cow::Borrowed(bytes) => Cow::Borrowed(&bytes[self.header..end]),
                Cow::Owned(mut bytes) => {
                    bytes.truncate(end);
                    bytes.drain(..self.header);
                    Cow::Owned(bytes)
                }
            };
            return Ok((data, end));
        }
        let blocks = self.number(node, &bytes, 0)?;
        if blocks == 0 {
            return Ok((Cow::Borrowed(&[]), self.header));
        }
        let (whole, last) = (self.number(node, &bytes, 1)?, self.number(node, &bytes, 2)?);
        let front = blocks.checked_add(3).and_then(|count| count.checked_mul(self.header));
        let mut rest = front.and_then(|front| bytes.get(front..)).ok_or_else(|| cut(node))?;
        let mut data = Vec::new();
        // One for all blocks: it is large, and they may be many.
        let mut decoder = ZlibDecoder::new(&[][..]);
        for block in 0..blocks {
            let size = self.number(node, &bytes, 3 + block)?;
            let (packed, after) = rest.split_at_checked(size).ok_or_else(|| cut(node))?;
            rest = after;
            let wanted = if block + 1 == blocks && last > 0 { last } else { whole };
            let before = data.len();
            // No more than was announced, and memory grows with what really comes.
            decoder.reset(packed);
            let read = decoder.by_ref().take(wanted as u64).read_to_end(&mut data);
            if read.is_err() || data.len() - before != wanted {
                let found = format!("{} of {wanted} bytes in block {block}", data.len() - before);
                let expected = "data that zlib can unpack";
                return Err(fault_at(node, bad_word(expected, found.as_bytes())));
            }
        }
        let length = bytes.len() - rest.len();
        Ok((Cow::Owned(data), length))
    }

    /// One of the numbers in front of an array.
    fn number(&self, node: Node<'_, '_>, bytes: &[u8], index: usize) -> Result<usize, Fault> {
        let start = index.checked_mul(self.header).ok_or_else(|| cut(node))?;
        let word = bytes.get(start..).and_then(|rest| rest.get(..self.header));
        let word = word.ok_or_else(|| cut(node))?;
        let join = |sum: u64, &byte: &u8| sum << 8 | u64::from(byte);
        let value = match self.is_big_endian {
            true => word.iter().fold(0, join),
            false => word.iter().rev().fold(0, join),
        };
        usize::try_from(value).map_err(|_| cut(node))
    }
}

fn cut(node: Node) -> Fault {
    let name = shorten(node.attribute("Name").unwrap_or("points").as_bytes());
    let reading = format!("array `{name}`");
    fault_at(node, ReadProblem::UnexpectedEnd { reading })
}

/// Base64 in which blanks and ends may stand anywhere.
fn decode(node: Node, text: &[u8]) -> Result<Vec<u8>, Fault> {
    let text: Vec<u8> = text.iter().copied().filter(|b| !b.is_ascii_whitespace()).collect();
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let mut rest = &text[..];
    while !rest.is_empty() {
        let padding = rest.iter().position(|&byte| byte == b'=').unwrap_or(rest.len());
        // Behind the four letters of which it is one, even where it is the first.
        let end = (padding / 4 * 4 + 4).min(rest.len());
        let (part, after) = rest.split_at(end);
        STANDARD.decode_vec(part, &mut bytes).map_err(|error| {
            let found = error.to_string();
            fault_at(node, bad_word("data in Base64", found.as_bytes()))
        })?;
        rest = after;
    }
    Ok(bytes)
}
