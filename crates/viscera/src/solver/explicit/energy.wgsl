// The energy limit of explicit steps that tools are near (explicit/guard.rs), part by part.
//
//   T_1 <= T_n + V(x_n with pins moved) - V(x_1) + sum_i (m_i g + f_i) . (x_1 - x_n)_i + W + owed
//   v *= sqrt(limit/T_1) where it is exceeded; where more is stored than all of that, the part is at x_n, without speed
//
// V: tissue, springs, attachments, contact; W: work of tools, their forces times their ways in every small step. Samples keep
// what tools have given without what contact stores (contact.wgsl). `owed`: what has gone may come back, or the swing of a
// symplectic step's energy would brake tissue that is at rest. It stands in `mixture_best` until the next step begins, then in
// `best_value`, because every workgroup of a part reads it where the first one decides anew.

// Sums of a piece: change of the stored energy [J] but for the work of tools, the same without signs, kinetic energy at both ends of
// the step, work of loads, samples that tools are near.
const ENERGY_STORED: u32 = 0u;
const ENERGY_SIZE: u32 = 1u;
const ENERGY_BEFORE: u32 = 2u;
const ENERGY_KINETIC: u32 = 3u;
const ENERGY_WORK: u32 = 4u;
const ENERGY_NEAR: u32 = 5u;
const ENERGIES: u32 = 8u;

// The share of the energies of a step that may come back after it has gone.
const SWING: f32 = 0.1;

// Change [J] of what an element stores.
fn stored_in(element: u32) -> f32 {
    let corners = corners_of(element);
    var x: array<vec3f, 4>;
    var way: array<vec3f, 4>;
    for (var i = 0u; i < 4u; i++) {
        let v = corners[i];
        x[i] = start_of(v);
        way[i] = points[v].xyz - x[i];
    }
    let tet_lanes = table[TET_LANES_AT];
    if element >= tet_lanes {
        let row = element_row(element - tet_lanes);
        return element_energy_change(table[row + ELEMENT_KIND], moment_of(row, x, frame.dt), x, way);
    }
    let block = element / LANES;
    let lane = element % LANES;
    if is_recovered(block) {
        return stored_in_recovered(block, lane, x, way);
    }
    let material = tissue_of(tets[block].material[lane]);
    let shape = shape_of(block, lane);
    let f = deformation_gradient(x, shape);
    let d = deformation_gradient(way, shape);
    let density = law_energy_change(law_of(block), f, d, material.lame_lambda, material.lame_mu);
    return tets[block].rest_volume[lane] * density;
}

fn add_energy_of(v: u32, into: ptr<function, Sums>) {
    let on_vertex = vertex_data_of(EXTERNAL_FORCES, v);
    if on_vertex.w == 0.0 {
        return;
    }
    let mass = 1.0 / on_vertex.w;
    // Velocities at the start of the step are kept there until its end.
    let before = vertex_data_of(PREDICTED, v).xyz;
    let velocity = vertex_data_of(VELOCITIES, v).xyz;
    let hold = vertex_data_of(TARGETS, v);
    let start = vertex_data_of(PREVIOUS, v).xyz;
    let moved = points[v].xyz - start;
    let springs = 0.5 * hold.w * dot(moved, (points[v].xyz - hold.xyz) + (start - hold.xyz));
    (*into)[ENERGY_BEFORE] += 0.5 * mass * dot(before, before);
    (*into)[ENERGY_KINETIC] += 0.5 * mass * dot(velocity, velocity);
    (*into)[ENERGY_WORK] += dot(frame.gravity * mass + on_vertex.xyz, moved) - springs;
}

@compute @workgroup_size(256)
fn measure_energy(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let piece = workgroup.x + workgroup.y * groups.x;
    if piece >= job.count {
        return;
    }
    let row = piece_row(piece);
    let are_vertices = table[row + PIECE_ARE_VERTICES] != 0u;
    var sums: Sums;
    for (var i = table[row + PIECE_FIRST] + local; i < table[row + PIECE_END]; i += THREADS) {
        if are_vertices {
            add_energy_of(i, &sums);
            continue;
        }
        let element = member(i);
        if element < table[FIRST_SAMPLE_AT] {
            let change = stored_in(element);
            sums[ENERGY_STORED] += change;
            sums[ENERGY_SIZE] += abs(change);
            continue;
        }
        let at = contact_at(element - table[FIRST_SAMPLE_AT]);
        if slots_used(loads[at].w) > 0u {
            let given = loads[at + 2u].z;
            sums[ENERGY_NEAR] += 1.0;
            sums[ENERGY_STORED] -= given;
            sums[ENERGY_SIZE] += abs(given);
        }
    }
    reduce(sums, 1u, 0u, local);
    let part = table[row + PIECE_PART];
    if local == 0u && piece == table[part_row(part) + PART_VERTEX_PIECES] {
        control.parts[part].guard.best_value = control.parts[part].guard.mixture_best;
    }
    if local < ENERGIES {
        partial_sums[SUMS * piece + local] = totals[local];
    }
}

// Of a part: how the step ends, and the factor of its velocities.
struct EnergyLimit {
    is_taken: u32,
    share: f32,
}

var<workgroup> energy_limit: EnergyLimit;

fn limit_of_energy(part: u32, reports: bool) -> EnergyLimit {
    if totals[ENERGY_NEAR] == 0.0 {
        if reports {
            control.parts[part].guard.mixture_best = 0.0;
        }
        return EnergyLimit(1u, 1.0);
    }
    let kinetic = totals[ENERGY_KINETIC];
    let work = totals[ENERGY_WORK];
    let given = totals[ENERGY_BEFORE] - totals[ENERGY_STORED] + work + control.parts[part].guard.best_value;
    let size = totals[ENERGY_SIZE] + totals[ENERGY_BEFORE];
    let noise = 8.0 * EPSILON * (size + abs(work));
    var limit = EnergyLimit(1u, 1.0);
    var owed = clamp(given - kinetic, 0.0, SWING * (size + kinetic));
    if !(is_finite(given) && is_finite(kinetic) && given >= -noise) {
        limit = EnergyLimit(0u, 0.0);
        owed = 0.0;
    } else if kinetic > given {
        limit.share = sqrt(max(given, 0.0) / kinetic);
    }
    if reports {
        // The other word is read by this dispatch.
        control.parts[part].guard.mixture_best = owed;
        control.parts[part].guard.was_rejected = 1u - limit.is_taken;
        control.parts[part].guard.kept_speed = limit.share;
        if limit.is_taken == 0u {
            atomicAdd(&control.rejected, 1u);
        }
    }
    return limit;
}

// `job.first`: the first piece of vertices, whose number the job counts.
@compute @workgroup_size(256)
fn limit_energy(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let place = workgroup.x + workgroup.y * groups.x;
    if place >= job.count {
        return;
    }
    let piece = job.first + place;
    let row = piece_row(piece);
    let part = table[row + PIECE_PART];
    let count = piece_count(part);
    var sums: Sums;
    add_averaged_energies(part, local, &sums);
    for (var i = local; i < count; i += THREADS) {
        for (var k = 0u; k < ENERGIES; k++) {
            sums[k] += partial_sums[SUMS * piece_at(part, i) + k];
        }
    }
    reduce(sums, 1u, 0u, local);
    if local == 0u {
        energy_limit = limit_of_energy(part, piece == table[part_row(part) + PART_VERTEX_PIECES]);
    }
    let limit = workgroupUniformLoad(&energy_limit);
    for (var v = table[row + PIECE_FIRST] + local; v < table[row + PIECE_END]; v += THREADS) {
        if limit.share == 1.0 || vertex_data_of(EXTERNAL_FORCES, v).w == 0.0 {
            continue;
        }
        if limit.is_taken == 0u {
            points[v] = vec4f(vertex_data_of(PREVIOUS, v).xyz, 0.0);
            vertex_data[PREDICTED * table[STRIDE_AT] + v] = vec4f(points[v].xyz, vertex_data_of(PREDICTED, v).w);
        }
        // A speed that is no number times zero is none.
        let velocity = select(vec3f(), vertex_data_of(VELOCITIES, v).xyz * limit.share, limit.is_taken != 0u);
        vertex_data[VELOCITIES * table[STRIDE_AT] + v] = vec4f(velocity, 0.0);
    }
}
