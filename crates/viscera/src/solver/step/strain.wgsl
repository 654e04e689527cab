// Green strain of tetrahedra, for viscosity.
@compute @workgroup_size(64)
fn measure_strain(
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
    let vertices = vertices_of(block, lane);
    var x: array<vec3f, 4>;
    for (var i = 0u; i < 4u; i++) {
        x[i] = points[vertices[i]].xyz;
    }
    let strain = green_strain_strain(deformation_gradient(x, shape_of(block, lane)));
    for (var p = 0u; p < 6u; p++) {
        start_strain[6u * block + p][lane] = strain[p];
    }
}
