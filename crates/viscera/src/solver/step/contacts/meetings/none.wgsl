// For builds that leave out how tissue meets tissue, in the place of the files beside this one.

struct Blocks {
    own: array<f32, 6>,
    whole: array<f32, 6>,
    may_touch: bool,
}

fn has_skin() -> bool {
    return false;
}

fn add_meetings(v: u32, blocks: ptr<function, Blocks>) {
}

fn meeting_force(v: u32) -> vec3f {
    return vec3f();
}
