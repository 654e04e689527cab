// Pressure of tools at vertices (contact/pressure.rs), of what samples have kept of the last step:
//
//   p_a = sum_s b_a N_s/sum_s b_a A_s
//
// `measured` has one over the denominators.

@compute @workgroup_size(64)
fn measure_pressures(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let v = thread_of(id, groups, 64u);
    if v >= job.count {
        return;
    }
    var force = 0.0;
    let offsets = table[SAMPLE_OFFSETS_AT] + v;
    for (var i = table[offsets]; i < table[offsets + 1u]; i++) {
        let entry = table[SAMPLE_ENTRIES_AT] + 2u * i;
        let at = contact_at(table[entry]);
        let used = slots_used(loads[at].w);
        for (var slot = 0u; slot < used; slot++) {
            let first = slot_vectors(at, slot);
            if (u32(loads[first + 3u].w) & IS_KEPT) != 0u {
                force += loads[first + 2u].w * number(entry + 1u);
            }
        }
    }
    frame_points[v].w = force * measured[v];
}
