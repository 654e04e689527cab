// Gradient of the incremental potential at a trial, and its change on the way there (evaluate.rs), in two dispatches.
//
//   grad_i Phi(y) = m_i (y_i - xt_i) - he^2 f_i(y),   slope at y: grad Phi(y) . (y - x)
//   Phi(y) - Phi(x) = sum_i m_i (y - x) . (x - xt + (y - x)/2) + he^2 sum_t V_t (W(F + D) - W(F)),   F + D at y
//
// `job.parameter`: he over the step; see `share_of`.

// Of a tetrahedron: the change [J], and forces times he^2 into the places of its corners.
fn evaluate_tet(block: u32, lane: u32) -> f32 {
    let vertices = vertices_of(block, lane);
    var x: array<vec3f, 4>;
    var y: array<vec3f, 4>;
    for (var i = 0u; i < 4u; i++) {
        x[i] = vertex_data_of(QN_BASE, vertices[i]).xyz;
        y[i] = points[vertices[i]].xyz;
    }
    let way = array<vec3f, 4>(y[0] - x[0], y[1] - x[1], y[2] - x[2], y[3] - x[3]);
    let shape = shape_of(block, lane);
    let f = deformation_gradient(y, shape);
    let before = deformation_gradient(x, shape);
    let d = deformation_gradient(way, shape);
    let material = tissue_of(tets[block].material[lane]);
    let lambda = material.lame_lambda;
    let mu = material.lame_mu;
    let law = law_of(block);
    var piola = law_piola(law, f, lambda, mu);
    var density = law_energy_change(law, before, d, lambda, mu);
    if material.viscosity > 0.0 {
        var start: array<vec3f, 4>;
        for (var i = 0u; i < 4u; i++) {
            start[i] = vertex_data_of(QN_STAGE_START, vertices[i]).xyz;
        }
        let strain = green_strain_strain(deformation_gradient(start, shape));
        let rate = material.viscosity / solve_dt();
        let since = tissue_change_since(before, strain);
        density += tissue_viscous_energy_change(before, d, since, rate, lambda, mu);
        piola += tissue_viscous_piola(f, tissue_change_since(f, strain), rate, lambda, mu);
    }
    let volume = tets[block].rest_volume[lane];
    let squared = solve_dt() * solve_dt();
    let forces = internal_forces(piola, shape, volume * squared);
    let slots = table[CORNERS_AT] + 32u * block + lane;
    for (var i = 0u; i < 4u; i++) {
        loads[table[slots + 8u * i]] = vec4f(forces[i], 0.0);
    }
    return volume * density;
}

// The same of another element.
fn evaluate_element(row: u32) -> f32 {
    let kind = table[row + ELEMENT_KIND];
    let vertices = four_of(row + ELEMENT_VERTICES);
    var x: array<vec3f, 4>;
    var y: array<vec3f, 4>;
    var start: array<vec3f, 4>;
    for (var i = 0u; i < 4u; i++) {
        x[i] = vertex_data_of(QN_BASE, vertices[i]).xyz;
        y[i] = points[vertices[i]].xyz;
        start[i] = vertex_data_of(QN_STAGE_START, vertices[i]).xyz;
    }
    let h = solve_dt();
    let moment = moment_of(row, start, h);
    var forces = element_forces(kind, moment, y);
    for (var i = 0u; i < element_corners(kind); i++) {
        loads[table[row + ELEMENT_SLOTS + i]] = vec4f(forces[i] * (h * h), 0.0);
    }
    let way = array<vec3f, 4>(y[0] - x[0], y[1] - x[1], y[2] - x[2], y[3] - x[3]);
    return element_energy_change(kind, moment, x, way);
}

@compute @workgroup_size(256)
fn evaluate_elements(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let piece = workgroup.x + workgroup.y * groups.x;
    if piece >= job.count {
        return;
    }
    let row = piece_row(piece);
    let part = table[row + PIECE_PART];
    own_share = share_of(part);
    if agree(!acts(part, newer_record()), local) {
        return;
    }
    let tet_lanes = table[TET_LANES_AT];
    let squared = solve_dt() * solve_dt();
    var sums: Sums;
    for (var i = table[row + PIECE_FIRST] + local; i < table[row + PIECE_END]; i += THREADS) {
        let element = member(i);
        var change = 0.0;
        if element < tet_lanes && is_recovered(element / LANES) {
            change = squared * evaluate_recovered(element / LANES, element % LANES);
        } else if element < tet_lanes {
            change = squared * evaluate_tet(element / LANES, element % LANES);
        } else if element >= table[FIRST_MEETING_AT] {
            change = squared * evaluate_meeting(element - table[FIRST_MEETING_AT]);
        } else if element >= table[FIRST_SAMPLE_AT] {
            change = squared * evaluate_sample(element - table[FIRST_SAMPLE_AT]);
        } else {
            change = squared * evaluate_element(element_row(element - tet_lanes));
        }
        sums[SUM_CHANGE] += change;
        sums[SUM_SIZE] += abs(change);
    }
    reduce(sums, 1u, 0u, local);
    if local < 8u {
        partial_sums[SUMS * piece + local] = totals[local];
    }
}

// Vertices, piece by piece: `job.first` is the first of these.
@compute @workgroup_size(256)
fn evaluate_vertices(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let place = workgroup.x + workgroup.y * groups.x;
    if place >= job.count {
        return;
    }
    let piece = job.first + place;
    let row = piece_row(piece);
    let part = table[row + PIECE_PART];
    if piece == table[part_row(part) + PART_VERTEX_PIECES] {
        copy_record(part, local);
    }
    own_share = share_of(part);
    if agree(!acts(part, newer_record()), local) {
        return;
    }
    var sums: Sums;
    if piece == table[part_row(part) + PART_VERTEX_PIECES] {
        add_averages(part, local, &sums);
    }
    for (var v = table[row + PIECE_FIRST] + local; v < table[row + PIECE_END]; v += THREADS) {
        let y = points[v].xyz;
        sums[SUM_REACH] = max(sums[SUM_REACH], dot(y, y));
        var gradient = vec3f();
        if vertex_data_of(EXTERNAL_FORCES, v).w != 0.0 {
            let predicted = vertex_data_of(PREDICTED, v);
            let away = y - predicted.xyz;
            let base = vertex_data_of(QN_BASE, v);
            let way = y - base.xyz;
            gradient = away * predicted.w - (gather(v).xyz + recovered_force(v));
            if base.w != 0.0 {
                gradient -= contact_force(v);
            }
            let change = predicted.w * dot(way, away - way * 0.5);
            sums[SUM_CHANGE] += change;
            sums[SUM_SIZE] += abs(change);
            sums[SUM_SLOPE] += dot(gradient, way);
        }
        vertex_data[QN_TRIAL_GRADIENT * table[STRIDE_AT] + v] = vec4f(gradient, 0.0);
    }
    reduce(sums, 1u, TRIAL_MAXIMA, local);
    if local < SUM_LONGEST {
        partial_sums[SUMS * piece + local] = totals[local];
    }
    if local == 0u {
        partial_sums[SUMS * piece + SUM_LONGEST] = partial_sums[SUMS * piece + SUM_NEXT_LONGEST];
    }
}

fn copy_record(part: u32, local: u32) {
    for (var i = local; i < MOST_PRODUCTS; i += THREADS) {
        progress[part].sy[older_record()][i] = progress[part].sy[newer_record()][i];
        progress[part].yw[older_record()][i] = progress[part].yw[newer_record()][i];
    }
    if local == 0u {
        progress[part].states[older_record()] = progress[part].states[newer_record()];
    }
}
