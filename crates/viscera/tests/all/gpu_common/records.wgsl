// Records of numbers, taken and put one after the other.

@group(0) @binding(0) var<storage, read> inputs: array<f32>;
@group(0) @binding(1) var<storage, read_write> outputs: array<f32>;

var<private> next_input: u32;
var<private> next_output: u32;

fn take() -> f32 {
    let value = inputs[next_input];
    next_input += 1u;
    return value;
}

fn take_vec3() -> vec3f {
    let x = take();
    let y = take();
    let z = take();
    return vec3f(x, y, z);
}

fn take_mat3() -> mat3x3f {
    let a = take_vec3();
    let b = take_vec3();
    let c = take_vec3();
    return mat3x3f(a, b, c);
}

fn take_2() -> array<f32, 2> {
    let a = take();
    let b = take();
    return array<f32, 2>(a, b);
}

fn take_6() -> array<f32, 6> {
    let a = take_vec3();
    let b = take_vec3();
    return array<f32, 6>(a.x, a.y, a.z, b.x, b.y, b.z);
}

fn put(value: f32) {
    outputs[next_output] = value;
    next_output += 1u;
}

fn put_vec3(v: vec3f) {
    put(v.x);
    put(v.y);
    put(v.z);
}

fn put_mat3(m: mat3x3f) {
    put_vec3(m[0]);
    put_vec3(m[1]);
    put_vec3(m[2]);
}

fn put_2(v: array<f32, 2>) {
    put(v[0]);
    put(v[1]);
}

fn put_6(v: array<f32, 6>) {
    put_vec3(vec3f(v[0], v[1], v[2]));
    put_vec3(vec3f(v[3], v[4], v[5]));
}

fn put_corners(v: array<vec3f, 4>) {
    put_vec3(v[0]);
    put_vec3(v[1]);
    put_vec3(v[2]);
    put_vec3(v[3]);
}

// All impulses, then all bounds.
fn put_loads(loads: array<CornerLoad, 4>) {
    put_corners(array<vec3f, 4>(
        loads[0].impulse,
        loads[1].impulse,
        loads[2].impulse,
        loads[3].impulse,
    ));
    put(loads[0].mass_bound);
    put(loads[1].mass_bound);
    put(loads[2].mass_bound);
    put(loads[3].mass_bound);
}
