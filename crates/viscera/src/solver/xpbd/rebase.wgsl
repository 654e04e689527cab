// Vertices between sweeps (xpbd/rebase.rs).

// Stabilised rebase: r = M (x - xt) - J^T l, mh = m + share of the bounds, x -= theta r/mh, w = 1/mh per
// copy. Where tools are near Mh of contact is added to mh (contacts/gather.wgsl), and never to w.
@compute @workgroup_size(64)
fn rebase(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let v = thread_of(id, groups, 64u);
    if v >= job.count || external_forces[v].w == 0.0 {
        return;
    }
    let load = gather(v);
    let place = points[v].xyz;
    let inertia = predicted[v];
    let contact = contact_on(v);
    let residual = (place - inertia.xyz) * inertia.w - load.xyz - contact.force;
    let row = part_row(part_with(PART_VERTICES_END, v));
    let bound = inertia.w + load.w * number(row + PART_BOUND_SHARE);
    let inverse = 1.0 / bound;
    let factor = number(row + PART_REBASE_FACTOR);
    var x = place - residual * (factor * inverse);
    if contact.is_near {
        x = place - resolved(contact, bound, residual) * factor;
    }
    points[v] = vec4f(x, inverse * previous[v].w);
}

// x = xt + M^-1 J^T l.
@compute @workgroup_size(64)
fn recompute_positions(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let v = thread_of(id, groups, 64u);
    if v >= job.count || external_forces[v].w == 0.0 {
        return;
    }
    let impulse = gather(v).xyz + contact_on(v).force;
    points[v] = vec4f(predicted[v].xyz + impulse * external_forces[v].w, points[v].w);
}

@compute @workgroup_size(64)
fn split_copies(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let v = thread_of(id, groups, 64u);
    if v >= job.count {
        return;
    }
    let point = points[v];
    let end = offsets[v + 1u] & ~WHOLE;
    for (var copy = offsets[v] & ~WHOLE; copy < end; copy++) {
        copies[copy] = point;
    }
}

// Averages the changes of the copies: a vertex that no constraint moved stays where it is to the bit. Where a part has
// no vertex of several copies they are its vertices, as if there were none.
@compute @workgroup_size(64)
fn join_copies(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let v = thread_of(id, groups, 64u);
    if v >= job.count {
        return;
    }
    let point = points[v];
    let first = offsets[v] & ~WHOLE;
    let end = offsets[v + 1u] & ~WHOLE;
    if (offsets[v] & WHOLE) != 0u {
        points[v] = vec4f(copies[first].xyz, point.w);
        return;
    }
    var sum = vec3f();
    for (var copy = first; copy < end; copy++) {
        sum += copies[copy].xyz - point.xyz;
    }
    points[v] = vec4f(point.xyz + sum * (1.0 / f32(end - first)), point.w);
}
