// Signed singular value decomposition of a 3 x 3 matrix; twin of `singular_values.rs`.
//
//   F = U diag(s_1, s_2, s_3) V^T,   det U = det V = 1,   s_1 >= s_2 >= |s_3|
//
// (the convention of Irving, Teran, Fedkiw, "Invertible Finite Elements For Robust Simulation of
// Large Deformation", SCA 2004). `V` comes from cyclic Jacobi rotations of `F^T F`; `U` from `F V`,
// so that small singular values, which `F^T F` loses, are as accurate as `F`.

struct SignedSvd {
    // Rotation of the principal axes in space; columns are left singular vectors.
    u: mat3x3f,
    // Signed singular values: principal stretches, largest first.
    sigma: vec3f,
    // Principal axes of the material; columns are right singular vectors.
    v: mat3x3f,
}

// Most sweeps of three rotations.
const SINGULAR_VALUES_MOST_SWEEPS = 6;

// An off-diagonal entry is zero below this share of the diagonal: a hundredth of round-off.
const SINGULAR_VALUES_NEGLIGIBLE = 0.01 * 1.1920929e-7;

// Keeps a zero matrix from dividing by zero. Larger than in the Rust twin, since devices may take
// denormal numbers for zero: an entry that is rotated away needs a normal square. Only matrices
// below 1e-9, a thousandth of what has a direction, can tell.
const SINGULAR_VALUES_SMALLEST = 1e-18;

// A singular value below this fraction of the largest has no usable direction.
const SINGULAR_VALUES_DIRECTIONLESS = 1e-6;

// Decomposes any matrix; collapsed ones too, with an arbitrary rotation then.
fn signed_svd(f: mat3x3f) -> SignedSvd {
    // Upper triangle of `F^T F`, and the axes.
    var a00 = dot(f[0], f[0]);
    var a01 = dot(f[0], f[1]);
    var a02 = dot(f[0], f[2]);
    var a11 = dot(f[1], f[1]);
    var a12 = dot(f[1], f[2]);
    var a22 = dot(f[2], f[2]);
    var v0 = vec3f(1.0, 0.0, 0.0);
    var v1 = vec3f(0.0, 1.0, 0.0);
    var v2 = vec3f(0.0, 0.0, 1.0);
    for (var sweep = 0; sweep < SINGULAR_VALUES_MOST_SWEEPS; sweep++) {
        let largest = max(max(abs(a01), abs(a02)), abs(a12));
        let smallest = min(min(a00, a11), a22);
        if largest < singular_values_negligible(smallest, smallest) {
            break;
        }
        singular_values_rotate(&a00, &a11, &a01, &a02, &a12, &v0, &v1);
        singular_values_rotate(&a00, &a22, &a02, &a01, &a12, &v0, &v2);
        singular_values_rotate(&a11, &a22, &a12, &a01, &a02, &v1, &v2);
    }
    singular_values_order(&a00, &a11, &v0, &v1);
    singular_values_order(&a11, &a22, &v1, &v2);
    singular_values_order(&a00, &a11, &v0, &v1);

    let f1 = f * v0;
    let f2 = f * v1;
    let f3 = f * v2;
    let largest = length(f1);
    let collapsed = largest < SINGULAR_VALUES_DIRECTIONLESS;
    let u1 = select(f1 * (1.0 / largest), vec3f(1.0, 0.0, 0.0), collapsed);
    let across = f2 - u1 * dot(u1, f2);
    let width = length(across);
    let directionless = width < max(largest, 1.0) * SINGULAR_VALUES_DIRECTIONLESS;
    let u2 = select(across * (1.0 / width), singular_values_any_normal(u1), directionless);
    let u3 = cross(u1, u2);
    let sigma = vec3f(dot(u1, f1), dot(u2, f2), dot(u3, f3));
    return SignedSvd(mat3x3f(u1, u2, u3), sigma, mat3x3f(v0, v1, v2));
}

// Below this an entry between two diagonal ones is zero.
fn singular_values_negligible(app: f32, aqq: f32) -> f32 {
    return (app + aqq) * SINGULAR_VALUES_NEGLIGIBLE + SINGULAR_VALUES_SMALLEST;
}

// One Jacobi rotation of the axes `p` and `q` that zeroes their entry; `r` is the third axis.
fn singular_values_rotate(
    app: ptr<function, f32>,
    aqq: ptr<function, f32>,
    apq: ptr<function, f32>,
    arp: ptr<function, f32>,
    arq: ptr<function, f32>,
    vp: ptr<function, vec3f>,
    vq: ptr<function, vec3f>,
) {
    // The tangent of the smaller of the two angles that do it.
    let gap = *aqq - *app;
    let twice = 2.0 * *apq;
    let root = sqrt(gap * gap + twice * twice);
    let still = abs(*apq) < singular_values_negligible(*app, *aqq);
    let t = select(twice / (gap + select(root, -root, gap < 0.0)), 0.0, still);
    let c = 1.0 / sqrt(t * t + 1.0);
    let s = t * c;
    *app -= t * *apq;
    *aqq += t * *apq;
    *apq = 0.0;
    let third_p = *arp;
    let third_q = *arq;
    *arp = c * third_p - s * third_q;
    *arq = s * third_p + c * third_q;
    let axis_p = *vp;
    let axis_q = *vq;
    *vp = axis_p * c - axis_q * s;
    *vq = axis_p * s + axis_q * c;
}

// Puts the larger value first; the sign keeps the axes right-handed.
fn singular_values_order(
    value_i: ptr<function, f32>,
    value_j: ptr<function, f32>,
    vi: ptr<function, vec3f>,
    vj: ptr<function, vec3f>,
) {
    if *value_i < *value_j {
        let value = *value_i;
        *value_i = *value_j;
        *value_j = value;
        let axis = *vi;
        *vi = *vj;
        *vj = -axis;
    }
}

// A unit vector normal to a unit vector.
fn singular_values_any_normal(u: vec3f) -> vec3f {
    let axis = select(vec3f(1.0, 0.0, 0.0), vec3f(0.0, 1.0, 0.0), 0.6 < abs(u.x));
    let normal = axis - u * dot(u, axis);
    return normal * (1.0 / length(normal));
}
