//! How tissue has turned and stretched, by any deformation: turned inside out and flat ones too.

use crate::elements::law::{Law, with_law};
use crate::material::MaterialModel;
use crate::scalar::{Mat3, Real, Vec3, vec3};

/// How a group has turned and stretched.
#[derive(Clone, Copy, Debug)]
pub struct Turn<S> {
    /// `R`.
    pub rotation: Mat3<S>,
    /// `A`.
    pub map: Mat3<S>,
    /// The factor by which viscosity stiffens it: `1 + eta/he`.
    pub stiffer: S,
}

impl<S: Real> Turn<S> {
    /// Of the rest shape.
    pub const NONE: Self = Self { rotation: Mat3::IDENTITY, map: Mat3::IDENTITY, stiffer: S::ONE };

    /// Of a mean deformation gradient; `rate` is the retardation time over the step.
    pub fn new(law: MaterialModel, f: &Mat3<f64>, rate: f64) -> Self {
        let rotation = rotation_of(f).cast();
        let map: Mat3<S> = with_law!(law, W => W::gradient_map(f)).cast();
        // Also where a number is none.
        let is_finite = map.norm_squared().is_finite();
        let map = if is_finite { map } else { rotation };
        Self { rotation, map, stiffer: S::from_f64(1.0 + rate) }
    }
}

/// Turns at most: quadratic convergence needs a handful.
const MOST_TURNS: usize = 20;

/// A turn [rad] below which the rotation is near enough for a preconditioner.
const NEAR: f64 = 1e-5;

/// The rotation `R` that maximises `R : F`: Mueller, Bender, Chentanez, Macklin, "A robust method to extract the
/// rotational part of deformations", MIG 2016. It starts from the first two columns of `F`, made orthonormal.
fn rotation_of(f: &Mat3<f64>) -> Mat3<f64> {
    let mut r = start(f);
    for _ in 0..MOST_TURNS {
        let mut turn = Vec3::<f64>::ZERO;
        let mut along = 0.0;
        for i in 0..3 {
            turn += r.columns[i].cross(f.columns[i]);
            along += r.columns[i].dot(f.columns[i]);
        }
        let turn = turn * (1.0 / (along.abs() + f64::MIN_POSITIVE));
        let angle = turn.length();
        // Also where a number is none.
        if !(angle > NEAR && angle.is_finite()) {
            break;
        }
        let axis = turn * (1.0 / angle);
        r.columns = r.columns.map(|column| turned(column, axis, angle));
    }
    r
}

fn turned(v: Vec3<f64>, axis: Vec3<f64>, angle: f64) -> Vec3<f64> {
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    v * cos + axis.cross(v) * sin + axis * (axis.dot(v) * (1.0 - cos))
}

fn start(f: &Mat3<f64>) -> Mat3<f64> {
    let [a, b, _] = f.columns;
    let unit = |v: Vec3<f64>, otherwise: Vec3<f64>| {
        let length = v.length();
        if length > 1e-12 && length.is_finite() { v * (1.0 / length) } else { otherwise }
    };
    let a = unit(a, vec3(1.0, 0.0, 0.0));
    // Of the axes the one that is least along `a`.
    let axis = if a.x.abs() < 0.6 { vec3(1.0, 0.0, 0.0) } else { vec3(0.0, 1.0, 0.0) };
    let across = unit(axis - a * a.dot(axis), axis);
    let b = unit(b - a * a.dot(b), across);
    Mat3::from_columns(a, b, a.cross(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_rotation(r: &Mat3<f64>) -> bool {
        let product = r.transpose() * *r - Mat3::IDENTITY;
        product.norm_squared() < 1e-24 && r.determinant() > 0.0
    }

    /// The nearest rotation leaves a symmetric stretch; what is inverted, flat, zero or no number leaves a rotation.
    #[test]
    fn what_is_left_is_a_symmetric_stretch() {
        for seed in 0..2000 {
            let number = |k: usize| libm::sin((seed * 9 + k) as f64 * 12.9898) * 1.7;
            let column = |k: usize| vec3(number(k), number(k + 1), number(k + 2));
            let f = Mat3::from_columns(column(0), column(3), column(6));
            let r = rotation_of(&f);
            assert!(is_rotation(&r), "{f:?}");
            if f.determinant() > 0.1 {
                let stretch = r.transpose() * f;
                let skew = stretch - stretch.transpose();
                assert!(skew.norm_squared() < 1e-8 * f.norm_squared(), "{seed}");
            }
        }
        let flat = Mat3::from_columns(vec3(1.0, 0.0, 0.0), vec3(2.0, 0.0, 0.0), Vec3::ZERO);
        let none = Mat3::from_columns(vec3(f64::NAN, 0.0, 0.0), Vec3::ZERO, Vec3::ZERO);
        for f in [flat, none, flat * 0.0, flat * 1e300] {
            assert!(is_rotation(&rotation_of(&f)), "{f:?}");
        }
    }
}
