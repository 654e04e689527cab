// The end of a step: what is kept of contact, and the forces of tools (contact/touch.rs, `keep`).
//
//   u *= min(1, mu min(N, N_new)/(K |u|)),  a = p - u,  N = N_new;   nothing is kept where N_new = 0
//   force on a tool  -f,  torque about its origin  (p - t) x (-f)
//
// `end_contacts` leaves sums of 256 samples for each tool, `report_tools` adds them up, a workgroup for each tool. Sums of a
// tool: force and torque, samples that it presses on, those of them that only hang on pinned vertices, samples that had no slot
// for it; the deepest that tissue is inside the contact's thickness [m].

const TOOL_MAXIMA: u32 = 0x200u;

fn tool_sums_at(tool: u32) -> u32 {
    return table[TOOL_SUMS_AT] + TOOL_SUMS * tool;
}

fn piece_sums_at(group: u32, tool: u32) -> u32 {
    return tool_sums_at(MOST_TOOLS + MOST_TOOLS * group + tool);
}

// What a slot gives to its tool.
struct Given {
    tool: u32,
    force: vec3f,
    torque: vec3f,
    depth: f32,
}

fn end_slot(at: u32, slot: u32, row: u32, place: vec3f) -> Given {
    let touching = touching_of(at, slot, row);
    let tool = tool_of(touching.marks);
    let law = tools.kinds[tool].law;
    let met = meet(touching, AT_END, place);
    let felt = felt_of(touching, met);
    let into = slot_vectors(at, slot);
    let was_tied = (touching.marks & IS_TIED) != 0u;
    let is_locked = tools.all[tool].way.w != 0.0;
    let is_tied = is_locked && (was_tied || felt.pressed > 0.0);
    var marks = touching.marks & (HAS_PLANE | IS_TIED | (MOST_TOOLS - 1u));
    if felt.pressed > 0.0 || is_tied {
        var anchor = into_tool(tool, AT_END, place);
        if touching.friction.w > 0.0 {
            if was_tied && is_tied {
                anchor = touching.friction.xyz;
            } else if !was_tied {
                let elastic = touching.stiffness * law.y * length_of(met.slip);
                let most = min(touching.friction.w, law.w * felt.pressed);
                let share = select(1.0, most / elastic, elastic > most);
                anchor = into_tool(tool, AT_END, place - met.slip * share);
            }
        }
        if (marks & HAS_PLANE) == 0u {
            let local = into_tool(tool, AT_END, place);
            loads[into] = tangent(tool, local, distance_to(tool, local));
        }
        loads[into + 2u] = vec4f(anchor, felt.pressed);
        marks |= IS_KEPT | select(0u, WILL_BE_TIED, is_tied);
    }
    loads[into + 3u] = vec4f(felt.force, f32(marks));
    let arm = place - origin_of(tool, AT_END);
    return Given(tool, -felt.force, cross(arm, -felt.force), law.z - met.distance);
}

// `job.count` samples.
@compute @workgroup_size(256)
fn end_contacts(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let group = workgroup.x + workgroup.y * groups.x;
    let sample = THREADS * group + local;
    var given: array<Given, SLOTS>;
    var used = 0u;
    var left_out = 0u;
    var is_pinned = true;
    if sample < job.count {
        let row = sample_row(sample);
        let at = contact_at(sample);
        let mark = u32(loads[at].w);
        used = mark & 7u;
        left_out = mark >> 3u;
        var place = vec3f();
        for (var i = 0u; i < 4u; i++) {
            let v = table[row + i];
            let weight = number(row + SAMPLE_WEIGHTS + i);
            place += points[v].xyz * weight;
            is_pinned = is_pinned && (weight == 0.0 || vertex_data_of(EXTERNAL_FORCES, v).w == 0.0);
        }
        for (var slot = 0u; slot < used; slot++) {
            given[slot] = end_slot(at, slot, row, place);
        }
    }
    for (var tool = 0u; tool < tools.count.x; tool++) {
        var sums: Sums;
        for (var slot = 0u; slot < used; slot++) {
            let one = given[slot];
            if one.tool != tool || all(one.force == vec3f()) {
                continue;
            }
            for (var axis = 0u; axis < 3u; axis++) {
                sums[axis] += one.force[axis];
                sums[3u + axis] += one.torque[axis];
            }
            sums[6] += 1.0;
            sums[7] += select(0.0, 1.0, is_pinned);
            sums[9] = max(sums[9], one.depth);
        }
        sums[8] = f32((left_out >> tool) & 1u);
        reduce(sums, TOOL_SUMS / 8u, TOOL_MAXIMA, local);
        if local < TOOL_SUMS {
            partial_sums[piece_sums_at(group, tool) + local] = totals[local];
        }
        workgroupBarrier();
    }
}

// `job.count` groups of samples.
@compute @workgroup_size(256)
fn report_tools(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let tool = workgroup.x + workgroup.y * groups.x;
    var sums: Sums;
    for (var group = local; group < job.count && tool < tools.count.x; group += THREADS) {
        let at = piece_sums_at(group, tool);
        for (var k = 0u; k < TOOL_SUMS; k++) {
            let one = partial_sums[at + k];
            let is_maximum = (TOOL_MAXIMA & (1u << k)) != 0u;
            sums[k] = select(sums[k] + one, max(sums[k], one), is_maximum);
        }
    }
    reduce(sums, TOOL_SUMS / 8u, TOOL_MAXIMA, local);
    if local < TOOL_SUMS && tool < MOST_TOOLS {
        partial_sums[tool_sums_at(tool) + local] = totals[local];
    }
}
