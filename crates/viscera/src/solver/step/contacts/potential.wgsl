// Contact in the incremental potential (contacts/mod.rs): samples of the surface are members of pieces behind the elements.
//
//   Phi += dt^2 sum_s (E_s(x) - E_s(x_ref)),   the change of each sample by itself;   tools are where the step ends

fn has_samples() -> bool {
    return table[SAMPLE_OFFSETS_AT] != 0u;
}

fn is_sample(element: u32) -> bool {
    return element >= table[FIRST_SAMPLE_AT];
}

fn sample_corners(element: u32) -> array<u32, 4> {
    let row = sample_row(element - table[FIRST_SAMPLE_AT]);
    return array<u32, 4>(table[row], table[row + 1u], table[row + 2u], table[row + 3u]);
}

fn weights_of(row: u32) -> vec4f {
    let at = row + SAMPLE_WEIGHTS;
    return vec4f(number(at), number(at + 1u), number(at + 2u), number(at + 3u));
}

fn mean_of(weights: vec4f, x: array<vec3f, 4>) -> vec3f {
    return x[0] * weights.x + x[1] * weights.y + x[2] * weights.z + x[3] * weights.w;
}

// What a range of the vertex data holds of the vertices of a sample.
fn all_of(range: u32, row: u32) -> array<vec3f, 4> {
    var x: array<vec3f, 4>;
    for (var i = 0u; i < 4u; i++) {
        x[i] = vertex_data_of(range, table[row + i]).xyz;
    }
    return x;
}

// The change [J] of a sample's energy since the start of the step with its pins moved, and the square of the forces [N^2] that a
// rounded place moves through.
fn sample_answer(element: u32, x: array<vec3f, 4>) -> vec2f {
    let sample = element - table[FIRST_SAMPLE_AT];
    let at = contact_at(sample);
    let used = slots_used(loads[at].w);
    if used == 0u {
        return vec2f();
    }
    let row = sample_row(sample);
    let weights = weights_of(row);
    let start = all_of(REFERENCE, row);
    let base = mean_of(weights, start);
    let ways = array<vec3f, 4>(x[0] - start[0], x[1] - start[1], x[2] - start[2], x[3] - start[3]);
    let way = mean_of(weights, ways);
    var found = vec2f();
    for (var slot = 0u; slot < used; slot++) {
        let touching = touching_of(at, slot, row);
        var met: array<Met, 2>;
        for (var k = 0u; k < 2u; k++) {
            met[k] = meet(touching, AT_END, base + way * f32(k));
        }
        found.x += contact_change(touching, AT_END, met[0], met[1], way);
        let thickness = tools.kinds[tool_of(touching.marks)].law.z;
        let most = length_of(felt_of(touching, met[1]).force) + stiffness_of(touching, met[1]).x * thickness;
        found.y += most * most;
    }
    return found;
}

// What the motion of tools gives to a sample that ends at `x`: energy [J] that they add by moving into tissue that stands still;
// their work [J] by the forces at the start of the step and at its end; and whether one is near.
fn given_to(element: u32, x: array<vec3f, 4>) -> vec4f {
    let sample = element - table[FIRST_SAMPLE_AT];
    let at = contact_at(sample);
    let used = slots_used(loads[at].w);
    if used == 0u {
        return vec4f();
    }
    let row = sample_row(sample);
    let weights = weights_of(row);
    let start = mean_of(weights, all_of(PREVIOUS, row));
    let end = mean_of(weights, x);
    var given = vec4f(0.0, 0.0, 0.0, 1.0);
    for (var slot = 0u; slot < used; slot++) {
        let touching = touching_of(at, slot, row);
        let tool = tool_of(touching.marks);
        var poses = array<u32, 3>(AT_START, AT_END, AT_END);
        var met: array<Met, 3>;
        for (var k = 0u; k < 3u; k++) {
            met[k] = meet(touching, poses[k], select(start, end, k == 2u));
        }
        given.x += contact_energy(touching, met[1]) - contact_energy(touching, met[0]);
        let kept = loads[slot_vectors(at, slot) + 3u].xyz;
        given.y += work_of(tool, kept, start - origin_of(tool, AT_START));
        let force = felt_of(touching, met[2]).force;
        given.z += work_of(tool, force, end - origin_of(tool, AT_END));
    }
    return given;
}

// A bound of how the gradient of the distance turns where a sample is [1/m]; none at planes.
fn turning_at(touching: Touching, met: Met, place: vec3f) -> f32 {
    let tool = tool_of(touching.marks);
    let kind = u32(tools.kinds[tool].law.x);
    if (touching.marks & HAS_PLANE) != 0u || kind == HALF_SPACE {
        return 0.0;
    }
    if kind == SOLID {
        let cell = cell_at(tool, into_tool(tool, AT_END, place));
        if cell.edge == 0.0 {
            return 0.0;
        }
        // Within a cell as the function says, from cell to cell as the surface does.
        let bend = max(tools.kinds[tool].bounds.z + max(met.distance, 0.0), tools.kinds[tool].grid.w);
        return length_of(twist_of(cell)) * sqrt(2.0) / (cell.edge * cell.edge) + 1.0 / bend;
    }
    let radius = tools.kinds[tool].lengths.w;
    let away = met.distance + radius;
    // Inside a box the nearest face decides.
    return select(1.0 / max(away, INNERMOST * radius), 0.0, away < 0.0);
}

const INNERMOST: f32 = 0.1;

// The mixed derivatives of the function of a cell, times its edge.
fn twist_of(cell: Cell) -> vec3f {
    let v = cell.values;
    let t = cell.share;
    let xy = vec2f(v[6] - v[4] - v[2] + v[0], v[7] - v[5] - v[3] + v[1]);
    let xz = vec2f(v[5] - v[4] - v[1] + v[0], v[7] - v[6] - v[3] + v[2]);
    let yz = vec2f(v[3] - v[2] - v[1] + v[0], v[7] - v[6] - v[5] + v[4]);
    return vec3f(mix(xy.x, xy.y, t.z), mix(xz.x, xz.y, t.y), mix(yz.x, yz.y, t.x));
}

// Leaves a sample's force and the curvature of its energy where vertices gather them, times dt^2.
fn load_sample(element: u32, x: array<vec3f, 4>) {
    let sample = element - table[FIRST_SAMPLE_AT];
    let at = contact_at(sample);
    let mark = loads[at].w;
    let used = slots_used(mark);
    if used == 0u {
        return;
    }
    let row = sample_row(sample);
    let weights = weights_of(row);
    let place = mean_of(weights, x);
    var force = vec3f();
    var direct = vec3f();
    var mixed = vec3f();
    var bound = 0.0;
    for (var slot = 0u; slot < used; slot++) {
        let touching = touching_of(at, slot, row);
        let met = meet(touching, AT_END, place);
        let felt = felt_of(touching, met);
        let stiffness = stiffness_of(touching, met);
        var turning = 0.0;
        if felt.pressed > 0.0 {
            turning = felt.pressed / met.slope * turning_at(touching, met, place);
        }
        let along = stiffness.x + stiffness.y;
        let across = stiffness.z;
        let n = met.normal;
        force += felt.force;
        bound += max(along, across) + turning;
        direct += vec3f(across + turning) + n * n * (along - across);
        mixed += vec3f(n.y * n.z, n.x * n.z, n.x * n.y) * (along - across);
    }
    let share = frame.squared_dt * dot(abs(weights), vec4f(1.0));
    loads[at] = vec4f(force * frame.squared_dt, mark);
    loads[at + 1u] = vec4f(direct, mixed.x) * share;
    loads[at + 2u] = vec4f(mixed.yz, bound, 0.0) * share;
}

// Before a rebase.
@compute @workgroup_size(64)
fn load_contacts(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let sample = thread_of(id, groups, 64u);
    if sample >= job.count || loads[contact_at(sample)].w == 0.0 {
        return;
    }
    let row = sample_row(sample);
    var x: array<vec3f, 4>;
    for (var i = 0u; i < 4u; i++) {
        x[i] = points[table[row + i]].xyz;
    }
    load_sample(table[FIRST_SAMPLE_AT] + sample, x);
}
