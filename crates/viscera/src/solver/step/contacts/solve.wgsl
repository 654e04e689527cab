// Contact in a solve: samples are members of pieces beside the elements, and vertices gather what presses on their samples.

// The poses that a solve of the quasi-Newton method looks at.
fn pose_of_solve() -> u32 {
    return select(AT_FIRST, AT_END, own_share == 1.0 || (job.mode & SECOND_RECORD) != 0u);
}

// The change [J] of a sample's energy on the way to the trial; leaves its force there, times he^2.
fn evaluate_sample(sample: u32) -> f32 {
    let at = contact_at(sample);
    let mark = loads[at].w;
    let used = slots_used(mark);
    if used == 0u {
        return 0.0;
    }
    let row = sample_row(sample);
    var place = vec3f();
    var way = vec3f();
    for (var i = 0u; i < 4u; i++) {
        let v = table[row + i];
        let weight = number(row + SAMPLE_WEIGHTS + i);
        let before = vertex_data_of(QN_BASE, v).xyz;
        place += before * weight;
        way += (points[v].xyz - before) * weight;
    }
    let pose = pose_of_solve();
    var force = vec3f();
    var change = 0.0;
    for (var slot = 0u; slot < used; slot++) {
        let touching = touching_of(at, slot, row);
        let before = meet(touching, pose, place);
        let after = meet(touching, pose, place + way);
        change += contact_change(touching, pose, before, after, way);
        force += felt_of(touching, after).force;
    }
    let h = solve_dt();
    loads[at] = vec4f(force * (h * h), mark);
    return change;
}

// On a vertex, times he^2.
fn contact_force(v: u32) -> vec3f {
    var sum = meeting_force(v);
    if table[SAMPLE_OFFSETS_AT] == 0u {
        return sum;
    }
    let offsets = table[SAMPLE_OFFSETS_AT] + v;
    let end = table[offsets + 1u];
    for (var i = table[offsets]; i < end; i++) {
        let entry = table[SAMPLE_ENTRIES_AT] + 2u * i;
        sum += loads[contact_at(table[entry])].xyz * number(entry + 1u);
    }
    return sum;
}
