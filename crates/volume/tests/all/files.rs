//! Writers of small files, from the documents of the formats and not from the readers.

use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;
use viscera_volume::{LabelMap, Limits, VolumeReport, read};

/// Both ways to order the bytes of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Order {
    Little,
    Big,
}

pub const ORDERS: [Order; 2] = [Order::Little, Order::Big];

/// A number as bytes, in an order.
pub trait Bytes {
    fn bytes(self, order: Order) -> Vec<u8>;
}

macro_rules! bytes {
    ($($type:ty)*) => {
        $(impl Bytes for $type {
            fn bytes(self, order: Order) -> Vec<u8> {
                match order {
                    Order::Little => self.to_le_bytes().to_vec(),
                    Order::Big => self.to_be_bytes().to_vec(),
                }
            }
        })*
    };
}
bytes!(u8 i8 u16 i16 u32 i32 u64 i64 f32 f64);

/// Labels as values of a type: its NIfTI code, its spelling in NRRD, the bytes.
pub fn encoded(labels: &[u16], order: Order) -> Vec<(i16, &'static str, Vec<u8>)> {
    macro_rules! types {
        ($($code:literal $name:literal $type:ty),*) => {
            vec![$((
                $code,
                $name,
                labels.iter().flat_map(|&label| (label as $type).bytes(order)).collect(),
            )),*]
        };
    }
    types!(
        2 "uint8" u8, 256 "signed char" i8, 512 "unsigned short" u16, 4 "int16_t" i16,
        768 "uint" u32, 8 "signed int" i32, 1280 "unsigned long long" u64, 1024 "longlong" i64,
        16 "float" f32, 64 "double" f64
    )
}

/// A NIfTI file. The default has 2 x 3 x 2 voxels of 3 x 2 x 4 mm, an sform, and labels 0 to 11.
#[derive(Clone)]
pub struct Nifti {
    pub second: bool,
    pub order: Order,
    pub dim: [i64; 8],
    pub datatype: i16,
    pub pixdim: [f64; 8],
    pub vox_offset: Option<f64>,
    pub scale: [f64; 2],
    pub units: u8,
    pub qform_code: i16,
    pub sform_code: i16,
    pub quatern: [f64; 3],
    pub qoffset: [f64; 3],
    pub srow: [[f64; 4]; 3],
    pub extensions: Vec<(i32, Vec<u8>)>,
    pub data: Vec<u8>,
    pub magic: Option<&'static [u8]>,
}

impl Default for Nifti {
    fn default() -> Self {
        Self {
            second: false,
            order: Order::Little,
            dim: [3, 2, 3, 2, 1, 1, 1, 1],
            datatype: 2,
            pixdim: [1.0, 3.0, 2.0, 4.0, 1.0, 1.0, 1.0, 1.0],
            vox_offset: None,
            scale: [0.0, 0.0],
            units: 2,
            qform_code: 0,
            sform_code: 1,
            quatern: [0.0; 3],
            qoffset: [0.0; 3],
            srow: [[3.0, 0.0, 0.0, -10.0], [0.0, 2.0, 0.0, 20.0], [0.0, 0.0, 4.0, 30.0]],
            extensions: Vec::new(),
            data: (0..12).collect(),
            magic: None,
        }
    }
}

impl Nifti {
    /// The file, not compressed.
    pub fn file(&self) -> Vec<u8> {
        let mut bytes = if self.second { self.second_header() } else { self.first_header() };
        bytes.extend([u8::from(!self.extensions.is_empty()), 0, 0, 0]);
        for (code, content) in &self.extensions {
            bytes.extend((content.len() as i32 + 8).bytes(self.order));
            bytes.extend(code.bytes(self.order));
            bytes.extend(content);
        }
        bytes.extend(&self.data);
        bytes
    }

    fn data_offset(&self) -> f64 {
        let extensions: usize = self.extensions.iter().map(|(_, content)| content.len() + 8).sum();
        let header = if self.second { 544 } else { 352 };
        self.vox_offset.unwrap_or((header + extensions) as f64)
    }

    fn first_header(&self) -> Vec<u8> {
        let mut header = vec![0; 348];
        let order = self.order;
        let mut put = |at: usize, bytes: Vec<u8>| {
            header[at..at + bytes.len()].copy_from_slice(&bytes);
        };
        put(0, 348_i32.bytes(order));
        for i in 0..8 {
            put(40 + 2 * i, (self.dim[i] as i16).bytes(order));
            put(76 + 4 * i, (self.pixdim[i] as f32).bytes(order));
        }
        put(70, self.datatype.bytes(order));
        put(108, (self.data_offset() as f32).bytes(order));
        put(112, (self.scale[0] as f32).bytes(order));
        put(116, (self.scale[1] as f32).bytes(order));
        put(123, vec![self.units]);
        put(252, self.qform_code.bytes(order));
        put(254, self.sform_code.bytes(order));
        for i in 0..3 {
            put(256 + 4 * i, (self.quatern[i] as f32).bytes(order));
            put(268 + 4 * i, (self.qoffset[i] as f32).bytes(order));
            for j in 0..4 {
                put(280 + 16 * i + 4 * j, (self.srow[i][j] as f32).bytes(order));
            }
        }
        put(344, self.magic.unwrap_or(b"n+1\0").to_vec());
        header
    }

    fn second_header(&self) -> Vec<u8> {
        let mut header = vec![0; 540];
        let order = self.order;
        let mut put = |at: usize, bytes: Vec<u8>| {
            header[at..at + bytes.len()].copy_from_slice(&bytes);
        };
        put(0, 540_i32.bytes(order));
        put(4, self.magic.unwrap_or(b"n+2\0\r\n\x1a\n").to_vec());
        put(12, self.datatype.bytes(order));
        for i in 0..8 {
            put(16 + 8 * i, self.dim[i].bytes(order));
            put(104 + 8 * i, self.pixdim[i].bytes(order));
        }
        put(168, (self.data_offset() as i64).bytes(order));
        put(176, self.scale[0].bytes(order));
        put(184, self.scale[1].bytes(order));
        put(344, i32::from(self.qform_code).bytes(order));
        put(348, i32::from(self.sform_code).bytes(order));
        for i in 0..3 {
            put(352 + 8 * i, self.quatern[i].bytes(order));
            put(376 + 8 * i, self.qoffset[i].bytes(order));
            for j in 0..4 {
                put(400 + 32 * i + 8 * j, self.srow[i][j].bytes(order));
            }
        }
        put(500, i32::from(self.units).bytes(order));
        header
    }
}

/// An NRRD file of these lines and data.
pub fn nrrd(lines: &[&str], data: &[u8]) -> Vec<u8> {
    let mut bytes = format!("NRRD0004\n# made by a test\n{}\n\n", lines.join("\n")).into_bytes();
    bytes.extend(data);
    bytes
}

/// Lines of an NRRD header of bytes, without its encoding and its place.
pub const BASIC: [&str; 3] = ["type: uint8", "dimension: 3", "sizes: 2 3 2"];
/// Lines of the place of [`Nifti::default`], as 3D Slicer writes it.
pub const LPS: [&str; 3] = [
    "space: left-posterior-superior",
    "space directions: (-3,0,0) (0,-2,0) (0,0,4)",
    "space origin: (10,-20,30)",
];

/// Compressed by gzip.
pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// The label map of a file that is in order.
pub fn read_well(bytes: &[u8]) -> (LabelMap, VolumeReport) {
    read("test", bytes, Limits::default()).unwrap_or_else(|error| panic!("{error}"))
}

/// The message of a file that is not.
pub fn message(bytes: &[u8]) -> String {
    match read("test", bytes, Limits::default()) {
        Ok((_, report)) => panic!("read without an error: {report}"),
        Err(error) => error.to_string(),
    }
}
