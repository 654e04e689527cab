//! Colouring of constraints, with cliques separated by phantom copies.
//!
//! The constraint graph has a node per constraint and an edge where two share a vertex; all
//! constraints at one vertex form a clique, so a vertex of 30 tetrahedra alone asks for 30
//! colours. Fratarcangeli and Pellacini, "Scalable Partitioning for Parallel Position Based
//! Dynamics", Computer Graphics Forum 34(2), 2015, choose the number of colours instead and break
//! the cliques that are too large: a constraint that finds no free colour gets phantom copies of
//! the vertices in conflict.
//!
//! Here one parameter spans the family:
//!
//! * one colour: every constraint has its own copies: Jacobi;
//! * a few colours: clique separation;
//! * unlimited: nothing is split: Gauss-Seidel.
//!
//! Every connected part is coloured as if it were alone.
//!
//! Invariant, checked by [`Coloring::validate`]: **no two constraints of a colour share a copy.**
//!
//! A vertex of inverse mass `w` with `k` copies gives each copy `k w`, and the copies are averaged
//! after a sweep. The mean change is then `w J^T dl` exactly, so positions and multipliers stay
//! consistent (`k` times mass splitting; averaging with mass `w` would weaken the body).

use crate::settings::Colors;
use crate::sorting;

/// A colour for each constraint and a copy for each of its corners.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Coloring {
    /// Number of colours used.
    pub color_count: u32,
    /// Colour of each constraint, shape [constraint_count].
    pub color_of: Vec<u32>,
    /// Copy of each corner, in the order of the corners given, shape [corner_count].
    pub copy_of: Vec<u32>,
    /// Copies of vertex `v` are `copy_offsets[v] .. copy_offsets[v + 1]`, shape
    /// [vertex_count + 1]. At least one copy each.
    pub copy_offsets: Vec<u32>,
    /// Size of the largest clique: the most constraints at one vertex.
    pub largest_clique: u32,
}

/// The corners of all constraints: constraint `c` acts on `corners[offsets[c]..offsets[c + 1]]`.
#[derive(Clone, Debug, Default)]
pub struct ConstraintGraph {
    offsets: Vec<u32>,
    corners: Vec<u32>,
}

impl ConstraintGraph {
    /// An empty graph.
    pub fn new() -> Self {
        Self { offsets: vec![0], corners: Vec::new() }
    }

    /// Adds a constraint between vertices.
    pub fn push(&mut self, vertices: &[u32]) {
        self.corners.extend_from_slice(vertices);
        self.offsets.push(self.corners.len() as u32);
    }

    /// Number of constraints.
    pub fn constraint_count(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Where the corners of a constraint stand in corner order.
    pub fn corner_range(&self, constraint: usize) -> std::ops::Range<usize> {
        self.offsets[constraint] as usize..self.offsets[constraint + 1] as usize
    }

    /// The vertices of a constraint.
    pub fn vertices(&self, constraint: usize) -> &[u32] {
        &self.corners[self.corner_range(constraint)]
    }

    /// The connected part of each vertex, numbered by first vertex, and how many there are.
    pub fn parts(&self, vertex_count: usize) -> (Vec<u32>, usize) {
        let mut parent: Vec<u32> = (0..vertex_count as u32).collect();
        fn root(parent: &mut [u32], mut v: u32) -> u32 {
            while parent[v as usize] != v {
                parent[v as usize] = parent[parent[v as usize] as usize];
                v = parent[v as usize];
            }
            v
        }
        for constraint in 0..self.constraint_count() {
            for pair in self.vertices(constraint).windows(2) {
                let (a, b) = (root(&mut parent, pair[0]), root(&mut parent, pair[1]));
                // The smaller root wins, so that a part's root is its first vertex whatever the order of constraints.
                parent[a.max(b) as usize] = a.min(b);
            }
        }
        let mut count = 0;
        let mut part_of = vec![0; vertex_count];
        for v in 0..vertex_count as u32 {
            // A part's root is its first vertex, so its number is known by now.
            let first = root(&mut parent, v);
            part_of[v as usize] = if first == v {
                count += 1;
                count - 1
            } else {
                part_of[first as usize]
            };
        }
        (part_of, count as usize)
    }

    /// How many constraints each vertex has.
    fn valence(&self, vertex_count: usize) -> Vec<u32> {
        let mut valence = vec![0u32; vertex_count];
        self.corners.iter().for_each(|&v| valence[v as usize] += 1);
        valence
    }

    /// Constraints whose vertices lie in many others come first: they have the fewest free
    /// colours left when they wait. Ties by index, so that the result is always the same.
    fn order(&self, valence: &[u32]) -> Vec<u32> {
        let crowding = |c: u32| -> u32 {
            self.vertices(c as usize).iter().map(|&v| valence[v as usize]).sum()
        };
        sorting::by_key(0..self.constraint_count() as u32, |c| {
            [u64::from(u32::MAX - crowding(c)), 0]
        })
    }

    /// Colours greedily with at most the wanted number of colours, connected parts independently.
    pub fn color(&self, vertex_count: usize, wanted: Colors) -> Coloring {
        let limit = match wanted {
            Colors::Unlimited => usize::MAX,
            Colors::Limited(count) => count.max(1) as usize,
        };
        let valence = self.valence(vertex_count);

        // used[v][color]: how many constraints of that colour act on v; copies[v]: the largest.
        let mut used: Vec<Vec<u32>> = vec![Vec::new(); vertex_count];
        let mut copies = vec![1u32; vertex_count];
        // Per part: how many constraints each open colour has.
        let (part_of, part_count) = self.parts(vertex_count);
        let mut loads: Vec<Vec<u32>> = vec![Vec::new(); part_count];
        let mut color_of = vec![0u32; self.constraint_count()];
        let mut local_copy = vec![0u32; self.corners.len()];

        for constraint in self.order(&valence) {
            let vertices = self.vertices(constraint as usize);
            let Some(&first) = vertices.first() else { continue };
            let load = &mut loads[part_of[first as usize] as usize];
            let taken =
                |v: u32, color: usize| -> u32 { used[v as usize].get(color).copied().unwrap_or(0) };
            // A copy that no constraint of this colour uses yet is no conflict: it was made for another colour.
            let conflicts = |color: usize| {
                vertices.iter().filter(|&&v| taken(v, color) >= copies[v as usize]).count()
            };
            // Fewest conflicts first. Among equals Gauss-Seidel takes the lowest colour (fewest colours); a limited
            // number is filled evenly (equal work). A new colour opens only where every open one conflicts.
            let mut best = (usize::MAX, u32::MAX, 0);
            for color in 0..load.len() {
                let weight = if limit == usize::MAX { 0 } else { load[color] };
                best = best.min((conflicts(color), weight, color));
                if limit == usize::MAX && best.0 == 0 {
                    break;
                }
            }
            let color = if best.0 > 0 && load.len() < limit {
                load.push(0);
                load.len() - 1
            } else {
                best.2
            };
            load[color] += 1;
            color_of[constraint as usize] = color as u32;
            for corner in self.corner_range(constraint as usize) {
                let v = self.corners[corner] as usize;
                if used[v].len() <= color {
                    used[v].resize(color + 1, 0);
                }
                // The n-th constraint of a colour at `v` acts on copy n: two of one colour never on the same one.
                local_copy[corner] = used[v][color];
                used[v][color] += 1;
                copies[v] = copies[v].max(used[v][color]);
            }
        }

        let mut copy_offsets = Vec::with_capacity(vertex_count + 1);
        copy_offsets.push(0u32);
        for count in &copies {
            copy_offsets.push(copy_offsets.last().copied().unwrap_or(0) + count);
        }
        let copy_of = local_copy
            .iter()
            .zip(&self.corners)
            .map(|(&local, &v)| copy_offsets[v as usize] + local)
            .collect();
        Coloring {
            color_count: loads.iter().map(Vec::len).max().unwrap_or(0) as u32,
            color_of,
            copy_of,
            copy_offsets,
            largest_clique: valence.iter().copied().max().unwrap_or(0),
        }
    }
}

impl Coloring {
    /// One colour, and nothing split: for constraints that get colours elsewhere.
    pub(crate) fn unsplit(graph: &ConstraintGraph, vertex_count: usize) -> Self {
        Self {
            color_count: 1,
            color_of: vec![0; graph.constraint_count()],
            copy_of: graph.corners.clone(),
            copy_offsets: (0..=vertex_count as u32).collect(),
            largest_clique: graph.valence(vertex_count).into_iter().max().unwrap_or(0),
        }
    }

    /// Number of copies of all vertices together.
    pub fn copy_count(&self) -> usize {
        self.copy_offsets.last().map_or(0, |&count| count as usize)
    }

    /// True where at least one vertex has more than one copy.
    pub fn is_split(&self) -> bool {
        self.copy_count() + 1 > self.copy_offsets.len()
    }

    /// The first two constraints of one colour that share a copy, or of a corner whose copy is
    /// not its vertex's; `None` where the invariant holds.
    pub fn validate(&self, graph: &ConstraintGraph) -> Option<(usize, usize)> {
        let color = |c: u32| [u64::from(self.color_of[c as usize]), 0];
        let order = sorting::by_key(0..graph.constraint_count() as u32, color);
        let mut last_user = vec![usize::MAX; self.copy_count()];
        for constraint in order.into_iter().map(|c| c as usize) {
            for corner in graph.corner_range(constraint) {
                let copy = self.copy_of[corner];
                let v = graph.corners[corner] as usize;
                if !(self.copy_offsets[v]..self.copy_offsets[v + 1]).contains(&copy) {
                    return Some((constraint, constraint));
                }
                let user = last_user[copy as usize];
                if user != usize::MAX && self.color_of[user] == self.color_of[constraint] {
                    return Some((user, constraint));
                }
                last_user[copy as usize] = constraint;
            }
        }
        None
    }
}
