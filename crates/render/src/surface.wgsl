// Light on wet tissue, as the software renderer has it: a key from the upper left, a weak fill from the
// right and the sky, all of which travel with the viewer; diffuse light that wraps around the terminator, more in
// red than in blue; two highlights; a Fresnel term (Schlick 1994), F = F0 + (1 - F0)(1 - n.v)^5.

struct View {
    // Where the viewer stands [m].
    position: vec4<f32>,
    right: vec4<f32>,
    up: vec4<f32>,
    backward: vec4<f32>,
    // Sideways and upward scale, nearest and farthest depth [m].
    lens: vec4<f32>,
    // Linear light; the last is 1 where the target wants sRGB values written.
    color: vec4<f32>,
}

@group(0) @binding(0) var<uniform> view: View;

struct Fragment {
    @builtin(position) place: vec4<f32>,
    @location(0) to_viewer: vec3<f32>,
    @location(1) normal: vec3<f32>,
}

@vertex
fn place(@location(0) position: vec4<f32>, @location(1) normal: vec4<f32>) -> Fragment {
    let v = position.xyz - view.position.xyz;
    let depth = -dot(v, view.backward.xyz);
    let near = view.lens.z;
    let far = view.lens.w;
    let x = dot(v, view.right.xyz) * view.lens.x;
    let y = dot(v, view.up.xyz) * view.lens.y;
    let place = vec4<f32>(x, y, far * (depth - near) / (far - near), depth);
    return Fragment(place, -v, normal.xyz);
}

fn in_world(v: vec3<f32>) -> vec3<f32> {
    return normalize(view.right.xyz * v.x + view.up.xyz * v.y + view.backward.xyz * v.z);
}

fn srgb(linear: vec3<f32>) -> vec3<f32> {
    let c = clamp(linear, vec3<f32>(0.0), vec3<f32>(1.0));
    let curve = 1.055 * pow(c, vec3<f32>(1.0 / 2.4)) - 0.055;
    return select(curve, 12.92 * c, c <= vec3<f32>(0.0031308));
}

@fragment
fn shade(fragment: Fragment, @builtin(front_facing) is_front: bool) -> @location(0) vec4<f32> {
    let v = normalize(fragment.to_viewer);
    // A surface without area has no normal: it is lit from the viewer.
    let raw = select(-fragment.normal, fragment.normal, is_front);
    let n = select(v, normalize(raw), dot(raw, raw) > 1e-12);
    let key = in_world(vec3<f32>(-0.45, 0.65, 0.6));
    let fill = in_world(vec3<f32>(0.8, 0.1, 0.45));
    let wrap = vec3<f32>(0.35, 0.15, 0.1);
    let diffuse = clamp((vec3<f32>(dot(n, key)) + wrap) / (1.0 + wrap), vec3<f32>(0.0), vec3<f32>(1.0));
    let side = max(dot(n, fill), 0.0);
    let sky = mix(vec3<f32>(0.16, 0.14, 0.13), vec3<f32>(0.42, 0.44, 0.48), 0.5 + 0.5 * n.z);
    let light = 0.95 * diffuse + 0.16 * side + 0.7 * sky;
    let half_way = normalize(key + v);
    let shine = max(dot(n, half_way), 0.0);
    let fresnel = 0.028 + 0.972 * pow(1.0 - clamp(dot(n, v), 0.0, 1.0), 5.0);
    let highlight = 0.10 * pow(shine, 24.0) + 0.55 * pow(shine, 220.0);
    let linear = view.color.rgb * light + highlight + 0.35 * fresnel * sky;
    let shown = select(clamp(linear, vec3<f32>(0.0), vec3<f32>(1.0)), srgb(linear), view.color.a > 0.5);
    return vec4<f32>(shown, 1.0);
}
