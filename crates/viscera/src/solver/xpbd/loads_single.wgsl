// What springs and attachments put on their vertices (solver/xpbd/loads.rs); see loads.wgsl.

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
