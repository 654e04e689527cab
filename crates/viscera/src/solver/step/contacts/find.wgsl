// The beginning of a step: what samples find in the way of the tools (contact/touch.rs, `find`).
//
//   path in the tool's frame from R_0^T (p_n - t_0) to R_1^T (p_n + dt v - t_1); where it comes within dh/2 of the tool, or begins
//   within dh, the tangent plane there is the tool for this step
//
// A sample has `SLOTS` slots: what is kept of the last step comes first, then what is met, then what is near.

const MOST_TRACED: u32 = 24u;
const NOWHERE: u32 = 0xffffffffu;

struct Found {
    plane: vec4f,
    friction: vec4f,
    kept: vec4f,
    force: vec3f,
    marks: u32,
    // The lower the sooner it has a slot.
    rank: f32,
}

struct Plane {
    plane: vec4f,
    is_met: bool,
}

fn steepest_of(tool: u32) -> f32 {
    return select(1.0, tools.kinds[tool].bounds.y, u32(tools.kinds[tool].law.x) == SOLID);
}

// Along a path in the tool's frame by sphere tracing.
fn trace(tool: u32, start: vec3f, end: vec3f, thickness: f32) -> Plane {
    let way = end - start;
    let longest = length_of(way) * steepest_of(tool);
    if !(longest > 0.0) {
        return Plane(vec4f(), false);
    }
    let near = 0.5 * thickness;
    var share = 0.0;
    var at = start;
    for (var i = 0u; i < MOST_TRACED; i++) {
        let distance = distance_to(tool, at);
        if distance.value <= near * 1.02 {
            return Plane(tangent(tool, at, distance), true);
        }
        share += (distance.value - near) / longest;
        if share >= 1.0 {
            let last = distance_to(tool, end);
            return Plane(tangent(tool, end, last), last.value <= near);
        }
        at = start + way * share;
    }
    // Grazing: so near for so long that it counts. Along a gap between two sides of a tool it may be near to neither.
    let last = distance_to(tool, at);
    let is_convex = u32(tools.kinds[tool].law.x) != SOLID;
    return Plane(tangent(tool, at, last), is_convex || last.value < thickness);
}

// The place of what is kept of a tool among the slots of a sample.
fn kept_slot(at: u32, used: u32, tool: u32) -> u32 {
    for (var slot = 0u; slot < used; slot++) {
        let marks = u32(loads[slot_vectors(at, slot) + 3u].w);
        if (marks & IS_KEPT) != 0u && tool_of(marks) == tool {
            return slot_vectors(at, slot);
        }
    }
    return NOWHERE;
}

// What a sample is to a tool: no tool has that number where they are too far apart.
fn find_tool(tool: u32, place: vec3f, velocity: vec3f, slot: u32) -> Found {
    let thickness = tools.kinds[tool].law.z;
    let start = into_tool(tool, AT_START, place);
    let end = into_tool(tool, AT_END, place + velocity * frame.dt);
    let first = distance_to(tool, start);
    let is_kept = slot != NOWHERE;
    var found: Found;
    found.marks = NOWHERE;
    if first.value > 2.0 * (thickness + length_of(end - start)) * steepest_of(tool) && !is_kept {
        return found;
    }
    found.marks = tool;
    found.rank = first.value;
    var marks = 0u;
    if is_kept {
        found.kept = loads[slot + 2u];
        found.force = loads[slot + 3u].xyz;
        found.rank = -3e38;
        marks = u32(loads[slot + 3u].w);
    }
    if first.value < thickness {
        let is_shallow = first.value > -SHALLOW * thinnest_of(tool);
        found.plane = tangent(tool, start, first);
        if is_kept && !is_shallow {
            found.plane = loads[slot];
        }
        found.marks |= HAS_PLANE;
    } else {
        // Tissue may be dragged along, or held back: what stands still is looked at as well.
        var met = trace(tool, start, end, thickness);
        if !met.is_met {
            met = trace(tool, start, into_tool(tool, AT_END, place), thickness);
        }
        found.plane = met.plane;
        found.marks |= select(0u, HAS_PLANE, met.is_met);
    }
    if (found.marks & HAS_PLANE) != 0u && !is_kept {
        found.rank -= 1e30;
    }
    if is_kept {
        let is_tied = (marks & WILL_BE_TIED) != 0u;
        found.friction = vec4f(found.kept.xyz, tools.kinds[tool].law.w * found.kept.w);
        if is_tied {
            found.friction.w = LOCKED;
            found.marks |= IS_TIED;
        }
    }
    return found;
}

// The curvature of the energy at a place where tools are at the end of the step, without what may be negative in it.
fn add_curvature(touching: Touching, place: vec3f, direct: ptr<function, vec3f>, mixed: ptr<function, vec3f>) {
    let met = meet(touching, AT_END, place);
    let stiffness = stiffness_of(touching, met);
    let along = stiffness.x + stiffness.y;
    let across = stiffness.z;
    let n = met.normal;
    *direct += vec3f(across) + n * n * (along - across);
    *mixed += vec3f(n.y * n.z, n.x * n.z, n.x * n.y) * (along - across);
}

// `job.parameter`: how far ahead of the start of the step tissue is stiff, as a share of it.
@compute @workgroup_size(64)
fn find_contacts(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let sample = thread_of(id, groups, 64u);
    if sample >= job.count {
        return;
    }
    let row = sample_row(sample);
    let at = contact_at(sample);
    var place = vec3f();
    var velocity = vec3f();
    for (var i = 0u; i < 4u; i++) {
        let v = table[row + i];
        let weight = number(row + SAMPLE_WEIGHTS + i);
        place += points[v].xyz * weight;
        velocity += vertex_data_of(VELOCITIES, v).xyz * weight;
    }
    let used = slots_used(loads[at].w);
    var best: array<Found, SLOTS>;
    var count = 0u;
    var left_out = 0u;
    for (var tool = 0u; tool < tools.count.x; tool++) {
        var slot = NOWHERE;
        // What has jumped has forgotten what it touched.
        if tools.all[tool].turn.w == 0.0 {
            slot = kept_slot(at, used, tool);
        }
        let found = find_tool(tool, place, velocity, slot);
        if found.marks == NOWHERE {
            continue;
        }
        if count < SLOTS {
            best[count] = found;
            count++;
            continue;
        }
        var worst = 0u;
        for (var i = 1u; i < SLOTS; i++) {
            if best[i].rank >= best[worst].rank {
                worst = i;
            }
        }
        let takes_place = found.rank < best[worst].rank;
        left_out |= 1u << tool_of(select(found.marks, best[worst].marks, takes_place));
        if takes_place {
            best[worst] = found;
        }
    }
    loads[at] = vec4f(0.0, 0.0, 0.0, f32(count + 8u * left_out));
    var direct = vec3f();
    var mixed = vec3f();
    let ahead = place + velocity * (frame.dt * job.parameter);
    var presses = false;
    for (var i = 0u; i < count; i++) {
        let stiffness = number(row + SAMPLE_STIFFNESS);
        let touching = Touching(best[i].plane, best[i].friction, best[i].marks, stiffness);
        add_curvature(touching, ahead, &direct, &mixed);
        let gap = tools.kinds[tool_of(best[i].marks)].law.z - meet(touching, AT_END, place).distance;
        presses = presses || gap > 0.0 || best[i].friction.w > 0.0;
        let into = slot_vectors(at, i);
        loads[into] = best[i].plane;
        loads[into + 1u] = best[i].friction;
        loads[into + 2u] = best[i].kept;
        loads[into + 3u] = vec4f(best[i].force, f32(best[i].marks));
    }
    if presses {
        // The step has no number yet.
        atomicStore(&control.parts[table[row + SAMPLE_PART]].pressed_step, control.step + 1u);
    }
    loads[at + 1u] = vec4f(direct, mixed.x);
    loads[at + 2u] = vec4f(mixed.yz, 0.0, 0.0);
}
