// Where the solve of a connected part stands (parts.rs), and the verdict on its trial.
//
// There are two records of a part. A direction's dispatch reads one and writes the other, which the first vertices'
// workgroup of the next evaluation copies: whoever decides reads what nobody writes. `job.mode` has a bit that says which
// of them is the newer one, and another for solves whose last direction is never taken unchecked.

// Phases: no step is sought; the trial is the start, or the reference itself; the trial is a step from the iterate.
const DONE: u32 = 0u;
const STARTING: u32 = 1u;
const FROM_REFERENCE: u32 = 2u;
const ITERATING: u32 = 3u;

const SECOND_RECORD: u32 = 1u;
const UNCHECKED: u32 = 2u;

// Round-off of a change of the potential: so many units of the precision of the sum of its terms' magnitudes.
const ROUNDED: f32 = 8.0;
// See parts.rs.
const SETTLED: f32 = 0.5;
const UNCHECKED_STEP: f32 = 4.0;
const CLEAR_STEP: f32 = 16.0;
const MOST_FAILURES: u32 = 2u;

// Sums of pieces: the change of the potential and the magnitudes of its terms [J s^2], the slope at the trial [J s^2], the
// largest squared distance from the origin [m^2], and that of a vector of the direction [m^2], which the next direction
// leaves behind the others.
const SUM_CHANGE: u32 = 0u;
const SUM_SIZE: u32 = 1u;
const SUM_SLOPE: u32 = 2u;
const SUM_REACH: u32 = 3u;
const SUM_LONGEST: u32 = 4u;
const SUM_NEXT_LONGEST: u32 = 5u;
const TRIAL_MAXIMA: u32 = 0x18u;

// The share of the step that solves of the part at hand take: a body that lies on tools alone has one solve for all of it. The
// second of SDIRK2's would go on from the velocity of the first, which friction has yet to answer.
var<private> own_share: f32;

fn share_of(part: u32) -> f32 {
    return select(job.parameter, 1.0, progress[part].slides != 0u);
}

// The step [s] of a solve.
fn solve_dt() -> f32 {
    return frame.dt * own_share;
}

// Solves of implicit Euler: their last direction is never taken unchecked.
fn is_checked() -> bool {
    return (job.mode & UNCHECKED) == 0u && own_share != 1.0;
}

fn newer_record() -> u32 {
    return job.mode & SECOND_RECORD;
}

fn older_record() -> u32 {
    return newer_record() ^ SECOND_RECORD;
}

fn acts(part: u32, record: u32) -> bool {
    return progress[part].states[record].phase != DONE && progress[part].states[record].passes_left > 0u;
}

// What is decided about a trial.
struct Verdict {
    phase: u32,
    accepted: u32,
    // Whether the step leaves a pair; whether the trial becomes the reference.
    leaves_pair: u32,
    goes_back: u32,
    failures: u32,
    rejections: u32,
    length: f32,
}

fn add_trials(part: u32, local: u32, into: ptr<function, Sums>) {
    let count = piece_count(part);
    for (var i = local; i < count; i += THREADS) {
        let at = SUMS * piece_at(part, i);
        (*into)[SUM_CHANGE] += partial_sums[at + SUM_CHANGE];
        (*into)[SUM_SIZE] += partial_sums[at + SUM_SIZE];
        // Elements leave zeros there.
        (*into)[SUM_SLOPE] += partial_sums[at + SUM_SLOPE];
        (*into)[SUM_REACH] = max((*into)[SUM_REACH], partial_sums[at + SUM_REACH]);
        (*into)[SUM_LONGEST] = max((*into)[SUM_LONGEST], partial_sums[at + SUM_LONGEST]);
    }
}

// The same at the end of a solve, where the last direction has left its own.
fn add_ends(part: u32, local: u32, into: ptr<function, Sums>) {
    let row = part_row(part);
    let end = table[row + PART_VERTEX_PIECES_END];
    for (var piece = table[row + PART_VERTEX_PIECES] + local; piece < end; piece += THREADS) {
        let at = SUMS * piece;
        (*into)[SUM_REACH] = max((*into)[SUM_REACH], partial_sums[at + SUM_REACH]);
        (*into)[SUM_LONGEST] = max((*into)[SUM_LONGEST], partial_sums[at + SUM_NEXT_LONGEST]);
    }
}

// Steps below this [m] are round-off.
fn resolution() -> f32 {
    return EPSILON * sqrt(totals[SUM_REACH]);
}

fn is_settled(part: u32, record: u32, step: f32) -> bool {
    let now = progress[part].states[record];
    let slope = totals[SUM_SLOPE];
    if !is_checked() || !is_finite(slope) {
        return false;
    }
    if now.phase == STARTING {
        return now.calm != 0u;
    }
    let before = now.length * now.slope;
    let is_between = slope <= -SETTLED * before && slope >= before;
    return is_between && step > CLEAR_STEP * resolution();
}

fn suffices(limit: f32) -> bool {
    let allowance = ROUNDED * EPSILON * totals[SUM_SIZE];
    return is_finite(totals[SUM_CHANGE]) && is_finite(allowance) && totals[SUM_CHANGE] <= limit + allowance;
}

// From `totals`, of a part that acts.
fn judge(part: u32, record: u32) -> Verdict {
    let now = progress[part].states[record];
    let phase = now.phase;
    let length = now.length;
    let failures = now.failures;
    let rejections = now.rejections;
    let step = length * sqrt(totals[SUM_LONGEST]);
    if phase == ITERATING && !(is_finite(step) && step > resolution()) {
        // The next step is round-off.
        return Verdict(DONE, 0u, 0u, 0u, failures, rejections, length);
    }
    let before = length * now.slope;
    let limit = select(SUFFICIENT * before, 0.0, phase == STARTING);
    if phase == FROM_REFERENCE || is_settled(part, record, step) || suffices(limit) {
        let leaves = phase == ITERATING && step > CLEAR_STEP * resolution();
        return Verdict(ITERATING, 1u, select(0u, 1u, leaves), 0u, 0u, rejections, length);
    }
    if phase == STARTING {
        return Verdict(FROM_REFERENCE, 0u, 0u, 1u, failures, rejections, length);
    }
    // To the minimum of the parabola that has both slopes, within limits.
    var shorter = SHORTEN;
    let after = totals[SUM_SLOPE];
    if is_finite(after) && after > before {
        shorter = clamp(before / (before - after), 0.1, SHORTEN);
    }
    return Verdict(ITERATING, 0u, 0u, 0u, failures + 1u, rejections + 1u, length * shorter);
}

// Whether a solve ends at the last trial, which nothing has judged, and not at the iterate.
fn goes_on(part: u32, record: u32) -> bool {
    let now = progress[part].states[record];
    let step = now.length * sqrt(totals[SUM_LONGEST]);
    let is_ahead = now.ahead != 0u && now.accepted != 0u;
    let is_trusted = now.rejections == 0u && now.calm != 0u && is_checked();
    return is_ahead && is_trusted && is_finite(step) && step > UNCHECKED_STEP * resolution();
}

// The place of the next pair, of `job.set_first`.
fn next_slot(part: u32, record: u32) -> u32 {
    let now = progress[part].states[record];
    return select((now.newest + 1u) % job.set_first, 0u, now.count == 0u);
}

fn most_pairs(part: u32) -> u32 {
    return levels[levels[LEVELS_PART_ROWS] + LEVEL_PART_WORDS * part + 4u];
}

// The pairs of a part, from the newest to the oldest; with the one that a verdict leaves.
struct Pairs {
    count: u32,
    newest: u32,
}

fn pairs_with(part: u32, record: u32, leaves_pair: u32) -> Pairs {
    let now = progress[part].states[record];
    if leaves_pair == 0u {
        return Pairs(now.count, now.newest);
    }
    return Pairs(min(now.count + 1u, most_pairs(part)), next_slot(part, record));
}

fn slot_of(kept: Pairs, k: u32) -> u32 {
    return (kept.newest + job.set_first - k) % job.set_first;
}

// Of a pair: the step [m], the change of the gradient [N s^2], and its image under the preconditioner [m].
const STEP: u32 = 0u;
const CHANGE: u32 = 1u;
const IMAGE: u32 = 2u;

fn pair_at(slot: u32, what: u32, v: u32) -> u32 {
    return (3u * slot + what) * table[STRIDE_AT] + v;
}

// Products that a piece of vertices leaves: of each pair with the gradient, and with the newest pair.
const PRODUCTS_OF_PAIR: u32 = 4u;
const PAIRS_AT_ONCE: u32 = 5u;

fn products_at(piece: u32) -> u32 {
    return table[LINES_AT] + 2u * SUMS * (piece - job.first);
}
