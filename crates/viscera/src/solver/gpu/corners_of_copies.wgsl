// A sweep works on the copies of the vertices.
fn swept_corners(block: u32, lane: u32) -> array<u32, 4> {
    return indices_of(block, lane);
}
