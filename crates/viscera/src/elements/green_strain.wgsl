// Green-strain block: six constraints of a tetrahedron solved together; `green_strain.rs` holds the
// derivation.
//
//   C = (E00, E11, E22, 2 E12, 2 E02, 2 E01),  E = (H + H^T + H^T H)/2,  H = F - I
//   W = C^T D C / 2                                                  Saint Venant-Kirchhoff
//   [grad C M^-1 grad C^T + a~] dl = -C - a~ l,   a~ = D^-1/(V dt^2)
//   dx_i = w_i F (L g_i),                         L the symmetric matrix of dl
//
// XPBD: Macklin, Mueller, Chentanez, "XPBD", MIG 2016, eq. 18, with six components as one block.

// `C`, from `H = F - I` so that small strains keep their digits.
fn green_strain_strain(deformation_gradient: mat3x3f) -> array<f32, 6> {
    let a = deformation_gradient[0] - vec3f(1.0, 0.0, 0.0);
    let b = deformation_gradient[1] - vec3f(0.0, 1.0, 0.0);
    let c = deformation_gradient[2] - vec3f(0.0, 0.0, 1.0);
    return array<f32, 6>(
        a.x + 0.5 * dot(a, a),
        b.y + 0.5 * dot(b, b),
        c.z + 0.5 * dot(c, c),
        (b.z + c.y) + dot(b, c),
        (a.z + c.x) + dot(a, c),
        (a.y + b.x) + dot(a, b),
    );
}

// The symmetric 3 x 3 matrix whose components are `v` (without halving the shear).
fn green_strain_symmetric(v: array<f32, 6>) -> mat3x3f {
    return mat3x3f(v[0], v[5], v[4], v[5], v[1], v[3], v[4], v[3], v[2]);
}

// Six components times a number.
fn green_strain_scaled(v: array<f32, 6>, factor: f32) -> array<f32, 6> {
    return array<f32, 6>(
        v[0] * factor,
        v[1] * factor,
        v[2] * factor,
        v[3] * factor,
        v[4] * factor,
        v[5] * factor,
    );
}

// Energy density [Pa]: `W = C^T D C / 2` with `D` isotropic.
fn green_strain_energy_density(c: array<f32, 6>, lame_lambda: f32, lame_mu: f32) -> f32 {
    let trace = c[0] + c[1] + c[2];
    let direct = c[0] * c[0] + c[1] * c[1] + c[2] * c[2];
    let shear = c[3] * c[3] + c[4] * c[4] + c[5] * c[5];
    return lame_mu * (direct + 0.5 * shear) + 0.5 * lame_lambda * trace * trace;
}

// Second Piola stress [Pa]: `D C`, the components of `S = 2 mu E + lambda tr(E) I`.
fn green_strain_second_piola(
    c: array<f32, 6>,
    lame_lambda: f32,
    lame_mu: f32,
) -> array<f32, 6> {
    let pressure = lame_lambda * (c[0] + c[1] + c[2]);
    let twice = 2.0 * lame_mu;
    return array<f32, 6>(
        twice * c[0] + pressure,
        twice * c[1] + pressure,
        twice * c[2] + pressure,
        lame_mu * c[3],
        lame_mu * c[4],
        lame_mu * c[5],
    );
}

// `E(F + D) - E(F) = sym((F + D/2)^T D)`, in the components of `green_strain_strain`.
fn green_strain_strain_change(f: mat3x3f, d: mat3x3f) -> array<f32, 6> {
    let m = f + d * 0.5;
    return array<f32, 6>(
        dot(m[0], d[0]),
        dot(m[1], d[1]),
        dot(m[2], d[2]),
        dot(m[1], d[2]) + dot(m[2], d[1]),
        dot(m[0], d[2]) + dot(m[2], d[0]),
        dot(m[0], d[1]) + dot(m[1], d[0]),
    );
}

// `W(c + change) - W(c)` [Pa] with the round-off of its terms, which vanish with the change.
fn green_strain_energy_density_change(
    c: array<f32, 6>,
    change: array<f32, 6>,
    lame_lambda: f32,
    lame_mu: f32,
) -> f32 {
    let middle = array<f32, 6>(
        c[0] + 0.5 * change[0],
        c[1] + 0.5 * change[1],
        c[2] + 0.5 * change[2],
        c[3] + 0.5 * change[3],
        c[4] + 0.5 * change[4],
        c[5] + 0.5 * change[5],
    );
    let stress = green_strain_second_piola(middle, lame_lambda, lame_mu);
    let direct = stress[0] * change[0] + stress[1] * change[1] + stress[2] * change[2];
    return direct + (stress[3] * change[3] + stress[4] * change[4] + stress[5] * change[5]);
}

// First Piola stress [Pa]: `P = F S`.
fn green_strain_piola(
    deformation_gradient: mat3x3f,
    c: array<f32, 6>,
    lame_lambda: f32,
    lame_mu: f32,
) -> mat3x3f {
    let stress = green_strain_second_piola(c, lame_lambda, lame_mu);
    return deformation_gradient * green_strain_symmetric(stress);
}

// The multipliers at which the residual of the solve is zero: `l = -s D c`, with `c` the strain
// less its target and `s` the inverse of the compliance's scale.
fn green_strain_constitutive_multipliers(
    c: array<f32, 6>,
    lame_lambda: f32,
    lame_mu: f32,
    step_volume: f32,
) -> array<f32, 6> {
    return green_strain_scaled(green_strain_second_piola(c, lame_lambda, lame_mu), -step_volume);
}

// `grad C M^-1 grad C^T + a~` [1/(kg m^2)], from `K = F^T F = I + 2 E` and
// `G = sum_i w_i g_i g_i^T`.
fn green_strain_system(c: array<f32, 6>, g: Symmetric, compliance: Compliance) -> Lower6 {
    let kxx = 1.0 + 2.0 * c[0];
    let kyy = 1.0 + 2.0 * c[1];
    let kzz = 1.0 + 2.0 * c[2];
    let kyz = c[3];
    let kxz = c[4];
    let kxy = c[5];
    return Lower6(
        g.xx * kxx + compliance.normal,

        g.xy * kxy + compliance.cross,
        g.yy * kyy + compliance.normal,

        g.xz * kxz + compliance.cross,
        g.yz * kyz + compliance.cross,
        g.zz * kzz + compliance.normal,

        g.xy * kxz + g.xz * kxy,
        g.yy * kyz + g.yz * kyy,
        g.yz * kzz + g.zz * kyz,
        (g.zz * kyy + g.yy * kzz) + 2.0 * (g.yz * kyz) + compliance.shear,

        g.xx * kxz + g.xz * kxx,
        g.xy * kyz + g.yz * kxy,
        g.xz * kzz + g.zz * kxz,
        (g.zz * kxy + g.xz * kyz) + (g.yz * kxz + g.xy * kzz),
        (g.zz * kxx + g.xx * kzz) + 2.0 * (g.xz * kxz) + compliance.shear,

        g.xx * kxy + g.xy * kxx,
        g.xy * kyy + g.yy * kxy,
        g.xz * kyz + g.yz * kxz,
        (g.xz * kyy + g.yz * kxy) + (g.xy * kyz + g.yy * kxz),
        (g.xz * kxy + g.yz * kxx) + (g.xx * kyz + g.xy * kxz),
        (g.yy * kxx + g.xx * kyy) + 2.0 * (g.xy * kxy) + compliance.shear,
    );
}

// One block solve of `C(x) - target_strain + a~ (l + dl) + grad C dx = 0`. `w` are the inverse
// masses [1/kg] of the corners, `compliance` is `a~`, `target_strain` zero for elastic tissue.
fn green_strain_solve(
    x: array<vec3f, 4>,
    w: array<f32, 4>,
    inverse_rest_shape: mat3x3f,
    multipliers: array<f32, 6>,
    target_strain: array<f32, 6>,
    compliance: Compliance,
) -> TetCorrection6 {
    let f = deformation_gradient(x, inverse_rest_shape);
    let g = shape_gradients(inverse_rest_shape);
    let c = green_strain_strain(f);
    let matrix = green_strain_system(c, weighted_products(g, w), compliance);
    let give = compliance_times(compliance, multipliers);
    let right = array<f32, 6>(
        target_strain[0] - (c[0] + give[0]),
        target_strain[1] - (c[1] + give[1]),
        target_strain[2] - (c[2] + give[2]),
        target_strain[3] - (c[3] + give[3]),
        target_strain[4] - (c[4] + give[4]),
        target_strain[5] - (c[5] + give[5]),
    );
    let change = solve_symmetric(matrix, right);
    return TetCorrection6(change, weighted_images(f * green_strain_symmetric(change), g, w));
}

// `grad C^T l` on each corner, and the Gershgorin bound of its geometric stiffness
// `sum_b |g_i^T L g_b|`.
fn green_strain_corner_loads(
    x: array<vec3f, 4>,
    inverse_rest_shape: mat3x3f,
    multipliers: array<f32, 6>,
) -> array<CornerLoad, 4> {
    let f = deformation_gradient(x, inverse_rest_shape);
    let g = shape_gradients(inverse_rest_shape);
    let stress = green_strain_symmetric(multipliers);
    return array<CornerLoad, 4>(
        green_strain_corner_load(f, g, stress * g[0]),
        green_strain_corner_load(f, g, stress * g[1]),
        green_strain_corner_load(f, g, stress * g[2]),
        green_strain_corner_load(f, g, stress * g[3]),
    );
}

// Of one corner; `v = L g_i`.
fn green_strain_corner_load(f: mat3x3f, g: array<vec3f, 4>, v: vec3f) -> CornerLoad {
    let mass_bound = abs(dot(v, g[0])) + abs(dot(v, g[1])) + abs(dot(v, g[2])) + abs(dot(v, g[3]));
    return CornerLoad(f * v, mass_bound);
}

// The law of Saint Venant and Kirchhoff.

fn saint_venant_kirchhoff_energy_density(f: mat3x3f, lame_lambda: f32, lame_mu: f32) -> f32 {
    return green_strain_energy_density(green_strain_strain(f), lame_lambda, lame_mu);
}

fn saint_venant_kirchhoff_piola(f: mat3x3f, lame_lambda: f32, lame_mu: f32) -> mat3x3f {
    return green_strain_piola(f, green_strain_strain(f), lame_lambda, lame_mu);
}

fn saint_venant_kirchhoff_energy_change(
    f: mat3x3f,
    d: mat3x3f,
    lame_lambda: f32,
    lame_mu: f32,
) -> f32 {
    let change = green_strain_strain_change(f, d);
    return green_strain_energy_density_change(green_strain_strain(f), change, lame_lambda, lame_mu);
}

// Of the derivative of `tr E`: `F`.
fn saint_venant_kirchhoff_gradient_map(f: mat3x3f) -> mat3x3f {
    return f;
}

// Stretching of a line along `g`, of the Green strain.
fn stretch_curvature(f: mat3x3f, g: vec3f, lame_lambda: f32, lame_mu: f32) -> f32 {
    return (lame_lambda + 2.0 * lame_mu) * norm_squared(f) * dot(g, g);
}

fn saint_venant_kirchhoff_curvature(
    f: mat3x3f,
    g: vec3f,
    lame_lambda: f32,
    lame_mu: f32,
) -> f32 {
    let c = green_strain_strain(f);
    let pressure = lame_lambda * (c[0] + c[1] + c[2]);
    let tensor = array<f32, 6>(c[0], c[1], c[2], 0.5 * c[3], 0.5 * c[4], 0.5 * c[5]);
    let along = dot(g, green_strain_symmetric(tensor) * g);
    let stretch = stretch_curvature(f, g, lame_lambda, lame_mu);
    return stretch + max(2.0 * lame_mu * along + pressure * dot(g, g), 0.0);
}
