// `PartProgress` of progress.rs: where the solve of a connected part stands.

// Products of pairs, by both places: `MOST_HISTORY` squared.
const MOST_PRODUCTS: u32 = MOST_HISTORY * MOST_HISTORY;

// See parts.rs.
struct SolveState {
    phase: u32,
    passes_left: u32,
    accepted: u32,
    ahead: u32,
    failures: u32,
    rejections: u32,
    calm: u32,
    // Of pairs: how many, and the place of the newest.
    count: u32,
    newest: u32,
    // `s . y / y . M y` of the newest pair.
    scale: f32,
    // The share of the direction that the trial goes, and `g . d` [J s^2].
    length: f32,
    slope: f32,
}

struct PartProgress {
    states: array<SolveState, 2>,
    // `s_i . y_j` of pairs `i` that are not newer than `j`, and `y_i . M y_j`, by their places.
    sy: array<array<f32, MOST_PRODUCTS>, 2>,
    yw: array<array<f32, MOST_PRODUCTS>, 2>,
    // Whether the last step was rejected, and whether its last solve rejected no trial.
    was_rejected: u32,
    calm: u32,
    // At the end of a step: whether the last solve ends at its trial.
    takes_trial: u32,
    // Whether it lies on tools alone: then its step is one of implicit Euler, whose solve goes on through both of SDIRK2's.
    slides: u32,
}
