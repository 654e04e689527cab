// Forces of recovered-gradient tetrahedra (step/recovered/mod.rs) in a small step: three dispatches beside those of mod.wgsl.
//
//   recover_places      G_n in the middle of the small step
//   load_forces         Fh_t: S_t but for the pressure, and volumes
//   average_pressures   p_n = k_n (Jh_n - 1) + k_c (Jh_c - 1)
//   gather_stresses     N_n; vertices add up theirs where they advance
//
// Viscosity acts against the strain of the small step before: tetrahedra keep theirs, places their gradient.

fn recovered_acts(part: u32) -> bool {
    return control.small_steps_done < table[small_row(part) + SMALL_COUNT];
}

fn recovered_dt(part: u32) -> f32 {
    return number(small_row(part) + SMALL_DT);
}

// Modes beside small steps, which look where vertices are: for viscosity, where they were one small step before the first; for
// the energy of the step, where they are at its start, pins moved, and how that changes to its end.
const BEFORE_MOTION: u32 = 1u;
const OF_ENERGY: u32 = 2u;

fn place_in_motion(v: u32, h: f32) -> vec3f {
    if job.mode == OF_ENERGY {
        return start_of(v);
    }
    if job.mode != BEFORE_MOTION {
        return points[v].xyz;
    }
    return vertex_data_of(PREVIOUS, v).xyz - vertex_data_of(PREDICTED, v).xyz * (0.5 * h);
}

@compute @workgroup_size(64)
fn recover_places(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let group = workgroup.x + workgroup.y * groups.x;
    if group >= job.count {
        return;
    }
    let part = table[recovered_table(RECOVERED_GROUP_PARTS) + group];
    if agree(!recovered_acts(part) && job.mode != OF_ENERGY, local) {
        return;
    }
    let h = recovered_dt(part);
    let n = 8u * group + local / LANES_OF_PLACE;
    let own_vertex = place_of_number(n).vertex;
    let own = place_in_motion(own_vertex, h);
    let own_way = points[own_vertex].xyz - own;
    var gradient = mat3x3f();
    var change = mat3x3f();
    let offsets = recovered_table(RECOVERED_RING_OFFSETS) + n;
    let end = table[offsets + 1u];
    for (var i = table[offsets] + local % LANES_OF_PLACE; i < end; i += LANES_OF_PLACE) {
        let row = recovered_table(RECOVERED_RINGS) + 4u * i;
        let b = vec3f(number(row + 1u), number(row + 2u), number(row + 3u));
        let x = place_in_motion(table[row], h);
        gradient += recovered_outer(x - own, b);
        if job.mode == OF_ENERGY {
            change += recovered_outer((points[table[row]].xyz - x) - own_way, b);
        }
    }
    gradient = share_matrix(gradient, local);
    if job.mode == OF_ENERGY {
        change = share_matrix(change, local);
        if local % LANES_OF_PLACE == 0u {
            put_matrix(CHANGES, n, change, vec3f());
        }
    }
    if local % LANES_OF_PLACE == 0u {
        if job.mode == 0u && recovered_count(RECOVERED_IS_VISCOUS) != 0u {
            put_matrix(STARTS, n, matrix_of(GRADIENTS, n), vec3f());
        }
        put_matrix(GRADIENTS, n, gradient, vec3f());
    }
}

// `Fh` of a recovered-gradient tetrahedron whose linear gradient is `f`; of others that.
fn tet_gradient(block: u32, lane: u32, f: mat3x3f, shape: mat3x3f) -> mat3x3f {
    if !is_recovered(block) {
        return f;
    }
    let at = recovered_block(block);
    return recovered_gradient(f, matrices_of(GRADIENTS, at, lane), frame_of(at, lane, shape));
}

fn load_recovered(block: u32, lane: u32) {
    let kind = tets[block].material[lane];
    let part = part_of_block(block);
    if kind == FILLING || !recovered_acts(part) {
        return;
    }
    let h = recovered_dt(part);
    let vertices = vertices_of(block, lane);
    var x: array<vec3f, 4>;
    for (var i = 0u; i < 4u; i++) {
        x[i] = points[vertices[i]].xyz;
    }
    let shape = shape_of(block, lane);
    let linear = deformation_gradient(x, shape);
    let f = tet_gradient(block, lane, linear, shape);
    let material = tissue_of(kind);
    let mu = material.lame_mu;
    let lambda = recovered_bulk_shares(material.lame_lambda, mu).local;
    var piola = neo_hookean_piola(f, lambda, mu);
    if material.viscosity > 0.0 {
        let change = tissue_change_since(f, start_strain_of(block, lane));
        piola += tissue_viscous_piola(f, change, material.viscosity / h, lambda, mu);
        store_start_strain(block, lane, green_strain_strain(f));
    }
    let volume = tets[block].rest_volume[lane];
    let scale = volume * (h * h);
    let share = recovered_share(RECOVERED_TET_SHARE);
    let at = recovered_block(block);
    put_tet(at, lane, TetState(piola * (share * scale), cofactor(f) * scale, floor_factor(linear, mu) * scale));
    put_volumes(at, lane, vec3f(0.25 * volume * neo_hookean_volume_change(f), 0.0, 0.0));
}

@compute @workgroup_size(256)
fn average_pressures(
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
    if means.n != NOWHERE_PLACE {
        put_pressure(means);
    }
}
