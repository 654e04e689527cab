// The same of a solve.

fn evaluate_meeting(meeting: u32) -> f32 {
    return 0.0;
}
