//! Instruments inside each other: nothing keeps them apart, so reports say so.

use crate::contact::{Shape, Tool};
use crate::scalar::{Vec3, vec3};
use crate::scene::Instrument;

/// An instrument that is inside another one.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Crossed {
    /// The other one's name.
    pub tool: String,
    /// How deep at least [m].
    pub depth: f64,
}

/// Points of a mesh that are looked at, at most.
const MOST_POINTS: usize = 512;

/// Points along a rod or an edge.
const ALONG: u32 = 9;

/// Of each tool, the other one that it is deepest inside, or that is inside it; `parts` are those of all, tool by
/// tool, of each so many as `count_of` says.
pub(super) fn crossings(
    tools: &[Instrument],
    parts: &[Tool],
    count_of: impl Fn(usize, &Instrument) -> usize,
) -> Vec<Option<Crossed>> {
    let mut first = 0;
    let of_tools: Vec<&[Tool]> = tools
        .iter()
        .enumerate()
        .map(|(index, tool)| {
            let range = first..first + count_of(index, tool);
            first = range.end;
            parts.get(range).unwrap_or_default()
        })
        .collect();
    let mut crossed: Vec<Option<Crossed>> = vec![None; tools.len()];
    for a in 0..tools.len() {
        for b in 0..a {
            let pairs = of_tools[a]
                .iter()
                .flat_map(|one| of_tools[b].iter().map(move |other| (one, other)));
            let depth = pairs.map(|(one, other)| depth(one, other)).fold(0.0, f64::max);
            for (own, other) in [(a, b), (b, a)] {
                if depth > crossed[own].as_ref().map_or(0.0, |known| known.depth) {
                    crossed[own] = Some(Crossed { tool: tools[other].name.clone(), depth });
                }
            }
        }
    }
    crossed
}

/// How deep one part is in another at least [m]; zero where that is not known.
fn depth(one: &Tool, other: &Tool) -> f64 {
    let apart = (one.pose.translation - other.pose.translation).length();
    if apart > one.shape.reach() + other.shape.reach() {
        return 0.0;
    }
    let into = |one: &Tool, other: &Tool| {
        let mut deepest = 0.0_f64;
        each_point(&one.shape, |x, radius| {
            let value = other.distance(one.pose.apply(x)).value;
            deepest = deepest.max(radius - value);
        });
        deepest
    };
    into(one, other).max(into(other, one))
}

/// Calls `act` with middles and radii of balls that are within a shape, or points on it.
fn each_point(shape: &Shape, mut act: impl FnMut(Vec3<f64>, f64)) {
    let share = |k: u32| f64::from(k) / f64::from(ALONG - 1);
    match *shape {
        // The other one looks at it.
        Shape::HalfSpace => {}
        Shape::Sphere { radius } => act(Vec3::ZERO, radius),
        Shape::Capsule { length, radius } => {
            // Closer together than its radius where it is short; along a shaft what passes by is seen from the other side.
            (0..ALONG * 8).for_each(|k| {
                act(vec3(0.0, 0.0, length * f64::from(k) / f64::from(ALONG * 8 - 1)), radius)
            });
        }
        Shape::RoundedBox { half, radius } => {
            let core = half - Vec3::splat(radius);
            for k in 0..ALONG * ALONG * ALONG {
                let at =
                    [k / ALONG / ALONG, k / ALONG % ALONG, k % ALONG].map(|k| 2.0 * share(k) - 1.0);
                act(core.scale(Vec3::from_f64(at)), radius);
            }
        }
        Shape::Mesh(ref grid) => {
            let vertices = &grid.surface().vertices;
            let step = vertices.len().div_ceil(MOST_POINTS).max(1);
            vertices.iter().step_by(step).for_each(|x| act(*x, 0.0));
        }
    }
}
