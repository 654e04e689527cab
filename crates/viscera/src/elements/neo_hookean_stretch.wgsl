// Stable neo-Hookean tetrahedron in the stretch form: six multipliers conjugate to the signed polar
// stretch; `neo_hookean_stretch.rs` holds the derivation.
//
//   F = U diag(s) V^T                            signed singular values
//   t_i = mu s_i + e s_j s_k,  e = lh (J - a)    Biot stress, principal values
//   L' = V^T L V,  g' = V^T g,  impulse on a corner U L' g'
//   r = (L'_11 + s t_1, L'_22 + s t_2, L'_33 + s t_3, L'_23, L'_13, L'_12),  s = V dt^2
//   (C + sum_i w_i B_i B_i^T) d = -C r;  L' += d;  x_i += w_i U (D g'_i)
//
// `C` preconditions only: a fixed point needs `r = 0`, so clamps never move it.

// The stiffness of the principal stretches counts as positive while its minors exceed this fraction
// of those of `mu I`.
const NEO_HOOKEAN_STRETCH_CLEARLY_POSITIVE = 1e-3;

// Smallest shear stiffness as a fraction of mu.
const NEO_HOOKEAN_STRETCH_SOFTEST_SHEAR = 0.1;

// Smallest `s_i + s_j` in the mass bound.
const NEO_HOOKEAN_STRETCH_SMALLEST_PAIR = 0.3;

// Principal Biot stresses `t` [Pa], and `e` [Pa].
struct BiotStress {
    t: vec3f,
    e: f32,
}

// A symmetric 3 x 3 matrix by its lower triangle.
struct Lower3 {
    a00: f32,
    a10: f32, a11: f32,
    a20: f32, a21: f32, a22: f32,
}

fn neo_hookean_stretch_biot_stress(sigma: vec3f, lame_lambda: f32, lame_mu: f32) -> BiotStress {
    let volume_modulus = lame_lambda + lame_mu;
    let e = volume_modulus * (sigma.x * sigma.y * sigma.z - 1.0) - lame_mu;
    return BiotStress(lame_mu * sigma + e * sigma.yxx * sigma.zzy, e);
}

// `V^T L V` as six components.
fn neo_hookean_stretch_turn(v: mat3x3f, components: array<f32, 6>) -> array<f32, 6> {
    let image = green_strain_symmetric(components) * v;
    return array<f32, 6>(
        dot(v[0], image[0]),
        dot(v[1], image[1]),
        dot(v[2], image[2]),
        dot(v[1], image[2]),
        dot(v[0], image[2]),
        dot(v[0], image[1]),
    );
}

// The multipliers at which the residual of the solve is zero: `L = -V dt^2 V diag(t) V^T`.
fn neo_hookean_stretch_constitutive_multipliers(
    f: mat3x3f,
    lame_lambda: f32,
    lame_mu: f32,
    step_volume: f32,
) -> array<f32, 6> {
    let svd = signed_svd(f);
    let t = neo_hookean_stretch_biot_stress(svd.sigma, lame_lambda, lame_mu).t * -step_volume;
    return neo_hookean_stretch_turn(transpose(svd.v), array<f32, 6>(t.x, t.y, t.z, 0.0, 0.0, 0.0));
}

// Stiffness [Pa] of the principal stretches, whose indefinite part is that of `e`.
fn neo_hookean_stretch_stretch_stiffness(
    sigma: vec3f,
    volume_modulus: f32,
    lame_mu: f32,
    e: f32,
) -> Lower3 {
    let c = sigma.yxx * sigma.zzy;
    return Lower3(
        lame_mu + volume_modulus * c.x * c.x,

        volume_modulus * c.y * c.x + e * sigma.z,
        lame_mu + volume_modulus * c.y * c.y,

        volume_modulus * c.z * c.x + e * sigma.y,
        volume_modulus * c.z * c.y + e * sigma.x,
        lame_mu + volume_modulus * c.z * c.z,
    );
}

// The leading minor of two rows.
fn neo_hookean_stretch_minor(d: Lower3) -> f32 {
    return d.a00 * d.a11 - d.a10 * d.a10;
}

fn neo_hookean_stretch_determinant(d: Lower3) -> f32 {
    return d.a00 * (d.a11 * d.a22 - d.a21 * d.a21) - d.a10 * (d.a10 * d.a22 - d.a21 * d.a20)
        + d.a20 * (d.a10 * d.a21 - d.a11 * d.a20);
}

// Inverse of the stiffness of the principal stretches, times `1/(V dt^2)`.
fn neo_hookean_stretch_stretch_compliance(
    sigma: vec3f,
    lame_lambda: f32,
    lame_mu: f32,
    e: f32,
    step_volume: f32,
) -> Lower3 {
    let volume_modulus = lame_lambda + lame_mu;
    let full = neo_hookean_stretch_stretch_stiffness(sigma, volume_modulus, lame_mu, e);
    let smallest = NEO_HOOKEAN_STRETCH_CLEARLY_POSITIVE * lame_mu * lame_mu;
    let indefinite = neo_hookean_stretch_minor(full) < smallest
        || neo_hookean_stretch_determinant(full) < smallest * lame_mu;
    let kept = select(e, 0.0, indefinite);
    let d = neo_hookean_stretch_stretch_stiffness(sigma, volume_modulus, lame_mu, kept);
    let scale = 1.0 / (neo_hookean_stretch_determinant(d) * step_volume);
    return Lower3(
        (d.a11 * d.a22 - d.a21 * d.a21) * scale,

        (d.a20 * d.a21 - d.a10 * d.a22) * scale,
        (d.a00 * d.a22 - d.a20 * d.a20) * scale,

        (d.a10 * d.a21 - d.a20 * d.a11) * scale,
        (d.a10 * d.a20 - d.a00 * d.a21) * scale,
        neo_hookean_stretch_minor(d) * scale,
    );
}

// Compliance of the shears in the planes across the principal axes, with a floor of the stiffness.
fn neo_hookean_stretch_shear_compliance(
    sigma: vec3f,
    lame_mu: f32,
    e: f32,
    step_volume: f32,
) -> vec3f {
    let softest = vec3f(NEO_HOOKEAN_STRETCH_SOFTEST_SHEAR * lame_mu);
    return 2.0 / (max(softest, lame_mu - e * sigma) * step_volume);
}

// One block solve. `w` are the inverse masses [1/kg] of the corners, `multipliers` the components
// of `L` [J s^2] in material axes, `step_volume = V dt^2` [m^3 s^2].
fn neo_hookean_stretch_solve(
    x: array<vec3f, 4>,
    w: array<f32, 4>,
    inverse_rest_shape: mat3x3f,
    multipliers: array<f32, 6>,
    lame_lambda: f32,
    lame_mu: f32,
    step_volume: f32,
) -> TetCorrection6 {
    let f = deformation_gradient(x, inverse_rest_shape);
    let svd = signed_svd(f);
    let material_axes = transpose(svd.v);
    let in_rest_axes = shape_gradients(inverse_rest_shape);
    let g = array<vec3f, 4>(
        material_axes * in_rest_axes[0],
        material_axes * in_rest_axes[1],
        material_axes * in_rest_axes[2],
        material_axes * in_rest_axes[3],
    );
    let stress = neo_hookean_stretch_biot_stress(svd.sigma, lame_lambda, lame_mu);
    let principal = neo_hookean_stretch_turn(svd.v, multipliers);
    let residual = vec3f(principal[0], principal[1], principal[2]) + step_volume * stress.t;

    // sum_i w_i B_i B_i^T, from G = sum_i w_i g'_i g'_i^T; the axes u are orthonormal.
    let p = weighted_products(g, w);
    let c = neo_hookean_stretch_stretch_compliance(
        svd.sigma, lame_lambda, lame_mu, stress.e, step_volume);
    let shears = neo_hookean_stretch_shear_compliance(svd.sigma, lame_mu, stress.e, step_volume);
    let matrix = Lower6(
        c.a00 + p.xx,
        c.a10, c.a11 + p.yy,
        c.a20, c.a21, c.a22 + p.zz,
        0.0, p.yz, p.yz, shears.x + p.yy + p.zz,
        p.xz, 0.0, p.xz, p.xy, shears.y + p.xx + p.zz,
        p.xy, p.xy, 0.0, p.xz, p.yz, shears.z + p.xx + p.yy,
    );
    let right = array<f32, 6>(
        -(c.a00 * residual.x + c.a10 * residual.y + c.a20 * residual.z),
        -(c.a10 * residual.x + c.a11 * residual.y + c.a21 * residual.z),
        -(c.a20 * residual.x + c.a21 * residual.y + c.a22 * residual.z),
        -(shears.x * principal[3]),
        -(shears.y * principal[4]),
        -(shears.z * principal[5]),
    );
    let change = solve_symmetric(matrix, right);
    let positions = weighted_images(svd.u * green_strain_symmetric(change), g, w);
    return TetCorrection6(neo_hookean_stretch_turn(material_axes, change), positions);
}

// `R L g` on each corner, and the bound of its geometric stiffness `tau sum_b |g_i . g_b|`
// with `tau = max_(i<j) (|L'_ii + L'_jj| + 2 max |L'_offdiagonal|)/(s_i + s_j)`.
fn neo_hookean_stretch_corner_loads(
    x: array<vec3f, 4>,
    inverse_rest_shape: mat3x3f,
    multipliers: array<f32, 6>,
) -> array<CornerLoad, 4> {
    let f = deformation_gradient(x, inverse_rest_shape);
    let svd = signed_svd(f);
    let g = shape_gradients(inverse_rest_shape);
    let l = neo_hookean_stretch_turn(svd.v, multipliers);
    let off_diagonal = 2.0 * max(max(abs(l[3]), abs(l[4])), abs(l[5]));
    // Pairs (0, 1), (0, 2), (1, 2).
    let sums = abs(vec3f(l[0] + l[1], l[0] + l[2], l[1] + l[2]));
    let pairs = svd.sigma.xxy + svd.sigma.yzz;
    let stiffness =
        (sums + off_diagonal) / max(pairs, vec3f(NEO_HOOKEAN_STRETCH_SMALLEST_PAIR));
    let tau = max(max(stiffness.x, stiffness.y), stiffness.z);
    let stress = svd.u * transpose(svd.v) * green_strain_symmetric(multipliers);
    return array<CornerLoad, 4>(
        CornerLoad(stress * g[0], tau * neo_hookean_stretch_reach(g, g[0])),
        CornerLoad(stress * g[1], tau * neo_hookean_stretch_reach(g, g[1])),
        CornerLoad(stress * g[2], tau * neo_hookean_stretch_reach(g, g[2])),
        CornerLoad(stress * g[3], tau * neo_hookean_stretch_reach(g, g[3])),
    );
}

// `sum_b |g_i . g_b|` of one corner.
fn neo_hookean_stretch_reach(g: array<vec3f, 4>, own: vec3f) -> f32 {
    return abs(dot(own, g[0])) + abs(dot(own, g[1])) + abs(dot(own, g[2])) + abs(dot(own, g[3]));
}
