//! Moving pictures, frame by frame.
//!
//! A frame is shown from its time until that of the next one. A GIF counts hundredths of a second, and players
//! take what is shorter than two of them for a tenth of a second: times are rounded from the beginning, so that
//! no rounding adds up, and a frame whose successor comes too soon gives way to it.
//!
//! A GIF frame has 255 colours and may leave pixels as they were. Everything that already looks
//! right stays: backgrounds, scales and letters cost nothing after the first frame. Where pictures of the whole film are
//! known before ([`Animation::in_colors_of`]), one palette is trained on them; where frames come one by one
//! ([`Animation::new`]), each has a palette of its own, trained only on the pixels that changed.

use std::borrow::Cow;

use color_quant::NeuQuant;

use crate::error::PictureError;
use crate::image::{Image, ImageSize};

/// Colours of a frame; one more stands for "as it was".
const COLORS: usize = 255;
const UNCHANGED: u8 = 255;

/// A channel may be this far [levels of 255] from the truth before a pixel is drawn again. Larger
/// leaves trails behind moving edges, smaller doubles the file for differences nobody sees.
const TOLERANCE: u8 = 3;

/// How often a colour of a film counts at most in the training of its palette. More, and the network forgets rare
/// colours, highlights among them, over even ones; less, and even ones show steps.
const COUNTED: usize = 4;

/// Every how many pixels one is looked at to train a palette. 1 is best and slowest.
const TRAINING_STRIDE: i32 = 3;

/// Shortest time between frames [1/100 s]; browsers slow anything faster down to a tenth second.
const SHORTEST_DELAY: u64 = 2;

/// Longest time between frames [s]: the format counts to eleven minutes.
const LONGEST_DELAY: f64 = 600.0;

/// How long a frame stays whose successor is earlier: what is shown has begun again [s].
const USUAL_DELAY: f64 = 0.04;

/// A GIF in the making. Frames are compressed as they come, so that memory holds one of them.
pub struct Animation {
    size: ImageSize,
    encoder: gif::Encoder<Vec<u8>>,
    /// The frame whose end is not known yet.
    waiting: Option<Image>,
    /// The time of the last frame, as its giver counts [s].
    last_time: f64,
    /// When the last frame is shown, from the beginning [s].
    clock: f64,
    /// Delays written so far [1/100 s].
    written: u64,
    /// What a viewer shows after the last frame. With one palette for all frames, the colours for which that stands.
    shown: Option<Vec<[u8; 3]>>,
    /// That of all frames, where they share one.
    palette: Option<Palette>,
}

fn failed(error: gif::EncodingError) -> PictureError {
    PictureError::Encoding { format: "gif", reason: error.to_string() }
}

impl Animation {
    /// An endless animation of frames that nobody knows before.
    pub fn new(size: ImageSize) -> Result<Self, PictureError> {
        Self::with(size, None)
    }

    /// An endless animation in the colours of some of its pictures.
    pub fn in_colors_of(pictures: &[Image], size: ImageSize) -> Result<Self, PictureError> {
        let pixels = pictures.iter().flat_map(|picture| picture.pixels().iter().copied());
        Self::with(size, Some(Palette::of(pixels, COUNTED)))
    }

    fn with(size: ImageSize, palette: Option<Palette>) -> Result<Self, PictureError> {
        let (width, height) = (size.width() as u16, size.height() as u16);
        let colors = palette.as_ref().map(Palette::bytes).unwrap_or_default();
        let mut encoder = gif::Encoder::new(Vec::new(), width, height, &colors).map_err(failed)?;
        encoder.set_repeat(gif::Repeat::Infinite).map_err(failed)?;
        let (waiting, shown) = (None, None);
        Ok(Self { size, encoder, waiting, last_time: 0.0, clock: 0.0, written: 0, shown, palette })
    }

    /// Adds a frame that is shown from a time [s] on, by any clock. Where that goes back, a motion has begun again
    /// and follows the one before.
    pub fn push(&mut self, image: &Image, time: f64) -> Result<(), PictureError> {
        if image.size() != self.size {
            return Err(PictureError::FrameSize {
                width: image.size().width(),
                height: image.size().height(),
                expected_width: self.size.width(),
                expected_height: self.size.height(),
            });
        }
        if self.waiting.is_some() {
            let step = time - self.last_time;
            self.clock += if step >= 0.0 { step.min(LONGEST_DELAY) } else { USUAL_DELAY };
            self.show_until(self.clock, 0)?;
        }
        self.waiting = Some(image.clone());
        self.last_time = time;
        Ok(())
    }

    /// The bytes of the GIF file. The last frame stays for `seconds` before the motion repeats.
    pub fn finish(mut self, seconds: f64) -> Result<Vec<u8>, PictureError> {
        self.show_until(self.clock + seconds.clamp(0.0, LONGEST_DELAY), SHORTEST_DELAY)?;
        self.encoder
            .into_inner()
            .map_err(|e| PictureError::Encoding { format: "gif", reason: e.to_string() })
    }

    /// Writes the frame that waits, shown until so far from the beginning [s]; not where that is too soon, unless
    /// it stays for `least` [1/100 s] all the same.
    fn show_until(&mut self, end: f64, least: u64) -> Result<(), PictureError> {
        // What is no number becomes zero.
        let end = (100.0 * end).round() as u64;
        let delay = end.saturating_sub(self.written).max(least);
        if delay < SHORTEST_DELAY {
            return Ok(());
        }
        let Some(image) = self.waiting.take() else { return Ok(()) };
        self.written += delay;
        let frame = self.changes(&image, delay as u16);
        self.encoder.write_frame(&frame).map_err(failed)
    }

    /// The smallest rectangle around all pixels that no longer look right, and what is shown then.
    fn changes(&mut self, image: &Image, delay: u16) -> gif::Frame<'static> {
        let pixels = image.pixels();
        let width = self.size.width() as usize;
        let stale: Vec<bool> = match &self.shown {
            None => vec![true; pixels.len()],
            Some(shown) => pixels
                .iter()
                .zip(shown)
                .map(|(new, old)| (0..3).any(|c| new[c].abs_diff(old[c]) > TOLERANCE))
                .collect(),
        };
        let (mut left, mut right, mut top, mut bottom) = (usize::MAX, 0, usize::MAX, 0);
        for i in (0..stale.len()).filter(|&i| stale[i]) {
            (left, right) = (left.min(i % width), right.max(i % width));
            (top, bottom) = (top.min(i / width), bottom.max(i / width));
        }
        if left > right {
            // Nothing changed: a single unchanged pixel carries the delay.
            (left, right, top, bottom) = (0, 0, 0, 0);
        }

        let (mut own, is_shared) = (None, self.palette.is_some());
        let palette = match &mut self.palette {
            Some(palette) => palette,
            None => {
                let changed = pixels.iter().zip(&stale).filter(|p| *p.1).map(|p| *p.0);
                own.insert(Palette::of(changed, usize::MAX))
            }
        };
        let shown = self.shown.get_or_insert_with(|| vec![[0; 3]; pixels.len()]);
        let mut buffer = Vec::with_capacity((right - left + 1) * (bottom - top + 1));
        for y in top..=bottom {
            for i in y * width + left..=y * width + right {
                if stale[i] {
                    let index = palette.index_of(pixels[i], dithered(pixels[i], i % width, y));
                    // With one palette a colour is shown alike in all frames, and what is off by dithering stays.
                    shown[i] = match is_shared {
                        true => pixels[i],
                        false => palette.colors[usize::from(index)],
                    };
                    buffer.push(index);
                } else {
                    buffer.push(UNCHANGED);
                }
            }
        }
        gif::Frame {
            delay,
            dispose: gif::DisposalMethod::Keep,
            transparent: Some(UNCHANGED),
            left: left as u16,
            top: top as u16,
            width: (right - left + 1) as u16,
            height: (bottom - top + 1) as u16,
            palette: own.map(|palette| palette.bytes()),
            buffer: Cow::Owned(buffer),
            ..gif::Frame::default()
        }
    }
}

/// A colour shifted by a pattern that repeats every four pixels (B. Bayer, 1973), by about half the
/// distance between a palette's colours: smooth shading without visible steps.
fn dithered(color: [u8; 3], x: usize, y: usize) -> [u8; 3] {
    const PATTERN: [[i16; 4]; 4] = [[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]];
    let shift = (PATTERN[y % 4][x % 4] - 8) / 3;
    color.map(|c| (i16::from(c) + shift).clamp(0, 255) as u8)
}

/// Colours of a frame that are taken over exactly, the most frequent ones: backgrounds and scales,
/// where the eye sees the slightest trail. The background has 45 of them: fewer, and it shows bands; more would leave too
/// few for the shading.
const EXACT: usize = 48;

/// Few colours that stand for many.
struct Palette {
    /// First the exact ones, sorted; then the network's.
    colors: Vec<[u8; 3]>,
    exact_count: usize,
    /// None where all colours are exact.
    network: Option<NeuQuant>,
    /// Index by colour, for colours already looked up; `UNCHANGED` elsewhere. Shape [2^21], seven
    /// bits a channel.
    known: Vec<u8>,
}

impl Palette {
    /// Of pixels, of which each colour counts so often at most.
    fn of(pixels: impl Iterator<Item = [u8; 3]>, counted: usize) -> Self {
        let mut pixels: Vec<[u8; 3]> = pixels.collect();
        let mut sorted = pixels.clone();
        sorted.sort_unstable();
        let mut counts: Vec<(usize, [u8; 3])> =
            sorted.chunk_by(|a, b| a == b).map(|same| (same.len(), same[0])).collect();
        let all_fit = counts.len() <= COLORS;
        if !all_fit {
            if counted < usize::MAX {
                let often = |&(count, color)| std::iter::repeat_n(color, counted.min(count));
                pixels = counts.iter().flat_map(often).collect();
            }
            counts.sort_unstable_by(|a, b| b.cmp(a));
            counts.truncate(EXACT);
        }
        let mut colors: Vec<[u8; 3]> = counts.into_iter().map(|c| c.1).collect();
        colors.sort_unstable();
        let exact_count = colors.len();
        if all_fit {
            return Self { colors, exact_count, network: None, known: Vec::new() };
        }
        let rgba: Vec<u8> = pixels
            .iter()
            .filter(|&p| colors.binary_search(p).is_err())
            .flat_map(|&[r, g, b]| [r, g, b, 255])
            .collect();
        // Little to learn from deserves to be looked at completely.
        let stride = if rgba.len() < 80_000 { 1 } else { TRAINING_STRIDE };
        let network = NeuQuant::new(stride, COLORS - exact_count, &rgba);
        colors.extend(network.color_map_rgb().chunks_exact(3).map(|c| [c[0], c[1], c[2]]));
        Self { colors, exact_count, network: Some(network), known: vec![UNCHANGED; 1 << 21] }
    }

    /// The index of a colour, or else of the nearest one to its dithered version.
    fn index_of(&mut self, color: [u8; 3], dithered: [u8; 3]) -> u8 {
        let exact = self.colors[..self.exact_count].binary_search(&color);
        let (Err(_), Some(network)) = (exact, &self.network) else {
            return exact.unwrap_or(0) as u8;
        };
        let [r, g, b] = dithered.map(|c| usize::from(c >> 1));
        let cell = &mut self.known[r << 14 | g << 7 | b];
        if *cell == UNCHANGED {
            let learned = network.index_of(&[dithered[0], dithered[1], dithered[2], 255]);
            *cell = (self.exact_count + learned) as u8;
        }
        *cell
    }

    /// Three bytes a colour; the entry for unchanged pixels included.
    fn bytes(&self) -> Vec<u8> {
        let mut colors = self.colors.clone();
        colors.resize(COLORS + 1, [0; 3]);
        colors.into_flattened()
    }
}
