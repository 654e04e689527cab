// Stages of the explicit method (solver/explicit/mod.rs): two dispatches for a small step h, five with recovered-gradient tetrahedra.
//
//   x += h/2 v once,   v += h (g + M^-1 f(x + tau v)),   x += h v, in the last one h/2
//
// Tethers of a vertex stand in `targets`: w is their stiffness [N/m]. Pinned vertices have their places there. Each connected part
// takes as many small steps as it needs, and then waits for the others.

fn small_row(part: u32) -> u32 {
    return table[SMALL_STEPS_AT] + SMALL_WORDS * part;
}

fn part_of_block(block: u32) -> u32 {
    return table[table[BLOCK_PARTS_AT] + block];
}

fn put_vertex_data(range: u32, v: u32, value: vec4f) {
    vertex_data[range * table[STRIDE_AT] + v] = value;
}

// Where a pinned vertex is after a share of the step.
fn led(v: u32, share: f32) -> vec3f {
    let start = vertex_data_of(PREVIOUS, v).xyz;
    return start + (vertex_data_of(TARGETS, v).xyz - start) * share;
}

// Remembers positions and, in `predicted` until the end of the step, velocities. Moves to the middle of the first small step.
@compute @workgroup_size(64)
fn begin_explicit(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let v = thread_of(id, groups, 64u);
    if v == 0u {
        control.small_steps_done = 0u;
    }
    if v >= job.count {
        return;
    }
    put_vertex_data(PREVIOUS, v, vec4f(points[v].xyz, vertex_data_of(PREVIOUS, v).w));
    put_vertex_data(PREDICTED, v, vec4f(vertex_data_of(VELOCITIES, v).xyz, vertex_data_of(PREDICTED, v).w));
    let small = small_row(part_with(PART_VERTICES_END, v));
    if vertex_data_of(EXTERNAL_FORCES, v).w == 0.0 {
        let way = vertex_data_of(TARGETS, v).xyz - points[v].xyz;
        points[v] = vec4f(led(v, 0.5 / f32(table[small + SMALL_COUNT])), 0.0);
        put_vertex_data(VELOCITIES, v, vec4f(way * frame.inverse_dt, 0.0));
        return;
    }
    let time = 0.5 * number(small + SMALL_DT) + number(small + SMALL_AHEAD);
    points[v] = vec4f(points[v].xyz + vertex_data_of(VELOCITIES, v).xyz * time, 0.0);
}

// Green strain one small step before the middle of the first, at x_n - h/2 v_n.
@compute @workgroup_size(64)
fn begin_strain(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let thread = thread_of(id, groups, 64u);
    if thread >= job.count {
        return;
    }
    let block = thread / LANES;
    let lane = thread % LANES;
    if tets[block].material[lane] == FILLING {
        return;
    }
    let vertices = vertices_of(block, lane);
    let small_dt = number(small_row(part_of_block(block)) + SMALL_DT);
    var x: array<vec3f, 4>;
    for (var i = 0u; i < 4u; i++) {
        x[i] = vertex_data_of(PREVIOUS, vertices[i]).xyz - vertex_data_of(PREDICTED, vertices[i]).xyz * (0.5 * small_dt);
    }
    let shape = shape_of(block, lane);
    let f = tet_gradient(block, lane, deformation_gradient(x, shape), shape);
    store_start_strain(block, lane, green_strain_strain(f));
}

fn store_start_strain(block: u32, lane: u32, strain: array<f32, 6>) {
    for (var p = 0u; p < 6u; p++) {
        start_strain[6u * block + p][lane] = strain[p];
    }
}

// h^2 times the forces of tetrahedra and then of other elements, into a place for each corner, and from `job.first` on of samples.
// Counts the small step, which the other kernels only read.
@compute @workgroup_size(64)
fn load_forces(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let thread = thread_of(id, groups, 64u);
    if thread == 0u {
        control.small_step = control.small_steps_done + 1u;
    }
    if thread < job.tet_count && is_recovered(thread / LANES) {
        load_recovered(thread / LANES, thread % LANES);
    } else if thread < job.tet_count {
        load_tet(thread / LANES, thread % LANES);
    } else if thread < job.first {
        load_element(element_row(thread - job.tet_count));
    } else if thread < job.count {
        load_sample(thread - job.first);
    }
}

fn load_tet(block: u32, lane: u32) {
    let kind = tets[block].material[lane];
    let small = small_row(part_of_block(block));
    if kind == FILLING || control.small_steps_done >= table[small + SMALL_COUNT] {
        return;
    }
    let small_dt = number(small + SMALL_DT);
    let material = tissue_of(kind);
    let lambda = material.lame_lambda;
    let mu = material.lame_mu;
    let vertices = vertices_of(block, lane);
    var x: array<vec3f, 4>;
    for (var i = 0u; i < 4u; i++) {
        x[i] = points[vertices[i]].xyz;
    }
    let shape = shape_of(block, lane);
    let f = deformation_gradient(x, shape);
    var piola = law_piola(law_of(block), f, lambda, mu);
    if material.viscosity > 0.0 {
        let change = tissue_change_since(f, start_strain_of(block, lane));
        let rate = material.viscosity * number(small + SMALL_INVERSE_DT);
        piola += tissue_viscous_piola(f, change, rate, lambda, mu);
        store_start_strain(block, lane, green_strain_strain(f));
    }
    let volume = tets[block].rest_volume[lane] * (small_dt * small_dt);
    let forces = internal_forces(piola, shape, volume);
    let slots = table[CORNERS_AT] + 32u * block + lane;
    for (var i = 0u; i < 4u; i++) {
        loads[table[slots + 8u * i]] = vec4f(forces[i], 0.0);
    }
}

fn load_element(row: u32) {
    let kind = table[row + ELEMENT_KIND];
    let vertices = four_of(row + ELEMENT_VERTICES);
    let h = number(small_row(table[row + ELEMENT_PART]) + SMALL_DT);
    var x: array<vec3f, 4>;
    var start: array<vec3f, 4>;
    for (var i = 0u; i < 4u; i++) {
        x[i] = points[vertices[i]].xyz;
        start[i] = x[i] - vertex_data_of(VELOCITIES, vertices[i]).xyz * h;
    }
    var forces = element_forces(kind, moment_of(row, start, h), x);
    for (var i = 0u; i < element_corners(kind); i++) {
        loads[table[row + ELEMENT_SLOTS + i]] = vec4f(forces[i] * (h * h), 0.0);
    }
}

@compute @workgroup_size(64)
fn advance_explicit(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let v = thread_of(id, groups, 64u);
    if v >= job.count {
        return;
    }
    if v == 0u {
        control.small_steps_done = control.small_step;
    }
    let small = small_row(part_with(PART_VERTICES_END, v));
    let count = table[small + SMALL_COUNT];
    if control.small_step > count {
        return;
    }
    let on_vertex = vertex_data_of(EXTERNAL_FORCES, v);
    let hold = vertex_data_of(TARGETS, v);
    let is_last = control.small_step == count;
    if on_vertex.w == 0.0 {
        let share = (f32(control.small_step) + 0.5) / f32(count);
        points[v] = vec4f(select(led(v, share), hold.xyz, is_last), 0.0);
        return;
    }
    let h = number(small + SMALL_DT);
    let x = points[v].xyz;
    let pull = on_vertex.xyz + (hold.xyz - x) * hold.w;
    let impulse = (gather(v).xyz + recovered_force(v)) * number(small + SMALL_INVERSE_DT) + pull * h;
    let before = vertex_data_of(VELOCITIES, v).xyz;
    let velocity = pushed_velocity(v, h, on_vertex.w, before, impulse * on_vertex.w + frame.gravity * h);
    let ahead = number(small + SMALL_AHEAD);
    let place = x - before * ahead;
    put_vertex_data(VELOCITIES, v, vec4f(velocity, 0.0));
    points[v] = vec4f(place + velocity * select(h + ahead, 0.5 * h, is_last), 0.0);
}

// xt = x - dt^2 a + dt^2 (g + M^-1 f_ext), a the acceleration in the middle of the last small step; of a pinned vertex
// xt = x - dt (v - v_n) + dt^2 (g + M^-1 f_ext).
@compute @workgroup_size(64)
fn end_explicit(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let v = thread_of(id, groups, 64u);
    if v >= job.count {
        return;
    }
    let mass = vertex_data_of(PREDICTED, v).w;
    let x = points[v].xyz;
    let on_vertex = vertex_data_of(EXTERNAL_FORCES, v);
    var back: vec3f;
    if on_vertex.w == 0.0 {
        let change = vertex_data_of(VELOCITIES, v).xyz - vertex_data_of(PREDICTED, v).xyz;
        let load = frame.gravity + on_vertex.xyz * (1.0 / mass);
        back = change * frame.dt - load * frame.squared_dt;
    } else {
        let small = small_row(part_with(PART_VERTICES_END, v));
        let time = 0.5 * number(small + SMALL_DT) - number(small + SMALL_AHEAD);
        let middle = x - vertex_data_of(VELOCITIES, v).xyz * time;
        let pull = (vertex_data_of(TARGETS, v).xyz - middle) * vertex_data_of(TARGETS, v).w * frame.squared_dt;
        let steps = frame.dt * number(small + SMALL_INVERSE_DT);
        let force = gather(v).xyz + recovered_force(v) + contact_load(v);
        back = (force * (steps * steps) + pull) * on_vertex.w;
    }
    put_vertex_data(PREDICTED, v, vec4f(x - back, mass));
}
