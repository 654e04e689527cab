// For models that tools do not touch, in the place of the kernels' contact.

fn load_sample(sample: u32) {
}

fn pushed_velocity(v: u32, h: f32, inverse_mass: f32, velocity: vec3f, change: vec3f) -> vec3f {
    return velocity + change;
}

fn contact_load(v: u32) -> vec3f {
    return vec3f();
}
