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
#![allow(unsafe_code)]

use super::parts::{Phase, Progress};
use super::vectors::{Combination, Factors, MOST_DOTS};
use super::{Memory, Pair, vectors};
use std::ops::Range;

use crate::layout::{Layout, Part};
use crate::scalar::{Real, Vec3};
use crate::settings::MOST_HISTORY;
use crate::solver::cpu::threads::{Shared, Workers};
use crate::solver::step::data::{Step, StepConstants, StepData};
use crate::solver::step::groups::Groups;
use crate::state::{Learned, LearnedPart};

/// Of the bound of the curvature along a first direction this much counts at least: where the exact curvature nearly
/// vanishes, or is negative, the step would have no end.
const LEAST_CURVATURE: f64 = 0.1;

/// Vectors that a direction is a sum of, at most, besides that of the preconditioner.
const MOST_TERMS: usize = 2 * MOST_HISTORY;

impl<S: Real> Memory<S> {
    /// [`super::stage::QuasiNewtonStage::Precondition`].
    pub(super) fn precondition(
        &mut self,
        step: &Step<'_, S>,
        data: &StepData<S>,
        learned: &mut Learned<S>,
    ) {
        let StepConstants { workers, groups, .. } = &data.constants;
        let is_new = |progress: &Progress| progress.acts() && progress.accepted;
        for (number, part) in step.layout.parts.iter().enumerate() {
            if !is_new(&self.parts[number]) {
                continue;
            }
            let range = part.vertices.clone();
            let Self { preconditioner, trial_z, gradient, .. } = self;
            let (r, into) = (&gradient[range.clone()], &mut trial_z[range.clone()]);
            preconditioner.apply(workers, number, r, into);
            if self.has_new_pair[number] {
                let slot = next_slot(self.history(), &learned.parts[number]);
                let Self { trial_z, z, images, .. } = self;
                let image = Pair::places(slot, step.layout.vertex_count(), &range).image;
                let (new, images) = (&trial_z[range.clone()], Shared::new(&mut images[image]));
                let z = Shared::new(&mut z[range]);
                vectors::each_piece(workers, new.len(), |range| {
                    // SAFETY: pieces do not overlap.
                    let (images, z) =
                        unsafe { (images.range(range.clone()), z.range(range.clone())) };
                    for ((image, z), new) in images.iter_mut().zip(z).zip(&new[range]) {
                        (*image, *z) = (*new - *z, *new);
                    }
                });
            } else {
                let Self { trial_z, z, .. } = self;
                z[range.clone()].copy_from_slice(&trial_z[range]);
            }
        }
        for number in 0..step.layout.part_count() {
            let keeps = is_new(&self.parts[number]) && self.has_new_pair[number];
            if keeps && groups.leads(number) {
                self.keep_pair(step.layout, (workers, groups), number, learned);
            }
        }
    }

    /// Takes over the pair that [`Memory::judge`] has left behind the newest one of a part's group, and its image, if it tells
    /// a curvature.
    fn keep_pair(
        &mut self,
        layout: &Layout<S>,
        (workers, groups): (&Workers, &Groups),
        number: usize,
        learned: &mut Learned<S>,
    ) {
        let slot = next_slot(self.history(), &learned.parts[number]);
        let most = self.history_of(groups, number);
        let before = learned.parts[number];
        let count = (before.count as usize + 1).min(most);
        let mut kept = LearnedPart { count: count as u32, newest: slot as u32, ..before };
        self.multiply_pair(layout, (workers, groups), number, &learned.pairs, (&kept, slot));
        let products = &self.parts[number].products;
        let (sy, yw) = (products.sy[slot][slot], products.yw[slot][slot]);
        if sy > 0.0 && yw > 0.0 && (sy / yw).is_finite() {
            kept.scale = sy / yw;
        } else {
            // Negative curvature says nothing of the way to the minimum. An older pair may be gone: it was overwritten.
            let lost = before.count as usize == most;
            kept = LearnedPart { count: before.count - u32::from(lost), ..before };
        }
        for part in groups.of(number) {
            let LearnedPart { count, newest, scale, .. } = kept;
            learned.parts[part] = LearnedPart { count, newest, scale, ..learned.parts[part] };
        }
    }

    /// Pairs that the group of a part keeps at most.
    pub(super) fn history_of(&self, groups: &Groups, number: usize) -> usize {
        groups.of(number).map(|part| self.choices[part].history).min().unwrap_or(0)
    }

    /// Products of a pair of a part's group, of which so much is `kept`, with itself and with older ones. The recursion reads
    /// `s` of the older with `y` of the newer.
    fn multiply_pair(
        &mut self,
        layout: &Layout<S>,
        (workers, groups): (&Workers, &Groups),
        number: usize,
        pairs: &[Vec3<S>],
        (kept, slot): (&LearnedPart, usize),
    ) {
        let vertices = layout.vertex_count();
        let ring = self.history();
        let others = || slots(ring, kept.count, kept.newest).skip_while(|&other| other != slot);
        let count = 2 * others().count();
        let mut found = [0.0; MOST_DOTS];
        for part in groups.of(number).map(|part| &layout.parts[part]) {
            let this = Pair::places(slot, vertices, &part.vertices);
            let (y, image) = (&pairs[this.y], &self.images[this.image]);
            let mut factors: [Factors<'_, S>; MOST_DOTS] = [(y, y); MOST_DOTS];
            for (factors, other) in factors.as_chunks_mut::<2>().0.iter_mut().zip(others()) {
                let that = Pair::places(other, vertices, &part.vertices);
                *factors = [(&pairs[that.s], y), (&pairs[that.y], image)];
            }
            vectors::add_dots(workers, &factors[..count], &mut found[..count]);
        }
        let products = &mut self.parts[number].products;
        for (&[sy, yw], other) in found.as_chunks::<2>().0.iter().zip(others()) {
            products.sy[other][slot] = sy;
            (products.yw[slot][other], products.yw[other][slot]) = (yw, yw);
        }
    }

    /// Images of all pairs of every part under the preconditioner as it is now, and their products.
    pub(super) fn renew_pairs(
        &mut self,
        layout: &Layout<S>,
        constants: &StepConstants<S>,
        learned: &Learned<S>,
    ) {
        let StepConstants { workers, groups, .. } = constants;
        let vertices = layout.vertex_count();
        for (number, part) in layout.parts.iter().enumerate() {
            let kept = learned.parts[number];
            for slot in slots(self.history(), kept.count, kept.newest) {
                let Pair { y, image, .. } = Pair::places(slot, vertices, &part.vertices);
                let Self { preconditioner, images, .. } = self;
                preconditioner.apply(workers, number, &learned.pairs[y], &mut images[image]);
            }
        }
        for number in (0..layout.part_count()).filter(|&number| groups.leads(number)) {
            let kept = &learned.parts[number];
            for slot in slots(self.history(), kept.count, kept.newest) {
                let pairs = &learned.pairs;
                self.multiply_pair(layout, (workers, groups), number, pairs, (kept, slot));
            }
        }
    }

    /// [`super::stage::QuasiNewtonStage::ChooseDirection`].
    pub(super) fn choose_directions(
        &mut self,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        learned: &mut Learned<S>,
    ) {
        for number in 0..step.layout.part_count() {
            if data.constants.groups.leads(number) {
                self.choose_direction(step, data, learned, number);
            }
        }
    }

    /// Of a group, by the part that leads it.
    fn choose_direction(
        &mut self,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        learned: &mut Learned<S>,
        number: usize,
    ) {
        let progress = &mut self.parts[number];
        // Without pairs there is nothing to forget: the length goes on shrinking.
        let mut forgets =
            progress.failures >= super::MOST_FAILURES && learned.parts[number].count > 0;
        let is_iterating = progress.acts() && progress.phase == Phase::Iterating;
        if !(is_iterating && (progress.accepted || forgets)) {
            return;
        }
        if forgets {
            progress.failures = 0;
        }
        let StepConstants { workers, groups, .. } = &data.constants;
        let mut slope = f64::NAN;
        if learned.parts[number].count > 0 && !forgets {
            slope = self.recur(step.layout, (workers, groups), number, learned);
            self.parts[number].length = 1.0;
        }
        // A comparison that is false of what is no number as well.
        if !(slope < 0.0 && slope.is_finite()) {
            forgets = true;
            slope = self.combine_all(step.layout, (workers, groups), number);
            self.parts[number].length = self.first_length(step, data, number, slope);
        }
        self.parts[number].slope = slope;
        self.stop_at_resolution(number);
        let lead = self.parts[number];
        for part in data.constants.groups.of(number) {
            if forgets {
                learned.parts[part].count = 0;
            }
            let Progress { failures, length, slope, longest, phase, ahead, .. } = lead;
            let own = self.parts[part];
            self.parts[part] = Progress { failures, length, slope, longest, phase, ahead, ..own };
        }
    }

    /// The direction of a group as the preconditioner alone has it; returns its slope [J s^2].
    fn combine_all(
        &mut self,
        layout: &Layout<S>,
        (workers, groups): (&Workers, &Groups),
        number: usize,
    ) -> f64 {
        let mut all = [0.0; 2];
        for part in groups.of(number) {
            let vertices = layout.parts[part].vertices.clone();
            let found = self.combine(workers, vertices, -S::ONE, &[]);
            all = vectors::both(all, found);
        }
        self.parts[number].longest = all[1].sqrt();
        all[0]
    }

    /// The direction as a sum of vectors of a part: of `z` and others, times these numbers. Returns its slope [J s^2] and the
    /// square of its longest vector.
    fn combine(
        &mut self,
        workers: &Workers,
        range: Range<usize>,
        scale: S,
        terms: &[(S, &[Vec3<S>])],
    ) -> [f64; 2] {
        let Self { z, direction, gradient, pinned, .. } = self;
        let (z, pinned) = (&z[range.clone()], &pinned[range.clone()]);
        let all = Combination { z, scale, terms, pinned };
        all.find(workers, &gradient[range.clone()], &mut direction[range])
    }

    /// The length of a direction of a group that no pair has scaled: to the minimum along it, as curvature tells.
    fn first_length(
        &mut self,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        number: usize,
        slope: f64,
    ) -> f64 {
        let Self { evaluation, direction, direction_points, base, stage_start, .. } = self;
        let members = data.constants.groups.range(number);
        for part in data.constants.groups.of(number) {
            for v in step.layout.parts[part].vertices.clone() {
                direction_points[v].set_vec3(direction[v]);
            }
        }
        let moments = super::moments(step, stage_start);
        let [mut exact, mut bound] = [0.0; 2];
        for place in members {
            let part = data.constants.groups.member(place);
            let constants = &mut data.constants;
            let found =
                evaluation.curvature(constants, step, &moments, base, direction_points, part);
            (exact, bound) = (exact + found[0], bound + found[1]);
        }
        let length = -slope / exact.max(LEAST_CURVATURE * bound);
        if length.is_finite() && length > 0.0 { length } else { 0.0 }
    }

    /// The direction of a group by the two loops; returns its slope [J s^2].
    fn recur(
        &mut self,
        layout: &Layout<S>,
        (workers, groups): (&Workers, &Groups),
        number: usize,
        learned: &Learned<S>,
    ) -> f64 {
        let vertices = layout.vertex_count();
        let kept = learned.parts[number];
        let ring = self.history();
        let order = || slots(ring, kept.count, kept.newest);
        let count = 2 * kept.count as usize;
        let mut found = [0.0; MOST_DOTS];
        for part in groups.of(number).map(|part| &layout.parts[part]) {
            let g = &self.gradient[part.vertices.clone()];
            let mut factors: [Factors<'_, S>; MOST_DOTS] = [(g, g); MOST_DOTS];
            for (factors, slot) in factors.as_chunks_mut::<2>().0.iter_mut().zip(order()) {
                let Pair { s, image, .. } = Pair::places(slot, vertices, &part.vertices);
                *factors = [(&learned.pairs[s], g), (&self.images[image], g)];
            }
            vectors::add_dots(workers, &factors[..count], &mut found[..count]);
        }
        let mut with_gradient = [[0.0; 2]; MOST_HISTORY];
        for (&found, slot) in found.as_chunks::<2>().0.iter().zip(order()) {
            with_gradient[slot] = found;
        }
        let products = &self.parts[number].products;
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
        // Taken out, and put back: the direction is written meanwhile.
        let images = std::mem::take(&mut self.images);
        let mut all = [0.0; 2];
        for part in groups.of(number) {
            let range = layout.parts[part].vertices.clone();
            let mut terms: [(S, &[Vec3<S>]); MOST_TERMS] = [(S::ZERO, &[]); MOST_TERMS];
            for (terms, i) in terms.as_chunks_mut::<2>().0.iter_mut().zip(order()) {
                let Pair { s, image, .. } = Pair::places(i, vertices, &range);
                let (of_image, of_step) = (S::from_f64(scale * a[i]), S::from_f64(-c[i]));
                *terms = [(of_image, &images[image]), (of_step, &learned.pairs[s])];
            }
            let found = self.combine(workers, range, S::from_f64(-scale), &terms[..count]);
            all = vectors::both(all, found);
        }
        self.images = images;
        self.parts[number].longest = all[1].sqrt();
        all[0]
    }

    /// Ends the solve of a part whose next step is round-off.
    fn stop_at_resolution(&mut self, number: usize) {
        let progress = &mut self.parts[number];
        let longest = progress.length * progress.longest;
        if !(longest > progress.resolution && longest.is_finite()) {
            progress.phase = Phase::Done;
            progress.ahead = false;
        }
    }

    /// Goes over to an accepted trial, and leaves the pair of the step there behind the newest one, if it tells more than
    /// round-off.
    pub(super) fn take_over(
        &mut self,
        vertices: usize,
        number: usize,
        part: &Part,
        data: &StepData<S>,
        learned: &mut Learned<S>,
    ) {
        let range = part.vertices.clone();
        let progress = &self.parts[number];
        let leaves_pair = progress.phase == Phase::Iterating && progress.is_clear();
        self.has_new_pair[number] = leaves_pair;
        let ring = self.history();
        let Self { base, gradient, trial_gradient, .. } = self;
        let (x, g) = (&mut base[range.clone()], &mut gradient[range.clone()]);
        let (y, trial) = (&data.points[range.clone()], &trial_gradient[range.clone()]);
        if !leaves_pair {
            x.copy_from_slice(y);
            g.copy_from_slice(trial);
            return;
        }
        let slot = next_slot(ring, &learned.parts[number]);
        let pair = Pair::places(slot, vertices, &range);
        let (s, change) = learned.pairs.split_at_mut(pair.y.start);
        let (s, change) = (Shared::new(&mut s[pair.s]), Shared::new(&mut change[..range.len()]));
        let (x, g) = (Shared::new(x), Shared::new(g));
        vectors::each_piece(&data.constants.workers, range.len(), |range| {
            for i in range {
                // SAFETY: pieces do not overlap.
                let (s, change, x, g) = unsafe { (s.at(i), change.at(i), x.at(i), g.at(i)) };
                (*s, *change) = (y[i].vec3() - x.vec3(), trial[i] - *g);
                (*x, *g) = (y[i], trial[i]);
            }
        });
    }
}

/// The place of the next pair. All parts have places for as many, whatever number of them they use: what was kept with
/// other settings stands where it is looked for.
fn next_slot(history: usize, kept: &LearnedPart) -> usize {
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
