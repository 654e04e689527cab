// Carries out what the guard of mixtures has decided, number by number of the long vector. `job.first`:
// where multipliers begin, `job.count` its length, `job.set_first` the window; mode 0 after the choice of
// the start, which the best place so far starts from, mode 1 after a verdict.
@compute @workgroup_size(256)
fn take(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = thread_of(id, groups, 256u);
    if i >= job.count {
        return;
    }
    let v = i / 4u;
    let axis = i % 4u;
    let is_position = i < job.first && v < table[VERTEX_COUNT] && axis < 3u;
    let best = START * table[STRIDE] + v;
    if job.mode == 0u {
        if is_position && axis == 0u && control.start != START {
            ground[best] = ground_of(control.start, v);
        }
        return;
    }
    // One thread for all of a vertex: parts of a vector are no places of their own.
    if control.is_better != 0u && is_position && axis == 0u {
        if control.taken == DESCENT {
            ground[best] = ground_of(TRIAL, v);
        } else {
            ground[best] = vec4f(unknowns[i], unknowns[i + 1u], unknowns[i + 2u], 0.0);
        }
    }
    if control.taken == PLAIN && (is_position || i >= job.first) {
        unknowns[i] = mapped[job.set_first * job.count + i];
    }
    if control.taken == DESCENT && is_position {
        unknowns[i] = ground_of(TRIAL, v)[axis];
    }
}
