// Markers and arrows: balls, rods and cones, put in place by three axes, in matt light so that no highlight is
// mistaken for wet tissue. Tools are placed alike, and are of brushed metal, in which sky and ground are mirrored.

struct Solid {
    @location(2) center: vec4f,
    // Where the mesh's axes go [m].
    @location(3) x: vec4f,
    @location(4) y: vec4f,
    @location(5) z: vec4f,
    // Linear light, and how strongly it shines through tissue before it.
    @location(6) color: vec4f,
}

struct SolidFragment {
    @builtin(position) place: vec4f,
    @location(0) normal: vec3f,
    @location(1) color: vec3f,
    @location(2) @interpolate(flat) see_through: f32,
    @location(3) to_viewer: vec3f,
}

@vertex
fn place_solid(
    @location(0) position: vec4f,
    @location(1) normal: vec4f,
    solid: Solid,
) -> SolidFragment {
    let x = solid.x.xyz;
    let y = solid.y.xyz;
    let z = solid.z.xyz;
    // From the viewer to the centre first: exact far from the origin.
    let offset = x * position.x + y * position.y + z * position.z;
    let v = solid.center.xyz - view.position.xyz + offset;
    // Normals go by the inverse transpose; the axes are perpendicular.
    let n = x * (normal.x / dot(x, x)) + y * (normal.y / dot(y, y)) + z * (normal.z / dot(z, z));
    return SolidFragment(on_screen(v), normalize(n), solid.color.rgb, solid.color.a, -v);
}

fn solid_color(fragment: SolidFragment) -> vec3f {
    let n = normalize(fragment.normal);
    return srgb(fragment.color * 1.15 * diffuse_light(n, 1.0, vec3f(0.25)));
}

@fragment
fn shade_solid(fragment: SolidFragment) -> @location(0) vec4f {
    return vec4f(solid_color(fragment), 1.0);
}

// Behind tissue: paler, so that one sees that it is there and that it is inside.
@fragment
fn shade_hidden_solid(fragment: SolidFragment) -> @location(0) vec4f {
    return vec4f(mix(solid_color(fragment), vec3f(1.0), 0.15), fragment.see_through);
}

// Light that metal sends to the viewer, as the software renderer has it: in part as matt things do, in part a blurred
// mirror of sky and ground.
@fragment
fn shade_tool(fragment: SolidFragment) -> @location(0) vec4f {
    let v = normalize(fragment.to_viewer);
    let n = normalize(fragment.normal);
    let lit = lit_share(-fragment.to_viewer, n);
    let diffuse = fragment.color * diffuse_light(n, lit, vec3f(0.25));
    let mirrored = n * (2.0 * dot(n, v)) - v;
    let sky = 0.5 + 0.5 * dot(mirrored, view.up.xyz);
    let around = 1.6 * mix(GROUND_LIGHT, SKY_LIGHT, sky * sky);
    let shine = max(dot(n, normalize(view.key.xyz + v)), 0.0);
    let broad = fourth_power(fourth_power(shine));
    let tight = fourth_power(broad) * fourth_power(broad);
    let white = min(lit * (0.30 * broad + 0.22 * tight), 1.0);
    let metal = 0.62 * diffuse + fragment.color * around;
    return vec4f(srgb(mix(metal, vec3f(1.0), white)), 1.0);
}

// What is nearer to the light than the map begins is at its beginning: a shaft throws its shadow from there as well.
@vertex
fn place_solid_shadow(
    @location(0) position: vec4f,
    @location(1) normal: vec4f,
    solid: Solid,
) -> @builtin(position) vec4f {
    let offset = solid.x.xyz * position.x + solid.y.xyz * position.y + solid.z.xyz * position.z;
    let place = in_shadow_map(solid.center.xyz - view.position.xyz + offset);
    return vec4f(place.xy, max(place.z, 0.0), place.w);
}
