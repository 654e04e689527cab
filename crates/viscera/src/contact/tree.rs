//! Which triangles may be near which samples: a tree of boxes and of cones of normals over the skin.
//!
//! ```text
//! node: the box of its triangles;  axis a and chord r of their normals:  |n - a| <= r
//! samples of a leaf meet nothing in a node where
//!   gap of boxes > reach        or        r_s + |a_s - a| + r <= 1, for then  n_s.n = 1 - |n_s - n|^2/2 >= 1/2  for all of them
//! ```
//!
//! Cones: Volino and Magnenat-Thalmann, "Efficient self-collision detection on smoothly discretized surface animations using
//! geometrical shape regularity", 1994. Most of a smooth organ's own skin is beside any other part of it, and is left out in a few
//! nodes. What remains is a list of leaves for each leaf. It is good until points or normals have gone further than the margins
//! with which it was made, and decides what is looked at, never what is found: of all triangles within reach the nearest one
//! counts, of several the lowest, each where it is now.

use super::search::{Closest, Found, closest};
use super::skin::{Site, Skin};
use crate::scalar::Vec3;
use std::ops::Range;

/// Triangles of a leaf, at most.
const LEAF: usize = 8;

/// Leaves that may be near a leaf, on average, before lists end and everything is looked at.
const ROOM: usize = 24;

/// Lists count normals as if they had turned by this chord.
pub const TURN: f64 = 0.1;

/// Two directions of which the chord is no more than this are beside each other, see [`BESIDE`].
const CHORD: f64 = 1.0 - 1e-9;

/// Surfaces do not meet where the product of their outward normals is no less than this, at an angle of up to 60 degrees.
pub const BESIDE: f64 = 0.5;

/// More than rounding makes of sums of ways [m].
const ROUNDING: f64 = 1e-9;

/// No leaf, or no body.
const NONE: u32 = u32::MAX;

/// Directions near an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Cone {
    axis: Vec3<f64>,
    chord: f64,
}

impl Cone {
    /// Around directions of length 1 with what each may turn; those that are no numbers meet nothing, and do not count.
    fn around(directions: impl Iterator<Item = (Vec3<f64>, f64)> + Clone) -> Self {
        let all = directions.filter(|(direction, _)| direction.is_finite());
        let sum = all.clone().fold(Vec3::ZERO, |sum, (direction, _)| sum + direction);
        let axis = unit(sum);
        let chord = all
            .fold(0.0f64, |most, (direction, turn)| most.max((direction - axis).length() + turn));
        Self { axis, chord }
    }

    fn join(self, other: Self) -> Self {
        let axis = unit(self.axis + other.axis);
        let chord = |cone: Self| (cone.axis - axis).length() + cone.chord;
        Self { axis, chord: chord(self).max(chord(other)) }
    }

    /// Whether every direction of one is beside every one of the other.
    fn is_beside(&self, other: &Self) -> bool {
        self.chord + other.chord + (self.axis - other.axis).length() <= CHORD
    }
}

/// Of length 1, or nothing.
fn unit(direction: Vec3<f64>) -> Vec3<f64> {
    let unit = direction * (1.0 / direction.length());
    if unit.is_finite() { unit } else { Vec3::ZERO }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Span {
    low: Vec3<f64>,
    high: Vec3<f64>,
}

impl Span {
    const NOTHING: Self =
        Self { low: Vec3::splat(f64::INFINITY), high: Vec3::splat(f64::NEG_INFINITY) };

    fn with(self, x: Vec3<f64>) -> Self {
        Self { low: self.low.min(x), high: self.high.max(x) }
    }

    fn join(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// The gap to another [m], squared.
    fn gap(&self, other: &Self) -> f64 {
        (self.low - other.high).max(other.low - self.high).max(Vec3::ZERO).length_squared()
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Node {
    span: Span,
    cone: Cone,
    /// Of its triangles, in the order of leaves.
    first: u32,
    count: u32,
    /// The node behind all that are below it.
    end: u32,
    /// Which leaf it is, or [`NONE`].
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
    /// The node of each leaf.
    leaves: Vec<u32>,
    /// The leaf of each sample, or [`NONE`].
    leaf_of: Vec<u32>,
    /// Samples by leaf, and the first of each leaf and the end of the last.
    samples: Vec<u32>,
    first_sample: Vec<u32>,
    /// Leaves that each leaf's samples may meet: all where there is no room for a list.
    lists: Vec<Near>,
    near: Vec<u32>,
    /// How many of those are in use.
    used: usize,
    /// How far apart what was left out is at least [m]; nothing before a list was made.
    width: Option<f64>,
    since: Since,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Near {
    first: u32,
    end: u32,
    is_full: bool,
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

/// A skin's points and normals.
#[derive(Clone, Copy)]
pub struct SkinNow<'a> {
    pub skin: &'a Skin,
    /// Places of points [m].
    pub at: &'a [Vec3<f64>],
    /// Normals of triangles, of length 1.
    pub normals: &'a [Vec3<f64>],
}

/// What is looked for around a point.
#[derive(Clone, Copy, Debug)]
pub struct Query {
    /// The point [m].
    pub p: Vec3<f64>,
    /// Outwards there, of length 1.
    pub outward: Vec3<f64>,
    /// [m].
    pub reach: f64,
    /// The leaf of the sample.
    pub leaf: u32,
    /// A triangle that is probably near: it is looked at first, which saves time and changes nothing.
    pub first: Option<u32>,
}

impl SkinNow<'_> {
    /// Places of a triangle's corners [m].
    pub fn corners(&self, triangle: u32) -> [Vec3<f64>; 3] {
        self.skin.triangles[triangle as usize].map(|point| self.at[point as usize])
    }

    /// The mean of the normals at a sample.
    pub fn mean_normal(&self, sample: u32) -> Vec3<f64> {
        match self.skin.sites[sample as usize] {
            Site::Triangle(triangle) => self.normals[triangle as usize],
            Site::Point(point) => {
                let around = self.skin.topology.around(point);
                let normals = around.iter().map(|&triangle| self.normals[triangle as usize]);
                let sum = normals.fold(Vec3::ZERO, |sum, normal| sum + normal);
                sum * (1.0 / around.len().max(1) as f64)
            }
        }
    }

    /// Outwards at a sample, of length 1, with the chord by which it may turn while no normal turns by more than [`TURN`].
    fn outward(&self, sample: u32) -> (Vec3<f64>, f64) {
        let mean = self.mean_normal(sample);
        let steady = mean.length();
        // |a/|a| - b/|b|| <= 2 |a - b|/(|a| + |b|), and the mean turns no further than the normals.
        let turn = if steady > TURN { 2.0 * TURN / (2.0 * steady - TURN) } else { 2.0 };
        (mean * (1.0 / steady), turn)
    }

    fn triangle_span(&self, triangle: u32) -> Span {
        self.corners(triangle).into_iter().fold(Span::NOTHING, Span::with)
    }
}

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
        tree.lists = vec![Near::default(); tree.leaves.len()];
        tree.near = vec![NONE; ROOM * tree.leaves.len()];
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
            span: Span::NOTHING,
            cone: Cone::default(),
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

    /// The leaf of a sample, none where no triangle is at it.
    pub fn leaf_of(&self, sample: u32) -> u32 {
        self.leaf_of[sample as usize]
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        let numbers = [&self.order, &self.leaves, &self.leaf_of, &self.samples, &self.first_sample];
        numbers.map(|all| size_of_val(&all[..])).iter().sum::<usize>()
            + size_of_val(&self.nodes[..])
            + size_of_val(&self.lists[..])
            + size_of_val(&self.near[..])
    }

    /// Says what has happened since lists were made. True where they are as good for queries that reach so far [m].
    pub fn has_lists(&mut self, reach: f64, since: Since) -> bool {
        self.since = since;
        let wide = reach + 2.0 * (since.moved + ROUNDING);
        self.width.is_some_and(|width| wide <= width) && since.turned <= TURN
    }

    /// Whether no sample may meet anything.
    pub fn is_clear(&self) -> bool {
        self.lists.iter().all(|near| !near.is_full && near.first == near.end)
    }

    /// Makes lists for queries that reach up to `width` [m], of all that has moved until then. Takes no memory.
    pub fn list(&mut self, now: SkinNow<'_>, itself: bool, bodies: bool, width: f64) {
        self.refit(now);
        self.used = 0;
        for leaf in 0..self.leaves.len() {
            self.lists[leaf] = self.list_of(now, leaf, (itself, bodies), width);
        }
        self.width = Some(width);
        self.since = Since::default();
    }

    /// Boxes and cones of where points are.
    pub fn refit(&mut self, now: SkinNow<'_>) {
        for place in (0..self.nodes.len()).rev() {
            let node = self.nodes[place];
            let (span, cone) = if node.leaf == NONE {
                let first = &self.nodes[place + 1];
                let second = &self.nodes[first.end as usize];
                (first.span.join(second.span), first.cone.join(second.cone))
            } else {
                let own = &self.order[node.range()];
                let span = own
                    .iter()
                    .map(|&triangle| now.triangle_span(triangle))
                    .fold(Span::NOTHING, Span::join);
                let normals = own.iter().map(|&triangle| (now.normals[triangle as usize], TURN));
                (span, Cone::around(normals))
            };
            self.nodes[place].span = span;
            self.nodes[place].cone = cone;
        }
    }

    /// Leaves that the samples of one may meet.
    fn list_of(
        &mut self,
        now: SkinNow<'_>,
        leaf: usize,
        (itself, bodies): (bool, bool),
        width: f64,
    ) -> Near {
        let Self { nodes, leaves, near, used, .. } = self;
        let first = *used as u32;
        let own =
            &self.samples[self.first_sample[leaf] as usize..self.first_sample[leaf + 1] as usize];
        if own.is_empty() {
            return Near { first, end: first, is_full: false };
        }
        let body = nodes[leaves[leaf] as usize].body;
        let span =
            own.iter().fold(Span::NOTHING, |span, &sample| match now.skin.sites[sample as usize] {
                Site::Triangle(triangle) => span.join(now.triangle_span(triangle)),
                Site::Point(point) => span.with(now.at[point as usize]),
            });
        let cone = Cone::around(own.iter().map(|&sample| now.outward(sample)));
        let mut place = 0;
        while let Some(node) = nodes.get(place) {
            let is_out = node.body != NONE && !(if node.body == body { itself } else { bodies });
            // Not the other way round: places that are no numbers hide nothing.
            let is_far = node.span.gap(&span) > width * width;
            if is_out || is_far || node.cone.is_beside(&cone) {
                place = node.end as usize;
                continue;
            }
            if node.leaf != NONE {
                let Some(place) = near.get_mut(*used) else {
                    *used = first as usize;
                    return Near { first, end: first, is_full: true };
                };
                *place = node.leaf;
                *used += 1;
            }
            place += 1;
        }
        Near { first, end: *used as u32, is_full: false }
    }

    /// The nearest triangle within reach [m] of a point that `may` be met, however it lies, where [`Tree::refit`] has been.
    pub fn nearest_to(
        &self,
        now: SkinNow<'_>,
        p: Vec3<f64>,
        reach: f64,
        may: impl Fn(u32) -> bool,
    ) -> Option<Found> {
        let mut best: Option<(f64, Found)> = None;
        let mut place = 0;
        while let Some(node) = self.nodes.get(place) {
            let least = best.map_or(reach * reach, |(squared, _)| squared);
            // Rounding hides nothing that is as near.
            if node.span.gap(&Span { low: p, high: p }) > least * (1.0 + 1e-9) {
                place = node.end as usize;
                continue;
            }
            place += 1;
            if node.leaf == NONE {
                continue;
            }
            for &triangle in self.order[node.range()].iter().filter(|&&triangle| may(triangle)) {
                let near = closest(p, now.corners(triangle));
                let squared = near.away.length_squared();
                let is_nearer = best.is_none_or(|(least, found)| {
                    squared < least || (squared == least && triangle < found.triangle)
                });
                if squared <= reach * reach && is_nearer {
                    best = Some((squared, Found { triangle, closest: near }));
                }
            }
        }
        best.map(|(_, found)| found)
    }

    /// Whether samples of a leaf meet nothing.
    pub fn meets_nothing(&self, leaf: u32) -> bool {
        let near = self.lists.get(leaf as usize);
        near.is_none_or(|near| !near.is_full && near.first == near.end)
    }

    /// The nearest triangle within reach, not beside the point, that `may` be met and that `suits` as it lies.
    pub fn nearest(
        &self,
        now: SkinNow<'_>,
        query: &Query,
        mut may: impl FnMut(u32) -> bool,
        mut suits: impl FnMut(u32, &Closest) -> bool,
    ) -> Option<Found> {
        let Query { p, outward, reach, leaf, first } = *query;
        let list = *self.lists.get(leaf as usize)?;
        let mut best: Option<Found> = None;
        let mut least = reach * reach;
        let mut look = |triangle: u32, least: &mut f64| {
            // False also where it is no number.
            let is_turned = outward.dot(now.normals[triangle as usize]) < BESIDE;
            if !is_turned || !may(triangle) {
                return;
            }
            let near = closest(p, now.corners(triangle));
            let squared = near.away.length_squared();
            let is_nearer = best.is_none_or(|found| {
                squared < *least || (squared == *least && triangle < found.triangle)
            });
            // Nothing where it is no number, as beside triangles without area.
            if squared <= *least && is_nearer && suits(triangle, &near) {
                *least = squared;
                best = Some(Found { triangle, closest: near });
            }
        };
        if let Some(triangle) = first {
            look(triangle, &mut least);
        }
        let then = Span { low: p - self.since.drift, high: p - self.since.drift };
        let moved = self.since.moved + ROUNDING;
        let mut see = |leaf: u32| {
            let node = &self.nodes[self.leaves[leaf as usize] as usize];
            let wide = least.sqrt() + moved;
            if node.span.gap(&then) <= wide * wide {
                self.order[node.range()].iter().for_each(|&triangle| look(triangle, &mut least));
            }
        };
        if list.is_full {
            (0..self.leaves.len() as u32).for_each(&mut see);
        } else {
            self.near[list.first as usize..list.end as usize].iter().for_each(|&leaf| see(leaf));
        }
        best
    }
}

impl Node {
    fn range(&self) -> Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::skin::SkinPoint;
    use crate::contact::turn_normals;
    use crate::scalar::vec3;

    /// A number between -1 and 1 of a fixed sequence.
    fn number(i: usize, step: f64) -> f64 {
        2.0 * ((i as f64 * step) % 1.0) - 1.0
    }

    fn point(i: usize) -> Vec3<f64> {
        vec3(number(i, 0.618034), number(i, 0.754878), number(i, 0.569840))
    }

    /// Many small triangles of a few bodies, each with a sample in its middle, and where their corners are [m].
    fn triangles(count: usize) -> (Skin, Vec<Vec3<f64>>) {
        let mut skin = Skin::default();
        for i in 0..count as u32 {
            let corner =
                |k: u32| SkinPoint { vertices: [3 * i + k; 4], weights: [1.0, 0.0, 0.0, 0.0] };
            skin.points.extend([0, 1, 2].map(corner));
            skin.triangles.push([0, 1, 2].map(|k| 3 * i + k));
            skin.bodies.push(i % 3);
            skin.sites.push(Site::Triangle(i));
        }
        let corners = |i: usize| {
            let u = unit(point(7 * i + 3));
            let v = unit(u.cross(point(11 * i + 5)));
            [u, v - u * 0.5, (v + u * 0.5) * -1.0].map(|corner| point(i) * 0.1 + corner * 0.004)
        };
        let at = (0..count).flat_map(corners).collect();
        (skin, at)
    }

    const DRIFT: Vec3<f64> = vec3(0.3, -0.1, 0.2);

    /// What the nearest triangle is by looking at all.
    fn best_of_all(
        now: SkinNow<'_>,
        query: &Query,
        may: impl Fn(u32) -> bool,
        suits: impl Fn(u32) -> bool,
    ) -> Option<u32> {
        let all = (0..now.skin.triangles.len() as u32)
            .filter(|&t| query.outward.dot(now.normals[t as usize]) < BESIDE)
            .map(|t| (closest(query.p, now.corners(t)).away.length_squared(), t))
            .filter(|&(squared, t)| squared <= query.reach * query.reach && may(t) && suits(t));
        all.min_by(|a, b| a.partial_cmp(b).expect("numbers")).map(|(_, t)| t)
    }

    /// Also where points have moved and normals have turned since lists were made, and where lists have no room.
    #[test]
    fn the_tree_finds_what_looking_at_all_triangles_finds() {
        let (skin, at) = triangles(300);
        let mut tree = Tree::new(&skin, &at);
        let (mut met, mut full) = (0, 0);
        for (reach, swing) in [(0.02, 5e-5), (0.04, 1e-4), (0.3, 0.0)] {
            let mut normals = Vec::new();
            turn_normals(&skin, &at, &mut normals);
            let now = SkinNow { skin: &skin, at: &at, normals: &normals };
            tree.list(now, true, true, reach + 3.0 * swing + 1e-8);
            let later: Vec<Vec3<f64>> = (0..)
                .zip(&at)
                .map(|(i, x)| *x + DRIFT + point(i + 91) * (swing / 3.0_f64.sqrt()))
                .collect();
            let turned = turn_normals(&skin, &later, &mut normals);
            let since = Since { drift: DRIFT, moved: swing, turned };
            assert!(tree.has_lists(reach, since), "{since:?}");
            let now = SkinNow { skin: &skin, at: &later, normals: &normals };
            let (may, suits) = (|t: u32| !t.is_multiple_of(5), |t: u32| t % 7 != 1);
            for sample in 0..300 {
                let [a, b, c] = now.corners(sample);
                let query = Query {
                    p: (a + b + c) * (1.0 / 3.0),
                    outward: now.outward(sample).0,
                    reach,
                    leaf: tree.leaf_of(sample),
                    first: sample.is_multiple_of(3).then_some((sample + 40) % 300),
                };
                let found = tree.nearest(now, &query, may, |t, _| suits(t));
                let exact = best_of_all(now, &query, may, suits);
                assert_eq!(found.map(|found| found.triangle), exact, "{sample} within {reach} m");
                met += usize::from(exact.is_some());
            }
            full += tree.lists.iter().filter(|near| near.is_full).count();
        }
        assert!(met > 400 && full > 10, "{met} {full}");
    }

    /// Bodies that may not meet are in no list, nor are those of whom all is beside all.
    #[test]
    fn lists_leave_out_what_may_not_meet() {
        let (skin, at) = triangles(300);
        let mut normals = Vec::new();
        turn_normals(&skin, &at, &mut normals);
        let now = SkinNow { skin: &skin, at: &at, normals: &normals };
        let mut tree = Tree::new(&skin, &at);
        tree.list(now, false, false, 1.0);
        assert!(tree.is_clear());
        tree.list(now, true, false, 0.02);
        assert!(!tree.is_clear());
        for leaf in 0..tree.leaves.len() {
            let body = |leaf: u32| tree.nodes[tree.leaves[leaf as usize] as usize].body;
            let near = tree.lists[leaf];
            let all = &tree.near[near.first as usize..near.end as usize];
            assert!(all.iter().all(|&other| body(other) == body(leaf as u32)));
        }
        // A sheet that is bent a little is beside itself; a list that is older than its margins says so.
        let flat: Vec<Vec3<f64>> = (0..300)
            .flat_map(|i| {
                let x = vec3(f64::from(i % 20), f64::from(i / 20), 0.0) * 1e-3;
                [vec3(0.0, 0.0, 0.0), vec3(1e-3, 0.0, 0.0), vec3(0.0, 1e-3, 1e-4)]
                    .map(|corner| x + corner)
            })
            .collect();
        turn_normals(&skin, &flat, &mut normals);
        tree.list(SkinNow { skin: &skin, at: &flat, normals: &normals }, true, true, 0.01);
        assert!(tree.is_clear());
        let since = Since::default();
        assert!(tree.has_lists(0.009, Since { moved: 4e-4, turned: 0.1, ..since }));
        assert!(!tree.has_lists(0.009, Since { moved: 6e-4, ..since }));
        assert!(!tree.has_lists(0.009, Since { turned: 0.11, ..since }));
    }

    /// Of two triangles with a common edge the lower, whichever the tree has first.
    #[test]
    fn of_triangles_that_are_as_near_the_lowest_is_found() {
        for i in 0..100 {
            let place = point(i);
            let corners = [
                vec3(0.0, 0.0, 0.0),
                vec3(0.0, 1.0, 0.0),
                vec3(-2.0, 0.5, 0.0),
                vec3(2.0, 0.5, 0.0),
            ];
            let at = corners.map(|x| place + x * 0.125);
            let points = (0..4)
                .map(|v| SkinPoint { vertices: [v; 4], weights: [1.0, 0.0, 0.0, 0.0] })
                .collect();
            let skin = Skin {
                points,
                triangles: vec![[0, 1, 2], [1, 0, 3]],
                bodies: vec![0; 2],
                sites: vec![Site::Triangle(1)],
                ..Skin::default()
            };
            let mut normals = Vec::new();
            turn_normals(&skin, &at, &mut normals);
            let now = SkinNow { skin: &skin, at: &at, normals: &normals };
            let mut tree = Tree::new(&skin, &at);
            tree.list(now, true, true, 1.0);
            tree.lists[0] = Near { is_full: true, ..Near::default() };
            let p = at[0] - vec3(0.0, 5e-4, 0.0);
            let outward = vec3(1.0, 0.0, 0.0);
            let query = Query { p, outward, reach: 1e-3, leaf: 0, first: None };
            let found = tree.nearest(now, &query, |_| true, |_, _| true);
            assert_eq!(found.map(|found| found.triangle), Some(0), "{i}");
        }
    }
}
