//! Text as numbered lines of words, straight from bytes: comments may be in any encoding.

use super::error::{Fault, ReadProblem};
use super::text::shorten;

/// Goes through a text line by line.
#[derive(Clone)]
pub(super) struct Lines<'a> {
    rest: &'a [u8],
    number: usize,
}

/// One line and its number, counting from 1.
#[derive(Clone, Copy)]
pub(super) struct Line<'a> {
    pub number: usize,
    pub text: &'a [u8],
}

impl<'a> Lines<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes, number: 0 }
    }

    /// How many bytes have not been handed out.
    pub fn bytes_left(&self) -> usize {
        self.rest.len()
    }

    /// The next bytes as they are, beginning right behind the last line handed out.
    pub fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.rest.split_at_checked(count)?;
        self.rest = rest;
        Some(taken)
    }

    /// The number of the last line handed out.
    pub fn number(&self) -> usize {
        self.number
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = Line<'a>;

    /// The next line that is not blank, without blanks at its ends.
    fn next(&mut self) -> Option<Line<'a>> {
        while !self.rest.is_empty() {
            let end = self.rest.iter().position(|&byte| byte == b'\n');
            let (line, rest) = match end {
                Some(end) => (&self.rest[..end], &self.rest[end + 1..]),
                None => (self.rest, &self.rest[self.rest.len()..]),
            };
            self.rest = rest;
            self.number += 1;
            let text = line.trim_ascii();
            if !text.is_empty() {
                return Some(Line { number: self.number, text });
            }
        }
        None
    }
}

impl<'a> Line<'a> {
    pub fn words(&self) -> Words<'a> {
        Words { rest: self.text, line: self.number }
    }

    pub fn fault(&self, problem: ReadProblem) -> Fault {
        Fault::at(self.number, problem)
    }
}

/// Goes through the words of a line.
#[derive(Clone)]
pub(super) struct Words<'a> {
    rest: &'a [u8],
    line: usize,
}

impl<'a> Iterator for Words<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        let text = self.rest.trim_ascii_start();
        if text.is_empty() {
            return None;
        }
        let end = text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len());
        let (word, rest) = text.split_at(end);
        self.rest = rest;
        Some(word)
    }
}

impl Words<'_> {
    /// The next word as a number, or a fault that says what was expected.
    pub fn parse<T: std::str::FromStr>(&mut self, expected: &'static str) -> Result<T, Fault> {
        let word = self.next().unwrap_or_default();
        parse_word(word).ok_or_else(|| Fault::at(self.line, bad_word(expected, word)))
    }
}

/// A word as a number.
pub(super) fn parse_word<T: std::str::FromStr>(word: &[u8]) -> Option<T> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// The problem of a word in the wrong place.
pub(super) fn bad_word(expected: &'static str, found: &[u8]) -> ReadProblem {
    ReadProblem::BadWord { expected, found: shorten(found) }
}

/// True if the bytes hold a word somewhere.
pub(super) fn holds(bytes: &[u8], word: &[u8]) -> bool {
    bytes.windows(word.len()).any(|window| window == word)
}
