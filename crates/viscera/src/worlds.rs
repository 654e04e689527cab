//! Many worlds: one scene, many simulations of it, each with settings, holds and tools of its own, side by side on threads.
//!
//! A world has the bits that it has alone, whatever becomes of the others, and however many threads there are.
//!
//! ```
//! use viscera::scene::Scene;
//! use viscera::simulation::Assembly;
//! use viscera::worlds::{Status, Worlds};
//!
//! let text = r#"
//!     [[body]]
//!     name = "block"
//!     shape = "block"
//!     size = ["30 mm", "30 mm", "15 mm"]
//!     cells = [3, 3, 2]
//!     material = { young = "5 kPa", poisson = 0.45 }
//!
//!     [[fixing]]
//!     body = "block"
//!     half_space = { point = [0, 0, 0], normal = [0, 0, -1] }
//! "#;
//! let scene = Scene::parse("block.toml", text, &[])?;
//! let assembly = Assembly::new(&scene, &mut |file| Err(format!("{file}: no files here")))?;
//! let mut worlds = Worlds::<f32>::new(scene, assembly, 4, 2)?;
//! worlds.for_each(None, |number, simulation| {
//!     let young = format!("{} kPa", 5 + number);
//!     simulation.change(&[("body.block.material.young".to_owned(), young)])
//! })?;
//! worlds.step(2);
//! assert!((0..4).all(|number| worlds.status(number) == Status::Fine));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::scalar::Real;
use crate::scene::Scene;
use crate::settings::Method;
use crate::simulation::{Assembly, Checkpoint, FrameError, LiveError, Simulation, SimulationError};
use rayon::prelude::*;
use std::sync::Arc;

/// Unbalanced forces over loads above which a world is [`Status::Unsolved`].
const UNSOLVED: f64 = 0.01;

/// More threads than there are worlds have nothing to do; more than this no machine has.
const MOST_THREADS: usize = 1024;

/// How a world is after its last step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// As it should be.
    Fine,
    /// Its iterations ended before forces were balanced within 1 % of the loads: it seems stiffer or softer than it is.
    Unsolved,
    /// Tetrahedra are turned inside out.
    Inverted,
    /// It cannot go on: it is not stepped until it is reset.
    Failed,
}

/// Simulations of one scene.
#[derive(Debug)]
pub struct Worlds<S: Real> {
    worlds: Vec<World<S>>,
    pool: rayon::ThreadPool,
}

#[derive(Debug)]
struct World<S: Real> {
    simulation: Simulation<S>,
    /// Its beginning, of the model that it has now: worlds of one model share it.
    start: Arc<Checkpoint<S>>,
    failure: Option<FrameError>,
}

/// Why there cannot be so many worlds.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WorldsError {
    /// None were asked for.
    #[error("there must be one world at least")]
    NoWorld,
    /// Threads cannot be had.
    #[error("{threads} threads cannot be started: {reason}; take from 1 to {MOST_THREADS}")]
    Threads {
        /// How many were asked for.
        threads: usize,
        /// Why not.
        reason: String,
    },
    /// A simulation of the scene cannot be built.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// It cannot be computed by one thread on the CPU.
    #[error(transparent)]
    Live(#[from] LiveError),
}

impl<S: Real> Worlds<S> {
    /// So many worlds of a scene, on so many threads; each world is computed by one thread at a time, on the CPU.
    pub fn new(
        mut scene: Scene,
        assembly: Assembly,
        count: usize,
        threads: usize,
    ) -> Result<Self, WorldsError> {
        if count == 0 {
            return Err(WorldsError::NoWorld);
        }
        let refuse = |reason: String| WorldsError::Threads { threads, reason };
        if !(1..=MOST_THREADS).contains(&threads) {
            return Err(refuse("that is no number of threads".to_owned()));
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.min(count)).build();
        let pool = pool.map_err(|error| refuse(error.to_string()))?;
        let alone = [("threads", "1"), ("device", "cpu")];
        let alone = alone.map(|(key, value)| (format!("solver.{key}"), value.to_owned()));
        scene.change(&alone).map_err(LiveError::from)?;
        let build = |_| Simulation::new(scene.clone(), assembly.clone());
        // The first shows whether there can be any.
        let first = build(0)?;
        let start = Arc::new(first.checkpoint());
        let others: Result<Vec<_>, _> =
            pool.install(|| (1..count).into_par_iter().map(build).collect());
        let all = std::iter::once(first).chain(others?);
        let world = |simulation| World { simulation, start: Arc::clone(&start), failure: None };
        Ok(Self { worlds: all.map(world).collect(), pool })
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.worlds.len()
    }

    /// One of them.
    pub fn world(&self, number: usize) -> Option<&Simulation<S>> {
        self.worlds.get(number).map(|world| &world.simulation)
    }

    /// How one of them is; [`Status::Failed`] of one that there is not.
    pub fn status(&self, number: usize) -> Status {
        let Some(World { simulation, failure: None, .. }) = self.worlds.get(number) else {
            return Status::Failed;
        };
        let residual = simulation.relative_residual();
        // Explicit steps have no iterations that could end early.
        let iterates = simulation.solver().method != Method::Explicit;
        match () {
            () if simulation.deformation().inverted > 0 => Status::Inverted,
            () if iterates && (residual > UNSOLVED || residual.is_nan()) => Status::Unsolved,
            () => Status::Fine,
        }
    }

    /// Why one of them cannot go on.
    pub fn failure(&self, number: usize) -> Option<&FrameError> {
        self.worlds.get(number)?.failure.as_ref()
    }

    /// Advances all worlds that have not failed by so many frames, and measures the last.
    pub fn step(&mut self, frames: u32) {
        self.pool.install(|| {
            self.worlds.par_iter_mut().with_max_len(1).for_each(|world| world.step(frames));
        });
    }

    /// Does something to each world, or to those that are chosen: between frames. The first error, by the number of its world,
    /// is returned once all are done; the others stand.
    pub fn for_each<E: Send>(
        &mut self,
        chosen: Option<&[bool]>,
        act: impl Fn(usize, &mut Simulation<S>) -> Result<(), E> + Sync,
    ) -> Result<(), E> {
        self.each(chosen, |number, world| act(number, &mut world.simulation))
    }

    /// Sets worlds, or those that are chosen, back to the beginning, at rest: holds and tools that were taken are gone, settings
    /// stay. Where only its state has changed that costs a copy of it.
    pub fn reset(&mut self, chosen: Option<&[bool]>) -> Result<(), LiveError> {
        self.each(chosen, |_, world| world.reset())
    }

    fn each<E: Send>(
        &mut self,
        chosen: Option<&[bool]>,
        act: impl Fn(usize, &mut World<S>) -> Result<(), E> + Sync,
    ) -> Result<(), E> {
        let is_chosen = |number: usize| {
            chosen.is_none_or(|chosen| chosen.get(number).copied().unwrap_or(false))
        };
        let act = |(number, world): (usize, &mut World<S>)| match is_chosen(number) {
            true => act(number, world),
            false => Ok(()),
        };
        let done: Vec<Result<(), E>> = self
            .pool
            .install(|| self.worlds.par_iter_mut().with_max_len(1).enumerate().map(act).collect());
        done.into_iter().collect()
    }
}

impl<S: Real> World<S> {
    fn step(&mut self, frames: u32) {
        for frame in 1..=frames {
            if self.failure.is_some() {
                return;
            }
            let simulation = &mut self.simulation;
            let stepped = match frame == frames {
                true => simulation.advance_frame(),
                false => simulation.advance(),
            };
            self.failure = stepped.err();
        }
    }

    fn reset(&mut self) -> Result<(), LiveError> {
        let restored = match self.failure.is_none() {
            true => self.simulation.restore(&self.start),
            // What failed has a solver that may be in the middle of something.
            false => Err(LiveError::OtherModel),
        };
        if restored.is_err() {
            self.simulation.reset()?;
            self.start = Arc::new(self.simulation.checkpoint());
        }
        self.failure = None;
        Ok(())
    }
}
