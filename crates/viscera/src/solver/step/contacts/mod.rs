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

mod explicit;
mod far;
mod found;
#[cfg(feature = "gpu")]
pub mod meetings;
mod of_vertices;
#[cfg(feature = "gpu")]
pub mod on_device;
mod pairs;

use std::ops::Range;

use crate::contact::{Felt, Placed, Tool, Touch, Touching, Wrench};
use crate::layout::{LaidSample, Layout};
use crate::scalar::lanes::Point;
use crate::scalar::rigid::{RigidTransform, axis_times_sine};
use crate::scalar::{Mat3, Real, Vec3};
use crate::solver::inputs::Pin;
use crate::state::ContactState;
use far::Far;
pub use of_vertices::OfVertices;
pub use pairs::{Pairs, Places};

/// What samples and tools are to each other in a step.
#[derive(Clone, Debug, Default)]
pub struct Contacts {
    /// Of each tool, at the end of the last step.
    pub wrenches: Vec<Wrench>,
    /// What tools give to parts in the step, but for the work of the forces at its end.
    gifts: Vec<Gift>,
    /// The samples that may meet a tool, part by part; `Touching::sample` is the place of one in the layout.
    touching: Vec<Touching>,
    /// The same where the step begins.
    at_start: Vec<Touching>,
    /// The first of each part, and the end of the last one's.
    first: Vec<usize>,
    /// Where tools are at the start of the step, at the moment that the step looks at, and which were put elsewhere.
    starts: Vec<RigidTransform>,
    poses: Vec<RigidTransform>,
    jumped: Vec<bool>,
    /// Of each part, whether a tool presses on it where the step begins.
    presses: Vec<bool>,
    /// Samples that need not be looked at.
    far: Far,
    /// Of XPBD's rebase.
    pub of_vertices: OfVertices,
    /// Of tissue and tissue.
    pub pairs: Pairs,
}

/// What contact knows of a step.
#[derive(Clone, Copy)]
pub struct ContactStep<'a, S> {
    pub layout: &'a Layout<S>,
    pub tools: &'a [Tool],
    pub pins: &'a [Pin<S>],
    /// [s].
    pub dt: f64,
}

impl<'a, S> ContactStep<'a, S> {
    /// With the places of vertices [m].
    pub fn places(&self, x: &'a [Point<S>]) -> Places<'a, S> {
        Places { layout: self.layout, x }
    }
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
    /// Their work [J], where all forces along the way are known: in explicit motion.
    pub exact: Option<f64>,
}

impl Gift {
    /// Of two parts.
    pub fn plus(self, other: Self) -> Self {
        let exact = match (self.exact, other.exact) {
            (None, None) => None,
            (a, b) => Some(a.unwrap_or(0.0) + b.unwrap_or(0.0)),
        };
        Self {
            is_near: self.is_near || other.is_near,
            lifted: self.lifted + other.lifted,
            work: [self.work[0] + other.work[0], self.work[1] + other.work[1]],
            exact,
        }
    }

    /// Work of the tools in the step [J].
    pub fn work(&self) -> f64 {
        self.exact.unwrap_or_else(|| self.work[1].max(self.mean_work()))
    }

    /// By the mean of the forces where it is not known exactly [J].
    pub fn mean_work(&self) -> f64 {
        self.exact.unwrap_or(0.5 * (self.work[0] + self.work[1]))
    }
}

/// Which bound of stiffness comes with forces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// None.
    Without,
    /// Of the curvature where the sample is.
    Here,
}

impl Contacts {
    /// For the steps of a model.
    pub fn new<S: Real>(layout: &Layout<S>) -> Self {
        if layout.samples.is_empty() && layout.skin.is_none() {
            return Self::default();
        }
        Self {
            gifts: vec![Gift::default(); layout.part_count()],
            first: vec![0; layout.part_count() + 1],
            presses: vec![false; layout.part_count()],
            touching: Vec::with_capacity(layout.samples.len()),
            at_start: Vec::with_capacity(layout.samples.len()),
            far: Far::new(layout),
            of_vertices: OfVertices::new(layout),
            pairs: Pairs::new(layout),
            ..Self::default()
        }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        self.touching.capacity() * size_of::<Touching>()
            + self.at_start.capacity() * size_of::<Touching>()
            + size_of_val(&self.wrenches[..])
            + size_of_val(&self.gifts[..])
            + size_of_val(&self.first[..])
            + self.far.bytes()
            + self.of_vertices.bytes()
            + self.pairs.bytes()
    }

    /// Forgets all contact: nothing touches anything.
    pub fn clear(&mut self) {
        self.touching.clear();
        self.at_start.clear();
        self.first.fill(0);
        self.presses.fill(false);
        self.gifts.fill(Gift::default());
        self.pairs.clear();
    }

    /// Work [J] along the way of the tools of the forces that they exert on a part at `x`.
    pub fn work_after<S: Real>(
        &self,
        step: &ContactStep<'_, S>,
        part: usize,
        x: &[Point<S>],
    ) -> f64 {
        let mut work = 0.0;
        self.each(step, part, x, |_, touching, place, felt| {
            let tool = touching.tool as usize;
            let arm = place - self.poses[tool].translation;
            work += self.work_of(step.tools, tool, felt.force, arm);
        });
        work
    }

    /// What the tools' motion gives to a part.
    pub fn gift(&self, part: usize) -> Gift {
        self.gifts.get(part).copied().unwrap_or_default()
    }

    /// Of one force on the tissue, at `arm` [m] from the origin of a tool.
    fn work_of(&self, tools: &[Tool], tool: usize, force: Vec3<f64>, arm: Vec3<f64>) -> f64 {
        let (start, end) = (&self.starts[tool], &tools[tool].pose);
        let turn = axis_times_sine(&(end.rotation * start.rotation.transpose()));
        force.dot(end.translation - start.translation) + arm.cross(force).dot(turn)
    }

    /// Puts the tools where they are after a share of the step.
    pub fn place<S: Real>(&mut self, step: &ContactStep<'_, S>, share: f64) {
        for (number, tool) in step.tools.iter().enumerate().take(self.poses.len()) {
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
        step: &ContactStep<'_, S>,
        part: usize,
        x: &[Point<S>],
        mut act: impl FnMut(&LaidSample, &Touching, Vec3<f64>, &Felt),
    ) {
        for touching in self.of_part(part) {
            let sample = &step.layout.samples[touching.sample as usize];
            let place = sample.place(x);
            let felt = touching.feel(self.placed(step.tools, touching), place);
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
    pub fn sums<S: Real>(&self, step: &ContactStep<'_, S>, part: usize, x: &[Point<S>]) -> Sums {
        let mut sums = Sums::default();
        self.each(step, part, x, |_, touching, _, felt| {
            sums.energy += felt.energy;
            sums.presses |= felt.pressed > 0.0 || touching.friction.is_some();
            let most = felt.force.length() + felt.stiffness * touching.foundation.thickness;
            sums.squared_force += most * most;
        });
        let of_pairs = self.pairs.sums(step.places(x), part);
        sums.energy += of_pairs.energy;
        sums.squared_force += of_pairs.squared_force;
        sums
    }

    /// The change of a part's energy [J] from one place to another, and the sum of the magnitudes of its terms.
    pub fn change<S: Real>(
        &self,
        step: &ContactStep<'_, S>,
        part: usize,
        [from, to]: [&[Point<S>]; 2],
    ) -> [f64; 2] {
        let mut sums = [0.0; 2];
        for touching in self.of_part(part) {
            let sample = &step.layout.samples[touching.sample as usize];
            let [before, after] = [from, to]
                .map(|x| touching.feel(self.placed(step.tools, touching), sample.place(x)).energy);
            sums[0] += after - before;
            sums[1] += (after - before).abs();
        }
        let of_pairs = self.pairs.change(part, [from, to]);
        [sums[0] + of_pairs[0], sums[1] + of_pairs[1]]
    }

    /// The curvature of a part's energy along a direction of vertices [J].
    pub fn curvature<S: Real>(
        &self,
        step: &ContactStep<'_, S>,
        part: usize,
        x: &[Point<S>],
        direction: &[Point<S>],
    ) -> f64 {
        let mut sum = 0.0;
        self.each(step, part, x, |sample, _, _, felt| {
            let d = sample.place(direction);
            sum += d.dot(felt.curvature() * d);
        });
        sum + self.pairs.curvature(x, part, direction)
    }

    /// Calls `add` with the vertices of every sample of a part, their weights and the curvature between them [N/m].
    pub fn each_block<S: Real>(
        &self,
        step: &ContactStep<'_, S>,
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
        step: &ContactStep<'_, S>,
        part: usize,
        x: &[Point<S>],
        bound: Bound,
        loads: &mut [Point<S>],
    ) {
        self.each(step, part, x, |sample, _, _, felt| {
            let stiffness = match bound {
                Bound::Without => 0.0,
                Bound::Here => (felt.stiffness + felt.tie).max(felt.drag) + felt.turning,
            };
            spread(step, sample, (felt.force, stiffness), loads);
        });
    }

    /// The same of pairs of a part's samples, on vertices of whatever part: after all parts of its group have their own.
    pub fn add_pair_forces<S: Real>(
        &self,
        step: &ContactStep<'_, S>,
        part: usize,
        x: &[Point<S>],
        bound: Bound,
        loads: &mut [Point<S>],
    ) {
        self.pairs.add_forces(step.places(x), part, (step.dt, bound), loads);
    }

    /// Adds `dt^2` times all forces of contact at `x` to the first copy of each vertex, and finds the blocks.
    pub fn load_vertices<S: Real>(
        &mut self,
        step: &ContactStep<'_, S>,
        x: &[Point<S>],
        loads: &mut [Point<S>],
    ) {
        let mut of_vertices = std::mem::take(&mut self.of_vertices);
        of_vertices.clear();
        let squared = step.dt * step.dt;
        for part in 0..step.layout.part_count() {
            self.each(step, part, x, |sample, _, _, felt| {
                if felt.force == Vec3::ZERO && felt.drag == 0.0 {
                    return;
                }
                let block = (felt.curvature() + Mat3::IDENTITY * felt.turning) * squared;
                let sum: f64 = sample.weights.iter().map(|weight| weight.abs()).sum();
                for (&v, &weight) in sample.vertices.iter().zip(&sample.weights) {
                    if weight == 0.0 {
                        continue;
                    }
                    let first = step.layout.copy_offsets[v as usize] as usize;
                    let load = (felt.force * (squared * weight)).cast();
                    loads[first].add(Point::new(load, S::ZERO));
                    of_vertices.add(v, block * (weight.abs() * sum));
                }
            });
        }
        self.pairs.load_vertices(step.places(x), step.dt, &mut of_vertices, loads);
        self.of_vertices = of_vertices;
    }

    /// The end of a step at `x`: the forces of tools, and what is kept for the next.
    pub fn end<S: Real>(
        &mut self,
        step: &ContactStep<'_, S>,
        x: &[Point<S>],
        pinned: impl Fn(usize) -> bool,
        kept: &mut ContactState,
    ) {
        let tools = step.tools;
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
        let ties = step.layout.skin.as_ref().map_or(0, |skin| skin.ties.len());
        kept.torn.resize(ties, false);
        self.pairs.end(step.places(x), &mut kept.pairs, &mut kept.torn);
        kept.poses.clear();
        kept.poses.extend(tools.iter().map(|tool| tool.pose));
    }
}

/// Adds `dt^2` times a force [N] and a bound of stiffness [N/m] at a sample to the first copy of each of its vertices.
fn spread<S: Real>(
    step: &ContactStep<'_, S>,
    sample: &LaidSample,
    (force, stiffness): (Vec3<f64>, f64),
    loads: &mut [Point<S>],
) {
    let squared = step.dt * step.dt;
    let sum: f64 = sample.weights.iter().map(|weight| weight.abs()).sum();
    for (&v, &weight) in sample.vertices.iter().zip(&sample.weights) {
        let first = step.layout.copy_offsets[v as usize] as usize;
        let load = (force * (squared * weight)).cast();
        let bound = S::from_f64(squared * stiffness * weight.abs() * sum);
        loads[first].add(Point::new(load, bound));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Shape;
    use crate::scalar::rigid::rotation_matrix;
    use crate::scalar::vec3;

    /// Two jaws that turn about a hinge with what they squeeze do no work. By the forces at the end alone the chord of each
    /// jaw's way would say so only to second order, and a step would be charged for what no tool took.
    #[test]
    fn jaws_that_turn_with_what_they_hold_do_no_work() {
        let (turn, squeeze) = (rotation_matrix(vec3(0.0, 0.0, 0.035)), 2.0);
        let at = |x: f64, rotation| RigidTransform { rotation, translation: vec3(x, 0.0, 0.0) };
        let straight = RigidTransform::IDENTITY.rotation;
        let ways = [0.01, -0.01];
        let starts = ways.map(|x| at(x, straight)).to_vec();
        let tools = ways.map(|x| {
            let start = at(x, turn);
            let pose = RigidTransform { translation: turn * start.translation, ..start };
            Tool { pose, ..Tool::new(Shape::Sphere { radius: 4e-3 }) }
        });
        let contacts = Contacts { starts, ..Contacts::default() };
        // Of forces on the tissue, in front of the jaws.
        let work = |turned: &Mat3<f64>| -> f64 {
            let each = ways.iter().enumerate().map(|(tool, x)| {
                let force = *turned * vec3(-squeeze * x.signum(), 0.0, 0.0);
                let arm = *turned * vec3(-4e-3 * x.signum(), 0.0, 0.0);
                contacts.work_of(&tools, tool, force, arm)
            });
            each.sum()
        };
        let gift = Gift { work: [work(&straight), work(&turn)], ..Gift::default() };
        // Of the squeezing forces along a way as long as that of the jaws.
        let whole = 2.0 * squeeze * 0.01 * 0.035;
        let ends = -gift.work[1];
        assert!(ends > 1e-2 * whole, "{gift:?}");
        assert!(gift.work().abs() < 1e-2 * ends, "{gift:?}");
        assert!(gift.mean_work().abs() < 1e-2 * ends, "{gift:?}");
        let exact = Gift { exact: Some(0.3), ..gift };
        assert_eq!((exact.work(), exact.mean_work()), (0.3, 0.3));
    }
}
