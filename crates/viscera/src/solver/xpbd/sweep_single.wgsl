// Springs and attachments in a sweep, one colour at a time (solver/xpbd/sweep.rs); see sweep.wgsl.

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
    let a = points[read_place(spring.vertices[0], spring.copies[0])];
    let b = points[read_place(spring.vertices[1], spring.copies[1])];
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
    let first = write_place(spring.vertices[0], spring.copies[0]);
    let second = write_place(spring.vertices[1], spring.copies[1]);
    write_point(first, vec4f(a.xyz + change.positions[0] * relaxation, a.w));
    write_point(second, vec4f(b.xyz + change.positions[1] * relaxation, b.w));
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
    let point = points[read_place(attachment.vertex, attachment.copy_index)];
    let compliance_tilde = 1.0 / (attachment.stiffness * frame.squared_dt);
    let l = multipliers_of(attachment.multiplier);
    let change = attachment_solve(point.xyz, point.w, anchors[index].xyz, l, compliance_tilde);
    let after = l + frame.relaxation_multipliers * change.multipliers;
    multipliers[attachment.multiplier] = after.x;
    multipliers[attachment.multiplier + 1u] = after.y;
    multipliers[attachment.multiplier + 2u] = after.z;
    let x = point.xyz + change.position * frame.relaxation_positions;
    write_point(write_place(attachment.vertex, attachment.copy_index), vec4f(x, point.w));
}

fn multipliers_of(first: u32) -> vec3f {
    return vec3f(multipliers[first], multipliers[first + 1u], multipliers[first + 2u]);
}
