// The starts of solves (time.rs): SDIRK2, or implicit Euler.
//
//   he = c dt, d = dt - he;   every solve:  xt = xs + he vs + he^2 (g + M^-1 f)
//   first:   xs = x_n, vs = v_n                                             start  xs + he vs
//   second:  xs = x_n + d v_1, vs = v_n + d a_1, a_1 = (v_1 - v_n)/he       start  x_1 + d v_1 + d^2/2 a_1
//
// For vertices, piece by piece from `job.first` on. `job.parameter`: c, one of implicit Euler; `job.set_first`: whether the
// step begins with the second record.

// Inertial prediction [m] of a free vertex from where it starts.
fn inertial(v: u32, start: vec3f, velocity: vec3f) -> vec3f {
    let he = solve_dt();
    let squared = he * he;
    let on_vertex = vertex_data_of(EXTERNAL_FORCES, v);
    let hold = vertex_data_of(TARGETS, v);
    let mass = vertex_data_of(PREDICTED, v).w;
    let place = start + velocity * he;
    let pull = (hold.xyz - (place + frame.gravity * squared)) * hold.w;
    return place + (frame.gravity + (on_vertex.xyz + pull) * (1.0 / mass)) * squared;
}

// Whether nothing holds a body of a part, but for tools and other tissue, and whether one of these presses on the part where the
// step begins.
fn has_free_body(part: u32) -> bool {
    return table[table[FALLS_AT] + FALL_WORDS * part + FALL_IS_FREE] != 0u;
}

fn is_pressed(part: u32) -> bool {
    return atomicLoad(&control.parts[part].pressed_step) == control.step;
}

// How what nothing holds is accelerated; zero of what is held.
fn fall_of(part: u32) -> vec3f {
    let at = table[FALLS_AT] + FALL_WORDS * part;
    if table[at + FALL_IS_FREE] != WHOLLY_FREE {
        return vec3f();
    }
    let acceleration = at + FALL_ACCELERATION;
    return vec3f(number(acceleration), number(acceleration + 1u), number(acceleration + 2u));
}

// Adds what samples that tools may touch give to a vertex: `C` of one with weight b.
fn add_samples(v: u32, blocks: ptr<function, Blocks>) {
    if table[SAMPLE_OFFSETS_AT] == 0u {
        return;
    }
    let offsets = table[SAMPLE_OFFSETS_AT] + v;
    let end = table[offsets + 1u];
    for (var i = table[offsets]; i < end; i++) {
        let entry = table[SAMPLE_ENTRIES_AT] + 2u * i;
        let at = table[CONTACT_AT] + SAMPLE_VECTORS * table[entry];
        if loads[at].w == 0.0 {
            continue;
        }
        (*blocks).may_touch = true;
        let weight = abs(number(entry + 1u));
        let a = loads[at + 1u];
        let b = loads[at + 2u];
        let block = array<f32, 6>(a.x, a.y, a.z, a.w, b.x, b.y);
        for (var k = 0u; k < 6u; k++) {
            (*blocks).own[k] += weight * weight * block[k];
            (*blocks).whole[k] += weight * block[k];
        }
    }
}

// Whether a vertex may touch a tool, or other tissue. Leaves the blocks [N/m] that contact has there:
//   sum_s b^2 C, of the vertex alone, and sum_s b C, of the tissue around it where that moves alike
fn begin_contact(v: u32) -> bool {
    if table[SAMPLE_OFFSETS_AT] == 0u && !has_skin() {
        return false;
    }
    var blocks: Blocks;
    add_samples(v, &blocks);
    add_meetings(v, &blocks);
    let into = levels[LEVELS_CONTACT] + CONTACT_NUMBERS * v;
    for (var k = 0u; k < 6u; k++) {
        multilevel[into + k] = blocks.own[k];
        multilevel[into + 6u + k] = blocks.whole[k];
    }
    return blocks.may_touch;
}

fn begin_vertex(v: u32, fall: vec3f) {
    let stride = table[STRIDE_AT];
    let he = solve_dt();
    let x = points[v].xyz;
    let velocity = vertex_data_of(VELOCITIES, v).xyz;
    let mass = vertex_data_of(PREDICTED, v).w;
    let xt = inertial(v, x, velocity);
    var base = x;
    var first = x + velocity * he + fall * (he * he);
    if vertex_data_of(EXTERNAL_FORCES, v).w == 0.0 {
        base = x + (vertex_data_of(TARGETS, v).xyz - x) * own_share;
        first = base;
    }
    vertex_data[PREVIOUS * stride + v] = vec4f(x, vertex_data_of(PREVIOUS, v).w);
    vertex_data[QN_START_VELOCITIES * stride + v] = vec4f(velocity, 0.0);
    // Measures ask whether its solve was one for all of the step.
    vertex_data[QN_STAGE_START * stride + v] = vec4f(x, select(0.0, 1.0, own_share == 1.0));
    vertex_data[PREDICTED * stride + v] = vec4f(xt, mass);
    vertex_data[QN_BASE * stride + v] = vec4f(base, select(0.0, 1.0, begin_contact(v)));
    // There is none where the first solve is the last.
    vertex_data[QN_FIRST * stride + v] = vec4f(x, 0.0);
    points[v] = vec4f(first, 0.0);
}

fn begin_record(part: u32, slides: bool, local: u32) {
    let kept = select(0u, 1u, job.set_first != 0u);
    for (var i = local; i < MOST_PRODUCTS; i += THREADS) {
        progress[part].sy[0][i] = progress[part].sy[kept][i];
        progress[part].yw[0][i] = progress[part].yw[kept][i];
    }
    if local != 0u {
        return;
    }
    let row = levels[LEVELS_PART_ROWS] + LEVEL_PART_WORDS * part;
    let before = progress[part].states[kept];
    // Pairs of steps of another length, or of a step that was rejected, say nothing of this one's.
    let keeps = frame.rescale != 0.0 && progress[part].was_rejected == 0u;
    var state = SolveState();
    state.phase = STARTING;
    // What slides goes on through the second solve's passes.
    progress[part].slides = select(0u, 1u, slides);
    multilevel[levels[LEVELS_STEPS] + part] = own_share;
    state.passes_left = levels[row + 3u] * select(1u, 2u, slides);
    state.calm = select(0u, progress[part].calm, keeps);
    state.count = select(0u, min(before.count, levels[row + 4u]), keeps);
    state.newest = before.newest;
    state.scale = before.scale;
    progress[part].states[0] = state;
}

@compute @workgroup_size(256)
fn begin_solves(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let place = workgroup.x + workgroup.y * groups.x;
    if place >= job.count {
        return;
    }
    let row = piece_row(job.first + place);
    let part = table[row + PIECE_PART];
    let slides = job.parameter != 1.0 && has_free_body(part) && is_pressed(part);
    own_share = select(job.parameter, 1.0, slides);
    if job.first + place == table[part_row(part) + PART_VERTEX_PIECES] {
        begin_record(part, slides, local);
    }
    let fall = select(fall_of(part), vec3f(), is_pressed(part));
    for (var v = table[row + PIECE_FIRST] + local; v < table[row + PIECE_END]; v += THREADS) {
        begin_vertex(v, fall);
    }
}

var<workgroup> is_trusted: u32;

fn continue_vertex(v: u32, fall: vec3f, takes_trial: bool) {
    let stride = table[STRIDE_AT];
    let he = solve_dt();
    let d = frame.dt - he;
    let x1 = select(vertex_data_of(QN_BASE, v).xyz, points[v].xyz, takes_trial);
    let x = vertex_data_of(PREVIOUS, v).xyz;
    let before = vertex_data_of(QN_START_VELOCITIES, v).xyz;
    let after = (x1 - x) * (1.0 / he);
    let change = (after - before) * (1.0 / he);
    let start = x + after * d;
    let xt = inertial(v, start, before + change * d);
    var base = x1;
    // Nothing inside changes the way of what nothing holds: there its middle goes all the way.
    var first = x1 + after * d + change * (0.5 * d * d) + fall * (d * (he - 0.5 * d));
    if vertex_data_of(EXTERNAL_FORCES, v).w == 0.0 {
        base = vertex_data_of(TARGETS, v).xyz;
        first = base;
    }
    vertex_data[QN_FIRST * stride + v] = vec4f(x1, 0.0);
    vertex_data[QN_STAGE_START * stride + v] = vec4f(start, 0.0);
    vertex_data[PREDICTED * stride + v] = vec4f(xt, vertex_data_of(PREDICTED, v).w);
    vertex_data[QN_BASE * stride + v] = vec4f(base, vertex_data_of(QN_BASE, v).w);
    points[v] = vec4f(first, 0.0);
}

// From the end of the first solve to the start of the second.
@compute @workgroup_size(256)
fn begin_second(
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
    own_share = share_of(part);
    let slides = progress[part].slides != 0u;
    var sums: Sums;
    add_ends(part, local, &sums);
    reduce(sums, 1u, TRIAL_MAXIMA, local);
    if local == 0u {
        is_trusted = select(0u, 1u, goes_on(part, 0u));
    }
    let takes_trial = workgroupUniformLoad(&is_trusted) != 0u;
    if piece == table[part_row(part) + PART_VERTEX_PIECES] {
        for (var i = local; i < MOST_PRODUCTS; i += THREADS) {
            progress[part].sy[1][i] = progress[part].sy[0][i];
            progress[part].yw[1][i] = progress[part].yw[0][i];
        }
        if local == 0u {
            var state = progress[part].states[0];
            if !slides {
                state.calm = select(0u, 1u, state.rejections == 0u);
                state.phase = STARTING;
                state.passes_left = levels[levels[LEVELS_PART_ROWS] + LEVEL_PART_WORDS * part + 3u];
                state.accepted = 0u;
                state.ahead = 0u;
                state.failures = 0u;
                state.rejections = 0u;
            }
            progress[part].states[1] = state;
        }
    }
    if slides {
        return;
    }
    let fall = select(fall_of(part), vec3f(), is_pressed(part));
    for (var v = table[row + PIECE_FIRST] + local; v < table[row + PIECE_END]; v += THREADS) {
        continue_vertex(v, fall, takes_trial);
    }
}
