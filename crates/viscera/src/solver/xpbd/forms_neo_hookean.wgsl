// The form of a neo-Hookean tetrahedron's constraints: volume and norm of the deformation gradient, or six
// components of the stretch. `$form` stands for the element's name, `$count` for its number of
// multipliers; kernels.rs puts them in.

const MULTIPLIER_COUNT: u32 = $count;
alias Multipliers = array<f32, $count>;

fn form_solve(
    x: array<vec3f, 4>,
    w: array<f32, 4>,
    shape: mat3x3f,
    l: Multipliers,
    material: Material,
    step_volume: f32,
) -> TetCorrection$count {
    return $form_solve(x, w, shape, l, material.lame_lambda, material.lame_mu, step_volume);
}

fn form_corner_loads(x: array<vec3f, 4>, shape: mat3x3f, l: Multipliers) -> array<CornerLoad, 4> {
    return $form_corner_loads(x, shape, l);
}

fn form_constitutive(
    x: array<vec3f, 4>,
    shape: mat3x3f,
    material: Law,
    step_volume: f32,
) -> Multipliers {
    let f = deformation_gradient(x, shape);
    return $form_constitutive_multipliers(f, material.lame_lambda, material.lame_mu, step_volume);
}
