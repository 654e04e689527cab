// The form of a tetrahedron's constraints: six components of the Green strain.

const MULTIPLIER_COUNT: u32 = 6u;
alias Multipliers = array<f32, 6>;

fn form_solve(
    x: array<vec3f, 4>,
    w: array<f32, 4>,
    shape: mat3x3f,
    l: Multipliers,
    material: Material,
    step_volume: f32,
) -> TetCorrection6 {
    let compliance = compliance_scaled(material.compliance, 1.0 / step_volume);
    return green_strain_solve(x, w, shape, l, array<f32, 6>(), compliance);
}

fn form_corner_loads(x: array<vec3f, 4>, shape: mat3x3f, l: Multipliers) -> array<CornerLoad, 4> {
    return green_strain_corner_loads(x, shape, l);
}

fn form_constitutive(
    x: array<vec3f, 4>,
    shape: mat3x3f,
    material: TissueConstants,
    step_volume: f32,
) -> Multipliers {
    let c = green_strain_strain(deformation_gradient(x, shape));
    return green_strain_constitutive_multipliers(c, material.lame_lambda, material.lame_mu, step_volume);
}
