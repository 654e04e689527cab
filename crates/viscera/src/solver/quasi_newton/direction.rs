//! Directions of descent: limited-memory BFGS about the preconditioner.
//!
//! ```text
//! q = g;  from the newest pair:  a_i = s_i.q/s_i.y_i,  q -= a_i y_i
//! r = c M q;  from the oldest:  b = y_i.r/s_i.y_i,  r += (a_i - b) s_i;   d = -r,   c = s.y/y.M y of the newest
//! ```
//!
//! Nocedal, Wright, "Numerical Optimization", 2006, algorithm 7.4, with `z = M g` and `w_i = M y_i` at hand: then
//! `M q = z - sum a_i w_i`, and one application of the preconditioner per iteration is enough. The recursion itself
//! works on inner products.

use super::parts::{Phase, Products, Progress};
use super::{Memory, Pair, vectors};
use crate::layout::{Layout, Part};
use crate::scalar::{Real, Vec3};
use crate::settings::MOST_HISTORY;
use crate::solver::cpu::threads::Workers;
use crate::solver::step::data::{Step, StepData};
use crate::state::Learned;

/// Of the bound of the curvature along a first direction this much counts at least: where the exact curvature nearly
/// vanishes, or is negative, the step would have no end.
const LEAST_CURVATURE: f64 = 0.1;

/// Pairs are kept of steps above this many resolutions: of shorter ones the change of the gradient is round-off.
const CLEAR_STEP: f64 = 16.0;

impl<S: Real> Memory<S> {
    /// [`super::stage::QuasiNewtonStage::Precondition`].
    pub(super) fn precondition(
        &mut self,
        step: &Step<'_, S>,
        workers: &Workers,
        learned: &mut Learned<S>,
    ) {
        for (number, part) in step.layout.parts.iter().enumerate() {
            let progress = self.parts[number];
            if !(progress.acts() && progress.accepted) {
                continue;
            }
            let range = part.vertices.clone();
            let Self { preconditioner, trial_z, gradient, .. } = self;
            preconditioner.apply(number, &gradient[range.clone()], &mut trial_z[range.clone()]);
            if self.has_new_pair[number] {
                self.keep_pair(step.layout, workers, number, learned);
            }
            let Self { trial_z, z, .. } = self;
            z[range.clone()].copy_from_slice(&trial_z[range]);
        }
    }

    /// Takes the pair that [`Memory::judge`] has left behind the newest one over, if it tells a curvature.
    fn keep_pair(
        &mut self,
        layout: &Layout<S>,
        workers: &Workers,
        number: usize,
        learned: &mut Learned<S>,
    ) {
        let (vertices, part) = (layout.vertex_count(), &layout.parts[number]);
        let slot = next_slot(self.history(), &learned.parts[number]);
        let Pair { image, .. } = Pair::places(slot, vertices, &part.vertices);
        for (v, place) in part.vertices.clone().zip(image) {
            self.images[place] = self.trial_z[v] - self.z[v];
        }
        let kept = &mut learned.parts[number];
        let count = (kept.count as usize + 1).min(self.choices[number].history);
        let before = *kept;
        (kept.count, kept.newest) = (count as u32, slot as u32);
        self.multiply_pair(layout, workers, number, learned, slot);
        let products = &self.parts[number].products;
        let (sy, yw) = (products.sy[slot][slot], products.yw[slot][slot]);
        if sy > 0.0 && yw > 0.0 && (sy / yw).is_finite() {
            learned.parts[number].scale = sy / yw;
        } else {
            // Negative curvature says nothing of the way to the minimum. An older pair may be gone: it was overwritten.
            let lost = before.count as usize == self.choices[number].history;
            let count = before.count - u32::from(lost);
            learned.parts[number] = crate::state::LearnedPart { count, ..before };
        }
    }

    /// Products of one pair with all others.
    fn multiply_pair(
        &mut self,
        layout: &Layout<S>,
        workers: &Workers,
        number: usize,
        learned: &Learned<S>,
        slot: usize,
    ) {
        let (vertices, part) = (layout.vertex_count(), &layout.parts[number]);
        let kept = learned.parts[number];
        let this = Pair::places(slot, vertices, &part.vertices);
        for other in slots(self.history(), kept.count, kept.newest) {
            let that = Pair::places(other, vertices, &part.vertices);
            let (s, y) = (&learned.pairs[this.s.clone()], &learned.pairs[this.y.clone()]);
            let (other_s, other_y) = (&learned.pairs[that.s], &learned.pairs[that.y]);
            let sy = vectors::dot(workers, s, other_y);
            let ys = if other == slot { sy } else { vectors::dot(workers, other_s, y) };
            let yw = vectors::dot(workers, other_y, &self.images[this.image.clone()]);
            let Products { sy: all, yw: images } = &mut self.parts[number].products;
            (all[slot][other], all[other][slot]) = (sy, ys);
            (images[slot][other], images[other][slot]) = (yw, yw);
        }
    }

    /// Images of all pairs of a part under the preconditioner as it is now, and their products.
    pub(super) fn renew_pairs(
        &mut self,
        layout: &Layout<S>,
        workers: &Workers,
        number: usize,
        learned: &Learned<S>,
    ) {
        let (vertices, part) = (layout.vertex_count(), &layout.parts[number]);
        let kept = learned.parts[number];
        for slot in slots(self.history(), kept.count, kept.newest) {
            let Pair { y, image, .. } = Pair::places(slot, vertices, &part.vertices);
            self.preconditioner.apply(number, &learned.pairs[y], &mut self.images[image]);
        }
        for slot in slots(self.history(), kept.count, kept.newest) {
            self.multiply_pair(layout, workers, number, learned, slot);
        }
    }

    /// [`super::stage::QuasiNewtonStage::ChooseDirection`].
    pub(super) fn choose_direction(
        &mut self,
        step: &Step<'_, S>,
        data: &StepData<S>,
        learned: &mut Learned<S>,
    ) {
        let workers = &data.constants.workers;
        for (number, part) in step.layout.parts.iter().enumerate() {
            let progress = self.parts[number];
            // Without pairs there is nothing to forget: the length goes on shrinking.
            let forgets =
                progress.failures >= super::MOST_FAILURES && learned.parts[number].count > 0;
            let is_iterating = progress.acts() && progress.phase == Phase::Iterating;
            if !(is_iterating && (progress.accepted || forgets)) {
                continue;
            }
            if forgets {
                learned.parts[number].count = 0;
                self.parts[number].failures = 0;
            }
            let mut slope = f64::NAN;
            if learned.parts[number].count > 0 {
                self.recur(step.layout, workers, number, learned);
                slope = self.slope(workers, part);
                self.parts[number].length = 1.0;
            }
            // A comparison that is false of what is no number as well.
            if !(slope < 0.0 && slope.is_finite()) {
                learned.parts[number].count = 0;
                for v in part.vertices.clone() {
                    self.direction[v] = -self.z[v];
                }
                slope = self.slope(workers, part);
                self.parts[number].length = self.first_length(step, data, number, slope);
            }
            self.parts[number].slope = slope;
            self.stop_at_resolution(number, part);
        }
    }

    fn slope(&self, workers: &Workers, part: &Part) -> f64 {
        let range = part.vertices.clone();
        vectors::dot(workers, &self.gradient[range.clone()], &self.direction[range])
    }

    /// The length of a direction that no pair has scaled: to the minimum along it, as curvature tells.
    fn first_length(
        &mut self,
        step: &Step<'_, S>,
        data: &StepData<S>,
        number: usize,
        slope: f64,
    ) -> f64 {
        let Self { evaluation, direction, direction_points, base, stage_start, .. } = self;
        for v in step.layout.parts[number].vertices.clone() {
            direction_points[v].set_vec3(direction[v]);
        }
        let moments = super::moments(step, stage_start);
        let [exact, bound] =
            evaluation.curvature(&data.constants, step, &moments, base, direction_points, number);
        let length = -slope / exact.max(LEAST_CURVATURE * bound);
        if length.is_finite() && length > 0.0 { length } else { 0.0 }
    }

    /// The direction by the two loops.
    fn recur(
        &mut self,
        layout: &Layout<S>,
        workers: &Workers,
        number: usize,
        learned: &Learned<S>,
    ) {
        let (vertices, part) = (layout.vertex_count(), &layout.parts[number]);
        let kept = learned.parts[number];
        let range = part.vertices.clone();
        let ring = self.history();
        let mut with_gradient = [[0.0; 2]; MOST_HISTORY];
        for slot in slots(ring, kept.count, kept.newest) {
            let Pair { s, image, .. } = Pair::places(slot, vertices, &range);
            let g = &self.gradient[range.clone()];
            with_gradient[slot] = [
                vectors::dot(workers, &learned.pairs[s], g),
                vectors::dot(workers, &self.images[image], g),
            ];
        }
        let products = &self.parts[number].products;
        let order = || slots(ring, kept.count, kept.newest);
        let (mut a, mut c) = ([0.0; MOST_HISTORY], [0.0; MOST_HISTORY]);
        for (k, i) in order().enumerate() {
            let newer: f64 = order().take(k).map(|j| a[j] * products.sy[i][j]).sum();
            a[i] = (with_gradient[i][0] - newer) / products.sy[i][i];
        }
        let scale = kept.scale;
        let oldest_first = || (0..kept.count as usize).rev();
        for k in oldest_first() {
            let i = order().nth(k).unwrap_or(0);
            let images: f64 = order().map(|j| a[j] * products.yw[i][j]).sum();
            let older: f64 = order().skip(k + 1).map(|j| c[j] * products.sy[j][i]).sum();
            let yr = scale * (with_gradient[i][1] - images) + older;
            c[i] = a[i] - yr / products.sy[i][i];
        }
        let Self { z, direction, images, .. } = self;
        let minus = S::from_f64(-scale);
        for v in range.clone() {
            direction[v] = z[v] * minus;
        }
        for i in order() {
            let Pair { s, image, .. } = Pair::places(i, vertices, &range);
            let (of_image, of_step) = (S::from_f64(scale * a[i]), S::from_f64(-c[i]));
            let pairs = learned.pairs[s].iter().zip(&images[image]);
            for (d, (s, w)) in direction[range.clone()].iter_mut().zip(pairs) {
                *d += *w * of_image + *s * of_step;
            }
        }
    }

    /// Ends the solve of a part whose next step is round-off. Pinned vertices do not move.
    fn stop_at_resolution(&mut self, number: usize, part: &Part) {
        let mut longest = S::ZERO;
        for v in part.vertices.clone() {
            if self.pinned[v] {
                self.direction[v] = Vec3::ZERO;
            }
            longest = longest.max(self.direction[v].length_squared());
        }
        let progress = &mut self.parts[number];
        let longest = progress.length * longest.to_f64().sqrt();
        if !(longest > progress.resolution && longest.is_finite()) {
            progress.phase = Phase::Done;
            progress.ahead = false;
        }
    }

    /// Leaves the pair of an accepted step behind the newest one, if it tells more than round-off.
    pub(super) fn offer_pair(
        &mut self,
        vertices: usize,
        number: usize,
        part: &Part,
        data: &StepData<S>,
        learned: &mut Learned<S>,
    ) {
        let slot = next_slot(self.history(), &learned.parts[number]);
        let Pair { s, y, .. } = Pair::places(slot, vertices, &part.vertices);
        let mut longest = S::ZERO;
        for v in part.vertices.clone() {
            let moved = data.points[v].vec3() - self.base[v].vec3();
            longest = longest.max(moved.length_squared());
        }
        let is_clear = longest.to_f64().sqrt() > CLEAR_STEP * self.parts[number].resolution;
        self.has_new_pair[number] = is_clear;
        if !is_clear {
            return;
        }
        for (v, (s, y)) in part.vertices.clone().zip(s.zip(y)) {
            learned.pairs[s] = data.points[v].vec3() - self.base[v].vec3();
            learned.pairs[y] = self.trial_gradient[v] - self.gradient[v];
        }
    }
}

/// The place of the next pair. All parts have places for as many, whatever number of them they use: what was kept with
/// other settings stands where it is looked for.
fn next_slot(history: usize, kept: &crate::state::LearnedPart) -> usize {
    if kept.count == 0 { 0 } else { (kept.newest as usize + 1) % history }
}

/// Places of the pairs in use, from the newest to the oldest.
fn slots(history: usize, count: u32, newest: u32) -> impl Iterator<Item = usize> {
    (0..count as usize).map(move |k| (newest as usize + history - k) % history)
}

impl Progress {
    /// Whether a trial that changed the potential by so much [J s^2] is good enough: Armijo's condition, with
    /// what round-off can pretend.
    pub fn suffices(&self, change: f64, size: f64, epsilon: f64) -> bool {
        // Where terms overflow, so does what round-off could be.
        change.is_finite()
            && change
                <= super::SUFFICIENT * self.length * self.slope + super::ROUNDED * epsilon * size
    }
}
