// Contact in the kernels of a small step: samples are threads behind the elements, vertices gather what presses on theirs.

fn load_sample(sample: u32) {
    let small = small_row(table[sample_row(sample) + SAMPLE_PART]);
    let count = table[small + SMALL_COUNT];
    if control.small_steps_done < count {
        let share = (f32(control.small_steps_done) + 0.5) / f32(count);
        slip_sample(sample, share, number(small + SMALL_DT));
    }
}

// Where the step has ended: what has left a tool is free of friction.
@compute @workgroup_size(64)
fn slip_contacts(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let sample = thread_of(id, groups, 64u);
    if sample < job.count {
        slip_sample(sample, 1.0, 0.0);
    }
}

// Force times h^2, and a quarter of the stiffness times that.
fn pushed_at(v: u32) -> Pushed {
    var sum: Pushed;
    let offsets = table[SAMPLE_OFFSETS_AT] + v;
    let end = table[offsets + 1u];
    for (var i = table[offsets]; i < end; i++) {
        let entry = table[SAMPLE_ENTRIES_AT] + 2u * i;
        let at = contact_at(table[entry]);
        let force = loads[at];
        if slots_used(force.w) > 0u {
            let weight = number(entry + 1u);
            let direct = loads[at + 1u] * abs(weight);
            sum.force += force.xyz * weight;
            sum.direct += direct.xyz;
            sum.mixed += vec3f(direct.w, loads[at + 2u].xy * abs(weight));
        }
    }
    return sum;
}

// A quarter of D.
fn stiffness_felt(pushed: Pushed) -> mat3x3f {
    let m = pushed.mixed;
    return mat3x3f(
        vec3f(pushed.direct.x, m.z, m.y),
        vec3f(m.z, pushed.direct.y, m.x),
        vec3f(m.y, m.x, pushed.direct.z),
    );
}

// The velocity after a small step in which everything else changes it by `change`: (1 + D/4m) (v' - v) = change + h f/m. Keeps
// the force times h^2.
fn pushed_velocity(v: u32, h: f32, inverse_mass: f32, velocity: vec3f, change: vec3f) -> vec3f {
    let pushed = pushed_at(v);
    if all(pushed.force == vec3f()) && all(pushed.direct == vec3f()) {
        put_vertex_data(REFERENCE, v, vec4f());
        return velocity + change;
    }
    let added = stiffness_felt(pushed);
    let m = mat3x3f(vec3f(1.0, 0.0, 0.0), vec3f(0.0, 1.0, 0.0), vec3f(0.0, 0.0, 1.0)) + added * inverse_mass;
    let given = change + pushed.force * (inverse_mass / h);
    let a = cross(m[1], m[2]);
    let b = cross(m[2], m[0]);
    let c = cross(m[0], m[1]);
    let gained = (a * given.x + b * given.y + c * given.z) * (1.0 / dot(m[0], a));
    put_vertex_data(REFERENCE, v, vec4f(pushed.force - added * gained * h, 0.0));
    return velocity + gained;
}

// Times h^2, as in the last small step.
fn contact_load(v: u32) -> vec3f {
    return vertex_data_of(REFERENCE, v).xyz;
}
