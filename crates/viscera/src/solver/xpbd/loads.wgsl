// J^T l of each tetrahedron and the bound of its geometric stiffness, into a place for each corner; the
// vertex gathers them in their fixed order (solver/xpbd/loads.rs).
@compute @workgroup_size(64)
fn load_multipliers(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let thread = thread_of(id, groups, 64u);
    if thread >= job.count {
        return;
    }
    let block = job.first + thread / LANES;
    let lane = thread % LANES;
    if tets[block].material[lane] == FILLING {
        return;
    }
    let shape = shape_of(block, lane);
    let vertices = vertices_of(block, lane);
    var x: array<vec3f, 4>;
    for (var i = 0u; i < 4u; i++) {
        x[i] = points[vertices[i]].xyz;
    }
    var l: Multipliers;
    for (var p = 0u; p < MULTIPLIER_COUNT; p++) {
        l[p] = multipliers[place_of(job.multiplier_offset, MULTIPLIER_COUNT, block, p, lane)];
    }
    var sum = form_corner_loads(x, shape, l);
    if job.is_viscous != 0u {
        var l: array<f32, 6>;
        for (var p = 0u; p < 6u; p++) {
            l[p] = multipliers[place_of(job.viscous_offset, 6u, block, p, lane)];
        }
        let more = green_strain_corner_loads(x, shape, l);
        for (var i = 0u; i < 4u; i++) {
            sum[i].impulse += more[i].impulse;
            sum[i].mass_bound += more[i].mass_bound;
        }
    }
    let slots = indices_of(block, lane);
    for (var i = 0u; i < 4u; i++) {
        loads[slots[i]] = vec4f(sum[i].impulse, sum[i].mass_bound);
    }
}
