// Takes all multipliers of a part's tetrahedra from the positions, where one of the part was found broken (mode 0)
// or whatever they are (mode 1); see history.wgsl.
@compute @workgroup_size(64)
fn repair_multipliers(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let stride = 64u * groups.x * groups.y;
    for (var i = thread_of(id, groups, 64u); i < job.count; i += stride) {
        let block = job.set_first + i / LANES;
        if is_repaired(table[table[BLOCK_PARTS_AT] + block]) {
            repair_tet(block, i % LANES);
        }
    }
}

fn repair_tet(block: u32, lane: u32) {
    let kind = tets[block].material[lane];
    let counts = kind != FILLING;
    let material = tissue_of(select(0u, kind, counts));
    let volume = select(0.0, tets[block].rest_volume[lane], counts);
    let vertices = vertices_of(block, lane);
    let x = array<vec3f, 4>(
        position(vertices[0]),
        position(vertices[1]),
        position(vertices[2]),
        position(vertices[3]),
    );
    let shape = shape_of(block, lane);
    let l = form_constitutive(x, shape, material, volume * frame.squared_dt);
    for (var p = 0u; p < MULTIPLIER_COUNT; p++) {
        let place = place_of(job.multiplier_offset, MULTIPLIER_COUNT, block, p, lane);
        store_multiplier(place, select(0.0, l[p], counts));
    }
    if job.is_viscous != 0u {
        // Kelvin-Voigt: V eta dt takes the place of V dt^2.
        let change = tissue_change_since(deformation_gradient(x, shape), start_strain_of(block, lane));
        let scale = volume * material.viscosity * frame.dt;
        let lambda = material.lame_lambda;
        let l = green_strain_constitutive_multipliers(change, lambda, material.lame_mu, scale);
        for (var p = 0u; p < 6u; p++) {
            let place = place_of(job.viscous_offset, 6u, block, p, lane);
            store_multiplier(place, select(0.0, l[p], counts));
        }
    }
}
