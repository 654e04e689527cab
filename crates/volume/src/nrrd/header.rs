//! Lines of the header: `field: value`, `key:=value` and comments, up to an empty line.

use std::collections::BTreeMap;

use crate::error::{Fault, VolumeProblem, bad_field, shorten, unsupported};

/// A header with all names of 3D Slicer's largest segmentations is a hundredth of it.
const LARGEST: usize = 1 << 24;

/// Fields that matter, without the blanks in their names: Teem takes both spellings.
const KNOWN: [&str; 15] = [
    "type",
    "dimension",
    "sizes",
    "encoding",
    "endian",
    "space",
    "spacedimension",
    "spaceunits",
    "spaceorigin",
    "spacedirections",
    "spacings",
    "units",
    "kinds",
    "lineskip",
    "byteskip",
];

/// A field's value and its line, counting from 1.
pub(super) struct Field {
    pub line: usize,
    pub text: String,
}

/// The header of a file.
pub(super) struct Header {
    fields: BTreeMap<&'static str, Field>,
    /// Keys of segments, with escapes resolved.
    pub keys: BTreeMap<String, Field>,
    /// The line of `data file`, where the header has one.
    detached: Option<usize>,
    /// Where data begin, unless the header does not end.
    data: Option<usize>,
}

impl Header {
    pub fn parse(bytes: &[u8]) -> Result<Self, Fault> {
        let mut header =
            Self { fields: BTreeMap::new(), keys: BTreeMap::new(), detached: None, data: None };
        let mut at = 0;
        let mut number = 0;
        while let Some(end) = bytes[at..].iter().position(|&byte| byte == b'\n') {
            let line = bytes[at..at + end].trim_ascii_end();
            at += end + 1;
            number += 1;
            if number == 1 {
                check_magic(line)?;
            } else if line.is_empty() {
                header.data = Some(at);
                return Ok(header);
            } else {
                header.take_line(number, line)?;
            }
            if at > LARGEST {
                let found = format!("a header above {} MiB", LARGEST >> 20);
                return Err(unsupported(found, "remove keys that are not needed").into());
            }
        }
        if number == 0 {
            check_magic(bytes.trim_ascii_end())?;
        } else if !bytes[at..].is_empty() && bytes.len() - at < LARGEST {
            header.take_line(number + 1, bytes[at..].trim_ascii_end())?;
        }
        Ok(header)
    }

    fn take_line(&mut self, line: usize, bytes: &[u8]) -> Result<(), Fault> {
        if bytes.starts_with(b"#") {
            return Ok(());
        }
        let text = String::from_utf8_lossy(bytes);
        let field_end = text.find(": ").unwrap_or(text.len());
        if let Some((key, value)) = text.split_once(":=").filter(|(key, _)| key.len() < field_end) {
            if key.starts_with("Segment") {
                self.keys.insert(key.to_owned(), Field { line, text: unescape(value) });
            }
            return Ok(());
        }
        let Some((name, value)) = text.split_once(':') else {
            let expected = "`field: value`, `key:=value`, or the empty line before the voxels";
            return Err(Fault::at(line, bad_field("header", expected, &text)));
        };
        let name = name.replace(' ', "").to_ascii_lowercase();
        if name == "datafile" {
            self.detached = Some(line);
        }
        if let Some(&name) = KNOWN.iter().find(|known| **known == name) {
            let field = Field { line, text: value.trim().to_owned() };
            if self.fields.insert(name, field).is_some() {
                let expected = "one line of this field";
                return Err(Fault::at(line, bad_field(name, expected, "a second line")));
            }
        }
        Ok(())
    }

    /// A field by its name without blanks.
    pub fn field(&self, name: &'static str) -> Option<&Field> {
        self.fields.get(name)
    }

    /// A field that each file has.
    pub fn needed(&self, name: &'static str) -> Result<&Field, Fault> {
        let advice = "the header is incomplete, export the label map again";
        let missing = VolumeProblem::MissingField { field: name, advice };
        self.field(name).ok_or_else(|| missing.into())
    }

    /// A problem at the line of a field.
    pub fn fault(&self, name: &'static str, problem: VolumeProblem) -> Fault {
        Fault { line: self.field(name).map(|field| field.line), problem }
    }

    /// A header without voxels is no file to read.
    pub fn refuse_detached(&self) -> Result<(), Fault> {
        let Some(line) = self.detached else { return Ok(()) };
        let advice = "save header and voxels as one .nrrd file, for example with 3D Slicer";
        Err(Fault::at(line, unsupported("a header with voxels in another file", advice)))
    }

    /// The bytes behind the header.
    pub fn data<'a>(&self, bytes: &'a [u8]) -> Result<&'a [u8], Fault> {
        let missing = VolumeProblem::MissingField {
            field: "empty line",
            advice: "it stands between header and voxels; the file was cut short, export it again",
        };
        self.data.and_then(|at| bytes.get(at..)).ok_or_else(|| missing.into())
    }
}

fn check_magic(line: &[u8]) -> Result<(), Fault> {
    match line {
        [b'N', b'R', b'R', b'D', b'0', b'0', b'0', b'1'..=b'5'] => Ok(()),
        _ => {
            let found = shorten(&String::from_utf8_lossy(&line[..line.len().min(64)]));
            let problem = bad_field("magic", "NRRD0001 to NRRD0005", found);
            Err(Fault::at(1, problem))
        }
    }
}

/// `\n` stands for the end of a line, `\\` for one backslash.
fn unescape(value: &str) -> String {
    let mut text = String::with_capacity(value.len());
    let mut rest = value.chars();
    while let Some(c) = rest.next() {
        match (c, rest.clone().next()) {
            ('\\', Some('n')) => text.push('\n'),
            ('\\', Some('\\')) => text.push('\\'),
            _ => {
                text.push(c);
                continue;
            }
        }
        rest.next();
    }
    text
}
