//! The Newton reference: implicit Euler steps and static equilibrium in double precision, by exact
//! Newton steps with a sparse Cholesky factor.
//!
//! It minimises what the library's solver minimises, over the same model and inputs, and shares with
//! it only the pure functions for energy and stress of an element. It is slow and takes much memory:
//! [`Reference::cost`] tells how much before anything is solved.
//!
//! | file | what |
//! |---|---|
//! | `tissue` | second derivative of the energy |
//! | `problem` | tetrahedra, linear or quadratic, springs, attachments |
//! | `recovered` | recovered-gradient tetrahedra |
//! | `contact` | contact with tools and friction, from their formulas |
//! | `touching` | forces on tools, and what a step leaves of contact |
//! | `objective` | potential, gradient, Hessian |
//! | `matrix` | sparse matrix, factor, cost |
//! | `newton` | the iteration |
//! | `frequency` | the slowest oscillation |
//! | `spectrum` | many oscillations of a free body |
//! | `course` | states of rest of a scene |
//! | `overlap` | whether tissue lies in tissue |
//! | `sensitivity` | derivatives of a state of rest by the constants of a model |
//! | `fixing` | whether a body can be at rest |
//! | `error` | why there is no solution |

pub mod contact;
mod course;
mod error;
pub mod fixing;
pub mod frequency;
pub mod matrix;
pub mod newton;
pub mod objective;
mod overlap;
pub mod problem;
pub mod recovered;
pub mod sensitivity;
pub mod spectrum;
pub mod tissue;
mod touching;

use viscera::layout::Smoothing;
use viscera::material::Material;
use viscera::mesh::TetMesh;
use viscera::model::Model;
use viscera::scalar::Vec3;
use viscera::settings::Elements;
use viscera::solver::{Inputs, Tether};
use viscera::state::State;

pub use contact::Touched;
pub use course::{Course, RestState, Undetermined, check_determined};
pub use error::ReferenceError;
pub use frequency::Mode;
pub use matrix::Cost;
pub use newton::{Convergence, Tolerance};

use contact::Contacts;
use matrix::{FactorError, Factorization, Pattern};
use objective::{Load, Objective, creep_at};

use problem::Problem;

/// Memory [B] that a reference takes at most unless stated otherwise.
pub const DEFAULT_MEMORY: u64 = 8 << 30;

/// A solution and how it was found.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Positions [m], shape [vertex_count].
    pub positions: Vec<Vec3<f64>>,
    /// How the solve went.
    pub convergence: Convergence,
}

/// What a state's potential looks like where it is, for comparing minima.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standing {
    /// Potential [J]: elastic energy and that of contact, minus the work of dead loads.
    pub potential: f64,
    /// Elastic energy [J].
    pub elastic_energy: f64,
    /// Norm of the unbalanced forces [N] over free vertices.
    pub gradient: f64,
    /// Norm of the dead loads [N] over free vertices.
    pub load: f64,
}

/// Newton's method for one model.
pub struct Reference {
    problem: Problem,
    tolerance: Tolerance,
    memory: u64,
    lumped: bool,
    goes_on: fn() -> bool,
    /// Of the pins last used.
    analysis: Option<Analysis>,
}

/// Pattern and elimination order for one set of pins.
struct Analysis {
    pinned: Vec<bool>,
    pattern: Pattern,
    factorization: Factorization,
}

impl Reference {
    /// For the library's model.
    pub fn new(model: &Model<f64>) -> Self {
        Self::of(Problem::linear(model), true)
    }

    /// For the library's model with stable neo-Hookean tissue as recovered-gradient tetrahedra.
    pub fn recovered(model: &Model<f64>, smoothing: Smoothing) -> Self {
        Self::of(Problem::recovered(model, smoothing), true)
    }

    /// For the library's model with the elements that a solver of it has.
    pub fn with_elements(model: &Model<f64>, elements: Elements) -> Self {
        match elements {
            Elements::Recovered => Self::recovered(model, Smoothing::RECOVERED),
            Elements::Auto | Elements::Plain => Self::new(model),
        }
    }

    /// For one body of quadratic tetrahedra, with a node on every edge of the mesh; the mesh's
    /// vertices keep their numbers.
    pub fn quadratic(mesh: &TetMesh, material: &Material) -> Self {
        Self::of(Problem::quadratic(mesh, material, None), false)
    }

    /// The same with all regions of the mesh but region 0 of a second material of the same density.
    pub fn quadratic_of_two(mesh: &TetMesh, material: &Material, second: &Material) -> Self {
        Self::of(Problem::quadratic(mesh, material, Some(second)), false)
    }

    fn of(problem: Problem, lumped: bool) -> Self {
        let tolerance = Tolerance::default();
        Self {
            problem,
            tolerance,
            memory: DEFAULT_MEMORY,
            lumped,
            goes_on: || true,
            analysis: None,
        }
    }

    /// Changes how much memory [B] may be taken.
    pub fn allow_memory(mut self, bytes: u64) -> Self {
        self.memory = bytes;
        self
    }

    /// Changes how far Newton's method goes.
    pub fn with_tolerance(mut self, tolerance: Tolerance) -> Self {
        self.tolerance = tolerance;
        self
    }

    /// Solves end with [`ReferenceError::Stopped`] where this says, asked before each Newton step, that they shall not go on.
    pub fn stop_where(mut self, goes_on: fn() -> bool) -> Self {
        self.goes_on = goes_on;
        self
    }

    /// What is solved.
    pub fn problem(&self) -> &Problem {
        &self.problem
    }

    /// What a solve with these inputs would cost. Takes the memory of the pattern only.
    pub fn cost(&mut self, inputs: &Inputs<f64>) -> Result<Cost, ReferenceError> {
        let analysis = self.analyse(self.pinned(inputs)?)?;
        let cost = analysis.factorization.cost(&analysis.pattern, &self.problem);
        self.analysis = Some(analysis);
        Ok(cost)
    }

    /// Static equilibrium near `start` [m]: pins at their targets, gravity and forces as dead loads, tools without
    /// friction where they are.
    pub fn settle(
        &mut self,
        start: &[Vec3<f64>],
        inputs: &Inputs<f64>,
    ) -> Result<Solution, ReferenceError> {
        let pinned = self.check_held(start, inputs)?;
        let x = with_pins(start, inputs);
        let load = Load::Forces(dead_loads(&self.problem, inputs));
        self.minimise(pinned, x, (inputs, &[]), load)
    }

    /// One step of implicit Euler; changes positions and velocities of the state. Tools are at the end of the step and
    /// have no friction.
    pub fn step(
        &mut self,
        state: &mut State<f64>,
        inputs: &Inputs<f64>,
        dt: f64,
    ) -> Result<Convergence, ReferenceError> {
        self.step_touching(state, inputs, &[], dt)
    }

    /// The same with what the step before has left of contact: touched samples keep their planes and have friction.
    pub fn step_touching(
        &mut self,
        state: &mut State<f64>,
        inputs: &Inputs<f64>,
        touched: &[Touched],
        dt: f64,
    ) -> Result<Convergence, ReferenceError> {
        if !self.lumped {
            return Err(ReferenceError::NoStep);
        }
        if !(dt > 0.0 && (dt * dt).is_finite() && 1.0 / (dt * dt) < f64::MAX) {
            return Err(ReferenceError::NotFinite { what: "step" });
        }
        let pinned = self.check(&state.positions, inputs)?;
        self.check_touched(inputs, touched)?;
        let expected = self.problem.vertex_count();
        if state.velocities.len() != expected {
            let (what, given) = ("list of velocities", state.velocities.len());
            return Err(ReferenceError::Mismatch { what, given, expected });
        }
        if !state.velocities.iter().all(|v| v.is_finite()) {
            return Err(ReferenceError::NotFinite { what: "velocities" });
        }
        let predicted = self.predict(state, inputs, dt);
        let x = with_pins(&predicted, inputs);
        let creep = creep_at(&self.problem, &state.positions, dt);
        let start = self.problem.recovered.start(&state.positions, dt);
        let load = Load::Inertia { dt, predicted, creep, start };
        let solution = self.minimise(pinned, x, (inputs, touched), load)?;
        for (v, x) in solution.positions.into_iter().enumerate() {
            state.velocities[v] = (x - state.positions[v]) * (1.0 / dt);
            state.positions[v] = x;
        }
        Ok(solution.convergence)
    }

    /// Where inertia and loads alone would lead all vertices [m].
    fn predict(&self, state: &State<f64>, inputs: &Inputs<f64>, dt: f64) -> Vec<Vec3<f64>> {
        let mut predicted = state.positions.clone();
        for (v, load) in dead_loads(&self.problem, inputs).into_iter().enumerate() {
            let acceleration = load * (1.0 / self.problem.masses[v]);
            predicted[v] += state.velocities[v] * dt + acceleration * (dt * dt);
        }
        predicted
    }

    /// The incremental potential [J] of a step from `state` at places `x` [m] and, before it, at the start
    /// of the step with pins moved; pinned vertices have no inertia. Infinite where `x` is NaN.
    pub fn incremental(
        &self,
        state: &State<f64>,
        x: &[Vec3<f64>],
        inputs: &Inputs<f64>,
        dt: f64,
    ) -> Result<[f64; 2], ReferenceError> {
        self.check(&state.positions, inputs)?;
        let predicted = with_pins(&self.predict(state, inputs, dt), inputs);
        let creep = creep_at(&self.problem, &state.positions, dt);
        let start = self.problem.recovered.start(&state.positions, dt);
        let load = Load::Inertia { dt, predicted, creep, start };
        let objective = objective(&self.problem, inputs, load);
        let value = |x: &[Vec3<f64>]| {
            let sum = objective.value(x).sum;
            if sum.is_finite() { sum } else { f64::INFINITY }
        };
        Ok([value(&with_pins(&state.positions, inputs)), value(x)])
    }

    /// Elastic energy [J] of tissue, springs, attachments and tethers at `x`.
    pub fn elastic_energy(
        &self,
        x: &[Vec3<f64>],
        inputs: &Inputs<f64>,
    ) -> Result<f64, ReferenceError> {
        self.check(x, inputs)?;
        let load = Load::Forces(Vec::new());
        Ok(objective(&self.problem, inputs, load).elastic_energy(x))
    }

    /// Potential, energy and unbalanced forces of statics at `x`.
    pub fn standing(
        &self,
        x: &[Vec3<f64>],
        inputs: &Inputs<f64>,
    ) -> Result<Standing, ReferenceError> {
        let pinned = self.check(x, inputs)?;
        let loads = dead_loads(&self.problem, inputs);
        let objective = objective(&self.problem, inputs, Load::Forces(loads.clone()));
        let norm = |values: &[Vec3<f64>]| {
            let free = values.iter().zip(&pinned).filter(|(_, pinned)| !**pinned);
            free.map(|(value, _)| value.length_squared()).sum::<f64>().sqrt()
        };
        Ok(Standing {
            potential: objective.value(x).sum,
            elastic_energy: objective.elastic_energy(x),
            gradient: norm(&objective.gradient(x)),
            load: norm(&loads),
        })
    }

    /// Forces [N] by which pins hold their vertices at `x`, shape [pin_count].
    pub fn reactions(
        &self,
        x: &[Vec3<f64>],
        inputs: &Inputs<f64>,
    ) -> Result<Vec<Vec3<f64>>, ReferenceError> {
        self.check(x, inputs)?;
        let load = Load::Forces(dead_loads(&self.problem, inputs));
        let gradient = objective(&self.problem, inputs, load).gradient(x);
        Ok(inputs.pins.iter().map(|pin| gradient[pin.vertex as usize]).collect())
    }

    /// Fails where a solve would, for inputs that do not fit or bodies that nothing holds; tells
    /// which vertices are pinned, shape [vertex_count]. Takes next to no time.
    pub fn check_held(
        &self,
        start: &[Vec3<f64>],
        inputs: &Inputs<f64>,
    ) -> Result<Vec<bool>, ReferenceError> {
        let pinned = self.check(start, inputs)?;
        match fixing::find_loose(&self.problem, inputs, &pinned, &with_pins(start, inputs)) {
            Some(fixing::Loose { vertex, turns }) => Err(ReferenceError::Loose { vertex, turns }),
            None => Ok(pinned),
        }
    }

    fn minimise(
        &mut self,
        pinned: Vec<bool>,
        mut x: Vec<Vec3<f64>>,
        (inputs, touched): (&Inputs<f64>, &[Touched]),
        load: Load,
    ) -> Result<Solution, ReferenceError> {
        let mut analysis = self.analyse(pinned)?;
        let cost = self.check_memory(&analysis)?;
        let Analysis { pattern, factorization, .. } = &mut analysis;
        let contacts = Contacts::new(&self.problem.samples, &inputs.tools, touched);
        let objective = Objective { contacts, ..objective(&self.problem, inputs, load) };
        let solved = newton::minimise(
            &objective,
            pattern,
            factorization,
            (&self.tolerance, &self.goes_on),
            &mut x,
        );
        self.analysis = Some(analysis);
        let convergence = match solved {
            Ok(convergence) => convergence,
            Err(FactorError::TooLarge) => return Err(self.too_large(&cost)),
            Err(FactorError::Stopped) => return Err(ReferenceError::Stopped),
            Err(FactorError::Indefinite) => {
                return Err(ReferenceError::NotFinite { what: "curvature of the potential" });
            }
        };
        if !convergence.converged {
            let Convergence { steps, gradient, start_gradient, .. } = convergence;
            return Err(ReferenceError::NotConverged { steps, gradient, start_gradient });
        }
        Ok(Solution { positions: x, convergence })
    }

    /// What solving costs, where that is allowed.
    fn check_memory(&self, analysis: &Analysis) -> Result<Cost, ReferenceError> {
        let cost = analysis.factorization.cost(&analysis.pattern, &self.problem);
        if cost.bytes > self.memory { Err(self.too_large(&cost)) } else { Ok(cost) }
    }

    fn too_large(&self, cost: &Cost) -> ReferenceError {
        let (unknowns, bytes, limit) = (cost.unknowns, cost.bytes, self.memory);
        ReferenceError::TooLarge { unknowns, bytes, limit }
    }

    /// The analysis for a set of pins: the last one, where it is of the same.
    fn analyse(&mut self, pinned: Vec<bool>) -> Result<Analysis, ReferenceError> {
        if let Some(known) = self.analysis.take_if(|known| known.pinned == pinned) {
            return Ok(known);
        }
        let pattern = Pattern::new(&self.problem, &pinned);
        let unknowns = pattern.unknowns();
        let factorization = Factorization::new(&pattern).map_err(|_| ReferenceError::TooLarge {
            unknowns,
            bytes: u64::MAX,
            limit: self.memory,
        })?;
        Ok(Analysis { pinned, pattern, factorization })
    }

    fn check(&self, x: &[Vec3<f64>], inputs: &Inputs<f64>) -> Result<Vec<bool>, ReferenceError> {
        let expected = self.problem.vertex_count();
        if x.len() != expected {
            let (what, given) = ("list of positions", x.len());
            return Err(ReferenceError::Mismatch { what, given, expected });
        }
        let finite = [
            ("positions", x.iter().all(|x| x.is_finite())),
            ("gravity", inputs.gravity.is_finite()),
            ("pin targets", inputs.pins.iter().all(|pin| pin.target.is_finite())),
            ("tethers", inputs.tethers.iter().all(is_legal)),
            ("anchors", inputs.anchors.iter().all(|anchor| anchor.is_finite())),
            ("forces", inputs.forces.iter().all(|(_, force)| force.is_finite())),
        ];
        if let Some((what, _)) = finite.into_iter().find(|(_, finite)| !finite) {
            return Err(ReferenceError::NotFinite { what });
        }
        let (given, expected) = (inputs.anchors.len(), self.problem.rest_anchors.len());
        if given != 0 && given != expected {
            let what = "list of anchors";
            return Err(ReferenceError::Mismatch { what, given, expected });
        }
        self.check_tools(&inputs.tools)?;
        self.pinned(inputs)
    }

    fn pinned(&self, inputs: &Inputs<f64>) -> Result<Vec<bool>, ReferenceError> {
        let vertex_count = self.problem.vertex_count();
        let vertices = (inputs.pins.iter().map(|pin| ("pin", pin.vertex)))
            .chain(inputs.tethers.iter().map(|tether| ("tether", tether.vertex)))
            .chain(inputs.forces.iter().map(|&(vertex, _)| ("force", vertex)));
        for (what, vertex) in vertices {
            if vertex as usize >= vertex_count {
                return Err(ReferenceError::UnknownVertex { what, vertex, vertex_count });
            }
        }
        let mut pinned = vec![false; vertex_count];
        for pin in &inputs.pins {
            pinned[pin.vertex as usize] = true;
        }
        Ok(pinned)
    }
}

fn is_legal(tether: &Tether<f64>) -> bool {
    tether.target.is_finite() && tether.stiffness >= 0.0 && tether.stiffness.is_finite()
}

fn with_pins(x: &[Vec3<f64>], inputs: &Inputs<f64>) -> Vec<Vec3<f64>> {
    let mut x = x.to_vec();
    for pin in &inputs.pins {
        x[pin.vertex as usize] = pin.target;
    }
    x
}

fn objective<'a>(problem: &'a Problem, inputs: &'a Inputs<f64>, load: Load) -> Objective<'a> {
    let at_rest = inputs.anchors.is_empty();
    let anchors = if at_rest { &problem.rest_anchors } else { &inputs.anchors };
    let contacts = Contacts::new(&problem.samples, &inputs.tools, &[]);
    Objective { problem, anchors, tethers: &inputs.tethers, contacts, load }
}

/// Weight and external forces [N].
fn dead_loads(problem: &Problem, inputs: &Inputs<f64>) -> Vec<Vec3<f64>> {
    let mut loads: Vec<_> = problem.masses.iter().map(|&m| inputs.gravity * m).collect();
    for &(vertex, force) in &inputs.forces {
        loads[vertex as usize] += force;
    }
    loads
}
