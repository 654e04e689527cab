// The energy limit (solver/step/energy.rs), part by part.
//
//   T_1 <= T_n + V(x_n with pins moved) - V(x_1) + sum_i (m_i g + f_i) . (x_1 - x_n)_i
//   v *= sqrt(limit/T_1) where it is exceeded; without any hold relative to the center of mass
//   where tools are near, the smaller of two limits: at most T_n above what the tools say that they do, W

// Of what tools give: energy [J] that they add by moving into tissue that stands still, their work [J] by the forces at the start of
// the step and at its end, and samples that they are near to. In the place of sums that the limit does not need.
const GIVEN_LIFTED: u32 = SUM_MAGNITUDE;
const GIVEN_WORK_BEFORE: u32 = SUM_FORCE;
const GIVEN_WORK_AFTER: u32 = SUM_REACH;
const GIVEN_NEAR: u32 = SUM_AHEAD;

fn vector_at(sum: u32) -> vec3f {
    return vec3f(totals[sum], totals[sum + 1u], totals[sum + 2u]);
}

// The velocity [m/s] that is not scaled, and the factor for velocities relative to it.
struct Limit {
    drift: vec3f,
    share: f32,
}

var<workgroup> limit: Limit;

// v = (x - x_n)/dt, limited: one workgroup for each piece of vertices, each of which adds up what its part
// has; the first reports how the step ended. `job.first`: the first of them.
@compute @workgroup_size(256)
fn limit_velocities(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let place_of_piece = workgroup.x + workgroup.y * groups.x;
    if place_of_piece >= job.count {
        return;
    }
    let piece = job.first + place_of_piece;
    let row = piece_row(piece);
    let part = table[row + PIECE_PART];
    let reports = piece == table[part_row(part) + PART_VERTEX_PIECES];
    // Whatever is long is called at one place.
    for (var is_limited = !reports; ; is_limited = true) {
        var sums: Sums;
        if is_limited {
            add_motions(part, local, &sums);
        } else {
            add_pieces(part, local, &sums);
        }
        let maxima = select(1u << SUM_REACH, 0u, is_limited);
        reduce(sums, select(1u, SUMS / 8u, is_limited), maxima, local);
        if is_limited {
            break;
        }
        // The sums of pieces are those of the place where the step ended: `evaluate` has run again where it was
        // rejected.
        if local == 0u {
            let potential = potential_of_totals();
            control.parts[part].guard.potential = potential.value;
            control.parts[part].guard.noise = potential.noise;
        }
    }
    if local == 0u {
        limit = limit_of(part);
        if reports {
            control.parts[part].guard.kept_speed = limit.share;
        }
    }
    let now = workgroupUniformLoad(&limit);
    for (var v = table[row + PIECE_FIRST] + local; v < table[row + PIECE_END]; v += THREADS) {
        var velocity = end_velocity(v);
        if now.share < 1.0 && vertex_data_of(EXTERNAL_FORCES, v).w != 0.0 {
            velocity = now.drift + (velocity - now.drift) * now.share;
        }
        vertex_data[VELOCITIES * table[STRIDE_AT] + v] = vec4f(velocity, 0.0);
    }
}

fn add_motions(part: u32, local: u32, into: ptr<function, Sums>) {
    let row = part_row(part);
    // Of elements what is stored, and whether something holds them.
    let elements_end = table[row + PART_ELEMENT_PIECES_END];
    for (var piece = table[row + PART_ELEMENT_PIECES] + local; piece < elements_end; piece += THREADS) {
        // Without the weight dt^2 of the potential: `limit_of` needs energies [J].
        let at = SUMS * piece;
        (*into)[SUM_TESTED] += partial_sums[at + SUM_TESTED];
        (*into)[SUM_REFERENCE] += partial_sums[at + SUM_REFERENCE];
        (*into)[SUM_HELD] += partial_sums[at + SUM_HELD];
        if has_samples() {
            (*into)[GIVEN_LIFTED] += partial_sums[at + SUM_GIVEN];
            (*into)[GIVEN_WORK_BEFORE] += partial_sums[at + SUM_GIVEN + 1u];
            (*into)[GIVEN_WORK_AFTER] += partial_sums[at + SUM_GIVEN + 2u];
            (*into)[GIVEN_NEAR] += partial_sums[at + SUM_GIVEN + 3u];
        }
    }
    let vertices_end = table[row + PART_VERTEX_PIECES_END];
    for (var piece = table[row + PART_VERTEX_PIECES] + local; piece < vertices_end; piece += THREADS) {
        // From the holds on: what vertices have before that is inertia of the potential [J s^2].
        for (var k = SUM_HELD; k < SUMS; k++) {
            (*into)[k] += partial_sums[SUMS * piece + k];
        }
    }
}

fn limit_of(part: u32) -> Limit {
    var kinetic = totals[SUM_KINETIC];
    var given = totals[SUM_KINETIC_START] - totals[SUM_TESTED] + totals[SUM_WORK];
    var drift = vec3f();
    if totals[SUM_HELD] == 0.0 && totals[SUM_MASS] > 0.0 {
        // Relative to the centre of mass, as on the CPU, but from sums relative to the part's first vertex: in
        // single precision a fast common motion would swallow the rest. The centre moves at `after * inverse`
        // against that vertex; the terms with `inverse` take this remainder out. `dt` makes a way of a velocity.
        let inverse = 1.0 / totals[SUM_MASS];
        let before = vector_at(SUM_MOMENTUM_START);
        let after = vector_at(SUM_MOMENTUM);
        drift = end_velocity(first_vertex_of(part)) + after * inverse;
        kinetic = totals[SUM_RELATIVE] - 0.5 * inverse * dot(after, after);
        given = totals[SUM_RELATIVE_START] - 0.5 * inverse * dot(before, before);
        given += totals[SUM_RELATIVE_WORK] - frame.dt * inverse * dot(vector_at(SUM_LOAD), after);
        given -= totals[SUM_TESTED];
    }
    if totals[GIVEN_NEAR] > 0.0 {
        // Tools move while the tissue stands: that bound charges the overlap that they make. The other charges what they say
        // that they do, and only forbids to gain.
        let after = totals[GIVEN_WORK_AFTER];
        let work = max(after, 0.5 * (totals[GIVEN_WORK_BEFORE] + after));
        given = min(given, max(given - totals[GIVEN_LIFTED] + work, totals[SUM_KINETIC_START]));
    }
    var share = 1.0;
    // Energies are differences to the start of the step. Where one there is NaN its difference means nothing, and
    // there is no limit.
    let is_known = is_finite(given) && totals[SUM_REFERENCE] == 0.0;
    if is_known && kinetic > given {
        share = sqrt(max(given, 0.0) / kinetic);
    }
    return Limit(drift, share);
}
