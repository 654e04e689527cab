//! Winding neighbours alike.

/// Elements that hang together by a common side, each with whether it has to be turned to be wound as the first of its part.
pub type Part = Vec<(u32, bool)>;

/// The parts that `count` elements form. A pair of neighbours is told by their numbers and whether they are wound alike. Where
/// pairs contradict each other, as on a Moebius strip, the first way to an element counts.
pub fn parts(count: usize, neighbors: &[([u32; 2], bool)]) -> Vec<Part> {
    let both = |&([a, b], alike): &([u32; 2], bool)| [(a, b, alike), (b, a, alike)];
    let mut pairs: Vec<(u32, u32, bool)> = neighbors.iter().flat_map(both).collect();
    pairs.sort_unstable();
    let mut reached = vec![false; count];
    let mut parts = Vec::new();
    for start in 0..count {
        if reached[start] {
            continue;
        }
        reached[start] = true;
        let (mut part, mut at) = (vec![(start as u32, false)], 0);
        while let Some(&(element, is_turned)) = part.get(at) {
            at += 1;
            let first = pairs.partition_point(|pair| pair.0 < element);
            for &(_, other, alike) in pairs[first..].iter().take_while(|pair| pair.0 == element) {
                if !std::mem::replace(&mut reached[other as usize], true) {
                    part.push((other, is_turned == alike));
                }
            }
        }
        parts.push(part);
    }
    parts
}
