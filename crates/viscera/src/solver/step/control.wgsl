// `PartGuard` of control.rs: what the guards decide for one connected part. Potentials [J s^2] are differences to the
// start of the step with its pins moved.
struct PartGuard {
    limit: f32,
    was_rejected: u32,
    share: f32,
    descends: u32,
    potential: f32,
    noise: f32,
    kept_speed: f32,
    best_value: f32,
    failures: u32,
    mixture_best: f32,
    mixture_failures: u32,
    is_good: u32,
}
