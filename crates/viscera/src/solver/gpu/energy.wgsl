// The energy limit (solver/energy.rs), part by part.
//
//   T_1 <= T_n + V(x_n with pins moved) - V(x_1) + sum_i (m_i g + f_i) . (x_1 - x_n)_i
//   v *= sqrt(limit/T_1) where it is exceeded; without any hold relative to the center of mass

fn vector_at(sum: u32) -> vec3f {
    return vec3f(totals[sum], totals[sum + 1u], totals[sum + 2u]);
}

// The velocity [m/s] that is not scaled, and the share that what is beside it keeps: one workgroup for
// each part.
@compute @workgroup_size(256)
fn limit_parts(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let part = workgroup.x + workgroup.y * groups.x;
    if part >= job.count {
        return;
    }
    let row = part_row(part);
    var sums: Sums;
    // Of elements what is stored, and whether something holds them.
    for (var piece = table[row] + local; piece < table[row + 1u]; piece += THREADS) {
        for (var k = SUM_TESTED; k <= SUM_HELD; k++) {
            sums[k] += partial_sums[SUMS * piece + k];
        }
    }
    for (var piece = table[row + 2u] + local; piece < table[row + 3u]; piece += THREADS) {
        for (var k = SUM_HELD; k < SUMS; k++) {
            sums[k] += partial_sums[SUMS * piece + k];
        }
    }
    reduce(sums, 3u, local);
    if local != 0u {
        return;
    }
    var kinetic = totals[SUM_KINETIC];
    var given = totals[SUM_KINETIC_START] - totals[SUM_TESTED] + totals[SUM_WORK];
    var drift = vec3f();
    if totals[SUM_HELD] == 0.0 && totals[SUM_MASS] > 0.0 {
        let inverse = 1.0 / totals[SUM_MASS];
        let before = vector_at(SUM_MOMENTUM_START);
        let after = vector_at(SUM_MOMENTUM);
        drift = end_velocity(first_vertex_of(part)) + after * inverse;
        kinetic = totals[SUM_RELATIVE] - 0.5 * inverse * dot(after, after);
        given = totals[SUM_RELATIVE_START] - 0.5 * inverse * dot(before, before);
        given += totals[SUM_RELATIVE_WORK] - frame.dt * inverse * dot(vector_at(SUM_LOAD), after);
        given -= totals[SUM_TESTED];
    }
    var share = 1.0;
    let is_known = is_finite(given) && totals[SUM_REFERENCE] == 0.0;
    if is_known && kinetic > given {
        share = sqrt(max(given, 0.0) / kinetic);
    }
    let at = table[PARTS_AT] + 4u * part;
    for (var axis = 0u; axis < 3u; axis++) {
        partial_sums[at + axis] = drift[axis];
    }
    partial_sums[at + 3u] = share;
}

// v = (x - x_n)/dt, limited: one workgroup for each piece of vertices. `job.first`: the first of them.
@compute @workgroup_size(256)
fn limit_velocities(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let piece = workgroup.x + workgroup.y * groups.x;
    if piece >= job.count {
        return;
    }
    let row = piece_row(job.first + piece);
    let at = table[PARTS_AT] + 4u * table[row];
    let drift = vec3f(partial_sums[at], partial_sums[at + 1u], partial_sums[at + 2u]);
    let share = partial_sums[at + 3u];
    for (var i = table[row + 1u] + local; i < table[row + 2u]; i += THREADS) {
        let v = member(i);
        var velocity = end_velocity(v);
        if share < 1.0 && ground_of(ACTING, v).w != 0.0 {
            velocity = drift + (velocity - drift) * share;
        }
        ground[VELOCITIES * table[STRIDE] + v] = vec4f(velocity, 0.0);
    }
}
