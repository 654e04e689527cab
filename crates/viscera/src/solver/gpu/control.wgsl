// What the device decides during a step: no result comes back to the host inside one.

const LARGEST_WINDOW: u32 = 10u;

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
    // Whether what was tested last is good; whether it is better than the best.
    is_good: u32,
    is_better: u32,
    failures: u32,
    rejected: u32,
    // Of the last step.
    was_rejected: u32,
    potential: f32,
    noise: f32,
    kept_speed: f32,
    // Multipliers that are no numbers were found.
    is_broken: atomic<u32>,
}

// Sums over the free vertices of a connected part; see energy.rs.
struct Part {
    // Center, momentum and load at the end of the step.
    momentum: vec3f,
    mass: f32,
    start_momentum: vec3f,
    is_held: u32,
    load: vec3f,
    // [J]: kinetic at start and end, what was stored at the end above the start, work of the loads.
    kinetic: f32,
    shift: vec3f,
    start_kinetic: f32,
    stored: f32,
    work: f32,
    share: f32,
    drift: vec3f,
}
