// Samples of the surface and tools: contact/shape.rs, contact/law.rs and contact/touch.rs in single precision.
//
//   psi(d) = k/2 max(dh - d, 0)^2 + (B - 1) k/2 max(dh/2 - d, 0)^2      d: distance to the tool, or to the plane that a sample
//                                                                      has met;  force A p n,  p = -psi'
//   E_f = K |u|^2/2 where K |u| <= L, else L (|u| - L/(2 K))            u: slip from the anchor
//
// Changes of energies are computed from changes of distance and slip: round-off is that of the change.
//
// A sample has `SAMPLE_VECTORS` vectors behind the loads: its force on the tissue times he^2, in w how many slots it uses in this
// step and, eight times, a bit for each tool that found none; the curvature of its energy [N/m] as xx, yy, zz, yz and xz, xy; then
// its slots, four vectors each:
//   plane of the tool's frame, offset;   anchor of friction in the step, its limit;   anchor and normal force at the end of the
//   last step;   force [N] on the tissue then, and the tool's number with marks

// Of a tool in a step.
struct ToolMotion {
    // To the world from the tool's frame at the start of the step, at the end of its first solve, at its end: columns of the
    // rotation, in w a component of the translation [m]. Explicit steps have their turn in the place of the second.
    poses: array<array<vec4f, 3>, 3>,
    // Way of its origin in the step [m]; whether it is locked.
    way: vec4f,
    // Axis times sine of its turn; whether it was put elsewhere.
    turn: vec4f,
}

// Of a tool in many steps.
struct ToolKind {
    // Lengths [m], the last of them the radius.
    lengths: vec4f,
    // Kind of shape; stiffness, thickness [m] and friction of the contact.
    law: vec4f,
    // Of a closed surface (contact/distance_grid): the lower corner of its grid and the edge of small cells [m]; bricks along each
    // axis and its first word; margin [m], the steepest that its distance is, half of the thickness of its walls [m]; of
    // every tool how far it reaches from its origin [m], or nothing.
    grid: vec4f,
    bricks: vec4u,
    bounds: vec4f,
}

struct Tools {
    count: vec4u,
    all: array<ToolMotion, MOST_TOOLS>,
    kinds: array<ToolKind, MOST_TOOLS>,
}

@group(1) @binding(2) var<uniform> tools: Tools;
// Distances of closed surfaces, row by row: of each, the numbers of its divided bricks, corners of bricks, points of divided ones.
@group(1) @binding(3) var distances: texture_2d<u32>;

const HALF_SPACE: u32 = 0u;
const SPHERE: u32 = 1u;
const CAPSULE: u32 = 2u;
const ROUNDED_BOX: u32 = 3u;
const SOLID: u32 = 4u;

// Poses.
const AT_START: u32 = 0u;
const AT_FIRST: u32 = 1u;
const AT_END: u32 = 2u;

// See law.rs and touch.rs.
const SECOND_STAGE: f32 = 10.0;
const SHALLOW: f32 = 0.25;

// The gradient is `slope` times the normal.
struct Distance {
    value: f32,
    normal: vec3f,
    slope: f32,
}

fn length_of(v: vec3f) -> f32 {
    return sqrt(dot(v, v));
}

fn turned(tool: u32, pose: u32, v: vec3f) -> vec3f {
    let m = tools.all[tool].poses[pose];
    return m[0].xyz * v.x + m[1].xyz * v.y + m[2].xyz * v.z;
}

fn turned_back(tool: u32, pose: u32, v: vec3f) -> vec3f {
    let m = tools.all[tool].poses[pose];
    return vec3f(dot(m[0].xyz, v), dot(m[1].xyz, v), dot(m[2].xyz, v));
}

fn origin_of(tool: u32, pose: u32) -> vec3f {
    let m = tools.all[tool].poses[pose];
    return vec3f(m[0].w, m[1].w, m[2].w);
}

fn into_tool(tool: u32, pose: u32, place: vec3f) -> vec3f {
    return turned_back(tool, pose, place - origin_of(tool, pose));
}

fn out_of_tool(tool: u32, pose: u32, place: vec3f) -> vec3f {
    return turned(tool, pose, place) + origin_of(tool, pose);
}

// At `away` from the nearest point of a core that is rounded by `radius`.
fn from_core(away: vec3f, radius: f32) -> Distance {
    let length = length_of(away);
    let is_some = length > 0.0;
    let normal = select(vec3f(1.0, 0.0, 0.0), away * (1.0 / select(1.0, length, is_some)), is_some);
    return Distance(length - radius, normal, 1.0);
}

fn inside_box(x: vec3f, core: vec3f, radius: f32) -> Distance {
    let depth = abs(x) - core;
    var nearest = 0u;
    for (var axis = 1u; axis < 3u; axis++) {
        if depth[axis] > depth[nearest] {
            nearest = axis;
        }
    }
    var normal = vec3f();
    normal[nearest] = select(1.0, -1.0, x[nearest] < 0.0);
    return Distance(depth[nearest] - radius, normal, 1.0);
}

fn grid_word(i: u32) -> u32 {
    return textureLoad(distances, vec2u(i % GRID_ROW, i / GRID_ROW), 0).x;
}

// Eight distances and a place between them; an edge of nothing beyond the grid.
struct Cell {
    values: array<f32, 8>,
    edge: f32,
    share: vec3f,
}

fn put_values(first: u32, columns: u32, height: u32, cell: ptr<function, Cell>) {
    for (var k = 0u; k < 8u; k++) {
        let at = ((k >> 2u) * columns + ((k >> 1u) & 1u)) * height + (k & 1u);
        (*cell).values[k] = bitcast<f32>(grid_word(first + at));
    }
}

fn cell_at(tool: u32, x: vec3f) -> Cell {
    var cell: Cell;
    let grid = tools.kinds[tool].grid;
    let bricks = tools.kinds[tool].bricks;
    let count = bricks.xyz;
    let at = (x - grid.xyz) * (1.0 / grid.w);
    let most = vec3f(count * BRICK);
    if !(all(at >= vec3f()) && all(at <= most)) {
        return cell;
    }
    let brick = min(vec3u(at) / BRICK, count - 1u);
    let inner = at - vec3f(brick * BRICK);
    let corners = bricks.w + count.x * count.y * count.z;
    let points = corners + (count.x + 1u) * (count.y + 1u) * (count.z + 1u);
    let divided = grid_word(bricks.w + (brick.x * count.y + brick.y) * count.z + brick.z);
    if divided == WHOLE_BRICK {
        let first = (brick.x * (count.y + 1u) + brick.y) * (count.z + 1u) + brick.z;
        put_values(corners + first, count.y + 1u, count.z + 1u, &cell);
        cell.edge = f32(BRICK) * grid.w;
        cell.share = inner * (1.0 / f32(BRICK));
        return cell;
    }
    let low = min(vec3u(inner), vec3u(BRICK - 1u));
    let side = BRICK + 1u;
    let first = divided * side * side * side + (low.x * side + low.y) * side + low.z;
    put_values(points + first, side, side, &cell);
    cell.edge = grid.w;
    cell.share = inner - vec3f(low);
    return cell;
}

// The trilinear function of a cell, and its gradient in the first three.
fn interpolated(cell: Cell) -> vec4f {
    let v = cell.values;
    let t = cell.share;
    var of_z: array<vec2f, 4>;
    for (var k = 0u; k < 4u; k++) {
        let rise = v[2u * k + 1u] - v[2u * k];
        of_z[k] = vec2f(v[2u * k] + rise * t.z, rise);
    }
    var of_y: array<vec3f, 2>;
    for (var k = 0u; k < 2u; k++) {
        let a = of_z[2u * k];
        let b = of_z[2u * k + 1u];
        of_y[k] = vec3f(a.x + (b.x - a.x) * t.y, b.x - a.x, a.y + (b.y - a.y) * t.y);
    }
    let a = of_y[0];
    let b = of_y[1];
    let along = a + (b - a) * t.x;
    return vec4f(vec3f(b.x - a.x, along.y, along.z) * (1.0 / cell.edge), along.x);
}

// Beyond the grid a bound from below.
fn beyond_grid(tool: u32, x: vec3f) -> Distance {
    let grid = tools.kinds[tool].grid;
    let high = grid.xyz + vec3f(tools.kinds[tool].bricks.xyz * BRICK) * grid.w;
    return from_core(x - min(max(x, grid.xyz), high), -tools.kinds[tool].bounds.x);
}

fn solid_distance(tool: u32, x: vec3f) -> Distance {
    let cell = cell_at(tool, x);
    if cell.edge == 0.0 {
        return beyond_grid(tool, x);
    }
    let found = interpolated(cell);
    let slope = length_of(found.xyz);
    let is_some = slope > 0.0;
    let normal = select(vec3f(1.0, 0.0, 0.0), found.xyz * (1.0 / select(1.0, slope, is_some)), is_some);
    return Distance(found.w, normal, slope);
}

fn solid_value(tool: u32, x: vec3f) -> f32 {
    let cell = cell_at(tool, x);
    if cell.edge == 0.0 {
        return beyond_grid(tool, x).value;
    }
    return interpolated(cell).w;
}

// The plane that stands for a tool at a point of its frame: of length 1, and as far from it as the tool.
fn tangent(tool: u32, at: vec3f, distance: Distance) -> vec4f {
    var normal = distance.normal;
    if u32(tools.kinds[tool].law.x) == SOLID {
        // The mean gradient, which is continuous from cell to cell; on a ridge there is none.
        let half = 0.5 * tools.kinds[tool].grid.w;
        var rise = vec3f();
        for (var axis = 0u; axis < 3u; axis++) {
            var step = vec3f();
            step[axis] = half;
            rise[axis] = solid_value(tool, at + step) - solid_value(tool, at - step);
        }
        let length = length_of(rise);
        if length > 2e-3 * half {
            normal = rise * (1.0 / length);
        }
    }
    return vec4f(normal, dot(normal, at) - distance.value);
}

// Distance [m] and its gradient at a point of the tool's frame.
fn distance_to(tool: u32, x: vec3f) -> Distance {
    let kind = u32(tools.kinds[tool].law.x);
    let lengths = tools.kinds[tool].lengths;
    if kind == HALF_SPACE {
        return Distance(x.z, vec3f(0.0, 0.0, 1.0), 1.0);
    }
    if kind == SOLID {
        return solid_distance(tool, x);
    }
    if kind == SPHERE {
        return from_core(x, lengths.w);
    }
    if kind == CAPSULE {
        return from_core(x - vec3f(0.0, 0.0, clamp(x.z, 0.0, lengths.x)), lengths.w);
    }
    let core = lengths.xyz - vec3f(lengths.w);
    let away = x - min(max(x, -core), core);
    if all(away == vec3f()) {
        return inside_box(x, core, lengths.w);
    }
    return from_core(away, lengths.w);
}

// The smallest radius [m] of its surface.
fn thinnest_of(tool: u32) -> f32 {
    let kind = u32(tools.kinds[tool].law.x);
    let lengths = tools.kinds[tool].lengths;
    if kind == HALF_SPACE {
        return 3e38;
    }
    if kind == SOLID {
        return tools.kinds[tool].bounds.z;
    }
    if kind == ROUNDED_BOX {
        return min(min(lengths.x, lengths.y), lengths.z);
    }
    return lengths.w;
}

fn sample_row(sample: u32) -> u32 {
    return table[SAMPLES_AT] + SAMPLE_WORDS * sample;
}

fn contact_at(sample: u32) -> u32 {
    return table[CONTACT_AT] + SAMPLE_VECTORS * sample;
}

fn slot_vectors(at: u32, slot: u32) -> u32 {
    return at + FIRST_SLOT + SLOT_VECTORS * slot;
}

// Slots that a sample uses, of the fourth number of its force.
fn slots_used(mark: f32) -> u32 {
    return u32(mark) & 7u;
}

// What a sample and a tool are to each other in a step.
struct Touching {
    plane: vec4f,
    // Anchor of friction, and its limit [N]: zero for none, `LOCKED` where the sample is tied.
    friction: vec4f,
    marks: u32,
    // Area times the tissue's stiffness there [N/m].
    stiffness: f32,
}

// Larger than every force.
const LOCKED: f32 = 1e30;

fn touching_of(at: u32, slot: u32, row: u32) -> Touching {
    let first = slot_vectors(at, slot);
    let marks = u32(loads[first + 3u].w);
    return Touching(loads[first], loads[first + 1u], marks, number(row + SAMPLE_STIFFNESS));
}

fn tool_of(marks: u32) -> u32 {
    return marks & (MOST_TOOLS - 1u);
}

// Distance, its gradient in the world as `slope` times the normal, slip from the anchor [m].
struct Met {
    distance: f32,
    normal: vec3f,
    slope: f32,
    slip: vec3f,
}

fn meet(touching: Touching, pose: u32, place: vec3f) -> Met {
    let tool = tool_of(touching.marks);
    let local = into_tool(tool, pose, place);
    var met: Met;
    if (touching.marks & HAS_PLANE) != 0u {
        met.distance = dot(touching.plane.xyz, local) - touching.plane.w;
        met.normal = turned(tool, pose, touching.plane.xyz);
        met.slope = 1.0;
    } else {
        let live = distance_to(tool, local);
        met.distance = live.value;
        met.normal = turned(tool, pose, live.normal);
        met.slope = live.slope;
    }
    if touching.friction.w > 0.0 {
        let away = turned(tool, pose, local - touching.friction.xyz);
        met.slip = away;
        if (touching.marks & IS_TIED) == 0u {
            met.slip = away - met.normal * dot(met.normal, away);
        }
    }
    return met;
}

// Forces on the tissue [N]: with friction, and the normal one alone.
struct Felt {
    force: vec3f,
    pressed: f32,
}

fn felt_of(touching: Touching, met: Met) -> Felt {
    let law = tools.kinds[tool_of(touching.marks)].law;
    let k = touching.stiffness * law.y;
    let gap = max(law.z - met.distance, 0.0);
    let deep = max(gap - 0.5 * law.z, 0.0);
    let pressed = (k * gap + (SECOND_STAGE - 1.0) * k * deep) * met.slope;
    var felt = Felt(met.normal * pressed, pressed);
    let limit = touching.friction.w;
    if limit > 0.0 {
        let length = length_of(met.slip);
        let gives_way = k * length > limit;
        felt.force -= met.slip * select(k, limit / select(1.0, length, gives_way), gives_way);
    }
    return felt;
}

// The curvature of the energy [N/m] along the normal, what a tie adds to it, and a bound of it across: without what may be
// negative in it.
fn stiffness_of(touching: Touching, met: Met) -> vec3f {
    let law = tools.kinds[tool_of(touching.marks)].law;
    let k = touching.stiffness * law.y;
    let gap = law.z - met.distance;
    var along = select(0.0, k, gap > 0.0);
    along += select(0.0, (SECOND_STAGE - 1.0) * k, gap > 0.5 * law.z);
    var across = 0.0;
    let limit = touching.friction.w;
    if limit > 0.0 {
        let length = length_of(met.slip);
        let gives_way = k * length > limit;
        across = select(k, limit / select(1.0, length, gives_way), gives_way);
    }
    let tie = select(0.0, across, (touching.marks & IS_TIED) != 0u);
    return vec3f(along * (met.slope * met.slope), tie, across);
}

// Half the change of the square of what is above zero; `change`: that of the number.
fn half_square_change(before: f32, after: f32, change: f32) -> f32 {
    let a = max(before, 0.0);
    let b = max(after, 0.0);
    let both = before > 0.0 && after > 0.0;
    return 0.5 * select(b - a, change, both) * (a + b);
}

// The change of the energy [J] from one place to another, `way` apart.
fn contact_change(touching: Touching, pose: u32, before: Met, after: Met, way: vec3f) -> f32 {
    let tool = tool_of(touching.marks);
    let law = tools.kinds[tool].law;
    let k = touching.stiffness * law.y;
    var nearer = before.distance - after.distance;
    if (touching.marks & HAS_PLANE) != 0u {
        nearer = -dot(before.normal, way);
    }
    let gap = law.z - before.distance;
    let later = law.z - after.distance;
    let half = 0.5 * law.z;
    var change = k * half_square_change(gap, later, nearer);
    change += (SECOND_STAGE - 1.0) * k * half_square_change(gap - half, later - half, nearer);
    let limit = touching.friction.w;
    if limit > 0.0 {
        var more = after.slip - before.slip;
        if (touching.marks & HAS_PLANE) != 0u {
            more = way;
            if (touching.marks & IS_TIED) == 0u {
                more = way - before.normal * dot(before.normal, way);
            }
        }
        change += drag_change(k, limit, before.slip, after.slip, more);
    }
    return change;
}

// Of friction from one slip to another, `more` apart.
fn drag_change(k: f32, limit: f32, before: vec3f, after: vec3f, more: vec3f) -> f32 {
    let a = length_of(before);
    let b = length_of(after);
    let squares = dot(more, before + after);
    if k * max(a, b) <= limit {
        return 0.5 * k * squares;
    }
    if k * min(a, b) > limit {
        return limit * squares / (a + b);
    }
    return friction_energy(k, limit, b) - friction_energy(k, limit, a);
}

fn friction_energy(k: f32, limit: f32, length: f32) -> f32 {
    if k * length <= limit {
        return 0.5 * k * length * length;
    }
    return limit * (length - 0.5 * limit / k);
}

fn contact_energy(touching: Touching, met: Met) -> f32 {
    let law = tools.kinds[tool_of(touching.marks)].law;
    let k = touching.stiffness * law.y;
    let gap = max(law.z - met.distance, 0.0);
    let deep = max(gap - 0.5 * law.z, 0.0);
    let energy = 0.5 * k * (gap * gap + (SECOND_STAGE - 1.0) * deep * deep);
    let limit = touching.friction.w;
    if limit > 0.0 {
        return energy + friction_energy(k, limit, length_of(met.slip));
    }
    return energy;
}

// Work [J] along the way of a tool of a force on the tissue at `arm` from its origin.
fn work_of(tool: u32, force: vec3f, arm: vec3f) -> f32 {
    return dot(force, tools.all[tool].way.xyz) + dot(cross(arm, force), tools.all[tool].turn.xyz);
}
