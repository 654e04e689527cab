// Nothing is split: a sweep works on the vertices themselves.
fn swept_corners(block: u32, lane: u32) -> array<u32, 4> {
    return vertices_of(block, lane);
}
