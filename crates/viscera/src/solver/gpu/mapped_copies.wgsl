// The sweep has left positions in copies: here they are joined, as `join_copies` does. The last of a
// vertex's four weights, which is no weight, holds where its copies begin.
fn mapped_value(i: u32) -> f32 {
    let value = unknowns[i];
    if i >= job.first {
        return value;
    }
    let own = i | 3u;
    if own + 4u >= job.first {
        return value;
    }
    let first = u32(weights[own]);
    let end = u32(weights[own + 4u]);
    if end <= first {
        return value;
    }
    var sum = 0.0;
    for (var copy = first; copy < end; copy++) {
        sum += copies[copy][i & 3u] - value;
    }
    let joined = value + sum * (1.0 / f32(end - first));
    unknowns[i] = joined;
    return joined;
}
