//! The solver's numbering of vertices: neighbours in space get neighbouring numbers, so that what a
//! block of tetrahedra loads lies close together. Connected parts come one after the other, each along a curve
//! through its own extent: where others are changes nothing. The user's numbering stays what it is.

use crate::scalar::Vec3;

/// Two numberings of the same vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Numbering {
    /// The user's number of each of the solver's vertices.
    pub order: Vec<u32>,
    /// The solver's number of each of the user's vertices.
    pub rank: Vec<u32>,
}

/// Bits of each coordinate along the curve.
const BITS: u32 = 16;

impl Numbering {
    /// Sorts vertices by part, then along a Z-order curve through their places [m]; ties keep the user's
    /// order. `part_of` has the part of each vertex, `part_count` how many there are.
    pub fn along_curves(positions: &[Vec3<f64>], part_of: &[u32], part_count: usize) -> Self {
        let nothing = (Vec3::splat(f64::INFINITY), Vec3::splat(f64::NEG_INFINITY));
        let mut extents = vec![nothing; part_count];
        for (p, &part) in positions.iter().zip(part_of) {
            let (low, high) = &mut extents[part as usize];
            (*low, *high) = (low.min(*p), high.max(*p));
        }
        let key = |(p, &part): (&Vec3<f64>, &u32)| {
            let (low, high) = extents[part as usize];
            let size = high - low;
            let extent = size.x.max(size.y).max(size.z).max(f64::MIN_POSITIVE);
            let scale = f64::from((1u32 << BITS) - 1) / extent;
            let cell = (*p - low) * scale;
            let place =
                spread(cell.x as u64) | spread(cell.y as u64) << 1 | spread(cell.z as u64) << 2;
            (part, place)
        };
        let keys: Vec<(u32, u64)> = positions.iter().zip(part_of).map(key).collect();
        let mut order: Vec<u32> = (0..positions.len() as u32).collect();
        order.sort_by_key(|&v| (keys[v as usize], v));
        let mut rank = vec![0; order.len()];
        for (place, &v) in order.iter().enumerate() {
            rank[v as usize] = place as u32;
        }
        Self { order, rank }
    }

    /// The solver's number of one of the user's vertices.
    #[inline]
    pub fn of(&self, vertex: u32) -> usize {
        self.rank[vertex as usize] as usize
    }
}

/// Two zero bits between any two of the lowest [`BITS`].
fn spread(value: u64) -> u64 {
    (0..BITS).fold(0, |spread, bit| spread | (value >> bit & 1) << (3 * bit))
}
