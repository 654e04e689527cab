// What recovered-gradient tetrahedra store at the end of a step (end.wgsl), from where it began with its pins moved to the
// ends of its last and its first solve: gradients of places, then tetrahedra in measure_end, then mean volumes.

@compute @workgroup_size(64)
fn recover_ends(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let group = workgroup.x + workgroup.y * groups.x;
    if group >= job.count {
        return;
    }
    let part = table[recovered_table(RECOVERED_GROUP_PARTS) + group];
    let is_trial = progress[part].takes_trial != 0u;
    let n = 8u * group + local / LANES_OF_PLACE;
    let own = place_of_number(n).vertex;
    let x0 = reference(own);
    let last0 = place_at(own, 0u, is_trial) - x0;
    let first0 = place_at(own, 1u, is_trial) - x0;
    let before0 = vertex_data_of(PREVIOUS, own).xyz;
    var gradient = mat3x3f();
    var last = mat3x3f();
    var first = mat3x3f();
    var before = mat3x3f();
    let offsets = recovered_table(RECOVERED_RING_OFFSETS) + n;
    let end = table[offsets + 1u];
    for (var i = table[offsets] + local % LANES_OF_PLACE; i < end; i += LANES_OF_PLACE) {
        let row = recovered_table(RECOVERED_RINGS) + 4u * i;
        let v = table[row];
        let b = vec3f(number(row + 1u), number(row + 2u), number(row + 3u));
        let x = reference(v);
        gradient += recovered_outer(x - x0, b);
        last += recovered_outer((place_at(v, 0u, is_trial) - x) - last0, b);
        first += recovered_outer((place_at(v, 1u, is_trial) - x) - first0, b);
        before += recovered_outer(vertex_data_of(PREVIOUS, v).xyz - before0, b);
    }
    gradient = share_matrix(gradient, local);
    last = share_matrix(last, local);
    first = share_matrix(first, local);
    before = share_matrix(before, local);
    if local % LANES_OF_PLACE == 0u {
        put_matrix(GRADIENTS, n, gradient, vec3f());
        put_matrix(CHANGES, n, last, vec3f());
        put_matrix(STRESSES, n, first, vec3f());
        if recovered_count(RECOVERED_IS_VISCOUS) != 0u {
            put_matrix(STARTS, n, before, vec3f());
        }
    }
}

// The range of the changes to the end of a solve.
fn changes_of(k: u32) -> u32 {
    return select(CHANGES, STRESSES, k == 1u);
}

// Changes [J] of what a tetrahedron stores by itself; its volumes go to its places.
fn recovered_ends(block: u32, lane: u32, is_trial: bool) -> vec2f {
    let vertices = vertices_of(block, lane);
    var x: array<vec3f, 4>;
    for (var i = 0u; i < 4u; i++) {
        x[i] = reference(vertices[i]);
    }
    let shape = shape_of(block, lane);
    let at = recovered_block(block);
    let rest = frame_of(at, lane, shape);
    let linear = deformation_gradient(x, shape);
    let f = recovered_gradient(linear, matrices_of(GRADIENTS, at, lane), rest);
    let material = tissue_of(tets[block].material[lane]);
    let mu = material.lame_mu;
    let lambda = recovered_bulk_shares(material.lame_lambda, mu).local;
    var since: array<f32, 6>;
    if material.viscosity > 0.0 {
        let start = deformation_gradient(before_steps(vertices), shape);
        let before = recovered_gradient(start, matrices_of(STARTS, at, lane), rest);
        since = tissue_change_since(f, green_strain_strain(before));
    }
    let volume = tets[block].rest_volume[lane];
    var volumes = vec3f(neo_hookean_volume_change(f), 0.0, 0.0);
    var changes = vec2f();
    for (var k = 0u; k < 2u; k++) {
        var way: array<vec3f, 4>;
        for (var i = 0u; i < 4u; i++) {
            way[i] = place_at(vertices[i], k, is_trial) - x[i];
        }
        let linear_change = deformation_gradient(way, shape);
        let d = recovered_gradient(linear_change, matrices_of(changes_of(k), at, lane), rest);
        var density = neo_hookean_energy_change(f, d, lambda, mu);
        if material.viscosity > 0.0 {
            let rate = material.viscosity * frame.inverse_dt;
            density += tissue_viscous_energy_change(f, d, since, rate, lambda, mu);
        }
        density = recovered_share(RECOVERED_TET_SHARE) * density
            + recovered_floor_energy_change(linear, linear_change, mu);
        volumes[k + 1u] = recovered_volume_variation(f, d);
        changes[k] = volume * density;
    }
    put_volumes(at, lane, volumes * (0.25 * volume));
    return changes;
}

@compute @workgroup_size(256)
fn average_ends(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let group = workgroup.x + workgroup.y * groups.x;
    if group >= job.count {
        return;
    }
    let means = find_means(group, local);
    var sums: Sums;
    if means.n != NOWHERE_PLACE {
        for (var k = 0u; k < 2u; k++) {
            let terms = place_changes(means, changes_of(k), k, frame.dt);
            sums[END_STORED + k] = (terms.x + terms.y) + terms.z;
            sums[END_SIZE + k] = (abs(terms.x) + abs(terms.y)) + abs(terms.z);
        }
    }
    reduce(sums, 1u, 0u, local);
    if local == 0u {
        recovery[recovered_count(RECOVERED_SUMS_AT) + group] = vec4f(totals[0], totals[1], totals[2], totals[3]);
    }
}

// What averages have left.
fn add_averages(part: u32, local: u32, into: ptr<function, Sums>) {
    let row = recovered_table(RECOVERED_PART_AVERAGES) + part;
    let end = table[row + 1u];
    for (var group = table[row] + local; group < end; group += THREADS) {
        let sums = recovery[recovered_count(RECOVERED_SUMS_AT) + group];
        (*into)[END_STORED] += sums.x;
        (*into)[END_STORED + 1u] += sums.y;
        (*into)[END_SIZE] += sums.z;
        (*into)[END_SIZE + 1u] += sums.w;
    }
}
