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

// `PartControl` of control.rs.
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
    // The guards, see step/control.wgsl.
    guard: PartGuard,
    // NaN multipliers were found.
    is_broken: atomic<u32>,
    // The last step that began with a tool that pressed.
    pressed_step: atomic<u32>,
}
