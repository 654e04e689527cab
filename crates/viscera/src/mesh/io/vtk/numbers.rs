//! Numbers of a legacy VTK file: words, or bytes in big-endian order.

use crate::mesh::io::error::{Fault, Place, ReadProblem};
use crate::mesh::io::lines::{Line, Lines, Words, bad_word, parse_word};

/// A type of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Kind {
    bytes: usize,
    is_float: bool,
    is_signed: bool,
}

impl Kind {
    const fn new(bytes: usize, is_float: bool, is_signed: bool) -> Self {
        Self { bytes, is_float, is_signed }
    }

    /// Numbers that count, of files before version 5.
    pub const INT: Self = Self::new(4, false, true);
    pub const BYTE: Self = Self::new(1, false, false);

    pub fn is_whole(self) -> bool {
        !self.is_float
    }

    /// By its name in files. Longs are of eight bytes, as on most machines that write them.
    pub fn named(word: &[u8]) -> Option<Self> {
        Some(match word.to_ascii_lowercase().as_slice() {
            b"float" => Self::new(4, true, true),
            b"double" => Self::new(8, true, true),
            b"char" | b"signed_char" => Self::new(1, false, true),
            b"unsigned_char" => Self::BYTE,
            b"short" => Self::new(2, false, true),
            b"unsigned_short" => Self::new(2, false, false),
            b"int" => Self::INT,
            b"unsigned_int" => Self::new(4, false, false),
            b"long" | b"vtkidtype" | b"vtktypeint64" => Self::new(8, false, true),
            b"unsigned_long" | b"vtktypeuint64" => Self::new(8, false, false),
            _ => return None,
        })
    }
}

/// Goes through a file.
pub(super) struct Numbers<'a> {
    lines: Lines<'a>,
    words: Option<Words<'a>>,
    total: usize,
    pub is_binary: bool,
    /// What is being read.
    pub reading: &'static str,
}

impl<'a> Numbers<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        let lines = Lines::new(bytes);
        Self { lines, words: None, total: bytes.len(), is_binary: false, reading: "its header" }
    }

    /// The next line that is not blank. What is left of the one before does not matter.
    pub fn line(&mut self) -> Option<Line<'a>> {
        self.words = None;
        self.lines.next()
    }

    /// Whether the next line begins with a keyword.
    pub fn starts_with(&self, keyword: &[u8]) -> bool {
        let mut ahead = self.lines.clone();
        let word = ahead.next().and_then(|line| line.words().next());
        word.is_some_and(|word| word.eq_ignore_ascii_case(keyword))
    }

    /// The type of an array whose name stands on a line of its own.
    pub fn array_kind(&mut self, keyword: &'static [u8]) -> Result<Kind, Fault> {
        let line = self.line().ok_or_else(|| self.cut_short())?;
        let mut words = line.words();
        if !words.next().is_some_and(|word| word.eq_ignore_ascii_case(keyword)) {
            return Err(line.fault(bad_word("the offsets or corners of cells", line.text)));
        }
        let kind = words.next().and_then(Kind::named);
        kind.ok_or_else(|| line.fault(bad_word("a type such as vtktypeint64", line.text)))
    }

    /// Where the next number stands.
    pub fn place(&self) -> Place {
        match self.is_binary {
            true => Place::Byte(self.total - self.lines.bytes_left()),
            false => Place::Line(self.lines.number()),
        }
    }

    pub fn fault(&self, problem: ReadProblem) -> Fault {
        Fault { place: Some(self.place()), problem }
    }

    pub fn cut_short(&self) -> Fault {
        self.fault(ReadProblem::UnexpectedEnd { reading: self.reading.to_owned() })
    }

    /// A count of numbers that the rest of the file can hold.
    pub fn check_count(
        &self,
        what: &'static str,
        claimed: u64,
        kind: Kind,
    ) -> Result<usize, Fault> {
        let bytes_left = self.lines.bytes_left();
        // A digit and a blank, where numbers are words.
        let shortest = if self.is_binary { kind.bytes } else { 2 };
        match usize::try_from(claimed) {
            Ok(count) if count <= (bytes_left + 1) / shortest => Ok(count),
            _ => Err(self.fault(ReadProblem::TooManyClaimed { what, claimed, bytes_left })),
        }
    }

    /// The next word, on whatever line.
    fn word(&mut self) -> Result<&'a [u8], Fault> {
        loop {
            if let Some(word) = self.words.as_mut().and_then(Iterator::next) {
                return Ok(word);
            }
            let line = self.lines.next().ok_or_else(|| self.cut_short())?;
            self.words = Some(line.words());
        }
    }

    /// Calls `take` with each of so many numbers and with their place.
    fn each<T>(
        &mut self,
        count: usize,
        kind: Kind,
        (expected, parse): (&'static str, impl Fn(&[u8]) -> Option<T>),
        decode: impl Fn(&[u8], Kind) -> T,
        mut take: impl FnMut(T, Place),
    ) -> Result<(), Fault> {
        if self.is_binary {
            let start = self.total - self.lines.bytes_left();
            let bytes = count.checked_mul(kind.bytes).and_then(|count| self.lines.bytes(count));
            let bytes = bytes.ok_or_else(|| self.cut_short())?;
            for (index, number) in bytes.chunks_exact(kind.bytes).enumerate() {
                take(decode(number, kind), Place::Byte(start + index * kind.bytes));
            }
            return Ok(());
        }
        for _ in 0..count {
            let word = self.word()?;
            let number = parse(word).ok_or_else(|| self.fault(bad_word(expected, word)))?;
            take(number, self.place());
        }
        Ok(())
    }

    pub fn floats(
        &mut self,
        (count, kind): (usize, Kind),
        expected: &'static str,
        mut take: impl FnMut(f64, Place),
    ) -> Result<(), Fault> {
        let decode = |bytes: &[u8], kind: Kind| match (kind.is_float, bytes) {
            (true, &[a, b, c, d]) => f64::from(f32::from_be_bytes([a, b, c, d])),
            (true, _) => f64::from_bits(join(bytes)),
            _ => whole(bytes, kind) as f64,
        };
        self.each(count, kind, (expected, parse_word), decode, &mut take)
    }

    /// Numbers that have to be whole, whatever type they are of.
    pub fn wholes(
        &mut self,
        (count, kind): (usize, Kind),
        expected: &'static str,
        mut take: impl FnMut(i64, Place),
    ) -> Result<(), Fault> {
        self.each(count, kind, (expected, parse_word), whole, &mut take)
    }

    /// Texts: each on a line, or behind its length.
    pub fn texts(&mut self, claimed: u64) -> Result<Vec<Vec<u8>>, Fault> {
        // An empty one takes a byte.
        let count = self.check_count("texts", claimed, Kind::BYTE)?;
        let mut texts = Vec::new();
        for _ in 0..count {
            let text = if self.is_binary {
                let length = self.text_length()?;
                self.lines.bytes(length).ok_or_else(|| self.cut_short())?
            } else {
                self.line().ok_or_else(|| self.cut_short())?.text
            };
            texts.push(text.to_vec());
        }
        Ok(texts)
    }

    /// The two highest bits of a length's first byte say how many bytes it has.
    fn text_length(&mut self) -> Result<usize, Fault> {
        let first = self.lines.bytes(1).ok_or_else(|| self.cut_short())?[0];
        let more = match first >> 6 {
            3 => 0,
            2 => 1,
            1 => 3,
            _ => 7,
        };
        let rest = self.lines.bytes(more).ok_or_else(|| self.cut_short())?;
        let length = join(rest) | u64::from(first & 0x3f) << (8 * more);
        usize::try_from(length).map_err(|_| self.cut_short())
    }

    /// Passes over numbers.
    pub fn skip(&mut self, count: usize, kind: Kind) -> Result<(), Fault> {
        self.floats((count, kind), "a number", |_, _| ())
    }
}

/// Bytes in big-endian order as the lowest bits of a number.
fn join(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0, |sum, &byte| sum << 8 | u64::from(byte))
}

fn whole(bytes: &[u8], kind: Kind) -> i64 {
    let unused = 64 - 8 * bytes.len().clamp(1, 8) as u32;
    let bits = join(bytes) << unused;
    if kind.is_signed { bits as i64 >> unused } else { (bits >> unused) as i64 }
}
