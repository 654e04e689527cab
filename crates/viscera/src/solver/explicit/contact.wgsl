// Contact with tools in a small step h (step/contacts/explicit.rs): samples slip where they are, planes follow.
//
//   (m + D/4) (v' - v) = h (f + sum_s b f_s),   D = sum_s |b| C_s,   C_s = h^2 dF_s/dx sum_a |b_a|
//
// with f_s the force of the tool where it is in the middle of the small step. Contact is much stiffer than tissue. A quarter of D
// beside the mass (Newmark's beta; Hughes, The Finite Element Method, 9.1) makes it stable however long a small step is, without
// damping: h^2 K <= 4 m + D wherever h^2 K_tissue <= 4 m. C_s counts what presses and what sticks; what slides is dragged by
// `mu N`, whatever its speed.

// A plane turns by less than the angle of this cosine from small step to small step.
const SAME_SIDE: f32 = 0.5;
const SERIES: u32 = 9u;
const BETA: f32 = 0.25;

// A tool's place.
struct Pose {
    rotation: mat3x3f,
    origin: vec3f,
}

// Origins on a straight line, rotations about one axis; sin x/x and (1 - cos x)/x^2 by their series up to half a turn. The pose
// of first solves, which the method lacks, has the turn as axis times angle in its first column.
fn pose_between(tool: u32, share: f32) -> Pose {
    let pose = select(AT_START, AT_END, share == 1.0);
    let turn = tools.all[tool].poses[AT_FIRST][0].xyz * select(share, 0.0, share == 1.0);
    let squared = dot(turn, turn);
    var once = 1.0;
    var twice = 1.0;
    for (var k = SERIES; k > 0u; k--) {
        once = 1.0 - squared * once / f32(2u * k * (2u * k + 1u));
        twice = 1.0 - squared * twice / f32((2u * k + 1u) * (2u * k + 2u));
    }
    var rotation: mat3x3f;
    for (var i = 0u; i < 3u; i++) {
        let column = tools.all[tool].poses[pose][i].xyz;
        let across = cross(turn, column);
        rotation[i] = column + across * once + cross(turn, across) * (0.5 * twice);
    }
    let start = origin_of(tool, AT_START);
    let between = start + tools.all[tool].way.xyz * share;
    return Pose(rotation, select(between, origin_of(tool, AT_END), share == 1.0));
}

// What a sample feels: its force [N] and stiffness [N/m] as xx, yy, zz and yz, xz, xy; the work [J] of tools, and what contact
// stores [J].
struct Pushed {
    force: vec3f,
    direct: vec3f,
    mixed: vec3f,
    work: f32,
    stored: f32,
}

// In the tool's frame: what is met, and felt once the anchor of friction has slipped.
fn slip_slot(at: u32, slot: u32, row: u32, share: f32, place: vec3f, h: f32, sum: ptr<function, Pushed>) {
    var touching = touching_of(at, slot, row);
    let tool = tool_of(touching.marks);
    let law = tools.kinds[tool].law;
    let into = slot_vectors(at, slot);
    let pose = pose_between(tool, share);
    let arm = place - pose.origin;
    let local = transpose(pose.rotation) * arm;
    let is_tied = (touching.marks & IS_TIED) != 0u;
    let has_plane = (touching.marks & HAS_PLANE) != 0u;
    let live = distance_to(tool, local);
    if has_plane && !is_tied {
        let touches = live.value >= -SHALLOW * thinnest_of(tool) && live.value < law.z;
        if touches && dot(live.normal, touching.plane.xyz) > SAME_SIDE {
            touching.plane = tangent(tool, local, live);
            loads[into] = touching.plane;
        }
    }
    var met = Met(live.value, live.normal, live.slope, vec3f());
    if has_plane {
        met = Met(dot(touching.plane.xyz, local) - touching.plane.w, touching.plane.xyz, 1.0, vec3f());
    }
    let k = touching.stiffness * law.y;
    let n = met.normal;
    var sticks = is_tied;
    if is_tied {
        met.slip = local - touching.friction.xyz;
    } else {
        let anchor = select(local, touching.friction.xyz, touching.friction.w > 0.0);
        touching.friction = vec4f();
        let limit = law.w * felt_of(touching, met).pressed;
        if limit > 0.0 {
            let away = (local - anchor) - n * dot(n, local - anchor);
            let elastic = k * length_of(away);
            sticks = elastic <= limit;
            met.slip = away * select(limit / elastic, 1.0, sticks);
            touching.friction = vec4f(local - met.slip, limit);
        }
        loads[into + 1u] = touching.friction;
    }
    let felt = felt_of(touching, met);
    let across = select(0.0, k, sticks);
    var along = select(0.0, k, met.distance < law.z);
    along += select(0.0, (SECOND_STAGE - 1.0) * k, met.distance < 0.5 * law.z);
    along = along * met.slope * met.slope + select(0.0, k, is_tied);
    let normal = pose.rotation * n;
    let force = pose.rotation * felt.force;
    let turn = tools.all[tool].poses[AT_FIRST][0].xyz;
    (*sum).work += dot(force, tools.all[tool].way.xyz + cross(turn, arm)) * (h * frame.inverse_dt);
    (*sum).stored += contact_energy(touching, met);
    (*sum).force += force;
    (*sum).direct += vec3f(across) + normal * normal * (along - across);
    (*sum).mixed += normal.yxx * normal.zzy * (along - across);
}

// What contact stores [J] where the step begins, with its pins moved.
fn stored_at_start(at: u32, used: u32, row: u32) -> f32 {
    var place = vec3f();
    for (var i = 0u; i < 4u; i++) {
        place += start_of(table[row + i]) * number(row + SAMPLE_WEIGHTS + i);
    }
    var stored = 0.0;
    for (var slot = 0u; slot < used; slot++) {
        let touching = touching_of(at, slot, row);
        stored += contact_energy(touching, meet(touching, AT_START, place));
    }
    return stored;
}

// Leaves forces and stiffness times h^2, and what tools have given until now without what contact stores. At the end of the step,
// where `share` is one, samples slip for the last time.
fn slip_sample(sample: u32, share: f32, h: f32) {
    let at = contact_at(sample);
    let mark = loads[at].w;
    let used = slots_used(mark);
    let row = sample_row(sample);
    if used == 0u {
        return;
    }
    var given = loads[at + 2u].z;
    if share < 1.0 && control.small_steps_done == 0u {
        given = stored_at_start(at, used, row);
    }
    var place = vec3f();
    var weights = 0.0;
    for (var i = 0u; i < 4u; i++) {
        let weight = number(row + SAMPLE_WEIGHTS + i);
        place += points[table[row + i]].xyz * weight;
        weights += abs(weight);
    }
    var sum: Pushed;
    for (var slot = 0u; slot < used; slot++) {
        slip_slot(at, slot, row, share, place, h, &sum);
    }
    given += sum.work - select(0.0, sum.stored, share == 1.0);
    let squared = h * h;
    let added = BETA * squared * weights;
    loads[at] = vec4f(sum.force * squared, mark);
    loads[at + 1u] = vec4f(sum.direct, sum.mixed.x) * added;
    loads[at + 2u] = vec4f(sum.mixed.yz * added, given, 0.0);
}
