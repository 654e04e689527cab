// What the device decides during a step: no result comes back to the host inside one.

const LARGEST_WINDOW: u32 = 10u;

// What takes the place of an iterate of Anderson's.
const NOTHING: u32 = 0u;
const PLAIN: u32 = 1u;
const DESCENT: u32 = 2u;

struct Control {
    // Anderson: sweeps in the history, the place of the next difference, how many there are.
    sweeps: u32,
    next: u32,
    differences: u32,
    // Squared norm of the last residual.
    last_norm: f32,
    // Shares of the differences that are taken off the last mapped iterate.
    shares: array<f32, 10>,
    // Products of the differences with each other.
    gram: array<f32, 100>,
    // Chebyshev: sweeps so far, weight, measured radius, norm of the last change.
    iteration: u32,
    omega: f32,
    radius: f32,
    last_change: f32,
    // Explicit method: small steps done.
    small_step: u32,
    // Step guard; potentials [J s^2] are what is above the start of the step with its pins moved.
    limit: f32,
    best_value: f32,
    // The range of the ground that holds the best start.
    start: u32,
    // Of mixtures: whether the iterate passes, whether it is better than the best, and what is taken
    // in its place.
    is_good: u32,
    is_better: u32,
    taken: u32,
    failures: u32,
    // Steps taken back so far.
    rejected: u32,
    // Of the last step.
    was_rejected: u32,
    potential: f32,
    noise: f32,
    // Multipliers that are no numbers were found.
    is_broken: atomic<u32>,
}
