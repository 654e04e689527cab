// For builds without contact on devices, in the place of gather.wgsl and potential.wgsl.

struct OnVertex {
    force: vec3f,
    bound: f32,
    is_near: bool,
}

fn contact_on(v: u32) -> OnVertex {
    return OnVertex();
}

fn resolved(contact: OnVertex, bound: f32, r: vec3f) -> vec3f {
    return r / bound;
}

fn has_samples() -> bool {
    return false;
}

fn is_sample(element: u32) -> bool {
    return false;
}

fn sample_corners(element: u32) -> array<u32, 4> {
    return array<u32, 4>();
}

fn sample_answer(element: u32, x: array<vec3f, 4>) -> vec2f {
    return vec2f();
}

fn given_to(element: u32, x: array<vec3f, 4>) -> vec4f {
    return vec4f();
}

fn load_sample(element: u32, x: array<vec3f, 4>) {
}
