// The point of a triangle that is nearest to a sample (mesh/nearest.rs, contact/pair.rs): Ericson, "Real-time collision
// detection", 2005, 5.1.5.

// Closer than this [m] the direction between two points means little: the triangle's own counts.
const CLOSE: f32 = 1e-5;

fn share_in(part: f32, rest: f32) -> f32 {
    let is_some = part + rest > 0.0;
    return select(0.0, part / select(1.0, part + rest, is_some), is_some);
}

// Barycentric weights of the point of a triangle that is nearest to the origin.
fn nearest_weights(a: vec3f, b: vec3f, c: vec3f) -> vec3f {
    let ab = b - a;
    let ac = c - a;
    let d1 = -dot(ab, a);
    let d2 = -dot(ac, a);
    if d1 <= 0.0 && d2 <= 0.0 {
        return vec3f(1.0, 0.0, 0.0);
    }
    let d3 = -dot(ab, b);
    let d4 = -dot(ac, b);
    if d3 >= 0.0 && d4 <= d3 {
        return vec3f(0.0, 1.0, 0.0);
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let on_b = share_in(d1, -d3);
        return vec3f(1.0 - on_b, on_b, 0.0);
    }
    let d5 = -dot(ab, c);
    let d6 = -dot(ac, c);
    if d6 >= 0.0 && d5 <= d6 {
        return vec3f(0.0, 0.0, 1.0);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let on_c = share_in(d2, -d6);
        return vec3f(1.0 - on_c, 0.0, on_c);
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let on_c = share_in(d4 - d3, d5 - d6);
        return vec3f(0.0, 1.0 - on_c, on_c);
    }
    let sum = va + vb + vc;
    if sum <= 0.0 {
        return vec3f(1.0, 0.0, 0.0);
    }
    let on_b = vb / sum;
    let on_c = vc / sum;
    return vec3f(1.0 - on_b - on_c, on_b, on_c);
}

struct Near {
    weights: vec3f,
    // From the triangle's point to the sample [m], and its square.
    away: vec3f,
    squared: f32,
    // Below zero behind the triangle [m], and the direction of length 1 that it is along.
    distance: f32,
    direction: vec3f,
}

// Of a triangle whose corners are seen from the sample, with its outer normal of length 1.
fn near_of(a: vec3f, b: vec3f, c: vec3f, outer: vec3f) -> Near {
    let weights = nearest_weights(a, b, c);
    let away = -(a * weights.x + b * weights.y + c * weights.z);
    let squared = dot(away, away);
    let length = sqrt(squared);
    let along = dot(outer, away);
    if length < CLOSE {
        return Near(weights, away, squared, along, outer);
    }
    let sign = select(1.0, -1.0, along < 0.0);
    return Near(weights, away, squared, sign * length, away * (sign / length));
}

// A vector along a triangle in terms of its edges from the first corner; zero where they span nothing.
fn in_edges(vector: vec3f, ab: vec3f, ac: vec3f) -> vec2f {
    let bb = dot(ab, ab);
    let bc = dot(ab, ac);
    let cc = dot(ac, ac);
    let determinant = bb * cc - bc * bc;
    let found = vec2f(dot(vector, ab) * cc - dot(vector, ac) * bc, dot(vector, ac) * bb - dot(vector, ab) * bc);
    let is_some = determinant > 0.0;
    return select(vec2f(), found * (1.0 / select(1.0, determinant, is_some)), is_some);
}
