// Stable neo-Hookean tetrahedron, defined through inversion; `neo_hookean.rs` holds the derivation.
//
//   lh = lambda + mu,  a = 1 + mu/lh
//   W = mu/2 (|F|^2 - 3) + lh/2 (J - a)^2 - lh/2 (1 - a)^2,   P = mu F + lh (J - a) cof F
//
// After Smith, de Goes, Kim, "Stable Neo-Hookean Flesh Simulation", TOG 2018, section 3, without
// the logarithmic term. Evaluated through `H = F - I`: `J - 1 = tr H + I2 + det H`.

struct NeoHookeanInvariants {
    trace: f32,
    second: f32,
    determinant: f32,
}

// `(tr H, I2, det H)` of `H = F - I`.
fn neo_hookean_invariants(f: mat3x3f) -> NeoHookeanInvariants {
    let a = f[0] - vec3f(1.0, 0.0, 0.0);
    let b = f[1] - vec3f(0.0, 1.0, 0.0);
    let c = f[2] - vec3f(0.0, 0.0, 1.0);
    let second = (a.x * b.y - a.y * b.x) + (a.x * c.z - a.z * c.x) + (b.y * c.z - b.z * c.y);
    return NeoHookeanInvariants(a.x + b.y + c.z, second, dot(a, cross(b, c)));
}

// Relative volume change `J - 1`.
fn neo_hookean_volume_change(f: mat3x3f) -> f32 {
    let h = neo_hookean_invariants(f);
    return h.trace + h.second + h.determinant;
}

// Energy density [Pa], zero at rest.
fn neo_hookean_energy_density(f: mat3x3f, lame_lambda: f32, lame_mu: f32) -> f32 {
    let h = neo_hookean_invariants(f);
    let j = h.trace + h.second + h.determinant;
    let shear = norm_squared(f - IDENTITY) - 2.0 * (h.second + h.determinant);
    return 0.5 * (lame_mu * shear + (lame_lambda + lame_mu) * j * j);
}

// First Piola stress [Pa]: `P = mu (F - cof F) + lh (J - 1) cof F`.
fn neo_hookean_piola(f: mat3x3f, lame_lambda: f32, lame_mu: f32) -> mat3x3f {
    let area = cofactor(f);
    let pressure = (lame_lambda + lame_mu) * neo_hookean_volume_change(f);
    return (f - area) * lame_mu + area * pressure;
}

// `W(F + D) - W(F)` [Pa] with the round-off of its terms, which vanish with `D`.
fn neo_hookean_energy_change(f: mat3x3f, d: mat3x3f, lame_lambda: f32, lame_mu: f32) -> f32 {
    let h = f - IDENTITY;
    let trace = d[0].x + d[1].y + d[2].z;
    let turned = inner_product(transpose(h), d);
    let rest = ((h[0].x + h[1].y + h[2].z) * trace - turned) + inner_product(cofactor(h), d);
    let higher = inner_product(f, cofactor(d)) + dot(d[0], cross(d[1], d[2]));
    let volume = (trace + rest) + higher;
    let shear = (inner_product(h, d) - rest) + 0.5 * norm_squared(d) - higher;
    let middle = neo_hookean_volume_change(f) + 0.5 * volume;
    return lame_mu * shear + (lame_lambda + lame_mu) * volume * middle;
}

// The law.

fn stable_neo_hookean_energy_change(f: mat3x3f, d: mat3x3f, lame_lambda: f32, lame_mu: f32) -> f32 {
    return neo_hookean_energy_change(f, d, lame_lambda, lame_mu);
}

// Of the derivative of `det F`: its cofactors.
fn stable_neo_hookean_gradient_map(f: mat3x3f) -> mat3x3f {
    return cofactor(f);
}

fn stable_neo_hookean_energy_density(f: mat3x3f, lame_lambda: f32, lame_mu: f32) -> f32 {
    return neo_hookean_energy_density(f, lame_lambda, lame_mu);
}

fn stable_neo_hookean_piola(f: mat3x3f, lame_lambda: f32, lame_mu: f32) -> mat3x3f {
    return neo_hookean_piola(f, lame_lambda, lame_mu);
}

fn stable_neo_hookean_curvature(f: mat3x3f, g: vec3f, lame_lambda: f32, lame_mu: f32) -> f32 {
    let area = cofactor(f) * g;
    return lame_mu * dot(g, g) + (lame_lambda + lame_mu) * dot(area, area);
}
