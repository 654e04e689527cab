//! How far a state is from rest, judged by the forces alone: one step of Newton's method, by conjugate gradients.
//!
//! ```text
//! V(x): elastic energy less the work of the loads,  r = -grad V(x),  K = grad grad V(x)
//! K d = r:  d is what is left of the way to the state of rest [m]
//! K p ~ (grad V(x + e p) - grad V(x))/e,   preconditioned by the diagonal of K at small strain
//! ```
//!
//! Neither the solver's residual nor its multipliers go into it, and the cause of the error does not matter: too few
//! sweeps, motion that has not ended, or a formulation that is not exact at rest. Unbalanced forces themselves say
//! little: small smooth ones stand for a long way, large rough ones for none. Conjugate gradients: Hestenes and
//! Stiefel, 1952; the sum of `alpha r.z` over some iterations is what they add to `d.K d` and bounds what was
//! missing before (Strakos and Tichy, "On error estimation in the conjugate gradient method", 2002, section 4).

mod linear;
mod unloaded;

pub use unloaded::{TooSoft, Unloaded};

use crate::elements::kinds::{Energy, Kind};
use crate::elements::{attachment, deformation_gradient, internal_forces, law, shape_gradients};
use crate::layout::{Domains, Smoothing};
use crate::material::{MaterialConstants, MaterialModel};
use crate::model::Model;
use crate::model::{ElementList, for_each_kind};
use crate::scalar::{Real, Vec3};
use crate::settings::Elements;
use crate::solver::Inputs;
use crate::solver::recovered::Recovered;

/// The difference quotient's step, as a share of the shortest distance over which strain changes by one: far
/// above the square root of round-off, far below where curvature changes.
const DIFFERENCE: f64 = 1e-6;

/// Conjugate gradients end where the last of their iterations add less than this share of `d.K d`.
const COMPLETE: f64 = 0.01;

/// Passes over single tetrahedra that an estimate takes at most: seconds.
const MOST_WORK: f64 = 1e7;

/// Iterations at most, and at least where the mesh is large.
const MOST_ITERATIONS: f64 = 1000.0;
const FEWEST_ITERATIONS: f64 = 50.0;

/// Positions are rounded by this many units of their precision, over a run.
const ROUNDED: f64 = 16.0;

/// The rest of the way to the state of rest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WayToRest {
    /// `d` [m], shape [vertex_count]; zero where a vertex is pinned, or its part is not held at all.
    pub way: Vec<Vec3<f64>>,
    /// The forces [N] at the place that `d` leads to by which what is pinned is held there, shape [vertex_count];
    /// zero elsewhere.
    pub holding: Vec<Vec3<f64>>,
    /// Largest `|d|` [m], less what rounding may have moved a vertex by.
    pub distance: f64,
    /// Largest displacement [m] from the rest shape at the place that `d` leads to.
    pub displacement: f64,
    /// Apparent stiffness minus one: the displacement at rest over what there is of it, along it. Above zero the
    /// tissue has given way too little.
    pub stiffness: f64,
    /// Largest excursion [m] of what moves, if all of it swings in the shape of its velocities `v`, with
    /// `omega^2 = v.K v/v.M v`: largest `|v|` over `omega`.
    pub excursion: f64,
    /// False where the iterations ended before all of the way was found: it is at least this long.
    pub complete: bool,
    /// False where forces push the tissue on rather than back along some way: it may be about to buckle.
    pub stable: bool,
}

impl WayToRest {
    /// Largest distance from rest over largest displacement; 0 where nothing is displaced.
    pub fn error(&self) -> f64 {
        if self.displacement > 0.0 { self.distance / self.displacement } else { 0.0 }
    }

    /// Measures a state at `x` [m] that moves with `velocities` [m/s], both of shape [vertex_count], under these
    /// inputs. Takes memory for ten vectors of that shape, and as long as some dozens to hundreds of passes over the
    /// mesh. Nothing where no part of the model is held.
    pub fn measure<S: Real>(
        model: &Model<S>,
        x: &[Vec3<S>],
        velocities: &[Vec3<f64>],
        inputs: &Inputs<S>,
        elements: Elements,
    ) -> Option<Self> {
        let x: Vec<Vec3<f64>> = x.iter().map(|x| x.cast()).collect();
        let statics = Statics::new(model, inputs, elements);
        if !statics.is_held {
            return None;
        }
        let found = statics.solve(&x);
        let excursion = statics.excursion(&x, velocities);
        Some(WayToRest { excursion, ..statics.judge(&x, found) })
    }
}

/// The result of conjugate gradients.
struct Found {
    way: Vec<Vec3<f64>>,
    complete: bool,
    stable: bool,
}

/// The static equations of a model under inputs.
struct Statics<'a, S> {
    model: &'a Model<S>,
    inputs: &'a Inputs<S>,
    /// Whether anything is.
    is_held: bool,
    /// Neither pinned nor part of a body that nothing holds.
    moves: Vec<bool>,
    /// Inverse of the diagonal of `K` at small strain [m/N].
    softness: Vec<f64>,
    /// The length [m] over which strain changes by one, the smallest of the mesh.
    shortest: f64,
    /// Where stable neo-Hookean tetrahedra are recovered-gradient tetrahedra.
    recovered: Option<(Domains<f64>, Vec<MaterialConstants<f64>>)>,
}

impl<'a, S: Real> Statics<'a, S> {
    fn new(model: &'a Model<S>, inputs: &'a Inputs<S>, elements: Elements) -> Self {
        let (stiffness, shortest) = diagonal(model, inputs);
        // A part that nothing holds has no state of rest: `K` has its rigid motions in the null space, and conjugate
        // gradients would run off along them. Pins come last: a pinned vertex holds its part, but does not move.
        let mut moves = held(model, inputs);
        let is_held = moves.contains(&true);
        for pin in &inputs.pins {
            moves[pin.vertex as usize] = false;
        }
        let softness = stiffness.iter().map(|&k| if k > 0.0 { 1.0 / k } else { 0.0 }).collect();
        let domains = (elements == Elements::Recovered)
            .then(|| Domains::cast_from(model, Smoothing::RECOVERED));
        let recovered = domains.map(|domains| (domains, materials_of(model)));
        Self { model, inputs, is_held, moves, softness, shortest, recovered }
    }

    /// `grad V` [N] of vertices that move, zero for others.
    fn gradient(&self, x: &[Vec3<f64>], gradient: &mut [Vec3<f64>]) {
        self.full_gradient(x, gradient);
        for (gradient, moves) in gradient.iter_mut().zip(&self.moves) {
            if !moves {
                *gradient = Vec3::ZERO;
            }
        }
    }

    /// `grad V` [N] of all vertices.
    fn full_gradient(&self, x: &[Vec3<f64>], gradient: &mut [Vec3<f64>]) {
        let Self { model, inputs, .. } = self;
        let gravity = inputs.gravity.cast::<f64>();
        for (load, mass) in gradient.iter_mut().zip(&model.masses) {
            *load = gravity * -mass.to_f64();
        }
        for &(v, force) in &inputs.forces {
            gradient[v as usize] -= force.cast::<f64>();
        }
        for tether in inputs.tethers.iter().filter(|tether| self.moves[tether.vertex as usize]) {
            let (v, target) = (tether.vertex as usize, tether.target.cast::<f64>());
            gradient[v] -= attachment::force(x[v], target, tether.stiffness.to_f64());
        }
        for_each_kind!(model, set => self.add_elements(set, x, gradient));
        self.add_tissue(x, gradient);
    }

    /// Of the elements of one kind.
    fn add_elements<K: Kind<N, M>, const N: usize, const M: usize>(
        &self,
        set: &ElementList<S, K, N, M>,
        x: &[Vec3<f64>],
        gradient: &mut [Vec3<f64>],
    ) {
        // At rest there is no rate of strain, so viscosity is left out.
        let anchors = self.inputs.anchors_of(&self.model.rest_anchors);
        for i in 0..set.len() {
            let vertices = set.vertices[i];
            let places = vertices.map(|v| x[v as usize]);
            for (v, force) in
                vertices.into_iter().zip(set.element::<f64>(i, anchors).forces(&places))
            {
                gradient[v as usize] -= force;
            }
        }
    }

    /// Of the tetrahedra.
    fn add_tissue(&self, x: &[Vec3<f64>], gradient: &mut [Vec3<f64>]) {
        if let Some((domains, materials)) = &self.recovered {
            let mut tets = Recovered::new(domains);
            tets.evaluate(domains, materials, x);
            tets.add_gradient(domains, materials, gradient);
        }
        let is_plain = |law| self.recovered.is_none() || law != MaterialModel::StableNeoHookean;
        for tet in self.model.tets().filter(|tet| is_plain(tet.law)) {
            let shape = tet.inverse_rest_shape.cast::<f64>();
            let volume = tet.rest_volume.to_f64();
            let material = &self.model.materials[tet.material as usize];
            let [lambda, mu] = [material.lame_lambda, material.lame_mu].map(Real::to_f64);
            let f = deformation_gradient(&tet.vertices.map(|v| x[v as usize]), &shape);
            let (_, piola) = law::respond(tet.law, &f, lambda, mu);
            let forces = internal_forces(&piola, &shape, volume);
            for (v, force) in tet.vertices.into_iter().zip(forces) {
                gradient[v as usize] -= force;
            }
        }
    }

    fn solve(&self, x: &[Vec3<f64>]) -> Found {
        let n = x.len();
        let mut at_x = vec![Vec3::ZERO; n];
        self.gradient(x, &mut at_x);
        // The iterates start at `d = 0`, where the residual is all of `-grad V`. It is updated from step to step;
        // computing it anew would be a second pass over the mesh in each iteration.
        let mut residual: Vec<Vec3<f64>> = at_x.iter().map(|&gradient| -gradient).collect();
        let mut way = vec![Vec3::ZERO; n];
        let [mut direction, mut image, mut moved] = [(); 3].map(|()| vec![Vec3::ZERO; n]);
        let tets = self.model.tet_count().max(1) as f64;
        let most = (MOST_WORK / tets).clamp(FEWEST_ITERATIONS, MOST_ITERATIONS) as usize;
        // A smooth error is seen once information has gone through the whole body, some cells an iteration.
        let delay = 10 + 2 * libm::cbrt(n as f64) as usize;
        let mut added = Vec::with_capacity(most);
        // `added[k]` is `alpha r.z` of iteration k [J]: by how much `d . K d` has grown. No product with the unknown
        // solution is needed.
        let (mut product, mut total) = (self.preconditioned(&residual), 0.0);
        let mut beta = 0.0;
        for _ in 0..most {
            // Zero: the equations are solved. NaN or infinite: the state itself is; the way found so far is returned.
            if !(product > 0.0 && product.is_finite()) {
                break;
            }
            for v in 0..n {
                direction[v] = residual[v] * self.softness[v] + direction[v] * beta;
            }
            self.times_stiffness(x, &at_x, &direction, &mut moved, &mut image);
            let curvature = dot(&direction, &image);
            // Forces drive the tissue on along `direction`: `K` is not positive definite, and a Newton step may lead
            // to a saddle. The way up to here descends, so it is kept, as a part of what is left.
            if curvature.is_nan() || curvature <= 0.0 {
                return Found { way, complete: false, stable: false };
            }
            let alpha = product / curvature;
            for v in 0..n {
                way[v] += direction[v] * alpha;
                residual[v] -= image[v] * alpha;
            }
            total += alpha * product;
            added.push(alpha * product);
            // What the last `delay` iterations added bounds from below what was missing before them. One small
            // addition proves nothing: the iteration stalls until information has reached the far end of a body.
            let last: f64 = added.iter().rev().take(delay).sum();
            if added.len() > delay && last < COMPLETE * total {
                return Found { way, complete: true, stable: true };
            }
            let next = self.preconditioned(&residual);
            beta = next / product;
            product = next;
        }
        Found { way, complete: added.len() < most, stable: true }
    }

    /// `r.z` with `z` the preconditioned `r`.
    fn preconditioned(&self, residual: &[Vec3<f64>]) -> f64 {
        residual.iter().zip(&self.softness).map(|(r, c)| r.length_squared() * c).sum()
    }

    /// `K p`.
    fn times_stiffness(
        &self,
        x: &[Vec3<f64>],
        at_x: &[Vec3<f64>],
        p: &[Vec3<f64>],
        moved: &mut [Vec3<f64>],
        image: &mut [Vec3<f64>],
    ) {
        // Scaled by the longest vector of `p`, so that strain changes by about `DIFFERENCE` at most: directions
        // shrink by orders of magnitude from the first iteration to the last.
        let step = DIFFERENCE * self.shortest / longest(p).max(f64::MIN_POSITIVE);
        for ((moved, x), p) in moved.iter_mut().zip(x).zip(p) {
            *moved = *x + *p * step;
        }
        self.gradient(moved, image);
        for (image, at_x) in image.iter_mut().zip(at_x) {
            *image = (*image - *at_x) * (1.0 / step);
        }
    }

    /// See [`WayToRest::excursion`].
    fn excursion(&self, x: &[Vec3<f64>], velocities: &[Vec3<f64>]) -> f64 {
        let moving = velocities.iter().zip(&self.moves);
        let v: Vec<_> = moving.map(|(&v, &moves)| if moves { v } else { Vec3::ZERO }).collect();
        let [mut at_x, mut moved, mut image] = [(); 3].map(|()| vec![Vec3::ZERO; x.len()]);
        self.gradient(x, &mut at_x);
        self.times_stiffness(x, &at_x, &v, &mut moved, &mut image);
        let masses = v.iter().zip(&self.model.masses);
        let inertia: f64 = masses.map(|(v, mass)| mass.to_f64() * v.length_squared()).sum();
        let curvature = dot(&v, &image);
        if curvature > 0.0 { longest(&v) * (inertia / curvature).sqrt() } else { 0.0 }
    }

    fn judge(&self, x: &[Vec3<f64>], found: Found) -> WayToRest {
        // A body that rests under gravity as it was given is displaced all the same.
        let rest = self.model.stress_free();
        let (mut displacement, mut reach) = (0.0f64, 0.0f64);
        let (mut square, mut along) = (0.0, 0.0);
        for ((x, rest), way) in x.iter().zip(rest).zip(&found.way) {
            let now = *x - rest.cast::<S>().cast();
            let end = now + *way;
            displacement = displacement.max(end.length());
            reach = reach.max(x.length());
            square += end.length_squared();
            along += end.dot(now);
        }
        // Relative to the distance from the origin, not to the displacement: positions are stored in absolute numbers.
        let rounding = ROUNDED * S::EPSILON * reach;
        let distance = (longest(&found.way) - rounding).max(0.0);
        // The least-squares factor between the displacement at rest `u*` and what there is of it: `u = u*/s` gives
        // `u*.u* / u*.u = s` exactly.
        let stiffness = if along > 0.0 && distance > 0.0 { square / along - 1.0 } else { 0.0 };
        let mut holding = vec![Vec3::ZERO; x.len()];
        let there: Vec<_> = x.iter().zip(&found.way).map(|(x, way)| *x + *way).collect();
        // At the end of the way, not at `x`: a holding force at `x` contains what is out of balance next to the pin.
        self.full_gradient(&there, &mut holding);
        for (holding, moves) in holding.iter_mut().zip(&self.moves) {
            if *moves {
                *holding = Vec3::ZERO;
            }
        }
        WayToRest {
            holding,
            distance,
            displacement: if displacement > rounding { displacement } else { 0.0 },
            stiffness,
            excursion: 0.0,
            complete: found.complete,
            stable: found.stable,
            way: found.way,
        }
    }
}

fn materials_of<S: Real>(model: &Model<S>) -> Vec<MaterialConstants<f64>> {
    model.materials.iter().map(MaterialConstants::cast).collect()
}

fn dot(a: &[Vec3<f64>], b: &[Vec3<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}

fn longest(all: &[Vec3<f64>]) -> f64 {
    all.iter().fold(0.0, |longest: f64, v| longest.max(v.length()))
}

/// The mean of the three diagonal entries of `K` at small strain, of each vertex [N/m], and the smallest height of
/// a tetrahedron [m].
fn diagonal<S: Real>(model: &Model<S>, inputs: &Inputs<S>) -> (Vec<f64>, f64) {
    let mut stiffness = vec![0.0; model.vertex_count()];
    let mut steepest = 0.0f64;
    for tet in model.tets() {
        let material = &model.materials[tet.material as usize];
        let [lambda, mu] = [material.lame_lambda, material.lame_mu].map(Real::to_f64);
        // `V ((lambda + mu) g g^T + mu |g|^2 I)`
        let of_slope = tet.rest_volume.to_f64() * ((lambda + mu) / 3.0 + mu);
        let gradients = shape_gradients(&tet.inverse_rest_shape.cast::<f64>());
        for (v, g) in tet.vertices.into_iter().zip(gradients) {
            stiffness[v as usize] += of_slope * g.length_squared();
            steepest = steepest.max(g.length());
        }
    }
    for_each_kind!(model, set => add_stiffness(set, model, &mut stiffness));
    for tether in &inputs.tethers {
        stiffness[tether.vertex as usize] += tether.stiffness.to_f64();
    }
    (stiffness, if steepest > 0.0 { 1.0 / steepest } else { 1.0 })
}

/// Adds to each vertex the mean curvature of the elements of one kind: a third of what all of their stiffness can be
/// where it lies along one line, all of it where an anchor holds in every direction.
fn add_stiffness<S: Real, K: Kind<N, M>, const N: usize, const M: usize>(
    set: &ElementList<S, K, N, M>,
    model: &Model<S>,
    stiffness: &mut [f64],
) {
    for (i, vertices) in set.vertices.iter().enumerate() {
        let curvature = set.element::<f64>(i, &model.rest_anchors).curvature();
        for &v in vertices {
            stiffness[v as usize] += if K::IS_ANCHORED { curvature } else { curvature / 3.0 };
        }
    }
}

/// Vertices of parts that a pin, an attachment or a tether holds: others have no state of rest, or any.
fn held<S: Real>(model: &Model<S>, inputs: &Inputs<S>) -> Vec<bool> {
    let mut parent: Vec<u32> = (0..model.vertex_count() as u32).collect();
    fn root(parent: &mut [u32], mut v: u32) -> u32 {
        while parent[v as usize] != v {
            parent[v as usize] = parent[parent[v as usize] as usize];
            v = parent[v as usize];
        }
        v
    }
    let mut join = |a: u32, b: u32| {
        let (a, b) = (root(&mut parent, a), root(&mut parent, b));
        parent[a.max(b) as usize] = a.min(b);
    };
    // In the caller's numbering, as all of this file. Pins join nothing: two bodies that a hand holds stay two parts.
    for tet in &*model.tet_vertices {
        tet[1..].iter().for_each(|&v| join(tet[0], v));
    }
    let mut anchored = Vec::new();
    for_each_kind!(model, set => {
        for all in &set.vertices {
            all.iter().for_each(|&v| join(all[0], v));
            anchored.extend((!set.anchors.is_empty()).then_some(all[0]));
        }
    });
    let holders = (inputs.pins.iter().map(|pin| pin.vertex))
        .chain(inputs.tethers.iter().map(|tether| tether.vertex))
        .chain(anchored);
    let mut is_held = vec![false; parent.len()];
    for v in holders {
        is_held[root(&mut parent, v) as usize] = true;
    }
    (0..parent.len() as u32).map(|v| is_held[root(&mut parent, v) as usize]).collect()
}
