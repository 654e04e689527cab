// The long vector of all unknowns, part by part. A workgroup works on one part: on numbers of the vector that
// the part has in a model of its own, so that their order, and with it every sum, is that of the part alone.

struct Span {
    part: u32,
    // Which of the part's workgroups, and how many it has.
    group: u32,
    groups: u32,
    // Numbers of its vector.
    length: u32,
}

// Padding between positions and multipliers.
const NOWHERE: u32 = 0xffffffffu;

// The first of a part's workgroups.
fn first_group(part: u32) -> u32 {
    if part == 0u {
        return 0u;
    }
    return table[part_row(part - 1u) + PART_GROUPS_END];
}

// `groups` is zero where there is nothing left to do.
fn span_of(workgroup: vec3u, groups: vec3u) -> Span {
    let number = workgroup.x + workgroup.y * groups.x;
    let part = part_with(PART_GROUPS_END, number);
    let row = part_row(part);
    let first = first_group(part);
    let end = table[row + PART_GROUPS_END];
    return Span(part, number - first, select(0u, end - first, number < end), table[row + PART_LENGTH]);
}

// Where number `j` of a part's vector stands in that of all.
fn number_at(part: u32, j: u32) -> u32 {
    let row = part_row(part);
    var low = table[row + PART_RUNS];
    var high = table[row + PART_RUNS_END] - 1u;
    while low < high {
        let middle = (low + high + 1u) / 2u;
        if table[table[RUNS_AT] + 2u * middle] <= j {
            low = middle;
        } else {
            high = middle - 1u;
        }
    }
    let run = table[RUNS_AT] + 2u * low;
    return select(table[run + 1u] + (j - table[run]), NOWHERE, table[run + 1u] == NOWHERE);
}
