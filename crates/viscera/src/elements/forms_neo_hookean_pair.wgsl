// The constraints of a neo-Hookean tetrahedron: volume and norm of the deformation gradient.

const MULTIPLIER_COUNT: u32 = 2;
alias Multipliers = array<f32, 2>;

fn form_solve(
    x: array<vec3f, 4>,
    w: array<f32, 4>,
    shape: mat3x3f,
    l: Multipliers,
    material: Material,
    step_volume: f32,
) -> TetCorrection2 {
    return neo_hookean_pair_solve(x, w, shape, l, material.lame_lambda, material.lame_mu, step_volume);
}

fn form_corner_loads(x: array<vec3f, 4>, shape: mat3x3f, l: Multipliers) -> array<CornerLoad, 4> {
    return neo_hookean_pair_corner_loads(x, shape, l);
}

fn form_constitutive(
    x: array<vec3f, 4>,
    shape: mat3x3f,
    material: TissueConstants,
    step_volume: f32,
) -> Multipliers {
    let f = deformation_gradient(x, shape);
    return neo_hookean_pair_constitutive_multipliers(f, material.lame_lambda, material.lame_mu, step_volume);
}
