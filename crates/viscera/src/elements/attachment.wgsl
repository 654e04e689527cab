// Attachment: a vertex held elastically at a point in space (the anchor `p`). `C = x - p`, energy
// `k |C|^2 / 2`, compliance `1/k`. Twin of `attachment.rs`.

// What one solve changes: the three multipliers and the position [m].
struct AttachmentCorrection {
    multipliers: vec3f,
    position: vec3f,
}

// Energy [J].
fn attachment_energy(x: vec3f, anchor: vec3f, stiffness: f32) -> f32 {
    return 0.5 * stiffness * dot(x - anchor, x - anchor);
}

// Force [N] on the vertex.
fn attachment_force(x: vec3f, anchor: vec3f, stiffness: f32) -> vec3f {
    return (anchor - x) * stiffness;
}

// One solve. `compliance_tilde = 1/(k dt^2)`.
fn attachment_solve(
    x: vec3f,
    w: f32,
    anchor: vec3f,
    multipliers: vec3f,
    compliance_tilde: f32,
) -> AttachmentCorrection {
    let scale = 1.0 / (w + compliance_tilde);
    let change = (anchor - x - multipliers * compliance_tilde) * scale;
    return AttachmentCorrection(change, change * w);
}

// The multipliers at which the residual of the solve is zero: `-C/a~`.
fn attachment_constitutive_multipliers(
    x: vec3f,
    anchor: vec3f,
    compliance_tilde: f32,
) -> vec3f {
    return (anchor - x) * (1.0 / compliance_tilde);
}
