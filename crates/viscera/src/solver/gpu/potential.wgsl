// The incremental potential (solver/potential.rs) in single precision: as the difference to what it is at
// the start of the step with its pins moved. Elements and vertices give their own differences, so that
// sums are of the size of what happens in a step and not of all that is stored,
//
//   Phi(x) - Phi(x_ref) = sum_e dt^2 (V W - V W_ref) + sum_i m_i/2 (x - x_ref) . ((x - xt) + (x_ref - xt))
//
// A piece (512 elements, or vertices, of one part of the model) is summed by one workgroup, pieces by
// whoever needs their sum, always in the same order.

const THREADS: u32 = 256u;
const EPSILON: f32 = 1.1920929e-7;

// The first words of the table: where everything stands (`Header` in layout.rs).
const MATERIALS_AT: u32 = 0u;
const CORNERS_AT: u32 = 1u;
const OFFSETS_AT: u32 = 2u;
const SPRINGS_AT: u32 = 3u;
const ATTACHMENTS_AT: u32 = 4u;
const PIECES_AT: u32 = 5u;
const MEMBERS_AT: u32 = 6u;
const STRIDE: u32 = 7u;
const ANCHORS_AT: u32 = 8u;
const PARTS_AT: u32 = 9u;
const ENERGIES_AT: u32 = 10u;
const VERTEX_COUNT: u32 = 11u;
const TET_LANES: u32 = 12u;
const NEO_HOOKEAN_FROM: u32 = 13u;
const SPRING_COUNT: u32 = 14u;
const ATTACHMENT_COUNT: u32 = 15u;
const PIECE_COUNT: u32 = 16u;

// The ranges of the ground.
const PREVIOUS: u32 = 0u;
const PREDICTED: u32 = 1u;
const ACTING: u32 = 2u;
const TARGETS: u32 = 3u;
const VELOCITIES: u32 = 4u;
// The start of the step, the inertial prediction and the start of the iteration, pins moved in all.
const REFERENCE: u32 = 5u;
const AHEAD: u32 = 6u;
const START: u32 = 7u;
// A line along which places are tried.
const TRIAL: u32 = 8u;
const DIRECTION: u32 = 9u;
// Places beside the ranges: the positions, and `TRIAL + line * DIRECTION`.
const POINTS: u32 = 100u;
const LINE: u32 = 101u;

var<private> line: f32;

// What a piece leaves, or a sum of pieces: potentials above the reference, of elements in [J], of inertia in
// [J s^2]; and of how many elements the reference is no number.
const SUM_AHEAD: u32 = 0u;
const SUM_START: u32 = 1u;
const SUM_TESTED: u32 = 2u;
const SUM_REFERENCE: u32 = 3u;
// Of the terms of the place tested without their signs, of its squared forces [N^2], and its largest
// squared distance from the origin [m^2].
const SUM_MAGNITUDE: u32 = 4u;
const SUM_FORCE: u32 = 5u;
const SUM_REACH: u32 = 6u;
// Pins, attachments and tethers.
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
const SUMS: u32 = 24u;
alias Sums = array<f32, 24>;

// What is asked of a piece: the energies of the reference, and the other starts; motion for the energy
// limit; nothing where the iterate has passed already, or where the step was not taken back.
const WITH_STARTS: u32 = 1u;
const WITH_MOTION: u32 = 2u;
const UNLESS_GOOD: u32 = 4u;
const IF_REJECTED: u32 = 8u;

var<workgroup> shared_sums: array<f32, 2048>;
var<workgroup> totals: Sums;
var<workgroup> decision: u32;

// Sums over the workgroup, eight at a time (the reach is a maximum), into `totals`.
fn reduce(given: Sums, groups: u32, local: u32) {
    var values = given;
    for (var group = 0u; group < groups; group++) {
        workgroupBarrier();
        for (var k = 0u; k < 8u; k++) {
            shared_sums[THREADS * k + local] = values[8u * group + k];
        }
        workgroupBarrier();
        for (var half = THREADS / 2u; half > 0u; half /= 2u) {
            if local < half {
                for (var k = 0u; k < 8u; k++) {
                    let at = THREADS * k + local;
                    let a = shared_sums[at];
                    let b = shared_sums[at + half];
                    shared_sums[at] = select(a + b, max(a, b), 8u * group + k == SUM_REACH);
                }
            }
            workgroupBarrier();
        }
        if local < 8u {
            totals[8u * group + local] = shared_sums[THREADS * local];
        }
    }
    workgroupBarrier();
}

// What the first thread says, told to all.
fn agree(yes: bool, local: u32) -> bool {
    if local == 0u {
        decision = select(0u, 1u, yes);
    }
    return workgroupUniformLoad(&decision) != 0u;
}

// By its bits: compilers may take it for granted that numbers are finite.
fn is_finite(value: f32) -> bool {
    return (bitcast<u32>(value) & 0x7f800000u) != 0x7f800000u;
}

fn number(word: u32) -> f32 {
    return bitcast<f32>(table[word]);
}

fn ground_of(range: u32, v: u32) -> vec4f {
    return ground[range * table[STRIDE] + v];
}

fn place(source: u32, v: u32) -> vec3f {
    if source == POINTS {
        return points[v].xyz;
    }
    if source == LINE {
        let origin = ground_of(TRIAL, v).xyz;
        // Zero times a direction may be no number.
        if line == 0.0 {
            return origin;
        }
        return origin + line * ground_of(DIRECTION, v).xyz;
    }
    return ground_of(source, v).xyz;
}

// A tetrahedron where the vertices are at one of the places.
struct Deformed {
    f: mat3x3f,
    shape: mat3x3f,
    volume: f32,
    lame_lambda: f32,
    lame_mu: f32,
    viscosity_rate: f32,
    neo: bool,
    // Since the start of the step, where the tissue is viscous.
    change: array<f32, 6>,
}

fn deformed(block: u32, lane: u32, source: u32) -> Deformed {
    let vertices = vertices_of(block, lane);
    let x = array<vec3f, 4>(
        place(source, vertices[0]),
        place(source, vertices[1]),
        place(source, vertices[2]),
        place(source, vertices[3]),
    );
    let shape = shape_of(block, lane);
    let f = deformation_gradient(x, shape);
    // Of six constants the first, the second and the last.
    let material = table[MATERIALS_AT] + 6u * tets[block].material[lane];
    let rate = number(material + 5u) * frame.inverse_dt;
    let neo = LANES * block + lane >= table[NEO_HOOKEAN_FROM];
    var change: array<f32, 6>;
    if rate > 0.0 {
        change = tissue_change_since(f, start_strain_of(block, lane));
    }
    let volume = tets[block].rest_volume[lane];
    return Deformed(f, shape, volume, number(material), number(material + 1u), rate, neo, change);
}

fn stress_of(tet: Deformed) -> mat3x3f {
    let stress = tissue_piola(tet.neo, tet.f, tet.lame_lambda, tet.lame_mu);
    if tet.viscosity_rate == 0.0 {
        return stress;
    }
    let rate = tet.viscosity_rate;
    return stress + tissue_viscous_piola(tet.f, tet.change, rate, tet.lame_lambda, tet.lame_mu);
}

// Energy [J] of a tetrahedron and, where wanted, its squared force [N^2].
fn tet_answer(block: u32, lane: u32, source: u32, with_force: bool) -> vec2f {
    if tets[block].material[lane] == FILLING {
        return vec2f();
    }
    let tet = deformed(block, lane, source);
    var density = tissue_elastic_energy(tet.neo, tet.f, tet.lame_lambda, tet.lame_mu);
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

// Where a spring and an attachment stand in the table.
fn spring_row(i: u32) -> u32 {
    return table[SPRINGS_AT] + 10u * i;
}

fn attachment_row(i: u32) -> u32 {
    return table[ATTACHMENTS_AT] + 6u * i;
}

fn anchor_of(i: u32) -> vec3f {
    return ground[table[ANCHORS_AT] + i].xyz;
}

fn spring_ends(row: u32, source: u32) -> array<vec3f, 2> {
    return array<vec3f, 2>(place(source, table[row]), place(source, table[row + 1u]));
}

fn element_count() -> u32 {
    return table[TET_LANES] + table[SPRING_COUNT] + table[ATTACHMENT_COUNT];
}

// Of a tetrahedron, spring or attachment.
fn answer(element: u32, source: u32, with_force: bool) -> vec2f {
    let tet_lanes = table[TET_LANES];
    if element < tet_lanes {
        return tet_answer(element / LANES, element % LANES, source, with_force);
    }
    let single = element - tet_lanes;
    if single < table[SPRING_COUNT] {
        let row = spring_row(single);
        return vec2f(spring_energy(spring_ends(row, source), number(row + 7u), number(row + 8u)), 0.0);
    }
    let i = single - table[SPRING_COUNT];
    let row = attachment_row(i);
    let x = place(source, table[row]);
    return vec2f(attachment_energy(x, anchor_of(i), number(row + 4u)), 0.0);
}

// `m/2 (|x - xt|^2 - |x_ref - xt|^2)` of a free vertex [kg m^2] without its large terms.
fn inertia(v: u32, source: u32) -> f32 {
    let x = place(source, v);
    let predicted = ground_of(PREDICTED, v);
    let start = ground_of(PREVIOUS, v).xyz;
    let both = (x - predicted.xyz) + (start - predicted.xyz);
    return 0.5 * predicted.w * dot(x - start, both);
}

fn add_element(element: u32, mode: u32, into: ptr<function, Sums>) {
    // Energies are called at one place: compilers put them in wherever they are called.
    var sources = array<u32, 4>(REFERENCE, AHEAD, START, POINTS);
    for (var k = select(3u, 0u, (mode & WITH_STARTS) != 0u); k < 4u; k++) {
        let source = sources[k];
        let found = answer(element, source, source == POINTS);
        if source == REFERENCE {
            partial_sums[table[ENERGIES_AT] + element] = found.x;
        } else if source == AHEAD {
            (*into)[SUM_AHEAD] += found.x - reference_of(element);
        } else if source == START {
            (*into)[SUM_START] += found.x - reference_of(element);
        } else {
            add_tested(element, found, into);
        }
    }
    if element >= table[TET_LANES] + table[SPRING_COUNT] {
        (*into)[SUM_HELD] += 1.0;
    }
}

// Energy [J] at the reference; where it is no number the reference is out, and the others are taken as
// they are.
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
    let x = points[v].xyz;
    (*into)[SUM_REACH] = max((*into)[SUM_REACH], dot(x, x));
    if ground_of(ACTING, v).w == 0.0 {
        (*into)[SUM_HELD] += 1.0;
        return;
    }
    let tested = inertia(v, POINTS);
    (*into)[SUM_TESTED] += tested;
    (*into)[SUM_MAGNITUDE] += abs(tested);
    if (mode & WITH_STARTS) != 0u {
        (*into)[SUM_AHEAD] += inertia(v, AHEAD);
        (*into)[SUM_START] += inertia(v, START);
    }
    if (mode & WITH_MOTION) != 0u {
        add_motion(v, first, into);
    }
}

// Velocity at the end of the step [m/s].
fn end_velocity(v: u32) -> vec3f {
    return (points[v].xyz - ground_of(PREVIOUS, v).xyz) * frame.inverse_dt;
}

// What the energy limit needs (energy.wgsl). Large common motions would drown what is beside them:
// relative to the first vertex of the part both are kept apart.
fn add_motion(v: u32, first: u32, into: ptr<function, Sums>) {
    // Springs to places outside are no part of the mass: what they store is given, or taken.
    let hold = ground_of(TARGETS, v);
    let mass = max(ground_of(PREDICTED, v).w - hold.w * frame.squared_dt, 0.0);
    let load = frame.gravity * mass + ground_of(ACTING, v).xyz;
    let before = ground_of(VELOCITIES, v).xyz;
    let after = end_velocity(v);
    let relative_before = before - ground_of(VELOCITIES, first).xyz;
    let relative = after - end_velocity(first);
    (*into)[SUM_KINETIC_START] += 0.5 * mass * dot(before, before);
    (*into)[SUM_KINETIC] += 0.5 * mass * dot(after, after);
    (*into)[SUM_RELATIVE_START] += 0.5 * mass * dot(relative_before, relative_before);
    (*into)[SUM_RELATIVE] += 0.5 * mass * dot(relative, relative);
    let x = points[v].xyz;
    let start = ground_of(PREVIOUS, v).xyz;
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

// A piece: `(part, first, end, 1 for vertices)` among the members.
fn piece_row(piece: u32) -> u32 {
    return table[PIECES_AT] + 4u * piece;
}

// The pieces of a part: `(first, end)` of elements, then of vertices.
fn part_row(part: u32) -> u32 {
    return piece_row(table[PIECE_COUNT] + part);
}

fn member(i: u32) -> u32 {
    return table[table[MEMBERS_AT] + i];
}

fn first_vertex_of(part: u32) -> u32 {
    return member(table[piece_row(table[part_row(part) + 2u]) + 1u]);
}

fn sum_piece(piece: u32, mode: u32, local: u32) {
    let row = piece_row(piece);
    let end = table[row + 2u];
    let are_vertices = table[row + 3u] != 0u;
    var sums: Sums;
    if are_vertices {
        let first = first_vertex_of(table[row]);
        for (var i = table[row + 1u] + local; i < end; i += THREADS) {
            add_vertex(member(i), first, mode, &sums);
        }
    } else {
        for (var i = table[row + 1u] + local; i < end; i += THREADS) {
            add_element(member(i), mode, &sums);
        }
    }
    let groups = select(1u, 3u, are_vertices && (mode & WITH_MOTION) != 0u);
    reduce(sums, groups, local);
    if local < 8u * groups {
        partial_sums[SUMS * piece + local] = totals[local];
    }
}
