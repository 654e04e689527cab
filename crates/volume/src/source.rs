//! Bytes as they are, or inflated as far as they are asked for: a stream that would inflate to
//! terabytes costs what is read of it.

use std::io::{ErrorKind, Read};

use flate2::bufread::GzDecoder;

use crate::error::VolumeProblem;

/// What a gzip stream (by deflate) begins with.
pub(crate) const GZIP_START: &[u8] = b"\x1f\x8b\x08";

/// Where bytes come from.
pub(crate) enum Source<'a> {
    Plain(&'a [u8]),
    Gzip(Box<GzDecoder<&'a [u8]>>),
}

/// A part of the file while it is read: how many bytes it needs, how many came.
#[derive(Clone, Copy)]
pub(crate) struct Part {
    pub reading: &'static str,
    pub needed: u64,
    pub found: u64,
}

impl Part {
    pub fn new(reading: &'static str, needed: u64) -> Self {
        Self { reading, needed, found: 0 }
    }
}

impl<'a> Source<'a> {
    pub fn plain(bytes: &'a [u8]) -> Self {
        Self::Plain(bytes)
    }

    pub fn gzip(bytes: &'a [u8]) -> Self {
        Self::Gzip(Box::new(GzDecoder::new(bytes)))
    }

    pub fn is_gzip(&self) -> bool {
        matches!(self, Self::Gzip(_))
    }

    /// The next bytes of a part, all that the buffer holds.
    pub fn take(&mut self, part: &mut Part, buffer: &mut [u8]) -> Result<(), VolumeProblem> {
        let Part { reading, needed, .. } = *part;
        // Missing data is an error before any of it is read.
        if let Self::Plain(bytes) = self
            && (bytes.len() as u64) < needed - part.found.min(needed)
        {
            let found = part.found + bytes.len() as u64;
            return Err(VolumeProblem::Truncated { reading, needed, found });
        }
        let mut filled = 0;
        while filled < buffer.len() {
            match self.read_some(&mut buffer[filled..]) {
                Ok(0) => {
                    let found = part.found + filled as u64;
                    return Err(VolumeProblem::Truncated { reading, needed, found });
                }
                Ok(count) => filled += count,
                Err(error) if error.kind() == ErrorKind::UnexpectedEof => {
                    let found = part.found + filled as u64;
                    return Err(VolumeProblem::GzipCut { reading, needed, found });
                }
                Err(error) => {
                    let reason = error.to_string();
                    return Err(VolumeProblem::GzipCorrupt { reading, reason });
                }
            }
        }
        part.found += filled as u64;
        Ok(())
    }

    /// Passes over the bytes of a part.
    pub fn skip(&mut self, part: &mut Part) -> Result<(), VolumeProblem> {
        let mut buffer = [0; 4096];
        while part.found < part.needed {
            let count = (part.needed - part.found).min(buffer.len() as u64) as usize;
            self.take(part, &mut buffer[..count])?;
        }
        Ok(())
    }

    /// Looks behind the last byte that was needed: gzip has its checksum there. True where the file
    /// goes on; then the checksum lies too far away and is not compared.
    pub fn goes_on(mut self, part: &Part) -> Result<bool, VolumeProblem> {
        const LOOKED_AT: usize = 1 << 16;
        let mut buffer = [0; 4096];
        let mut looked = 0;
        while looked < LOOKED_AT {
            let Part { reading, needed, found } = *part;
            match self.read_some(&mut buffer) {
                Ok(0) => return Ok(looked > 0),
                Ok(count) => looked += count,
                Err(error) if error.kind() == ErrorKind::UnexpectedEof => {
                    return Err(VolumeProblem::GzipCut { reading, needed, found });
                }
                Err(error) => {
                    let reason = error.to_string();
                    return Err(VolumeProblem::GzipCorrupt { reading, reason });
                }
            }
        }
        Ok(true)
    }

    /// Some bytes, none at the end. A gzip file may be several streams, one after the other.
    fn read_some(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        match self {
            Self::Plain(bytes) => bytes.read(buffer),
            Self::Gzip(decoder) => loop {
                let count = decoder.read(buffer)?;
                let rest = *decoder.get_ref();
                if count > 0 || buffer.is_empty() || !rest.starts_with(GZIP_START) {
                    return Ok(count);
                }
                decoder.reset(rest);
            },
        }
    }
}
