// Stable neo-Hookean tetrahedron as a pair of constraints; `neo_hookean_pair.rs` holds the reasons.
//
//   C_H = J - a, compliance 1/(lh V);  C_D = |F|, compliance 1/(mu V)
//
// solved as one 2 x 2 block (Macklin and Mueller, "A Constraint-based Formulation of Stable
// Neo-Hookean Materials", MIG 2021, section 4, solve them one after the other).

// Below this fraction of its rest value, `|F|` has no usable direction.
const NEO_HOOKEAN_PAIR_COLLAPSED = 1e-6;

// `(C_H, C_D) = (J - a, |F|)`.
fn neo_hookean_pair_constraints(f: mat3x3f, lame_lambda: f32, lame_mu: f32) -> array<f32, 2> {
    let offset = lame_mu / (lame_lambda + lame_mu);
    return array<f32, 2>(neo_hookean_volume_change(f) - offset, sqrt(norm_squared(f)));
}

// The multipliers at which the residual of the solve is zero: `-V dt^2 (lh C_H, mu C_D)`.
fn neo_hookean_pair_constitutive_multipliers(
    f: mat3x3f,
    lame_lambda: f32,
    lame_mu: f32,
    step_volume: f32,
) -> array<f32, 2> {
    let c = neo_hookean_pair_constraints(f, lame_lambda, lame_mu);
    return array<f32, 2>(
        -(lame_lambda + lame_mu) * step_volume * c[0],
        -lame_mu * step_volume * c[1],
    );
}

// `1/|F|`, bounded where the tetrahedron has collapsed to a point.
fn neo_hookean_pair_inverse_norm(f: mat3x3f) -> f32 {
    return 1.0 / max(sqrt(norm_squared(f)), NEO_HOOKEAN_PAIR_COLLAPSED);
}

// One 2 x 2 block solve. `step_volume = V dt^2` [m^3 s^2]; `w` are the inverse masses [1/kg] of the
// corners.
fn neo_hookean_pair_solve(
    x: array<vec3f, 4>,
    w: array<f32, 4>,
    inverse_rest_shape: mat3x3f,
    multipliers: array<f32, 2>,
    lame_lambda: f32,
    lame_mu: f32,
    step_volume: f32,
) -> TetCorrection2 {
    let f = deformation_gradient(x, inverse_rest_shape);
    let g = shape_gradients(inverse_rest_shape);
    let area = cofactor(f);
    let scale = neo_hookean_pair_inverse_norm(f);
    // Gradients of C_H and of C_D.
    let h0 = area * g[0];
    let h1 = area * g[1];
    let h2 = area * g[2];
    let h3 = area * g[3];
    let d0 = f * g[0] * scale;
    let d1 = f * g[1] * scale;
    let d2 = f * g[2] * scale;
    let d3 = f * g[3] * scale;
    let c = neo_hookean_pair_constraints(f, lame_lambda, lame_mu);
    let volume_compliance = 1.0 / ((lame_lambda + lame_mu) * step_volume);
    let shear_compliance = 1.0 / (lame_mu * step_volume);

    let a00 = volume_compliance
        + w[0] * dot(h0, h0) + w[1] * dot(h1, h1) + w[2] * dot(h2, h2) + w[3] * dot(h3, h3);
    let a01 = w[0] * dot(h0, d0) + w[1] * dot(h1, d1) + w[2] * dot(h2, d2) + w[3] * dot(h3, d3);
    let a11 = shear_compliance
        + w[0] * dot(d0, d0) + w[1] * dot(d1, d1) + w[2] * dot(d2, d2) + w[3] * dot(d3, d3);
    let b0 = -c[0] - volume_compliance * multipliers[0];
    let b1 = -c[1] - shear_compliance * multipliers[1];
    // Elimination rather than Cramer's rule: the products a00 a11 and a01^2 may nearly cancel.
    let ratio = a01 / a00;
    let shear_change = (b1 - ratio * b0) / (a11 - ratio * a01);
    let volume_change = (b0 - a01 * shear_change) / a00;
    let positions = array<vec3f, 4>(
        (h0 * volume_change + d0 * shear_change) * w[0],
        (h1 * volume_change + d1 * shear_change) * w[1],
        (h2 * volume_change + d2 * shear_change) * w[2],
        (h3 * volume_change + d3 * shear_change) * w[3],
    );
    return TetCorrection2(array<f32, 2>(volume_change, shear_change), positions);
}

// `grad C^T l` on each corner, and the bound of its geometric stiffness:
// `|l_D|/|F| sum_b |g_i . g_b| + |l_H| sum_{b != i} |F (g_i x g_b)|`.
fn neo_hookean_pair_corner_loads(
    x: array<vec3f, 4>,
    inverse_rest_shape: mat3x3f,
    multipliers: array<f32, 2>,
) -> array<CornerLoad, 4> {
    let f = deformation_gradient(x, inverse_rest_shape);
    let g = shape_gradients(inverse_rest_shape);
    let volume = multipliers[0];
    let shear = multipliers[1] * neo_hookean_pair_inverse_norm(f);
    let stress = cofactor(f) * volume + f * shear;
    let sizes = abs(vec2f(volume, shear));
    return array<CornerLoad, 4>(
        CornerLoad(stress * g[0], neo_hookean_pair_mass_bound(f, sizes, g[0], g[1], g[2], g[3])),
        CornerLoad(stress * g[1], neo_hookean_pair_mass_bound(f, sizes, g[1], g[0], g[2], g[3])),
        CornerLoad(stress * g[2], neo_hookean_pair_mass_bound(f, sizes, g[2], g[0], g[1], g[3])),
        CornerLoad(stress * g[3], neo_hookean_pair_mass_bound(f, sizes, g[3], g[0], g[1], g[2])),
    );
}

// Of the corner with shape gradient `own`; `sizes` are `|l_H|` and `|l_D|/|F|`.
fn neo_hookean_pair_mass_bound(
    f: mat3x3f,
    sizes: vec2f,
    own: vec3f,
    p: vec3f,
    q: vec3f,
    r: vec3f,
) -> f32 {
    let reach = dot(own, own) + abs(dot(own, p)) + abs(dot(own, q)) + abs(dot(own, r));
    let twist = length(f * cross(own, p)) + length(f * cross(own, q)) + length(f * cross(own, r));
    return sizes.y * reach + sizes.x * twist;
}
