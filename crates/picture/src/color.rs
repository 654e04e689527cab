//! Colours: linear light inside, sRGB at the edge, and the colour map of values.
//!
//! The map runs through OKLab (B. Ottosson, "A perceptual color space for image processing", 2020)
//! with lightness falling in a straight line, so that equal steps of the value look like equal
//! steps of darkness, on a screen, in grey print and to colour-blind eyes.

use std::sync::LazyLock;

/// A colour in linear light, each channel 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Color {
    /// Red.
    pub r: f32,
    /// Green.
    pub g: f32,
    /// Blue.
    pub b: f32,
}

impl Color {
    /// Healthy liver, where nothing is to be read from the colour.
    pub const TISSUE: Self = Self::new(0.44, 0.115, 0.085);
    /// Vertices that are held in place.
    pub const FIXED: Self = Self::new(0.07, 0.085, 0.11);
    /// The patch that is pulled, and its arrow.
    pub const PULLED: Self = Self::new(1.0, 0.34, 0.01);
    /// Tools.
    pub const STEEL: Self = Self::new(0.23, 0.25, 0.275);
    /// The tool that is in a hand.
    pub const IN_HAND: Self = Self::new(0.16, 0.30, 0.42);
    /// The shape at rest.
    pub const REST: Self = Self::new(0.03, 0.09, 0.22);
    /// A value that is not a number.
    pub const MISSING: Self = Self::new(0.4, 0.4, 0.4);

    /// A colour from linear light.
    pub const fn new(r: f32, g: f32, b: f32) -> Self {
        Self { r, g, b }
    }

    /// A colour as screens and web pages name it, each channel 0 to 255.
    pub fn from_srgb(rgb: [u8; 3]) -> Self {
        let [r, g, b] = rgb.map(|c| SRGB_TO_LINEAR[usize::from(c)]);
        Self { r, g, b }
    }

    /// The colour as screens take it, each channel 0 to 255.
    pub fn to_srgb(self) -> [u8; 3] {
        [self.r, self.g, self.b].map(|c| {
            // A NaN casts to zero, so the index is always inside the table.
            LINEAR_TO_SRGB[(c.clamp(0.0, 1.0) * LINEAR_STEPS as f32 + 0.5) as usize]
        })
    }

    /// Every channel times a factor.
    pub(crate) fn scaled(self, factor: f32) -> Self {
        Self::new(self.r * factor, self.g * factor, self.b * factor)
    }

    /// Channel by channel product.
    pub(crate) fn times(self, other: Self) -> Self {
        Self::new(self.r * other.r, self.g * other.g, self.b * other.b)
    }

    /// Channel by channel sum.
    pub(crate) fn plus(self, other: Self) -> Self {
        Self::new(self.r + other.r, self.g + other.g, self.b + other.b)
    }

    /// From this colour (`t = 0`) to another (`t = 1`).
    pub(crate) fn mix(self, other: Self, t: f32) -> Self {
        self.scaled(1.0 - t).plus(other.scaled(t))
    }
}

/// Fine enough that neighbouring steps differ by less than one level even in the dark.
const LINEAR_STEPS: usize = 4095;

static LINEAR_TO_SRGB: LazyLock<Vec<u8>> = LazyLock::new(|| {
    (0..=LINEAR_STEPS)
        .map(|step| {
            let c = step as f32 / LINEAR_STEPS as f32;
            let encoded =
                if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * libm::powf(c, 1.0 / 2.4) - 0.055 };
            (encoded * 255.0 + 0.5) as u8
        })
        .collect()
});

static SRGB_TO_LINEAR: LazyLock<Vec<f32>> = LazyLock::new(|| {
    (0..=255u8)
        .map(|level| {
            let c = f32::from(level) / 255.0;
            if c <= 0.040_45 { c / 12.92 } else { libm::powf((c + 0.055) / 1.055, 2.4) }
        })
        .collect()
});

/// OKLab `a` and `b` at equal steps of the value: ivory, peach, flesh, crimson, plum. Inside the
/// sRGB gamut at the lightness of their place, so that nothing is clipped.
const MAP_CHROMA: [[f32; 2]; 5] =
    [[0.014, 0.036], [0.072, 0.072], [0.140, 0.074], [0.150, 0.026], [0.090, -0.042]];

/// OKLab lightness where the map begins and where it ends. Lighter would be lost on the
/// background, darker would swallow the shading.
const MAP_LIGHTNESS: [f32; 2] = [0.93, 0.30];

const MAP_STEPS: usize = 255;

static MAP: LazyLock<Vec<Color>> = LazyLock::new(|| {
    (0..=MAP_STEPS)
        .map(|step| {
            let t = step as f32 / MAP_STEPS as f32;
            let lightness = MAP_LIGHTNESS[0] + t * (MAP_LIGHTNESS[1] - MAP_LIGHTNESS[0]);
            oklab_to_linear(lightness, spline(t, 0), spline(t, 1))
        })
        .collect()
});

/// Catmull-Rom spline through the chroma points, the end points repeated.
fn spline(t: f32, channel: usize) -> f32 {
    let last = MAP_CHROMA.len() - 1;
    let place = t * last as f32;
    let i = (place as usize).min(last - 1);
    let u = place - i as f32;
    let p = |k: usize| MAP_CHROMA[k.min(last)][channel];
    let (p0, p1, p2, p3) = (p(i.saturating_sub(1)), p(i), p(i + 1), p(i + 2));
    p1 + 0.5
        * u
        * (p2 - p0 + u * (2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3 + u * (3.0 * (p1 - p2) + p3 - p0)))
}

fn oklab_to_linear(lightness: f32, a: f32, b: f32) -> Color {
    let l = lightness + 0.396_337_78 * a + 0.215_803_76 * b;
    let m = lightness - 0.105_561_346 * a - 0.063_854_17 * b;
    let s = lightness - 0.089_484_18 * a - 1.291_485_5 * b;
    let (l, m, s) = (l * l * l, m * m * m, s * s * s);
    Color::new(
        4.076_741_7 * l - 3.307_711_6 * m + 0.230_969_94 * s,
        -1.268_438 * l + 2.609_757_4 * m - 0.341_319_38 * s,
        -0.004_196_086_3 * l - 0.703_418_6 * m + 1.707_614_7 * s,
    )
}

/// The colour of a value between 0 (light, pale tissue) and 1 (dark, deep purple). Values outside
/// are drawn as the nearer end, a value that is not a number in grey.
pub fn map_color(t: f32) -> Color {
    if t.is_nan() {
        return Color::MISSING;
    }
    let place = t.clamp(0.0, 1.0) * MAP_STEPS as f32;
    let i = (place as usize).min(MAP_STEPS - 1);
    MAP[i].mix(MAP[i + 1], place - i as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_srgb_level_survives_the_way_through_linear_light() {
        for level in 0..=255 {
            assert_eq!(Color::from_srgb([level; 3]).to_srgb(), [level; 3]);
        }
    }

    #[test]
    fn color_map_darkens_steadily_and_stays_inside_the_gamut() {
        // CIE lightness, of which a viewer tells steps of about 1 apart.
        let lightness = |t: f32| {
            let c = map_color(t);
            116.0 * libm::cbrtf(0.2126 * c.r + 0.7152 * c.g + 0.0722 * c.b) - 16.0
        };
        let steps: Vec<f32> = (0..32).map(|i| lightness(i as f32 / 31.0)).collect();
        let mean = (steps[0] - steps[31]) / 31.0;
        for pair in steps.windows(2) {
            let step = pair[0] - pair[1];
            assert!(step > 0.6 * mean && step < 1.5 * mean, "step {step}, mean {mean}");
        }
        for i in 0..=MAP_STEPS {
            let c = MAP[i];
            for channel in [c.r, c.g, c.b] {
                assert!((-1e-3..=1.001).contains(&channel), "step {i}: {c:?}");
            }
        }
    }

    #[test]
    fn values_outside_the_range_take_the_nearer_end() {
        assert_eq!(map_color(-3.0), map_color(0.0));
        assert_eq!(map_color(f32::INFINITY), map_color(1.0));
        assert_eq!(map_color(f32::NAN), Color::MISSING);
    }
}
