//! Boxes of places and cones of directions.
//!
//! ```text
//! places p in a box with normals n_s, places q in another with normals n,   D = |p - q| at most
//! n.(p - q)   <= a.(m_s - m) + |a|.h + r D           below zero: p is behind q
//! n_s.(p - q) >= a_s.(m_s - m) - |a_s|.h - r_s D     above -D_least/5: p does not face q
//! m: middles, h: half of both sizes, a, r: axes and chords of the cones
//! ```

use crate::scalar::Vec3;

/// The cosine of the angle between a sample's normal and the way to what it faces is more than this.
pub const FACES: f64 = 0.2;

/// Two directions of which the chord is no more than this are beside each other, see [`super::BESIDE`].
const CHORD: f64 = 1.0 - 1e-9;

/// Directions near an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Cone {
    pub axis: Vec3<f64>,
    pub chord: f64,
}

impl Cone {
    /// Around directions of length 1, each with the chord by which it may turn. Directions that are not finite do not count:
    /// what has one meets nothing.
    pub fn around(directions: impl Iterator<Item = (Vec3<f64>, f64)> + Clone) -> Self {
        let all = directions.filter(|(direction, _)| direction.is_finite());
        let sum = all.clone().fold(Vec3::ZERO, |sum, (direction, _)| sum + direction);
        let axis = unit(sum);
        let chord = all
            .fold(0.0f64, |most, (direction, turn)| most.max((direction - axis).length() + turn));
        Self { axis, chord }
    }

    pub fn join(self, other: Self) -> Self {
        let axis = unit(self.axis + other.axis);
        let chord = |cone: Self| (cone.axis - axis).length() + cone.chord;
        Self { axis, chord: chord(self).max(chord(other)) }
    }

    /// Whether every direction of one is beside every one of the other.
    pub fn is_beside(&self, other: &Self) -> bool {
        self.chord + other.chord + (self.axis - other.axis).length() <= CHORD
    }
}

/// Of length 1, or nothing.
pub(super) fn unit(direction: Vec3<f64>) -> Vec3<f64> {
    let unit = direction * (1.0 / direction.length());
    if unit.is_finite() { unit } else { Vec3::ZERO }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Span {
    pub low: Vec3<f64>,
    pub high: Vec3<f64>,
}

impl Span {
    pub const NOTHING: Self =
        Self { low: Vec3::splat(f64::INFINITY), high: Vec3::splat(f64::NEG_INFINITY) };

    pub fn with(self, x: Vec3<f64>) -> Self {
        Self { low: self.low.min(x), high: self.high.max(x) }
    }

    pub fn join(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// The gap to another [m], squared.
    pub fn gap(&self, other: &Self) -> f64 {
        (self.low - other.high).max(other.low - self.high).max(Vec3::ZERO).length_squared()
    }

    fn middle(&self) -> Vec3<f64> {
        (self.low + self.high) * 0.5
    }

    fn half(&self) -> Vec3<f64> {
        (self.high - self.low) * 0.5
    }
}

/// Places, and directions there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Patch {
    pub span: Span,
    pub cone: Cone,
}

impl Patch {
    pub const NOTHING: Self =
        Self { span: Span::NOTHING, cone: Cone { axis: Vec3::ZERO, chord: 0.0 } };

    /// Of two patches together.
    pub fn join(&self, other: &Self) -> Self {
        match (self.is_empty(), other.is_empty()) {
            (true, _) => *other,
            (_, true) => *self,
            _ => Self { span: self.span.join(other.span), cone: self.cone.join(other.cone) },
        }
    }

    /// Whether no place is in it.
    pub fn is_empty(&self) -> bool {
        self.span.low.x > self.span.high.x
    }

    /// Whether samples of this patch are behind all of another that is no farther than `reach` [m], or turned away from it,
    /// whatever moves by no more than `slack` [m] towards each other. False where a place is NaN.
    pub fn is_averted(&self, other: &Self, reach: f64, slack: f64) -> bool {
        let between = self.span.middle() - other.span.middle();
        let half = self.span.half() + other.span.half();
        let far = reach.min((size(between) + half).length() + slack);
        let near = (self.span.gap(&other.span).sqrt() - slack).max(0.0);
        let along = |axis: Vec3<f64>| (axis.dot(between), size(axis).dot(half) + slack);
        let (front, more) = along(other.cone.axis);
        let (away, less) = along(self.cone.axis);
        front + more + other.cone.chord * far < 0.0
            || away - less - self.cone.chord * far > -FACES * near
    }
}

/// The magnitudes of components.
fn size(all: Vec3<f64>) -> Vec3<f64> {
    all.max(all * -1.0)
}
