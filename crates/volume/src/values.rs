//! Types of numbers, in both byte orders.

use crate::collect::Values;
use crate::error::VolumeProblem;
use crate::source::{Part, Source};

/// Which byte of a number comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ByteOrder {
    Little,
    Big,
}

/// How a value is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ValueType {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F32,
    F64,
}

impl ValueType {
    /// Bytes of a value.
    pub fn size(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }

    /// Hands out the values of a run of bytes. Whole numbers beyond 2^53 are rounded, which changes
    /// no label: labels end at 65535.
    pub fn decode(self, order: ByteOrder, bytes: &[u8], each: impl FnMut(f64)) {
        macro_rules! numbers {
            ($type:ty) => {{
                let chunks = bytes.as_chunks::<{ size_of::<$type>() }>().0.iter();
                match order {
                    ByteOrder::Little => {
                        chunks.map(|&b| <$type>::from_le_bytes(b) as f64).for_each(each)
                    }
                    ByteOrder::Big => {
                        chunks.map(|&b| <$type>::from_be_bytes(b) as f64).for_each(each)
                    }
                }
            }};
        }
        match self {
            Self::U8 => numbers!(u8),
            Self::I8 => numbers!(i8),
            Self::U16 => numbers!(u16),
            Self::I16 => numbers!(i16),
            Self::U32 => numbers!(u32),
            Self::I32 => numbers!(i32),
            Self::U64 => numbers!(u64),
            Self::I64 => numbers!(i64),
            Self::F32 => numbers!(f32),
            Self::F64 => numbers!(f64),
        }
    }
}

/// Reads all values of an image; memory grows with the bytes that are really there. True where the
/// file goes on behind them.
pub(crate) fn read_values(
    mut source: Source<'_>,
    value_type: ValueType,
    order: ByteOrder,
    values: &mut Values,
) -> Result<bool, VolumeProblem> {
    // A multiple of each size.
    const CHUNK: u64 = 1 << 16;
    let size = value_type.size();
    let mut part = Part::new("the voxels", values.announced().saturating_mul(size as u64));
    let mut buffer = vec![0; CHUNK as usize];
    while part.found < part.needed {
        let count = (part.needed - part.found).min(CHUNK) as usize;
        let bytes = &mut buffer[..count];
        source.take(&mut part, bytes)?;
        values.reserve(count / size)?;
        value_type.decode(order, bytes, |value| values.push(value));
    }
    source.goes_on(&part)
}
