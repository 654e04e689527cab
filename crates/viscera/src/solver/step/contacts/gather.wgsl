// Contact at vertices: what the rebase of XPBD and descents take of it (contacts/of_vertices.rs).
//
//   f_i = sum_s b_is f_s;   Mh_i = (m_i + kappa d_i) I + dt^2 sum_s |b_is| sum_a |b_as| (C_s + turning I)

// Times dt^2: force, a bound of its curvature, and the curvature as xx, yy, zz and yz, xz, xy.
struct OnVertex {
    force: vec3f,
    bound: f32,
    direct: vec3f,
    mixed: vec3f,
    // Whether any tool is near.
    is_near: bool,
}

fn contact_on(v: u32) -> OnVertex {
    var sum: OnVertex;
    if table[SAMPLE_OFFSETS_AT] == 0u {
        return sum;
    }
    let offsets = table[SAMPLE_OFFSETS_AT] + v;
    let end = table[offsets + 1u];
    for (var i = table[offsets]; i < end; i++) {
        let entry = table[SAMPLE_ENTRIES_AT] + 2u * i;
        let at = table[CONTACT_AT] + SAMPLE_VECTORS * table[entry];
        let force = loads[at];
        if force.w == 0.0 {
            continue;
        }
        let weight = number(entry + 1u);
        let a = loads[at + 1u];
        let b = loads[at + 2u];
        sum.is_near = true;
        sum.force += force.xyz * weight;
        sum.bound += b.z * abs(weight);
        sum.direct += a.xyz * abs(weight);
        sum.mixed += vec3f(a.w, b.xy) * abs(weight);
    }
    return sum;
}

// Mh^-1 r by a decomposition L D L^T: no number of D is below `bound`, which is all of Mh but contact, and which rounding would
// hide where contact is stiffer by far.
fn resolved(contact: OnVertex, bound: f32, r: vec3f) -> vec3f {
    let d = contact.direct + vec3f(bound);
    let yz = contact.mixed.x;
    let xz = contact.mixed.y;
    let xy = contact.mixed.z;
    let first = vec2f(xy, xz) * (1.0 / d.x);
    let second = max(d.y - first.x * xy, bound);
    let rest = yz - first.x * xz;
    let last = rest / second;
    let third = max(d.z - first.y * xz - last * rest, bound);
    let y = r.y - first.x * r.x;
    let z = (r.z - first.y * r.x - last * y) / third;
    let middle = y / second - last * z;
    return vec3f(r.x / d.x - first.x * middle - first.y * z, middle, z);
}
