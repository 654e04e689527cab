// Kinematics of linear tetrahedra; `mod.rs` holds the derivations.
//
//   F = Ds Dm^-1 = sum_i x_i g_i^T
//   g_1..g_3 the rows of Dm^-1,  g_0 = -(g_1 + g_2 + g_3)
//
// Pure functions with the names of their Rust twins, prefixed by the module. Every index is a
// constant: what is indexed by a variable lives in memory instead of registers.

const IDENTITY = mat3x3f(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);

// The changes by a local solve of a tetrahedron with six constraints.
struct TetCorrection6 {
    // Change of the multipliers [J s^2].
    multipliers: array<f32, 6>,
    // Change of the corner positions [m].
    positions: array<vec3f, 4>,
}

// The changes by a local solve of a tetrahedron with two constraints.
struct TetCorrection2 {
    // Change of the multipliers [J s^2].
    multipliers: array<f32, 2>,
    // Change of the corner positions [m].
    positions: array<vec3f, 4>,
}

// The load of a constraint with its multipliers on one corner.
struct CornerLoad {
    // `grad C^T lambda` [N s^2].
    impulse: vec3f,
    // Bound on the row of the geometric stiffness [kg].
    mass_bound: f32,
}

// A symmetric 3 x 3 matrix.
struct Symmetric {
    xx: f32,
    yy: f32,
    zz: f32,
    yz: f32,
    xz: f32,
    xy: f32,
}

// The lower triangle of a symmetric 6 x 6 matrix, row by row.
struct Lower6 {
    a00: f32,
    a10: f32, a11: f32,
    a20: f32, a21: f32, a22: f32,
    a30: f32, a31: f32, a32: f32, a33: f32,
    a40: f32, a41: f32, a42: f32, a43: f32, a44: f32,
    a50: f32, a51: f32, a52: f32, a53: f32, a54: f32, a55: f32,
}

// The compliance `D^-1` of an isotropic law [1/Pa], or a multiple of it.
struct Compliance {
    normal: f32,
    cross: f32,
    shear: f32,
}

// Constants of one material: the two Lame parameters [Pa], the compliance [1/Pa] and the
// retardation time [s] of the viscous stress. 24 bytes.
struct Material {
    lame_lambda: f32,
    lame_mu: f32,
    compliance: Compliance,
    viscosity: f32,
}

// A material without its compliance.
struct TissueConstants {
    lame_lambda: f32,
    lame_mu: f32,
    viscosity: f32,
}

// A multiple of it.
fn compliance_scaled(compliance: Compliance, factor: f32) -> Compliance {
    return Compliance(
        compliance.normal * factor,
        compliance.cross * factor,
        compliance.shear * factor,
    );
}

// The matrix times six components.
fn compliance_times(compliance: Compliance, v: array<f32, 6>) -> array<f32, 6> {
    let shared_part = compliance.cross * (v[0] + v[1] + v[2]);
    let own = compliance.normal - compliance.cross;
    return array<f32, 6>(
        shared_part + own * v[0],
        shared_part + own * v[1],
        shared_part + own * v[2],
        compliance.shear * v[3],
        compliance.shear * v[4],
        compliance.shear * v[5],
    );
}

// Edge vectors from corner 0 as columns [m].
fn edge_matrix(x: array<vec3f, 4>) -> mat3x3f {
    return mat3x3f(x[1] - x[0], x[2] - x[0], x[3] - x[0]);
}

// `F = Ds Dm^-1`.
fn deformation_gradient(x: array<vec3f, 4>, inverse_rest_shape: mat3x3f) -> mat3x3f {
    return edge_matrix(x) * inverse_rest_shape;
}

// Gradients [1/m] of the four linear shape functions.
fn shape_gradients(inverse_rest_shape: mat3x3f) -> array<vec3f, 4> {
    let g = transpose(inverse_rest_shape);
    return array<vec3f, 4>(-(g[0] + g[1] + g[2]), g[0], g[1], g[2]);
}

// Internal forces [N] on the corners: `f_i = -V P g_i`, `P` the first Piola stress [Pa].
fn internal_forces(
    piola: mat3x3f,
    inverse_rest_shape: mat3x3f,
    rest_volume: f32,
) -> array<vec3f, 4> {
    let w = array<f32, 4>(-rest_volume, -rest_volume, -rest_volume, -rest_volume);
    return weighted_images(piola, shape_gradients(inverse_rest_shape), w);
}

// The derivative of the determinant; `cof F = det F * F^-T`, for singular matrices too.
fn cofactor(f: mat3x3f) -> mat3x3f {
    return mat3x3f(cross(f[1], f[2]), cross(f[2], f[0]), cross(f[0], f[1]));
}

// `A : B`.
fn inner_product(a: mat3x3f, b: mat3x3f) -> f32 {
    return dot(a[0], b[0]) + dot(a[1], b[1]) + dot(a[2], b[2]);
}

// Squared Frobenius norm.
fn norm_squared(f: mat3x3f) -> f32 {
    return dot(f[0], f[0]) + dot(f[1], f[1]) + dot(f[2], f[2]);
}

// `sum_i w_i g_i g_i^T` over the corners.
fn weighted_products(g: array<vec3f, 4>, w: array<f32, 4>) -> Symmetric {
    let h0 = g[0] * w[0];
    let h1 = g[1] * w[1];
    let h2 = g[2] * w[2];
    let h3 = g[3] * w[3];
    let diagonal = (h0 * g[0] + h1 * g[1]) + (h2 * g[2] + h3 * g[3]);
    // yz, xz, xy.
    let mixed = (h0.yxx * g[0].zzy + h1.yxx * g[1].zzy) + (h2.yxx * g[2].zzy + h3.yxx * g[3].zzy);
    return Symmetric(diagonal.x, diagonal.y, diagonal.z, mixed.x, mixed.y, mixed.z);
}

// `w_i P g_i` for each corner; as `g_0 = -(g_1 + g_2 + g_3)`, the first is the sum of the others
// turned round.
fn weighted_images(p: mat3x3f, g: array<vec3f, 4>, w: array<f32, 4>) -> array<vec3f, 4> {
    let a = p * g[1];
    let b = p * g[2];
    let c = p * g[3];
    return array<vec3f, 4>((a + b + c) * -w[0], a * w[1], b * w[2], c * w[3]);
}

// Solves `A x = b` for a symmetric positive definite matrix, `A = L D L^T`: `p` are the inverse
// pivots, `l` the entries of `L` and `t` those of `L D`. No square roots and no branches.
fn solve_symmetric(a: Lower6, b: array<f32, 6>) -> array<f32, 6> {
    let p0 = 1.0 / a.a00;
    let t10 = a.a10;
    let t20 = a.a20;
    let t30 = a.a30;
    let t40 = a.a40;
    let t50 = a.a50;
    let l10 = t10 * p0;
    let l20 = t20 * p0;
    let l30 = t30 * p0;
    let l40 = t40 * p0;
    let l50 = t50 * p0;

    let p1 = 1.0 / (a.a11 - l10 * t10);
    let t21 = a.a21 - l10 * t20;
    let t31 = a.a31 - l10 * t30;
    let t41 = a.a41 - l10 * t40;
    let t51 = a.a51 - l10 * t50;
    let l21 = t21 * p1;
    let l31 = t31 * p1;
    let l41 = t41 * p1;
    let l51 = t51 * p1;

    let p2 = 1.0 / (a.a22 - l20 * t20 - l21 * t21);
    let t32 = a.a32 - l20 * t30 - l21 * t31;
    let t42 = a.a42 - l20 * t40 - l21 * t41;
    let t52 = a.a52 - l20 * t50 - l21 * t51;
    let l32 = t32 * p2;
    let l42 = t42 * p2;
    let l52 = t52 * p2;

    let p3 = 1.0 / (a.a33 - l30 * t30 - l31 * t31 - l32 * t32);
    let t43 = a.a43 - l30 * t40 - l31 * t41 - l32 * t42;
    let t53 = a.a53 - l30 * t50 - l31 * t51 - l32 * t52;
    let l43 = t43 * p3;
    let l53 = t53 * p3;

    let p4 = 1.0 / (a.a44 - l40 * t40 - l41 * t41 - l42 * t42 - l43 * t43);
    let t54 = a.a54 - l40 * t50 - l41 * t51 - l42 * t52 - l43 * t53;
    let l54 = t54 * p4;

    let p5 = 1.0 / (a.a55 - l50 * t50 - l51 * t51 - l52 * t52 - l53 * t53 - l54 * t54);

    let y0 = b[0];
    let y1 = b[1] - l10 * y0;
    let y2 = b[2] - l20 * y0 - l21 * y1;
    let y3 = b[3] - l30 * y0 - l31 * y1 - l32 * y2;
    let y4 = b[4] - l40 * y0 - l41 * y1 - l42 * y2 - l43 * y3;
    let y5 = b[5] - l50 * y0 - l51 * y1 - l52 * y2 - l53 * y3 - l54 * y4;

    let x5 = y5 * p5;
    let x4 = y4 * p4 - l54 * x5;
    let x3 = y3 * p3 - l43 * x4 - l53 * x5;
    let x2 = y2 * p2 - l32 * x3 - l42 * x4 - l52 * x5;
    let x1 = y1 * p1 - l21 * x2 - l31 * x3 - l41 * x4 - l51 * x5;
    let x0 = y0 * p0 - l10 * x1 - l20 * x2 - l30 * x3 - l40 * x4 - l50 * x5;
    return array<f32, 6>(x0, x1, x2, x3, x4, x5);
}
