//! The tree of a skin.

use super::bounds::{Patch, Span};
use super::{NONE, Near, Node, Tree};
use crate::contact::skin::{Site, Skin};
use crate::scalar::Vec3;
use std::ops::Range;

/// Triangles of a leaf, at most.
const LEAF: usize = 8;

/// Leaves that may be near a leaf, on average, before lists end and everything is looked at.
const ROOM: usize = 24;

/// Candidates on the way from the root to a leaf, for each leaf on average, before lists end.
const STACK: usize = 4;

impl Tree {
    /// Of a skin whose points are at these places [m]. Any places will do.
    pub fn new(skin: &Skin, at: &[Vec3<f64>]) -> Self {
        let mut tree =
            Self { order: (0..skin.triangles.len() as u32).collect(), ..Self::default() };
        let middle = |triangle: u32| {
            let corners = skin.triangles[triangle as usize].map(|point| at[point as usize]);
            (corners[0] + corners[1] + corners[2]) * (1.0 / 3.0)
        };
        if !tree.order.is_empty() {
            tree.divide(skin, &middle, 0..skin.triangles.len());
        }
        let mut of_triangles = vec![NONE; skin.triangles.len()];
        let mut of_points = vec![NONE; skin.points.len()];
        for (leaf, &node) in (0..).zip(&tree.leaves) {
            for &triangle in &tree.order[tree.nodes[node as usize].range()] {
                of_triangles[triangle as usize] = leaf;
                for point in skin.triangles[triangle as usize] {
                    of_points[point as usize] = leaf;
                }
            }
        }
        let leaf = |site: &Site| match *site {
            Site::Triangle(triangle) => of_triangles[triangle as usize],
            Site::Point(point) => of_points[point as usize],
        };
        tree.leaf_of = skin.sites.iter().map(leaf).collect();
        let numbered = tree.leaf_of.iter().zip(0..).map(|(&leaf, sample)| (leaf, sample));
        let mut of_samples: Vec<(u32, u32)> = numbered.filter(|(leaf, _)| *leaf != NONE).collect();
        of_samples.sort_unstable();
        let first = |leaf: u32| of_samples.partition_point(|(of, _)| *of < leaf) as u32;
        tree.first_sample = (0..=tree.leaves.len() as u32).map(first).collect();
        tree.samples = of_samples.into_iter().map(|(_, sample)| sample).collect();
        tree.of_samples = vec![Patch::NOTHING; tree.nodes.len()];
        tree.lists = vec![Near::default(); tree.leaves.len()];
        tree.near = vec![NONE; ROOM * tree.leaves.len()];
        tree.stack = vec![NONE; STACK * tree.leaves.len()];
        tree
    }

    /// Divides a range of triangles in two, at the middle of the direction in which they are spread most: bodies first.
    fn divide(&mut self, skin: &Skin, middle: &impl Fn(u32) -> Vec3<f64>, range: Range<usize>) {
        let own = &mut self.order[range.clone()];
        let body = |triangle: u32| skin.bodies[triangle as usize];
        let (least, most) = own.iter().fold((NONE, 0), |(least, most), &triangle| {
            (least.min(body(triangle)), most.max(body(triangle)))
        });
        let place = self.nodes.len();
        let is_leaf = own.len() <= LEAF && least == most;
        self.nodes.push(Node {
            patch: Patch::NOTHING,
            first: range.start as u32,
            count: range.len() as u32,
            end: 0,
            leaf: if is_leaf { self.leaves.len() as u32 } else { NONE },
            body: if least == most { least } else { NONE },
        });
        if is_leaf {
            self.leaves.push(place as u32);
        } else {
            let cut = if least == most {
                let span =
                    own.iter().fold(Span::NOTHING, |span, &triangle| span.with(middle(triangle)));
                let [x, y, z] = (span.high - span.low).to_array();
                let axis = if x >= y && x >= z { 0 } else { usize::from(y < z) + 1 };
                let half = own.len() / 2;
                let along = |triangle: u32| middle(triangle).to_array()[axis];
                own.select_nth_unstable_by(half, |&a, &b| {
                    along(a).total_cmp(&along(b)).then(a.cmp(&b))
                });
                half
            } else {
                let half = least + (most - least) / 2;
                own.sort_unstable_by_key(|&triangle| (body(triangle), triangle));
                own.partition_point(|&triangle| body(triangle) <= half)
            };
            let cut = range.start + cut;
            self.divide(skin, middle, range.start..cut);
            self.divide(skin, middle, cut..range.end);
        }
        self.nodes[place].end = self.nodes.len() as u32;
    }
}
