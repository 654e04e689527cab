//! A scene's course by the reference, from one state of rest to the next.
//!
//! Static equilibrium is followed through increments of the scene's time, so that it ends in the
//! minimum that the motions lead to, not in any other.

use anyhow::{Result, anyhow};
use viscera::simulation::Simulation;
use viscera::solver::Inputs;
use viscera_resources::Memory;

use crate::sections::Progress;
use viscera_reference::{Cost, Course, ReferenceError, RestState, Standing};

/// What the scene does at one time.
struct Stop {
    /// [s].
    time: f64,
    inputs: Inputs<f64>,
}

/// The way to the end of a scene.
pub struct LoadPath<'a> {
    simulation: &'a Simulation<f64>,
    course: Course<'a>,
    memory: Memory,
    parts: u32,
    /// Where something changes; at least one.
    stops: Vec<Stop>,
}

/// The state of rest at the end of a scene.
pub struct Rest {
    /// Places, forces and what acts.
    pub state: RestState,
    /// Its potential and unbalanced forces.
    pub standing: Standing,
    /// Newton steps of all parts.
    pub steps: u32,
}

impl Rest {
    /// What unbalanced forces are measured against [N]: dead loads, or the forces that hold, where
    /// these are more. One where nothing acts at all.
    pub fn load(&self) -> f64 {
        let squares: f64 = self.state.holding.iter().map(|force| force.length_squared()).sum();
        let load = self.standing.load.max(squares.sqrt());
        if load > 0.0 { load } else { 1.0 }
    }

    /// Unbalanced forces over the load.
    pub fn relative_gradient(&self) -> f64 {
        self.standing.gradient / self.load()
    }
}

impl<'a> LoadPath<'a> {
    /// Divides the scene's time; fails where a body has no state of rest at one of the times.
    pub fn new(simulation: &'a Simulation<f64>, parts: u32, memory: Memory) -> Result<Self> {
        let scene = simulation.scene();
        let end = scene.frame_count() as f64 * scene.time.frame;
        let course = Course::new(simulation, memory.0);
        let mut path = Self { simulation, course, memory, parts, stops: Vec::new() };
        for part in 1..=parts {
            // The last is the end itself, whatever the parts are.
            let left = f64::from(parts - part) / f64::from(parts);
            let time = end - end * left;
            let inputs = simulation.inputs_at(time);
            // Dead time changes nothing: the state of rest is the same, only later.
            match path.stops.last_mut() {
                Some(last) if last.inputs == inputs => last.time = time,
                _ => path.stops.push(Stop { time, inputs }),
            }
        }
        let rest = &simulation.model().rest_positions;
        for stop in &path.stops {
            let held = path.course.reference().check_held(rest, &stop.inputs);
            held.map_err(|error| path.explain(error, stop.time))?;
        }
        Ok(path)
    }

    /// How many states of rest are solved for.
    pub fn len(&self) -> usize {
        self.stops.len()
    }

    /// What the most expensive part costs, and the time [s] of all, roughly. An error where it is
    /// more memory than allowed comes with [`Path::check_memory`].
    pub fn cost(&mut self) -> Result<(Cost, f64)> {
        let mut most: Option<Cost> = None;
        let mut seconds = 0.0;
        for at in 0..self.stops.len() {
            let stop = &self.stops[at];
            let cost = self.course.reference_mut().cost(&stop.inputs);
            let cost = cost.map_err(|error| self.explain(error, self.stops[at].time))?;
            seconds += cost.solve_seconds;
            if most.is_none_or(|most| cost.bytes > most.bytes) {
                most = Some(cost);
            }
        }
        most.map(|most| (most, seconds)).ok_or_else(|| anyhow!("the scene takes no time"))
    }

    /// Refuses what is too large.
    pub fn check_memory(&self, cost: &Cost) -> Result<()> {
        let (unknowns, bytes, limit) = (cost.unknowns, cost.bytes, self.memory.0);
        if bytes <= limit {
            return Ok(());
        }
        Err(self.explain(ReferenceError::TooLarge { unknowns, bytes, limit }, 0.0))
    }

    /// Solves part after part, with a step of the bar for each.
    pub fn follow(mut self, progress: &Progress) -> Result<Rest> {
        let mut positions = self.simulation.model().rest_positions.clone();
        let (mut steps, mut last, mut before) = (0, None, 0.0);
        for (part, stop) in self.stops.iter().enumerate() {
            let _case = progress.case(&format!("part {} of {}", part + 1, self.stops.len()));
            let solved = self.course.go((before, &positions), stop.time);
            let state = solved.map_err(|error| self.explain(error, stop.time))?;
            positions.clone_from(&state.positions);
            steps += state.convergence.steps;
            before = stop.time;
            last = Some(state);
        }
        let state = last.ok_or_else(|| anyhow!("the scene takes no time"))?;
        let standing = self.course.reference().standing(&state.positions, &state.inputs)?;
        Ok(Rest { state, standing, steps })
    }

    /// An error of the reference in the words of a scene and of this program's options.
    fn explain(&self, error: ReferenceError, time: f64) -> anyhow::Error {
        let scene = &self.simulation.scene().name;
        match error {
            ReferenceError::TooLarge { unknowns, bytes, limit } => {
                let limit = Memory(limit);
                if bytes == u64::MAX {
                    return anyhow!(
                        "{scene}: {unknowns} unknowns are more than the reference can number; take \
                         a coarser mesh"
                    );
                }
                // A little more than needed, so that the advice holds.
                let enough = Memory(bytes.saturating_add(bytes / 10));
                let needed = Memory(bytes);
                anyhow!(
                    "{scene}: the reference would need {needed} for {unknowns} unknowns, more than \
                     the {limit} allowed; take a coarser mesh, or allow more with --memory \
                     \"{enough}\""
                )
            }
            ReferenceError::Loose { vertex, turns } => {
                let body = self.body_of(vertex);
                let (what, cure) = match turns {
                    true => ("is held but free to turn", "hold more of it, out of line"),
                    false => ("is not held by anything", "add a [[fixing]] for it"),
                };
                anyhow!(
                    "{scene}: body `{body}` {what} at {time:.3} s, so it has no state of rest; {cure}"
                )
            }
            ReferenceError::NotConverged { steps, gradient, .. } => anyhow!(
                "{scene}: Newton's method found no state of rest at {time:.3} s: after {steps} \
                 steps {gradient:.1e} N are out of balance; take smaller parts, for example \
                 --parts {}",
                self.parts.saturating_mul(4)
            ),
            other => anyhow!("{scene}, at {time:.3} s: {other}"),
        }
    }

    fn body_of(&self, vertex: u32) -> &str {
        let mut bodies = self.simulation.assembly().bodies.iter();
        let body = bodies.find(|body| body.vertices.contains(&(vertex as usize)));
        body.map_or("", |body| body.name.as_str())
    }
}
