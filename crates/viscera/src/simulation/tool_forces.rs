//! What a simulation says of its tools.

use super::Simulation;
use super::crossings::crossings;
use super::holding::tolerance;
use super::instruments::ToolForce;
use crate::contact::held::carry;
use crate::contact::{HeldMotion, Tool, Wrench};
use crate::scalar::Real;
use crate::solver::Ledger;

impl<S: Real> Simulation<S> {
    /// Forces on the scene's tools at the end of the last frame; zero before the first and after a change of settings.
    pub fn tool_forces(&self) -> Vec<ToolForce> {
        let (tools, parts, time) = (&self.assembly.tools, &self.inputs.tools, self.time());
        let mut forces = self.instruments.forces_on(tools, self.wrenches(), parts, time);
        self.instruments.tell_jumps(tools, &mut forces);
        let count_of = |index: usize, tool: &_| self.instruments.parts_of(index, tool);
        for (force, crossed) in forces.iter_mut().zip(crossings(tools, parts, count_of)) {
            force.crossed = crossed;
        }
        let shadow = self.shadow.as_ref().filter(|_| self.stepped);
        if let Some((shadow, wrenches)) = shadow.and_then(|all| Some((all, all.wrenches()?))) {
            let others = self.instruments.forces_on(tools, wrenches, parts, time);
            for (force, other) in forces.iter_mut().zip(others) {
                force.compare(&other, |force, other| shadow.error(force, other));
            }
        }
        forces
    }

    /// Of each part of each tool.
    pub(super) fn wrenches(&self) -> &[Wrench] {
        self.wrenches.as_deref().unwrap_or_else(|| self.backend.wrenches())
    }

    /// Work of tools on tissue and the energy that is stored, since the beginning or the last change of settings. Nothing where
    /// a graphics processor computes, which keeps no account of it.
    pub fn ledger(&self) -> Option<Ledger> {
        self.backend.ledger()
    }

    /// The opening angle [rad] of a tool's jaws at the end of the last frame; nothing where it has none.
    pub fn jaw_angle(&self, tool: usize) -> Option<f64> {
        let at = self.assembly.tools.get(tool).filter(|tool| tool.jaws.is_some())?;
        Some(self.instruments.angle(tool, at, self.time()))
    }

    /// The parts of all tools that are there in the frame to come, where they are now, tool by tool: [`Simulation::tools`]
    /// says which.
    pub fn tool_parts(&self) -> Vec<Tool> {
        let (mut parts, time) = (Vec::new(), self.time());
        for (index, tool) in self.assembly.tools.iter().enumerate() {
            if tool.is_there(time, tolerance(&self.scene)) {
                let first = parts.len();
                tool.parts_at(time, self.instruments.angle(index, tool, time), &mut parts);
                if let Some([pose, _]) = self.held(index).and_then(|held| held.poses) {
                    carry(&mut parts[first..], &pose);
                }
            }
        }
        parts
    }

    /// How a tool moves that a spring holds, and the force of the spring on the hand, at the end of the last frame; nothing
    /// where none does, and before the tool's first frame.
    pub fn held(&self, tool: usize) -> Option<HeldMotion> {
        let tools = self.assembly.tools.iter().enumerate();
        let before = tools.take(tool).map(|(index, at)| self.instruments.parts_of(index, at));
        let motion = self.state.contact.held.get(before.sum::<usize>())?;
        let at = self.assembly.tools.get(tool)?;
        let is_held = at.spring.is_some() && self.instruments.is_there(tool);
        is_held.then_some(*motion).filter(|motion| motion.poses.is_some())
    }

    /// Puts tools that springs hold to where they are.
    pub(super) fn place_held(&self, parts: &mut [Tool]) {
        let mut first = 0;
        while let Some(part) = parts.get(first) {
            let body = part.held.map(|held| held.body);
            let is_part = |tool: &&Tool| body.is_some() && tool.held.map(|held| held.body) == body;
            let count = parts[first..].iter().take_while(is_part).count();
            let motion = self.state.contact.held.get(first).and_then(|motion| motion.poses);
            if let Some([pose, _]) = motion {
                carry(&mut parts[first..first + count], &pose);
            }
            first += count.max(1);
        }
    }

    /// Jaws go on by what they met in the frame that has ended.
    pub(super) fn lead_jaws(&mut self) {
        let (time, frame) = (self.time(), self.scene.time.frame);
        let Self { instruments, assembly, backend, inputs, .. } = self;
        instruments.follow(&assembly.tools, backend.wrenches(), &inputs.tools, (time, frame));
    }
}
