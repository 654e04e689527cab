//! Chunks of a recording: bytes that are there and unchanged, or not.
//!
//! ```text
//! prefix   "viscera\x1c"   format u32   n u8   n bytes: the version that wrote it
//! chunk    length u32   kind u8   checksum of the content u32   checksum of these 9 bytes and all before u32   content
//! ```
//!
//! Numbers are little-endian, checksums CRC-32. The second checksum goes on from that of the chunk before, and the first one
//! from that of the prefix: a chunk that is left out, repeated or of another recording is noticed as an edited one is. Where
//! the file ends within a chunk it was cut off; where a checksum is another, it was changed.

/// What recordings begin with.
pub const MAGIC: &[u8; 8] = b"viscera\x1c";

/// Raised whenever the bytes mean something else.
pub const FORMAT: u32 = 1;

/// Of a chunk before its content.
const HEAD: usize = 13;

/// A chunk's content, by its number in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Scene, files, choices.
    Header = 1,
    /// Frames.
    Frames = 2,
    /// A saved simulation.
    Snapshot = 3,
    /// There is nothing behind.
    End = 4,
}

impl Kind {
    const ALL: [Self; 4] = [Self::Header, Self::Frames, Self::Snapshot, Self::End];

    fn of(byte: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| *kind as u8 == byte)
    }
}

fn checksum(parts: &[&[u8]]) -> u32 {
    let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
    let mut digest = crc.digest();
    parts.iter().for_each(|part| digest.update(part));
    digest.finalize()
}

/// Writes chunks one behind the other.
#[derive(Clone, Debug)]
pub struct Writer {
    /// Of all before the next chunk.
    before: u32,
}

impl Writer {
    /// At the beginning of a file; returns what stands there.
    pub fn begin() -> (Self, Vec<u8>) {
        let version = env!("CARGO_PKG_VERSION").as_bytes();
        let mut bytes = MAGIC.to_vec();
        bytes.extend(FORMAT.to_le_bytes());
        bytes.push(version.len() as u8);
        bytes.extend(version);
        (Self { before: checksum(&[&bytes]) }, bytes)
    }

    /// The next chunk.
    pub fn chunk(&mut self, kind: Kind, content: &[u8]) -> Vec<u8> {
        let mut bytes = (content.len() as u32).to_le_bytes().to_vec();
        bytes.push(kind as u8);
        bytes.extend(checksum(&[content]).to_le_bytes());
        self.before = checksum(&[&self.before.to_le_bytes(), &bytes]);
        bytes.extend(self.before.to_le_bytes());
        bytes.extend(content);
        bytes
    }
}

/// What stands at the beginning of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Prefix<'a> {
    /// Not what recordings begin with.
    Foreign,
    /// It ends too early.
    Cut,
    /// Another format, by this version.
    Other { format: u32, version: String },
    /// This one.
    Known { version: String, chunks: Reader<'a> },
}

/// Reads chunks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    is_first: bool,
    before: u32,
}

/// What comes next in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next<'a> {
    /// A chunk.
    Chunk(Kind, &'a [u8]),
    /// Nothing: the file ends between two chunks.
    Nothing,
    /// It ends within a chunk.
    Cut,
    /// Something was changed.
    Damaged,
}

/// Looks at the beginning of a file.
pub fn prefix(bytes: &[u8]) -> Prefix<'_> {
    let begin = &bytes[..bytes.len().min(MAGIC.len())];
    if !MAGIC.starts_with(begin) {
        return Prefix::Foreign;
    }
    let read = || {
        let (format, rest) = bytes.get(MAGIC.len()..)?.split_first_chunk::<4>()?;
        let (length, rest) = rest.split_first()?;
        let version = rest.get(..usize::from(*length))?;
        Some((u32::from_le_bytes(*format), String::from_utf8_lossy(version).into_owned()))
    };
    let Some((format, version)) = read() else { return Prefix::Cut };
    if format != FORMAT {
        return Prefix::Other { format, version };
    }
    let at = MAGIC.len() + 5 + usize::from(bytes[MAGIC.len() + 4]);
    Prefix::Known {
        version,
        chunks: Reader { bytes, at, is_first: true, before: checksum(&[&bytes[..at]]) },
    }
}

impl<'a> Reader<'a> {
    /// The first byte that the next chunk's checksum alone answers for: its own first one, or of the first chunk the one behind
    /// [`MAGIC`].
    pub fn at(&self) -> usize {
        if self.is_first { MAGIC.len() } else { self.at }
    }

    /// Reads the next chunk.
    pub fn next(&mut self) -> Next<'a> {
        let rest = &self.bytes[self.at..];
        if rest.is_empty() {
            return Next::Nothing;
        }
        let Some((head, rest)) = rest.split_first_chunk::<HEAD>() else { return Next::Cut };
        let word = |from: usize| {
            let bytes = head[from..].first_chunk().copied().unwrap_or_default();
            u32::from_le_bytes(bytes)
        };
        let before = checksum(&[&self.before.to_le_bytes(), &head[..9]]);
        if word(9) != before {
            return Next::Damaged;
        }
        let Some(content) = rest.get(..word(0) as usize) else { return Next::Cut };
        match Kind::of(head[4]) {
            Some(kind) if checksum(&[content]) == word(5) => {
                (self.before, self.is_first) = (before, false);
                self.at += HEAD + content.len();
                Next::Chunk(kind, content)
            }
            _ => Next::Damaged,
        }
    }
}
