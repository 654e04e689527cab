//! What is written on a picture: title, time, colour scale, length scale.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

use crate::color::{Color, map_color};
use crate::error::PictureError;
use crate::image::{Image, ImageSize};

const INK: [u8; 3] = [34, 38, 46];
const SOFT_INK: [u8; 3] = [92, 99, 110];

/// Which colour a value has, and the scale that tells the reader.
#[derive(Clone, Debug, PartialEq)]
pub struct ColorScale {
    title: String,
    min: f64,
    max: f64,
}

impl ColorScale {
    /// A scale from `min` to `max`. The title carries the unit: "displacement [mm]".
    pub fn new(title: impl Into<String>, min: f64, max: f64) -> Result<Self, PictureError> {
        if !(min < max && (max - min).is_finite()) {
            return Err(PictureError::ColorRange { min: min.to_string(), max: max.to_string() });
        }
        Ok(Self { title: title.into(), min, max })
    }

    /// A scale whose ends are round numbers just outside `min` to `max`. Where all values are
    /// equal it spans one unit.
    pub fn rounded(title: impl Into<String>, min: f64, max: f64) -> Result<Self, PictureError> {
        if min == max {
            return Self::new(title, min, max + 1.0);
        }
        let exact = Self::new(title, min, max)?;
        // The third part of a tick's step loses little of the map and keeps the ends short.
        let step = nice_at_most((max - min) / 12.0);
        let (low, high) = ((min / step + 1e-9).floor() * step, (max / step - 1e-9).ceil() * step);
        Ok(if low < high && (high - low).is_finite() {
            Self { min: low, max: high, ..exact }
        } else {
            exact
        })
    }

    /// The value drawn lightest and the value drawn darkest.
    pub fn range(&self) -> [f64; 2] {
        [self.min, self.max]
    }

    /// Place of a value on the colour map: 0 at the lower end, 1 at the upper.
    pub(crate) fn place(&self, value: f64) -> f32 {
        ((value - self.min) / (self.max - self.min)) as f32
    }
}

/// The largest of 1, 2, 5 times a power of ten that is not larger than a positive number.
fn nice_at_most(limit: f64) -> f64 {
    if !(limit.is_finite() && limit > 1e-290) {
        return 1.0;
    }
    let power = libm::pow(10.0, libm::floor(libm::log10(limit)));
    // The logarithm may be off by one bit at exact powers, hence the candidates on both sides.
    [10.0, 5.0, 2.0, 1.0, 0.5]
        .into_iter()
        .map(|factor| factor * power)
        .find(|&nice| nice <= limit * (1.0 + 1e-12))
        .unwrap_or(power)
}

/// Round numbers in a range, about five, with the label of each.
fn ticks(min: f64, max: f64) -> Vec<(f64, String)> {
    let step = nice_at_most((max - min) / 4.0);
    let first = (min / step - 1e-6).ceil();
    (0..12)
        .map(|k| (first + f64::from(k)) * step)
        .take_while(|&v| v <= max + 1e-6 * step)
        .map(|v| (v, tick_label(v, step)))
        .collect()
}

/// A tick's label with as many decimals as the step needs.
fn tick_label(value: f64, step: f64) -> String {
    let value = if value.abs() < 1e-9 * step { 0.0 } else { value };
    let largest = value.abs().max(step);
    if !(1e-4..1e5).contains(&step) || largest >= 1e6 {
        return if value == 0.0 { "0".into() } else { format!("{value:.0e}") };
    }
    let decimals = (-libm::floor(libm::log10(step) + 1e-9)).max(0.0) as usize;
    format!("{value:.decimals$}")
}

/// A length with the unit a surgeon would use.
fn length_label(meters: f64) -> String {
    let (value, unit) = if meters >= 0.9999 {
        (meters, "m")
    } else if meters >= 0.9999e-4 {
        (meters * 1e3, "mm")
    } else {
        (meters * 1e6, "µm")
    };
    // Lengths here are 1, 2 or 5 times a power of ten: one decimal is all that a millimetre needs.
    if (1e-2..1e5).contains(&value) {
        format!("{} {unit}", (value * 1e3).round() / 1e3)
    } else {
        format!("{value:.0e} {unit}")
    }
}

/// A rectangle [pixels].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Area {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
}

/// Where things stand on a picture of some size.
pub(crate) struct Layout {
    size: ImageSize,
    font: RasterHeight,
    /// Height of a line of text [pixels].
    line: i32,
    /// Width of a letter [pixels].
    letter: i32,
    margin: i32,
    /// False for thumbnails, where letters would cover the tissue.
    annotated: bool,
}

/// Letters that fit beside the colour bar.
const TICK_LETTERS: i32 = 5;

impl Layout {
    pub fn of(size: ImageSize) -> Self {
        let extent = size.height().min(size.width() * 2 / 3);
        let font = match extent {
            0..=499 => RasterHeight::Size16,
            500..=799 => RasterHeight::Size20,
            800..=1199 => RasterHeight::Size24,
            _ => RasterHeight::Size32,
        };
        Self {
            size,
            font,
            line: font.val() as i32,
            letter: get_raster_width(FontWeight::Regular, font) as i32,
            margin: (extent / 28).max(4) as i32,
            annotated: size.width() >= 240 && size.height() >= 160,
        }
    }

    /// Width of the colour bar [pixels].
    fn bar_width(&self) -> i32 {
        self.line * 3 / 4
    }

    /// The part of the picture that nothing is written on.
    pub fn tissue_area(&self) -> Area {
        let (width, height) = (f64::from(self.size.width()), f64::from(self.size.height()));
        let margin = f64::from(self.margin);
        if !self.annotated {
            let edge = 0.05 * width.min(height);
            return Area { left: edge, top: edge, right: width - edge, bottom: height - edge };
        }
        let beside = f64::from(self.bar_width() + (TICK_LETTERS + 2) * self.letter);
        let line = f64::from(self.line);
        Area {
            left: 1.5 * margin,
            top: 1.2 * margin + 2.3 * line,
            right: width - margin - beside,
            bottom: height - margin - 1.9 * line,
        }
    }
}

/// What is written on a picture, whoever has drawn it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overlay<'a> {
    /// Upper left, usually the scene's name.
    pub title: &'a str,
    /// Below the title, usually the time.
    pub caption: &'a str,
    /// Colours of values, at the right edge.
    pub color_scale: Option<&'a ColorScale>,
    /// Names and colours of bodies, at the right edge below the scale's title; the first dozen.
    pub legend: &'a [(String, Color)],
    /// For a bar of known length in the lower left corner: how many pixels a metre takes in the middle of
    /// the scene.
    pub pixels_per_meter: Option<f64>,
}

impl Overlay<'_> {
    /// Writes it; on thumbnails, where letters would cover the tissue, nothing.
    pub fn draw(&self, image: &mut Image) {
        let layout = Layout::of(image.size());
        if !layout.annotated {
            return;
        }
        let (width, margin) = (layout.size.width() as i32, layout.margin);
        let mut room = (width - 2 * margin) / layout.letter;
        if let Some(scale) = self.color_scale {
            let title = shortened(&scale.title, room * 3 / 5);
            let taken = title.chars().count() as i32;
            let x = width - margin - taken * layout.letter;
            write_text(image, &layout, x, margin, &title, INK);
            room -= taken + 2;
            draw_color_bar(image, &layout, scale);
        }
        if self.color_scale.is_none() {
            draw_legend(image, &layout, self.legend);
        }
        write_text(image, &layout, margin, margin, &shortened(self.title, room), INK);
        let below = margin + layout.line * 6 / 5;
        write_text(image, &layout, margin, below, &shortened(self.caption, room), SOFT_INK);
        if let Some(pixels) = self.pixels_per_meter.filter(|p| p.is_finite() && *p > 0.0) {
            draw_length_bar(image, &layout, pixels);
        }
    }
}

/// Text that fits in a number of letters, its loss marked.
fn shortened(text: &str, room: i32) -> String {
    let room = room.max(0) as usize;
    if text.chars().count() <= room {
        return text.into();
    }
    text.chars().take(room.saturating_sub(3)).chain("...".chars().take(room)).collect()
}

/// Writes a line with its upper left corner at a place. Letters the font lacks become "?".
fn write_text(image: &mut Image, layout: &Layout, x: i32, y: i32, text: &str, ink: [u8; 3]) {
    for (k, letter) in text.chars().enumerate() {
        let regular = |c| get_raster(c, FontWeight::Regular, layout.font);
        let Some(glyph) = regular(letter).or_else(|| regular('?')) else { continue };
        let left = x + k as i32 * layout.letter;
        for (row, line) in glyph.rows().enumerate() {
            for (column, &level) in line.iter().enumerate() {
                if level > 0 {
                    let alpha = f32::from(level) / 255.0;
                    image.blend(left + column as i32, y + row as i32, ink, alpha);
                }
            }
        }
    }
}

fn fill(
    image: &mut Image,
    columns: std::ops::Range<i32>,
    rows: std::ops::Range<i32>,
    ink: [u8; 3],
) {
    for y in rows {
        for x in columns.clone() {
            image.blend(x, y, ink, 1.0);
        }
    }
}

fn draw_color_bar(image: &mut Image, layout: &Layout, scale: &ColorScale) {
    let width = layout.size.width() as i32;
    let left = width
        - layout.margin
        - TICK_LETTERS * layout.letter
        - layout.letter / 2
        - layout.bar_width();
    let right = left + layout.bar_width();
    let top = layout.margin + layout.line * 17 / 10;
    let bottom = top + (layout.size.height() as i32 * 11 / 20).max(4 * layout.line);
    fill(image, left - 1..right + 1, top - 1..bottom + 1, SOFT_INK);
    for y in top..bottom {
        let t = 1.0 - (y - top) as f32 / (bottom - top - 1).max(1) as f32;
        fill(image, left..right, y..y + 1, map_color(t).to_srgb());
    }
    for (value, label) in ticks(scale.min, scale.max) {
        let y = bottom - 1 - ((bottom - top - 1) as f32 * scale.place(value)).round() as i32;
        fill(image, right..right + layout.letter / 3 + 1, y..y + 1, SOFT_INK);
        let x = right + layout.letter / 2 + layout.letter / 4;
        write_text(image, layout, x, y - layout.line / 2, &label, INK);
    }
}

/// So many names a legend has at most.
const MOST_NAMES: usize = 12;

/// Names at the right edge, each behind a patch of its colour.
fn draw_legend(image: &mut Image, layout: &Layout, legend: &[(String, Color)]) {
    let width = layout.size.width() as i32;
    let mut lines: Vec<(String, Option<Color>)> = legend
        .iter()
        .take(MOST_NAMES)
        .map(|(name, color)| (shortened(name, width / layout.letter / 3), Some(*color)))
        .collect();
    if legend.len() > MOST_NAMES {
        lines.push((format!("and {} more", legend.len() - MOST_NAMES), None));
    }
    let longest = lines.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0) as i32;
    let left = width - layout.margin - longest * layout.letter;
    let side = layout.line * 3 / 5;
    for (row, (name, color)) in (0..).zip(&lines) {
        let top = layout.margin + row * layout.line * 5 / 4;
        write_text(image, layout, left, top, name, INK);
        if let Some(color) = color {
            let (x, y) = (left - layout.letter - side, top + (layout.line - side) / 2);
            fill(image, x..x + side, y..y + side, color.to_srgb());
        }
    }
}

fn draw_length_bar(image: &mut Image, layout: &Layout, pixels_per_meter: f64) {
    let longest = 0.2 * f64::from(layout.size.width()) / pixels_per_meter;
    let length = nice_at_most(longest);
    let pixels = (length * pixels_per_meter).round() as i32;
    let (left, bottom) = (layout.margin, layout.size.height() as i32 - layout.margin);
    let thick = (layout.line / 10).max(1);
    let tick = layout.line * 2 / 5;
    fill(image, left..left + pixels, bottom - thick..bottom, INK);
    fill(image, left..left + thick, bottom - tick..bottom, INK);
    fill(image, left + pixels - thick..left + pixels, bottom - tick..bottom, INK);
    let label = length_label(length);
    let x = left + ((pixels - label.chars().count() as i32 * layout.letter) / 2).max(0);
    write_text(image, layout, x, bottom - tick - layout.line, &label, INK);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers_inside_the_range() {
        let labels = |min, max| ticks(min, max).into_iter().map(|t| t.1).collect::<Vec<_>>();
        assert_eq!(labels(0.0, 40.0), ["0", "10", "20", "30", "40"]);
        assert_eq!(labels(0.0, 0.7), ["0.0", "0.1", "0.2", "0.3", "0.4", "0.5", "0.6", "0.7"]);
        assert_eq!(labels(-1.3, 1.2), ["-1.0", "-0.5", "0.0", "0.5", "1.0"]);
        assert_eq!(labels(0.0, 8e7), ["0", "2e7", "4e7", "6e7", "8e7"]);
    }

    #[test]
    fn rounded_scale_encloses_its_values_closely() {
        for (min, max) in [(0.0, 37.2), (-0.013, 0.41), (0.0, 1e-7), (1000.0, 1001.0)] {
            let [low, high] = ColorScale::rounded("", min, max).unwrap().range();
            assert!(low <= min && high >= max);
            assert!(high - low <= (max - min) * (1.0 + 2.0 / 12.0) + 1e-12, "{low} {high}");
        }
    }

    #[test]
    fn impossible_scales_are_refused() {
        for (min, max) in [(1.0, 0.0), (f64::NAN, 1.0), (0.0, f64::INFINITY), (-1e308, 1e308)] {
            assert!(ColorScale::new("", min, max).is_err());
            assert!(ColorScale::rounded("", min, max).is_err());
        }
        assert_eq!(ColorScale::rounded("", 0.0, 0.0).unwrap().range(), [0.0, 1.0]);
    }

    #[test]
    fn lengths_carry_the_usual_unit() {
        assert_eq!(length_label(0.05), "50 mm");
        assert_eq!(length_label(5e-4), "0.5 mm");
        assert_eq!(length_label(2e-5), "20 µm");
        assert_eq!(length_label(1.0), "1 m");
    }

    #[test]
    fn nice_numbers_are_not_larger_than_the_limit() {
        for exponent in -280..290 {
            for factor in [1.0, 1.7, 2.0, 4.99, 5.0, 9.99] {
                let limit = factor * libm::pow(10.0, f64::from(exponent));
                let nice = nice_at_most(limit);
                assert!(nice <= limit * (1.0 + 1e-11) && nice >= limit / 2.51, "{limit} {nice}");
            }
        }
    }
}
