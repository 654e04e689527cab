// Carries out what the guard of accelerated iterates decides, part by part, on the long vector: copies the lowest
// start to the best place; replaces an accelerated iterate that does not pass by the plain sweep, or both by a
// descent. `job.first`: where multipliers begin, `job.count` the length, `job.set_first` the
// window.

struct Taken {
    // The range that the best start lies in; whether the iterate becomes the best, or gives way.
    range: u32,
    is_better: u32,
    gives_way: u32,
    length: f32,
}

var<workgroup> taken: Taken;

@compute @workgroup_size(256)
fn take(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let span = span_of(workgroup, groups);
    if span.groups == 0u {
        return;
    }
    let is_descent = (job.mode & TAKES_DESCENT) != 0u;
    // Most iterates need no descent; the part's workgroups then end here, all of them, before any barrier.
    if agree(is_descent && control.parts[span.part].guard.descends == 0u, local) {
        return;
    }
    var sums: Sums;
    if is_descent {
        add_lengths(span.part, local, &sums);
    } else {
        add_pieces(span.part, local, &sums);
    }
    reduce(sums, LINE_SUMS / 8u, select(1u << SUM_REACH, 0u, is_descent), local);
    if local == 0u {
        taken = decide(span.part, span.group == 0u);
    }
    let now = workgroupUniformLoad(&taken);
    var run = Run();
    for (var j = span.group * THREADS + local; j < span.length; j += span.groups * THREADS) {
        let i = number_at(&run, span.part, j);
        if i != NOWHERE {
            take_number(i, now);
        }
    }
}

fn decide(part: u32, keeps: bool) -> Taken {
    var now = Taken(START, 0u, 0u, 0.0);
    if (job.mode & CHOOSES) != 0u {
        // Before the first sweep. `x_s`, its potential and the count of failures are those of a new step.
        let choice = choose();
        now.range = choice.range;
        if keeps {
            control.parts[part].guard.limit = choice.limit;
            control.parts[part].guard.best_value = choice.limit;
            control.parts[part].guard.failures = 0u;
        }
    } else if (job.mode & JUDGES_MIXTURE) != 0u {
        // An iterate that lowers the potential becomes `x_s`; it passes if it is not above that by more than noise.
        // The decision goes into words of its own (`mixture_..`, `is_good`): the part's other workgroups still read
        // `best_value` and `failures`.
        let tested = potential_of_totals();
        let best = control.parts[part].guard.best_value;
        let is_better = improves(tested.value, best);
        let new_best = select(best, tested.value, is_better);
        let is_good = passes(tested, new_best);
        now.is_better = select(0u, 1u, is_better);
        now.gives_way = select(1u, 0u, is_good);
        if keeps {
            control.parts[part].guard.is_good = 1u - now.gives_way;
            control.parts[part].guard.mixture_best = new_best;
            control.parts[part].guard.mixture_failures = select(control.parts[part].guard.failures, 0u, is_good);
        }
    } else {
        // Length zero where no length brings enough: positions then go back to `x_s` itself, whose potential is
        // known already.
        let found = pick_length();
        now.length = found.length;
        if keeps {
            control.parts[part].guard.failures = 0u;
            if found.length > 0.0 {
                control.parts[part].guard.best_value = found.value;
            }
            // The older sweeps started elsewhere: Anderson's history is dropped. No residual is above the largest
            // number, so that the next one does not count as grown.
            control.parts[part].sweeps = 0u;
            control.parts[part].next = 0u;
            control.parts[part].differences = 0u;
            control.parts[part].last_norm = 3e38;
        }
    }
    return now;
}

// One thread for all three coordinates of a vertex: ranges of the vertex data are written a vector at a time.
fn take_number(i: u32, now: Taken) {
    let is_vertex = i < job.first;
    let v = i / 4u;
    if is_vertex && i % 4u != 0u {
        return;
    }
    let best = START * table[STRIDE_AT] + v;
    if (job.mode & TAKES_DESCENT) != 0u {
        if is_vertex {
            let x = along(vertex_data_of(TRIAL, v).xyz, vertex_data_of(DIRECTION, v).xyz, now.length);
            vertex_data[best] = vec4f(x, 0.0);
            for (var axis = 0u; axis < 3u; axis++) {
                unknowns[i + axis] = x[axis];
            }
        }
        return;
    }
    // The best start lies in START from here on, so that everything later has one place to begin at.
    if is_vertex && now.range != START {
        vertex_data[best] = vertex_data_of(now.range, v);
    }
    if is_vertex && now.is_better != 0u {
        vertex_data[best] = vec4f(unknowns[i], unknowns[i + 1u], unknowns[i + 2u], 0.0);
    }
    if now.gives_way != 0u {
        // The history keeps the plain sweep behind the differences, as vector number `window`. Multipliers give way
        // with the positions: either alone would break `M (x - xt) = J^T l`.
        let plain = job.set_first * job.count + i;
        for (var k = 0u; k < select(1u, 3u, is_vertex); k++) {
            unknowns[i + k] = mapped[plain + k];
        }
    }
}
