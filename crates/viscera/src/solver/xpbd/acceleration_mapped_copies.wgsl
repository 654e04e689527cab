// The sweep has left positions in copies: here they are joined, as `join_copies` does. Where a vertex's
// copies begin stands in the place of its fourth weight.
fn mapped_value(i: u32) -> f32 {
    let value = unknowns[i];
    if i >= job.first {
        return value;
    }
    let own = i | 3u;
    if own + 4u >= job.first {
        return value;
    }
    let begin = table[table[WEIGHTS_AT] + own];
    let first = begin & ~WHOLE;
    let end = table[table[WEIGHTS_AT] + own + 4u] & ~WHOLE;
    if end <= first {
        return value;
    }
    if (begin & WHOLE) != 0u {
        unknowns[i] = copies[first][i & 3u];
        return unknowns[i];
    }
    var sum = 0.0;
    for (var copy = first; copy < end; copy++) {
        sum += copies[copy][i & 3u] - value;
    }
    let joined = value + sum * (1.0 / f32(end - first));
    unknowns[i] = joined;
    return joined;
}
