//! Rough handling that the sections share: a bar whose vertices are torn about, or scrambled.

use std::fmt;

use anyhow::Result;
use viscera::material::Material;
use viscera::mesh::shapes::{Block, Splitting};
use viscera::mesh::tet_volume;
use viscera::model::Model;
use viscera::scalar::Vec3;
use viscera::settings::SolverSettings;
use viscera::solver::{Inputs, Pin, Solver};
use viscera::state::State;

use crate::load_cases::{FRAME_RATE, LoadCase, Random};
use crate::settling::AfterStep;
use viscera_reference::{Reference, ReferenceError};

/// Edge lengths of the bar [m].
pub const SIZE: [f64; 3] = [0.08, 0.04, 0.04];

/// Of a potential or an energy, what its sums may lose to rounding.
pub const ROUND_OFF: f64 = 1e-9;

/// Frames of a run.
pub const FRAMES: u32 = 60;

/// Frames after which grabs are let go; they jump again at half time.
pub const HELD: u32 = 20;

const CELLS: [usize; 3] = [8, 4, 4];

/// What is done to the bar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Vertices jump to places up to a body length away, twice, and are let go.
    Grab,
    /// All vertices start at random places in the body's box.
    Scramble,
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Grab => "violent grab",
            Self::Scramble => "scramble",
        })
    }
}

/// The bar, 768 tetrahedra, held by nothing.
pub fn bar(tissue: Material) -> Result<LoadCase> {
    let block = Block {
        splitting: Splitting::Six,
        jitter: 0.6,
        seed: 1,
        ..Block::new(Vec3::from_f64(SIZE), CELLS)
    };
    Ok(LoadCase::bare("bar", block.mesh()?, tissue))
}

/// One bar in trouble, a step per frame.
pub struct Run<'a> {
    /// The body.
    pub load_case: &'a LoadCase,
    /// For its solver.
    pub model: Model<f64>,
    /// What moves it.
    pub solver: Solver<f64>,
    /// Where it is.
    pub state: State<f64>,
    /// Of the last step.
    pub inputs: Inputs<f64>,
    /// Frames done.
    pub frame: u32,
    kind: Kind,
    random: Random,
    grabbed: Vec<u32>,
}

impl<'a> Run<'a> {
    /// The length of a step [s].
    pub const DT: f64 = 1.0 / FRAME_RATE;

    /// Before the first step. Equal seeds do the same to every solver.
    pub fn new(
        load_case: &'a LoadCase,
        kind: Kind,
        seed: u64,
        settings: &SolverSettings,
    ) -> Result<Self> {
        let model = load_case.model::<f64>()?;
        let mut solver = Solver::new(&model, settings);
        let mut state = State::at_rest(&model);
        let mut random = Random(seed);
        let inputs = Inputs::default();
        let mut grabbed = Vec::new();
        match kind {
            Kind::Grab => {
                let count = 2 + random.bits() % 6;
                for _ in 0..count {
                    grabbed.push((random.bits() % model.vertex_count() as u64) as u32);
                }
            }
            Kind::Scramble => {
                for x in &mut state.positions {
                    *x = Vec3::from_f64(SIZE.map(|side| random.uniform(0.0, side)));
                }
                solver.restart(&model, &mut state, &inputs, Self::DT)?;
            }
        }
        Ok(Self { load_case, model, solver, state, inputs, frame: 0, kind, random, grabbed })
    }

    /// The next frame.
    pub fn step(&mut self) -> Result<()> {
        if self.kind == Kind::Grab && (self.frame == 0 || self.frame == HELD / 2) {
            self.inputs.pins.clear();
            for &vertex in &self.grabbed {
                let rest = self.model.rest_positions[vertex as usize];
                let target = rest + self.random.vector(SIZE[0]);
                self.inputs.pins.push(Pin { vertex, target });
            }
        }
        if self.frame == HELD {
            self.inputs.pins.clear();
        }
        self.solver.step(&self.model, &mut self.state, &self.inputs, Self::DT)?;
        self.frame += 1;
        Ok(())
    }

    /// The next frame, and what `Phi`, computed outside the solver, is at its end over what it was at its start;
    /// infinite where it is no number.
    pub fn step_watched(&mut self, reference: &Reference) -> Result<f64> {
        let before = self.state.clone();
        self.step()?;
        let x = &self.state.positions;
        let [start, end] = reference.incremental(&before, x, &self.inputs, Self::DT)?;
        let factor = end / start;
        Ok(match (factor.is_finite(), end.abs() <= start.abs()) {
            (true, _) => factor,
            // A body that rests has no potential at all.
            (false, true) => 1.0,
            (false, false) => f64::INFINITY,
        })
    }

    /// Kinetic and elastic energy [J], computed outside the solver; infinite where positions are NaN.
    pub fn mechanical_energy(&self, reference: &Reference) -> Result<f64, ReferenceError> {
        if !self.state.is_finite() {
            return Ok(f64::INFINITY);
        }
        let moving = self.state.velocities.iter().zip(&self.model.masses);
        let kinetic: f64 = moving.map(|(v, m)| 0.5 * m * v.length_squared()).sum();
        Ok(kinetic + reference.elastic_energy(&self.state.positions, &self.inputs)?)
    }

    /// For what is done after a step.
    pub fn after_step(&mut self) -> AfterStep<'_, f64> {
        let Self { model, solver, state, inputs, .. } = self;
        AfterStep { model, solver, state, inputs, dt: Self::DT }
    }

    /// Whether nothing but the tissue itself acts from now on.
    pub fn is_free(&self) -> bool {
        self.kind == Kind::Scramble || self.frame >= HELD
    }

    /// Tetrahedra inside out; all of them where positions are NaN.
    pub fn inverted(&self) -> usize {
        let is_finite = self.state.is_finite();
        let is_inverted = |tet: &&[u32; 4]| {
            !is_finite || tet_volume(tet.map(|v| self.state.positions[v as usize])) <= 0.0
        };
        self.load_case.mesh.tets().iter().filter(is_inverted).count()
    }
}
