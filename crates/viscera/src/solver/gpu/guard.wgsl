// The step guard and the guard of mixtures (solver/guard.rs), in one workgroup: what decides is small.
// What follows a bad verdict is not, but rare: there the workgroup goes through the whole model, so that
// a step that is accepted pays one dispatch for all of it, and one that does nothing.
//
// One loop takes turns. Each sums one potential, then the first thread says what is next:
//
//   PIECES -> DONE                                   nothing to search for
//   PIECES -> SHARE ... -> MOVE                      a share of the step passes
//   PIECES -> SHARE ... -> AIM -> LENGTH ... -> MOVE   none does: descent, up to three times from AIM on
//   PIECES -> AIM -> LENGTH ... -> MOVE              mixtures and plain sweeps fail: one descent
//
// Compilers put a function in wherever it is called, and some take seconds for the energies: whatever is
// long is called at one place.

const SHARE_COUNT: u32 = 4u;
const SHARES: array<f32, SHARE_COUNT> = array<f32, SHARE_COUNT>(0.5, 0.2, 0.08, 0.032);
const DESCENTS: u32 = 3u;
const SUFFICIENT: f32 = 1e-4;
const SHORTEN: f32 = 0.4;
const SHORTENINGS: u32 = 12u;
const TOLERATED: u32 = 2u;

// Uses of `settle`: the best start is found; the step is judged, or a mixture, or the plain sweep that took
// the place of one.
const CHOOSES: u32 = 1u;
const JUDGES: u32 = 2u;
const JUDGES_MIXTURE: u32 = 4u;
const JUDGES_PLAIN: u32 = 8u;

// What a turn does: what the pieces have left is added up; a share of the step is tried; forces say where
// to descend to; a length of that is tried. Or the search is over: with places, or with nothing.
const PIECES: u32 = 0u;
const SHARE: u32 = 1u;
const AIM: u32 = 2u;
const LENGTH: u32 = 3u;
const MOVE: u32 = 4u;
const DONE: u32 = 5u;

// `Phi` [J s^2] above the start of the step, and what round-off can pretend of it.
struct Potential {
    value: f32,
    noise: f32,
}

struct Search {
    turn: u32,
    // The share, or the length, that is tried or was found; zero before any.
    line: f32,
    // Shares or lengths tried, this one included; descents that got somewhere.
    tries: u32,
    descents: u32,
    // The best so far, and what a descent of length one promises [J s^2].
    found: Potential,
    slope: f32,
    // The range of the ground that it starts from, and whether it has not been left yet.
    start: u32,
    is_new: u32,
}

var<workgroup> search: Search;

// As on the CPU, but for the sums, which are in single precision here.
fn potential_of_totals() -> Potential {
    let rounding = sqrt(totals[SUM_REACH]) * sqrt(totals[SUM_FORCE]);
    let noise = 4.0 * EPSILON * frame.squared_dt * rounding + 8.0 * EPSILON * totals[SUM_MAGNITUDE];
    return Potential(totals[SUM_TESTED], select(0.0, noise, is_finite(noise)));
}

// Sums of all pieces, elements in [J s^2] as well. Vertices have no forces, elements no reach: their
// places are zero.
fn add_pieces(local: u32, into: ptr<function, Sums>) {
    for (var piece = local; piece < table[PIECE_COUNT]; piece += THREADS) {
        let weight = select(frame.squared_dt, 1.0, table[piece_row(piece) + 3u] != 0u);
        let at = SUMS * piece;
        for (var k = 0u; k <= SUM_MAGNITUDE; k++) {
            (*into)[k] += weight * partial_sums[at + k];
        }
        (*into)[SUM_FORCE] += partial_sums[at + SUM_FORCE];
        (*into)[SUM_REACH] = max((*into)[SUM_REACH], partial_sums[at + SUM_REACH]);
    }
}

// At `TRIAL + line * DIRECTION`.
fn add_line(local: u32, into: ptr<function, Sums>) {
    for (var element = local; element < element_count(); element += THREADS) {
        if element >= table[TET_LANES] || tets[element / LANES].material[element % LANES] != FILLING {
            add_tested(element, answer(element, LINE, true), into);
        }
    }
    (*into)[SUM_TESTED] *= frame.squared_dt;
    (*into)[SUM_MAGNITUDE] *= frame.squared_dt;
    for (var v = local; v < table[VERTEX_COUNT]; v += THREADS) {
        let x = place(LINE, v);
        (*into)[SUM_REACH] = max((*into)[SUM_REACH], dot(x, x));
        if ground_of(ACTING, v).w != 0.0 {
            let term = inertia(v, LINE);
            (*into)[SUM_TESTED] += term;
            (*into)[SUM_MAGNITUDE] += abs(term);
        }
    }
}

// `value <= limit + allowance` as on the CPU, by the bits of a limit that may be no number: below an
// infinite one is whatever is finite, below one that is none nothing.
fn is_below(value: f32, limit: f32, allowance: f32) -> bool {
    let is_infinite = bitcast<u32>(limit) == 0x7f800000u;
    return is_finite(value) && (is_infinite || is_finite(limit) && value <= limit + allowance);
}

fn passes(tested: Potential, limit: f32) -> bool {
    return is_below(tested.value, limit, tested.noise);
}

// The lowest of three starts; one that is no finite number gives way to the next.
fn choose() {
    var limit = totals[SUM_START];
    var range = START;
    if totals[SUM_REFERENCE] == 0.0 && (!is_finite(limit) || 0.0 < limit) {
        limit = 0.0;
        range = REFERENCE;
    }
    let ahead = totals[SUM_AHEAD];
    if !is_finite(limit) || is_finite(ahead) && ahead < limit {
        limit = ahead;
        range = AHEAD;
    }
    control.limit = limit;
    control.best_value = limit;
    control.start = range;
    control.failures = 0u;
}

@compute @workgroup_size(256)
fn settle(@builtin(local_invocation_index) local: u32) {
    if local == 0u {
        search = first();
    }
    var now = workgroupUniformLoad(&search);
    while now.turn < MOVE {
        line = now.line;
        if now.is_new != 0u {
            set_out(now.start, local);
        }
        var sums: Sums;
        if now.turn == AIM {
            sums[SUM_HELD] = aim(local);
        }
        if now.turn == PIECES {
            add_pieces(local, &sums);
        } else {
            add_line(local, &sums);
        }
        reduce(sums, 1u, local);
        if local == 0u {
            search = next(now, potential_of_totals());
        }
        now = workgroupUniformLoad(&search);
    }
    if now.turn == MOVE {
        line = now.line;
        advance(local);
        if (job.mode & JUDGES) != 0u {
            for (var v = local; v < table[VERTEX_COUNT]; v += THREADS) {
                points[v] = vec4f(ground_of(TRIAL, v).xyz, points[v].w);
            }
        }
        if local == 0u {
            conclude(now);
        }
    }
}

fn first() -> Search {
    var begun: Search;
    if (job.mode & JUDGES_PLAIN) != 0u && control.is_good != 0u {
        // The mixture passed.
        control.is_better = 0u;
        control.taken = NOTHING;
        begun.turn = DONE;
    }
    return begun;
}

// After a turn that has found `tested`.
fn next(now: Search, tested: Potential) -> Search {
    var then = now;
    then.is_new = 0u;
    switch now.turn {
        case PIECES: {
            then.turn = verdict(tested);
            then.is_new = 1u;
            then.start = select(control.start, START, (job.mode & CHOOSES) == 0u);
            then.tries = 1u;
            then.line = select(0.0, SHARES[0], then.turn == SHARE);
        }
        case SHARE: {
            then.found = tested;
            if passes(tested, control.limit) {
                then.turn = MOVE;
            } else if now.tries < SHARE_COUNT {
                var shares = SHARES;
                then.line = shares[now.tries];
                then.tries += 1u;
            } else {
                then.turn = AIM;
                then.line = 0.0;
            }
        }
        case AIM: {
            then.found = tested;
            then.slope = totals[SUM_HELD];
            then.turn = LENGTH;
            then.line = 1.0;
            then.tries = 1u;
        }
        default: {
            let decrease = SUFFICIENT * now.line * now.slope;
            if is_below(tested.value, now.found.value, decrease) {
                then.found = tested;
                then.descents += 1u;
                let wanted = select(1u, DESCENTS, (job.mode & JUDGES) != 0u);
                then.turn = select(AIM, MOVE, then.descents == wanted);
            } else if now.tries < SHORTENINGS {
                then.line *= SHORTEN;
                then.tries += 1u;
            } else {
                then.turn = MOVE;
                then.line = 0.0;
            }
        }
    }
    return then;
}

// What follows from the potential at the end of the sweeps.
fn verdict(swept: Potential) -> u32 {
    if (job.mode & CHOOSES) != 0u {
        choose();
    }
    if (job.mode & JUDGES) != 0u {
        if passes(swept, control.limit) {
            report(swept, 0u);
            return DONE;
        }
        return SHARE;
    }
    if (job.mode & (JUDGES_MIXTURE | JUDGES_PLAIN)) != 0u {
        judge_iterate(swept);
        let is_plain = (job.mode & JUDGES_PLAIN) != 0u;
        control.taken = select(PLAIN, NOTHING, is_plain || control.is_good != 0u);
        if is_plain && control.is_good == 0u {
            control.failures += 1u;
            if control.failures >= TOLERATED {
                return AIM;
            }
        }
    }
    return DONE;
}

// Whether this is better than the best so far; becomes it then.
fn improve(value: f32) {
    let best = control.best_value;
    control.is_better = select(0u, 1u, is_below(value, best, 0.0) && value != best);
    if control.is_better != 0u {
        control.best_value = value;
    }
}

// Whether an iterate is at least as good as the best so far; becomes it where it is better.
fn judge_iterate(tested: Potential) {
    improve(tested.value);
    control.is_good = select(0u, 1u, passes(tested, control.best_value));
    if control.is_good != 0u {
        control.failures = 0u;
    }
}

fn report(ended: Potential, rejected: u32) {
    control.potential = ended.value;
    control.noise = ended.noise;
    control.was_rejected = rejected;
    control.rejected += rejected;
}

// A line from the start to where the sweeps ended.
fn set_out(start: u32, local: u32) {
    let trial = TRIAL * table[STRIDE];
    let direction = DIRECTION * table[STRIDE];
    for (var v = local; v < table[VERTEX_COUNT]; v += THREADS) {
        let origin = ground_of(start, v).xyz;
        ground[trial + v] = vec4f(origin, 0.0);
        ground[direction + v] = vec4f(points[v].xyz - origin, 0.0);
    }
    storageBarrier();
}

// `TRIAL` goes the share, or the length, that was found.
fn advance(local: u32) {
    // Else it stays where it is.
    if line != 0.0 {
        let trial = TRIAL * table[STRIDE];
        for (var v = local; v < table[VERTEX_COUNT]; v += THREADS) {
            ground[trial + v] = vec4f(place(LINE, v), 0.0);
        }
        line = 0.0;
    }
    storageBarrier();
}

fn conclude(ended: Search) {
    if (job.mode & JUDGES) != 0u {
        report(ended.found, 1u);
        return;
    }
    control.taken = DESCENT;
    control.failures = 0u;
    // The older sweeps started elsewhere: Anderson's history begins anew.
    control.sweeps = 0u;
    control.next = 0u;
    control.differences = 0u;
    control.last_norm = 3e38;
    improve(ended.found.value);
}

// The direction of a descent from where the last one ended; its share of the slope.
fn aim(local: u32) -> f32 {
    advance(local);
    load_forces(local);
    storageBarrier();
    var slope = 0.0;
    let direction = DIRECTION * table[STRIDE];
    for (var v = local; v < table[VERTEX_COUNT]; v += THREADS) {
        var along = vec3f();
        if ground_of(ACTING, v).w != 0.0 {
            let load = gather(v);
            let predicted = ground_of(PREDICTED, v);
            let gradient = (ground_of(TRIAL, v).xyz - predicted.xyz) * predicted.w - load.xyz;
            along = gradient * (-1.0 / (predicted.w + load.w));
            slope += dot(gradient, along);
        }
        ground[direction + v] = vec4f(along, 0.0);
    }
    storageBarrier();
    return slope;
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
