// Forces and energies of recovered-gradient tetrahedra (step/recovered/mod.rs) at a trial, in five dispatches that only
// gather; a workgroup for eight places, a piece of elements, 64 clusters, eight places, and a piece of vertices.
//
//   recover_gradients    G_n(y), and D_n of the way back from y to x
//   evaluate_elements    Fh_t and D_t of tetrahedra: S_t but for the pressure, volumes and energies
//   average_volumes      Jh_n, Jh_c: pressures p_n, and energies of places
//   gather_stresses      N_n = sum_t S_t : dFh_t/dG_n + V_n alpha P(G_n), and what n's tetrahedra do to its own vertex
//   evaluate_vertices    f_i = of its places - sum_n N_n b_ni
//
// Energies are counted from y, where stresses are, back to x. The last two stages are in step/recovered/forces.wgsl.

fn recovered_acts(part: u32) -> bool {
    own_share = share_of(part);
    return acts(part, newer_record());
}

fn recovered_dt(part: u32) -> f32 {
    return solve_dt();
}

// Where the tissue is viscous, of the start of the solve as well.
@compute @workgroup_size(64)
fn recover_gradients(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let group = workgroup.x + workgroup.y * groups.x;
    if group >= job.count {
        return;
    }
    let part = table[recovered_table(RECOVERED_GROUP_PARTS) + group];
    if agree(!recovered_acts(part), local) {
        return;
    }
    let n = 8u * group + local / LANES_OF_PLACE;
    let own = place_of_number(n).vertex;
    let y0 = points[own].xyz;
    let way0 = vertex_data_of(QN_BASE, own).xyz - y0;
    let start0 = vertex_data_of(QN_STAGE_START, own).xyz;
    let is_viscous = recovered_count(RECOVERED_IS_VISCOUS) != 0u;
    var gradient = mat3x3f();
    var change = mat3x3f();
    var start = mat3x3f();
    let offsets = recovered_table(RECOVERED_RING_OFFSETS) + n;
    let end = table[offsets + 1u];
    for (var i = table[offsets] + local % LANES_OF_PLACE; i < end; i += LANES_OF_PLACE) {
        let row = recovered_table(RECOVERED_RINGS) + 4u * i;
        let v = table[row];
        let b = vec3f(number(row + 1u), number(row + 2u), number(row + 3u));
        let y = points[v].xyz;
        gradient += recovered_outer(y - y0, b);
        change += recovered_outer((vertex_data_of(QN_BASE, v).xyz - y) - way0, b);
        if is_viscous {
            start += recovered_outer(vertex_data_of(QN_STAGE_START, v).xyz - start0, b);
        }
    }
    gradient = share_matrix(gradient, local);
    change = share_matrix(change, local);
    if is_viscous {
        start = share_matrix(start, local);
    }
    if local % LANES_OF_PLACE == 0u {
        put_matrix(GRADIENTS, n, gradient, vec3f());
        put_matrix(CHANGES, n, change, vec3f());
        if is_viscous {
            put_matrix(STARTS, n, start, vec3f());
        }
    }
}

// Of a tetrahedron whose places are known: the change [J] of its own energy from x to y.
fn evaluate_recovered(block: u32, lane: u32) -> f32 {
    let vertices = vertices_of(block, lane);
    var y: array<vec3f, 4>;
    var way: array<vec3f, 4>;
    for (var i = 0u; i < 4u; i++) {
        y[i] = points[vertices[i]].xyz;
        way[i] = vertex_data_of(QN_BASE, vertices[i]).xyz - y[i];
    }
    let shape = shape_of(block, lane);
    let at = recovered_block(block);
    let rest = frame_of(at, lane, shape);
    let linear = deformation_gradient(y, shape);
    let linear_change = deformation_gradient(way, shape);
    let f = recovered_gradient(linear, matrices_of(GRADIENTS, at, lane), rest);
    let d = recovered_gradient(linear_change, matrices_of(CHANGES, at, lane), rest);
    let material = tissue_of(tets[block].material[lane]);
    let mu = material.lame_mu;
    let local = recovered_bulk_shares(material.lame_lambda, mu).local;
    let share = recovered_share(RECOVERED_TET_SHARE);
    var piola = neo_hookean_piola(f, local, mu);
    var density = neo_hookean_energy_change(f, d, local, mu);
    if material.viscosity > 0.0 {
        var start: array<vec3f, 4>;
        for (var i = 0u; i < 4u; i++) {
            start[i] = vertex_data_of(QN_STAGE_START, vertices[i]).xyz;
        }
        let before = recovered_gradient(deformation_gradient(start, shape), matrices_of(STARTS, at, lane), rest);
        let since = tissue_change_since(f, green_strain_strain(before));
        let rate = material.viscosity / solve_dt();
        piola += tissue_viscous_piola(f, since, rate, local, mu);
        density += tissue_viscous_energy_change(f, d, since, rate, local, mu);
    }
    let volume = tets[block].rest_volume[lane];
    let scale = volume * solve_dt() * solve_dt();
    put_tet(at, lane, TetState(piola * (share * scale), cofactor(f) * scale, floor_factor(linear, mu) * scale));
    let volumes = vec3f(neo_hookean_volume_change(f), recovered_volume_variation(f, d), 0.0);
    put_volumes(at, lane, volumes * (0.25 * volume));
    return -volume * (share * density + recovered_floor_energy_change(linear, linear_change, mu));
}

// Pressures, and sums [J s^2] for the first vertices of each part.
@compute @workgroup_size(256)
fn average_volumes(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let group = workgroup.x + workgroup.y * groups.x;
    if group >= job.count {
        return;
    }
    let part = table[recovered_table(RECOVERED_AVERAGE_PARTS) + group];
    if agree(!recovered_acts(part), local) {
        return;
    }
    let means = find_means(group, local);
    var sums: Sums;
    if means.n != NOWHERE_PLACE {
        put_pressure(means);
        let terms = place_changes(means, CHANGES, 0u, solve_dt()) * (solve_dt() * solve_dt());
        sums[SUM_CHANGE] = -((terms.x + terms.y) + terms.z);
        sums[SUM_SIZE] = (abs(terms.x) + abs(terms.y)) + abs(terms.z);
    }
    reduce(sums, 1u, 0u, local);
    if local == 0u {
        recovery[recovered_count(RECOVERED_SUMS_AT) + group] = vec4f(totals[SUM_CHANGE], totals[SUM_SIZE], 0.0, 0.0);
    }
}

// What averages have left, for one workgroup of a part.
fn add_averages(part: u32, local: u32, into: ptr<function, Sums>) {
    let row = recovered_table(RECOVERED_PART_AVERAGES) + part;
    let end = table[row + 1u];
    for (var group = table[row] + local; group < end; group += THREADS) {
        let sums = recovery[recovered_count(RECOVERED_SUMS_AT) + group];
        (*into)[SUM_CHANGE] += sums.x;
        (*into)[SUM_SIZE] += sums.y;
    }
}
