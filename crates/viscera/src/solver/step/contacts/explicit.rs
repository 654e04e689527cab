//! Contact in explicit motion: samples slip, planes follow, and tools do work in every small step.

use super::{ContactStep, Contacts, spread};
use crate::contact::Placed;
use crate::scalar::Real;
use crate::scalar::lanes::Point;

impl Contacts {
    /// As [`Contacts::add_forces`] in the middle of a small step [s] of a whole one: samples slip where they are, and the bound
    /// is a `share` of the curvature that they may have after moving by half the thickness.
    pub fn add_forces_in_motion<S: Real>(
        &mut self,
        (whole, small): (&ContactStep<'_, S>, f64),
        part: usize,
        x: &[Point<S>],
        share: f64,
        loads: &mut [Point<S>],
    ) {
        let step = ContactStep { dt: small, ..*whole };
        let mut work = 0.0;
        for place in self.range(part).unwrap_or_default() {
            let touching = &mut self.touching[place];
            let sample = &whole.layout.samples[touching.sample as usize];
            let number = touching.tool as usize;
            let tool = &whole.tools[number];
            let placed = Placed { shape: &tool.shape, pose: &self.poses[number] };
            let at = sample.place(x);
            let felt = touching.slip(tool, placed, at);
            let stiffness = share * (touching.stiffness_near(tool, &felt) + felt.turning);
            spread(&step, sample, (felt.force, stiffness), loads);
            let arm = at - self.poses[number].translation;
            work += self.work_of(whole.tools, number, felt.force, arm);
        }
        self.pairs.add_forces_in_motion(whole.places(x), part, (small, share), loads);
        if let Some(gift) = self.gifts.get_mut(part) {
            *gift.exact.get_or_insert(0.0) += work * small / whole.dt;
        }
    }

    /// Samples slip where the step has ended: what has left a tool is free of friction.
    pub fn slip<S: Real>(&mut self, step: &ContactStep<'_, S>, part: usize, x: &[Point<S>]) {
        for place in self.range(part).unwrap_or_default() {
            let touching = &mut self.touching[place];
            let number = touching.tool as usize;
            let tool = &step.tools[number];
            let placed = Placed { shape: &tool.shape, pose: &self.poses[number] };
            touching.slip(tool, placed, step.layout.samples[touching.sample as usize].place(x));
        }
        self.pairs.slip(x, part);
    }

    /// Puts a part back to where its step begins: it has not slipped, and tools have done no work.
    pub fn begin_again(&mut self, part: usize) {
        let range = self.range(part).unwrap_or_default();
        self.touching[range.clone()].copy_from_slice(&self.at_start[range]);
        self.pairs.begin_again(part);
        if let Some(gift) = self.gifts.get_mut(part) {
            gift.exact = Some(0.0);
        }
    }
}
