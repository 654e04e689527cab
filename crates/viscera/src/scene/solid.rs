//! Parts of instruments that are closed surfaces: from a file, or made by code.
//!
//! Sizes are in the range of instruments for laparoscopy. Graspers have shafts of 5 mm and 31 cm, blades of 2 cm that are
//! serrated inside, and open by 2 cm (Milsom, Boehm, Nakajima, Laparoscopic Colorectal Surgery, "Grasping instruments"); tubes
//! for suction 5 to 10 mm across and 30 cm (the same, "Irrigation and suction devices"). A fan retractor passes a port of
//! 10 mm; the length and the spread of its fingers are a choice.

use crate::mesh::SurfaceMesh;
use crate::mesh::shapes::{lofted, turned};
use crate::scalar::rigid::RigidTransform;
use crate::scalar::vec3;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// A part before it has a shape: its distances are computed where the scene is put together.
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    /// Its surface.
    pub source: SolidSource,
    /// As [`Part::place`](super::Part).
    pub place: RigidTransform,
    /// As [`Part::opens`](super::Part).
    pub opens: f64,
}

/// Where a surface comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum SolidSource {
    /// A file.
    File {
        /// As the scene names it.
        mesh: String,
        /// The length of one unit in it [m].
        unit: f64,
    },
    /// A jaw with ridges across.
    Jaw(RidgedJaw),
    /// The end of a tube.
    Tube(Tube),
}

/// The upper one of two jaws: along -z from a hinge at the origin, its inner side towards -y. In plan and in profile its end
/// is round, its back is half an ellipse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RidgedJaw {
    /// Width, thickness and length [m].
    pub size: [f64; 3],
    /// From the plane y = 0 to the ridges' tops [m].
    pub away: f64,
    /// Of the inner side's long edges [m].
    pub rounding: f64,
    /// From a ridge's top to the valley beside it [m].
    pub height: f64,
    /// From ridge to ridge [m].
    pub spacing: f64,
    /// Whether there is a valley at the hinge, where the other jaw has a ridge.
    pub is_other: bool,
}

/// A tube from the origin along +z, open at the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tube {
    /// Outer radius [m].
    pub radius: f64,
    /// Of its bore [m].
    pub inner: f64,
    /// How deep the bore is [m]: nothing gets further.
    pub depth: f64,
    /// [m].
    pub length: f64,
}

/// Sides of round surfaces: 6 degrees each, 0.1 % of a radius within the circle.
const SIDES: u32 = 60;

/// Sections from ridge to ridge.
const SECTIONS: f64 = 12.0;

/// Sections of a jaw at most.
const MOST_SECTIONS: f64 = 2000.0;

/// Steps of the ellipse of a jaw's back.
const BACK: u32 = 16;

/// The outermost section of a jaw's round end, as a share of the whole.
const END: f64 = 0.25;

impl SolidSource {
    /// Its surface, where no file has it.
    pub fn surface(&self) -> Option<SurfaceMesh> {
        match self {
            Self::File { .. } => None,
            Self::Jaw(jaw) => Some(jaw.surface()),
            Self::Tube(tube) => Some(tube.surface()),
        }
    }
}

impl RidgedJaw {
    /// What is wrong with its sizes; nothing where they are legal.
    pub(super) fn complaint(&self) -> Option<&'static str> {
        let [width, thickness, length] = self.size;
        if self.rounding > 0.5 * thickness.min(width) {
            return Some("jaws have edges rounded by half of their smallest size at most");
        }
        if self.height >= 0.5 * thickness {
            return Some("ridges are lower than half of the jaw's thickness");
        }
        (self.spacing > length || self.spacing * MOST_SECTIONS < SECTIONS * length)
            .then_some("ridges are closer together than the jaw is long, and fewer than 160")
    }

    /// Its surface, closed.
    pub fn surface(&self) -> SurfaceMesh {
        let [width, thickness, length] = self.size;
        let half = 0.5 * width;
        let count = (SECTIONS * length / self.spacing).ceil().max(SECTIONS);
        // Closer together at the round end.
        let at_end = (0..8).map(|k| f64::from(k) / 8.0 * half.min(0.25 * length));
        let step = length / count;
        let begin = at_end.clone().next_back().unwrap_or(0.0);
        let beyond = (0..=count as u32).map(|k| step * f64::from(k));
        let places = at_end.chain(beyond.filter(|place| *place > begin + 0.5 * step));
        let section = |from_end: f64| {
            let left = 1.0 - (from_end / half.min(0.25 * length)).min(1.0);
            let share = (1.0 - left * left).sqrt().max(END);
            let z = from_end - length;
            let phase = if self.is_other { PI } else { 0.0 };
            let valley = 0.5 - 0.5 * libm::cos(TAU * z / self.spacing + phase);
            let inner = self.away + self.height * valley;
            let (half, top) =
                (half * share, self.away + self.height + (thickness - self.height) * share);
            section(half, [inner, top], self.rounding * share).map(|[x, y]| vec3(x, y, z)).collect()
        };
        lofted(&places.map(section).collect::<Vec<_>>())
    }
}

/// A flat side from -half to half at the lower height, edges rounded, and half an ellipse above: counter-clockwise.
fn section(half: f64, [low, top]: [f64; 2], rounding: f64) -> impl Iterator<Item = [f64; 2]> {
    let radius = rounding.min(0.5 * half).min(0.4 * (top - low)).max(1e-3 * half);
    let corner = move |side: f64, from: f64| {
        (0..=3).map(move |k| {
            let (sin, cos) = libm::sincos(from + FRAC_PI_2 * f64::from(k) / 3.0);
            [side * (half - radius) + radius * cos, low + radius + radius * sin]
        })
    };
    let back = (1..BACK).map(move |k| {
        let (sin, cos) = libm::sincos(PI * f64::from(k) / f64::from(BACK));
        let foot = low + radius;
        [half * cos, foot + (top - foot) * sin]
    });
    corner(1.0, -FRAC_PI_2).chain(back).chain(corner(-1.0, PI))
}

impl Tube {
    /// What is wrong with its sizes; nothing where they are legal.
    pub(super) fn complaint(&self) -> Option<&'static str> {
        if self.inner >= 0.95 * self.radius {
            return Some("a tube's `inner_radius` is less than 0.95 of its `radius`");
        }
        (self.length <= self.depth + self.radius)
            .then_some("a tube is longer than twice its width; give it a larger `length`")
    }

    /// Its surface, closed: the bore is blind.
    pub fn surface(&self) -> SurfaceMesh {
        let Self { radius, inner, depth, length } = *self;
        let rim = 0.5 * (radius - inner);
        let mut profile = vec![[0.0, depth], [inner, depth]];
        for step in 0..=8 {
            let (sin, cos) = libm::sincos(PI * f64::from(step) / 8.0);
            profile.push([inner + rim - rim * cos, rim - rim * sin]);
        }
        profile.extend([[radius, length], [0.0, length]]);
        turned(&profile, SIDES)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::topology::count_open_edges;
    use crate::scalar::Vec3;

    const JAW: RidgedJaw = RidgedJaw {
        size: [5e-3, 3e-3, 0.02],
        away: 0.0,
        rounding: 4e-4,
        height: 5e-4,
        spacing: 2e-3,
        is_other: false,
    };

    fn bounds(mesh: &SurfaceMesh) -> (Vec3<f64>, Vec3<f64>) {
        let first = mesh.vertices[0];
        mesh.vertices.iter().fold((first, first), |(low, high), x| (low.min(*x), high.max(*x)))
    }

    #[test]
    fn a_jaw_has_its_size_and_ridges_inside() {
        assert_eq!(JAW.complaint(), None);
        let mesh = JAW.surface();
        assert_eq!(count_open_edges(&mesh), 0);
        let (low, high) = bounds(&mesh);
        assert!((high - low - vec3(5e-3, 3e-3, 0.02)).length() < 1e-4, "{low:?} {high:?}");
        assert!(high.z.abs() < 1e-12 && low.y.abs() < 1e-12 && (low.z + 0.02).abs() < 1e-12);
        let volume = mesh.enclosed_volume();
        assert!((0.5..0.85).contains(&(volume / (5e-3 * 3e-3 * 0.02))), "{volume}");
        // Where this one has a ridge the other has a valley.
        let other = RidgedJaw { is_other: true, ..JAW }.surface();
        let lowest = |mesh: &SurfaceMesh, z: f64| {
            let near = mesh.vertices.iter().filter(|x| (x.z - z).abs() < 1e-4);
            near.map(|x| x.y).fold(f64::MAX, f64::min)
        };
        for (z, ridge) in [(-8e-3, 0.0), (-9e-3, 5e-4), (-0.010, 0.0)] {
            assert!((lowest(&mesh, z) - ridge).abs() < 2e-5, "{z} {}", lowest(&mesh, z));
            assert!((lowest(&other, z) - (5e-4 - ridge)).abs() < 2e-5, "{z}");
        }
    }

    #[test]
    fn a_tube_is_hollow_at_its_end() {
        let tube = Tube { radius: 2.5e-3, inner: 1.5e-3, depth: 0.01, length: 0.05 };
        assert_eq!(tube.complaint(), None);
        let mesh = tube.surface();
        assert_eq!(count_open_edges(&mesh), 0);
        let (low, high) = bounds(&mesh);
        assert!((low.z, high.z) == (0.0, 0.05) && (high.x - 2.5e-3).abs() < 1e-9);
        let whole = PI * (6.25e-6 * 0.05 - 2.25e-6 * 0.01);
        assert!((mesh.enclosed_volume() / whole - 1.0).abs() < 0.01);
    }

    #[test]
    fn sizes_that_no_part_has_are_told() {
        assert!(RidgedJaw { height: 2e-3, ..JAW }.complaint().is_some());
        assert!(RidgedJaw { spacing: 0.03, ..JAW }.complaint().is_some());
        assert!(RidgedJaw { spacing: 1e-5, ..JAW }.complaint().is_some());
        assert!(RidgedJaw { rounding: 2e-3, ..JAW }.complaint().is_some());
        let tube = Tube { radius: 2e-3, inner: 2e-3, depth: 0.01, length: 0.05 };
        assert!(tube.complaint().is_some());
        assert!(Tube { inner: 1e-3, length: 0.011, ..tube }.complaint().is_some());
    }
}
