// Sums over the long vector of all unknowns, for the accelerations; those of products are |R_k|^2, then
// R_k . dR_j, then dR_new . dR_j.

// Numbers side by side whose sums are added up at the end. Part of the result's bits.
const THREADS: u32 = 128u;

// Sums of different products lie one number farther apart than they are long: threads that read the same place of
// different sums meet different banks of the memory.
const SUM_STRIDE: u32 = THREADS + 1u;

var<workgroup> shared_sums: array<f32, 2709>;

// The last of a vertex's four numbers is no unknown.
fn counts(i: u32) -> bool {
    return i != NOWHERE && (i >= job.first || i % 4u != 3u);
}

fn weight_of(i: u32) -> f32 {
    return number(table[WEIGHTS_AT] + i);
}
