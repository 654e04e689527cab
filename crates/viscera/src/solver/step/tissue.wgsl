// Energy, stress and curvature of a tetrahedron's tissue; twin of `Tissue` in `potential.rs`.
//
//   W = elastic energy of Saint Venant-Kirchhoff or, where `neo`, of stable neo-Hookean
//   viscosity: W += eta/(2 dt) |C - C_n|_D^2,  viscosity_rate = eta/dt
//
// Lame parameters and energy densities in [Pa].

fn tissue_elastic_energy(neo: bool, f: mat3x3f, lame_lambda: f32, lame_mu: f32) -> f32 {
    if neo {
        return neo_hookean_energy_density(f, lame_lambda, lame_mu);
    }
    return green_strain_energy_density(green_strain_strain(f), lame_lambda, lame_mu);
}

// Of a change of the Green strain since the start of the step.
fn tissue_viscous_energy(
    change: array<f32, 6>,
    viscosity_rate: f32,
    lame_lambda: f32,
    lame_mu: f32,
) -> f32 {
    return viscosity_rate * green_strain_energy_density(change, lame_lambda, lame_mu);
}

// First Piola stress [Pa], elastic part.
fn tissue_piola(neo: bool, f: mat3x3f, lame_lambda: f32, lame_mu: f32) -> mat3x3f {
    if neo {
        return neo_hookean_piola(f, lame_lambda, lame_mu);
    }
    return green_strain_piola(f, green_strain_strain(f), lame_lambda, lame_mu);
}

// First Piola stress [Pa], viscous part.
fn tissue_viscous_piola(
    f: mat3x3f,
    change: array<f32, 6>,
    viscosity_rate: f32,
    lame_lambda: f32,
    lame_mu: f32,
) -> mat3x3f {
    return green_strain_piola(f, change, lame_lambda, lame_mu) * viscosity_rate;
}

// Change of the Green strain since the start of the step.
fn tissue_change_since(f: mat3x3f, start: array<f32, 6>) -> array<f32, 6> {
    let c = green_strain_strain(f);
    return array<f32, 6>(
        c[0] - start[0],
        c[1] - start[1],
        c[2] - start[2],
        c[3] - start[3],
        c[4] - start[4],
        c[5] - start[5],
    );
}

// Bound [Pa] of the curvature of the energy density by one corner, for the corner's shape gradient
// `g`: the vertex's diagonal block without its negative part.
fn tissue_curvature(
    neo: bool,
    f: mat3x3f,
    g: vec3f,
    lame_lambda: f32,
    lame_mu: f32,
    viscosity_rate: f32,
) -> f32 {
    let squared = dot(g, g);
    let stretch = (lame_lambda + 2.0 * lame_mu) * norm_squared(f) * squared;
    if neo {
        let area = cofactor(f) * g;
        let elastic = lame_mu * squared + (lame_lambda + lame_mu) * dot(area, area);
        return elastic + viscosity_rate * stretch;
    }
    let c = green_strain_strain(f);
    let pressure = lame_lambda * (c[0] + c[1] + c[2]);
    let tensor = array<f32, 6>(c[0], c[1], c[2], 0.5 * c[3], 0.5 * c[4], 0.5 * c[5]);
    let along = dot(g, green_strain_symmetric(tensor) * g);
    let elastic = stretch + max(2.0 * lame_mu * along + pressure * squared, 0.0);
    return elastic + viscosity_rate * stretch;
}
