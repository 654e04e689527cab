//! The beginning of a step: samples of tissue look for the tissue in their way.
//!
//! ```text
//! reach = 2 dh + 2 w,   w: the way of the fastest vertex or tool in the step
//! ```
//!
//! Lists of what may be near are made anew when vertices have travelled so far, or turned so far, that they may have changed.
//! They decide where to look, and never what is found.

use std::mem::take;

use super::{NOTHING, NOWHERE, Pairs, Places, Search};
use crate::contact::tree::{Since, SkinNow, Wanted};
use crate::contact::{
    Bond, DEEPEST, Foundation, Kept, Looking, Moment, Pair, TissueContact, depths, from_edges,
    turn_normals,
};
use crate::layout::LaidSkin;
use crate::scalar::{Real, Vec3};
use crate::solver::cpu::threads::Workers;
use crate::solver::step::contacts::ContactStep;
use crate::solver::step::groups::Groups;
use crate::state::ContactState;

/// Samples of a piece of the search.
const GRAIN: usize = 64;

/// In a step nothing is looked for further than so many thicknesses.
const FARTHEST: f64 = 40.0;

/// Lists of what may be near are to last for so many looks in which as much moves and turns as in the last one,
const LASTING: f64 = 2.0;

/// where that is no more than this many thicknesses and a chord of this length: what moves faster has lists of its own in
/// every step.
const MARGIN: f64 = 0.2;
const TURN: f64 = 0.02;

/// Those that last are made for a reach that is this much longer.
const REACH: f64 = 1.25;

/// And for ways that rounding may make longer [m].
const MORE: f64 = 1e-8;

impl Pairs {
    /// Finds the pairs of a step in which tools go no further than `tools` [m], and the groups that follow.
    pub fn find<S: Real>(
        &mut self,
        step: &ContactStep<'_, S>,
        (places, velocities): (Places<'_, S>, &[Vec3<S>]),
        tools: f64,
        state: &ContactState,
        (workers, groups): (&Workers, &mut Groups),
    ) {
        self.clear();
        groups.part_all();
        let Some(skin) = &step.layout.skin else { return };
        let thickness = skin.contact.law.thickness;
        let fastest = self.search.go(step, places, velocities).max(tools);
        let reach = (2.0 * thickness + 2.0 * fastest).min(FARTHEST * thickness);
        if self.search.is_quiet(reach) && state.pairs.is_empty() && skin.ties.is_empty() {
            return;
        }
        self.search.prepare(skin, places, reach);
        self.search.keep(skin, &state.pairs);
        self.search.look(skin, places, (workers, reach), Some(&state.pairs));
        let mut ties = skin.ties.iter().peekable();
        for part in 0..step.layout.part_count() {
            self.first[part] = self.pairs.len();
            for place in skin.samples_of(part) {
                let kept = state.pairs.get(self.search.kept[place] as usize);
                self.presses[part] |= kept.is_some();
                self.gains[part] -= kept.map_or(0.0, |kept| kept.energy);
                self.meet(skin, place, kept);
                while let Some(&(_, tie)) = ties.next_if(|tie| tie.0 as usize == place) {
                    if !state.torn.get(tie as usize).copied().unwrap_or(false) {
                        self.push(skin, tied(skin, places, place, tie));
                    }
                }
            }
        }
        self.first[step.layout.part_count()] = self.pairs.len();
        for part in 0..step.layout.part_count() {
            let mut now = 0.0;
            self.each(places, part, |pair, _, away, _| now += pair.squeezed(away));
            self.gains[part] += now;
        }
        self.at_start.extend_from_slice(&self.pairs);
        for pair in &self.pairs {
            let parts =
                [skin.samples[pair.sample as usize].part, skin.parts[pair.triangle as usize]];
            groups.join(parts[0] as usize, parts[1] as usize);
        }
        groups.settle();
    }

    /// How far tissue comes closer to tissue in a frame, at most, where they may meet in it and the fastest vertex goes further
    /// than a `free` way [m]; zero elsewhere. The state alone decides, not what was found before.
    pub fn approach<S: Real>(
        &mut self,
        frame: &ContactStep<'_, S>,
        (places, velocities): (Places<'_, S>, &[Vec3<S>]),
        free: f64,
        workers: &Workers,
    ) -> f64 {
        let Some(skin) = &frame.layout.skin else { return 0.0 };
        let thickness = skin.contact.law.thickness;
        let fastest = self.search.go(frame, places, velocities);
        // Two surfaces may come towards each other.
        let reach = (thickness + 2.0 * fastest).min(FARTHEST * thickness);
        if 2.0 * fastest <= free || self.search.is_quiet(reach) {
            return 0.0;
        }
        self.search.prepare(skin, places, reach);
        self.search.look(skin, places, (workers, reach), None);
        let mut closest = 0.0f64;
        for (sample, met) in skin.samples.iter().zip(&self.search.met) {
            let Some(found) = &met.found else { continue };
            let (distance, normal) = found.closest.signed();
            let mut way = Vec3::ZERO;
            for (&v, &weight) in sample.vertices.iter().zip(&sample.weights) {
                way += self.search.ways[v as usize] * weight;
            }
            let weights = &found.closest.weights;
            skin.each_corner(found.triangle, weights, |v, weight| {
                way -= self.search.ways[v] * weight;
            });
            let approach = -normal.dot(way);
            if distance - approach < thickness {
                closest = closest.max(approach);
            }
        }
        closest
    }

    /// Adds a pair.
    pub(super) fn push(&mut self, skin: &LaidSkin, pair: Pair) {
        self.stencils.push(skin, &pair, &skin.samples[pair.sample as usize]);
        self.pairs.push(pair);
    }

    /// The pair of a sample that meets something.
    fn meet(&mut self, skin: &LaidSkin, place: usize, kept: Option<&Kept>) {
        let Some(found) = self.search.met[place].found else { return };
        let moment = self.search.moment(skin);
        let sample = &skin.samples[place];
        let number = sample.number as usize;
        let (_, normal) = found.closest.signed();
        let thickness = skin.contact.law.thickness;
        let weights = found.closest.weights;
        let bodies = [skin.skin.sample_bodies[number], skin.skin.bodies[found.triangle as usize]];
        let shift = skin.skin.shift(bodies);
        // What friction has kept is in terms of the triangle that it was kept on.
        let slip = kept
            .map_or(Vec3::ZERO, |kept| from_edges(kept.slip, moment.now.corners(kept.triangle)));
        let law = &skin.contact.law;
        let [own, other] = [sample.stiffness, skin.stiffness[found.triangle as usize]];
        // Each side is the foundation of the other, and has half of the area.
        let foundation = Foundation {
            area: 0.5 * sample.area * moment.facing(sample.number, &found),
            stiffness: law.stiffness * own * other / (own + other),
            thickness,
        };
        let friction = kept.and_then(|kept| {
            let limit = law.friction * kept.pressed;
            (limit > 0.0).then_some((foundation.area * foundation.stiffness, limit))
        });
        let coefficient = law.friction;
        let pair = Pair {
            sample: place as u32,
            triangle: found.triangle,
            weights,
            normal,
            offset: slip - found.closest.away,
            bond: Bond::Contact { foundation, shift, friction, coefficient },
        };
        self.push(skin, pair);
    }
}

/// A tie in this step.
fn tied<S: Real>(skin: &LaidSkin, places: Places<'_, S>, place: usize, number: u32) -> Pair {
    let tie = &skin.skin.ties[number as usize];
    let corner = |k: usize| {
        let mut weights = [0.0; 3];
        weights[k] = 1.0;
        skin.place(tie.triangle, &weights, places.x)
    };
    let [normal, rest] = tie.unstretched([0, 1, 2].map(corner));
    Pair {
        sample: place as u32,
        triangle: tie.triangle,
        weights: tie.weights,
        normal,
        offset: Vec3::ZERO,
        bond: Bond::Tie { number, stiffness: tie.stiffness, rest },
    }
}

impl Search {
    /// Counts how far vertices have travelled since the last look, and finds where each goes in the step, apart from what all
    /// have in common. Returns how far the fastest goes [m].
    fn go<S: Real>(
        &mut self,
        step: &ContactStep<'_, S>,
        Places { x, layout }: Places<'_, S>,
        velocities: &[Vec3<S>],
    ) -> f64 {
        let (mut sum, mut shift) = (Vec3::<f64>::ZERO, Vec3::<f64>::ZERO);
        let share = 1.0 / self.ways.len().max(1) as f64;
        for ((x, seen), velocity) in x.iter().zip(&self.seen).zip(velocities) {
            shift += x.vec3().cast::<f64>() - *seen;
            sum += velocity.cast::<f64>();
        }
        let (common, shift) = (sum * (step.dt * share), shift * share);
        let mut moved = 0.0f64;
        let all = self.seen.iter_mut().zip(&mut self.ways).zip(x.iter().zip(velocities));
        for ((seen, way), (x, velocity)) in all {
            let x = x.vec3().cast::<f64>();
            moved = moved.max((x - *seen - shift).length_squared());
            (*seen, *way) = (x, velocity.cast::<f64>() * step.dt);
        }
        self.travelled += moved.sqrt();
        // The boxes stay where they are.
        self.drift += shift;
        for pin in step.pins {
            let v = layout.numbering.of(pin.vertex);
            self.ways[v] = pin.target.cast::<f64>() - self.seen[v];
        }
        let ways = self.ways.iter().map(|way| (*way - common).length_squared());
        ways.fold(0.0, f64::max).sqrt()
    }

    /// Whether no sample meets anything within reach [m] because nothing has been deformed since it was looked for.
    fn is_quiet(&mut self, reach: f64) -> bool {
        self.travelled == self.prepared_at && self.has_lists(reach) && self.tree.is_clear()
    }

    /// Whether lists are as good for queries that reach so far [m].
    fn has_lists(&mut self, reach: f64) -> bool {
        let moved = self.travelled - self.listed_at;
        self.tree.has_lists(reach, Since { drift: self.drift, moved, turned: self.turned })
    }

    fn moment<'a>(&'a self, skin: &'a LaidSkin) -> Moment<'a> {
        let Self { tree, at, normals, .. } = self;
        let now = SkinNow { skin: &skin.skin, at, normals };
        Moment { now, tree, contact: &skin.contact, deepest: DEEPEST }
    }

    /// Which of what the last step has left is whose; both are sorted as samples are.
    fn keep(&mut self, skin: &LaidSkin, all: &[Kept]) {
        let mut kept = (0..).zip(all).peekable();
        for (place, sample) in skin.samples.iter().enumerate() {
            let own = (sample.part as usize, sample.number);
            let key = |kept: &Kept| (skin.part_of(kept.sample), kept.sample);
            while kept.next_if(|(_, kept)| key(kept) < own).is_some() {}
            let next = kept.next_if(|(_, kept)| key(kept) == own);
            // A state that the caller has changed may name triangles that do not exist.
            let known = next.filter(|(_, kept)| (kept.triangle as usize) < skin.parts.len());
            self.kept[place] = known.map_or(NOTHING, |(number, _)| number);
        }
    }

    /// What all samples meet within reach [m], see [`Moment::meet`], after [`Search::prepare`]; and after [`Search::keep`] where
    /// something is kept.
    fn look<S: Real>(
        &mut self,
        skin: &LaidSkin,
        places: Places<'_, S>,
        (workers, reach): (&Workers, f64),
        all_kept: Option<&[Kept]>,
    ) {
        let mut all_met = take(&mut self.met);
        let moment = self.moment(skin);
        workers.each_of(&mut all_met, GRAIN, |place, met| {
            let sample = &skin.samples[place];
            met.found = None;
            let leaf = self.tree.leaf_of(sample.number);
            let kept = all_kept.and_then(|all| all.get(self.kept[place] as usize));
            let kept = kept.map(|kept| kept.triangle);
            if kept.is_none() && self.tree.meets_nothing(leaf) {
                return;
            }
            let (number, p) = (sample.number, sample.place(places.x));
            let near = Some(met.near).filter(|near| *near != NOWHERE);
            met.found = moment.meet(&Looking { sample: number, p, leaf, kept, near }, reach);
            met.near = met.found.as_ref().map_or(NOWHERE, |found| found.triangle);
        });
        self.met = all_met;
    }

    /// Places of the skin's points and normals, and lists that are not too old.
    fn prepare<S: Real>(&mut self, skin: &LaidSkin, places: Places<'_, S>, reach: f64) {
        for (at, point) in self.at.iter_mut().zip(&skin.skin.points) {
            let all = point.vertices.iter().zip(&point.weights);
            *at = all.fold(Vec3::ZERO, |sum, (&v, &weight)| {
                sum + places.x[v as usize].vec3().cast::<f64>() * weight
            });
        }
        let moved = self.travelled - self.prepared_at;
        self.prepared_at = self.travelled;
        let turned = turn_normals(&skin.skin, &self.at, &mut self.normals);
        self.turned += turned;
        // The first look comes from nowhere, and numbers that have grown without bound tell nothing.
        let is_new = self.listed_at < 0.0 || !self.travelled.is_finite();
        if is_new {
            (self.travelled, self.prepared_at) = (0.0, 0.0);
        }
        if is_new || !self.has_lists(reach) {
            let TissueContact { itself, bodies, law } = skin.contact;
            let now = SkinNow { skin: &skin.skin, at: &self.at, normals: &self.normals };
            let (margin, turn) = (2.0 * LASTING * moved, LASTING * turned);
            let lasts = !is_new && margin <= MARGIN * law.thickness && turn <= TURN;
            let (margin, turn, longer) =
                if lasts { (margin, turn, REACH) } else { (0.0, 0.0, 1.0) };
            let wanted = Wanted {
                itself,
                bodies,
                reach: longer * reach,
                depths: depths(&skin.contact, DEEPEST),
                margin: margin + MORE,
                turn,
            };
            self.tree.list(now, wanted);
            (self.listed_at, self.drift, self.turned) = (self.travelled, Vec3::ZERO, 0.0);
        }
    }
}
