// What all shaders share: the camera, the lights, the way to the screen. Lights are those of the software
// renderer: a key from the upper left, a weak fill from the right and the sky, all of which travel with the viewer.

struct View {
    // Where the viewer stands [m].
    position: vec4f,
    right: vec4f,
    up: vec4f,
    backward: vec4f,
    // Sideways and upward scale, nearest and farthest depth [m].
    lens: vec4f,
    // Towards the lights, in the world.
    key: vec4f,
    fill: vec4f,
    // From a place as seen from the viewer [m] to the shadow map: across, up (-1 to 1), depth (0 to 1, away
    // from the light).
    shadow_across: vec4f,
    shadow_up: vec4f,
    shadow_depth: vec4f,
    // Step between places looked up in the map, how far before the surface they lie [m], whether there is a
    // shadow.
    shadow: vec4f,
    // What lies behind, in linear light.
    top: vec4f,
    bottom: vec4f,
}

@group(0) @binding(0) var<uniform> view: View;
// Colours of values, first to last, in linear light.
@group(0) @binding(1) var<uniform> palette: array<vec4f, 256>;

// Where a place, seen from the viewer [m], lies on the screen.
fn on_screen(v: vec3f) -> vec4f {
    let depth = -dot(v, view.backward.xyz);
    let near = view.lens.z;
    let far = view.lens.w;
    let x = dot(v, view.right.xyz) * view.lens.x;
    let y = dot(v, view.up.xyz) * view.lens.y;
    return vec4f(x, y, far * (depth - near) / (far - near), depth);
}

// As screens take it: the target does not encode by itself.
fn srgb(linear: vec3f) -> vec3f {
    let c = clamp(linear, vec3f(0.0), vec3f(1.0));
    let curve = 1.055 * pow(c, vec3f(1.0 / 2.4)) - 0.055;
    return select(curve, 12.92 * c, c <= vec3f(0.0031308));
}

// Of unit length and towards the viewer's side; a surface without area is lit from the viewer.
fn facing(normal: vec3f, v: vec3f, is_front: bool) -> vec3f {
    let raw = select(-normal, normal, is_front);
    return select(v, normalize(raw), dot(raw, raw) > 1e-12);
}

const KEY_LIGHT: vec3f = vec3f(0.84, 0.81, 0.77);
const FILL_LIGHT: vec3f = vec3f(0.12, 0.13, 0.14);
const SKY_LIGHT: vec3f = vec3f(0.34, 0.35, 0.37);
const GROUND_LIGHT: vec3f = vec3f(0.12, 0.11, 0.105);

// How much of the sky a surface sees; the sky travels with the viewer too.
fn sky_share(n: vec3f) -> f32 {
    return 0.5 + 0.5 * (0.954 * dot(n, view.up.xyz) + 0.301 * dot(n, view.backward.xyz));
}

// Diffuse light: of the key, a share, which reaches as far past the terminator as `wrap` says.
fn diffuse_light(n: vec3f, lit: f32, wrap: vec3f) -> vec3f {
    let wrapped = max((vec3f(dot(n, view.key.xyz)) + wrap) / (1.0 + wrap), vec3f(0.0));
    let side = max(dot(n, view.fill.xyz), 0.0);
    return lit * KEY_LIGHT * wrapped + FILL_LIGHT * side
        + mix(GROUND_LIGHT, SKY_LIGHT, sky_share(n));
}

struct Backdrop {
    @builtin(position) place: vec4f,
    @location(0) height: f32,
}

// One triangle that covers the screen.
@vertex
fn place_background(@builtin(vertex_index) i: u32) -> Backdrop {
    let corner = vec2f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0);
    return Backdrop(vec4f(corner, 1.0, 1.0), 0.5 + 0.5 * corner.y);
}

@fragment
fn shade_background(backdrop: Backdrop) -> @location(0) vec4f {
    return vec4f(srgb(mix(view.bottom.rgb, view.top.rgb, backdrop.height)), 1.0);
}
