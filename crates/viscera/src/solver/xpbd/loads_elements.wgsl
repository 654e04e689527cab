// The loads of elements that are no tetrahedra on their vertices: J^T l and the bound of its geometric stiffness
// (solver/xpbd/loads.rs); see loads.wgsl.
@compute @workgroup_size(64)
fn load_elements(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let thread = thread_of(id, groups, 64u);
    if thread >= job.count {
        return;
    }
    let row = element_row(thread);
    let kind = table[row + ELEMENT_KIND];
    let vertices = four_of(row + ELEMENT_VERTICES);
    var x: array<vec3f, 4>;
    for (var i = 0u; i < 4u; i++) {
        x[i] = points[vertices[i]].xyz;
    }
    var l: vec4f;
    for (var p = 0u; p < element_multipliers(kind); p++) {
        l[p] = multipliers[table[row + ELEMENT_MULTIPLIER] + p];
    }
    let moment = moment_of(row, before_steps(vertices), frame.dt);
    var all = element_loads(kind, moment, x, l, frame.squared_dt);
    for (var i = 0u; i < element_corners(kind); i++) {
        loads[table[row + ELEMENT_SLOTS + i]] = vec4f(all[i].impulse, all[i].mass_bound);
    }
}
