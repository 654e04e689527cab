//! The nearest triangle.

use super::bounds::{Cone, Patch, Span};
use super::{BESIDE, NONE, ROUNDING, SkinNow, Tree, depth};
use crate::contact::search::{Closest, Found, closest};
use crate::scalar::Vec3;

/// What is looked for around a point.
#[derive(Clone, Copy, Debug)]
pub struct Query {
    /// The point [m].
    pub p: Vec3<f64>,
    /// Outwards there, of length 1.
    pub outward: Vec3<f64>,
    /// [m].
    pub reach: f64,
    /// See [`Wanted`].
    pub depths: [f64; 2],
    /// The body of the sample.
    pub body: u32,
    /// The leaf of the sample.
    pub leaf: u32,
    /// A triangle that the sample was in touch with: it may be deeper behind those that have a point in common with it.
    pub kept: Option<u32>,
    /// A triangle that is probably near: it is looked at first, which saves time and changes nothing.
    pub first: Option<u32>,
}

/// A query on its way.
struct Looking<'a, M, U> {
    now: SkinNow<'a>,
    query: &'a Query,
    may: M,
    suits: U,
    best: Option<Found>,
    /// The distance of the best [m^2], or of what is out of reach.
    least: f64,
    /// The sample where it was when lists were made,
    then: Patch,
    /// and how far anything has moved since [m].
    moved: f64,
}

impl<M: FnMut(u32) -> bool, U: FnMut(u32, &Closest) -> bool> Looking<'_, M, U> {
    /// Takes a triangle that is nearer than the best.
    fn look(&mut self, triangle: u32) {
        let Self { now, query, .. } = *self;
        // False also for a NaN.
        let is_turned = query.outward.dot(now.normals[triangle as usize]) < BESIDE;
        if !is_turned || !(self.may)(triangle) {
            return;
        }
        let near = closest(query.p, now.corners(triangle));
        let squared = near.away.length_squared();
        let is_nearer = self.best.is_none_or(|found| {
            squared < self.least || (squared == self.least && triangle < found.triangle)
        });
        // False also for a NaN, as beside a triangle without area.
        if squared <= self.least && is_nearer && (self.suits)(triangle, &near) {
            self.least = squared;
            self.best = Some(Found { triangle, closest: near });
        }
    }

    /// Looks at a leaf's triangles. True where nothing in a node can be met.
    fn see(&mut self, tree: &Tree, place: u32) -> bool {
        let Self { now, query, then, moved, .. } = *self;
        let node = &tree.nodes[place as usize];
        let within = self.least.sqrt();
        let deep = depth(query.depths, query.body, node.body);
        let gap = node.patch.span.gap(&then.span);
        let (far, behind) = (within + moved, deep + moved);
        let point = Span { low: query.p, high: query.p };
        let is_out = gap > far * far
            || (node.leaf == NONE
                && (node.patch.cone.is_beside(&then.cone)
                    || (gap > behind * behind && then.is_averted(&node.patch, within, moved))));
        if is_out || node.leaf == NONE {
            return is_out;
        }
        for &triangle in &tree.order[node.range()] {
            let normal = now.normals[triangle as usize];
            // False also for a NaN.
            let is_turned = query.outward.dot(normal) < BESIDE;
            if !is_turned {
                continue;
            }
            let corners = now.corners(triangle);
            let height = normal.dot(query.p - corners[0]);
            // No point of it is nearer than its plane, or its box.
            if height < -(deep + ROUNDING) || height.abs() > within + ROUNDING {
                continue;
            }
            let gap = corners.into_iter().fold(Span::NOTHING, Span::with).gap(&point);
            if gap > self.least + ROUNDING * ROUNDING {
                continue;
            }
            self.look(triangle);
        }
        false
    }
}

impl Tree {
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
            if node.patch.span.gap(&Span { low: p, high: p }) > least * (1.0 + 1e-9) {
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

    /// The nearest triangle within reach, not beside the point, that `may` be met and that `suits` as it lies: which it does
    /// only where the point faces it, no deeper behind it than the query says.
    pub fn nearest(
        &self,
        now: SkinNow<'_>,
        query: &Query,
        may: impl FnMut(u32) -> bool,
        suits: impl FnMut(u32, &Closest) -> bool,
    ) -> Option<Found> {
        let list = *self.lists.get(query.leaf as usize)?;
        let place = query.p - self.since.drift;
        let then = Patch {
            span: Span { low: place, high: place },
            cone: Cone { axis: query.outward, chord: 0.0 },
        };
        let (least, moved) = (query.reach * query.reach, self.since.moved + ROUNDING);
        let mut looking = Looking { now, query, may, suits, best: None, least, then, moved };
        if let Some(triangle) = query.first {
            looking.look(triangle);
        }
        // Those that may be deep are looked at for themselves, and the rest as if nothing had been in touch.
        let kept = query.kept.map_or([].as_slice(), |kept| &now.skin.triangles[kept as usize]);
        for &point in kept {
            now.skin.topology.around(point).iter().for_each(|&triangle| looking.look(triangle));
        }
        if list.is_full {
            let mut place = 0;
            while (place as usize) < self.nodes.len() {
                let is_out = looking.see(self, place);
                place = if is_out { self.nodes[place as usize].end } else { place + 1 };
            }
        } else {
            for &place in &self.near[list.first as usize..list.end as usize] {
                looking.see(self, place);
            }
        }
        looking.best
    }
}
