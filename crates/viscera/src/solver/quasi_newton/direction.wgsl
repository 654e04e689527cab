// Directions of descent (direction.rs), in two dispatches for vertices, piece by piece from `job.first` on.
//
//   take_trial          x = y, g; a pair s, y, M y of the step; z = M g; products of all pairs
//   choose_direction    d = -c (z - sum_i a_i w_i) - sum_i c_i s_i by the two loops on products;  y = x + a d
//
// Every workgroup judges the trial for itself. `job.set_first`: places of pairs.

// What all threads of a workgroup go by: browsers want to see that they do, as loops with barriers go over pairs.
struct Judged {
    verdict: Verdict,
    // With the one that the verdict leaves.
    pairs: Pairs,
}

var<workgroup> judged: Judged;

fn judged_by_all(part: u32, local: u32) -> Judged {
    var sums: Sums;
    add_trials(part, local, &sums);
    reduce(sums, 1u, TRIAL_MAXIMA, local);
    if local == 0u {
        let verdict = judge(part, older_record());
        judged = Judged(verdict, pairs_with(part, older_record(), verdict.leaves_pair));
    }
    return workgroupUniformLoad(&judged);
}

// `M g` of a vertex: its own block's, and what the lattice adds.
fn preconditioned(v: u32, gradient: vec3f) -> vec3f {
    var z = inverse_times(v, gradient);
    let offsets = levels[LEVELS_PARENT_OFFSETS] + v;
    let end = levels[offsets + 1u];
    for (var i = levels[offsets]; i < end; i++) {
        let at = levels[LEVELS_PARENTS] + 2u * i;
        z += vector_at(correction_at(levels[at])) * levels_number(at + 1u);
    }
    return z;
}

@compute @workgroup_size(256)
fn take_trial(
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
    if agree(!acts(part, older_record()), local) {
        return;
    }
    let agreed = judged_by_all(part, local);
    let now = agreed.verdict;
    let kept = agreed.pairs;
    let first = table[row + PIECE_FIRST];
    let end = table[row + PIECE_END];
    for (var v = first + local; v < end; v += THREADS) {
        if now.goes_back != 0u {
            points[v] = vec4f(vertex_data_of(QN_BASE, v).xyz, 0.0);
        }
        if now.accepted != 0u {
            take_vertex(v, kept, now.leaves_pair != 0u);
        }
    }
    let count = select(0u, kept.count, now.accepted != 0u);
    // At least once: `g . z` tells the slope of a direction without pairs.
    for (var pair = 0u; pair == 0u || pair < count; pair += PAIRS_AT_ONCE) {
        var sums: Sums;
        for (var v = first + local; v < end; v += THREADS) {
            add_products(v, kept, pair, count, now.leaves_pair != 0u, &sums);
        }
        reduce(sums, SUMS / 8u, 0u, local);
        if local < SUMS {
            partial_sums[products_at(piece) + SUMS * (pair / PAIRS_AT_ONCE) + local] = totals[local];
        }
    }
}

fn take_vertex(v: u32, kept: Pairs, leaves_pair: bool) {
    let stride = table[STRIDE_AT];
    let y = points[v].xyz;
    let gradient = vertex_data_of(QN_TRIAL_GRADIENT, v).xyz;
    let z = preconditioned(v, gradient);
    let base = vertex_data_of(QN_BASE, v);
    if leaves_pair {
        pairs[pair_at(kept.newest, STEP, v)] = vec4f(y - base.xyz, 0.0);
        pairs[pair_at(kept.newest, CHANGE, v)] =
            vec4f(gradient - vertex_data_of(QN_GRADIENT, v).xyz, 0.0);
        pairs[pair_at(kept.newest, IMAGE, v)] = vec4f(z - vertex_data_of(QN_Z, v).xyz, 0.0);
    }
    vertex_data[QN_BASE * stride + v] = vec4f(y, base.w);
    vertex_data[QN_GRADIENT * stride + v] = vec4f(gradient, 0.0);
    vertex_data[QN_Z * stride + v] = vec4f(z, 0.0);
}

fn add_products(v: u32, kept: Pairs, at_first: u32, count: u32, leaves_pair: bool, into: ptr<function, Sums>) {
    let gradient = vertex_data_of(QN_GRADIENT, v).xyz;
    if at_first == 0u {
        (*into)[PRODUCTS_OF_PAIR * PAIRS_AT_ONCE] += dot(gradient, vertex_data_of(QN_Z, v).xyz);
    }
    if count == 0u {
        return;
    }
    var change = vec3f();
    var image = vec3f();
    if leaves_pair {
        change = pairs[pair_at(kept.newest, CHANGE, v)].xyz;
        image = pairs[pair_at(kept.newest, IMAGE, v)].xyz;
    }
    for (var k = 0u; k < PAIRS_AT_ONCE && at_first + k < count; k++) {
        let slot = slot_of(kept, at_first + k);
        let step = pairs[pair_at(slot, STEP, v)].xyz;
        let own_image = pairs[pair_at(slot, IMAGE, v)].xyz;
        (*into)[PRODUCTS_OF_PAIR * k] += dot(step, gradient);
        (*into)[PRODUCTS_OF_PAIR * k + 1u] += dot(own_image, gradient);
        if leaves_pair {
            (*into)[PRODUCTS_OF_PAIR * k + 2u] += dot(step, change);
            (*into)[PRODUCTS_OF_PAIR * k + 3u] += dot(pairs[pair_at(slot, CHANGE, v)].xyz, image);
        }
    }
}

// The newest pairs' products with the gradient, and those with the newest pair; `g . z`.
var<workgroup> products: array<f32, 48>;
// Products of pairs, by order: the newest first.
var<workgroup> sy: array<f32, MOST_PRODUCTS>;
var<workgroup> yw: array<f32, MOST_PRODUCTS>;
var<workgroup> of_images: array<f32, MOST_HISTORY>;
var<workgroup> of_steps: array<f32, MOST_HISTORY>;

// What follows from a verdict.
struct Course {
    // Whether there is a new direction, and how many pairs it is made of; whether all are forgotten, or the newest is no pair.
    is_new: u32,
    count: u32,
    forgets: u32,
    drops: u32,
    failures: u32,
    scale: f32,
    length: f32,
    slope: f32,
}

var<workgroup> course: Course;

@compute @workgroup_size(256)
fn choose_direction(
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
    if agree(!acts(part, older_record()), local) {
        return;
    }
    let agreed = judged_by_all(part, local);
    let now = agreed.verdict;
    let kept = agreed.pairs;
    let count = select(0u, kept.count, now.accepted != 0u);
    for (var at_first = 0u; at_first == 0u || at_first < count; at_first += PAIRS_AT_ONCE) {
        add_up_products(part, at_first, local);
    }
    if now.accepted != 0u {
        load_products(part, kept, now.leaves_pair != 0u, local);
    }
    workgroupBarrier();
    if local == 0u {
        course = choose_course(part, now, kept);
    }
    let next = workgroupUniformLoad(&course);
    if piece == table[part_row(part) + PART_VERTEX_PIECES] {
        leave_record(part, now, kept, next, local);
    }
    var sums: Sums;
    let length = next.length;
    let stride = table[STRIDE_AT];
    for (var v = table[row + PIECE_FIRST] + local; v < table[row + PIECE_END]; v += THREADS) {
        var d = vertex_data_of(QN_DIRECTION, v).xyz;
        if next.is_new != 0u {
            d = direction_of(v, kept, next);
            vertex_data[QN_DIRECTION * stride + v] = vec4f(d, 0.0);
        }
        if now.phase == ITERATING {
            points[v] = vec4f(vertex_data_of(QN_BASE, v).xyz + d * length, 0.0);
        }
        let squared = dot(d, d);
        sums[0] = max(sums[0], select(3e38, squared, is_finite(squared)));
    }
    reduce(sums, 1u, 1u, local);
    if local == 0u {
        partial_sums[SUMS * piece + SUM_NEXT_LONGEST] = totals[0];
    }
}

// Into `products`.
fn add_up_products(part: u32, at_first: u32, local: u32) {
    var sums: Sums;
    let row = part_row(part);
    let end = table[row + PART_VERTEX_PIECES_END];
    for (var piece = table[row + PART_VERTEX_PIECES] + local; piece < end; piece += THREADS) {
        let at = products_at(piece) + SUMS * (at_first / PAIRS_AT_ONCE);
        for (var k = 0u; k < SUMS; k++) {
            sums[k] += partial_sums[at + k];
        }
    }
    reduce(sums, SUMS / 8u, 0u, local);
    if local < SUMS {
        products[SUMS * (at_first / PAIRS_AT_ONCE) + local] = totals[local];
    }
    workgroupBarrier();
}

// Of the pair at a place in the order, from the newest on.
fn product(k: u32, which: u32) -> f32 {
    return products[SUMS * (k / PAIRS_AT_ONCE) + PRODUCTS_OF_PAIR * (k % PAIRS_AT_ONCE) + which];
}

fn load_products(part: u32, kept: Pairs, leaves_pair: bool, local: u32) {
    for (var i = local; i < kept.count * kept.count; i += THREADS) {
        let a = i / kept.count;
        let b = i % kept.count;
        let at = slot_of(kept, a) * MOST_HISTORY + slot_of(kept, b);
        let is_new = leaves_pair && min(a, b) == 0u;
        sy[a * MOST_HISTORY + b] = progress[part].sy[older_record()][at];
        yw[a * MOST_HISTORY + b] = progress[part].yw[older_record()][at];
        if is_new {
            sy[a * MOST_HISTORY + b] = product(max(a, b), 2u);
            yw[a * MOST_HISTORY + b] = product(max(a, b), 3u);
        }
    }
}

fn choose_course(part: u32, now: Verdict, kept: Pairs) -> Course {
    let state = progress[part].states[older_record()];
    var next = Course(0u, kept.count, 0u, 0u, now.failures, state.scale, now.length, state.slope);
    var first = 0u;
    if now.leaves_pair != 0u {
        let found = sy[0] / yw[0];
        if sy[0] > 0.0 && yw[0] > 0.0 && is_finite(found) {
            next.scale = found;
        } else {
            // Negative curvature says nothing of the way to the minimum.
            next.drops = 1u;
            first = 1u;
        }
    }
    let used = kept.count - first;
    let forgets = now.failures >= MOST_FAILURES && used > 0u;
    if now.phase != ITERATING || (now.accepted == 0u && !forgets) {
        return next;
    }
    next.is_new = 1u;
    if forgets {
        next.failures = 0u;
    }
    next.slope = 0.0;
    if used > 0u && !forgets {
        next.slope = recur(next.scale, first, kept.count);
        next.length = 1.0;
    }
    if !(next.slope < 0.0 && is_finite(next.slope)) {
        // Without pairs: to where the next slope tells how far the minimum is.
        next.forgets = 1u;
        next.count = 0u;
        next.scale = 1.0;
        next.slope = -products[PRODUCTS_OF_PAIR * PAIRS_AT_ONCE];
        next.length = FIRST_LENGTH;
    }
    return next;
}

// The share of the preconditioned gradient that is gone where no pair says more: levels add up.
const FIRST_LENGTH: f32 = 0.5;

// The two loops, of pairs from a place in the order on; returns the slope of the direction.
fn recur(scale: f32, first: u32, count: u32) -> f32 {
    for (var i = first; i < count; i++) {
        var newer_ones = 0.0;
        for (var j = first; j < i; j++) {
            newer_ones += of_images[j] * sy[i * MOST_HISTORY + j];
        }
        of_images[i] = (product(i, 0u) - newer_ones) / sy[i * MOST_HISTORY + i];
    }
    var slope = -scale * products[PRODUCTS_OF_PAIR * PAIRS_AT_ONCE];
    for (var k = count; k > first; k--) {
        let i = k - 1u;
        var image = product(i, 1u);
        for (var j = first; j < count; j++) {
            image -= of_images[j] * yw[i * MOST_HISTORY + j];
        }
        var along = scale * image;
        for (var j = i + 1u; j < count; j++) {
            along += of_steps[j] * sy[j * MOST_HISTORY + i];
        }
        of_steps[i] = of_images[i] - along / sy[i * MOST_HISTORY + i];
        slope += scale * of_images[i] * product(i, 1u) - of_steps[i] * product(i, 0u);
    }
    return slope;
}

fn direction_of(v: u32, kept: Pairs, next: Course) -> vec3f {
    if vertex_data_of(EXTERNAL_FORCES, v).w == 0.0 {
        return vec3f();
    }
    var d = vertex_data_of(QN_Z, v).xyz * -next.scale;
    for (var k = next.drops; k < next.count; k++) {
        let slot = slot_of(kept, k);
        d += pairs[pair_at(slot, IMAGE, v)].xyz * (next.scale * of_images[k]);
        d -= pairs[pair_at(slot, STEP, v)].xyz * of_steps[k];
    }
    return d;
}

// What the next pass reads.
fn leave_record(part: u32, now: Verdict, kept: Pairs, next: Course, local: u32) {
    for (var i = local; i < MOST_PRODUCTS; i += THREADS) {
        progress[part].sy[newer_record()][i] = progress[part].sy[older_record()][i];
        progress[part].yw[newer_record()][i] = progress[part].yw[older_record()][i];
    }
    storageBarrier();
    if now.leaves_pair != 0u && local < kept.count {
        let newest = kept.newest;
        let other = slot_of(kept, local);
        progress[part].sy[newer_record()][other * MOST_HISTORY + newest] = sy[local * MOST_HISTORY];
        progress[part].yw[newer_record()][other * MOST_HISTORY + newest] = yw[local * MOST_HISTORY];
        progress[part].yw[newer_record()][newest * MOST_HISTORY + other] = yw[local * MOST_HISTORY];
    }
    if local != 0u {
        return;
    }
    let state = progress[part].states[older_record()];
    var count = kept.count;
    var newest = kept.newest;
    if next.drops != 0u {
        // The place of the oldest may have been overwritten.
        count = kept.count - 1u;
        newest = state.newest;
    }
    if next.forgets != 0u {
        count = 0u;
    }
    let left = state.passes_left - 1u;
    let ahead = select(0u, 1u, now.phase == ITERATING);
    progress[part].states[newer_record()] = SolveState(
        now.phase,
        left,
        now.accepted,
        ahead,
        next.failures,
        now.rejections,
        state.calm,
        count,
        newest,
        next.scale,
        next.length,
        next.slope,
    );
}
