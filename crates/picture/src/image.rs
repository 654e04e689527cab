//! A picture in memory and its PNG file.

use crate::error::PictureError;

/// Longest side of a picture [pixels]: four times a 4K screen's would need a gigabyte of samples.
pub(crate) const MAX_SIDE: u32 = 4096;

/// Width and height of a picture [pixels].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageSize {
    width: u32,
    height: u32,
}

impl ImageSize {
    /// A size that can be drawn: each side 16 to 4096 pixels.
    pub fn new(width: u32, height: u32) -> Result<Self, PictureError> {
        let sides = 16..=MAX_SIDE;
        if !sides.contains(&width) || !sides.contains(&height) {
            return Err(PictureError::Size { width, height });
        }
        Ok(Self { width, height })
    }

    /// Width [pixels].
    pub fn width(self) -> u32 {
        self.width
    }

    /// Height [pixels].
    pub fn height(self) -> u32 {
        self.height
    }
}

/// A picture: sRGB, three bytes a pixel, rows from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    size: ImageSize,
    pixels: Vec<[u8; 3]>,
}

impl Image {
    /// A picture of one colour.
    pub fn filled(size: ImageSize, srgb: [u8; 3]) -> Self {
        Self { size, pixels: vec![srgb; size.width as usize * size.height as usize] }
    }

    /// A picture of these sRGB values, shape [height * width], rows from the top; nothing where their
    /// number is another.
    pub fn from_pixels(size: ImageSize, pixels: Vec<[u8; 3]>) -> Option<Self> {
        let count = size.width as usize * size.height as usize;
        (pixels.len() == count).then_some(Self { size, pixels })
    }

    /// Pictures of one size in rows of so many.
    pub fn tiled(images: &[Self], columns: usize) -> Result<Self, PictureError> {
        let columns = columns.clamp(1, images.len().max(1));
        let one = images.first().map_or(ImageSize { width: 0, height: 0 }, |image| image.size);
        let rows = images.len().div_ceil(columns);
        let size = ImageSize::new(
            one.width.saturating_mul(columns as u32),
            one.height.saturating_mul(rows as u32),
        )?;
        let mut tiled = Self::filled(size, [255; 3]);
        for (index, image) in images.iter().enumerate() {
            if image.size != one {
                return Err(PictureError::UnequalSizes { index });
            }
            let left = (index % columns) * one.width as usize;
            let top = (index / columns) * one.height as usize;
            for (row, pixels) in image.pixels.chunks(one.width as usize).enumerate() {
                let begin = (top + row) * size.width as usize + left;
                tiled.pixels[begin..begin + pixels.len()].copy_from_slice(pixels);
            }
        }
        Ok(tiled)
    }

    /// Width and height.
    pub fn size(&self) -> ImageSize {
        self.size
    }

    /// sRGB values, shape [height * width], rows from the top.
    pub fn pixels(&self) -> &[[u8; 3]] {
        &self.pixels
    }

    pub(crate) fn pixels_mut(&mut self) -> &mut [[u8; 3]] {
        &mut self.pixels
    }

    /// Lays a colour over a pixel; `alpha` 0 leaves the pixel, 1 replaces it. Pixels outside the
    /// picture are ignored. Mixing sRGB values keeps dark letters on a light ground from thinning.
    pub(crate) fn blend(&mut self, x: i32, y: i32, srgb: [u8; 3], alpha: f32) {
        let (width, height) = (self.size.width as i32, self.size.height as i32);
        if x < 0 || y < 0 || x >= width || y >= height {
            return;
        }
        let pixel = &mut self.pixels[y as usize * width as usize + x as usize];
        let alpha = alpha.clamp(0.0, 1.0);
        for c in 0..3 {
            let (under, over) = (f32::from(pixel[c]), f32::from(srgb[c]));
            pixel[c] = (under + (over - under) * alpha + 0.5) as u8;
        }
    }
}

/// The bytes of a PNG file.
pub fn write_png(image: &Image) -> Result<Vec<u8>, PictureError> {
    let failed =
        |e: png::EncodingError| PictureError::Encoding { format: "png", reason: e.to_string() };
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, image.size.width, image.size.height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(image.pixels.as_flattened()).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}
