// What samples of the skin meet in a step (contact/meeting.rs, contact/tree/nearest.rs, pairs/find.rs): of the triangles within
// reach that face a sample the nearest, of several the lowest.
//
//   n_s.n < 1/2, how much both face each other s((-n_s.nu - 0.2)/0.5) > 0, s(t) = t^2 (3 - 2 t);   k = A/2 s k_1 k_2/(k_1 + k_2)
//   d > -depth, unless the sample was in touch there before
//
// A thread goes down the tree for its sample: whatever the order, the same is found.

const BESIDE: f32 = 0.5;
const FACES: f32 = 0.2;
const WHOLLY: f32 = 0.7;
const STAYS: f32 = 0.1;

// A sample that looks: its place [m] as seen from its first vertex, which is at `origin`.
struct Looking {
    row: u32,
    body: u32,
    origin: vec3f,
    p: vec3f,
    outward: vec3f,
    // The triangle that it was in touch with, plus one.
    kept: u32,
}

struct Best {
    // Plus one.
    triangle: u32,
    squared: f32,
}

fn facing(outward: vec3f, direction: vec3f) -> f32 {
    let share = clamp((-dot(outward, direction) - FACES) / (WHOLLY - FACES), 0.0, 1.0);
    return share * share * (3.0 - 2.0 * share);
}

fn corner_from(looking: Looking, triangle: u32, corner: u32) -> vec3f {
    return (now_at(triangle, corner) - looking.origin) - looking.p;
}

fn near_triangle(looking: Looking, triangle: u32) -> Near {
    let a = corner_from(looking, triangle, 0u);
    let b = corner_from(looking, triangle, 1u);
    let c = corner_from(looking, triangle, 2u);
    return near_of(a, b, c, loads[range_at(triangle) - 1u].xyz);
}

// Whether two triangles are the same or have a point in common.
fn touch_each_other(a: u32, b: u32) -> bool {
    for (var i = 0u; i < 9u; i++) {
        if table[triangle_row(a) + i / 3u] == table[triangle_row(b) + i % 3u] {
            return true;
        }
    }
    return false;
}

fn is_neighbour(v: u32, other: u32) -> bool {
    let offsets = skin(SKIN_NEIGHBOUR_OFFSETS) + v;
    var low = table[offsets];
    var high = table[offsets + 1u];
    while low < high {
        let middle = (low + high) / 2u;
        let found = table[skin(SKIN_NEIGHBOURS) + middle];
        if found == other {
            return true;
        }
        if found < other {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return false;
}

// Whether a triangle hangs on a vertex that a sample hangs on, or on a neighbour of one.
fn is_around(looking: Looking, triangle: u32) -> bool {
    for (var i = 0u; i < 4u; i++) {
        let v = table[looking.row + i];
        if number(looking.row + 4u + i) == 0.0 {
            continue;
        }
        for (var k = 0u; k < 12u; k++) {
            let at = skin_point_row(table[triangle_row(triangle) + k / 4u]) + k % 4u;
            if number(at + 4u) != 0.0 && (table[at] == v || is_neighbour(v, table[at])) {
                return true;
            }
        }
    }
    return false;
}

// As it lies: faced, and no deeper than it may be.
fn suits(looking: Looking, triangle: u32, near: Near) -> bool {
    if facing(looking.outward, near.direction) == 0.0 {
        return false;
    }
    let is_own = table[triangle_row(triangle) + 3u] == looking.body;
    let depth = select(skin_number(SKIN_DEPTH_OTHER), skin_number(SKIN_DEPTH_OWN), is_own);
    if near.distance > -depth {
        return true;
    }
    return looking.kept != 0u && touch_each_other(looking.kept - 1u, triangle);
}

// Takes a triangle that is nearer than the best.
fn look_at(looking: Looking, triangle: u32, best: ptr<function, Best>) {
    let normal = loads[range_at(triangle) - 1u];
    if normal.w == 0.0 || !(dot(looking.outward, normal.xyz) < BESIDE) {
        return;
    }
    let near = near_triangle(looking, triangle);
    let is_nearer = near.squared < (*best).squared
        || (near.squared == (*best).squared && ((*best).triangle == 0u || triangle + 1u < (*best).triangle));
    if !is_nearer || !suits(looking, triangle, near) {
        return;
    }
    if table[triangle_row(triangle) + 3u] == looking.body && is_around(looking, triangle) {
        return;
    }
    *best = Best(triangle + 1u, near.squared);
}

// Whether a body's samples look at a body's triangles, or at those of several.
fn takes(body: u32, other: u32) -> bool {
    let itself = skin(SKIN_ITSELF) != 0u;
    let others = skin(SKIN_BODIES) != 0u;
    if other == 0xffffffffu {
        return itself || others;
    }
    return select(others, itself, body == other);
}

fn nearest_triangle(looking: Looking, hint: u32) -> Best {
    let reach = loads[skin(SKIN_REACH)].x;
    var best = Best(0u, reach * reach);
    // One that was near lately saves time and changes nothing.
    if hint != 0u && takes(looking.body, table[triangle_row(hint - 1u) + 3u]) {
        look_at(looking, hint - 1u, &best);
    }
    var node = 0u;
    while node < skin(SKIN_NODE_COUNT) {
        let row = node_row(node);
        let low = (loads[node_box(node)].xyz - looking.origin) - looking.p;
        let high = (loads[node_box(node) + 1u].xyz - looking.origin) - looking.p;
        let gap = max(max(low, -high), vec3f());
        // Rounding hides nothing that is as near.
        if dot(gap, gap) > best.squared * 1.001 + 1e-14 || !takes(looking.body, table[row + 3u]) {
            node = table[row];
            continue;
        }
        let first = table[row + 1u];
        for (var i = first; i < first + table[row + 2u]; i++) {
            look_at(looking, table[skin(SKIN_ORDER) + i], &best);
        }
        node++;
    }
    return best;
}

// Outwards at a sample, of length 1, or nothing.
fn outward_at(row: u32) -> vec3f {
    let site = table[row + 10u];
    if (site & ON_POINT) == 0u {
        return loads[range_at(site) - 1u].xyz;
    }
    let offsets = skin(SKIN_AROUND_OFFSETS) + (site & ~ON_POINT);
    var sum = vec3f();
    for (var i = table[offsets]; i < table[offsets + 1u]; i++) {
        sum += loads[range_at(table[skin(SKIN_AROUND) + i]) - 1u].xyz;
    }
    let length = length_of(sum);
    let is_some = length > 0.0;
    return select(vec3f(), sum * (1.0 / select(1.0, length, is_some)), is_some);
}

// What distances between two bodies are longer by [m].
fn shift_between(a: u32, b: u32) -> f32 {
    for (var i = 0u; i < skin(SKIN_SHIFT_COUNT); i++) {
        let row = skin(SKIN_SHIFTS) + 3u * i;
        if table[row] == min(a, b) && table[row + 1u] == max(a, b) {
            return number(row + 2u);
        }
    }
    return 0.0;
}

fn look_from(meeting: u32) -> Looking {
    let row = skin_sample_row(meeting);
    let origin = points[table[row]].xyz;
    var p = vec3f();
    for (var i = 1u; i < 4u; i++) {
        p += (points[table[row + i]].xyz - origin) * number(row + 4u + i);
    }
    let kept = u32(loads[meeting_at(meeting) + 6u].z);
    return Looking(row, table[row + 11u], origin, p, outward_at(row), kept);
}

// The triangle that a sample meets, plus one: where it was in touch it stays until another is nearer by a share of the thickness,
// or it has slid off its border, which would hold it back.
fn choose_triangle(looking: Looking, hint: u32) -> u32 {
    let best = nearest_triangle(looking, hint);
    if looking.kept == 0u {
        return best.triangle;
    }
    let before = near_triangle(looking, looking.kept - 1u);
    let is_on = all(before.weights > vec3f());
    let nearest = select(sqrt(best.squared), 0.0, best.triangle == 0u);
    let stays = sqrt(before.squared) <= nearest + STAYS * skin_number(SKIN_THICKNESS);
    let has_normal = loads[range_at(looking.kept - 1u) - 1u].w != 0.0;
    if is_on && has_normal && stays && suits(looking, looking.kept - 1u, before) {
        return looking.kept;
    }
    return best.triangle;
}

fn find_contact(meeting: u32) {
    let at = meeting_at(meeting);
    let looking = look_from(meeting);
    if looking.kept != 0u {
        atomicStore(&control.parts[table[looking.row + 12u]].pressed_step, control.step);
    }
    let found = choose_triangle(looking, u32(loads[at].w));
    loads[at] = vec4f(0.0, 0.0, 0.0, f32(found));
    if found == 0u {
        return;
    }
    let near = near_triangle(looking, found - 1u);
    let other = table[triangle_row(found - 1u) + 4u];
    let soft = bitcast<f32>(other);
    let own = number(looking.row + 9u);
    let area = number(looking.row + 8u) * facing(looking.outward, near.direction);
    let stiffness = area * (skin_number(SKIN_STIFFNESS) * own * soft / (own + soft));
    let shift = shift_between(looking.body, table[triangle_row(found - 1u) + 3u]);
    var slip = vec3f();
    var limit = 0.0;
    if looking.kept != 0u {
        // What friction has kept is in terms of the triangle that it was kept on.
        let kept = loads[at + 4u];
        let a = now_at(looking.kept - 1u, 0u);
        slip = (now_at(looking.kept - 1u, 1u) - a) * kept.x + (now_at(looking.kept - 1u, 2u) - a) * kept.y;
        limit = skin_number(SKIN_FRICTION) * kept.z;
    }
    loads[at + 1u] = vec4f(near.weights, shift);
    loads[at + 2u] = vec4f(near.direction, stiffness);
    loads[at + 3u] = vec4f(slip - near.away, limit);
}

fn find_tie(meeting: u32) {
    let at = meeting_at(meeting);
    let tie = meeting - skin(SKIN_SAMPLE_COUNT);
    let row = tie_row(tie);
    if loads[skin(SKIN_TORN) + tie].x != 0.0 {
        loads[at] = vec4f();
        return;
    }
    let triangle = table[row + 1u];
    let ab = now_at(triangle, 1u) - now_at(triangle, 0u);
    let ac = now_at(triangle, 2u) - now_at(triangle, 0u);
    let normal = loads[range_at(triangle) - 1u].xyz;
    let rest = ab * number(row + 5u) + ac * number(row + 6u) + normal * number(row + 7u);
    loads[at] = vec4f(0.0, 0.0, 0.0, f32(triangle + 1u));
    loads[at + 1u] = vec4f(number(row + 2u), number(row + 3u), number(row + 4u), 0.0);
    loads[at + 2u] = vec4f(normal, number(row + 8u));
    loads[at + 3u] = vec4f(rest, 0.0);
}

// Twice the curvature of the energy ahead of the start of the step.
fn put_curvature(meeting: u32, ahead: f32) {
    let at = meeting_at(meeting);
    let met = meeting_of(meeting);
    let origin = points[table[met.sample]].xyz;
    var away = vec3f();
    for (var i = 0u; i < BEARINGS; i++) {
        let one = bearing_of(met, i);
        if one.weight != 0.0 {
            let moved = vertex_data_of(VELOCITIES, one.vertex).xyz * ahead;
            away += ((points[one.vertex].xyz - origin) + moved) * one.weight;
        }
    }
    var along = met.stiffness;
    var across = met.stiffness;
    if !met.is_tie {
        let gap = skin_number(SKIN_THICKNESS) - distance_of(met, away);
        along = select(0.0, met.stiffness, gap > 0.0);
        along += select(0.0, (SECOND_STAGE - 1.0) * met.stiffness, gap > 0.5 * skin_number(SKIN_THICKNESS));
        across = 0.0;
        if met.limit > 0.0 {
            let length = length_of(slip_of(met, away));
            let gives_way = met.stiffness * length > met.limit;
            across = select(met.stiffness, met.limit / select(1.0, length, gives_way), gives_way);
        }
    }
    let n = met.normal;
    let direct = vec3f(across) + n * n * (along - across);
    let mixed = vec3f(n.y * n.z, n.x * n.z, n.x * n.y) * (along - across);
    loads[at + 5u] = vec4f(direct, mixed.x) * 2.0;
    loads[at + 6u] = vec4f(mixed.yz * 2.0, loads[at + 6u].z, 0.0);
}

// `job.parameter`: how far ahead of the start of the step tissue is stiff, as a share of it.
@compute @workgroup_size(64)
fn find_meetings(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let meeting = thread_of(id, groups, 64u);
    if meeting >= job.count {
        return;
    }
    if meeting < skin(SKIN_SAMPLE_COUNT) {
        find_contact(meeting);
    } else {
        find_tie(meeting);
    }
    if loads[meeting_at(meeting)].w != 0.0 {
        put_curvature(meeting, frame.dt * job.parameter);
    }
}
