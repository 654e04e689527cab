//! A step: its inputs and constants, and what is sent.

use super::clock::Marks;
use super::inputs::norm_weights;
use super::limits::accelerates;
use super::outgoing::MOST_DISPATCHES;
use super::parts::SmallSteps;
use super::slots::Slot;
use super::solver::GpuSolver;
use super::uniforms::FrameConstants;
use crate::layout::{Layout, Part};
use crate::model::Model;
use crate::scalar::Vec3;
use crate::settings::RelaxationForm;
use crate::solver::error::StepError;
use crate::solver::explicit::{calm_ahead, small_steps};
use crate::solver::inputs::Inputs;
use crate::solver::quasi_newton::on_device::share;
use crate::solver::step::tethers::bundle;

/// Small steps are so much shorter where there are tools: they press tissue together, which makes it stiffer than at rest, and
/// a device does not know by how much.
const WITH_TOOLS: f64 = 0.5;

impl GpuSolver {
    /// Advances the state on the device by one step of `dt` [s]: one submission, or several where there are
    /// many small steps, and no waiting. On an error nothing has moved.
    pub fn step(
        &mut self,
        model: &Model<f32>,
        inputs: &Inputs<f32>,
        dt: f64,
    ) -> Result<(), StepError> {
        self.step_marked(model, inputs, dt, Marks::default())
    }

    /// As `count` calls of [`GpuSolver::step`], to the bit, in as few submissions as one of them; `act` gets the number of
    /// each step, from 1 on, and puts what acts in it into the inputs. Where a step fails the state is that of the step
    /// before it.
    pub fn steps(
        &mut self,
        model: &Model<f32>,
        inputs: &mut Inputs<f32>,
        dt: f64,
        count: u32,
        mut act: impl FnMut(u32, &mut Inputs<f32>),
    ) -> Result<(), StepError> {
        let recorded = (1..=count).try_for_each(|number| {
            act(number, inputs);
            self.record_step(model, inputs, dt, Marks::default())
        });
        self.outgoing.submit();
        recorded
    }

    /// Submissions of steps so far.
    pub fn submissions(&self) -> u64 {
        self.outgoing.submissions()
    }

    /// Bytes of inputs of steps that were sent so far.
    pub fn bytes_sent(&self) -> u64 {
        self.outgoing.bytes()
    }

    /// A step at whose beginning and end the device's clock may be read.
    pub(super) fn step_marked(
        &mut self,
        model: &Model<f32>,
        inputs: &Inputs<f32>,
        dt: f64,
        marks: Marks<'_>,
    ) -> Result<(), StepError> {
        let recorded = self.record_step(model, inputs, dt, marks);
        self.outgoing.submit();
        recorded
    }

    /// Puts a step behind what is on its way.
    #[inline(never)]
    fn record_step(
        &mut self,
        model: &Model<f32>,
        inputs: &Inputs<f32>,
        dt: f64,
        marks: Marks<'_>,
    ) -> Result<(), StepError> {
        let mut left = self.begin_step(model, inputs, dt)?;
        let most = self.most_repeats();
        let [prologue, body, epilogue] = self.ready.each_ref().map(Vec::as_slice);
        let uniforms = &self.uniforms.all;
        let mut lists = vec![prologue];
        let mut now = marks;
        while left > most {
            lists.extend(std::iter::repeat_n(body, most as usize));
            self.outgoing.pass("step", uniforms, &lists, now.before_the_end());
            self.outgoing.submit();
            now = marks.after_the_beginning();
            lists.clear();
            left -= most;
        }
        lists.extend(std::iter::repeat_n(body, left as usize));
        lists.push(epilogue);
        self.outgoing.pass("step", uniforms, &lists, now);
        self.multiplier_dt = dt * self.solve_share();
        Ok(())
    }

    /// Iterations, or small steps, in one submission.
    pub(super) fn most_repeats(&self) -> u32 {
        (MOST_DISPATCHES / self.ready[1].len().max(1)).max(1) as u32
    }

    /// Inputs and constants of a step; returns how many iterations, or small steps, it has.
    pub(super) fn begin_step(
        &mut self,
        model: &Model<f32>,
        inputs: &Inputs<f32>,
        dt: f64,
    ) -> Result<u32, StepError> {
        let layout = self.layout_of(model)?;
        self.check_bodies(model)?;
        let model = &*layout;
        crate::solver::inputs::check_step(dt, model, inputs)?;
        self.send_tools(&inputs.tools, dt)?;
        self.sent = Default::default();
        let count = match &self.stability {
            // One small step: the step itself.
            None => 1,
            Some(stability) => {
                bundle(model, inputs, &mut self.tethers);
                let share = if inputs.tools.is_empty() { 1.0 } else { WITH_TOOLS };
                let most = small_steps(dt, share * stability.step(model, &self.tethers))?;
                let mut held: Vec<bool> = model.parts.iter().map(Part::is_anchored).collect();
                let pins = inputs.pins.iter().map(|pin| model.numbering.of(pin.vertex));
                let holding = pins.chain(self.tethers.iter().map(|tether| tether.vertex));
                holding.for_each(|v| held[model.part_at(v)] = true);
                let stable = stability.steps(model, &self.tethers);
                for ((small, stable), is_held) in self.small_steps.iter_mut().zip(stable).zip(held)
                {
                    let ahead = calm_ahead(is_held);
                    *small = SmallSteps::new(small_steps(dt, share * stable)?, dt, ahead);
                }
                let bytes = bytemuck::cast_slice(&self.small_steps);
                self.buffers.send(&mut self.outgoing, Slot::SmallSteps, bytes);
                most
            }
        };
        if let Some(table) = self.levels.as_mut().and_then(|levels| levels.fit(model, inputs)) {
            self.put_levels(&table);
        }
        self.prepare_step(model, inputs, dt);
        self.passes = self.plan.passes(count);
        Ok(self.passes)
    }

    /// The share of a step that each of its solves takes, which what is left of it belongs to.
    pub(super) fn solve_share(&self) -> f64 {
        if self.levels.is_some() { share(&self.settings) } else { 1.0 }
    }

    pub(super) fn encoder(&self, label: &str) -> wgpu::CommandEncoder {
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some(label) };
        self.device.device.create_command_encoder(&descriptor)
    }

    /// Inputs and constants of a step.
    pub(super) fn prepare_step(&mut self, layout: &Layout<f32>, inputs: &Inputs<f32>, dt: f64) {
        self.collect_updates(layout, inputs, dt);
        let outgoing = &mut self.outgoing;
        self.buffers.send(outgoing, Slot::Updates, bytemuck::cast_slice(&self.updates_sent));
        if let Some(falls) = &mut self.falls
            && falls.find(layout, inputs.gravity, &self.updates)
        {
            self.buffers.send(outgoing, Slot::Falls, bytemuck::cast_slice(&falls.all));
        }
        let settings = &self.settings;
        let is_anchored = !layout.rest_anchors.is_empty();
        if is_anchored && (!inputs.anchors.is_empty() || self.has_moved_anchors) {
            self.has_moved_anchors = !inputs.anchors.is_empty();
            let row = |anchor: &Vec3<f32>| [anchor.x, anchor.y, anchor.z, 0.0];
            let rows: Vec<[f32; 4]> =
                inputs.anchors_of(&layout.rest_anchors).iter().map(row).collect();
            self.buffers.send(outgoing, Slot::Anchors, bytemuck::cast_slice(&rows));
        }
        let last = self.multiplier_dt;
        let rescale = match settings.keep_multipliers {
            // Pairs of steps of another length are forgotten.
            _ if self.levels.is_some() => f64::from(u8::from(dt == self.weights_dt)),
            false => 0.0,
            true if last > 0.0 && last != dt => (dt / last) * (dt / last),
            true => 1.0,
        };
        let is_new = std::mem::replace(&mut self.weights_dt, dt) != dt;
        if accelerates(settings) && is_new {
            let weights = norm_weights(layout, settings, &self.buffers, dt);
            self.buffers.send(outgoing, Slot::Weights, bytemuck::cast_slice(&weights));
        }
        let omega = settings.relaxation as f32;
        let constants = FrameConstants {
            gravity: inputs.gravity.to_array(),
            dt: dt as f32,
            squared_dt: (dt * dt) as f32,
            inverse_dt: (1.0 / dt) as f32,
            rescale: rescale as f32,
            relaxation_multipliers: match settings.relaxation_form {
                RelaxationForm::Consistent => omega,
                RelaxationForm::Published => 1.0,
            },
            relaxation_positions: omega,
            update_count: self.updates_sent.len() as u32,
            part_count: self.part_count as u32,
            chebyshev_damping: settings.chebyshev_damping as f32,
        };
        self.outgoing.write(&self.uniforms.frame, 0, bytemuck::bytes_of(&constants));
    }
}
