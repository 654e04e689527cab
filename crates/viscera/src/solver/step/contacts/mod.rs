//! Contact in a step: which samples meet which tools, what they add to the step, and what is kept of it.
//!
//! ```text
//! Phi += dt^2 sum_s (A psi(d_s) + E_f),   grad_i += -dt^2 sum_s b_is f_s
//! curvature: b_a b_b dt^2 C_s;   bound at a vertex: |b_i| sum_a |b_a| dt^2 (C_s + turning)
//! W = max(W_1, (W_0 + W_1)/2),   W_k = sum_tools F_k.(t_1 - t_0) + M_k.w,   w: axis times sine of the turn R_1 R_0^T
//! ```
//!
//! Tools move before the step begins, and nothing of this changes until it has ended: poses at its end, planes, anchors and
//! normal forces are constants of the step, so that `Phi` has one value at a place. `F_k`, `M_k` are the forces that tools
//! exert on the tissue at the start and at the end of the step, as they are reported; jaws that turn with what they hold
//! do no work, which only the mean of both says.

mod of_vertices;

use std::ops::Range;

use crate::contact::{ContactLaw, Felt, Foundation, Moved, Placed, Tool, Touch, Touching, Wrench};
use crate::layout::{LaidSample, Layout};
use crate::scalar::lanes::Point;
use crate::scalar::rigid::{RigidTransform, axis_times_sine};
use crate::scalar::{Mat3, Real, Vec3};
use crate::solver::step::data::{Step, copies_of};
use crate::state::ContactState;
pub use of_vertices::OfVertices;

/// A tool that is faster than this [m/s], or than ten of its radii in a step where those are more, was put elsewhere.
const FASTEST: f64 = 10.0;
const FARTHEST: f64 = 10.0;

/// What samples and tools are to each other in a step.
#[derive(Clone, Debug, Default)]
pub struct Contacts {
    /// Of each tool, at the end of the last step.
    pub wrenches: Vec<Wrench>,
    /// What tools give to parts in the step, but for the work of the forces at its end.
    gifts: Vec<Gift>,
    /// The samples that may meet a tool, part by part; `Touching::sample` is the place of one in the layout.
    touching: Vec<Touching>,
    /// The first of each part, and the end of the last one's.
    first: Vec<usize>,
    /// Where tools are at the start of the step, at the moment that the step looks at, and which were put elsewhere.
    starts: Vec<RigidTransform>,
    poses: Vec<RigidTransform>,
    jumped: Vec<bool>,
    /// Of each part, whether a tool presses on it where the step begins.
    presses: Vec<bool>,
    /// Of XPBD's rebase.
    pub of_vertices: OfVertices,
}

/// What the motion of tools gives to a part in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gift {
    /// Whether a tool is near it.
    pub is_near: bool,
    /// Energy of contact [J] that tools add by moving into tissue that stands still.
    pub lifted: f64,
    /// Work [J] along their way of the forces at the start and at the end of the step.
    pub work: [f64; 2],
}

impl Gift {
    /// Work of the tools in the step [J].
    pub fn work(&self) -> f64 {
        self.work[1].max(self.mean_work())
    }

    /// By the mean of the forces [J].
    pub fn mean_work(&self) -> f64 {
        0.5 * (self.work[0] + self.work[1])
    }
}

/// Which bound of stiffness comes with forces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// None.
    Without,
    /// Of the curvature where the sample is.
    Here,
    /// A share of the curvature that it may have after moving by half the thickness.
    Near(f64),
}

impl Contacts {
    /// For the steps of a model.
    pub fn new<S: Real>(layout: &Layout<S>) -> Self {
        if layout.samples.is_empty() {
            return Self::default();
        }
        Self {
            gifts: vec![Gift::default(); layout.part_count()],
            first: vec![0; layout.part_count() + 1],
            presses: vec![false; layout.part_count()],
            touching: Vec::with_capacity(layout.samples.len()),
            of_vertices: OfVertices::new(layout),
            ..Self::default()
        }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        self.touching.capacity() * size_of::<Touching>()
            + size_of_val(&self.wrenches[..])
            + size_of_val(&self.gifts[..])
            + size_of_val(&self.first[..])
            + self.of_vertices.bytes()
    }

    /// Forgets all contact: nothing touches anything.
    pub fn clear(&mut self) {
        self.touching.clear();
        self.first.fill(0);
        self.presses.fill(false);
        self.gifts.fill(Gift::default());
    }

    /// Moves the tools to where they are at the end of the step, and finds what samples find in their way. `points` are
    /// places, `velocities` those at the start of the step.
    pub fn find<S: Real>(
        &mut self,
        step: &Step<'_, S>,
        points: &[Point<S>],
        velocities: &[Vec3<S>],
        kept_state: &ContactState,
    ) {
        self.clear();
        let (layout, tools) = (step.layout, &step.inputs.tools[..]);
        self.move_tools(step, kept_state);
        if tools.is_empty() {
            return;
        }
        let mut kept = kept_state.touches.iter().peekable();
        for (number, part) in layout.parts.iter().enumerate() {
            self.first[number] = self.touching.len();
            let speeds = velocities[part.vertices.clone()].iter().map(|v| v.length_squared());
            let squared = speeds.fold(S::ZERO, |most, speed| most.max(speed));
            let farthest = squared.to_f64().sqrt() * step.dt;
            for place in layout.samples_of(number) {
                self.find_at(step, place, (points, velocities), farthest, &mut kept);
            }
        }
        self.first[layout.part_count()] = self.touching.len();
        self.weigh(step, points);
        self.work_before(step, kept_state);
    }

    /// The tools that one sample may meet, which goes no farther than `farthest` [m]. What the last step has left is
    /// sorted as samples are.
    fn find_at<'k, S: Real>(
        &mut self,
        step: &Step<'_, S>,
        place: usize,
        (points, velocities): (&[Point<S>], &[Vec3<S>]),
        farthest: f64,
        kept: &mut std::iter::Peekable<impl Iterator<Item = &'k Touch>>,
    ) {
        let layout = step.layout;
        let sample = &layout.samples[place];
        let from = sample.place(points);
        for (number, tool) in step.inputs.tools.iter().enumerate() {
            let key = |touch: &Touch| {
                (layout.part_of_sample(touch.sample), touch.sample, touch.tool as usize)
            };
            let own = (sample.part as usize, sample.number, number);
            // Of tools that are no longer there.
            while kept.next_if(|touch| key(touch) < own).is_some() {}
            let touch = kept.next_if(|touch| key(touch) == own);
            let touch = touch.filter(|_| !self.jumped[number]);
            let start = &self.starts[number];
            if touch.is_none() && is_far(tool, start, from, farthest) {
                continue;
            }
            let moved = Moved { from, to: from + sample.mean(|v| velocities[v]) * step.dt };
            let own = (place as u32, foundation(&tool.law, sample));
            let tool = (number as u32, tool);
            self.touching.extend(Touching::find(own, tool, start, &moved, touch));
        }
    }

    /// Where tools begin and end the step.
    fn move_tools<S: Real>(&mut self, step: &Step<'_, S>, kept: &ContactState) {
        let tools = &step.inputs.tools;
        self.poses.clear();
        self.poses.extend(tools.iter().map(|tool| tool.pose));
        self.starts.clear();
        self.jumped.clear();
        for (number, tool) in tools.iter().enumerate() {
            let before = kept.poses.get(number).unwrap_or(&tool.pose);
            let way = (tool.pose.translation - before.translation).length();
            let most = (FASTEST * step.dt).max(FARTHEST * tool.shape.thinnest().min(1.0));
            let has_jumped = way > most;
            self.jumped.push(has_jumped);
            self.starts.push(if has_jumped { tool.pose } else { *before });
        }
    }

    /// What the motion of tools gives to parts that stand still at `x`.
    fn weigh<S: Real>(&mut self, step: &Step<'_, S>, x: &[Point<S>]) {
        for part in 0..step.layout.part_count() {
            let after = self.sums(step, part, x);
            self.presses[part] = after.presses;
            self.gifts[part] = Gift {
                is_near: !self.of_part(part).is_empty(),
                lifted: after.energy,
                work: [0.0; 2],
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
    fn work_before<S: Real>(&mut self, step: &Step<'_, S>, kept: &ContactState) {
        for touch in &kept.touches {
            let tool = touch.tool as usize;
            let is_known = (touch.sample as usize) < step.layout.samples.len();
            if is_known && self.jumped.get(tool) == Some(&false) {
                let arm = touch.place - self.starts[tool].translation;
                let work = self.work_of(step, tool, touch.force, arm);
                self.gifts[step.layout.part_of_sample(touch.sample)].work[0] += work;
            }
        }
    }

    /// Work [J] along the way of the tools of the forces that they exert on a part at `x`.
    pub fn work_after<S: Real>(&self, step: &Step<'_, S>, part: usize, x: &[Point<S>]) -> f64 {
        let mut work = 0.0;
        self.each(step, part, x, |_, touching, place, felt| {
            let tool = touching.tool as usize;
            let arm = place - self.poses[tool].translation;
            work += self.work_of(step, tool, felt.force, arm);
        });
        work
    }

    /// What the tools' motion gives to a part.
    pub fn gift(&self, part: usize) -> Gift {
        self.gifts.get(part).copied().unwrap_or_default()
    }

    /// Of one force on the tissue, at `arm` [m] from the origin of a tool.
    fn work_of<S: Real>(
        &self,
        step: &Step<'_, S>,
        tool: usize,
        force: Vec3<f64>,
        arm: Vec3<f64>,
    ) -> f64 {
        let (start, end) = (&self.starts[tool], &step.inputs.tools[tool].pose);
        let turn = axis_times_sine(&(end.rotation * start.rotation.transpose()));
        force.dot(end.translation - start.translation) + arm.cross(force).dot(turn)
    }

    /// Puts the tools where they are after a share of the step.
    pub fn place<S: Real>(&mut self, step: &Step<'_, S>, share: f64) {
        for (number, tool) in step.inputs.tools.iter().enumerate().take(self.poses.len()) {
            self.poses[number] = self.starts[number].towards(&tool.pose, share);
        }
    }

    /// Whether a tool presses on a part where the step begins.
    pub fn presses(&self, part: usize) -> bool {
        self.presses.get(part).copied().unwrap_or(false)
    }

    /// The samples of a part that may meet a tool.
    fn of_part(&self, part: usize) -> &[Touching] {
        let Some(range) = self.range(part) else { return &[] };
        &self.touching[range]
    }

    fn range(&self, part: usize) -> Option<Range<usize>> {
        Some(*self.first.get(part)?..*self.first.get(part + 1)?)
    }

    /// Calls `act` with every sample of a part that may meet a tool, where it is and what it feels at `x`.
    pub fn each<S: Real>(
        &self,
        step: &Step<'_, S>,
        part: usize,
        x: &[Point<S>],
        mut act: impl FnMut(&LaidSample, &Touching, Vec3<f64>, &Felt),
    ) {
        for touching in self.of_part(part) {
            let sample = &step.layout.samples[touching.sample as usize];
            let place = sample.place(x);
            let felt = touching.feel(self.placed(&step.inputs.tools, touching), place);
            act(sample, touching, place, &felt);
        }
    }

    /// The same with places of vertices from elsewhere.
    pub fn each_at<S: Real>(
        &self,
        layout: &Layout<S>,
        tools: &[Tool],
        part: usize,
        place: impl Fn(usize) -> Vec3<S>,
        mut act: impl FnMut(&LaidSample, &Felt),
    ) {
        for touching in self.of_part(part) {
            let sample = &layout.samples[touching.sample as usize];
            let felt = touching.feel(self.placed(tools, touching), sample.mean(&place));
            act(sample, &felt);
        }
    }

    fn placed<'a>(&'a self, tools: &'a [Tool], touching: &Touching) -> Placed<'a> {
        let tool = touching.tool as usize;
        Placed { shape: &tools[tool].shape, pose: &self.poses[tool] }
    }

    /// Energy of a part at `x`, and what round-off of places makes of it.
    pub fn sums<S: Real>(&self, step: &Step<'_, S>, part: usize, x: &[Point<S>]) -> Sums {
        let mut sums = Sums::default();
        self.each(step, part, x, |_, touching, _, felt| {
            sums.energy += felt.energy;
            sums.presses |= felt.pressed > 0.0 || touching.friction.is_some();
            let most = felt.force.length() + felt.stiffness * touching.foundation.thickness;
            sums.squared_force += most * most;
        });
        sums
    }

    /// The change of a part's energy [J] from one place to another, and the sum of the magnitudes of its terms.
    pub fn change<S: Real>(
        &self,
        step: &Step<'_, S>,
        part: usize,
        [from, to]: [&[Point<S>]; 2],
    ) -> [f64; 2] {
        let mut sums = [0.0; 2];
        for touching in self.of_part(part) {
            let sample = &step.layout.samples[touching.sample as usize];
            let [before, after] = [from, to].map(|x| {
                touching.feel(self.placed(&step.inputs.tools, touching), sample.place(x)).energy
            });
            sums[0] += after - before;
            sums[1] += (after - before).abs();
        }
        sums
    }

    /// The curvature of a part's energy along a direction of vertices [J].
    pub fn curvature<S: Real>(
        &self,
        step: &Step<'_, S>,
        part: usize,
        x: &[Point<S>],
        direction: &[Point<S>],
    ) -> f64 {
        let mut sum = 0.0;
        self.each(step, part, x, |sample, _, _, felt| {
            let d = sample.place(direction);
            sum += d.dot(felt.curvature() * d);
        });
        sum
    }

    /// Calls `add` with the vertices of every sample of a part, their weights and the curvature between them [N/m].
    pub fn each_block<S: Real>(
        &self,
        step: &Step<'_, S>,
        part: usize,
        x: &[Point<S>],
        mut add: impl FnMut(&LaidSample, Mat3<f64>),
    ) {
        self.each(step, part, x, |sample, _, _, felt| {
            if felt.pressed > 0.0 || felt.drag > 0.0 {
                add(sample, felt.curvature());
            }
        });
    }

    /// Adds `dt^2` times the forces of a part's contact to the first copy of each vertex, and the bound of the curvature.
    pub fn add_forces<S: Real>(
        &self,
        step: &Step<'_, S>,
        part: usize,
        x: &[Point<S>],
        bound: Bound,
        loads: &mut [Point<S>],
    ) {
        let squared = step.dt * step.dt;
        self.each(step, part, x, |sample, touching, _, felt| {
            let stiffness = match bound {
                Bound::Without => 0.0,
                Bound::Here => (felt.stiffness + felt.tie).max(felt.drag) + felt.turning,
                Bound::Near(share) => share * (touching.stiffness_near(felt) + felt.turning),
            };
            let sum: f64 = sample.weights.iter().map(|weight| weight.abs()).sum();
            for (&v, &weight) in sample.vertices.iter().zip(&sample.weights) {
                let first = copies_of(step.layout, v as usize).start;
                let load = (felt.force * (squared * weight)).cast();
                let bound = S::from_f64(squared * stiffness * weight.abs() * sum);
                loads[first].add(Point::new(load, bound));
            }
        });
    }

    /// The end of a step at `x`: the forces of tools, and what is kept for the next.
    pub fn end<S: Real>(
        &mut self,
        step: &Step<'_, S>,
        x: &[Point<S>],
        pinned: impl Fn(usize) -> bool,
        kept: &mut ContactState,
    ) {
        let tools = &step.inputs.tools;
        self.wrenches.clear();
        self.wrenches.resize(tools.len(), Wrench::default());
        for (wrench, &has_jumped) in self.wrenches.iter_mut().zip(&self.jumped) {
            wrench.has_jumped = has_jumped;
        }
        let mut wrenches = std::mem::take(&mut self.wrenches);
        kept.touches.clear();
        for part in 0..step.layout.part_count() {
            self.each(step, part, x, |sample, touching, place, felt| {
                let number = touching.tool as usize;
                let wrench = &mut wrenches[number];
                if felt.force != Vec3::ZERO {
                    wrench.add(-felt.force, place, tools[number].pose.translation);
                    wrench.touches += 1;
                    let all = sample.vertices.iter().zip(&sample.weights);
                    let mut bearing = all.filter(|(_, weight)| **weight != 0.0);
                    wrench.pinned += u32::from(bearing.all(|(&v, _)| pinned(v as usize)));
                    wrench.depth = wrench.depth.max(touching.foundation.thickness - felt.distance);
                }
                let touch = touching.keep(&tools[number], place, felt);
                kept.touches.extend(touch.map(|touch| Touch { sample: sample.number, ..touch }));
            });
        }
        self.wrenches = wrenches;
        kept.poses.clear();
        kept.poses.extend(tools.iter().map(|tool| tool.pose));
    }
}

/// Sums over the contact of a part.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sums {
    /// [J].
    pub energy: f64,
    /// Of forces that a rounded place moves through [N^2].
    pub squared_force: f64,
    /// Whether any sample is pressed or held.
    pub presses: bool,
}

/// The constants of contact between a tool and a sample.
fn foundation(law: &ContactLaw, sample: &LaidSample) -> Foundation {
    Foundation {
        area: sample.area,
        stiffness: law.stiffness * sample.stiffness,
        thickness: law.thickness,
    }
}

/// Whether a sample at `from` [m], which goes no farther than `farthest` [m], surely does not meet a tool.
fn is_far(tool: &Tool, start: &RigidTransform, from: Vec3<f64>, farthest: f64) -> bool {
    let distance = tool.shape.distance(start.undo(from)).value;
    if *start == tool.pose {
        return distance > 2.0 * (tool.law.thickness + farthest);
    }
    // The tool's own motion as the sample sees it.
    let way = (tool.pose.undo(from) - start.undo(from)).length();
    distance > 2.0 * (tool.law.thickness + farthest + way)
}
