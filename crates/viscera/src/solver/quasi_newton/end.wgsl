// The end of a step (time.rs): its energies, and what they leave to it, in two dispatches.
//
//   measure_end   E - E_ref of the last solve and of the first one, relative to x_n with its pins moved
//   end_step      the last solve, where it stores no more than there was; else the first one, else x_n;
//                 v *= sqrt(limit/T) where T exceeds the limit; without any hold relative to the center of mass
//
// The CPU takes a step again by implicit Euler that stores too much. Here it ends where the first solve has, earlier in time:
// a solve lowers its potential, so that it stores no more than there was.
//
// Pieces are measured from `job.first` on. `job.parameter`: c, one of implicit Euler, whose first solve is none.

// Sums of a piece. Of elements: changes of the energy [J] of last and first solve, the same without signs; of all: holds.
const END_STORED: u32 = 0u;
const END_SIZE: u32 = 2u;
const END_HELD: u32 = 4u;
// Of free vertices: kinetic energies [J] at the start, of the last and the first solve; their work [J]; both once more,
// relative to the first vertex of the part; mass [kg]; momentum at the start, load [N]; momenta, relative; way times mass.
const END_KINETIC_START: u32 = 5u;
const END_KINETIC: u32 = 6u;
const END_WORK: u32 = 8u;
const END_RELATIVE_START: u32 = 10u;
const END_RELATIVE: u32 = 11u;
const END_RELATIVE_WORK: u32 = 13u;
const END_MASS: u32 = 15u;
const END_MOMENTUM_START: u32 = 16u;
const END_LOAD: u32 = 19u;
const END_MOMENTUM: u32 = 24u;
const END_SHIFT: u32 = 30u;
// The velocities of the part's first vertex [m/s], which everything relative is relative to.
const END_FIRST: u32 = 36u;
// Of samples: energy [J] that tools add by moving into tissue that stands still; their work [J] by the forces at the start of the
// step, and at the ends of the last and the first solve; how many are near.
const END_LIFTED: u32 = 42u;
const END_WORK_BEFORE: u32 = 43u;
const END_WORK_AFTER: u32 = 44u;
const END_NEAR: u32 = 46u;
// Energy [J] that contact of tissue with tissue has gained because it was found anew.
const END_GAINED: u32 = 47u;

var<workgroup> is_trusted: u32;
var<workgroup> both: array<f32, 48>;

fn ends_at(piece: u32) -> u32 {
    return table[ENERGIES_AT] + 2u * SUMS * piece;
}

// The part's last direction is taken where it is trusted.
fn takes_trial(part: u32, local: u32) -> bool {
    own_share = share_of(part);
    var sums: Sums;
    add_ends(part, local, &sums);
    reduce(sums, 1u, TRIAL_MAXIMA, local);
    if local == 0u {
        is_trusted = select(0u, 1u, goes_on(part, newer_record()));
    }
    return workgroupUniformLoad(&is_trusted) != 0u;
}

// Places and velocities at the end of the last and of the first solve.
struct Ends {
    x: array<vec3f, 2>,
    v: array<vec3f, 2>,
}

fn ends_of(v: u32, is_trial: bool) -> Ends {
    let rate = 1.0 / solve_dt();
    let last = select(vertex_data_of(QN_BASE, v).xyz, points[v].xyz, is_trial);
    let first = vertex_data_of(QN_FIRST, v).xyz;
    let after = (last - vertex_data_of(QN_STAGE_START, v).xyz) * rate;
    let between = (first - vertex_data_of(PREVIOUS, v).xyz) * rate;
    return Ends(array<vec3f, 2>(last, first), array<vec3f, 2>(after, between));
}

// Where a vertex was at the start of the step, its pins moved.
fn reference(v: u32) -> vec3f {
    let is_pinned = vertex_data_of(EXTERNAL_FORCES, v).w == 0.0;
    return select(vertex_data_of(PREVIOUS, v).xyz, vertex_data_of(TARGETS, v).xyz, is_pinned);
}

fn place_at(v: u32, k: u32, is_trial: bool) -> vec3f {
    if vertex_data_of(EXTERNAL_FORCES, v).w == 0.0 {
        return vertex_data_of(TARGETS, v).xyz;
    }
    if k == 1u {
        return vertex_data_of(QN_FIRST, v).xyz;
    }
    return select(vertex_data_of(QN_BASE, v).xyz, points[v].xyz, is_trial);
}

// Change [J] of what an element stores.
fn element_change(element: u32, x: array<vec3f, 4>, way: array<vec3f, 4>) -> f32 {
    let tet_lanes = table[TET_LANES_AT];
    if element >= tet_lanes {
        let row = element_row(element - tet_lanes);
        let start = before_steps(four_of(row + ELEMENT_VERTICES));
        return element_energy_change(table[row + ELEMENT_KIND], moment_of(row, start, frame.dt), x, way);
    }
    let block = element / LANES;
    let lane = element % LANES;
    let shape = shape_of(block, lane);
    let f = deformation_gradient(x, shape);
    let d = deformation_gradient(way, shape);
    let material = tissue_of(tets[block].material[lane]);
    let lambda = material.lame_lambda;
    let mu = material.lame_mu;
    var density = law_energy_change(law_of(block), f, d, lambda, mu);
    if material.viscosity > 0.0 {
        let start = before_steps(vertices_of(block, lane));
        let strain = green_strain_strain(deformation_gradient(start, shape));
        let rate = material.viscosity * frame.inverse_dt;
        density += tissue_viscous_energy_change(f, d, tissue_change_since(f, strain), rate, lambda, mu);
    }
    return tets[block].rest_volume[lane] * density;
}

fn add_element_end(element: u32, is_trial: bool, into: ptr<function, Sums>) {
    let tet_lanes = table[TET_LANES_AT];
    if element < tet_lanes && is_recovered(element / LANES) {
        let changes = recovered_ends(element / LANES, element % LANES, is_trial);
        for (var k = 0u; k < 2u; k++) {
            (*into)[END_STORED + k] += changes[k];
            (*into)[END_SIZE + k] += abs(changes[k]);
        }
        return;
    }
    let corners = corners_of(element);
    var x: array<vec3f, 4>;
    for (var i = 0u; i < 4u; i++) {
        x[i] = reference(corners[i]);
    }
    for (var k = 0u; k < 2u; k++) {
        var way: array<vec3f, 4>;
        for (var i = 0u; i < 4u; i++) {
            way[i] = place_at(corners[i], k, is_trial) - x[i];
        }
        let change = element_change(element, x, way);
        (*into)[END_STORED + k] += change;
        (*into)[END_SIZE + k] += abs(change);
    }
    if element >= tet_lanes && element_is_anchored(table[element_row(element - tet_lanes) + ELEMENT_KIND]) {
        (*into)[END_HELD] += 1.0;
    }
}

fn add_vertex_end(
    v: u32,
    first: Ends,
    first_of_part: u32,
    is_trial: bool,
    into: ptr<function, Sums>,
    more: ptr<function, Sums>,
) {
    if vertex_data_of(EXTERNAL_FORCES, v).w == 0.0 {
        (*into)[END_HELD] += 1.0;
        return;
    }
    let he = solve_dt();
    let hold = vertex_data_of(TARGETS, v);
    // Springs at single vertices are taken out of the inertia again: what they store counts as work.
    let mass = max(vertex_data_of(PREDICTED, v).w - hold.w * (he * he), 0.0);
    let load = frame.gravity * mass + vertex_data_of(EXTERNAL_FORCES, v).xyz;
    let start = vertex_data_of(PREVIOUS, v).xyz;
    let before = vertex_data_of(QN_START_VELOCITIES, v).xyz;
    let relative_before = before - vertex_data_of(QN_START_VELOCITIES, first_of_part).xyz;
    let first_start = vertex_data_of(PREVIOUS, first_of_part).xyz;
    let ends = ends_of(v, is_trial);
    (*into)[END_HELD] += select(0.0, 1.0, hold.w > 0.0);
    (*into)[END_KINETIC_START] += 0.5 * mass * dot(before, before);
    (*into)[END_RELATIVE_START] += 0.5 * mass * dot(relative_before, relative_before);
    (*into)[END_MASS] += mass;
    for (var k = 0u; k < 2u; k++) {
        let moved = ends.x[k] - start;
        let relative = ends.v[k] - first.v[k];
        let relative_moved = moved - (first.x[k] - first_start);
        let springs = 0.5 * hold.w * dot(moved, (ends.x[k] - hold.xyz) + (start - hold.xyz));
        (*into)[END_KINETIC + k] += 0.5 * mass * dot(ends.v[k], ends.v[k]);
        (*into)[END_WORK + k] += dot(load, moved) - springs;
        (*into)[END_RELATIVE + k] += 0.5 * mass * dot(relative, relative);
        (*into)[END_RELATIVE_WORK + k] += dot(load, relative_moved);
        for (var axis = 0u; axis < 3u; axis++) {
            (*more)[END_MOMENTUM - SUMS + 3u * k + axis] += mass * relative[axis];
            (*more)[END_SHIFT - SUMS + 3u * k + axis] += mass * relative_moved[axis];
        }
    }
    for (var axis = 0u; axis < 3u; axis++) {
        (*into)[END_MOMENTUM_START + axis] += mass * relative_before[axis];
        (*into)[END_LOAD + axis] += load[axis];
    }
}

@compute @workgroup_size(256)
fn measure_end(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let place = workgroup.x + workgroup.y * groups.x;
    if place >= job.count {
        return;
    }
    let piece = job.first + place;
    let row = piece_row(piece);
    let part = table[row + PIECE_PART];
    let is_trial = takes_trial(part, local);
    if local == 0u && piece == table[part_row(part) + PART_VERTEX_PIECES] {
        progress[part].takes_trial = select(0u, 1u, is_trial);
    }
    var sums: Sums;
    var more: Sums;
    if table[row + PIECE_ARE_VERTICES] != 0u {
        let first = first_vertex_of(part);
        let ends = ends_of(first, is_trial);
        for (var v = table[row + PIECE_FIRST] + local; v < table[row + PIECE_END]; v += THREADS) {
            add_vertex_end(v, ends, first, is_trial, &sums, &more);
            for (var i = 0u; v == first && i < 6u; i++) {
                more[END_FIRST - SUMS + i] = ends.v[i / 3u][i % 3u];
            }
        }
    } else {
        for (var i = table[row + PIECE_FIRST] + local; i < table[row + PIECE_END]; i += THREADS) {
            let element = member(i);
            if element >= table[FIRST_MEETING_AT] {
                add_meeting_end(element - table[FIRST_MEETING_AT], is_trial, &sums, &more);
            } else if element >= table[FIRST_SAMPLE_AT] {
                add_sample_end(element - table[FIRST_SAMPLE_AT], is_trial, &sums, &more);
            } else {
                add_element_end(element, is_trial, &sums);
            }
        }
    }
    reduce(sums, SUMS / 8u, 0u, local);
    if local < SUMS {
        partial_sums[ends_at(piece) + local] = totals[local];
    }
    workgroupBarrier();
    reduce(more, SUMS / 8u, 0u, local);
    if local < SUMS {
        partial_sums[ends_at(piece) + SUMS + local] = totals[local];
    }
}

// How the step of a part ends: 0 with the last solve, 1 with the first, 2 where it began; the velocity that is not
// scaled, and the factor for velocities relative to it; what all velocities [m/s] and places [m] change by.
struct End {
    solve: u32,
    share: f32,
    drift: vec3f,
    push: vec3f,
    way: vec3f,
}

var<workgroup> end: End;

fn sum_at(sum: u32) -> vec3f {
    return vec3f(both[sum], both[sum + 1u], both[sum + 2u]);
}

// Whether anything can stop the centre of mass: a tool can, too.
fn is_held() -> bool {
    return both[END_HELD] > 0.0 || both[END_NEAR] > 0.0 || !(both[END_MASS] > 0.0);
}

// Kinetic energy [J] that is left to a solve, that which it has, and what round-off can pretend.
struct Balance {
    given: f32,
    kinetic: f32,
    noise: f32,
}

fn balance_of(k: u32) -> Balance {
    let stored = both[END_STORED + k];
    var given = both[END_KINETIC_START] + both[END_WORK + k] - stored;
    var kinetic = both[END_KINETIC + k];
    let size = both[END_SIZE + k] + both[END_KINETIC_START] + abs(both[END_WORK + k]);
    if !is_held() {
        let inverse = 1.0 / both[END_MASS];
        let before = sum_at(END_MOMENTUM_START);
        let after = sum_at(END_MOMENTUM + 3u * k);
        kinetic = both[END_RELATIVE + k] - 0.5 * inverse * dot(after, after);
        given = both[END_RELATIVE_START] - 0.5 * inverse * dot(before, before);
        given += both[END_RELATIVE_WORK + k] - inverse * dot(sum_at(END_LOAD), sum_at(END_SHIFT + 3u * k));
        given -= stored;
    }
    if both[END_NEAR] > 0.0 {
        // Tools move while the tissue stands: that bound charges the overlap that they make. The other charges what they say
        // that they do, and only forbids to gain.
        let after = both[END_WORK_AFTER + k];
        let work = max(after, 0.5 * (both[END_WORK_BEFORE] + after));
        given = min(given, max(given - both[END_LIFTED] + work, both[END_KINETIC_START]));
    }
    return Balance(given, kinetic, 8.0 * EPSILON * size);
}

fn is_possible(balance: Balance) -> bool {
    return is_finite(balance.given) && is_finite(balance.kinetic) && is_finite(balance.noise)
        && balance.given >= -balance.noise;
}

fn choose_end() -> End {
    var k = 0u;
    var balance = balance_of(0u);
    if !is_possible(balance) {
        k = 1u;
        balance = balance_of(1u);
        if !is_possible(balance) || own_share == 1.0 {
            return End(2u, 0.5, vec3f(), vec3f(), vec3f());
        }
    }
    var drift = vec3f();
    if !is_held() {
        drift = sum_at(END_FIRST + 3u * k) + sum_at(END_MOMENTUM + 3u * k) * (1.0 / both[END_MASS]);
    }
    var share = 1.0;
    // What finding triangles anew has added is nothing that the step began with.
    let given = balance.given - max(both[END_GAINED], 0.0);
    if balance.kinetic > given && balance.kinetic > 0.0 {
        share = sqrt(max(given, 0.0) / balance.kinetic);
    }
    return End(k, share, drift, vec3f(), vec3f());
}

// What of the momentum a solve that stops early has left out where tissue meets tissue and nothing holds it (step/momentum.rs): all
// of a part moves as one, which changes no strain. Of the last solve alone: the first one ends earlier in time.
fn keep_momentum(part: u32) {
    if !has_skin() || is_held() || end.solve != 0u {
        return;
    }
    let first = first_vertex_of(part);
    let inverse = 1.0 / both[END_MASS];
    let before = vertex_data_of(QN_START_VELOCITIES, first).xyz + sum_at(END_MOMENTUM_START) * inverse;
    let gained = sum_at(END_LOAD) * (inverse * frame.dt);
    // Where the part's first vertex is now other workgroups may have changed already.
    let stage = vertex_data_of(QN_STAGE_START, first).xyz - vertex_data_of(PREVIOUS, first).xyz;
    let moved = stage + sum_at(END_FIRST) * solve_dt() + sum_at(END_SHIFT) * inverse;
    let share = select(0.5, 1.0, own_share == 1.0);
    end.push = before - end.drift + gained;
    end.way = (before + gained * share) * frame.dt - moved;
}

// Vertices, piece by piece: `job.first` is the first of these.
@compute @workgroup_size(256)
fn end_step(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let place = workgroup.x + workgroup.y * groups.x;
    if place >= job.count {
        return;
    }
    let piece = job.first + place;
    let row = piece_row(piece);
    let part = table[row + PIECE_PART];
    let is_trial = takes_trial(part, local);
    let count = piece_count(part);
    for (var half = 0u; half < 2u; half++) {
        var sums: Sums;
        if half == 0u {
            add_averages(part, local, &sums);
        }
        for (var i = local; i < count; i += THREADS) {
            let at = ends_at(piece_at(part, i)) + SUMS * half;
            for (var k = 0u; k < SUMS; k++) {
                sums[k] += partial_sums[at + k];
            }
        }
        reduce(sums, SUMS / 8u, 0u, local);
        if local < SUMS {
            both[SUMS * half + local] = totals[local];
        }
    }
    workgroupBarrier();
    if local == 0u {
        end = choose_end();
        keep_momentum(part);
        if piece == table[part_row(part) + PART_VERTEX_PIECES] {
            report(part);
        }
    }
    let now = workgroupUniformLoad(&end);
    for (var v = table[row + PIECE_FIRST] + local; v < table[row + PIECE_END]; v += THREADS) {
        end_vertex(v, now, is_trial);
    }
}

fn end_vertex(v: u32, now: End, is_trial: bool) {
    let stride = table[STRIDE_AT];
    let start = vertex_data_of(PREVIOUS, v).xyz;
    let ends = ends_of(v, is_trial);
    var x = ends.x[now.solve & 1u];
    var velocity = ends.v[now.solve & 1u];
    if now.solve == 2u {
        x = start;
        velocity = vertex_data_of(QN_START_VELOCITIES, v).xyz;
    }
    x += now.way;
    velocity = now.drift + (velocity - now.drift) * now.share + now.push;
    if vertex_data_of(EXTERNAL_FORCES, v).w == 0.0 {
        x = vertex_data_of(TARGETS, v).xyz;
        velocity = (x - start) * frame.inverse_dt;
    } else if now.solve == 0u && own_share != job.parameter {
        // Measures of forces take every solve for one of `he` of the others.
        let shrink = job.parameter * job.parameter;
        let predicted = vertex_data_of(PREDICTED, v);
        vertex_data[PREDICTED * stride + v] = vec4f(x - (x - predicted.xyz) * shrink, predicted.w);
    } else if now.solve != 0u {
        // Measures of forces read what the place was to be: here inertia alone.
        vertex_data[PREDICTED * stride + v] = vec4f(x, vertex_data_of(PREDICTED, v).w);
    }
    points[v] = vec4f(x, 0.0);
    vertex_data[VELOCITIES * stride + v] = vec4f(velocity, 0.0);
}

fn report(part: u32) {
    let is_rejected = select(0u, 1u, end.solve != 0u);
    let k = end.solve & 1u;
    let balance = balance_of(k);
    let squared = frame.squared_dt;
    control.parts[part].guard.potential = squared * (both[END_STORED + k] + end.share * end.share * balance.kinetic);
    control.parts[part].guard.limit = squared * (both[END_STORED + k] + balance.given);
    control.parts[part].guard.noise = squared * balance.noise;
    control.parts[part].guard.was_rejected = is_rejected;
    control.parts[part].guard.kept_speed = end.share;
    progress[part].was_rejected = is_rejected;
    progress[part].calm = select(0u, 1u, progress[part].states[newer_record()].rejections == 0u && is_rejected == 0u);
    // Counted once for all parts: only the first to exchange the number of this step finds another one.
    if is_rejected != 0u && atomicExchange(&control.rejected_step, control.step) != control.step {
        atomicAdd(&control.rejected, 1u);
    }
}
