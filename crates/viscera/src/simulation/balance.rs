//! How bodies carry gravity that rest as they are: what was found, in numbers that travel.

use serde::{Deserialize, Serialize};

use crate::scalar::Vec3;
use crate::settings::Elements;

/// How bodies that are to rest under gravity as they are given carry it: their shapes without load, and where springs and ties
/// are without force. [`Assembly::balance`] has what was found; [`Assembly::with_balance`] takes it over, in a program that
/// cannot find it, or need not again.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Balance {
    /// Of the model before, and of gravity: what it was found for.
    pub(super) key: u64,
    pub(super) recovered: bool,
    pub(super) bodies: Vec<BodyBalance>,
    /// Anchors by their numbers, and their places [m].
    pub(super) anchors: Vec<(usize, [f64; 3])>,
    /// Ties by their numbers, and where they are without force.
    pub(super) ties: Rests,
}

/// Ties by their numbers, and where each is without force, see [`crate::contact::Tie::rest`].
pub(super) type Rests = Vec<(usize, [f64; 3])>;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct BodyBalance {
    /// Its number.
    pub body: usize,
    /// Of the body alone, of its holds and of its load.
    pub key: u64,
    /// Without load [m], shape [vertex_count of the body].
    pub shape: Vec<[f64; 3]>,
    /// Vertices that something holds, and its force on them [N].
    pub holding: Vec<(u32, [f64; 3])>,
    /// How far it would sag.
    pub note: String,
}

impl Balance {
    /// As bytes, which every build of this version reads.
    pub fn to_bytes(&self) -> Vec<u8> {
        // Memory takes everything.
        postcard::to_allocvec(self).unwrap_or_default()
    }

    /// Of bytes; nothing where they are none of it.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        postcard::from_bytes(bytes).ok()
    }

    /// A line for each body: how far it would sag.
    pub fn notes(&self) -> impl Iterator<Item = &String> {
        self.bodies.iter().map(|body| &body.note)
    }

    pub(super) fn is_of(&self, elements: Elements) -> bool {
        self.recovered == (elements == Elements::Recovered)
    }
}

/// Another number with each number that is added: FNV-1a.
pub(super) fn hashed(key: u64, numbers: impl IntoIterator<Item = u64>) -> u64 {
    numbers
        .into_iter()
        .fold(key, |key, number| (key ^ number).wrapping_mul(0x0100_0000_01b3).rotate_left(29))
}

pub(super) fn bits(x: Vec3<f64>) -> [u64; 3] {
    x.to_array().map(f64::to_bits)
}
