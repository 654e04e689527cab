// The same of its end.

fn add_meeting_end(meeting: u32, is_trial: bool, into: ptr<function, Sums>, more: ptr<function, Sums>) {
}
