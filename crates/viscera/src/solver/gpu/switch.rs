//! A step that the CPU begins and the device ends: where a result is wrong, the stage from which on it
//! is tells which twin to look at.

use super::clock::Marks;
use super::layout::DeviceLayout;
use super::outgoing::Ready;
use super::slots::Slot;
use super::solver::GpuSolver;
use crate::layout::Layout;
use crate::model::Model;
use crate::scalar::Vec3;
use crate::scalar::lanes::{LANES, Point};
use crate::solver::Solver;
use crate::solver::cpu::memory::MethodMemory;
use crate::solver::error::StepError;
use crate::solver::inputs::Inputs;
use crate::solver::plan::{GuardStage, Split, Stage, StepStage, XpbdStage};
use crate::solver::step::data::StepData;
use crate::state::State;

impl GpuSolver {
    /// Advances a state on the host by one step of `dt` [s], whose first stages `solver` computes, up to
    /// and without the first of `stage`, and this solver the others. Both are of one model and the same
    /// settings; of the iterations the CPU computes stages of the first only, and where iterates are
    /// guarded none after [`GuardStage::ChooseStart`]. Returns how many stages the CPU has computed. The
    /// state ends on the device: [`GpuSolver::read`] fetches it.
    pub fn step_from(
        &mut self,
        stage: Stage,
        solver: &mut Solver<f32>,
        model: &Model<f32>,
        state: &mut State<f32>,
        inputs: &Inputs<f32>,
        dt: f64,
    ) -> Result<usize, StepError> {
        self.write(model, state)?;
        let sizes = |layout: &Layout<f32>| [layout.multiplier_count, layout.copy_count()];
        if sizes(solver.layout()) != sizes(&self.layout) {
            return Err(StepError::OtherModel);
        }
        let repeats = self.begin_step(model, inputs, dt)?;
        let stages = self.plan.split();
        let count = first_stages(&stages, stage);
        solver.step_first(count, model, state, inputs, dt)?;
        self.take_over(solver, &self.layout, state, inputs, count);
        let [prologue, body, _] = &self.ready;
        let (before, within) = split(&self.stage_starts, count, stages.prologue.len());
        let mut lists: Vec<&[Ready]> = Vec::new();
        // What a prologue prepares for the device's own way through the body.
        let starts_acceleration = prologue.iter().filter(|ready| ready.starts_acceleration);
        let starts_acceleration: Vec<&[Ready]> =
            starts_acceleration.map(std::slice::from_ref).collect();
        if before > 0 {
            lists.extend(starts_acceleration);
        }
        lists.push(&prologue[before..]);
        lists.push(&body[within..]);
        lists.extend(std::iter::repeat_n(body.as_slice(), repeats.saturating_sub(1) as usize));
        lists.push(&self.ready[2]);
        self.outgoing.pass("step from a stage", &self.uniforms.all, &lists, Marks::default());
        self.outgoing.submit();
        self.multiplier_dt = dt;
        Ok(count)
    }

    /// Puts what the CPU has computed so far into the place of what the device would have.
    fn take_over(
        &self,
        solver: &Solver<f32>,
        layout: &Layout<f32>,
        state: &State<f32>,
        inputs: &Inputs<f32>,
        count: usize,
    ) {
        let StepData { constants, points, velocities, loads } = &solver.memory.data;
        let vector = |points: &[Point<f32>], multipliers: &[f32]| {
            let mut vector = vec![0.0; self.buffers.length as usize];
            let places: Vec<[f32; 4]> = points.iter().map(whole).collect();
            vector[..4 * places.len()].copy_from_slice(places.as_flattened());
            let first = (self.buffers.multipliers_start / 4) as usize;
            vector[first..first + multipliers.len()].copy_from_slice(multipliers);
            vector
        };
        let write = |slot, values: &[f32]| {
            self.buffers.write(&self.device.queue, slot, bytemuck::cast_slice(values));
        };
        let stages = self.plan.split();
        let has = |wanted: fn(&Stage) -> bool| stages.first_pass().take(count).any(wanted);
        if count == 0 {
            return;
        }
        write(Slot::Unknowns, &vector(points, &state.multipliers));
        self.put_rows(Slot::Velocities, &each(layout, &|v| with(velocities[v], 0.0)));
        if layout.is_viscous() {
            let mut rows: Vec<f32> = Vec::new();
            for (own, set) in constants.start_strain.iter().zip(&layout.tet_sets) {
                rows.extend(own.as_flattened().as_flattened());
                rows.resize(rows.len() + 6 * LANES * (set.block_count() - own.len()), 0.0);
            }
            write(Slot::StartStrain, &rows);
        }
        // Before the prediction the rest is of the last step.
        if !has(|stage| matches!(stage, Stage::Step(StepStage::Predict { .. }))) {
            return;
        }
        let MethodMemory::Xpbd(memory) = &solver.memory.method else { return };
        let remembered = &memory.iterate[0];
        if !remembered.positions.is_empty() {
            let is_valid = has(|stage| *stage == XpbdStage::RememberIterate.into());
            let now = (points, &state.multipliers);
            let (points, multipliers) =
                if is_valid { (&remembered.positions, &remembered.multipliers) } else { now };
            write(Slot::Iterate, &vector(points, multipliers));
        }
        self.take_over_prediction(solver, layout, inputs);
        if layout.is_split() {
            let all: Vec<[f32; 4]> = memory.copies.iter().map(whole).collect();
            self.put_rows(Slot::Copies, &all);
        }
        if !loads.is_empty() {
            self.put_rows(
                Slot::Loads,
                &DeviceLayout::new(layout, &self.settings).loads(layout, loads),
            );
        }
    }

    /// What the prediction leaves: constants of the step, targets, and where steps are guarded their starts.
    fn take_over_prediction(
        &self,
        solver: &Solver<f32>,
        layout: &Layout<f32>,
        inputs: &Inputs<f32>,
    ) {
        let constants = &solver.memory.data.constants;
        let copies = |v: usize| (layout.copy_offsets[v + 1] - layout.copy_offsets[v]) as f32;
        self.put_rows(
            Slot::Previous,
            &each(layout, &|v| with(constants.previous[v].vec3(), copies(v))),
        );
        self.put_rows(
            Slot::Predicted,
            &each(layout, &|v| with(constants.predicted[v].vec3(), constants.inertias[v])),
        );
        self.put_rows(
            Slot::ExternalForces,
            &each(layout, &|v| with(constants.external[v], constants.inverse_masses[v])),
        );
        let mut targets = each(layout, &|_| [0.0; 4]);
        for tether in &constants.tethers {
            targets[tether.vertex] = with(tether.target, tether.stiffness);
        }
        for pin in &inputs.pins {
            targets[layout.numbering.of(pin.vertex)] = with(pin.target, 0.0);
        }
        if let Some(start) = solver.memory.guard.as_ref().map(|guard| &guard.start) {
            let free = |v: usize| constants.inverse_masses[v] != 0.0;
            let place = |v: usize, x: Vec3<f32>| if free(v) { with(x, 0.0) } else { targets[v] };
            let starts = [&constants.previous, &constants.predicted, start];
            let mut rows = vec![[0.0; 4]; 3 * DeviceLayout::stride(layout) as usize];
            for (row, points) in rows.chunks_mut(DeviceLayout::stride(layout) as usize).zip(starts)
            {
                for (v, point) in points.iter().enumerate() {
                    row[v] = place(v, point.vec3());
                }
            }
            self.put_rows(Slot::Starts, &rows);
        }
        self.put_rows(Slot::Targets, &targets);
    }

    fn put_rows(&self, slot: Slot, values: &[[f32; 4]]) {
        self.buffers.write(&self.device.queue, slot, bytemuck::cast_slice(values));
    }
}

/// A row for each of the solver's vertices.
fn each(layout: &Layout<f32>, of: &dyn Fn(usize) -> [f32; 4]) -> Vec<[f32; 4]> {
    (0..layout.vertex_count()).map(of).collect()
}

fn with(v: Vec3<f32>, w: f32) -> [f32; 4] {
    [v.x, v.y, v.z, w]
}

fn whole(point: &Point<f32>) -> [f32; 4] {
    [point.x, point.y, point.z, point.w]
}

impl DeviceLayout {
    /// The loads of copies where the device looks for those of corners: all of a vertex's in its first
    /// place.
    fn loads(&self, layout: &Layout<f32>, of_copies: &[Point<f32>]) -> Vec<[f32; 4]> {
        let mut loads = vec![[0.0; 4]; self.slot_count() as usize];
        for v in 0..layout.vertex_count() {
            let load = crate::solver::step::data::gather(layout, of_copies, v);
            if let Some(place) = loads.get_mut(self.first_load(v)) {
                *place = whole(&load);
            }
        }
        loads
    }
}

/// How many stages come before the first of that name, of those that the CPU may compute.
fn first_stages(stages: &Split, stage: Stage) -> usize {
    let decides = |other: &Stage| *other == GuardStage::ChooseStart.into();
    let most = stages.first_pass().position(decides).unwrap_or(stages.first_pass().count());
    stages.first_pass().position(|other| *other == stage).unwrap_or(most).min(most)
}

/// How many dispatches of prologue and body belong to the first `count` stages.
fn split(starts: &[Vec<usize>; 2], count: usize, prologue: usize) -> (usize, usize) {
    let [of_prologue, of_body] = starts;
    let end = |list: &[usize]| list.last().copied().unwrap_or(0);
    if count < prologue {
        return (of_prologue[count], 0);
    }
    let within = of_body.get(count - prologue).copied().unwrap_or(end(of_body));
    (end(of_prologue), within)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_are_divided_where_their_dispatches_are() {
        let starts = [vec![0, 1, 3], vec![0, 0, 2, 5]];
        assert_eq!(split(&starts, 0, 2), (0, 0));
        assert_eq!(split(&starts, 1, 2), (1, 0));
        assert_eq!(split(&starts, 2, 2), (3, 0));
        assert_eq!(split(&starts, 4, 2), (3, 2));
    }
}
