//! Pairs of tissue and tissue without a step around them: for who measures what it costs to find and to evaluate them.

use super::cpu::threads::Workers;
use super::step::contacts::{ContactStep, OfVertices, Pairs, Places};
use super::step::groups::Groups;
use crate::contact::{Bond, Pair};
use crate::layout::Layout;
use crate::model::Model;
use crate::scalar::lanes::Point;
use crate::scalar::{Real, Vec3};
use crate::settings::SolverSettings;
use crate::state::{ContactState, State};

/// A sample of the skin and the triangle that it has met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundMeeting {
    /// The sample's number.
    pub sample: u32,
    /// The triangle's number.
    pub triangle: u32,
    /// Barycentric weights of its point.
    pub weights: [f64; 3],
    /// From the triangle to the sample, of length 1.
    pub normal: [f64; 3],
    /// The way there [m].
    pub away: [f64; 3],
    /// Stiffness of contact [N/m], by how much both face each other, and what distances are longer by [m].
    pub stiffness: f64,
    /// See above.
    pub shift: f64,
}

/// The pairs of contact among these, with vertices at `x` [m]; by samples.
pub(crate) fn told<S: Real>(layout: &Layout<S>, all: &[Pair], x: &[Point<S>]) -> Vec<FoundMeeting> {
    let Some(skin) = &layout.skin else { return Vec::new() };
    let contact = all.iter().filter_map(|pair| match pair.bond {
        Bond::Contact { foundation, shift, .. } => {
            Some((pair, foundation.area * foundation.stiffness, shift))
        }
        Bond::Tie { .. } => None,
    });
    let mut found: Vec<FoundMeeting> = contact
        .map(|(pair, stiffness, shift)| {
            let sample = &skin.samples[pair.sample as usize];
            let away = sample.place(x) - skin.place(pair.triangle, &pair.weights, x);
            FoundMeeting {
                sample: sample.number,
                triangle: pair.triangle,
                weights: pair.weights,
                normal: pair.normal.to_array(),
                away: away.to_array(),
                stiffness,
                shift,
            }
        })
        .collect();
    found.sort_unstable_by_key(|found| found.sample);
    found
}

/// What a step does with pairs, and nothing else.
pub struct Meetings<S> {
    layout: Layout<S>,
    pairs: Pairs,
    groups: Groups,
    of_vertices: OfVertices,
    /// Places [m] and velocities [m/s] of vertices, forces on their first copies.
    points: Vec<Point<S>>,
    velocities: Vec<Vec3<S>>,
    loads: Vec<Point<S>>,
    kept: ContactState,
}

impl<S: Real> Meetings<S> {
    /// Of a model whose tissue meets tissue; of another nothing meets.
    pub fn new(model: &Model<S>, settings: &SolverSettings) -> Self {
        let layout = Layout::new(model, &settings.of_solver());
        let ties = layout.skin.as_ref().map_or(0, |skin| skin.skin.ties.len());
        let none = Point::new(Vec3::ZERO, S::ZERO);
        Self {
            pairs: Pairs::new(&layout),
            groups: Groups::alone(layout.part_count()),
            of_vertices: OfVertices::new(&layout),
            points: vec![none; layout.vertex_count()],
            velocities: vec![Vec3::ZERO; layout.vertex_count()],
            loads: vec![none; layout.copy_offsets.last().map_or(0, |&count| count as usize)],
            kept: ContactState { torn: vec![false; ties], ..ContactState::default() },
            layout,
        }
    }

    /// The pairs that were found last.
    pub fn found(&self) -> Vec<FoundMeeting> {
        told(&self.layout, self.pairs.all(), &self.points)
    }

    /// What a step of `dt` [s] does with pairs: finds them at its start, takes their forces and curvature there once, and keeps what
    /// friction and the next step need. Returns their number and the sum of all forces' magnitudes [N].
    pub fn meet(&mut self, state: &State<S>, dt: f64) -> (usize, f64) {
        let Self { layout, pairs, groups, of_vertices, points, velocities, loads, kept } = self;
        let all = points.iter_mut().zip(velocities.iter_mut()).zip(&layout.numbering.order);
        for ((point, velocity), &user) in all {
            *point = Point::new(state.positions[user as usize], S::ZERO);
            *velocity = state.velocities[user as usize];
        }
        let step = ContactStep { layout, tools: &[], pins: &[], dt };
        let places = Places { layout, x: points };
        pairs.find(&step, (places, velocities), 0.0, kept, (&Workers::one(), groups));
        loads.fill(Point::new(Vec3::ZERO, S::ZERO));
        of_vertices.clear();
        pairs.load_vertices(places, dt, of_vertices, loads);
        pairs.end(places, &mut kept.pairs, &mut kept.torn);
        let forces = loads.iter().map(|load| load.vec3().cast::<f64>().length());
        (pairs.count(), forces.sum::<f64>() / (dt * dt))
    }
}
