// Searches for the place of a connected part whose step, or accelerated iterate and plain sweep after it, raises the
// potential (solver/step/guard.rs). Each dispatch first picks among what the one before it tried, then tries more:
//
//   JudgeStep    judge the step; all its shares at once, forces at x_s
//   TryLengths   pick a share, or all lengths of a descent at once
//   TakeLength   pick a length, forces where it leads
//   JudgePlain   judge the plain sweep, forces at x_s
//
// Parts whose step passes pay a look at their record. `job.mode` says what is picked and what is tried.
//
// Nothing that one workgroup reads another one writes: directions are gathered by elements and written by
// vertices, places move from one range of the vertex data to another, and a record's words are written in other
// dispatches than they are read in.

struct Next {
    goes_on: u32,
    // The range of the vertex data that lines start from, and the length that was picked.
    origin: u32,
    length: f32,
    // Whether the iterate becomes the best.
    is_better: u32,
}

var<workgroup> next: Next;

@compute @workgroup_size(256)
fn search(
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
    // Through `agree`, because what `control` holds is not uniform to the compiler, and barriers follow.
    if agree(is_over(part), local) {
        return;
    }
    // First what was tried, then what is tried. A loop and not two calls: compilers copy `reduce` and the energies to
    // every place they are called from, and a long kernel takes long to build.
    for (var tries = false; ; tries = true) {
        var sums: Sums;
        if tries {
            try_piece(row, next, local, &sums);
        } else {
            add_tried(part, local, &sums);
        }
        reduce(sums, LINE_SUMS / 8u, maxima_of(tries), local);
        if tries {
            break;
        }
        if local == 0u {
            next = decide(part, piece == table[part_row(part) + PART_VERTEX_PIECES]);
        }
        if workgroupUniformLoad(&next).goes_on == 0u {
            return;
        }
    }
    // The first threads write one sum each; a piece has places of its own, so nothing waits for another workgroup.
    let tries_shares = (job.mode & TRIES_SHARES) != 0u;
    if local < LINE_SUMS && (job.mode & (TRIES_SHARES | TRIES_LENGTHS)) != 0u {
        let at = select(lengths_at(piece), shares_at(piece), tries_shares);
        partial_sums[at + local] = totals[local];
    }
}

fn add_tried(part: u32, local: u32, into: ptr<function, Sums>) {
    if (job.mode & (JUDGES_STEP | JUDGES_PLAIN)) != 0u {
        add_pieces(part, local, into);
    } else if (job.mode & PICKS_SHARE) != 0u {
        add_shares(part, local, into);
    } else if (job.mode & PICKS_LENGTH) != 0u {
        add_lengths(part, local, into);
    }
}

fn try_piece(row: u32, now: Next, local: u32, into: ptr<function, Sums>) {
    let are_vertices = table[row + PIECE_ARE_VERTICES] != 0u;
    for (var i = table[row + PIECE_FIRST] + local; i < table[row + PIECE_END]; i += THREADS) {
        if are_vertices {
            try_vertex(i, now, into);
        } else {
            try_element(member(i), now, into);
        }
    }
}

fn maxima_of(tries: bool) -> u32 {
    if !tries && (job.mode & (JUDGES_STEP | JUDGES_PLAIN)) != 0u {
        return 1u << SUM_REACH;
    }
    let of_shares = select(PICKS_SHARE, TRIES_SHARES, tries);
    return select(0u, REACHES, (job.mode & of_shares) != 0u);
}

// Whether there is nothing to search for.
fn is_over(part: u32) -> bool {
    if (job.mode & (JUDGES_STEP | JUDGES_PLAIN)) != 0u {
        return false;
    }
    // Each word that is read here was written by an earlier dispatch of the search: `was_rejected` when the step was
    // judged, `descends` when no share did, or when the plain sweep failed for the second time.
    if (job.mode & PICKS_SHARE) != 0u {
        return control.parts[part].guard.was_rejected == 0u;
    }
    return control.parts[part].guard.descends == 0u;
}

// From the sums of what was tried; one workgroup of a part keeps the decision.
fn decide(part: u32, keeps: bool) -> Next {
    var then = Next(1u, select(TRIAL, AHEAD, (job.mode & TRIES_LENGTHS) != 0u), 0.0, 0u);
    if (job.mode & JUDGES_STEP) != 0u {
        then = judge_step(part, keeps);
    } else if (job.mode & JUDGES_PLAIN) != 0u {
        then = judge_plain(part, keeps);
    } else if (job.mode & PICKS_SHARE) != 0u {
        let share = pick_share(control.parts[part].guard.limit);
        // With a share the part is done: `TRIAL` and `DIRECTION` still hold `x_s` and the whole step, and
        // `evaluate` moves the vertices along them at the end.
        then.goes_on = select(0u, 1u, share == 0.0);
        if keeps {
            control.parts[part].guard.share = share;
            control.parts[part].guard.descends = then.goes_on;
        }
    } else if (job.mode & PICKS_LENGTH) != 0u {
        then.length = pick_length().length;
    }
    return then;
}

fn judge_step(part: u32, keeps: bool) -> Next {
    var choice = Choice(0.0, START);
    // Where the starts were chosen before the sweeps, START holds the best place by now and `control` its limit.
    // Otherwise they are chosen here; the limit is written below, and read by later dispatches only.
    if (job.mode & CHOOSES) != 0u {
        choice = choose();
    } else {
        choice.limit = control.parts[part].guard.limit;
    }
    let is_rejected = select(1u, 0u, passes(potential_of_totals(), choice.limit));
    if keeps {
        if (job.mode & CHOOSES) != 0u {
            control.parts[part].guard.limit = choice.limit;
        }
        control.parts[part].guard.was_rejected = is_rejected;
        // Counted once for all parts: only the first to exchange the number of this step finds another one.
        if is_rejected != 0u && atomicExchange(&control.rejected_step, control.step) != control.step {
            atomicAdd(&control.rejected, 1u);
        }
        control.parts[part].guard.descends = 0u;
    }
    return Next(is_rejected, choice.range, 0.0, 0u);
}

// Judges the plain sweep that replaced a rejected iterate; does nothing where the accelerated iterate has passed.
fn judge_plain(part: u32, keeps: bool) -> Next {
    // Reads the words that `take` wrote when it judged the accelerated iterate, and writes the other pair: a late
    // workgroup must still find what the first one found.
    var best = control.parts[part].guard.mixture_best;
    var failures = 0u;
    var is_better = false;
    if control.parts[part].guard.is_good == 0u {
        let tested = potential_of_totals();
        is_better = improves(tested.value, best);
        best = select(best, tested.value, is_better);
        failures = select(control.parts[part].guard.mixture_failures + 1u, 0u, passes(tested, best));
    }
    let descends = failures >= TOLERATED;
    if keeps {
        control.parts[part].guard.best_value = best;
        control.parts[part].guard.failures = failures;
        control.parts[part].guard.descends = select(0u, 1u, descends);
    }
    // `is_better` means that the sweep passed, so there is either a new best place to remember or a descent to
    // prepare, never both.
    return Next(select(0u, 1u, descends || is_better), START, 0.0, select(0u, 1u, is_better));
}

// Where a line from `origin` leads, and its slope there.
struct Direction {
    along: vec3f,
    slope: f32,
}

fn direction_of(v: u32, origin: vec3f) -> Direction {
    if (job.mode & TRIES_SHARES) != 0u {
        return Direction(points[v].xyz - origin, 0.0);
    }
    // A later dispatch than the one that tried lengths: the loads may be those of another place by now, so the
    // direction comes from where that dispatch has left it.
    if (job.mode & TRIES_LENGTHS) == 0u {
        return Direction(vertex_data_of(DIRECTION, v).xyz, 0.0);
    }
    // A pinned vertex, whose inverse mass is zero: it is where the pin is.
    if vertex_data_of(EXTERNAL_FORCES, v).w == 0.0 {
        return Direction();
    }
    let load = gather(v);
    let contact = contact_on(v);
    let predicted = vertex_data_of(PREDICTED, v);
    // As `descent` on the CPU. Every element at the vertex does this again, because within a dispatch it cannot
    // read what the workgroup of the vertex finds; the loads are those of the dispatch before.
    let gradient = (origin - predicted.xyz) * predicted.w - load.xyz - contact.force;
    let descent = gradient * (-1.0 / (predicted.w + load.w + contact.bound));
    return Direction(descent, dot(gradient, descent));
}

// How many places are tried, and which is the `k`-th: all shares, or zero and all lengths, each from the one
// before it.
fn line_count() -> u32 {
    if (job.mode & TRIES_SHARES) != 0u {
        return SHARE_COUNT;
    }
    return select(0u, SHORTENINGS + 1u, (job.mode & TRIES_LENGTHS) != 0u);
}

fn line_at(k: u32, before: f32) -> f32 {
    if (job.mode & TRIES_SHARES) != 0u {
        var shares = SHARES;
        return shares[k];
    }
    if k < 2u {
        return f32(k);
    }
    return before * SHORTEN;
}

fn try_element(element: u32, now: Next, into: ptr<function, Sums>) {
    let corners = corners_of_member(element);
    var origin: array<vec3f, 4>;
    var direction: array<vec3f, 4>;
    for (var i = 0u; i < 4u; i++) {
        origin[i] = vertex_data_of(now.origin, corners[i]).xyz;
        direction[i] = direction_of(corners[i], origin[i]).along;
    }
    let with_force = (job.mode & TRIES_SHARES) != 0u;
    var length = 0.0;
    for (var k = 0u; k < line_count(); k++) {
        length = line_at(k, length);
        // Forces are needed for the noise of the share that is judged. Armijo's condition has no noise.
        let found = answer(element, on_line(origin, direction, length), with_force);
        let difference = found.x - reference_of(element);
        if with_force {
            (*into)[4u * k] += difference;
            (*into)[4u * k + 1u] += abs(difference);
            (*into)[4u * k + 2u] += found.y;
        } else {
            (*into)[k] += difference;
        }
    }
    // For the descent that may follow, at its start: `x_s` after the step was judged (the length is zero there), or
    // where the last length led. Loaded before it is known whether a share does: that would be a dispatch more.
    if (job.mode & LOADS_FORCES) != 0u && now.is_better == 0u {
        load_forces(element, on_line(origin, direction, now.length));
    }
}

fn on_line(origin: array<vec3f, 4>, direction: array<vec3f, 4>, length: f32) -> array<vec3f, 4> {
    return array<vec3f, 4>(
        along(origin[0], direction[0], length),
        along(origin[1], direction[1], length),
        along(origin[2], direction[2], length),
        along(origin[3], direction[3], length),
    );
}

fn try_vertex(v: u32, now: Next, into: ptr<function, Sums>) {
    let origin = vertex_data_of(now.origin, v).xyz;
    let line_of_vertex = direction_of(v, origin);
    let direction = line_of_vertex.along;
    let is_free = vertex_data_of(EXTERNAL_FORCES, v).w != 0.0;
    let with_force = (job.mode & TRIES_SHARES) != 0u;
    var length = 0.0;
    for (var k = 0u; k < line_count(); k++) {
        length = line_at(k, length);
        let x = along(origin, direction, length);
        // Pinned vertices have no inertia in `Phi`; their distance still counts for the noise of positions.
        let term = select(0.0, inertia(v, x), is_free);
        if with_force {
            (*into)[4u * k] += term;
            (*into)[4u * k + 1u] += abs(term);
            (*into)[4u * k + 3u] = max((*into)[4u * k + 3u], dot(x, x));
        } else {
            (*into)[k] += term;
        }
    }
    let stride = table[STRIDE_AT];
    if (job.mode & TRIES_LENGTHS) != 0u {
        (*into)[SLOPE] += line_of_vertex.slope;
        // Where the line starts, for the dispatch that picks a length: its elements read TRIAL, and AHEAD is then free
        // for where that length leads.
        vertex_data[TRIAL * stride + v] = vec4f(origin, 0.0);
    }
    // Written for later dispatches. Elements of this one find the direction by themselves.
    if (job.mode & (TRIES_SHARES | TRIES_LENGTHS)) != 0u {
        vertex_data[DIRECTION * stride + v] = vec4f(direction, 0.0);
    }
    if now.is_better != 0u {
        vertex_data[START * stride + v] = vec4f(points[v].xyz, 0.0);
    } else if (job.mode & LOADS_FORCES) != 0u {
        // Where the next line starts. It is tried from AHEAD, which nothing here reads: the prediction that it held has
        // been judged by now. Where that is the best start it stays.
        let x = vec4f(along(origin, direction, now.length), 0.0);
        if now.origin != AHEAD {
            vertex_data[AHEAD * stride + v] = x;
        }
        // Shares are counted from TRIAL.
        if (job.mode & PICKS_LENGTH) == 0u {
            vertex_data[TRIAL * stride + v] = x;
        }
    }
}

// Squared step times force, and the bound of its curvature, into the places that vertices gather.
fn load_forces(element: u32, x: array<vec3f, 4>) {
    let squared = frame.squared_dt;
    let tet_lanes = table[TET_LANES_AT];
    if is_sample(element) {
        load_sample(element, x);
        return;
    }
    if element < tet_lanes {
        let block = element / LANES;
        let lane = element % LANES;
        let tet = deformed(block, lane, x);
        let volume = tet.volume * squared;
        var forces = internal_forces(stress_of(tet), tet.shape, volume);
        var g = shape_gradients(tet.shape);
        for (var corner = 0u; corner < 4u; corner++) {
            let slot = table[table[CORNERS_AT] + LANES * (4u * block + corner) + lane];
            let rate = tet.viscosity_rate;
            let curvature =
                tissue_curvature(tet.law, tet.f, g[corner], tet.lame_lambda, tet.lame_mu, rate);
            loads[slot] = vec4f(forces[corner], volume * curvature);
        }
        return;
    }
    let row = element_row(element - tet_lanes);
    let kind = table[row + ELEMENT_KIND];
    let moment = moment_of(row, before_steps(four_of(row + ELEMENT_VERTICES)), frame.dt);
    var forces = element_forces(kind, moment, x);
    let curvature = element_curvature(kind, moment);
    for (var i = 0u; i < element_corners(kind); i++) {
        loads[table[row + ELEMENT_SLOTS + i]] = vec4f(forces[i] * squared, squared * curvature);
    }
}
