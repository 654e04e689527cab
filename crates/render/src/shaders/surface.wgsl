// Light on tissue. Wet: diffuse light that wraps around the terminator, more in red than in blue; two
// highlights; a Fresnel term (Schlick 1994), F = F0 + (1 - F0)(1 - n.v)^5. Values: colours as the scale has
// them, shaded so softly that they can be read.

struct Body {
    // Linear light, and opacity.
    color: vec4f,
    // Value of the first colour, and one over the span of values.
    scale: vec4f,
}

@group(1) @binding(0) var<uniform> body: Body;

@group(2) @binding(0) var shadow_map: texture_depth_2d;
@group(2) @binding(1) var shadow_sampler: sampler_comparison;

struct Fragment {
    // A ghost's colours must meet the depths that were drawn before them.
    @invariant @builtin(position) place: vec4f,
    @location(0) to_viewer: vec3f,
    @location(1) normal: vec3f,
    // The value, and a number above zero where it is none.
    @location(2) value: vec2f,
}

// Ghosts lie a little farther than they are, a share of the distance along the line of sight: where one is the
// same as solid tissue, that is seen, and not a patchwork of both.
const GHOST_SINK: f32 = 0.002;

fn fragment_of(position: vec3f, normal: vec3f, value: vec2f) -> Fragment {
    let v = position - view.position.xyz;
    let sink = select(0.0, GHOST_SINK, body.color.a < 1.0);
    return Fragment(on_screen(v * (1.0 + sink)), -v, normal, value);
}

@vertex
fn place_tissue(@location(0) position: vec4f, @location(1) normal: vec4f) -> Fragment {
    return fragment_of(position.xyz, normal.xyz, vec2f());
}

@vertex
fn place_values(
    @location(0) position: vec4f,
    @location(1) normal: vec4f,
    @location(2) value: vec2f,
) -> Fragment {
    return fragment_of(position.xyz, normal.xyz, value);
}

@vertex
fn place_shadow(@location(0) position: vec4f) -> @builtin(position) vec4f {
    return in_shadow_map(position.xyz - view.position.xyz);
}

// Lines lie a little nearer than their triangles: a fixed share of the distance, along the line of sight.
const WIRE_LIFT: f32 = 0.0015;

@vertex
fn place_wire(@location(0) position: vec4f) -> @builtin(position) vec4f {
    return on_screen((position.xyz - view.position.xyz) * (1.0 - WIRE_LIFT));
}

@fragment
fn shade_wire() -> @location(0) vec4f {
    return vec4f(0.05, 0.05, 0.08, 0.30 * body.color.a);
}

fn in_shadow_map(v: vec3f) -> vec4f {
    let seen = vec4f(v, 1.0);
    return vec4f(
        dot(view.shadow_across, seen),
        dot(view.shadow_up, seen),
        dot(view.shadow_depth, seen),
        1.0,
    );
}

// The share of the key light that reaches a place: the mean of nine looks around it.
fn lit_share(v: vec3f, n: vec3f) -> f32 {
    if view.shadow.z == 0.0 {
        return 1.0;
    }
    let at = in_shadow_map(v + n * view.shadow.y);
    let middle = vec2f(0.5 + 0.5 * at.x, 0.5 - 0.5 * at.y);
    if any(middle <= vec2f(0.0)) || any(middle >= vec2f(1.0)) {
        return 1.0;
    }
    var sum = 0.0;
    for (var y = -1; y <= 1; y++) {
        for (var x = -1; x <= 1; x++) {
            let place = middle + vec2f(f32(x), f32(y)) * view.shadow.x;
            sum += textureSampleCompareLevel(shadow_map, shadow_sampler, place, at.z);
        }
    }
    return sum / 9.0;
}

fn fourth_power(x: f32) -> f32 {
    let square = x * x;
    return square * square;
}

// A ghost is as glass: clear where one looks straight at it, so that what it covers keeps its colours, and
// denser at its rim. The mean over a ball is near its opacity.
fn opacity(grazing: f32) -> f32 {
    let ghost = min(body.color.a * (0.35 + 2.0 * grazing * grazing), 1.0);
    return select(ghost, 1.0, body.color.a >= 1.0);
}

@fragment
fn shade_tissue(fragment: Fragment, @builtin(front_facing) is_front: bool) -> @location(0) vec4f {
    let v = normalize(fragment.to_viewer);
    let n = facing(fragment.normal, v, is_front);
    let lit = lit_share(-fragment.to_viewer, n);
    let light = diffuse_light(n, lit, vec3f(0.32, 0.24, 0.20));
    let shine = max(dot(n, normalize(view.key.xyz + v)), 0.0);
    let broad = fourth_power(fourth_power(shine));
    // Tighter shows the triangles of a coarse surface.
    let tight = fourth_power(broad);
    let grazing = 1.0 - clamp(dot(n, v), 0.0, 1.0);
    let fresnel = 0.03 + 0.97 * grazing * fourth_power(grazing);
    let mirrored = lit * (0.09 * broad + 0.36 * tight) + 0.24 * fresnel * sky_share(n);
    // Towards white, never past it; a ghost is no wetter than it is dense.
    let white = min(mirrored * body.color.a, 1.0);
    let linear = mix(body.color.rgb * light, vec3f(1.0, 0.99, 0.97), white);
    return vec4f(srgb(linear), opacity(grazing));
}

// The colour of a value that is none: viscera_picture::Color::MISSING.
const MISSING: vec3f = vec3f(0.4);

fn color_of(value: vec2f) -> vec3f {
    let place = 255.0 * clamp((value.x - body.scale.x) * body.scale.y, 0.0, 1.0);
    let i = min(u32(place), 254u);
    let color = mix(palette[i].rgb, palette[i + 1u].rgb, place - f32(i));
    return select(color, MISSING, value.y > 0.0);
}

@fragment
fn shade_values(fragment: Fragment, @builtin(front_facing) is_front: bool) -> @location(0) vec4f {
    let v = normalize(fragment.to_viewer);
    let n = facing(fragment.normal, v, is_front);
    let lit = lit_share(-fragment.to_viewer, n);
    let wrapped = lit * max((dot(n, view.key.xyz) + 0.4) / 1.4, 0.0);
    // One where the key falls straight on it.
    let grazing = 1.0 - clamp(dot(n, v), 0.0, 1.0);
    let light = 0.58 + 0.32 * wrapped + 0.10 * (1.0 - grazing);
    return vec4f(srgb(color_of(fragment.value) * light), opacity(grazing));
}
