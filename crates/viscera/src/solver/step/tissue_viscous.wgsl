// Viscous energy and stress of a tetrahedron's tissue; twin of `Tissue` in `tissue.rs`.
//
//   W = eta/(2 dt) |C - C_n|_D^2,  viscosity_rate = eta/dt
//
// Lame parameters and energy densities in [Pa].

// Of a change of the Green strain since the start of the step.
fn tissue_viscous_energy(
    change: array<f32, 6>,
    viscosity_rate: f32,
    lame_lambda: f32,
    lame_mu: f32,
) -> f32 {
    return viscosity_rate * green_strain_energy_density(change, lame_lambda, lame_mu);
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

// Change of the viscous energy from `F` to `F + D`; `before` is the change of the strain at `F`.
fn tissue_viscous_energy_change(
    f: mat3x3f,
    d: mat3x3f,
    before: array<f32, 6>,
    viscosity_rate: f32,
    lame_lambda: f32,
    lame_mu: f32,
) -> f32 {
    let change = green_strain_strain_change(f, d);
    let density = green_strain_energy_density_change(before, change, lame_lambda, lame_mu);
    return viscosity_rate * density;
}
