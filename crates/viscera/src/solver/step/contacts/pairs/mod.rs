//! Tissue that meets tissue in a step.
//!
//! ```text
//! Phi += dt^2 sum_p E_p,   force on vertex i: sum_p w_pi f_p,   w: weights of the sample, less those of the triangle's point
//! bound at a vertex: |w_i| sum_a |w_a| dt^2 (C_p)
//! ```
//!
//! Every sample meets one triangle at most, and both sides of a contact have samples. Energies count as those of the sample's
//! part; parts that share a pair are one group (`groups.rs`).

mod find;
mod stencils;

use super::{Bound, Sums};
use crate::contact::search::Found;
use crate::contact::tree::Tree;
use crate::contact::{Bond, Felt, Kept, Pair};
use crate::layout::{LaidSample, Layout};
use crate::scalar::lanes::Point;
use crate::scalar::{Mat3, Real, Vec3};
use crate::solver::step::contacts::OfVertices;
use stencils::Stencils;

/// Tissue and tissue in a step.
#[derive(Clone, Debug, Default)]
pub struct Pairs {
    /// Part by part of their samples.
    pairs: Vec<Pair>,
    stencils: Stencils,
    /// The same where the step begins.
    at_start: Vec<Pair>,
    /// The first of each part, and the end of the last one's.
    first: Vec<usize>,
    /// Of each part, whether tissue presses on one of its samples where the step begins.
    presses: Vec<bool>,
    /// Of each part the energy [J] that contact has gained because pairs were found anew.
    gains: Vec<f64>,
    search: Search,
}

/// What finding pairs keeps, none of which changes what is found.
#[derive(Clone, Debug, Default)]
struct Search {
    tree: Tree,
    /// Where vertices were when it looked last [m].
    seen: Vec<Vec3<f64>>,
    /// How far the vertex that moves most beside the mean of all has moved since the beginning, from look to look [m].
    travelled: f64,
    /// The same when lists were made, and when normals were found; below zero before.
    listed_at: f64,
    prepared_at: f64,
    /// How far all of it has moved since lists were made [m], and by how long a chord the normal that turned most.
    drift: Vec3<f64>,
    turned: f64,
    /// Places of the skin's points [m], and normals of its triangles.
    at: Vec<Vec3<f64>>,
    normals: Vec<Vec3<f64>>,
    /// Where vertices go in the step [m].
    ways: Vec<Vec3<f64>>,
    /// What each sample meets.
    met: Vec<Met>,
    /// What each sample has kept, by its number in the state, or [`NOTHING`].
    kept: Vec<u32>,
}

/// What a sample meets.
#[derive(Clone, Copy, Debug)]
struct Met {
    /// Now.
    found: Option<Found>,
    /// The triangle that it met when it looked last, or [`NOWHERE`].
    near: u32,
}

/// No triangle.
const NOWHERE: u32 = u32::MAX;

/// Nothing is kept.
const NOTHING: u32 = u32::MAX;

/// What pairs know of a step.
#[derive(Clone, Copy)]
pub struct Places<'a, S> {
    pub layout: &'a Layout<S>,
    /// Of vertices [m].
    pub x: &'a [Point<S>],
}

impl Pairs {
    /// For the steps of a model.
    pub fn new<S: Real>(layout: &Layout<S>) -> Self {
        let Some(skin) = &layout.skin else { return Self::default() };
        let (samples, vertices) = (skin.samples.len(), layout.vertex_count());
        let room = samples + skin.ties.len();
        Self {
            pairs: Vec::with_capacity(room),
            stencils: Stencils::new(skin, room),
            at_start: Vec::with_capacity(room),
            first: vec![0; layout.part_count() + 1],
            presses: vec![false; layout.part_count()],
            gains: vec![0.0; layout.part_count()],
            search: Search {
                tree: skin.tree.clone(),
                seen: vec![Vec3::ZERO; vertices],
                travelled: 0.0,
                listed_at: -1.0,
                prepared_at: -1.0,
                drift: Vec3::ZERO,
                turned: 0.0,
                at: vec![Vec3::ZERO; skin.skin.points.len()],
                normals: Vec::with_capacity(skin.skin.triangles.len()),
                ways: vec![Vec3::ZERO; vertices],
                met: vec![Met { found: None, near: NOWHERE }; samples],
                kept: vec![NOTHING; samples],
            },
        }
    }

    /// Pairs that a device has found: of the whole model, for measures that ask for forces alone.
    #[cfg(feature = "gpu")]
    pub fn found<S: Real>(layout: &Layout<S>, all: Vec<Pair>) -> Self {
        let mut pairs = Self::default();
        if let Some(skin) = &layout.skin {
            pairs.stencils = Stencils::new(skin, all.len());
            for pair in all {
                pairs.push(skin, pair);
            }
        }
        pairs
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        let Search { tree, seen, at, ways, normals, met, kept, .. } = &self.search;
        (self.pairs.capacity() + self.at_start.capacity()) * size_of::<Pair>()
            + size_of_val(&self.first[..])
            + tree.bytes()
            + self.stencils.bytes()
            + size_of_val(&met[..])
            + size_of_val(&kept[..])
            + [seen, at, ways, normals].map(|all| size_of_val(&all[..])).iter().sum::<usize>()
    }

    /// All of them.
    pub fn all(&self) -> &[Pair] {
        &self.pairs
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.pairs.len()
    }

    /// Forgets all pairs.
    pub fn clear(&mut self) {
        self.pairs.clear();
        self.stencils.clear();
        self.at_start.clear();
        self.first.fill(0);
        self.presses.fill(false);
        self.gains.fill(0.0);
    }

    /// Whether there are pairs of a part's samples.
    pub fn is_any(&self, part: usize) -> bool {
        !self.range(part).is_empty()
    }

    /// By how much the energy of contact [J] of a part's samples is larger where the step begins than where the last one has
    /// ended, at the same places: what is nearest now is never farther than what was nearest then.
    pub fn gain(&self, part: usize) -> f64 {
        self.gains.get(part).copied().unwrap_or(0.0).max(0.0)
    }

    /// Whether tissue presses on samples of a part where the step begins.
    pub fn presses(&self, part: usize) -> bool {
        self.presses.get(part).copied().unwrap_or(false)
    }

    /// Calls `act` with every pair of a part's samples, its sample, its way [m] and what it feels at `x`.
    pub fn each<S: Real>(
        &self,
        Places { layout, x }: Places<'_, S>,
        part: usize,
        mut act: impl FnMut(&Pair, &LaidSample, Vec3<f64>, &Felt),
    ) {
        let Some(skin) = &layout.skin else { return };
        for number in self.range(part) {
            let pair = &self.pairs[number];
            let sample = &skin.samples[pair.sample as usize];
            let away = self.stencils.of(number).away(x);
            act(pair, sample, away, &pair.feel(away));
        }
    }

    /// Energy of a part's pairs at `x`, and what round-off of places makes of it.
    pub fn sums<S: Real>(&self, places: Places<'_, S>, part: usize) -> Sums {
        let mut sums = Sums::default();
        self.each(places, part, |pair, _, _, felt| {
            sums.energy += felt.energy;
            let thickness = match pair.bond {
                Bond::Contact { foundation, .. } => foundation.thickness,
                Bond::Tie { .. } => 0.0,
            };
            let most = felt.force.length() + felt.stiffness * thickness;
            // Both ends are rounded.
            sums.squared_force += 2.0 * most * most;
        });
        sums
    }

    /// The change of the energy [J] of a part's pairs from one place to another, and the sum of the magnitudes of its terms.
    pub fn change<S: Real>(&self, part: usize, [from, to]: [&[Point<S>]; 2]) -> [f64; 2] {
        let mut sums = [0.0; 2];
        for number in self.range(part) {
            let (pair, stencil) = (&self.pairs[number], self.stencils.of(number));
            let [before, after] = [from, to].map(|x| pair.feel(stencil.away(x)).energy);
            sums[0] += after - before;
            sums[1] += (after - before).abs();
        }
        sums
    }

    /// The curvature of the energy of a part's pairs along a direction of vertices [J].
    pub fn curvature<S: Real>(&self, x: &[Point<S>], part: usize, direction: &[Point<S>]) -> f64 {
        let mut sum = 0.0;
        for number in self.range(part) {
            let stencil = self.stencils.of(number);
            let felt = self.pairs[number].feel(stencil.away(x));
            let d = stencil.away(direction);
            sum += d.dot(felt.curvature() * d);
        }
        sum
    }

    /// Calls `add` with what bears on vertices of any part by the pairs of all parts: four vertices, their weights and a block
    /// [N/m], blocks of one pair together being no smaller than its curvature.
    pub fn each_block<S: Real>(
        &self,
        places: Places<'_, S>,
        mut add: impl FnMut(&[u32; 4], &[f64; 4], Mat3<f64>),
    ) {
        let Some(skin) = &places.layout.skin else { return };
        for part in 0..places.layout.part_count() {
            self.each(places, part, |pair, sample, _, felt| {
                if felt.pressed > 0.0 || felt.drag > 0.0 {
                    // (p - q)^2 <= 2 p^2 + 2 q^2, and q^2 <= sum_k beta_k y_k^2 of the triangle's corners y_k.
                    let block = felt.curvature() * 2.0;
                    add(&sample.vertices, &sample.weights, block);
                    let points = skin.skin.triangles[pair.triangle as usize]
                        .map(|point| &skin.skin.points[point as usize]);
                    if points.iter().all(|point| point.weights[0] == 1.0) {
                        let [a, b, c] = points.map(|point| point.vertices[0]);
                        let [on_a, on_b, on_c] = pair.weights;
                        add(&[a, b, c, a], &[on_a, on_b, on_c, 0.0], block);
                        return;
                    }
                    for (point, weight) in points.into_iter().zip(pair.weights) {
                        add(&point.vertices, &point.weights, block * weight);
                    }
                }
            });
        }
    }

    /// Calls with every vertex that a pair of a part's samples bears on: its weight, the sum of their magnitudes and what the
    /// sample feels at `x`.
    fn each_vertex<S: Real>(
        &self,
        x: &[Point<S>],
        part: usize,
        mut act: impl FnMut(usize, f64, f64, &Felt),
    ) {
        for number in self.range(part) {
            let stencil = self.stencils.of(number);
            let felt = self.pairs[number].feel(stencil.away(x));
            if felt.force == Vec3::ZERO && felt.drag == 0.0 {
                continue;
            }
            let sum = stencil.size();
            stencil.each().for_each(|(v, weight)| act(v, weight, sum, &felt));
        }
    }

    /// Calls with every vertex that pairs bear on and the force [N], places of vertices [m] being from elsewhere.
    pub fn each_force_at<S: Real>(
        &self,
        place: impl Fn(usize) -> Vec3<S>,
        mut act: impl FnMut(usize, Vec3<f64>),
    ) {
        for (number, pair) in self.pairs.iter().enumerate() {
            let stencil = self.stencils.of(number);
            let force = pair.feel(stencil.sum(&place)).force;
            stencil.each().for_each(|(v, weight)| act(v, force * weight));
        }
    }

    /// Adds `dt^2` times the forces of a part's pairs to the first copy of each vertex, of whatever part, and the bound of the
    /// curvature.
    pub fn add_forces<S: Real>(
        &self,
        places: Places<'_, S>,
        part: usize,
        (dt, bound): (f64, Bound),
        loads: &mut [Point<S>],
    ) {
        let copies = &places.layout.copy_offsets;
        self.each_vertex(places.x, part, |v, weight, sum, felt| {
            let stiffness = match bound {
                Bound::Without => 0.0,
                Bound::Here => (felt.stiffness + felt.tie).max(felt.drag),
            };
            let load = load(dt, felt.force, (weight, sum), stiffness);
            loads[copies[v] as usize].add(load);
        });
    }

    /// The same of all parts, with blocks in place of bounds.
    pub fn load_vertices<S: Real>(
        &self,
        places: Places<'_, S>,
        dt: f64,
        of_vertices: &mut OfVertices,
        loads: &mut [Point<S>],
    ) {
        let copies = &places.layout.copy_offsets;
        for part in 0..places.layout.part_count() {
            self.each_vertex(places.x, part, |v, weight, sum, felt| {
                loads[copies[v] as usize].add(load(dt, felt.force, (weight, 0.0), 0.0));
                let block = felt.curvature() * (dt * dt * weight.abs() * sum);
                of_vertices.add(v as u32, block);
            });
        }
    }

    /// As [`Pairs::add_forces`] in the middle of a small step of explicit motion: samples slip where they are, and the bound
    /// is a `share` of the curvature that they may have after moving by half the thickness.
    pub fn add_forces_in_motion<S: Real>(
        &mut self,
        Places { layout, x }: Places<'_, S>,
        part: usize,
        (dt, share): (f64, f64),
        loads: &mut [Point<S>],
    ) {
        for number in self.range(part) {
            let (pair, stencil) = (&mut self.pairs[number], self.stencils.of(number));
            let felt = pair.slip_now(stencil.away(x));
            let stiffness = share * pair.stiffness_near(&felt);
            let sum = stencil.size();
            for (v, weight) in stencil.each() {
                let load = load(dt, felt.force, (weight, sum), stiffness);
                loads[layout.copy_offsets[v] as usize].add(load);
            }
        }
    }

    /// Samples slip where the step has ended.
    pub fn slip<S: Real>(&mut self, x: &[Point<S>], part: usize) {
        for number in self.range(part) {
            self.pairs[number].slip_now(self.stencils.of(number).away(x));
        }
    }

    /// Puts a part back to where its step begins.
    pub fn begin_again(&mut self, part: usize) {
        let range = self.range(part);
        self.pairs[range.clone()].copy_from_slice(&self.at_start[range]);
    }

    fn range(&self, part: usize) -> std::ops::Range<usize> {
        match (self.first.get(part), self.first.get(part + 1)) {
            (Some(&start), Some(&end)) => start..end,
            _ => 0..0,
        }
    }

    /// What is kept of a step that has ended at `x`.
    pub fn end<S: Real>(&self, places: Places<'_, S>, kept: &mut Vec<Kept>, torn: &mut [bool]) {
        kept.clear();
        let Places { layout, x } = places;
        let Some(skin) = &layout.skin else { return };
        for part in 0..layout.part_count() {
            self.each(places, part, |pair, sample, away, felt| {
                if let Bond::Tie { number, .. } = pair.bond {
                    let strength = skin.skin.ties[number as usize].strength;
                    torn[number as usize] |= felt.force.length() > strength;
                    return;
                }
                let corner = |point: u32| {
                    let point = &skin.skin.points[point as usize];
                    let all = point.vertices.iter().zip(&point.weights);
                    all.fold(Vec3::ZERO, |sum, (&v, &weight)| {
                        sum + x[v as usize].vec3().cast::<f64>() * weight
                    })
                };
                let corners = skin.skin.triangles[pair.triangle as usize].map(corner);
                kept.extend(pair.keep(sample.number, away, felt, corners));
            });
        }
    }
}

/// `dt^2` times a force [N] at a vertex of this weight, with a bound of stiffness [N/m].
fn load<S: Real>(dt: f64, force: Vec3<f64>, (weight, sum): (f64, f64), stiffness: f64) -> Point<S> {
    let squared = dt * dt;
    let bound = S::from_f64(squared * stiffness * weight.abs() * sum);
    Point::new((force * (squared * weight)).cast(), bound)
}
