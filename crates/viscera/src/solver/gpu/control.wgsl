// Decisions of the device during a step: no result comes back to the host inside one.

struct Control {
    // Explicit method: the small step that is made, and how many are done. One is written where the other
    // is read.
    small_step: u32,
    small_steps_done: u32,
    // Steps so far, the last that was rejected for some part, and the number of rejected steps.
    step: u32,
    rejected_step: atomic<u32>,
    rejected: atomic<u32>,
    // Each connected part decides for itself.
    parts: array<PartControl>,
}

// `PartControl` of report.rs.
struct PartControl {
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
    // Step guard; potentials [J s^2] are differences to the start of the step with its pins moved.
    limit: f32,
    // Of the last step: whether it was rejected, and to which share of it; zero for none, from which
    // descents follow.
    was_rejected: u32,
    share: f32,
    descends: u32,
    // How the last step ended.
    potential: f32,
    noise: f32,
    kept_speed: f32,
    // Guard of accelerated iterates: the best so far and failures in a row, after a plain sweep was judged; the same
    // after the accelerated one was, and whether it passed. Two of each, because workgroups that decide the same
    // must not read what one of them writes.
    best_value: f32,
    failures: u32,
    mixture_best: f32,
    mixture_failures: u32,
    is_good: u32,
    // NaN multipliers were found.
    is_broken: atomic<u32>,
}
