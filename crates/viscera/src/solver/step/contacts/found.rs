//! The beginning of a step: tools move, and samples find what is in their way.

use super::far::BLOCK;
use super::{ContactStep, Contacts, Gift};
use crate::contact::{Moved, Tool, Touch, Touching};
use crate::scalar::lanes::Point;
use crate::scalar::rigid::{RigidTransform, axis_times_sine};
use crate::scalar::{Real, Vec3};
use crate::solver::cpu::threads::Workers;
use crate::solver::step::groups::Groups;
use crate::state::ContactState;
use std::ops::Range;

impl Contacts {
    /// Moves the tools to where they are at the end of the step, and finds what samples find in their way. `points` are
    /// places, `velocities` those at the start of the step.
    pub fn find<S: Real>(
        &mut self,
        step: &ContactStep<'_, S>,
        points: &[Point<S>],
        velocities: &[Vec3<S>],
        kept_state: &ContactState,
        (workers, groups): (&Workers, &mut Groups),
    ) {
        self.clear();
        let (layout, tools) = (step.layout, step.tools);
        self.move_tools(step, kept_state);
        let places = (step.places(points), velocities);
        let farthest = self.farthest_tool(step);
        self.pairs.find(step, places, farthest, kept_state, (workers, groups));
        if tools.is_empty() {
            return;
        }
        self.far.begin((layout.samples.len(), points), (tools, &self.starts));
        let mut kept = kept_state.touches.iter().peekable();
        for (number, part) in layout.parts.iter().enumerate() {
            self.first[number] = self.touching.len();
            let speeds = velocities[part.vertices.clone()].iter().map(|v| v.length_squared());
            let squared = speeds.fold(S::ZERO, |most, speed| most.max(speed));
            let farthest = squared.to_f64().sqrt() * step.dt;
            for range in blocks(layout.samples_of(number)) {
                let last = range.end - 1;
                let key = |touch: &Touch| (layout.part_of_sample(touch.sample), touch.sample);
                let last_key = (number, layout.samples[last].number);
                let is_touched = kept.peek().is_some_and(|touch| key(touch) <= last_key);
                let block = last / BLOCK;
                if !is_touched && self.far.is_block_far(block, farthest) {
                    continue;
                }
                for place in range {
                    self.find_at(step, place, (points, velocities), farthest, &mut kept);
                }
                self.far.end_block(block);
            }
        }
        self.first[layout.part_count()] = self.touching.len();
        self.at_start.extend_from_slice(&self.touching);
        self.weigh(step, points);
        self.work_before(step, kept_state);
    }

    /// The tools that one sample may meet, which goes no farther than `farthest` [m]. What the last step has left is
    /// sorted as samples are.
    fn find_at<'k, S: Real>(
        &mut self,
        step: &ContactStep<'_, S>,
        place: usize,
        (points, velocities): (&[Point<S>], &[Vec3<S>]),
        farthest: f64,
        kept: &mut std::iter::Peekable<impl Iterator<Item = &'k Touch>>,
    ) {
        let layout = step.layout;
        let sample = &layout.samples[place];
        let mut from = None;
        for (number, tool) in step.tools.iter().enumerate() {
            let key = |touch: &Touch| {
                (layout.part_of_sample(touch.sample), touch.sample, touch.tool as usize)
            };
            let own = (sample.part as usize, sample.number, number);
            // Of tools that are no longer there.
            while kept.next_if(|touch| key(touch) < own).is_some() {}
            let touch = kept.next_if(|touch| key(touch) == own);
            let touch = touch.filter(|_| !self.jumped[number]);
            if touch.is_none() && self.far.is_far(place, number, tool, farthest) {
                continue;
            }
            let from = *from.get_or_insert_with(|| sample.place(points));
            let start = &self.starts[number];
            let distance = tool.shape.distance(start.undo(from)).value;
            self.far.keep(place, number, tool, distance);
            if touch.is_none() && is_far(tool, (start, distance), from, farthest) {
                continue;
            }
            let moved = Moved { from, to: from + sample.mean(|v| velocities[v]) * step.dt };
            let own = (place as u32, sample.foundation(&tool.law));
            let tool = (number as u32, tool);
            self.touching.extend(Touching::find(own, tool, start, &moved, touch));
        }
    }

    /// Where tools begin and end the step.
    fn move_tools<S: Real>(&mut self, step: &ContactStep<'_, S>, kept: &ContactState) {
        let tools = step.tools;
        self.poses.clear();
        self.poses.extend(tools.iter().map(|tool| tool.pose));
        self.starts.clear();
        self.jumped.clear();
        for (start, has_jumped) in starts(tools, &kept.poses, step.dt) {
            self.jumped.push(has_jumped);
            self.starts.push(start);
        }
    }

    /// How far the tool that goes farthest in the step goes [m].
    fn farthest_tool<S: Real>(&self, step: &ContactStep<'_, S>) -> f64 {
        let ways = step.tools.iter().zip(&self.starts).map(|(tool, start)| {
            let turn = axis_times_sine(&(tool.pose.rotation * start.rotation.transpose()));
            let reach = tool.shape.reach();
            let turned = if reach.is_finite() { turn.length() * reach } else { 0.0 };
            (tool.pose.translation - start.translation).length() + turned
        });
        ways.fold(0.0, f64::max)
    }

    /// What the motion of tools gives to parts that stand still at `x`.
    fn weigh<S: Real>(&mut self, step: &ContactStep<'_, S>, x: &[Point<S>]) {
        for part in 0..step.layout.part_count() {
            let after = self.sums(step, part, x);
            self.presses[part] = after.presses;
            self.gifts[part] = Gift {
                is_near: !self.of_part(part).is_empty(),
                lifted: after.energy,
                ..Gift::default()
            };
        }
        let ends = std::mem::replace(&mut self.poses, std::mem::take(&mut self.starts));
        for part in 0..step.layout.part_count() {
            let before = self.sums(step, part, x);
            self.gifts[part].lifted -= before.energy;
        }
        self.starts = std::mem::replace(&mut self.poses, ends);
    }

    /// Work [J] along the way of the tools of the forces at the end of the last step, of every part.
    fn work_before<S: Real>(&mut self, step: &ContactStep<'_, S>, kept: &ContactState) {
        for touch in &kept.touches {
            let tool = touch.tool as usize;
            let is_known = (touch.sample as usize) < step.layout.samples.len();
            if is_known && self.jumped.get(tool) == Some(&false) {
                let arm = touch.place - self.starts[tool].translation;
                let work = self.work_of(step.tools, tool, touch.force, arm);
                self.gifts[step.layout.part_of_sample(touch.sample)].work[0] += work;
            }
        }
    }
}

/// Where tools begin a step of `dt` [s], and whether they were put elsewhere; `poses` are those before it.
pub fn starts<'a>(
    tools: &'a [Tool],
    poses: &'a [RigidTransform],
    dt: f64,
) -> impl Iterator<Item = (RigidTransform, bool)> + 'a {
    tools.iter().enumerate().map(move |(number, tool)| {
        let before = poses.get(number).unwrap_or(&tool.pose);
        let way = (tool.pose.translation - before.translation).length();
        let has_jumped = tool.jumps(way, dt);
        (if has_jumped { tool.pose } else { *before }, has_jumped)
    })
}

/// A range cut where blocks of samples end.
fn blocks(range: Range<usize>) -> impl Iterator<Item = Range<usize>> {
    let mut start = range.start;
    std::iter::from_fn(move || {
        let end = ((start / BLOCK + 1) * BLOCK).min(range.end);
        let block = start..end;
        start = end;
        (!block.is_empty()).then_some(block)
    })
}

/// Whether a sample at `from` [m], at a distance [m] from a tool, which goes no farther than `farthest` [m], surely does not meet
/// it.
fn is_far(
    tool: &Tool,
    (start, distance): (&RigidTransform, f64),
    from: Vec3<f64>,
    farthest: f64,
) -> bool {
    let twice = 2.0 * tool.shape.steepest();
    if *start == tool.pose {
        return distance > twice * (tool.law.thickness + farthest);
    }
    // The tool's own motion as the sample sees it.
    let way = (tool.pose.undo(from) - start.undo(from)).length();
    distance > twice * (tool.law.thickness + farthest + way)
}
