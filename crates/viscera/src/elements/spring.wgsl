// Spring between two vertices: `C = |x1 - x0| - L`, energy `k C^2 / 2`, compliance `1/k`. Twin of
// `spring.rs`.

// Shortest length [m] at which a spring still has a direction.
const SPRING_SHORTEST = 1e-12;

// Direction from the first to the second end, and the length [m].
struct SpringDirection {
    n: vec3f,
    length: f32,
}

// The changes by one solve: the multiplier [J s^2 / m] and the two positions [m].
struct SpringCorrection {
    multiplier: f32,
    positions: array<vec3f, 2>,
}

fn spring_direction(x: array<vec3f, 2>) -> SpringDirection {
    let edge = x[1] - x[0];
    let length = sqrt(dot(edge, edge));
    let inverse = select(1.0 / length, 0.0, length < SPRING_SHORTEST);
    return SpringDirection(edge * inverse, length);
}

// Energy [J].
fn spring_energy(x: array<vec3f, 2>, rest_length: f32, stiffness: f32) -> f32 {
    let c = spring_direction(x).length - rest_length;
    return 0.5 * stiffness * c * c;
}

// Forces [N] on the two ends.
fn spring_forces(x: array<vec3f, 2>, rest_length: f32, stiffness: f32) -> array<vec3f, 2> {
    let along = spring_direction(x);
    let pull = along.n * (stiffness * (along.length - rest_length));
    return array<vec3f, 2>(pull, -pull);
}

// One solve. `compliance_tilde = 1/(k dt^2)`.
fn spring_solve(
    x: array<vec3f, 2>,
    w: array<f32, 2>,
    rest_length: f32,
    multiplier: f32,
    compliance_tilde: f32,
) -> SpringCorrection {
    let along = spring_direction(x);
    let numerator = -(along.length - rest_length) - compliance_tilde * multiplier;
    let change = numerator / (w[0] + w[1] + compliance_tilde);
    let positions = array<vec3f, 2>(along.n * (-change * w[0]), along.n * (change * w[1]));
    return SpringCorrection(change, positions);
}

// The multiplier at which the residual of the solve is zero: `-C/a~`.
fn spring_constitutive_multiplier(
    x: array<vec3f, 2>,
    rest_length: f32,
    compliance_tilde: f32,
) -> f32 {
    return (rest_length - spring_direction(x).length) / compliance_tilde;
}

// `grad C^T l` on both ends; `d^2 C = (I - n n^T)/|x1 - x0|` gives the bound `2 |l|/|x1 - x0|`.
fn spring_corner_loads(x: array<vec3f, 2>, multiplier: f32) -> array<CornerLoad, 2> {
    let along = spring_direction(x);
    let mass_bound = 2.0 * abs(multiplier) / max(along.length, SPRING_SHORTEST);
    return array<CornerLoad, 2>(
        CornerLoad(along.n * -multiplier, mass_bound),
        CornerLoad(along.n * multiplier, mass_bound),
    );
}

// The kind; constants are rest length [m] and stiffness [N/m].

fn springs_energy(e: ElementMoment, x: array<vec3f, 4>) -> f32 {
    return spring_energy(array<vec3f, 2>(x[0], x[1]), e.constants.x, e.constants.y);
}

// `k (l1 - l0) ((l0 + l1)/2 - L)`, with `l1 - l0 = d01 . (2 e + d01)/(l0 + l1)`.
fn springs_energy_change(e: ElementMoment, x: array<vec3f, 4>, d: array<vec3f, 4>) -> f32 {
    let edge = x[1] - x[0];
    let change = d[1] - d[0];
    let sum = sqrt(dot(edge, edge)) + sqrt(dot(edge + change, edge + change));
    let longer = dot(change, edge + edge + change) * (1.0 / max(sum, SPRING_SHORTEST));
    return e.constants.y * longer * (0.5 * sum - e.constants.x);
}

fn springs_forces(e: ElementMoment, x: array<vec3f, 4>) -> array<vec3f, 4> {
    let forces = spring_forces(array<vec3f, 2>(x[0], x[1]), e.constants.x, e.constants.y);
    return array<vec3f, 4>(forces[0], forces[1], vec3f(), vec3f());
}

fn springs_curvature(e: ElementMoment) -> f32 {
    return e.constants.y;
}

fn springs_solve(
    e: ElementMoment,
    x: array<vec3f, 4>,
    w: array<f32, 4>,
    l: vec4f,
    squared: f32,
) -> ElementCorrection {
    let compliance_tilde = 1.0 / (e.constants.y * squared);
    let ends = array<vec3f, 2>(x[0], x[1]);
    let weights = array<f32, 2>(w[0], w[1]);
    let change = spring_solve(ends, weights, e.constants.x, l.x, compliance_tilde);
    let moves = array<vec3f, 4>(change.positions[0], change.positions[1], vec3f(), vec3f());
    return ElementCorrection(vec4f(change.multiplier, 0.0, 0.0, 0.0), moves);
}

fn springs_loads(
    e: ElementMoment,
    x: array<vec3f, 4>,
    l: vec4f,
    squared: f32,
) -> array<CornerLoad, 4> {
    let load = spring_corner_loads(array<vec3f, 2>(x[0], x[1]), l.x);
    return array<CornerLoad, 4>(load[0], load[1], CornerLoad(), CornerLoad());
}

fn springs_constitutive(e: ElementMoment, x: array<vec3f, 4>, squared: f32) -> vec4f {
    let compliance_tilde = 1.0 / (e.constants.y * squared);
    let ends = array<vec3f, 2>(x[0], x[1]);
    let l = spring_constitutive_multiplier(ends, e.constants.x, compliance_tilde);
    return vec4f(l, 0.0, 0.0, 0.0);
}
