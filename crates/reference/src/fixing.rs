//! Whether a body can be at rest at all: one that can drift or turn freely has no static solution.

use viscera::scalar::Vec3;
use viscera::solver::Inputs;

use super::problem::Problem;

/// A part of the problem that nothing holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Loose {
    /// One of its vertices.
    pub vertex: u32,
    /// True where something holds it, but not against turning.
    pub turns: bool,
}

/// The first connected part of tissue that fewer than three points out of line hold: pins,
/// attachments, or springs from other parts. Parts that only springs hold must hang, through them,
/// on something fixed.
pub fn find_loose(
    problem: &Problem,
    inputs: &Inputs<f64>,
    pinned: &[bool],
    x: &[Vec3<f64>],
) -> Option<Loose> {
    let count = problem.vertex_count();
    let (mut tissue, mut all) = (Groups::new(count), Groups::new(count));
    let linear = problem.linear.nodes.iter().map(|nodes| nodes.as_slice());
    let quadratic = problem.quadratic.nodes.iter().map(|nodes| nodes.as_slice());
    let recovered = problem.recovered.nodes.iter().map(|nodes| nodes.as_slice());
    for nodes in linear.chain(quadratic).chain(recovered) {
        for &node in &nodes[1..] {
            tissue.join(nodes[0], node);
            all.join(nodes[0], node);
        }
    }
    for spring in &problem.springs {
        all.join(spring.ends[0], spring.ends[1]);
    }
    let mut held: Vec<(u32, u32)> = Vec::new();
    let mut fixed = vec![false; count];
    let tethered = inputs.tethers.iter().filter(|tether| tether.stiffness > 0.0);
    let attached = (problem.attachments.iter().map(|attachment| attachment.vertex))
        .chain(tethered.map(|tether| tether.vertex));
    let pins = (0..count as u32).filter(|&v| pinned[v as usize]);
    for vertex in pins.chain(attached) {
        held.push((tissue.group(vertex), vertex));
        fixed[all.group(vertex) as usize] = true;
    }
    for spring in &problem.springs {
        let [a, b] = spring.ends.map(|v| tissue.group(v));
        if a != b {
            held.extend([(a, spring.ends[0]), (b, spring.ends[1])]);
        }
    }
    held.sort_unstable();
    for vertex in 0..count as u32 {
        let group = tissue.group(vertex);
        // Each part is looked at once, at its first vertex.
        if group != vertex || pinned[vertex as usize] && tissue.size(vertex) == 1 {
            continue;
        }
        if !fixed[all.group(vertex) as usize] {
            return Some(Loose { vertex, turns: false });
        }
        let first = held.partition_point(|&(g, _)| g < group);
        let last = held.partition_point(|&(g, _)| g <= group);
        let places: Vec<_> = held[first..last].iter().map(|&(_, v)| x[v as usize]).collect();
        if tissue.size(vertex) > 1 && are_in_line(&places) {
            return Some(Loose { vertex, turns: true });
        }
    }
    None
}

/// Points on one line leave a body free to turn about it.
fn are_in_line(points: &[Vec3<f64>]) -> bool {
    let Some(&first) = points.first() else { return true };
    let from_first = |p: &Vec3<f64>| *p - first;
    let Some(farthest) =
        points.iter().map(from_first).max_by(|a, b| a.length().total_cmp(&b.length()))
    else {
        return true;
    };
    let area = |p: &Vec3<f64>| from_first(p).cross(farthest).length();
    let widest = points.iter().map(area).fold(0.0, f64::max);
    widest <= 1e-9 * farthest.length_squared()
}

/// Disjoint sets; a set's smallest vertex stands for it.
struct Groups {
    parent: Vec<u32>,
    size: Vec<u32>,
}

impl Groups {
    fn new(count: usize) -> Self {
        Self { parent: (0..count as u32).collect(), size: vec![1; count] }
    }

    fn group(&mut self, mut vertex: u32) -> u32 {
        while self.parent[vertex as usize] != vertex {
            let above = self.parent[self.parent[vertex as usize] as usize];
            self.parent[vertex as usize] = above;
            vertex = above;
        }
        vertex
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.group(a), self.group(b));
        if a != b {
            let (low, high) = (a.min(b), a.max(b));
            self.parent[high as usize] = low;
            self.size[low as usize] += self.size[high as usize];
        }
    }

    fn size(&mut self, vertex: u32) -> u32 {
        let group = self.group(vertex);
        self.size[group as usize]
    }
}
