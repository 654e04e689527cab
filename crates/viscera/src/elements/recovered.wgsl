// Recovered-gradient tetrahedron; `recovered.rs` holds the derivation.
//
//   Fh   = F + sum_o c_o k_o g_o^T,  k_o = sum_{p in face o} G_p (X_p - X_o)
//   E    = sum_t V_t (1 - alpha) W(Fh_t; l, mu) + sum_n V_n alpha W(G_n; l, mu)
//        + sum_n V_n k_n/2 (Jh_n - 1)^2 + sum_c V_c k_c/2 (Jh_c - 1)^2 + sum_t V_t 16 mu/2 min(det F_t - 1/5, 0)^2
//   lambda = l + k_n + k_c

const RECOVERED_CLUSTERED_ABOVE: f32 = 4.0;
const RECOVERED_VOLUME_FLOOR: f32 = 0.2;
const RECOVERED_FLOOR_STIFFNESS: f32 = 16.0;

// Where the parts of Lame's first parameter count [Pa].
struct RecoveredBulkShares {
    local: f32,
    domain: f32,
    cluster: f32,
}

// A tetrahedron at rest.
struct RecoveredRestFrame {
    // Gradients [1/m] of the linear shape functions.
    gradients: array<vec3f, 4>,
    // The corners from the centroid [m].
    arms: array<vec3f, 4>,
    // `c_o` of the face opposite each corner.
    face_weights: vec4f,
}

// `a b^T`.
fn recovered_outer(a: vec3f, b: vec3f) -> mat3x3f {
    return mat3x3f(a * b.x, a * b.y, a * b.z);
}

fn recovered_bulk_shares(lame_lambda: f32, lame_mu: f32) -> RecoveredBulkShares {
    let local = min(lame_lambda, lame_mu);
    let averaged = min(lame_lambda, lame_mu * RECOVERED_CLUSTERED_ABOVE);
    return RecoveredBulkShares(local, averaged - local, lame_lambda - averaged);
}

// What face `o` adds to the mean gradient; `image` is `G_o r_o`, `sum` of all four.
fn recovered_face(
    sum: vec3f,
    image: vec3f,
    mean: mat3x3f,
    arm: vec3f,
    weight: f32,
    gradient: vec3f,
) -> mat3x3f {
    let apart = (image - mean * arm) * (4.0 / 3.0);
    return recovered_outer((sum - apart) * weight, gradient);
}

fn recovered_gradient(
    f: mat3x3f,
    vertex_gradients: array<mat3x3f, 4>,
    rest: RecoveredRestFrame,
) -> mat3x3f {
    let g = vertex_gradients;
    let r = rest.arms;
    let c = rest.face_weights;
    let mean = ((g[0] + g[1]) + (g[2] + g[3])) * 0.25;
    let y0 = g[0] * r[0];
    let y1 = g[1] * r[1];
    let y2 = g[2] * r[2];
    let y3 = g[3] * r[3];
    let sum = (y0 + y1) + (y2 + y3);
    var recovered = f;
    recovered += recovered_face(sum, y0, mean, r[0], c.x, rest.gradients[0]);
    recovered += recovered_face(sum, y1, mean, r[1], c.y, rest.gradients[1]);
    recovered += recovered_face(sum, y2, mean, r[2], c.z, rest.gradients[2]);
    recovered += recovered_face(sum, y3, mean, r[3], c.w, rest.gradients[3]);
    return recovered;
}

// What `dE/dFh` is as a derivative by the gradient of the domain of corner `p`.
fn recovered_vertex_stress(stress: mat3x3f, rest: RecoveredRestFrame, p: u32) -> mat3x3f {
    let r = rest.arms;
    let pulls = array<vec3f, 4>(
        stress * rest.gradients[0] * rest.face_weights.x,
        stress * rest.gradients[1] * rest.face_weights.y,
        stress * rest.gradients[2] * rest.face_weights.z,
        stress * rest.gradients[3] * rest.face_weights.w,
    );
    let sum = pulls[0] + pulls[1] + pulls[2] + pulls[3];
    let moment = (recovered_outer(pulls[0], r[0]) + recovered_outer(pulls[1], r[1])
        + recovered_outer(pulls[2], r[2]) + recovered_outer(pulls[3], r[3])) * (1.0 / 3.0);
    return moment + recovered_outer(sum - pulls[p] * (4.0 / 3.0), r[p]);
}

// `det(F + D) - det F` with the round-off of its terms, which vanish with `D`.
fn recovered_volume_variation(f: mat3x3f, d: mat3x3f) -> f32 {
    return (inner_product(cofactor(f), d) + inner_product(f, cofactor(d))) + determinant(d);
}

fn recovered_tet_stress(
    recovered: mat3x3f,
    local: f32,
    lame_mu: f32,
    share: f32,
    pressure: f32,
) -> mat3x3f {
    return neo_hookean_piola(recovered, local, lame_mu) * share + cofactor(recovered) * pressure;
}

fn recovered_bulk_energy(change: f32, stiffness: f32) -> f32 {
    return 0.5 * stiffness * (change * change);
}

fn recovered_below_floor(f: mat3x3f) -> f32 {
    return min(determinant(f) - RECOVERED_VOLUME_FLOOR, 0.0);
}

fn recovered_floor_energy(f: mat3x3f, lame_mu: f32) -> f32 {
    let below = recovered_below_floor(f);
    return 0.5 * RECOVERED_FLOOR_STIFFNESS * lame_mu * (below * below);
}

fn recovered_floor_piola(f: mat3x3f, lame_mu: f32) -> mat3x3f {
    return cofactor(f) * (RECOVERED_FLOOR_STIFFNESS * lame_mu * recovered_below_floor(f));
}

// The change of `recovered_floor_energy` from `F` to `F + D`.
fn recovered_floor_energy_change(f: mat3x3f, d: mat3x3f, lame_mu: f32) -> f32 {
    let volume = determinant(f) - RECOVERED_VOLUME_FLOOR;
    let below = min(volume, 0.0);
    let above = volume - below;
    // What goes up ends at the floor, what comes down starts there.
    let change = min(recovered_volume_variation(f, d) + above, -below);
    return RECOVERED_FLOOR_STIFFNESS * lame_mu * change * (below + 0.5 * change);
}
