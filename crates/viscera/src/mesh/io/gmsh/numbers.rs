//! Numbers of a Gmsh file: words of lines, or bytes as they are in memory.

use crate::mesh::io::error::{Fault, Place, ReadProblem};
use crate::mesh::io::lines::{Line, Lines, Words, bad_word};
use crate::mesh::io::text::shorten;

/// How numbers stand in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Coding {
    Text,
    /// True where the bytes of a number are in the other order than those of the file's writer.
    Binary {
        is_swapped: bool,
    },
}

/// Goes through a file.
pub(super) struct Numbers<'a> {
    lines: Lines<'a>,
    total: usize,
    pub coding: Coding,
    /// Bytes of a "size" in binary files.
    pub size_bytes: usize,
    words: Option<Words<'a>>,
    section: &'a [u8],
}

impl<'a> Numbers<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self {
            lines: Lines::new(bytes),
            total: bytes.len(),
            coding: Coding::Text,
            size_bytes: 8,
            words: None,
            section: b"",
        }
    }

    pub fn is_binary(&self) -> bool {
        self.coding != Coding::Text
    }

    /// The next line of text that is not blank.
    pub fn line(&mut self) -> Option<Line<'a>> {
        self.lines.next()
    }

    /// Enters a section, whose name its faults tell.
    pub fn enter(&mut self, section: &'a [u8]) {
        self.section = section;
    }

    /// Where the next number stands.
    pub fn place(&self) -> Place {
        match self.coding {
            Coding::Text => Place::Line(self.lines.number()),
            Coding::Binary { .. } => Place::Byte(self.total - self.lines.bytes_left()),
        }
    }

    pub fn fault(&self, problem: ReadProblem) -> Fault {
        Fault { place: Some(self.place()), problem }
    }

    pub fn bytes_left(&self) -> usize {
        self.lines.bytes_left()
    }

    /// The problem of a file that ends inside a section.
    pub fn cut_short(&self) -> Fault {
        let reading = format!("${}", shorten(self.section));
        self.fault(ReadProblem::UnexpectedEnd { reading })
    }

    /// Begins a record: a line in text.
    pub fn record(&mut self) -> Result<(), Fault> {
        if self.coding == Coding::Text {
            let line = self.lines.next().ok_or_else(|| self.cut_short())?;
            self.words = Some(line.words());
        }
        Ok(())
    }

    fn word<T: std::str::FromStr>(&mut self, expected: &'static str) -> Result<T, Fault> {
        match &mut self.words {
            Some(words) => words.parse(expected),
            None => Err(self.fault(bad_word(expected, b""))),
        }
    }

    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], Fault> {
        let mut bytes: [u8; N] = match self.lines.bytes(N).and_then(|b| b.try_into().ok()) {
            Some(bytes) => bytes,
            None => return Err(self.cut_short()),
        };
        if self.coding == (Coding::Binary { is_swapped: true }) {
            bytes.reverse();
        }
        Ok(bytes)
    }

    /// A whole number of four bytes.
    pub fn whole(&mut self, expected: &'static str) -> Result<i64, Fault> {
        if self.is_binary() {
            return Ok(i64::from(i32::from_le_bytes(self.bytes()?)));
        }
        self.word(expected)
    }

    /// A whole number of four bytes that is 0 or more.
    pub fn natural(&mut self, expected: &'static str) -> Result<u64, Fault> {
        if self.is_binary() {
            let value = self.whole(expected)?;
            return u64::try_from(value)
                .map_err(|_| self.fault(bad_word(expected, value.to_string().as_bytes())));
        }
        self.word(expected)
    }

    /// A number that counts something, or names an element or vertex of version 4.1.
    pub fn size(&mut self, expected: &'static str) -> Result<u64, Fault> {
        match (self.is_binary(), self.size_bytes) {
            (false, _) => self.word(expected),
            (true, 4) => Ok(u64::from(u32::from_le_bytes(self.bytes()?))),
            (true, _) => Ok(u64::from_le_bytes(self.bytes()?)),
        }
    }

    pub fn float(&mut self, expected: &'static str) -> Result<f64, Fault> {
        if self.is_binary() {
            return Ok(f64::from_le_bytes(self.bytes()?));
        }
        self.word(expected)
    }

    /// The rest of a record does not matter; `bytes` in binary files.
    pub fn pass_over(&mut self, bytes: usize) -> Result<(), Fault> {
        if self.is_binary() && self.lines.bytes(bytes).is_none() {
            return Err(self.cut_short());
        }
        Ok(())
    }

    /// A count that the rest of the file can hold: entries of at least so many bytes, in text and in binary files.
    pub fn check_count(
        &self,
        what: &'static str,
        claimed: u64,
        shortest: [usize; 2],
    ) -> Result<usize, Fault> {
        let bytes_left = self.bytes_left();
        let shortest = shortest[usize::from(self.is_binary())];
        match usize::try_from(claimed) {
            Ok(count) if count <= bytes_left / shortest => Ok(count),
            _ => Err(self.fault(ReadProblem::TooManyClaimed { what, claimed, bytes_left })),
        }
    }

    /// Passes over everything up to the end of the section, which its data may not hold.
    pub fn skip_section(&mut self, section: &'a [u8]) -> Result<(), Fault> {
        self.section = section;
        for line in self.lines.by_ref() {
            if is_end_of(line, section) {
                return Ok(());
            }
        }
        Err(self.cut_short())
    }

    /// The end of a section must follow its last entry.
    pub fn expect_end(&mut self) -> Result<(), Fault> {
        let line = self.lines.next().ok_or_else(|| self.cut_short())?;
        if is_end_of(line, self.section) {
            return Ok(());
        }
        // At the very end of a file, half an end mark means a cut rather than a wrong count.
        if self.lines.bytes_left() == 0 && line.text.starts_with(b"$") {
            return Err(self.cut_short());
        }
        let problem = bad_word("the end of the section (its count may be wrong)", line.text);
        Err(if self.is_binary() { self.fault(problem) } else { line.fault(problem) })
    }
}

fn is_end_of(line: Line, section: &[u8]) -> bool {
    [&b"$END"[..], &b"$End"[..]].iter().any(|end| line.text.strip_prefix(*end) == Some(section))
}
