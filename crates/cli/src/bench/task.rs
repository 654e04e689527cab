//! What is timed: a step of some length, or the steps of a frame.

use super::solvers::SolverEntry;
use super::subjects::{Size, Subject, hanging};
use anyhow::Result;
use serde::Serialize;
use viscera::model::ModelBuilder;
use viscera::settings::{Method, SolverSettings};
use viscera::solver::Solver;

/// A step [s]: a sixtieth of a second in ten substeps.
pub const DT: f64 = 1.0 / 600.0;
/// A frame [s].
pub const FRAME: f64 = 1.0 / 60.0;
/// How many tetrahedra a bar has by whose oscillations the substeps of a frame are chosen: they do not follow the mesh.
const OSCILLATING: usize = 3_000;

/// How long a step is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Length {
    /// [`DT`]; of an explicit solver as many small steps as it has sweeps.
    Usual,
    /// So long [s].
    Step(f64),
    /// Of a frame in as many substeps as are chosen; the explicit method takes it as one step.
    Frame,
}

/// What the host reads after each step, and waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ReadBack {
    Nothing,
    Positions,
    /// The force balance, by which the forces of fixings are known.
    Forces,
    /// The force on a tool that tissue meets, and nothing else.
    Tool,
}

/// What is timed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Task {
    pub length: Length,
    pub read_back: ReadBack,
    /// Of the tissue.
    pub poisson: f64,
}

impl Task {
    /// What solvers are compared by.
    pub const USUAL: Self =
        Self { length: Length::Usual, read_back: ReadBack::Nothing, poisson: 0.45 };

    /// The steps that one unit of the answer has, and their length [s] where it is fixed.
    pub fn steps(&self, entry: &SolverEntry) -> Result<(u32, Option<f64>)> {
        Ok(match self.length {
            Length::Usual => (1, None),
            Length::Step(dt) => (1, Some(dt)),
            Length::Frame => {
                let substeps = substeps(entry)?;
                (substeps, Some(FRAME / f64::from(substeps)))
            }
        })
    }
}

/// Of a frame, as the solver chooses them for a bar of this tissue.
fn substeps(entry: &SolverEntry) -> Result<u32> {
    let settings: SolverSettings = entry.settings();
    if settings.method == Method::Explicit {
        return Ok(1);
    }
    let mesh = Subject::Bar(Size(OSCILLATING)).mesh()?.into_owned();
    let mut builder = ModelBuilder::new();
    builder.add_body(&mesh, &entry.tissue()?)?;
    let model = builder.build::<f32>()?;
    Ok(Solver::new(&model, &settings).substeps(&hanging(&mesh), FRAME))
}
