// A picture onto the page's canvas: one texel to each pixel.

@group(0) @binding(0) var picture: texture_2d<f32>;

struct Pixel {
    @builtin(position) position: vec4f,
    // From the left upper corner of the part that the picture fills, 0 to 1.
    @location(0) place: vec2f,
}

// One triangle that covers everything.
@vertex
fn cover(@builtin(vertex_index) number: u32) -> Pixel {
    let corner = vec2f(f32((number << 1u) & 2u), f32(number & 2u));
    return Pixel(vec4f(2.0 * corner.x - 1.0, 1.0 - 2.0 * corner.y, 0.0, 1.0), corner);
}

@fragment
fn present(pixel: Pixel) -> @location(0) vec4f {
    let size = vec2f(textureDimensions(picture));
    let texel = clamp(pixel.place * size, vec2f(0.0), size - vec2f(1.0));
    return vec4f(textureLoad(picture, vec2u(texel), 0).rgb, 1.0);
}
