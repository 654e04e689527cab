//! The guard of explicit steps: no step ends with more energy than it had and was given.
//!
//! Velocities are scaled down where the energy limit asks for it (`step/energy.rs`). A part that stores more than all of that
//! takes its step again in shorter small steps, and in the end goes downhill from where it began.

use super::Memory;
use super::present::SmallSteps;
use crate::scalar::{Real, Vec3};
use crate::solver::step::data::{Step, StepConstants, StepData, copies_of};
use crate::solver::step::strain::put_strains;
use crate::state::{Learned, State};

/// Small steps of a step that is taken again, at most.
const MOST_AGAIN: f64 = 100_000.0;

/// The share of all energy that may come back after it has gone.
const SWING: f64 = 0.1;

impl<S: Real> Memory<S> {
    /// Takes the step of some parts again from its beginning, in more small steps.
    fn take_again(
        &mut self,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        times: u32,
        again: impl Fn(&Self, usize) -> bool,
    ) -> bool {
        let mut any = false;
        for (number, part) in step.layout.parts.iter().enumerate() {
            if again(self, number) {
                any = true;
                let count = (step.dt / self.of_loads[number]).ceil() * f64::from(times);
                let small = &mut self.small_steps[number];
                *small = SmallSteps::new(number, count.min(MOST_AGAIN) as u32, step.dt);
                small.was_violent = true;
                let range = part.vertices.clone();
                data.points[range.clone()].copy_from_slice(&data.constants.previous[range.clone()]);
                data.velocities[range.clone()].copy_from_slice(&self.start_velocities[range]);
            }
        }
        if any {
            self.start(step, data);
            while !self.is_all_done() {
                self.load_forces(step, data);
                self.advance(step, data);
            }
        }
        any
    }

    /// Parts that still store more than they had and were given go downhill from where the step began, without speed:
    /// `x = x_n + f/k`.
    fn relax_the_rest(&mut self, step: &Step<'_, S>, data: &mut StepData<S>, round_off: f64) {
        let mut any = false;
        for (number, part) in step.layout.parts.iter().enumerate() {
            let small = &mut self.small_steps[number];
            small.left = u32::from(self.energies.stores_too_much(number, round_off));
            if small.left > 0 {
                (any, small.since) = (true, 0);
                data.constants.contacts.begin_again(number);
                let range = part.vertices.clone();
                data.points[range.clone()].copy_from_slice(&data.constants.previous[range.clone()]);
                data.velocities[range].fill(Vec3::ZERO);
            }
        }
        if !any {
            return;
        }
        for pin in &step.inputs.pins {
            let v = step.layout.numbering.of(pin.vertex);
            if self.small_steps[step.layout.part_at(v)].left > 0 {
                data.points[v].set_vec3(pin.target);
            }
        }
        self.load_forces(step, data);
        let Self { small_steps, at_rest, of_loads, .. } = self;
        let StepData { constants, points, loads, .. } = data;
        for (number, part) in step.layout.parts.iter().enumerate() {
            let small = &mut small_steps[number];
            if std::mem::take(&mut small.left) > 0 {
                of_loads[number] = small.dt;
                at_rest.gather(constants, step.layout, part, small.dt, loads);
                constants.each_vertex(part, points, |v, point| {
                    let load = loads[copies_of(step.layout, v).start];
                    if constants.inverse_masses[v] != S::ZERO && load.w > S::ZERO {
                        let down = load.vec3() * (constants.inverse_masses[v] / load.w);
                        point.set_vec3(point.vec3() + down);
                    }
                });
            }
        }
        self.slip(step, data);
        self.evaluate(step, data);
        self.energies.end(step, data, &self.evaluator.stored);
    }

    /// Samples slip to where the step has ended.
    fn slip(&self, step: &Step<'_, S>, data: &mut StepData<S>) {
        let StepData { constants, points, .. } = data;
        constants.contacts.place(&step.contact(), 1.0);
        for number in 0..step.layout.part_count() {
            constants.contacts.slip(&step.contact(), number, points);
        }
    }

    /// Energies before the step, pins moved.
    pub(super) fn begin_energy(
        &mut self,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        learned: &Learned<S>,
    ) {
        let model = step.layout;
        let StepData { constants, points, .. } = data;
        if model.is_viscous() {
            for number in 0..model.part_count() {
                put_strains(constants, model, number, points, S::ZERO);
            }
        }
        for pin in &step.inputs.pins {
            points[model.numbering.of(pin.vertex)].set_vec3(pin.target);
        }
        self.evaluate(step, data);
        self.energies.begin(step, data, &self.evaluator.stored);
        for (number, part) in learned.parts.iter().enumerate() {
            self.energies.give(number, part.owed);
        }
        let StepData { constants, points, .. } = data;
        for pin in &step.inputs.pins {
            let v = model.numbering.of(pin.vertex);
            points[v] = constants.previous[v];
        }
    }

    /// No part ends a step with more energy than it had and was given. The energy of symplectic steps swings about its mean
    /// by a share of that of fast oscillations: what has gone may come back, or every swing would brake the body, until a
    /// hand moves it. A part that nothing holds is left alone until its motion is violent: the limit would brake its spin.
    pub(super) fn limit_energy(
        &mut self,
        step: &Step<'_, S>,
        data: &mut StepData<S>,
        state: &mut State<S>,
    ) {
        let round_off = 8.0 * S::EPSILON.max(1e-12);
        for times in [4, 16, 0] {
            self.slip(step, data);
            self.evaluate(step, data);
            self.energies.end(step, data, &self.evaluator.stored);
            // Velocities cannot give back what is stored.
            let again = |memory: &Self, number: usize| {
                times > 0 && memory.energies.stores_too_much(number, round_off)
            };
            if !self.take_again(step, data, times, again) {
                break;
            }
        }
        self.relax_the_rest(step, data, round_off);
        let (model, small_steps) = (step.layout, &self.small_steps);
        let limits = |number: usize, constants: &StepConstants<S>| {
            small_steps[number].was_violent
                || constants.contacts.gift(number).is_near
                || constants.rests(number, &model.parts[number])
        };
        self.energies.limit(step, data, limits, |_, _| {});
        for (number, part) in state.learned.parts.iter_mut().enumerate() {
            // Once for a group.
            let is_first = data.constants.groups.leads(number);
            part.owed = if is_first { self.energies.left(number, SWING) } else { 0.0 };
        }
        for pin in &step.inputs.pins {
            let v = model.numbering.of(pin.vertex);
            if data.constants.previous[v].vec3() != pin.target {
                state.learned.parts[model.part_at(v)].owed = 0.0;
            }
        }
    }

    /// What every part stores where it is [J].
    fn evaluate(&mut self, step: &Step<'_, S>, data: &mut StepData<S>) {
        let StepData { constants, points, .. } = data;
        constants.contacts.place(&step.contact(), 1.0);
        let leads = |number: &usize| constants.groups.leads(*number);
        for number in (0..self.small_steps.len()).filter(leads) {
            let step = Step { dt: self.small_steps[number].dt, ..*step };
            self.evaluator.evaluate(constants, &step, points, number);
        }
        for number in 0..self.small_steps.len() {
            self.evaluator.add_recovered(constants, step.layout, points, number);
        }
    }
}
