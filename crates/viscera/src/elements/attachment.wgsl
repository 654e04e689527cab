// Attachment: a vertex held elastically at a point in space (the anchor `p`). `C = x - p`, energy
// `k |C|^2 / 2`, compliance `1/k`. Twin of `attachment.rs`.

// The changes by one solve: the three multipliers and the position [m].
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

// The kind; its constant is the stiffness [N/m].

fn attachments_energy(e: ElementMoment, x: array<vec3f, 4>) -> f32 {
    return attachment_energy(x[0], e.anchor, e.constants.x);
}

// Change of the energy [J] as the vertex moves by `d` [m], with the round-off of the change.
fn attachments_energy_change(e: ElementMoment, x: array<vec3f, 4>, d: array<vec3f, 4>) -> f32 {
    return e.constants.x * dot(d[0], x[0] - e.anchor + d[0] * 0.5);
}

fn attachments_forces(e: ElementMoment, x: array<vec3f, 4>) -> array<vec3f, 4> {
    let force = attachment_force(x[0], e.anchor, e.constants.x);
    return array<vec3f, 4>(force, vec3f(), vec3f(), vec3f());
}

fn attachments_curvature(e: ElementMoment) -> f32 {
    return e.constants.x;
}

fn attachments_solve(
    e: ElementMoment,
    x: array<vec3f, 4>,
    w: array<f32, 4>,
    l: vec4f,
    squared: f32,
) -> ElementCorrection {
    let compliance_tilde = 1.0 / (e.constants.x * squared);
    let change = attachment_solve(x[0], w[0], e.anchor, l.xyz, compliance_tilde);
    let moves = array<vec3f, 4>(change.position, vec3f(), vec3f(), vec3f());
    return ElementCorrection(vec4f(change.multipliers, 0.0), moves);
}

fn attachments_loads(
    e: ElementMoment,
    x: array<vec3f, 4>,
    l: vec4f,
    squared: f32,
) -> array<CornerLoad, 4> {
    return array<CornerLoad, 4>(CornerLoad(l.xyz, 0.0), CornerLoad(), CornerLoad(), CornerLoad());
}

fn attachments_constitutive(e: ElementMoment, x: array<vec3f, 4>, squared: f32) -> vec4f {
    let compliance_tilde = 1.0 / (e.constants.x * squared);
    return vec4f(attachment_constitutive_multipliers(x[0], e.anchor, compliance_tilde), 0.0);
}
