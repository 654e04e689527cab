// Markers and arrows: balls, rods and cones, put in place by three axes, in matt light so that no highlight is
// mistaken for wet tissue.

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
    return SolidFragment(on_screen(v), normalize(n), solid.color.rgb, solid.color.a);
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
