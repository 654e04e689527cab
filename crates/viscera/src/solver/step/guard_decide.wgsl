// Decisions of the step guard and the guard of accelerated iterates (solver/step/guard.rs), for one connected
// part, from the sums of its pieces. Every workgroup that needs a decision makes it for itself: sums are small, and
// a dispatch that only decides costs as much as one that does something.

// `Phi` [J s^2] above the start of the step, and the part of it that round-off can pretend.
struct Potential {
    value: f32,
    noise: f32,
}

// As on the CPU, but for the sums, which are in single precision here.
fn potential(value: f32, magnitude: f32, force: f32, reach: f32) -> Potential {
    let rounding = sqrt(reach) * sqrt(force);
    let noise = 4.0 * EPSILON * frame.squared_dt * rounding + 8.0 * EPSILON * magnitude;
    return Potential(value, select(0.0, noise, is_finite(noise)));
}

fn potential_of_totals() -> Potential {
    let magnitude = totals[SUM_MAGNITUDE];
    return potential(totals[SUM_TESTED], magnitude, totals[SUM_FORCE], totals[SUM_REACH]);
}

// `value <= limit + allowance` as on the CPU, by the bits of a limit that need not be finite: every finite value is
// below infinity, nothing is below NaN. By bits, because WGSL lets compilers assume that there is neither.
fn is_below(value: f32, limit: f32, allowance: f32) -> bool {
    let is_infinite = bitcast<u32>(limit) == 0x7f800000u;
    return is_finite(value) && (is_infinite || (is_finite(limit) && value <= limit + allowance));
}

fn passes(tested: Potential, limit: f32) -> bool {
    return is_below(tested.value, limit, tested.noise);
}

// Whether an iterate becomes the best.
fn improves(value: f32, best: f32) -> bool {
    return is_below(value, best, 0.0) && value != best;
}

// The lowest of three starts, and the range of the vertex data that it lies in.
struct Choice {
    limit: f32,
    range: u32,
}

// A start whose potential is not finite gives way to the next.
fn choose() -> Choice {
    var choice = Choice(totals[SUM_START], START);
    // The reference is the start of the step with its pins moved, to which all sums are differences: its own value
    // is zero by definition. It is no candidate where the energy of one of its elements is NaN: `reference_of` then
    // takes that energy as zero, and zero is no longer its value.
    if totals[SUM_REFERENCE] == 0.0 && (!is_finite(choice.limit) || 0.0 < choice.limit) {
        choice = Choice(0.0, REFERENCE);
    }
    // The order is that of the CPU, and comparisons are strict: of equal places the same one is taken.
    let ahead = totals[SUM_AHEAD];
    if !is_finite(choice.limit) || (is_finite(ahead) && ahead < choice.limit) {
        choice = Choice(ahead, AHEAD);
    }
    return choice;
}

// The sums that a piece leaves in a search, from here on: value, magnitude, force and reach of every share of the
// step; behind them the values of every length of a descent, the first of them zero, and the slope.
fn shares_at(piece: u32) -> u32 {
    return table[LINES_AT] + 2u * LINE_SUMS * piece;
}

fn lengths_at(piece: u32) -> u32 {
    return shares_at(piece) + LINE_SUMS;
}

const SLOPE: u32 = LINE_SUMS - 1u;
// Of shares the reaches.
const REACHES: u32 = 0x8888u;

fn add_shares(part: u32, local: u32, into: ptr<function, Sums>) {
    let count = piece_count(part);
    for (var i = local; i < count; i += THREADS) {
        let piece = piece_at(part, i);
        let weight = weight_of_piece(piece);
        // Four numbers a share: value and magnitude, in [J] of elements and in [J s^2] of vertices, so elements are
        // weighted by dt^2; squared forces [N^2], which `potential` multiplies by dt^2 itself; reach [m^2], a maximum.
        for (var k = 0u; k < 4u * SHARE_COUNT; k++) {
            let sum = partial_sums[shares_at(piece) + k];
            if k % 4u == 3u {
                (*into)[k] = max((*into)[k], sum);
            } else {
                (*into)[k] += select(sum, weight * sum, k % 4u < 2u);
            }
        }
    }
}

fn add_lengths(part: u32, local: u32, into: ptr<function, Sums>) {
    let count = piece_count(part);
    for (var i = local; i < count; i += THREADS) {
        let piece = piece_at(part, i);
        let weight = weight_of_piece(piece);
        // The slope among them comes from vertices alone and is in [J s^2], so that its weight is one.
        for (var k = 0u; k < LINE_SUMS; k++) {
            (*into)[k] += weight * partial_sums[lengths_at(piece) + k];
        }
    }
}

// The first share of the step that passes; zero where none does.
fn pick_share(limit: f32) -> f32 {
    var shares = SHARES;
    for (var k = 0u; k < SHARE_COUNT; k++) {
        let at = 4u * k;
        if passes(potential(totals[at], totals[at + 1u], totals[at + 2u], totals[at + 3u]), limit) {
            return shares[k];
        }
    }
    return 0.0;
}

// A length of a descent, and the potential there.
struct Length {
    length: f32,
    value: f32,
}

// The first that brings enough of what the slope promises (Armijo); zero where none does.
fn pick_length() -> Length {
    var length = 1.0;
    for (var k = 1u; k <= SHORTENINGS; k++) {
        // No allowance for noise, as on the CPU: where round-off hides the decrease the place stays. `totals[0]` is
        // the same line at length zero, summed in the same order, so that equal places give equal sums.
        if is_below(totals[k], totals[0], SUFFICIENT * length * totals[SLOPE]) {
            return Length(length, totals[k]);
        }
        length *= SHORTEN;
    }
    return Length(0.0, totals[0]);
}
