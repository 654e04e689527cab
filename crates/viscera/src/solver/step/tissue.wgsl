// Curvature of a tetrahedron's tissue, elastic and viscous; twin of `Tissue` in `tissue.rs`. The elastic energy and
// stress are those of the law, by its number among the laws.

// Bound [Pa] of the curvature of the energy density by one corner, for the corner's shape gradient
// `g`: the vertex's diagonal block without its negative part.
fn tissue_curvature(
    law: u32,
    f: mat3x3f,
    g: vec3f,
    lame_lambda: f32,
    lame_mu: f32,
    viscosity_rate: f32,
) -> f32 {
    let elastic = law_curvature(law, f, g, lame_lambda, lame_mu);
    return elastic + viscosity_rate * stretch_curvature(f, g, lame_lambda, lame_mu);
}
