//! Green-strain block: six constraints of a tetrahedron solved together.
//!
//! ```text
//! E = (F^T F - I)/2 = (H + H^T + H^T H)/2,  H = F - I
//! C = (E00, E11, E22, 2 E12, 2 E02, 2 E01)                      Voigt order, engineering shear
//! W = C^T D C / 2 = mu E:E + lambda/2 tr(E)^2                   Saint Venant-Kirchhoff
//! [grad C M^-1 grad C^T + a~] dl = -C - a~ l,   a~ = D^-1/(V dt^2)
//! dx_i = w_i grad_i C^T dl = w_i F (L g_i),     L the symmetric matrix of dl
//! ```
//!
//! XPBD: Macklin, Mueller, Chentanez, "XPBD", MIG 2016, eq. 18; here with all six components of
//! the Green strain as one block, so that the compliance is the material's full 6 x 6.
//!
//! From `F` to `F + D` the strain changes by a quadratic polynomial, and the energy without a difference of energies:
//!
//! ```text
//! dE = E(F + D) - E(F) = sym((F + D/2)^T D)
//! dW = dE : C : (E + dE/2),     C the isotropic stiffness
//! D : d2W/dF2 : D = sym(F^T D) : C : sym(F^T D) + S : D^T D,   S = C E
//! ```
//!
//! The strain cannot see inversion (`E(RF) = E(F)` for reflections `R` too): prefer the stable
//! neo-Hookean element where tissue may turn inside out.

use super::{
    CornerLoad, Symmetric, TetCorrection, shape_gradients, solve_symmetric, weighted_images,
    weighted_products,
};
use crate::material::Compliance;
use crate::scalar::{Mat3, Scalar, Vec3, vec3};

/// A symmetric 6 x 6 matrix, or six constraint values.
pub type Voigt<S> = [S; 6];

/// The pairs of axes of the six components.
pub const PAIRS: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)];

/// `C = (E00, E11, E22, 2 E12, 2 E02, 2 E01)`, from `H = F - I` so that small strains keep their
/// digits in single precision.
#[inline(always)]
pub fn strain<S: Scalar>(deformation_gradient: &Mat3<S>) -> Voigt<S> {
    let h = *deformation_gradient - Mat3::IDENTITY;
    let [a, b, c] = h.columns;
    [
        a.x + S::HALF * a.dot(a),
        b.y + S::HALF * b.dot(b),
        c.z + S::HALF * c.dot(c),
        (b.z + c.y) + b.dot(c),
        (a.z + c.x) + a.dot(c),
        (a.y + b.x) + a.dot(b),
    ]
}

/// Components of `sym(F^T D)`, the derivative of the strain along `d`. The second derivative, `D^T D`, is this with `d`
/// in the place of `f`.
#[inline(always)]
fn strain_along<S: Scalar>(f: &Mat3<S>, d: &Mat3<S>) -> Voigt<S> {
    let ([a, b, c], [u, v, w]) = (f.columns, d.columns);
    [a.dot(u), b.dot(v), c.dot(w), b.dot(w) + c.dot(v), a.dot(w) + c.dot(u), a.dot(v) + b.dot(u)]
}

/// `E(F + D) - E(F)`, in the components of [`strain`]: with the digits of `d` however small it is.
#[inline(always)]
pub fn strain_change<S: Scalar>(f: &Mat3<S>, d: &Mat3<S>) -> Voigt<S> {
    strain_along(&(*f + *d * S::HALF), d)
}

/// The symmetric 3 x 3 matrix whose components are `v` (without halving the shear).
#[inline(always)]
pub fn symmetric<S: Scalar>(v: &Voigt<S>) -> Mat3<S> {
    Mat3::from_columns(vec3(v[0], v[5], v[4]), vec3(v[5], v[1], v[3]), vec3(v[4], v[3], v[2]))
}

/// Six components times a number.
#[inline(always)]
pub fn scaled<S: Scalar>(mut v: Voigt<S>, factor: S) -> Voigt<S> {
    for component in &mut v {
        *component *= factor;
    }
    v
}

/// Energy density [Pa]: `W = C^T D C / 2` with `D` isotropic.
#[inline(always)]
pub fn energy_density<S: Scalar>(c: &Voigt<S>, lame_lambda: S, lame_mu: S) -> S {
    let trace = c[0] + c[1] + c[2];
    let direct = c[0] * c[0] + c[1] * c[1] + c[2] * c[2];
    let shear = c[3] * c[3] + c[4] * c[4] + c[5] * c[5];
    lame_mu * (direct + S::HALF * shear) + S::HALF * lame_lambda * trace * trace
}

/// Second Piola stress [Pa]: `D C`, the components of `S = 2 mu E + lambda tr(E) I`.
#[inline(always)]
fn second_piola<S: Scalar>(c: &Voigt<S>, lame_lambda: S, lame_mu: S) -> Voigt<S> {
    let pressure = lame_lambda * (c[0] + c[1] + c[2]);
    let twice = S::TWO * lame_mu;
    [
        twice * c[0] + pressure,
        twice * c[1] + pressure,
        twice * c[2] + pressure,
        lame_mu * c[3],
        lame_mu * c[4],
        lame_mu * c[5],
    ]
}

/// Stress times strain [Pa]: `S : E`; the strain's shear is engineering shear, so every component counts once.
#[inline(always)]
fn work<S: Scalar>(stress: &Voigt<S>, strain: &Voigt<S>) -> S {
    let direct = stress[0] * strain[0] + stress[1] * strain[1] + stress[2] * strain[2];
    direct + (stress[3] * strain[3] + stress[4] * strain[4] + stress[5] * strain[5])
}

/// `W(c + change) - W(c)` [Pa] of the quadratic form [`energy_density`]: `change^T D (c + change/2)`. Its round-off
/// is that of its terms, which vanish with the change; that of a difference of two energies does not.
#[inline(always)]
pub fn energy_density_change<S: Scalar>(
    c: &Voigt<S>,
    change: &Voigt<S>,
    lame_lambda: S,
    lame_mu: S,
) -> S {
    let mut middle = *c;
    for p in 0..6 {
        middle[p] += S::HALF * change[p];
    }
    work(&second_piola(&middle, lame_lambda, lame_mu), change)
}

/// Second derivative [Pa] along `d` of the energy density of the strain `c` at `f`, where `c` is the Green strain less
/// any constant: exact, and its positive semidefinite part `sym(F^T D) : C : sym(F^T D)`, without the stress's
/// `S : D^T D`, which is negative under pressure.
#[inline(always)]
pub fn curvature_along<S: Scalar>(
    f: &Mat3<S>,
    d: &Mat3<S>,
    c: &Voigt<S>,
    lame_lambda: S,
    lame_mu: S,
) -> [S; 2] {
    let along = strain_along(f, d);
    let bound = work(&second_piola(&along, lame_lambda, lame_mu), &along);
    let stress = second_piola(c, lame_lambda, lame_mu);
    [bound + work(&stress, &strain_along(d, d)), bound]
}

/// First Piola stress [Pa]: `P = F S`.
#[inline(always)]
pub fn piola<S: Scalar>(
    deformation_gradient: &Mat3<S>,
    c: &Voigt<S>,
    lame_lambda: S,
    lame_mu: S,
) -> Mat3<S> {
    *deformation_gradient * symmetric(&second_piola(c, lame_lambda, lame_mu))
}

/// The multipliers at which the residual of [`solve`] is zero: `l = -a~^-1 c = -s D c`, with `c` the
/// strain less its target and `s` the inverse of the compliance's scale.
#[inline(always)]
pub fn constitutive_multipliers<S: Scalar>(
    c: &Voigt<S>,
    lame_lambda: S,
    lame_mu: S,
    step_volume: S,
) -> Voigt<S> {
    scaled(second_piola(c, lame_lambda, lame_mu), -step_volume)
}

/// Gradient of each constraint by one corner position [1/m]: `E_aa: g[a] F_a`,
/// `2 E_ab: g[b] F_a + g[a] F_b`.
#[inline(always)]
pub fn gradient<S: Scalar>(deformation_gradient: &Mat3<S>, g: Vec3<S>) -> [Vec3<S>; 6] {
    let f = &deformation_gradient.columns;
    PAIRS.map(|(a, b)| if a == b { f[a] * g[a] } else { f[a] * g[b] + f[b] * g[a] })
}

/// `grad C M^-1 grad C^T + a~` [1/(kg m^2)], from `K = F^T F = I + 2 E` and
/// `G = sum_i w_i g_i g_i^T`: with `J_(ab) = g_b F_a + g_a F_b` (halved for `a = b`), the entry for
/// pairs `(a,b)`, `(c,d)` is `G_bd K_ac + G_bc K_ad + G_ad K_bc + G_ac K_bd`. Lower triangle only.
#[inline(always)]
fn system<S: Scalar>(c: &Voigt<S>, g: &Symmetric<S>, compliance: &Compliance<S>) -> [[S; 6]; 6] {
    let (kxx, kyy, kzz) = (S::ONE + S::TWO * c[0], S::ONE + S::TWO * c[1], S::ONE + S::TWO * c[2]);
    let (kyz, kxz, kxy) = (c[3], c[4], c[5]);
    let Symmetric { xx, yy, zz, yz, xz, xy } = *g;
    let Compliance { normal, cross, shear } = *compliance;
    let o = S::ZERO;
    [
        [xx * kxx + normal, o, o, o, o, o],
        [xy * kxy + cross, yy * kyy + normal, o, o, o, o],
        [xz * kxz + cross, yz * kyz + cross, zz * kzz + normal, o, o, o],
        [
            xy * kxz + xz * kxy,
            yy * kyz + yz * kyy,
            yz * kzz + zz * kyz,
            (zz * kyy + yy * kzz) + S::TWO * (yz * kyz) + shear,
            o,
            o,
        ],
        [
            xx * kxz + xz * kxx,
            xy * kyz + yz * kxy,
            xz * kzz + zz * kxz,
            (zz * kxy + xz * kyz) + (yz * kxz + xy * kzz),
            (zz * kxx + xx * kzz) + S::TWO * (xz * kxz) + shear,
            o,
        ],
        [
            xx * kxy + xy * kxx,
            xy * kyy + yy * kxy,
            xz * kyz + yz * kxz,
            (xz * kyy + yz * kxy) + (xy * kyz + yy * kxz),
            (xz * kxy + yz * kxx) + (xx * kyz + xy * kxz),
            (yy * kxx + xx * kyy) + S::TWO * (xy * kxy) + shear,
        ],
    ]
}

/// One block solve: the multiplier and position changes that satisfy the linearised constraint
/// `C(x) - target + a~ (l + dl) + grad C dx = 0`.
///
/// `w` are the inverse masses [1/kg] of the corners (of their copies), `compliance` is
/// `a~ = D^-1/(V dt^2)`.
#[inline(always)]
pub fn solve<S: Scalar>(
    x: &[Vec3<S>; 4],
    w: &[S; 4],
    inverse_rest_shape: &Mat3<S>,
    multipliers: &Voigt<S>,
    target: Option<&Voigt<S>>,
    compliance: &Compliance<S>,
) -> TetCorrection<S, 6> {
    let f = super::deformation_gradient(x, inverse_rest_shape);
    let g = shape_gradients(inverse_rest_shape);
    let c = strain(&f);
    let matrix = system(&c, &weighted_products(&g, w), compliance);
    let mut right = compliance.times(multipliers);
    for p in 0..6 {
        right[p] = -(c[p] + right[p]);
    }
    if let Some(target) = target {
        for p in 0..6 {
            right[p] += target[p];
        }
    }
    let change = solve_symmetric(matrix, right);
    let positions = weighted_images(&(f * symmetric(&change)), &g, w);
    TetCorrection { multipliers: change, positions }
}

/// `grad C^T l` on each corner, and the Gershgorin bound of its geometric stiffness
/// `sum_b |g_i^T L g_b|` (L the symmetric matrix of the multipliers; the volume is inside them).
#[inline(always)]
pub fn corner_loads<S: Scalar>(
    x: &[Vec3<S>; 4],
    inverse_rest_shape: &Mat3<S>,
    multipliers: &Voigt<S>,
) -> [CornerLoad<S>; 4] {
    let f = super::deformation_gradient(x, inverse_rest_shape);
    let g = shape_gradients(inverse_rest_shape);
    let stress = symmetric(multipliers);
    let mut loads = [CornerLoad::default(); 4];
    for i in 0..4 {
        let v = stress * g[i];
        let mass_bound = v.dot(g[0]).abs() + v.dot(g[1]).abs() + v.dot(g[2]).abs();
        loads[i] = CornerLoad { impulse: f * v, mass_bound: mass_bound + v.dot(g[3]).abs() };
    }
    loads
}
