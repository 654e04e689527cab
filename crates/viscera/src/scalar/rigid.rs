//! Rigid motions: `x -> R x + t`.

use super::{Mat3, Vec3, vec3};

/// A rotation and a translation: `x -> rotation * x + translation`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct RigidTransform {
    /// Orthonormal, determinant 1.
    pub rotation: Mat3<f64>,
    /// [m].
    pub translation: Vec3<f64>,
}

impl RigidTransform {
    /// Leaves everything where it is.
    pub const IDENTITY: Self = Self { rotation: Mat3::IDENTITY, translation: Vec3::ZERO };

    /// Turns by a rotation vector [rad] about a point [m], then moves by `translation` [m].
    pub fn about(point: Vec3<f64>, rotation: Vec3<f64>, translation: Vec3<f64>) -> Self {
        let rotation = rotation_matrix(rotation);
        // In this order a rotation by nothing is exactly the translation.
        Self { rotation, translation: translation + (point - rotation * point) }
    }

    /// Where a point [m] goes.
    pub fn apply(&self, point: Vec3<f64>) -> Vec3<f64> {
        self.rotation * point + self.translation
    }
}

/// The rotation by `|r|` radians about the axis `r`. Sine and cosine are the same bits on every
/// machine.
pub fn rotation_matrix(r: Vec3<f64>) -> Mat3<f64> {
    let angle = r.length();
    if angle == 0.0 || !angle.is_finite() {
        return Mat3::IDENTITY;
    }
    let axis = r * (1.0 / angle);
    let cross = Mat3::from_columns(
        vec3(0.0, axis.z, -axis.y),
        vec3(-axis.z, 0.0, axis.x),
        vec3(axis.y, -axis.x, 0.0),
    );
    let half = libm::sin(0.5 * angle);
    // 1 - cos(a) = 2 sin(a/2)^2, without cancellation.
    Mat3::IDENTITY + cross * libm::sin(angle) + (cross * cross) * (2.0 * half * half)
}

impl RigidTransform {
    /// Where a point [m] comes from: the inverse of [`RigidTransform::apply`].
    pub fn undo(&self, point: Vec3<f64>) -> Vec3<f64> {
        self.rotation.transpose() * (point - self.translation)
    }

    /// The motion back.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.transpose();
        Self { rotation, translation: -(rotation * self.translation) }
    }

    /// A direction, turned.
    pub fn turn(&self, direction: Vec3<f64>) -> Vec3<f64> {
        self.rotation * direction
    }

    /// A direction, turned back.
    pub fn turn_back(&self, direction: Vec3<f64>) -> Vec3<f64> {
        self.rotation.transpose() * direction
    }

    /// First `other`, then this.
    pub fn after(&self, other: &Self) -> Self {
        Self {
            rotation: self.rotation * other.rotation,
            translation: self.apply(other.translation),
        }
    }

    /// A share of the way from this pose to `end`: origins on a straight line, rotations about one axis.
    pub fn towards(&self, end: &Self, share: f64) -> Self {
        if share == 1.0 {
            return *end;
        }
        if share == 0.0 || self == end {
            return *self;
        }
        let turn = rotation_vector(&(end.rotation * self.rotation.transpose()));
        Self {
            rotation: rotation_matrix(turn * share) * self.rotation,
            translation: self.translation + (end.translation - self.translation) * share,
        }
    }

    /// True while every number is finite.
    pub fn is_finite(&self) -> bool {
        self.translation.is_finite()
            && self.rotation.columns.iter().all(|column| column.is_finite())
    }

    /// Whether it keeps lengths and handedness, to round-off.
    pub fn is_rigid(&self) -> bool {
        let excess = self.rotation.transpose() * self.rotation - Mat3::IDENTITY;
        excess.norm_squared() < 1e-18 && self.rotation.determinant() > 0.0
    }
}

/// Axis times the sine of the angle of a rotation: by it forces that turn with what they hold do work.
pub fn axis_times_sine(rotation: &Mat3<f64>) -> Vec3<f64> {
    let [a, b, c] = rotation.columns;
    vec3(b.z - c.y, c.x - a.z, a.y - b.x) * 0.5
}

/// Axis times angle [rad] of a rotation, the inverse of [`rotation_matrix`] below half a turn.
pub fn rotation_vector(rotation: &Mat3<f64>) -> Vec3<f64> {
    let sine = axis_times_sine(rotation);
    let (length, cosine) = (sine.length(), 0.5 * (rotation.trace() - 1.0));
    let angle = libm::atan2(length, cosine);
    if length > 1e-9 {
        return sine * (angle / length);
    }
    if cosine > 0.0 {
        return sine;
    }
    // Half a turn: of the columns of `R + I = 2 a a^T` the longest.
    let shifted = (*rotation + Mat3::IDENTITY).columns;
    let axis = shifted.into_iter().fold(shifted[0], |longest, column| {
        if column.length_squared() > longest.length_squared() { column } else { longest }
    });
    axis * (angle / axis.length())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_of_the_way_is_one_of_the_turn() {
        let start = RigidTransform::about(Vec3::ZERO, vec3(0.3, -0.2, 0.1), vec3(1.0, 2.0, 3.0));
        let turn = vec3(0.4, 0.5, -0.3);
        let end = RigidTransform {
            rotation: rotation_matrix(turn) * start.rotation,
            translation: vec3(2.0, 2.0, 1.0),
        };
        let middle = start.towards(&end, 0.25);
        let wanted = rotation_matrix(turn * 0.25) * start.rotation;
        assert!((middle.rotation - wanted).norm_squared() < 1e-28);
        assert!((middle.translation - vec3(1.25, 2.0, 2.5)).length() < 1e-15);
        assert_eq!(start.towards(&end, 1.0), end);
        assert_eq!(start.towards(&end, 0.0), start);
        assert!(middle.is_rigid());
    }

    #[test]
    fn rotation_vectors_come_back() {
        let pi = std::f64::consts::PI;
        for turn in
            [vec3(0.0, 0.0, 0.0), vec3(1e-7, 0.0, 2e-7), vec3(0.1, 2.0, -1.0), vec3(0.0, pi, 0.0)]
        {
            let back = rotation_vector(&rotation_matrix(turn));
            assert!((back - turn).length() < 1e-9, "{turn:?}: {back:?}");
        }
    }

    #[test]
    fn what_is_undone_is_where_it_was() {
        let pose =
            RigidTransform::about(vec3(1.0, 0.0, 0.0), vec3(0.3, 0.7, 0.1), vec3(0.1, 0.2, 0.3));
        let point = vec3(0.4, -0.5, 0.6);
        assert!((pose.undo(pose.apply(point)) - point).length() < 1e-15);
        let both = pose.after(&pose);
        assert!((both.apply(point) - pose.apply(pose.apply(point))).length() < 1e-15);
    }
}
