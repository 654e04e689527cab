//! Which triangles may be near which samples: a tree of boxes and of cones of normals over the skin.
//!
//! ```text
//! node: the box of its triangles;  axis a and chord r of their normals:  |n - a| <= r
//! samples of a node meet nothing in a node where
//!   gap of boxes > reach        or        r_s + |a_s - a| + r <= 1, for then  n_s.n = 1 - |n_s - n|^2/2 >= 1/2  for all of them
//!   or  gap > depth  and all samples behind all triangles, or turned away from them    (`bounds.rs`)
//! candidates of a node: what is left of its parent's, as small as the node itself;  of a leaf: its list
//! ```
//!
//! Cones: Volino and Magnenat-Thalmann, "Efficient self-collision detection on smoothly discretized surface animations using
//! geometrical shape regularity", 1994. Most of a smooth organ's own skin is beside any other part of it or behind it, and is left
//! out in a few nodes. What remains is a list of leaves for each leaf. It is good until points or normals have gone further than
//! the margins with which it was made, and decides what is looked at, never what is found: of all triangles within reach the
//! nearest one counts, of several the lowest, each where it is now.

mod bounds;
mod build;
mod moment;
mod nearest;

pub use bounds::FACES;
pub use moment::SkinNow;
pub use nearest::Query;

use super::skin::Site;
use crate::scalar::Vec3;
use bounds::{Cone, Patch, Span};
use std::ops::Range;

/// Surfaces do not meet where the product of their outward normals is no less than this, at an angle of up to 60 degrees.
pub const BESIDE: f64 = 0.5;

/// More than rounding makes of sums of ways [m].
const ROUNDING: f64 = 1e-9;

/// No leaf, or no body.
const NONE: u32 = u32::MAX;

#[derive(Clone, Copy, Debug, PartialEq)]
struct Node {
    /// Of its triangles.
    patch: Patch,
    /// Of its triangles, in the order of leaves.
    first: u32,
    count: u32,
    /// The node behind all that are below it.
    end: u32,
    /// The number of the leaf, or [`NONE`].
    leaf: u32,
    /// The body of its triangles, or [`NONE`] where there are several.
    body: u32,
}

/// What each of a skin's leaves may meet.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tree {
    /// Triangles in the order of leaves.
    order: Vec<u32>,
    /// Parents before their children, the first child right behind.
    nodes: Vec<Node>,
    /// Of each node's samples, empty where it has none.
    of_samples: Vec<Patch>,
    /// The node of each leaf.
    leaves: Vec<u32>,
    /// The leaf of each sample, or [`NONE`].
    leaf_of: Vec<u32>,
    /// Samples by leaf, and the first of each leaf and the end of the last.
    samples: Vec<u32>,
    first_sample: Vec<u32>,
    /// Nodes of leaves that each leaf's samples may meet: all where there is no room for a list.
    lists: Vec<Near>,
    near: Vec<u32>,
    /// How many of those are in use.
    used: usize,
    /// Nodes that the samples of a node, and of those above it, may meet.
    stack: Vec<u32>,
    /// For what lists were made; nothing before.
    wanted: Option<Wanted>,
    since: Since,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Near {
    first: u32,
    end: u32,
    is_full: bool,
}

/// What lists are made for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wanted {
    /// Whether a body meets itself.
    pub itself: bool,
    /// Whether bodies meet each other.
    pub bodies: bool,
    /// Queries reach so far [m].
    pub reach: f64,
    /// No sample meets a triangle that it is deeper behind than this [m]: of its own body, of another.
    pub depths: [f64; 2],
    /// Lists are good while points move by no more than half of this [m],
    pub margin: f64,
    /// and while no normal turns by a longer chord than this.
    pub turn: f64,
}

impl Wanted {
    /// Whether samples of a body, or of several, look at triangles of a body, or of several.
    fn takes(&self, body: u32, other: u32) -> bool {
        match (body, other) {
            (NONE, _) | (_, NONE) => self.itself || self.bodies,
            _ if body == other => self.itself,
            _ => self.bodies,
        }
    }
}

/// How deep a sample of a body, or of several, may be behind triangles of a body, or of several.
fn depth([own, others]: [f64; 2], body: u32, other: u32) -> f64 {
    match (body, other) {
        (NONE, _) | (_, NONE) => own.max(others),
        _ if body == other => own,
        _ => others,
    }
}

/// What has happened since lists were made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Since {
    /// All points have moved by this [m],
    pub drift: Vec3<f64>,
    /// and none further than this beside it [m].
    pub moved: f64,
    /// No normal has turned by a longer chord.
    pub turned: f64,
}

impl Default for Since {
    fn default() -> Self {
        Self { drift: Vec3::ZERO, moved: 0.0, turned: 0.0 }
    }
}

impl Tree {
    /// The leaf of a sample, none where no triangle is at it.
    pub fn leaf_of(&self, sample: u32) -> u32 {
        self.leaf_of[sample as usize]
    }

    /// Triangles in the order of leaves.
    #[cfg(feature = "gpu")]
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// For a device: of each node the one behind all that are below it, its first triangle in the order of leaves and their
    /// number, zero where it is no leaf, and its body or `u32::MAX`; then nodes by their height over the leaves.
    #[cfg(feature = "gpu")]
    pub fn rows(&self) -> (Vec<[u32; 4]>, Vec<Vec<u32>>) {
        let mut heights = vec![0; self.nodes.len()];
        let mut levels: Vec<Vec<u32>> = Vec::new();
        for place in (0..self.nodes.len()).rev() {
            let height = self.children(place).map_or(0, |[a, b]| 1 + heights[a].max(heights[b]));
            heights[place] = height;
            levels.resize(levels.len().max(height + 1), Vec::new());
            levels[height].push(place as u32);
        }
        let row = |node: &Node| {
            let count = if node.leaf == NONE { 0 } else { node.count };
            [node.end, node.first, count, node.body]
        };
        (self.nodes.iter().map(row).collect(), levels)
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        let numbers = [&self.order, &self.leaves, &self.leaf_of, &self.samples, &self.first_sample];
        numbers.map(|all| size_of_val(&all[..])).iter().sum::<usize>()
            + size_of_val(&self.nodes[..])
            + size_of_val(&self.lists[..])
            + size_of_val(&self.of_samples[..])
            + size_of_val(&self.near[..])
            + size_of_val(&self.stack[..])
    }

    /// Says what has happened since lists were made. True where they are as good for queries that reach so far [m].
    pub fn has_lists(&mut self, reach: f64, since: Since) -> bool {
        self.since = since;
        let closer = 2.0 * (since.moved + ROUNDING);
        self.wanted.is_some_and(|wanted| {
            reach <= wanted.reach && closer <= wanted.margin && since.turned <= wanted.turn
        })
    }

    /// Whether no sample may meet anything.
    pub fn is_clear(&self) -> bool {
        self.lists.iter().all(|near| !near.is_full && near.first == near.end)
    }

    /// Whether samples of a leaf meet nothing.
    pub fn meets_nothing(&self, leaf: u32) -> bool {
        let near = self.lists.get(leaf as usize);
        near.is_none_or(|near| !near.is_full && near.first == near.end)
    }

    /// Makes lists of what samples may meet. Takes no memory.
    pub fn list(&mut self, now: SkinNow<'_>, wanted: Wanted) {
        self.refit(now, wanted.turn);
        self.take_samples(now, wanted.turn);
        self.used = 0;
        self.lists.fill(Near::default());
        if let Some(root) = self.stack.first_mut() {
            *root = 0;
            self.descend(0, 0..1, &wanted);
        }
        self.wanted = Some(wanted);
        self.since = Since::default();
    }

    /// Boxes and cones of where triangles are, while no normal turns by a longer chord than this.
    pub fn refit(&mut self, now: SkinNow<'_>, turn: f64) {
        for place in (0..self.nodes.len()).rev() {
            let node = self.nodes[place];
            self.nodes[place].patch = match self.children(place) {
                Some([first, second]) => self.nodes[first].patch.join(&self.nodes[second].patch),
                None => self.patch_of(now, &node, turn),
            };
        }
    }

    /// Of where samples are.
    fn take_samples(&mut self, now: SkinNow<'_>, turn: f64) {
        for place in (0..self.nodes.len()).rev() {
            self.of_samples[place] = match self.children(place) {
                Some([first, second]) => self.of_samples[first].join(&self.of_samples[second]),
                None => self.samples_of(now, self.nodes[place].leaf, turn),
            };
        }
    }

    /// The two nodes that a node consists of; a leaf has none.
    fn children(&self, place: usize) -> Option<[usize; 2]> {
        let first = place + 1;
        (self.nodes[place].leaf == NONE).then(|| [first, self.nodes[first].end as usize])
    }

    /// Of a leaf's triangles.
    fn patch_of(&self, now: SkinNow<'_>, node: &Node, turn: f64) -> Patch {
        let own = &self.order[node.range()];
        let spans = own.iter().map(|&triangle| now.triangle_span(triangle));
        let normals = own.iter().map(|&triangle| (now.normals[triangle as usize], turn));
        Patch { span: spans.fold(Span::NOTHING, Span::join), cone: Cone::around(normals) }
    }

    /// Of a leaf's samples.
    fn samples_of(&self, now: SkinNow<'_>, leaf: u32, turn: f64) -> Patch {
        let own = self.samples_in(leaf);
        let span =
            own.iter().fold(Span::NOTHING, |span, &sample| match now.skin.sites[sample as usize] {
                Site::Triangle(triangle) => span.join(now.triangle_span(triangle)),
                Site::Point(point) => span.with(now.at[point as usize]),
            });
        Patch { span, cone: Cone::around(own.iter().map(|&sample| now.outward(sample, turn))) }
    }

    fn samples_in(&self, leaf: u32) -> &[u32] {
        let [first, end] = [0, 1].map(|k| self.first_sample[leaf as usize + k] as usize);
        &self.samples[first..end]
    }

    /// Lists of all leaves below a node whose samples may meet no more than these places of the stack.
    fn descend(&mut self, place: usize, candidates: Range<usize>, wanted: &Wanted) {
        let node = self.nodes[place];
        let samples = self.of_samples[place];
        if samples.is_empty() {
            return;
        }
        let mut end = candidates.end;
        let mut has_room = true;
        for candidate in candidates.clone() {
            let mut other = self.stack[candidate] as usize;
            let last = self.nodes[other].end as usize;
            // Down the tree below the candidate, as far as nodes are larger than this one.
            while other < last {
                let met = &self.nodes[other];
                if wanted.leaves_out((node.body, &samples), met) {
                    other = met.end as usize;
                } else if met.leaf == NONE && (node.leaf != NONE || met.count > node.count) {
                    other += 1;
                } else {
                    let next = met.end as usize;
                    match self.stack.get_mut(end) {
                        Some(free) => *free = other as u32,
                        None => has_room = false,
                    }
                    end += 1;
                    other = next;
                }
            }
        }
        has_room &= node.leaf == NONE || self.used + end - candidates.end <= self.near.len();
        if !has_room {
            let leaves = self.leaves.partition_point(|&leaf| (leaf as usize) < place);
            let count = self.leaves[leaves..].partition_point(|&leaf| leaf < node.end);
            let full = Near { is_full: true, ..Near::default() };
            self.lists[leaves..leaves + count].fill(full);
        } else if node.leaf != NONE {
            let first = self.used as u32;
            for candidate in candidates.end..end {
                self.near[self.used] = self.stack[candidate];
                self.used += 1;
            }
            let end = self.used as u32;
            self.lists[node.leaf as usize] = Near { first, end, is_full: false };
        } else if end > candidates.end {
            for child in self.children(place).into_iter().flatten() {
                self.descend(child, candidates.end..end, wanted);
            }
        }
    }
}

impl Wanted {
    /// Whether samples of a body, or of several, meet nothing of a node.
    fn leaves_out(&self, (body, samples): (u32, &Patch), other: &Node) -> bool {
        if !self.takes(body, other.body) {
            return true;
        }
        let gap = other.patch.span.gap(&samples.span);
        let far = self.reach + self.margin;
        let deep = depth(self.depths, body, other.body) + self.margin;
        // Comparisons with a NaN are false: such a place leaves nothing out.
        gap > far * far
            || other.patch.cone.is_beside(&samples.cone)
            || (gap > deep * deep && samples.is_averted(&other.patch, self.reach, self.margin))
    }
}

impl Node {
    fn range(&self) -> Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }
}

#[cfg(test)]
mod tests;
