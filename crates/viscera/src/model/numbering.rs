//! The solver's numbering of vertices: neighbours in space get neighbouring numbers, so that what a
//! block of tetrahedra loads lies close together. Connected parts come one after the other, each along a curve
//! through its own extent: where others are changes nothing. The user's numbering stays what it is.

use crate::scalar::Vec3;
use crate::sorting;

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
            [u64::from(part), z_order([cell.x as u64, cell.y as u64, cell.z as u64])]
        };
        let keys: Vec<[u64; 2]> = positions.iter().zip(part_of).map(key).collect();
        let order = sorting::by_key(0..positions.len() as u32, |v| keys[v as usize]);
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

/// Bits of each coordinate that [`z_order`] takes: three times as many fit into 64.
pub(crate) const Z_ORDER_BITS: u32 = 21;

/// How far along a Z-order curve a cell lies; each coordinate is below 2 to the [`Z_ORDER_BITS`].
pub(crate) fn z_order(cell: [u64; 3]) -> u64 {
    spread(cell[0]) | spread(cell[1]) << 1 | spread(cell[2]) << 2
}

/// Two zero bits between any two of a value of [`Z_ORDER_BITS`].
fn spread(value: u64) -> u64 {
    // Groups of 16 bits move apart, then of 8, 4, 2 and 1.
    let value = (value | value << 32) & 0x001F_0000_0000_FFFF;
    let value = (value | value << 16) & 0x001F_0000_FF00_00FF;
    let value = (value | value << 8) & 0x100F_00F0_0F00_F00F;
    let value = (value | value << 4) & 0x10C3_0C30_C30C_30C3;
    (value | value << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bit_of_a_cell_gets_its_own_place() {
        for bit in 0..Z_ORDER_BITS {
            for axis in 0..3 {
                let mut cell = [0; 3];
                cell[axis] = 1 << bit;
                assert_eq!(z_order(cell), 1 << (3 * bit + axis as u32));
                // All other bits: nothing overlaps.
                let rest = [0, 1, 2].map(|other| cell[other] ^ ((1 << Z_ORDER_BITS) - 1));
                assert_eq!(z_order(rest), z_order(cell) ^ ((1 << (3 * Z_ORDER_BITS)) - 1));
            }
        }
    }
}
