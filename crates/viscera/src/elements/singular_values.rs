//! Signed singular value decomposition of a 3 x 3 matrix.
//!
//! ```text
//! F = U diag(s_1, s_2, s_3) V^T,   det U = det V = 1,   s_1 >= s_2 >= |s_3|,   s_3 < 0 where det F < 0
//! ```
//!
//! (the convention of Irving, Teran, Fedkiw, "Invertible Finite Elements For Robust Simulation of
//! Large Deformation", SCA 2004). `V` comes from cyclic Jacobi rotations of `F^T F`; `U` from `F V`, so that small
//! singular values, which `F^T F` loses, are as accurate as `F`.

use crate::scalar::{Mat3, Scalar, Vec3, vec3};

/// The decomposition.
#[derive(Clone, Copy, Debug)]
pub struct SignedSvd<S> {
    /// Rotation of the principal axes in space; columns are left singular vectors.
    pub u: Mat3<S>,
    /// Signed singular values: principal stretches, largest first.
    pub sigma: [S; 3],
    /// Principal axes of the material; columns are right singular vectors.
    pub v: Mat3<S>,
}

/// Most sweeps of three rotations. Convergence is quadratic: two or three sweeps do for tissue, the
/// rest is for odd inputs.
const MOST_SWEEPS: usize = 6;

/// An off-diagonal entry is zero when it is below this share of round-off: what it would turn the
/// axes by is then lost in the arithmetic anyway. Far smaller values would be rotated away too, at
/// the price of denormal numbers, which are slow.
const NEGLIGIBLE: f64 = 0.01;

/// Keeps a zero matrix from dividing by zero: its square must not be lost in the number format, in
/// single precision not even where denormals are.
const SMALLEST: [f64; 2] = [1e-18, 1e-30];

/// A singular value below this fraction of the largest has no usable direction.
const DIRECTIONLESS: f64 = 1e-6;

/// Decomposes any matrix; collapsed ones too, with an arbitrary rotation then.
#[inline(always)]
pub fn signed_svd<S: Scalar>(f: &Mat3<S>) -> SignedSvd<S> {
    // `F^T F`, upper triangle. Its rounding is relative to the largest stretch squared: a stretch below 3e-4 of the
    // largest is lost in single precision. The axes are then still orthonormal, and the lengths below come from `F`.
    let columns = f.columns;
    let mut a = [[S::ZERO; 3]; 3];
    for p in 0..3 {
        for q in p..3 {
            a[p][q] = columns[p].dot(columns[q]);
        }
    }
    let mut v = Mat3::IDENTITY.columns;
    for _ in 0..MOST_SWEEPS {
        let largest = a[0][1].abs().max(a[0][2].abs()).max(a[1][2].abs());
        let smallest = a[0][0].min(a[1][1]).min(a[2][2]);
        // Only when every lane is done. A lane that was done earlier goes on with rotations by zero, so that its bits do
        // not depend on its neighbours. That holds as long as this threshold does not exceed the one in `rotate`.
        if S::all(largest.less(negligible(smallest, smallest))) {
            break;
        }
        rotate(&mut a, &mut v, 0, 1);
        rotate(&mut a, &mut v, 0, 2);
        rotate(&mut a, &mut v, 1, 2);
    }
    let mut values = [a[0][0], a[1][1], a[2][2]];
    // Three exchanges sort three values. The largest has to come first, because Gram-Schmidt begins with it.
    order(&mut values, &mut v, 0, 1);
    order(&mut values, &mut v, 1, 2);
    order(&mut values, &mut v, 0, 1);

    let [f1, f2, f3] = [*f * v[0], *f * v[1], *f * v[2]];
    // `F v_i` are orthogonal but for rounding, and the first is the longest: its direction is the best known. `F` has
    // no unit and lengths of 1 at rest, so the bound is a number. `select` computes both sides; one may be NaN.
    let length = f1.length();
    let collapsed = length.less(S::from_f64(DIRECTIONLESS));
    let x_axis = vec3(S::ONE, S::ZERO, S::ZERO);
    let u1 = select(collapsed, x_axis, f1 * (S::ONE / length));
    // Against the larger of the first length and 1: of a tetrahedron squeezed to a line no direction across it
    // means anything, and rounding must not be scaled up to a unit vector.
    let across = f2 - u1 * u1.dot(f2);
    let width = across.length();
    let directionless = width.less(length.max(S::ONE) * S::from_f64(DIRECTIONLESS));
    let u2 = select(directionless, any_normal(u1), across * (S::ONE / width));
    // Not from `F v_3`: a cross product makes `det U = 1`, and `sigma_3` gets the sign of `det F`.
    let u3 = u1.cross(u2);
    SignedSvd {
        u: Mat3::from_columns(u1, u2, u3),
        sigma: [u1.dot(f1), u2.dot(f2), u3.dot(f3)],
        v: Mat3::from_columns(v[0], v[1], v[2]),
    }
}

/// Below this an entry between two diagonal ones is zero.
#[inline(always)]
fn negligible<S: Scalar>(app: S, aqq: S) -> S {
    let smallest = if S::EPSILON > 1e-10 { SMALLEST[0] } else { SMALLEST[1] };
    (app + aqq) * S::from_f64(NEGLIGIBLE * S::EPSILON) + S::from_f64(smallest)
}

/// One Jacobi rotation that zeroes entry `(p, q)`, `p < q`, of the upper triangle.
#[inline(always)]
fn rotate<S: Scalar>(a: &mut [[S; 3]; 3], v: &mut [Vec3<S>; 3], p: usize, q: usize) {
    let apq = a[p][q];
    // The tangent of the smaller of the two angles that do it.
    // `t = 2 a_pq/(gap +- sqrt(gap^2 + 4 a_pq^2))` with the sign of `gap`: nothing cancels and `|t| <= 1`. The other
    // root turns by more than 45 degrees and exchanges the axes, with which sweeps need not converge.
    let (gap, twice) = (a[q][q] - a[p][p], S::TWO * apq);
    let root = (gap * gap + twice * twice).sqrt();
    let t = twice / (gap + S::select(gap.less(S::ZERO), -root, root));
    // Also where `gap` and `a_pq` are zero, and `t` is 0/0.
    let t = S::select(apq.abs().less(negligible(a[p][p], a[q][q])), S::ZERO, t);
    let c = S::ONE / (t * t + S::ONE).sqrt();
    let s = t * c;
    // By `t a_pq` and not by squares of sine and cosine: what one entry loses the other gains, but for rounding.
    a[p][p] -= t * apq;
    a[q][q] += t * apq;
    a[p][q] = S::ZERO;
    // The third index; its entries stand above the diagonal.
    let r = 3 - p - q;
    let (rp, rq) = ((p.min(r), p.max(r)), (q.min(r), q.max(r)));
    let (arp, arq) = (a[rp.0][rp.1], a[rq.0][rq.1]);
    a[rp.0][rp.1] = c * arp - s * arq;
    a[rq.0][rq.1] = s * arp + c * arq;
    let (vp, vq) = (v[p], v[q]);
    v[p] = vp * c - vq * s;
    v[q] = vp * s + vq * c;
}

/// Puts the larger value first; the sign keeps the axes right-handed.
#[inline(always)]
fn order<S: Scalar>(values: &mut [S; 3], v: &mut [Vec3<S>; 3], i: usize, j: usize) {
    let swap = values[i].less(values[j]);
    (values[i], values[j]) =
        (S::select(swap, values[j], values[i]), S::select(swap, values[i], values[j]));
    (v[i], v[j]) = (select(swap, v[j], v[i]), select(swap, -v[i], v[j]));
}

/// A unit vector normal to a unit vector.
#[inline(always)]
fn any_normal<S: Scalar>(u: Vec3<S>) -> Vec3<S> {
    let along_x = S::from_f64(0.6).less(u.x.abs());
    let x_axis = vec3(S::ONE, S::ZERO, S::ZERO);
    let y_axis = vec3(S::ZERO, S::ONE, S::ZERO);
    let axis = select(along_x, y_axis, x_axis);
    let normal = axis - u * u.dot(axis);
    normal * (S::ONE / normal.length())
}

#[inline(always)]
fn select<S: Scalar>(mask: S::Mask, if_true: Vec3<S>, if_false: Vec3<S>) -> Vec3<S> {
    vec3(
        S::select(mask, if_true.x, if_false.x),
        S::select(mask, if_true.y, if_false.y),
        S::select(mask, if_true.z, if_false.z),
    )
}
