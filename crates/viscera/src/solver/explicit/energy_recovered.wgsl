// What recovered-gradient tetrahedra store (energy.wgsl), from the gradients and their changes that `recover_places` has left.

// Change [J] of a tetrahedron by itself; its volumes go to its places.
fn stored_in_recovered(block: u32, lane: u32, x: array<vec3f, 4>, way: array<vec3f, 4>) -> f32 {
    let shape = shape_of(block, lane);
    let at = recovered_block(block);
    let rest = frame_of(at, lane, shape);
    let linear = deformation_gradient(x, shape);
    let linear_change = deformation_gradient(way, shape);
    let f = recovered_gradient(linear, matrices_of(GRADIENTS, at, lane), rest);
    let d = recovered_gradient(linear_change, matrices_of(CHANGES, at, lane), rest);
    let material = tissue_of(tets[block].material[lane]);
    let mu = material.lame_mu;
    let lambda = recovered_bulk_shares(material.lame_lambda, mu).local;
    let volume = tets[block].rest_volume[lane];
    let volumes = vec3f(neo_hookean_volume_change(f), recovered_volume_variation(f, d), 0.0);
    put_volumes(at, lane, volumes * (0.25 * volume));
    let density = recovered_share(RECOVERED_TET_SHARE) * neo_hookean_energy_change(f, d, lambda, mu);
    return volume * (density + recovered_floor_energy_change(linear, linear_change, mu));
}

// Of places and clusters.
@compute @workgroup_size(256)
fn average_energies(
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
        let place = means.place;
        let f = matrix_of(GRADIENTS, means.n);
        let d = matrix_of(CHANGES, means.n);
        let density = neo_hookean_energy_change(f, d, place.local, place.lame_mu);
        let change = place.volume * (recovered_share(RECOVERED_PLACE_SHARE) * density
            + bulk_change(place.domain, means.of_place.x, means.of_place.y)
            + bulk_change(place.cluster, means.of_cluster.x, means.of_cluster.y));
        sums[ENERGY_STORED] = change;
        sums[ENERGY_SIZE] = abs(change);
    }
    reduce(sums, 1u, 0u, local);
    if local == 0u {
        recovery[recovered_count(RECOVERED_SUMS_AT) + group] = vec4f(totals[0], totals[1], 0.0, 0.0);
    }
}

fn add_averaged_energies(part: u32, local: u32, into: ptr<function, Sums>) {
    let row = recovered_table(RECOVERED_PART_AVERAGES) + part;
    let end = table[row + 1u];
    for (var group = table[row] + local; group < end; group += THREADS) {
        let sums = recovery[recovered_count(RECOVERED_SUMS_AT) + group];
        (*into)[ENERGY_STORED] += sums.x;
        (*into)[ENERGY_SIZE] += sums.y;
    }
}
