//! Pixels of a screenshot.

use std::fs;

use super::root;

/// A picture, its lines from the top.
pub struct Picture {
    pub width: usize,
    pub height: usize,
    /// Red, green, blue.
    pixels: Vec<[u8; 3]>,
    png: Vec<u8>,
}

impl Picture {
    pub fn new(png: Vec<u8>) -> Self {
        let mut decoder = png::Decoder::new(std::io::Cursor::new(&png));
        decoder.set_transformations(png::Transformations::normalize_to_color8());
        let mut reader = decoder.read_info().expect("a PNG file");
        let mut buffer = vec![0; reader.output_buffer_size().expect("a size")];
        let info = reader.next_frame(&mut buffer).expect("a picture");
        let channels = info.color_type.samples();
        assert!(channels >= 3, "a screenshot has colours");
        let pixels = buffer.chunks_exact(channels).map(|pixel| [pixel[0], pixel[1], pixel[2]]);
        let (width, height) = (info.width as usize, info.height as usize);
        Self { width, height, pixels: pixels.take(width * height).collect(), png }
    }

    pub fn at(&self, x: usize, y: usize) -> [u8; 3] {
        self.pixels[y * self.width + x]
    }

    /// All pixels with their places.
    pub fn pixels(&self) -> impl Iterator<Item = (usize, usize, [u8; 3])> + '_ {
        self.pixels.iter().enumerate().map(|(i, pixel)| (i % self.width, i / self.width, *pixel))
    }

    /// The share of pixels in a rectangle for which something holds.
    pub fn share(&self, area: [usize; 4], holds: impl Fn([u8; 3]) -> bool) -> f64 {
        let [left, top, width, height] = area;
        let inside = |(x, y, _): &(usize, usize, [u8; 3])| {
            (left..left + width).contains(x) && (top..top + height).contains(y)
        };
        let (mut all, mut held) = (0_usize, 0_usize);
        for (_, _, pixel) in self.pixels().filter(inside) {
            all += 1;
            held += usize::from(holds(pixel));
        }
        held as f64 / all.max(1) as f64
    }

    /// The share of pixels in a rectangle that differ from another picture by more than round-off.
    pub fn difference(&self, other: &Self, area: [usize; 4]) -> f64 {
        assert_eq!((self.width, self.height), (other.width, other.height), "pictures of one size");
        let [left, top, width, height] = area;
        let mut differ = 0_usize;
        for y in top..(top + height).min(self.height) {
            for x in left..(left + width).min(self.width) {
                let (a, b) = (self.at(x, y), other.at(x, y));
                differ += usize::from((0..3).any(|i| a[i].abs_diff(b[i]) > 8));
            }
        }
        differ as f64 / (width * height).max(1) as f64
    }

    /// Keeps it in `target/web/screenshots`, for people.
    pub fn save(&self, name: &str) {
        let folder = root().join("target/web/screenshots");
        fs::create_dir_all(&folder).expect("a folder for screenshots");
        fs::write(folder.join(format!("{name}.png")), &self.png).expect("a screenshot is written");
    }
}
