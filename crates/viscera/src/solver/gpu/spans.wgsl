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

// A run of a part's vector: its numbers `begin..end` stand in that of all from `at` on.
struct Run {
    begin: u32,
    end: u32,
    at: u32,
}

// The run that holds number `j` of a part.
fn run_with(part: u32, j: u32) -> Run {
    let row = part_row(part);
    let last = table[row + PART_RUNS_END] - 1u;
    var low = table[row + PART_RUNS];
    var high = last;
    while low < high {
        let middle = (low + high + 1u) / 2u;
        if table[table[RUNS_AT] + 2u * middle] <= j {
            low = middle;
        } else {
            high = middle - 1u;
        }
    }
    let run = table[RUNS_AT] + 2u * low;
    var end = table[row + PART_LENGTH];
    if low < last {
        end = table[run + 2u];
    }
    return Run(table[run], end, table[run + 1u]);
}

// Where number `j` of a part's vector stands in that of all. A thread's numbers ascend and runs are long, so that it
// searches rarely; it begins with `Run()`.
fn number_at(run: ptr<function, Run>, part: u32, j: u32) -> u32 {
    if j >= (*run).end {
        *run = run_with(part, j);
    }
    return select((*run).at + (j - (*run).begin), NOWHERE, (*run).at == NOWHERE);
}
