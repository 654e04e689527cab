// Meetings by triangles, of one by their numbers: a stable radix sort by one workgroup, of the few that are in force.
//
//   entries (triangle, meeting) in a row;   for each digit of the triangle, from the lowest: how many of each digit every thread has,
//   where those begin, and there each of them in its turn
//
// Every thread has a piece of the row of its own, so that equal triangles stay in their order. Nothing depends on who comes first.

const SORTERS: u32 = 128u;
const DIGITS: u32 = 16u;

// Of each digit what every thread has, then where it begins.
var<workgroup> digit_places: array<u32, 2048>;
var<workgroup> sums_of: array<u32, 128>;
var<workgroup> entry_count: u32;

// What all threads before this one have together.
fn sum_before(given: u32, local: u32) -> u32 {
    workgroupBarrier();
    sums_of[local] = given;
    workgroupBarrier();
    for (var ahead = 1u; ahead < SORTERS; ahead *= 2u) {
        var other = 0u;
        if local >= ahead {
            other = sums_of[local - ahead];
        }
        workgroupBarrier();
        sums_of[local] += other;
        workgroupBarrier();
    }
    return sums_of[local] - given;
}

// Entries of `job.count` meetings that are in force, in their order.
fn gather_entries(local: u32) -> u32 {
    let each = (job.count + SORTERS - 1u) / SORTERS;
    let first = min(local * each, job.count);
    let end = min(first + each, job.count);
    var own = 0u;
    for (var i = first; i < end; i++) {
        own += select(0u, 1u, loads[meeting_at(i)].w != 0.0);
    }
    var place = sum_before(own, local);
    if local == SORTERS - 1u {
        entry_count = place + own;
    }
    for (var i = first; i < end; i++) {
        let triangle = loads[meeting_at(i)].w;
        if triangle != 0.0 {
            loads[skin(SKIN_SORTED) + place] = vec4f(triangle - 1.0, f32(i), 0.0, 0.0);
            place++;
        }
    }
    return workgroupUniformLoad(&entry_count);
}

fn digit_of(entry: u32, shift: u32) -> u32 {
    return (u32(loads[entry].x) >> shift) % DIGITS;
}

fn sort_by_digit(count: u32, shift: u32, start: u32, into: u32, local: u32) {
    let each = (count + SORTERS - 1u) / SORTERS;
    let first = min(local * each, count);
    let end = min(first + each, count);
    for (var digit = 0u; digit < DIGITS; digit++) {
        digit_places[SORTERS * digit + local] = 0u;
    }
    for (var i = first; i < end; i++) {
        digit_places[SORTERS * digit_of(start + i, shift) + local]++;
    }
    workgroupBarrier();
    // In a row digit by digit: each thread has sixteen of them.
    var own = 0u;
    for (var k = 0u; k < DIGITS; k++) {
        own += digit_places[DIGITS * local + k];
    }
    var place = sum_before(own, local);
    for (var k = 0u; k < DIGITS; k++) {
        let count_of_digit = digit_places[DIGITS * local + k];
        digit_places[DIGITS * local + k] = place;
        place += count_of_digit;
    }
    workgroupBarrier();
    for (var i = first; i < end; i++) {
        let at = SORTERS * digit_of(start + i, shift) + local;
        loads[into + digit_places[at]] = loads[start + i];
        digit_places[at]++;
    }
}

// Of each triangle that is met where its entries are.
fn put_ranges(count: u32, local: u32) {
    let sorted = skin(SKIN_SORTED);
    for (var i = local; i < count; i += SORTERS) {
        let triangle = loads[sorted + i].x;
        if i > 0u && loads[sorted + max(i, 1u) - 1u].x == triangle {
            continue;
        }
        var end = i + 1u;
        while end < count && loads[sorted + end].x == triangle {
            end++;
        }
        loads[range_at(u32(triangle))] = vec4f(f32(i), f32(end), 0.0, 0.0);
    }
}

// One workgroup; `job.set_first` digits, an even number.
@compute @workgroup_size(128)
fn sort_meetings(@builtin(local_invocation_index) local: u32) {
    let count = gather_entries(local);
    if count == 0u {
        return;
    }
    for (var turn = 0u; turn < job.set_first; turn++) {
        storageBarrier();
        workgroupBarrier();
        let is_odd = turn % 2u == 1u;
        let start = select(skin(SKIN_SORTED), skin(SKIN_SORTED_TOO), is_odd);
        let into = select(skin(SKIN_SORTED_TOO), skin(SKIN_SORTED), is_odd);
        sort_by_digit(count, DIGIT_BITS * turn, start, into, local);
    }
    storageBarrier();
    workgroupBarrier();
    put_ranges(count, local);
}
