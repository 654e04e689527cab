// Springs and attachments: one colour of a sweep (mode 0), or their loads (mode 1: J^T l, mode 2: squared
// step times force). Threads below `job.first` do springs, the others attachments; the first of each
// and their number stand in `set_first`, `multiplier_offset` and `viscous_offset`.

@compute @workgroup_size(64)
fn solve_springs(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let thread = thread_of(id, groups, 64u);
    if thread >= job.count {
        return;
    }
    let spring = springs[job.first + thread];
    let a = points[spring.copies[0]];
    let b = points[spring.copies[1]];
    let compliance_tilde = 1.0 / (spring.stiffness * frame.squared_dt);
    let l = multipliers[spring.multiplier];
    let change = spring_solve(
        array<vec3f, 2>(a.xyz, b.xyz),
        array<f32, 2>(a.w, b.w),
        spring.rest_length,
        l,
        compliance_tilde,
    );
    multipliers[spring.multiplier] = l + frame.relaxation_multipliers * change.multiplier;
    let relaxation = frame.relaxation_positions;
    points[spring.copies[0]] = vec4f(a.xyz + change.positions[0] * relaxation, a.w);
    points[spring.copies[1]] = vec4f(b.xyz + change.positions[1] * relaxation, b.w);
}

@compute @workgroup_size(64)
fn solve_attachments(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let thread = thread_of(id, groups, 64u);
    if thread >= job.count {
        return;
    }
    let index = job.first + thread;
    let attachment = attachments[index];
    let point = points[attachment.copy_index];
    let compliance_tilde = 1.0 / (attachment.stiffness * frame.squared_dt);
    let l = multipliers_of(attachment.multiplier);
    let change = attachment_solve(point.xyz, point.w, anchors[index].xyz, l, compliance_tilde);
    let after = l + frame.relaxation_multipliers * change.multipliers;
    multipliers[attachment.multiplier] = after.x;
    multipliers[attachment.multiplier + 1u] = after.y;
    multipliers[attachment.multiplier + 2u] = after.z;
    let x = point.xyz + change.position * frame.relaxation_positions;
    points[attachment.copy_index] = vec4f(x, point.w);
}

fn multipliers_of(first: u32) -> vec3f {
    return vec3f(multipliers[first], multipliers[first + 1u], multipliers[first + 2u]);
}

// J^T l and the bound of its geometric stiffness.
@compute @workgroup_size(64)
fn load_springs(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let thread = thread_of(id, groups, 64u);
    if thread >= job.count {
        return;
    }
    let spring = springs[thread];
    let x = array<vec3f, 2>(points[spring.vertices[0]].xyz, points[spring.vertices[1]].xyz);
    let load = spring_corner_loads(x, multipliers[spring.multiplier]);
    loads[spring.slots[0]] = vec4f(load[0].impulse, load[0].mass_bound);
    loads[spring.slots[1]] = vec4f(load[1].impulse, load[1].mass_bound);
}

@compute @workgroup_size(64)
fn load_attachments(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let thread = thread_of(id, groups, 64u);
    if thread >= job.count {
        return;
    }
    let attachment = attachments[thread];
    loads[attachment.slot] = vec4f(multipliers_of(attachment.multiplier), 0.0);
}
