// Kinds of elements for tests. Twin of `trial.rs`.

// Hinges; their constant is the stiffness [N/m].

fn hinge_bend(x: array<vec3f, 4>) -> vec3f {
    return x[0] + x[2] - x[1] * 2.0;
}

fn hinges_energy(e: ElementMoment, x: array<vec3f, 4>) -> f32 {
    let bend = hinge_bend(x);
    return 0.5 * e.constants.x * dot(bend, bend);
}

fn hinges_energy_change(e: ElementMoment, x: array<vec3f, 4>, d: array<vec3f, 4>) -> f32 {
    return e.constants.x * dot(hinge_bend(d), hinge_bend(x) + hinge_bend(d) * 0.5);
}

fn hinges_forces(e: ElementMoment, x: array<vec3f, 4>) -> array<vec3f, 4> {
    let pull = hinge_bend(x) * e.constants.x;
    return array<vec3f, 4>(-pull, pull * 2.0, -pull, vec3f());
}

fn hinges_curvature(e: ElementMoment) -> f32 {
    return 4.0 * e.constants.x;
}

// Struts; constants are rest length [m] and stiffness [N/m].

fn strut_axis(x: array<vec3f, 4>) -> vec3f {
    return (x[0] + x[1] - x[2] - x[3]) * 0.5;
}

fn strut_residual(e: ElementMoment, x: array<vec3f, 4>) -> f32 {
    return length(strut_axis(x)) - e.constants.x;
}

// `-grad C` times a number.
fn strut_pull(x: array<vec3f, 4>, by: f32) -> array<vec3f, 4> {
    let axis = strut_axis(x);
    let half = axis * (1.0 / length(axis)) * (by * 0.5);
    return array<vec3f, 4>(-half, -half, half, half);
}

fn struts_energy(e: ElementMoment, x: array<vec3f, 4>) -> f32 {
    let residual = strut_residual(e, x);
    return 0.5 * e.constants.y * residual * residual;
}

// As `springs_energy_change`.
fn struts_energy_change(e: ElementMoment, x: array<vec3f, 4>, d: array<vec3f, 4>) -> f32 {
    let axis = strut_axis(x);
    let change = strut_axis(d);
    let sum = length(axis) + length(axis + change);
    let longer = dot(change, axis + axis + change) / sum;
    return e.constants.y * longer * (0.5 * sum - e.constants.x);
}

fn struts_forces(e: ElementMoment, x: array<vec3f, 4>) -> array<vec3f, 4> {
    return strut_pull(x, e.constants.y * strut_residual(e, x));
}

fn struts_curvature(e: ElementMoment) -> f32 {
    return e.constants.y;
}

fn struts_solve(
    e: ElementMoment,
    x: array<vec3f, 4>,
    w: array<f32, 4>,
    l: vec4f,
    squared: f32,
) -> ElementCorrection {
    let compliance_tilde = 1.0 / (e.constants.y * squared);
    let weight = (w[0] + w[1] + w[2] + w[3]) * 0.25;
    let change = (-strut_residual(e, x) - compliance_tilde * l.x) / (weight + compliance_tilde);
    var moves = strut_pull(x, -change);
    for (var i = 0u; i < 4u; i++) {
        moves[i] *= w[i];
    }
    return ElementCorrection(vec4f(change, 0.0, 0.0, 0.0), moves);
}

fn struts_loads(
    e: ElementMoment,
    x: array<vec3f, 4>,
    l: vec4f,
    squared: f32,
) -> array<CornerLoad, 4> {
    let pull = strut_pull(x, -l.x);
    let mass_bound = abs(l.x) / length(strut_axis(x));
    return array<CornerLoad, 4>(
        CornerLoad(pull[0], mass_bound),
        CornerLoad(pull[1], mass_bound),
        CornerLoad(pull[2], mass_bound),
        CornerLoad(pull[3], mass_bound),
    );
}

fn struts_constitutive(e: ElementMoment, x: array<vec3f, 4>, squared: f32) -> vec4f {
    let compliance_tilde = 1.0 / (e.constants.y * squared);
    return vec4f(-strut_residual(e, x) / compliance_tilde, 0.0, 0.0, 0.0);
}
