//! Tools in a run: where they are in each substep, jaws that follow a force, and the forces that tools meet.
//!
//! ```text
//! M_o = mean over jaws of their opening torque about the hinge [N m],   M_c = F L/2      F closing force, L jaws' length
//! speed of the next frame = g (open/closing_time) clamp((M_o - M_c)/|M_c|, -1, 1)        g <= 1: halved where it turned back
//! ```
//!
//! Force-driven jaws are quasi-static: they have no inertia, close at a limited speed, and stop where tissue holds against
//! the force. What they met at the end of a frame decides their speed in the next one, which is part of a saved simulation.

use super::crossings::Crossed;
use super::force_text::wrench_text;
use super::holding::tolerance_of;
use crate::contact::{Tool, Wrench};
use crate::scalar::rigid::{RigidTransform, rotation_vector};
use crate::scalar::{Real, Vec3, vec3};
use crate::scene::{Instrument, Jaws};
use crate::solver::Inputs;

/// The force and torque on one tool.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ToolForce {
    /// The tool's name in the scene.
    pub name: String,
    /// Force [N] of the tissue on the tool, all its parts together.
    pub force: [f64; 3],
    /// Torque [N m] of the same about the tool's origin.
    pub torque: [f64; 3],
    /// Samples of tissue that it presses on.
    pub touches: u32,
    /// Of these hang on held vertices only: nothing gives way there.
    pub pinned: u32,
    /// Samples that may meet it and were left out, because three other tools are nearer to them: on a graphics processor alone.
    pub left_out: u32,
    /// The deepest that tissue is inside the contact's thickness [m].
    pub depth: f64,
    /// Whether it was put elsewhere in the frame, further than a tool moves.
    pub has_jumped: bool,
    /// Another tool that it is inside of, or that is inside it: nothing keeps tools apart.
    pub crossed: Option<Crossed>,
    /// What the force may be off by because substeps have a length and sweeps an end [N], see
    /// [`Shadow`](crate::solver::Shadow); nothing where that is not asked for.
    pub error: Option<f64>,
    /// The same of the torque [N m].
    pub torque_error: Option<f64>,
}

impl ToolForce {
    /// Sets the errors by what another run of so many substeps says that [`Shadow`](crate::solver::Shadow) compares with.
    pub(super) fn compare(&mut self, other: &Self, error: impl Fn(Vec3<f64>, Vec3<f64>) -> f64) {
        let off = |a: [f64; 3], b: [f64; 3]| {
            let off = error(Vec3::from_f64(a), Vec3::from_f64(b));
            off.is_finite().then_some(off)
        };
        self.error = off(self.force, other.force);
        self.torque_error = off(self.torque, other.torque);
    }
}

impl std::fmt::Display for ToolForce {
    /// One line of a table, to four decimals unless a precision says otherwise.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let digits = f.precision().unwrap_or(4);
        let errors = [self.error, self.torque_error];
        let wrench = wrench_text(self.force, self.torque, errors, digits);
        write!(f, "{}: {wrench}, {} touches", self.name, self.touches)?;
        let jumped = "; it was put elsewhere, further than a tool moves";
        if self.has_jumped {
            f.write_str(jumped)?;
        }
        if self.left_out > 0 {
            let count = self.left_out;
            write!(f, "; {count} places were left out, where more than three tools are near")?;
        }
        match &self.crossed {
            Some(Crossed { tool, depth }) => {
                write!(
                    f,
                    "; it is {:.3} mm inside `{tool}`, and nothing keeps tools apart",
                    1e3 * depth
                )
            }
            None => Ok(()),
        }
    }
}

/// A tool that moves further than so many of its thinnest radii in a substep has the frame divided.
const MOST_RADII: f64 = 4.0;

/// A frame is divided into so many times as many substeps at most.
const MOST_DIVIDED: f64 = 100.0;

/// Closing forces below this one [N] are approached as it is.
const LEAST_FORCE: f64 = 1e-2;

/// The share of their speed that jaws have at least, and how fast it grows again.
const LEAST_GAIN: f64 = 1.0 / 64.0;
const GROWTH: f64 = 1.25;

/// Jaws that follow a force.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Jaw {
    /// Opening angle at the beginning of the frame to come [rad].
    pub angle: f64,
    /// In that frame [rad/s].
    pub speed: f64,
    /// The share of the largest speed that they take: less where they have swung about their rest.
    pub gain: f64,
}

/// What is kept of a scene's tools from frame to frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Instruments {
    /// Of each tool; without meaning where it has no jaws that follow a force.
    jaws: Vec<Jaw>,
    /// The beginning of the frame to come [s].
    since: f64,
    /// Of each tool, whether it is in the scene; what stands behind is not.
    there: Vec<bool>,
    /// Of each part of each tool that is there, whether it was put elsewhere in the last frame; empty where none moves.
    jumped: Vec<bool>,
}

impl Instruments {
    /// At the beginning of a scene whose frames have this duration [s].
    pub fn new(tools: &[Instrument], frame: f64) -> Self {
        let there = there_at(tools, 0.0, tolerance_of(frame));
        let mut all = Self::of(tools.iter().map(Jaw::open).collect(), there, 0.0);
        all.choose_speeds(tools, &[], &[], frame);
        all
    }

    /// Of jaws that were saved, and of tools that were there, at a time [s].
    pub fn of(jaws: Vec<Jaw>, there: Vec<bool>, since: f64) -> Self {
        Self { jaws, since, there, jumped: Vec::new() }
    }

    pub fn jaws(&self) -> &[Jaw] {
        &self.jaws
    }

    /// Of each tool whether it is in the scene, in the frame that has ended or begins.
    pub fn there(&self) -> &[bool] {
        &self.there
    }

    /// Whether a tool is.
    pub fn is_there(&self, index: usize) -> bool {
        self.there.get(index).copied().unwrap_or(false)
    }

    /// How many parts of a tool are there.
    pub fn parts_of(&self, index: usize, tool: &Instrument) -> usize {
        if self.is_there(index) { tool.parts.len() } else { 0 }
    }

    /// Another tool, which is not there yet.
    pub fn add(&mut self, tool: &Instrument) {
        self.jaws.push(Jaw::open(tool));
    }

    /// From the frame [s] on that begins now these tools are there. Returns where each part that was there is now among
    /// those that are.
    pub fn come_and_go(
        &mut self,
        tools: &[Instrument],
        there: Vec<bool>,
        frame: f64,
    ) -> Vec<Option<u32>> {
        let (mut places, mut next) = (Vec::new(), 0);
        for (index, tool) in tools.iter().enumerate() {
            let stays = there.get(index) == Some(&true);
            for part in 0..self.parts_of(index, tool) {
                places.push(stays.then_some(next + part as u32));
            }
            next += if stays { tool.parts.len() as u32 } else { 0 };
        }
        let before = std::mem::replace(&mut self.there, there);
        self.jumped.clear();
        for (index, (tool, jaw)) in tools.iter().zip(&mut self.jaws).enumerate() {
            let comes = self.there.get(index) == Some(&true) && before.get(index) != Some(&true);
            if let Some(jaws) = tool.jaws.as_ref().filter(|jaws| comes && jaws.follow_force()) {
                jaw.choose_speed((tool, jaws), 0.0, self.since, frame);
            }
        }
        places
    }

    /// The opening angle of a tool's jaws at a time [s], from the frame to come on; zero where it has none [rad].
    pub fn angle(&self, index: usize, tool: &Instrument, time: f64) -> f64 {
        let now = match (&tool.jaws, self.jaws.get(index)) {
            (Some(jaws), Some(jaw)) => {
                let angle = jaw.angle + jaw.speed * (time - self.since).max(0.0);
                within(jaws, angle)
            }
            _ => 0.0,
        };
        tool.jaw_angle(time, now)
    }

    /// Puts the tools of a time [s] into the inputs; takes no memory where they have room.
    pub fn act<S: Real>(&self, tools: &[Instrument], time: f64, inputs: &mut Inputs<S>) {
        inputs.tools.clear();
        self.parts_at(tools, time, &mut inputs.tools);
    }

    /// Tells which tools were put elsewhere in the last frame.
    pub fn tell_jumps(&self, tools: &[Instrument], forces: &mut [ToolForce]) {
        let mut first = 0;
        for (index, (tool, force)) in tools.iter().zip(forces).enumerate() {
            let range = first..first + self.parts_of(index, tool);
            first = range.end;
            let parts = self.jumped.get(range).unwrap_or_default();
            force.has_jumped = parts.contains(&true);
        }
    }

    /// Adds the parts of all tools that are there, where they are at a time [s].
    pub fn parts_at(&self, tools: &[Instrument], time: f64, parts: &mut Vec<Tool>) {
        for (index, tool) in tools.iter().enumerate().filter(|(index, _)| self.is_there(*index)) {
            tool.parts_at(time, self.angle(index, tool, time), parts);
        }
    }

    /// Substeps of a frame from `start` to `end` [s] that is to have so many: more where a tool would go far. Remembers which
    /// are put elsewhere.
    pub fn substeps(&mut self, tools: &[Instrument], [start, end]: [f64; 2], substeps: u32) -> u32 {
        self.jumped.clear();
        let moves = |(index, tool): (usize, &Instrument)| {
            self.is_there(index) && !(tool.stands_still() && tool.hands.is_empty())
        };
        if !tools.iter().enumerate().any(moves) {
            return substeps;
        }
        let dt = (end - start) / f64::from(substeps);
        let (mut before, mut after) = (Vec::new(), Vec::new());
        self.parts_at(tools, start, &mut before);
        let mut most = 1.0_f64;
        for substep in 1..=substeps {
            after.clear();
            self.parts_at(tools, start + f64::from(substep) * dt, &mut after);
            for (from, to) in before.iter().zip(&after) {
                let (radius, way) = (to.shape.thinnest(), farthest(from, to));
                if radius.is_finite() && !to.jumps(way, dt) {
                    most = most.max(way / (MOST_RADII * radius));
                }
            }
            let jumped = before.iter().zip(&after).map(|(from, to)| {
                to.jumps((to.pose.translation - from.pose.translation).length(), dt)
            });
            if self.jumped.is_empty() {
                self.jumped.extend(jumped);
            } else {
                self.jumped.iter_mut().zip(jumped).for_each(|(all, jumped)| *all |= jumped);
            }
            std::mem::swap(&mut before, &mut after);
        }
        substeps * most.min(MOST_DIVIDED).ceil() as u32
    }

    /// What tools met at the end of a frame decides how jaws go on. `parts` are those of the frame's end, `time` [s].
    pub fn follow(
        &mut self,
        tools: &[Instrument],
        wrenches: &[Wrench],
        parts: &[Tool],
        (time, frame): (f64, f64),
    ) {
        for (index, tool) in tools.iter().enumerate() {
            let angle = self.angle(index, tool, time);
            if let Some(jaw) = self.jaws.get_mut(index) {
                jaw.angle = angle;
            }
        }
        self.since = time;
        self.choose_speeds(tools, wrenches, parts, frame);
    }

    fn choose_speeds(
        &mut self,
        tools: &[Instrument],
        wrenches: &[Wrench],
        parts: &[Tool],
        frame: f64,
    ) {
        let time = self.since;
        let mut first = 0;
        for (index, tool) in tools.iter().enumerate() {
            let range = first..first + self.parts_of(index, tool);
            first = range.end;
            let Some(jaw) = self.jaws.get_mut(index).filter(|_| !range.is_empty()) else {
                continue;
            };
            let Some(jaws) = tool.jaws.as_ref().filter(|jaws| jaws.follow_force()) else {
                continue;
            };
            let met = wrenches.get(range.clone()).zip(parts.get(range));
            let opening = met.map_or(0.0, |(wrenches, parts)| {
                let pose = pose_of(tool, parts, (time, within(jaws, jaw.angle)));
                opening_torque(tool, &pose, wrenches, parts)
            });
            jaw.choose_speed((tool, jaws), opening, time, frame);
        }
    }

    /// Forces on tools at a time [s], none on those that are not there; `parts` and `wrenches` are those of the last step.
    pub fn forces_on(
        &self,
        tools: &[Instrument],
        wrenches: &[Wrench],
        parts: &[Tool],
        time: f64,
    ) -> Vec<ToolForce> {
        let mut first = 0;
        let of_tool = |(index, tool): (usize, &Instrument)| {
            let range = first..first + self.parts_of(index, tool);
            first = range.end;
            let met = wrenches.get(range.clone()).zip(parts.get(range)).unwrap_or_default();
            let pose = pose_of(tool, met.1, (time, self.angle(index, tool, time)));
            force_on(tool, met, pose.translation)
        };
        tools.iter().enumerate().map(of_tool).collect()
    }
}

impl Jaw {
    /// Of a tool that comes into the scene.
    fn open(tool: &Instrument) -> Self {
        let angle = tool.jaws.as_ref().map_or(0.0, |jaws| jaws.open);
        Self { angle, speed: 0.0, gain: 1.0 }
    }

    /// For the frame [s] that begins at a time [s], in which tissue opens the jaws by a torque [N m].
    fn choose_speed(
        &mut self,
        (tool, jaws): (&Instrument, &Jaws),
        opening: f64,
        time: f64,
        frame: f64,
    ) {
        if tool.is_locked(time) {
            self.speed = 0.0;
            return;
        }
        let arm = 0.5 * jaws.length;
        let closing = tool.closing_force(time) * arm;
        let drive = ((opening - closing) / closing.abs().max(LEAST_FORCE * arm)).clamp(-1.0, 1.0);
        let has_turned = drive * self.speed < 0.0;
        let gain = if has_turned { 0.5 * self.gain } else { GROWTH * self.gain };
        self.gain = gain.clamp(LEAST_GAIN, 1.0);
        let speed = drive * self.gain * jaws.open / jaws.closing_time;
        self.speed = (within(jaws, self.angle + speed * frame) - self.angle) / frame;
    }
}

/// An angle [rad] that jaws which follow a force can have.
fn within(jaws: &Jaws, angle: f64) -> f64 {
    angle.max(jaws.least_angle()).min(jaws.open)
}

/// How far the farthest point of a part goes at most [m].
fn farthest(from: &Tool, to: &Tool) -> f64 {
    let turn = rotation_vector(&(to.pose.rotation * from.pose.rotation.transpose())).length();
    let way = (to.pose.translation - from.pose.translation).length();
    if turn > 0.0 { way + turn * to.shape.reach() } else { way }
}

/// The mean torque [N m] about the hinge of a tool at `pose` by which tissue opens each jaw.
fn opening_torque(
    tool: &Instrument,
    pose: &RigidTransform,
    wrenches: &[Wrench],
    parts: &[Tool],
) -> f64 {
    let hinge = pose.turn(vec3(1.0, 0.0, 0.0));
    let all = tool.parts.iter().zip(wrenches).zip(parts);
    let each = all.map(|((part, wrench), placed)| {
        0.5 * part.opens * hinge.dot(torque_about(pose.translation, wrench, placed))
    });
    each.sum()
}

/// The torque [N m] of what a part meets about a point [m].
fn torque_about(point: Vec3<f64>, wrench: &Wrench, placed: &Tool) -> Vec3<f64> {
    wrench.torque + (placed.pose.translation - point).cross(wrench.force)
}

/// Where a tool is at a time [s] with its jaws at an angle [rad], its parts where they are: a spring may have given way.
fn pose_of(tool: &Instrument, parts: &[Tool], (time, angle): (f64, f64)) -> RigidTransform {
    match (tool.spring, parts.first().zip(tool.parts.first())) {
        (Some(_), Some((placed, part))) => placed.pose.after(&part.placed(angle).inverse()),
        _ => tool.pose(time),
    }
}

/// The force on a tool whose origin is there [m] by what its parts met where they are.
fn force_on(
    tool: &Instrument,
    (wrenches, parts): (&[Wrench], &[Tool]),
    origin: Vec3<f64>,
) -> ToolForce {
    let mut sum = Wrench::default();
    for (wrench, placed) in wrenches.iter().zip(parts) {
        sum.force += wrench.force;
        sum.torque += torque_about(origin, wrench, placed);
        sum.touches += wrench.touches;
        sum.pinned += wrench.pinned;
        sum.left_out += wrench.left_out;
        sum.depth = sum.depth.max(wrench.depth);
    }
    ToolForce {
        name: tool.name.clone(),
        force: sum.force.to_array(),
        torque: sum.torque.to_array(),
        touches: sum.touches,
        pinned: sum.pinned,
        left_out: sum.left_out,
        depth: sum.depth,
        has_jumped: false,
        crossed: None,
        error: None,
        torque_error: None,
    }
}

/// Of each tool whether it is there in a frame that begins at a time [s].
pub(super) fn there_at(tools: &[Instrument], time: f64, tolerance: f64) -> Vec<bool> {
    tools.iter().map(|tool| tool.is_there(time, tolerance)).collect()
}
