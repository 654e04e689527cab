//! A simulation as bytes: what hands had done to it, as text for its scene file, and what the library saves.

use crate::fault::{Class, error};
use crc::{CRC_32_ISO_HDLC, Crc};
use pyo3::PyResult;
use viscera::scalar::Real;
use viscera::simulation::Simulation;

const MAGIC: &[u8; 8] = b"viscera\x01";

/// What the library saves has a checksum of its own.
const CHECKSUM: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// A simulation as bytes.
pub fn of<S: Real>(simulation: &Simulation<S>) -> Vec<u8> {
    pack(&simulation.live().text(simulation.scene()), &simulation.save())
}

/// Both parts as bytes: length and checksum of the first, then both.
fn pack(hands: &str, saved: &[u8]) -> Vec<u8> {
    let length = (hands.len() as u64).to_le_bytes();
    let checksum = CHECKSUM.checksum(hands.as_bytes()).to_le_bytes();
    [MAGIC, &length[..], &checksum, hands.as_bytes(), saved].concat()
}

/// Both parts of a snapshot.
pub fn unpack(bytes: &[u8]) -> PyResult<(&str, &[u8])> {
    let Some(rest) = bytes.strip_prefix(MAGIC) else {
        let message = "this is no snapshot; give bytes that Simulation.save() returned";
        return Err(error(Class::Snapshot, message));
    };
    split(rest).ok_or_else(|| {
        let message = "the snapshot is damaged or incomplete; save it again, or run the scene from its beginning";
        error(Class::Snapshot, message)
    })
}

fn split(rest: &[u8]) -> Option<(&str, &[u8])> {
    let (length, rest) = rest.split_first_chunk::<8>()?;
    let (checksum, rest) = rest.split_first_chunk::<4>()?;
    let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
    let (hands, saved) = rest.split_at_checked(length)?;
    let is_whole = CHECKSUM.checksum(hands) == u32::from_le_bytes(*checksum);
    let hands = std::str::from_utf8(hands).ok()?;
    is_whole.then_some((hands, saved))
}
