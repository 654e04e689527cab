// The beginning of a step and the velocities at its end, vertex by vertex (step/predict.rs, step/mod.rs).

// Loads and holds of single vertices: takes over those that have changed since the last step. In mode 1 a thread
// for each part begins its accelerations and clears its mark of NaN multipliers.
@compute @workgroup_size(64)
fn apply_updates(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let thread = thread_of(id, groups, 64u);
    if job.mode == 1u && thread == 0u {
        control.step += 1u;
    }
    if job.mode == 1u && thread < frame.part_count {
        atomicStore(&control.parts[thread].is_broken, 0u);
        control.parts[thread].sweeps = 0u;
        control.parts[thread].next = 0u;
        control.parts[thread].differences = 0u;
        control.parts[thread].last_norm = 3e38;
        control.parts[thread].iteration = 0u;
        control.parts[thread].omega = 1.0;
        control.parts[thread].radius = job.parameter;
        control.parts[thread].last_change = 0.0;
    }
    if thread >= frame.update_count {
        return;
    }
    let update = updates[thread];
    let v = update.vertex;
    let inverse_mass = select(1.0 / update.inertia, 0.0, update.is_pinned != 0u);
    external_forces[v] = vec4f(update.force[0], update.force[1], update.force[2], inverse_mass);
    targets[v] = vec4f(update.place[0], update.place[1], update.place[2], update.stiffness);
    predicted[v].w = update.inertia;
}

// xt = x + dt v + dt^2 (g + M^-1 (f + k (a - y))), y without the last term: soft position constraints k to
// targets a are a part of the inertia (step/tethers.rs). x becomes the start of the iteration: x (mode 0), x + dt v
// (mode 1), xt (mode 2) or, in mode 3, x + dt v, where nothing holds the part, and no tool presses on it, with its mean
// acceleration. Pins move to their places; w = 1/m per copy. Where steps are guarded (mode bit 2) the possible starts of the
// step are kept.
@compute @workgroup_size(64)
fn predict(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let v = thread_of(id, groups, 64u);
    if v >= job.count {
        return;
    }
    let x = points[v].xyz;
    let mass = vertex_data_of(PREDICTED, v).w;
    let on_vertex = vertex_data_of(EXTERNAL_FORCES, v);
    let inertial = x + vertex_data_of(VELOCITIES, v).xyz * frame.dt;
    let hold = vertex_data_of(TARGETS, v);
    let pull = (hold.xyz - (inertial + frame.gravity * frame.squared_dt)) * hold.w;
    let load = (on_vertex.xyz + pull) * (1.0 / mass);
    let xt = inertial + (frame.gravity + load) * frame.squared_dt;
    let copy_count = vertex_data_of(PREVIOUS, v).w;
    let stride = table[STRIDE_AT];
    vertex_data[PREVIOUS * stride + v] = vec4f(x, copy_count);
    vertex_data[PREDICTED * stride + v] = vec4f(xt, mass);
    var start = x;
    if (job.mode & 3u) == 1u {
        start = inertial;
    } else if (job.mode & 3u) == 2u {
        start = xt;
    } else if (job.mode & 3u) == 3u {
        start = inertial;
        let part = part_with(PART_VERTICES_END, v);
        let fall = table[FALLS_AT] + FALL_WORDS * part;
        let lies = atomicLoad(&control.parts[part].pressed_step) == control.step;
        if table[fall + FALL_IS_FREE] != 0u && !lies {
            let at = fall + FALL_ACCELERATION;
            let acceleration = vec3f(number(at), number(at + 1u), number(at + 2u));
            start = inertial + acceleration * frame.squared_dt;
        }
    }
    let is_pinned = on_vertex.w == 0.0;
    start = select(start, hold.xyz, is_pinned);
    points[v] = vec4f(start, on_vertex.w * copy_count);
    if (job.mode & 4u) != 0u {
        vertex_data[REFERENCE * stride + v] = vec4f(select(x, start, is_pinned), 0.0);
        vertex_data[AHEAD * stride + v] = vec4f(select(xt, start, is_pinned), 0.0);
        vertex_data[START * stride + v] = vec4f(start, 0.0);
    }
}

// v = (x - x_n)/dt.
@compute @workgroup_size(64)
fn update_velocities(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let v = thread_of(id, groups, 64u);
    if v >= job.count {
        return;
    }
    velocities[v] = vec4f((points[v].xyz - previous[v].xyz) * frame.inverse_dt, 0.0);
}
