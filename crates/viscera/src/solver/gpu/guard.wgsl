// The step guard and the guard of mixtures (solver/guard.rs), in one workgroup: what decides is small.
// What follows a bad verdict is not, but rare: there the workgroup goes through the whole model, so that
// a step that is accepted pays one dispatch for all of it.

const SHARES: array<f32, 4> = array<f32, 4>(0.5, 0.2, 0.08, 0.032);
const DESCENTS: u32 = 3u;
const SUFFICIENT: f32 = 1e-4;
const SHORTEN: f32 = 0.4;
const SHORTENINGS: u32 = 12u;
const TOLERATED: u32 = 2u;

// Uses of `settle`: the best start is found, the step is judged.
const CHOOSES: u32 = 1u;
const JUDGES: u32 = 2u;

var<workgroup> start_range: u32;

// `Phi` [J s^2] above the start of the step, and what round-off can pretend of it.
struct Potential {
    value: f32,
    noise: f32,
}

// As on the CPU, but for the sums, which are in single precision here.
fn potential_of_totals() -> Potential {
    let rounding = sqrt(totals[SUM_REACH]) * sqrt(totals[SUM_FORCE]);
    let noise = 4.0 * EPSILON * frame.squared_dt * rounding + 8.0 * EPSILON * totals[SUM_MAGNITUDE];
    return Potential(totals[SUM_TESTED], select(0.0, noise, is_finite(noise)));
}

// Sums of all pieces, elements in [J s^2] as well.
fn add_pieces(local: u32) {
    var sums: Sums;
    for (var piece = local; piece < table[PIECE_COUNT]; piece += THREADS) {
        let weight = select(frame.squared_dt, 1.0, table[piece_row(piece) + 3u] != 0u);
        let at = SUMS * piece;
        for (var k = 0u; k <= SUM_MAGNITUDE; k++) {
            sums[k] += weight * partial_sums[at + k];
        }
        sums[SUM_FORCE] += partial_sums[at + SUM_FORCE];
        sums[SUM_REACH] = max(sums[SUM_REACH], partial_sums[at + SUM_REACH]);
    }
    // Vertices have no forces, elements no reach: their places are zero.
    reduce(sums, 1u, local);
}

// At `TRIAL + line * DIRECTION`.
fn potential_on_line(local: u32) -> Potential {
    var sums: Sums;
    for (var element = local; element < element_count(); element += THREADS) {
        if element >= table[TET_LANES] || tets[element / LANES].material[element % LANES] != FILLING {
            add_tested(element, LINE, &sums);
        }
    }
    sums[SUM_TESTED] *= frame.squared_dt;
    sums[SUM_MAGNITUDE] *= frame.squared_dt;
    for (var v = local; v < table[VERTEX_COUNT]; v += THREADS) {
        let x = place(LINE, v);
        sums[SUM_REACH] = max(sums[SUM_REACH], dot(x, x));
        if ground_of(ACTING, v).w != 0.0 {
            let term = inertia(v, LINE);
            sums[SUM_TESTED] += term;
            sums[SUM_MAGNITUDE] += abs(term);
        }
    }
    reduce(sums, 1u, local);
    return potential_of_totals();
}

// No higher than the limit; one that is no number gives way.
fn is_below(tested: Potential, limit: f32) -> bool {
    return is_finite(tested.value) && (!is_finite(limit) || tested.value <= limit + tested.noise);
}

// The lowest of three starts.
fn choose() {
    var limit = totals[SUM_START];
    var range = START;
    if totals[SUM_REFERENCE] == 0.0 && (!is_finite(limit) || 0.0 < limit) {
        limit = 0.0;
        range = REFERENCE;
    }
    let ahead = totals[SUM_AHEAD];
    if is_finite(ahead) && (!is_finite(limit) || ahead < limit) {
        limit = ahead;
        range = AHEAD;
    }
    control.limit = limit;
    control.best_value = limit;
    control.start = range;
    control.failures = 0u;
}

// After the evaluation: the best start (mode bit 0), the verdict on the step (bit 1).
@compute @workgroup_size(256)
fn settle(@builtin(local_invocation_index) local: u32) {
    add_pieces(local);
    let swept = potential_of_totals();
    if local == 0u {
        if (job.mode & CHOOSES) != 0u {
            choose();
        }
        // Mixtures that were guarded one by one have left their best there.
        start_range = select(control.start, START, job.mode == JUDGES);
    }
    if (job.mode & JUDGES) == 0u {
        return;
    }
    let keeps = local == 0u && is_below(swept, control.limit);
    if agree(keeps, local) {
        report(swept, false, local);
        return;
    }
    take_back(local);
}

fn report(ended: Potential, rejected: bool, local: u32) {
    if local == 0u {
        control.potential = ended.value;
        control.noise = ended.noise;
        control.was_rejected = select(0u, 1u, rejected);
        control.rejected += control.was_rejected;
    }
}

// The first share of the step that passes, else descent from its best start.
fn take_back(local: u32) {
    let start = workgroupUniformLoad(&start_range);
    let trial = TRIAL * table[STRIDE];
    let direction = DIRECTION * table[STRIDE];
    for (var v = local; v < table[VERTEX_COUNT]; v += THREADS) {
        let origin = ground_of(start, v).xyz;
        ground[trial + v] = vec4f(origin, 0.0);
        ground[direction + v] = vec4f(points[v].xyz - origin, 0.0);
    }
    storageBarrier();
    var shares = SHARES;
    var passed = false;
    var ended: Potential;
    for (var i = 0u; i < 4u; i++) {
        line = shares[i];
        ended = potential_on_line(local);
        passed = agree(local == 0u && is_below(ended, control.limit), local);
        if passed {
            break;
        }
    }
    if !passed {
        for (var i = 0u; i < DESCENTS; i++) {
            if !descend(local) {
                break;
            }
        }
        line = 0.0;
        ended = potential_on_line(local);
    }
    for (var v = local; v < table[VERTEX_COUNT]; v += THREADS) {
        points[v] = vec4f(place(LINE, v), points[v].w);
    }
    storageBarrier();
    report(ended, true, local);
    // The energy limit takes over what pieces leave.
    for (var piece = 0u; piece < table[PIECE_COUNT]; piece++) {
        sum_piece(piece, WITH_MOTION, local);
    }
}

// One step of descent from `TRIAL`; whether it got anywhere.
fn descend(local: u32) -> bool {
    load_forces(local);
    storageBarrier();
    var sums: Sums;
    let direction = DIRECTION * table[STRIDE];
    for (var v = local; v < table[VERTEX_COUNT]; v += THREADS) {
        var along = vec3f();
        if ground_of(ACTING, v).w != 0.0 {
            let load = gather(v);
            let predicted = ground_of(PREDICTED, v);
            let gradient = (ground_of(TRIAL, v).xyz - predicted.xyz) * predicted.w - load.xyz;
            along = gradient * (-1.0 / (predicted.w + load.w));
            sums[0] += dot(gradient, along);
        }
        ground[direction + v] = vec4f(along, 0.0);
    }
    storageBarrier();
    reduce(sums, 1u, local);
    let slope = totals[0];
    line = 0.0;
    let before = potential_on_line(local).value;
    var length = 1.0;
    for (var i = 0u; i < SHORTENINGS; i++) {
        line = length;
        let after = potential_on_line(local).value;
        let falls = is_finite(after) && after <= before + SUFFICIENT * length * slope;
        if agree(falls, local) {
            let trial = TRIAL * table[STRIDE];
            for (var v = local; v < table[VERTEX_COUNT]; v += THREADS) {
                ground[trial + v] = vec4f(place(LINE, v), 0.0);
            }
            storageBarrier();
            return true;
        }
        length *= SHORTEN;
    }
    return false;
}

fn gather(v: u32) -> vec4f {
    let row = table[OFFSETS_AT] + v;
    var sum = vec4f();
    for (var slot = table[row]; slot < table[row + 1u]; slot++) {
        sum += loads[slot];
    }
    return sum;
}

// At `TRIAL`: squared step times force, and the bound of its curvature, into the places that vertices
// gather.
fn load_forces(local: u32) {
    let squared = frame.squared_dt;
    for (var element = local; element < table[TET_LANES]; element += THREADS) {
        let block = element / LANES;
        let lane = element % LANES;
        if tets[block].material[lane] == FILLING {
            continue;
        }
        let tet = deformed(block, lane, TRIAL);
        let volume = tet.volume * squared;
        var forces = internal_forces(stress_of(tet), tet.shape, volume);
        var g = shape_gradients(tet.shape);
        for (var corner = 0u; corner < 4u; corner++) {
            let slot = table[table[CORNERS_AT] + LANES * (4u * block + corner) + lane];
            let rate = tet.viscosity_rate;
            let curvature =
                tissue_curvature(tet.neo, tet.f, g[corner], tet.lame_lambda, tet.lame_mu, rate);
            loads[slot] = vec4f(forces[corner], volume * curvature);
        }
    }
    for (var i = local; i < table[SPRING_COUNT]; i += THREADS) {
        let row = spring_row(i);
        let stiffness = number(row + 8u);
        let forces = spring_forces(spring_ends(row, TRIAL), number(row + 7u), stiffness);
        loads[table[row + 4u]] = vec4f(forces[0] * squared, squared * stiffness);
        loads[table[row + 5u]] = vec4f(forces[1] * squared, squared * stiffness);
    }
    for (var i = local; i < table[ATTACHMENT_COUNT]; i += THREADS) {
        let row = attachment_row(i);
        let stiffness = number(row + 4u);
        let force = attachment_force(place(TRIAL, table[row]), anchor_of(i), stiffness);
        loads[table[row + 2u]] = vec4f(force * squared, squared * stiffness);
    }
}

// Whether an iterate is at least as good as the best so far; becomes it where it is better.
fn judge_iterate(tested: Potential) {
    control.is_better = select(0u, 1u, is_finite(tested.value) && tested.value < control.best_value);
    if control.is_better != 0u {
        control.best_value = tested.value;
    }
    control.is_good = select(0u, 1u, is_below(tested, control.best_value));
    if control.is_good != 0u {
        control.failures = 0u;
    }
}

// After the evaluation of a mixture (mode 0), or of the plain sweep that took its place (mode 1).
@compute @workgroup_size(256)
fn judge(@builtin(local_invocation_index) local: u32) {
    let is_plain = job.mode == 1u;
    if is_plain {
        let passed = agree(local == 0u && control.is_good != 0u, local);
        if passed {
            if local == 0u {
                control.is_better = 0u;
                control.taken = NOTHING;
            }
            return;
        }
    }
    add_pieces(local);
    var gives_up = false;
    if local == 0u {
        judge_iterate(potential_of_totals());
        control.taken = select(PLAIN, NOTHING, is_plain || control.is_good != 0u);
        if is_plain && control.is_good == 0u {
            control.failures += 1u;
            gives_up = control.failures >= TOLERATED;
        }
    }
    if agree(gives_up, local) {
        go_on_from_best(local);
    }
}

// The older sweeps started elsewhere: Anderson's history begins anew.
fn go_on_from_best(local: u32) {
    let trial = TRIAL * table[STRIDE];
    for (var v = local; v < table[VERTEX_COUNT]; v += THREADS) {
        ground[trial + v] = ground_of(START, v);
    }
    storageBarrier();
    let got_on = descend(local);
    let value = totals[SUM_TESTED];
    if local == 0u {
        control.taken = DESCENT;
        control.failures = 0u;
        control.sweeps = 0u;
        control.next = 0u;
        control.differences = 0u;
        control.last_norm = 3e38;
        control.is_better = select(0u, 1u, got_on && value < control.best_value);
        if control.is_better != 0u {
            control.best_value = value;
        }
    }
}
