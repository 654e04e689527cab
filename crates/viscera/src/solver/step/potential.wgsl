// The incremental potential (solver/step/potential.rs) in single precision: as the difference to what it is at
// the start of the step with its pins moved. Elements and vertices give their own differences, so that
// sums are of the size of a step's changes and not of all that is stored,
//
//   Phi(x) - Phi(x_ref) = sum_e dt^2 (V W - V W_ref) + sum_i m_i/2 (x - x_ref) . ((x - xt) + (x_ref - xt))

// Places beside the ranges of the vertex data: the positions, and `TRIAL + line * DIRECTION`.
const POINTS: u32 = 100u;
const LINE: u32 = 101u;

var<private> line: f32;
// Where the vertices are that are tested.
var<private> tested_at: u32 = POINTS;

// The sums of a piece, or of all pieces: potentials above the reference, of elements in [J], of inertia in
// [J s^2]; and of how many elements the reference is NaN.
const SUM_AHEAD: u32 = 0u;
const SUM_START: u32 = 1u;
const SUM_TESTED: u32 = 2u;
const SUM_REFERENCE: u32 = 3u;
// Of the terms of the place tested without their signs, of its squared forces [N^2], and its largest
// squared distance from the origin [m^2].
const SUM_MAGNITUDE: u32 = 4u;
const SUM_FORCE: u32 = 5u;
const SUM_REACH: u32 = 6u;
// Pins, anchors and tethers.
const SUM_HELD: u32 = 7u;
// Of free vertices: kinetic energies [J], also relative to the first vertex of the part; work [J] of the
// loads, alike; mass [kg]; momenta [kg m/s], relative; load [N].
const SUM_KINETIC_START: u32 = 8u;
const SUM_KINETIC: u32 = 9u;
const SUM_RELATIVE_START: u32 = 10u;
const SUM_RELATIVE: u32 = 11u;
const SUM_WORK: u32 = 12u;
const SUM_RELATIVE_WORK: u32 = 13u;
const SUM_MASS: u32 = 14u;
const SUM_MOMENTUM_START: u32 = 15u;
const SUM_MOMENTUM: u32 = 18u;
const SUM_LOAD: u32 = 21u;
// Of elements in the place of these: what the motion of tools gives to samples (contacts/potential.wgsl).
const SUM_GIVEN: u32 = 8u;

fn place(source: u32, v: u32) -> vec3f {
    if source == POINTS {
        return points[v].xyz;
    }
    if source == LINE {
        return along(vertex_data_of(TRIAL, v).xyz, vertex_data_of(DIRECTION, v).xyz, line);
    }
    return vertex_data_of(source, v).xyz;
}

// Zero times a direction may be NaN.
fn along(origin: vec3f, direction: vec3f, length: f32) -> vec3f {
    if length == 0.0 {
        return origin;
    }
    return origin + length * direction;
}

// A tetrahedron whose vertices are somewhere.
struct Deformed {
    f: mat3x3f,
    shape: mat3x3f,
    volume: f32,
    lame_lambda: f32,
    lame_mu: f32,
    viscosity_rate: f32,
    // Its number among the laws.
    law: u32,
    // Since the start of the step, where the tissue is viscous.
    change: array<f32, 6>,
}

fn deformed(block: u32, lane: u32, x: array<vec3f, 4>) -> Deformed {
    let shape = shape_of(block, lane);
    let f = deformation_gradient(x, shape);
    let material = tissue_of(tets[block].material[lane]);
    let rate = material.viscosity * frame.inverse_dt;
    let law = law_of(block);
    var change: array<f32, 6>;
    if rate > 0.0 {
        change = tissue_change_since(f, start_strain_of(block, lane));
    }
    let volume = tets[block].rest_volume[lane];
    return Deformed(f, shape, volume, material.lame_lambda, material.lame_mu, rate, law, change);
}

fn stress_of(tet: Deformed) -> mat3x3f {
    let stress = law_piola(tet.law, tet.f, tet.lame_lambda, tet.lame_mu);
    if tet.viscosity_rate == 0.0 {
        return stress;
    }
    let rate = tet.viscosity_rate;
    return stress + tissue_viscous_piola(tet.f, tet.change, rate, tet.lame_lambda, tet.lame_mu);
}

// Energy [J] of a tetrahedron and, where wanted, its squared force [N^2].
fn tet_answer(block: u32, lane: u32, x: array<vec3f, 4>, with_force: bool) -> vec2f {
    let tet = deformed(block, lane, x);
    var density = law_energy_density(tet.law, tet.f, tet.lame_lambda, tet.lame_mu);
    if tet.viscosity_rate > 0.0 {
        let rate = tet.viscosity_rate;
        density += tissue_viscous_energy(tet.change, rate, tet.lame_lambda, tet.lame_mu);
    }
    var squared = 0.0;
    if with_force {
        let stress = norm_squared(stress_of(tet));
        squared = tet.volume * tet.volume * (stress * norm_squared(tet.shape));
    }
    return vec2f(tet.volume * density, squared);
}

// Energy [J] of an element whose vertices are at `x` and, of a tetrahedron where wanted, its squared force [N^2]; of a sample of
// the surface since the reference, and its squared force.
fn answer(element: u32, x: array<vec3f, 4>, with_force: bool) -> vec2f {
    let tet_lanes = table[TET_LANES_AT];
    if is_sample(element) {
        return sample_answer(element, x);
    }
    if element < tet_lanes {
        return tet_answer(element / LANES, element % LANES, x, with_force);
    }
    let row = element_row(element - tet_lanes);
    let start = before_steps(four_of(row + ELEMENT_VERTICES));
    let moment = moment_of(row, start, frame.dt);
    return vec2f(element_energy(table[row + ELEMENT_KIND], moment, x), 0.0);
}

// `m/2 (|x - xt|^2 - |x_ref - xt|^2)` of a free vertex [kg m^2] without its large terms.
fn inertia(v: u32, x: vec3f) -> f32 {
    let predicted = vertex_data_of(PREDICTED, v);
    let start = vertex_data_of(PREVIOUS, v).xyz;
    let both = (x - predicted.xyz) + (start - predicted.xyz);
    return 0.5 * predicted.w * dot(x - start, both);
}

fn add_element(element: u32, mode: u32, into: ptr<function, Sums>) {
    // Energies are called at one place: compilers put them in wherever they are called.
    var sources = array<u32, 4>(REFERENCE, AHEAD, START, tested_at);
    let corners = corners_of_member(element);
    for (var k = select(3u, 0u, (mode & WITH_STARTS) != 0u); k < 4u; k++) {
        let source = sources[k];
        let x = array<vec3f, 4>(
            place(source, corners[0]),
            place(source, corners[1]),
            place(source, corners[2]),
            place(source, corners[3]),
        );
        let found = answer(element, x, k == 3u);
        if k == 0u {
            partial_sums[table[ENERGIES_AT] + element] = found.x;
        } else if k == 1u {
            (*into)[SUM_AHEAD] += found.x - reference_of(element);
        } else if k == 2u {
            (*into)[SUM_START] += found.x - reference_of(element);
        } else {
            add_tested(element, found, into);
            if is_sample(element) {
                add_given(element, x, mode, into);
                return;
            }
        }
    }
    let tet_lanes = table[TET_LANES_AT];
    if element >= tet_lanes && element_is_anchored(table[element_row(element - tet_lanes) + ELEMENT_KIND]) {
        (*into)[SUM_HELD] += 1.0;
    }
}

fn corners_of_member(element: u32) -> array<u32, 4> {
    if is_sample(element) {
        return sample_corners(element);
    }
    return corners_of(element);
}

// A tool that is near can stop the part.
fn add_given(element: u32, x: array<vec3f, 4>, mode: u32, into: ptr<function, Sums>) {
    if (mode & WITH_MOTION) == 0u {
        return;
    }
    let given = given_to(element, x);
    (*into)[SUM_HELD] += given.w;
    for (var k = 0u; k < 4u; k++) {
        (*into)[SUM_GIVEN + k] += given[k];
    }
}

// Energy [J] at the reference; where it is NaN it counts as zero, and other energies are taken as they are.
fn reference_of(element: u32) -> f32 {
    let energy = partial_sums[table[ENERGIES_AT] + element];
    return select(0.0, energy, is_finite(energy));
}

// `tested`: energy and squared force at the place tested.
fn add_tested(element: u32, tested: vec2f, into: ptr<function, Sums>) {
    let difference = tested.x - reference_of(element);
    (*into)[SUM_TESTED] += difference;
    (*into)[SUM_MAGNITUDE] += abs(difference);
    (*into)[SUM_FORCE] += tested.y;
    if !is_finite(partial_sums[table[ENERGIES_AT] + element]) {
        (*into)[SUM_REFERENCE] += 1.0;
    }
}

fn add_vertex(v: u32, first: u32, mode: u32, into: ptr<function, Sums>) {
    let x = place(tested_at, v);
    (*into)[SUM_REACH] = max((*into)[SUM_REACH], dot(x, x));
    if vertex_data_of(EXTERNAL_FORCES, v).w == 0.0 {
        (*into)[SUM_HELD] += 1.0;
        return;
    }
    let tested = inertia(v, x);
    (*into)[SUM_TESTED] += tested;
    (*into)[SUM_MAGNITUDE] += abs(tested);
    if (mode & WITH_STARTS) != 0u {
        (*into)[SUM_AHEAD] += inertia(v, vertex_data_of(AHEAD, v).xyz);
        (*into)[SUM_START] += inertia(v, vertex_data_of(START, v).xyz);
    }
    if (mode & WITH_MOTION) != 0u {
        add_motion(v, first, into);
    }
}

// Velocity at the end of the step [m/s].
fn end_velocity(v: u32) -> vec3f {
    return (place(tested_at, v) - vertex_data_of(PREVIOUS, v).xyz) * frame.inverse_dt;
}

// The sums of the energy limit (energy.wgsl). A large common motion would drown the motion relative to it:
// relative to the first vertex of the part both are kept apart.
fn add_motion(v: u32, first: u32, into: ptr<function, Sums>) {
    // Tethers are taken out of the mass again: the energy that they store counts as work.
    let hold = vertex_data_of(TARGETS, v);
    let mass = max(vertex_data_of(PREDICTED, v).w - hold.w * frame.squared_dt, 0.0);
    let load = frame.gravity * mass + vertex_data_of(EXTERNAL_FORCES, v).xyz;
    let before = vertex_data_of(VELOCITIES, v).xyz;
    let after = end_velocity(v);
    let relative_before = before - vertex_data_of(VELOCITIES, first).xyz;
    let relative = after - end_velocity(first);
    (*into)[SUM_KINETIC_START] += 0.5 * mass * dot(before, before);
    (*into)[SUM_KINETIC] += 0.5 * mass * dot(after, after);
    (*into)[SUM_RELATIVE_START] += 0.5 * mass * dot(relative_before, relative_before);
    (*into)[SUM_RELATIVE] += 0.5 * mass * dot(relative, relative);
    let x = place(tested_at, v);
    let start = vertex_data_of(PREVIOUS, v).xyz;
    let springs = 0.5 * hold.w * dot(x - start, (x - hold.xyz) + (start - hold.xyz));
    (*into)[SUM_WORK] += dot(load, x - start) - springs;
    (*into)[SUM_HELD] += select(0.0, 1.0, hold.w > 0.0);
    (*into)[SUM_RELATIVE_WORK] += frame.dt * dot(load, relative);
    (*into)[SUM_MASS] += mass;
    for (var axis = 0u; axis < 3u; axis++) {
        (*into)[SUM_MOMENTUM_START + axis] += mass * relative_before[axis];
        (*into)[SUM_MOMENTUM + axis] += mass * relative[axis];
        (*into)[SUM_LOAD + axis] += load[axis];
    }
}

fn add_piece(row: u32, mode: u32, local: u32, into: ptr<function, Sums>) {
    let end = table[row + PIECE_END];
    if table[row + PIECE_ARE_VERTICES] != 0u {
        let first = first_vertex_of(table[row + PIECE_PART]);
        for (var v = table[row + PIECE_FIRST] + local; v < end; v += THREADS) {
            add_vertex(v, first, mode, into);
        }
    } else {
        for (var i = table[row + PIECE_FIRST] + local; i < end; i += THREADS) {
            add_element(member(i), mode, into);
        }
    }
}

// Energies of elements are in [J], those of inertia in [J s^2].
fn weight_of_piece(piece: u32) -> f32 {
    return select(frame.squared_dt, 1.0, table[piece_row(piece) + PIECE_ARE_VERTICES] != 0u);
}

// Sums of a part's pieces. Vertices have no forces, elements no reach: their places are zero.
fn add_pieces(part: u32, local: u32, into: ptr<function, Sums>) {
    let count = piece_count(part);
    for (var i = local; i < count; i += THREADS) {
        let piece = piece_at(part, i);
        let weight = weight_of_piece(piece);
        let at = SUMS * piece;
        for (var k = 0u; k <= SUM_MAGNITUDE; k++) {
            (*into)[k] += weight * partial_sums[at + k];
        }
        (*into)[SUM_FORCE] += partial_sums[at + SUM_FORCE];
        (*into)[SUM_REACH] = max((*into)[SUM_REACH], partial_sums[at + SUM_REACH]);
    }
}
