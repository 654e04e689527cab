//! The shape without load of a body that is known under load: a scanned organ hangs in gravity already.
//!
//! ```text
//! r(X) = -grad V(x; X)          forces [N] at the known places x, of tetrahedra that carry no stress at X
//! r(X) = 0  for X
//! K d = r,  X <- X - f d,  f = dX/dx     K the stiffness of the known shape at small strain, f averaged at vertices
//! ```
//!
//! `d` is about how far from `x` the body would rest: what is at `x + d` then is wanted at `x`, so that the new shape is
//! `X(x - d)`. Without `f` the step would stretch what the body turns. The equations of the inverse problem: Govindjee
//! and Mihalic, "Computational methods for inverse finite elastostatics", 1996. The iteration is that of Sellier, "An
//! iterative method for the inverse elasto-static problem", 2011, with one linear solution in the place of each nonlinear
//! one. Steps are combined as Anderson does ("Iterative procedures for nonlinear integral equations", 1965), and are
//! accepted where `d` gets shorter: `|r|` grows at first wherever a body turns (Deuflhard, "Newton Methods for Nonlinear
//! Problems", 2011, section 3.2).

use std::sync::Arc;

use super::linear::Stiffness;
use super::{Found, Statics, dot, longest, materials_of};
use crate::elements::edge_matrix;
use crate::layout::{Domains, Smoothing};
use crate::mesh::tet_volume;
use crate::mesh::topology::BoundingBox;
use crate::model::Model;
use crate::scalar::{Mat3, Vec3, vec3};
use crate::settings::Elements;
use crate::solver::Inputs;

/// Forces out of balance over loads at which the shape is found: what single precision can still see.
const BALANCED: f64 = 1e-6;

/// Rounds of one load at most. A liver takes eight.
const MOST_ROUNDS: usize = 60;

/// So many former steps are combined.
const DEPTH: usize = 6;

/// In so many rounds what is missing falls to a share at least, or it never will.
const PATIENCE: usize = 8;
const PROGRESS: f64 = 0.3;

/// Tetrahedra keep this share of their volume at least, or the step is shortened: behind zero there is no way back.
const KEPT: f64 = 0.2;

/// A load that cannot be carried is given up once the share that can is known to this, or is below the second number.
const FINEST: f64 = 0.1;
const LEAST: f64 = 1e-3;

/// Residuals of linear solutions, as a share of the first ones: far from balance, and near it.
const SOLVED: f64 = 1e-3;
const LEAST_SOLVED: f64 = 1e-6;

/// Vertices times iterations of linear solves at most: some seconds. A liver of 10,000 tetrahedra takes a tenth of them.
const MOST_WORK: usize = 120_000_000;

/// A direction along no axis: a push that tells whether a body stands or falls.
const ASIDE: Vec3<f64> = vec3(0.17, 0.23, 0.11);

/// A shape that becomes the known one under load.
#[derive(Clone, Debug, PartialEq)]
pub struct Unloaded {
    /// Its places [m], shape [vertex_count]; those of vertices that are held, and of parts that nothing holds, are the
    /// known ones.
    pub positions: Vec<Vec3<f64>>,
    /// Forces [N] by which pinned vertices are held in the known shape, shape [vertex_count]; zero elsewhere.
    pub holding: Vec<Vec3<f64>>,
    /// Root mean square of the forces that are left over that of the loads.
    pub unbalanced: f64,
    /// Largest distance [m] between a vertex's places with load and without.
    pub sag: f64,
}

/// No shape without load becomes the known one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TooSoft {
    /// A share of gravity that can be carried, with some room; zero where none was found. Stiffness counts as weight does: a body that is as many
    /// times stiffer can carry all of it.
    pub share: f64,
}

impl Unloaded {
    /// Finds it: `model` has the known shape as its rest positions, and is held by the pins of `inputs`; gravity and forces
    /// of `inputs` are the load. Without pins forces carry the weight, and the shape may be anywhere. Takes as long as some
    /// hundreds of passes over the mesh.
    pub fn find(
        model: &Model<f64>,
        inputs: &Inputs<f64>,
        elements: Elements,
    ) -> Result<Self, TooSoft> {
        let mut search = Search::new(model, inputs, elements);
        let mut at = search.known.clone();
        let (mut carried, mut step) = (0.0f64, search.first_share());
        let mut unbalanced = 0.0;
        while carried < 1.0 {
            let share = (carried + step).min(1.0);
            match search.carry(share, &at) {
                Some((positions, left)) => (carried, at, unbalanced) = (share, positions, left),
                None if step > FINEST * carried.max(LEAST) && search.work < MOST_WORK => {
                    step *= 0.5
                }
                None => return Err(TooSoft { share: carried * (1.0 - FINEST) }),
            }
        }
        let mut sag: Vec<_> = at.iter().zip(&search.known).map(|(a, b)| *a - *b).collect();
        if inputs.pins.is_empty() {
            // Where it is, nobody asks.
            let mean = sag.iter().fold(Vec3::ZERO, |sum, x| sum + *x) * (1.0 / sag.len() as f64);
            sag.iter_mut().for_each(|x| *x -= mean);
        }
        let sag = longest(&sag);
        let holding = search.holding(&at);
        Ok(Self { positions: at, holding, unbalanced, sag })
    }
}

/// The equations, and memory for them.
struct Search {
    /// Its stress-free positions are those of the last trial.
    model: Model<f64>,
    /// With a share of the loads.
    inputs: Inputs<f64>,
    loads: Inputs<f64>,
    /// Of the known shape, where tetrahedra are recovered-gradient ones.
    domains: Option<Domains<f64>>,
    moves: Vec<bool>,
    known: Vec<Vec3<f64>>,
    /// Inverses of the edges' matrices [1/m], and volumes [m^3], of the known shape.
    shapes: Vec<(Mat3<f64>, f64)>,
    stiffness: Stiffness,
    /// See [`MOST_WORK`].
    work: usize,
}

/// What is left at a trial.
struct Left {
    /// `-f d` [m].
    step: Vec<Vec3<f64>>,
    /// `|d|^2` [m^2].
    size: f64,
    /// See [`Unloaded::unbalanced`].
    unbalanced: f64,
}

impl Search {
    fn new(model: &Model<f64>, inputs: &Inputs<f64>, elements: Elements) -> Self {
        let known = model.rest_positions.clone();
        let shape = |tet: &[u32; 4]| {
            let corners = tet.map(|v| known[v as usize]);
            (edge_matrix(&corners).inverse(), tet_volume(corners))
        };
        let moves = match inputs.pins.is_empty() {
            true => vec![true; known.len()],
            false => Statics::new(model, inputs, Elements::Plain).moves,
        };
        Self {
            shapes: model.tet_vertices.iter().map(shape).collect(),
            stiffness: Stiffness::new(model, &moves),
            model: model.clone(),
            inputs: inputs.clone(),
            loads: inputs.clone(),
            domains: (elements == Elements::Recovered)
                .then(|| Domains::new(model, Smoothing::RECOVERED)),
            moves,
            known,
            work: 0,
        }
    }

    /// All of the load, or where small strain would have it sag by more than the body is long, a share of it that does not.
    fn first_share(&mut self) -> f64 {
        let known = self.known.clone();
        let sag = self.left_at(&known).map_or(f64::INFINITY, |left| longest(&left.step));
        let size = BoundingBox::around(&known).size();
        (size.length() / sag).clamp(LEAST, 1.0)
    }

    /// The shape that carries a share of gravity, from that of another share, and what is left out of balance.
    fn carry(&mut self, share: f64, from: &[Vec3<f64>]) -> Option<(Vec<Vec3<f64>>, f64)> {
        self.inputs.gravity = self.loads.gravity * share;
        let forces = self.loads.forces.iter().map(|&(v, force)| (v, force * share));
        self.inputs.forces = forces.collect();
        let mut at = from.to_vec();
        let mut left = self.left_at(&at)?;
        let mut past = Past::default();
        let mut shortened = 1.0;
        let mut sizes = Vec::new();
        for round in 0..MOST_ROUNDS {
            sizes.push(left.size.sqrt());
            let is_slow = round >= PATIENCE && sizes[round] > PROGRESS * sizes[round - PATIENCE];
            if is_slow || self.work > MOST_WORK {
                return None;
            }
            if left.unbalanced < BALANCED {
                return self.is_stable().then_some((at, left.unbalanced));
            }
            let combined = past.combine(&at, &left.step);
            let next = self.kept(&at, &combined, shortened);
            let there = self
                .left_at(&next)
                .filter(|there| there.size < left.size || there.unbalanced < left.unbalanced);
            if let Some(there) = there {
                past.push(&at, &left.step, &next, &there.step);
                (at, left, shortened) = (next, there, 1.0);
            } else if past.is_empty() {
                // A step along `-f d` alone, which descends at first.
                shortened *= 0.5;
                if shortened < 0.05 {
                    return None;
                }
            } else {
                past = Past::default();
            }
        }
        None
    }

    /// The step taken from `at` as far as all tetrahedra stay tetrahedra.
    fn kept(&self, at: &[Vec3<f64>], step: &[Vec3<f64>], most: f64) -> Vec<Vec3<f64>> {
        let mut length = most;
        loop {
            let next: Vec<_> = at.iter().zip(step).map(|(x, step)| *x + *step * length).collect();
            let volume = |tet: &[u32; 4]| tet_volume(tet.map(|v| next[v as usize]));
            let mut pairs = self.model.tet_vertices.iter().zip(&self.shapes);
            if pairs.all(|(tet, (_, known))| volume(tet) > KEPT * known) || length < 1e-3 {
                return next;
            }
            length *= 0.5;
        }
    }

    /// Nothing where it is no number: a tetrahedron has no volume.
    fn left_at(&mut self, at: &[Vec3<f64>]) -> Option<Left> {
        self.model.stress_free = Arc::new(at.to_vec());
        let statics = self.statics();
        let mut residual = vec![Vec3::ZERO; at.len()];
        statics.gradient(&self.known, &mut residual);
        residual.iter_mut().for_each(|r| *r = -*r);
        let loads = statics.moves.iter().zip(&self.model.masses);
        let loads = loads.filter(|(moves, _)| **moves).map(|(_, mass)| mass * mass).sum::<f64>();
        let load = loads.sqrt() * self.inputs.gravity.length();
        let unbalanced = dot(&residual, &residual).sqrt() / load;
        // What is far from balance needs no digits.
        let solved = (SOLVED * unbalanced).clamp(LEAST_SOLVED, SOLVED);
        let (way, iterations) = self.stiffness.solve(&residual, solved);
        self.work += iterations * at.len();
        let step = self.mapped(at, &way);
        let size = dot(&way, &way);
        let is_number = size.is_finite() && unbalanced.is_finite() && longest(&step).is_finite();
        is_number.then_some(Left { step, size, unbalanced })
    }

    /// `-f d`.
    fn mapped(&self, at: &[Vec3<f64>], way: &[Vec3<f64>]) -> Vec<Vec3<f64>> {
        let mut sums = vec![(Mat3::ZERO, 0.0); at.len()];
        for (tet, (inverse, volume)) in self.model.tet_vertices.iter().zip(&self.shapes) {
            let slope = edge_matrix(&tet.map(|v| at[v as usize])) * *inverse;
            for &v in tet {
                let (sum, whole) = &mut sums[v as usize];
                *sum = *sum + slope * *volume;
                *whole += volume;
            }
        }
        let step = |((sum, whole), way): (&(Mat3<f64>, f64), &Vec3<f64>)| match *whole > 0.0 {
            true => *sum * *way * (-1.0 / whole),
            false => -*way,
        };
        sums.iter().zip(way).map(step).collect()
    }

    fn statics(&self) -> Statics<'_, f64> {
        self.statics_with(&self.inputs)
    }

    fn statics_with<'a>(&'a self, inputs: &'a Inputs<f64>) -> Statics<'a, f64> {
        let places = self.model.stress_free();
        let domains = self.domains.clone().map(|domains| domains.with_stress_free(places));
        let recovered = domains.map(|domains| (domains, materials_of(&self.model)));
        let statics = Statics::new(&self.model, inputs, Elements::Plain);
        Statics { moves: self.moves.clone(), recovered, ..statics }
    }

    /// Whether the body stays where it was found to rest: no way leads down from there. Where forces carry it, that
    /// depends on what they come from.
    fn is_stable(&self) -> bool {
        if self.loads.pins.is_empty() {
            return true;
        }
        // What is in balance has no forces to look along: a push aside looks along all ways in which it could give way.
        let mut pushed = self.inputs.clone();
        pushed.gravity += ASIDE * pushed.gravity.length();
        let Found { stable, .. } = self.statics_with(&pushed).solve(&self.known);
        stable
    }

    fn holding(&mut self, at: &[Vec3<f64>]) -> Vec<Vec3<f64>> {
        self.model.stress_free = Arc::new(at.to_vec());
        let statics = self.statics();
        let mut holding = vec![Vec3::ZERO; at.len()];
        statics.full_gradient(&self.known, &mut holding);
        let is_pinned = self.inputs.pins.iter().map(|pin| pin.vertex as usize);
        let mut all = vec![Vec3::ZERO; at.len()];
        is_pinned.for_each(|v| all[v] = holding[v]);
        all
    }
}

/// Former steps: by how much places differed, and by how much the steps did there.
#[derive(Default)]
struct Past {
    moved: Vec<Vec<Vec3<f64>>>,
    changed: Vec<Vec<Vec3<f64>>>,
}

impl Past {
    fn is_empty(&self) -> bool {
        self.moved.is_empty()
    }

    fn push(
        &mut self,
        at: &[Vec3<f64>],
        step: &[Vec3<f64>],
        next: &[Vec3<f64>],
        there: &[Vec3<f64>],
    ) {
        if self.moved.len() == DEPTH {
            self.moved.remove(0);
            self.changed.remove(0);
        }
        self.moved.push(next.iter().zip(at).map(|(a, b)| *a - *b).collect());
        self.changed.push(there.iter().zip(step).map(|(a, b)| *a - *b).collect());
    }

    /// `f - (dX + dF) gamma` with `gamma` that makes `|f - dF gamma|` least: Gram and Schmidt, newest first.
    fn combine(&self, at: &[Vec3<f64>], step: &[Vec3<f64>]) -> Vec<Vec3<f64>> {
        let mut basis: Vec<[Vec<Vec3<f64>>; 2]> = Vec::new();
        let (mut left, mut combined) = (step.to_vec(), vec![Vec3::ZERO; at.len()]);
        for (moved, changed) in self.moved.iter().zip(&self.changed).rev() {
            let (mut moved, mut changed) = (moved.clone(), changed.clone());
            let whole = dot(&changed, &changed);
            for [other_moved, other] in &basis {
                let along = dot(&changed, other);
                add(&mut changed, other, -along);
                add(&mut moved, other_moved, -along);
            }
            let square = dot(&changed, &changed);
            // What lies in the span of the others says nothing new.
            if square.is_nan() || square <= 1e-12 * whole {
                continue;
            }
            let scale = 1.0 / square.sqrt();
            changed.iter_mut().chain(&mut moved).for_each(|v| *v = *v * scale);
            let along = dot(&left, &changed);
            add(&mut left, &changed, -along);
            add(&mut combined, &moved, -along);
            basis.push([moved, changed]);
        }
        add(&mut combined, &left, 1.0);
        combined
    }
}

/// `a + b factor`.
fn add(a: &mut [Vec3<f64>], b: &[Vec3<f64>], factor: f64) {
    a.iter_mut().zip(b).for_each(|(a, b)| *a += *b * factor);
}
