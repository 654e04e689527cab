//! Tools: where they are, what they meet, how they are drawn and which of them is under a pointer.

use viscera::contact::{Shape, Tool};
use viscera::scalar::rigid::RigidTransform;
use viscera::scalar::{Real, Vec3};
use viscera::scene::ToolKind;
use viscera::simulation::{Simulation, ToolForce};
use viscera::solver::gpu::Device;
use viscera_picture::{Arrow, Color, Facets};
use viscera_render::{BoundingSphere, Orbit, ToolMesh, ToolView};

use crate::hand::{HandId, ToolHands};
use crate::legend::{newtons_within, round_up};

/// A tool after a frame.
#[derive(Clone, Debug)]
pub struct ToolSnapshot {
    /// What it is.
    pub kind: ToolKind,
    /// From its own frame to the world: its working end is at the origin.
    pub pose: RigidTransform,
    /// Its parts, where they are.
    pub parts: Vec<Tool>,
    /// Its name, and what it meets.
    pub met: ToolForce,
    /// The opening angle of its jaws [rad], where it has some.
    pub jaw_angle: Option<f64>,
    /// Its number in the simulation.
    pub number: usize,
    /// The hand that has it.
    pub hand: Option<HandId>,
}

impl ToolSnapshot {
    /// Whether what it presses on is tied to it.
    pub fn is_locked(&self) -> bool {
        self.parts.iter().any(|part| part.is_locked)
    }

    /// The magnitude of the force [N].
    pub fn force(&self) -> f64 {
        Vec3::from_f64(self.met.force).length()
    }

    /// The magnitude of the torque about its origin [N m].
    pub fn torque(&self) -> f64 {
        Vec3::from_f64(self.met.torque).length()
    }

    /// The force with what it may be off by, as it is written everywhere.
    pub fn force_text(&self) -> String {
        if self.met.touches == 0 && self.force() == 0.0 {
            return "touches nothing".to_owned();
        }
        newtons_within(self.force(), self.met.error)
    }
}

/// All tools that are in a simulation's scene, as they are now.
pub(crate) fn tools_of<S: Real>(
    simulation: &Simulation<S>,
    hands: &ToolHands,
    tools: &mut Vec<ToolSnapshot>,
) {
    tools.clear();
    let mut parts = simulation.tool_parts().into_iter();
    let scene_tools = &simulation.assembly().tools;
    let all = scene_tools.iter().zip(simulation.tools()).zip(simulation.tool_forces());
    let there = all.enumerate().filter(|(_, ((_, state), _))| state.is_there);
    tools.extend(there.map(|(number, ((tool, state), met))| ToolSnapshot {
        kind: tool.kind,
        pose: state.pose,
        parts: parts.by_ref().take(tool.parts.len()).collect(),
        met,
        jaw_angle: state.jaw_angle,
        number,
        hand: hands.of(number),
    }));
}

/// The shapes of all parts of tools, on the device.
#[derive(Debug, Default)]
pub(crate) struct ToolSurfaces {
    meshes: Vec<(Shape, Option<ToolMesh>)>,
}

impl ToolSurfaces {
    /// Makes the triangles of shapes that are new. Of a half-space a square across from the scene, which is inside
    /// `around`.
    pub fn follow(
        &mut self,
        device: &Device,
        tools: &[ToolSnapshot],
        around: Option<BoundingSphere>,
    ) {
        let mut count = 0;
        for part in tools.iter().flat_map(|tool| &tool.parts) {
            if self.meshes.get(count).is_none_or(|(shape, _)| *shape != part.shape) {
                self.meshes.truncate(count);
                let facets = match (&part.shape, around) {
                    (Shape::HalfSpace, Some(BoundingSphere { center, radius })) => {
                        let middle = part.pose.undo(center);
                        Facets::patch(&RigidTransform::IDENTITY, middle, TABLE * radius)
                    }
                    (shape, _) => Facets::of(shape),
                };
                self.meshes.push((part.shape.clone(), ToolMesh::new(device, &facets)));
            }
            count += 1;
        }
        self.meshes.truncate(count);
    }

    /// What is drawn; the tool in hand in another shade.
    pub fn views<'a>(
        &'a self,
        tools: &'a [ToolSnapshot],
        in_hand: Option<HandId>,
    ) -> Vec<ToolView<'a>> {
        let parts = tools.iter().flat_map(|tool| {
            let is_in_hand = tool.hand.is_some() && tool.hand == in_hand;
            tool.parts.iter().map(move |part| (is_in_hand, part))
        });
        let drawn = parts.zip(&self.meshes).filter_map(|((is_in_hand, part), (shape, mesh))| {
            let is_table = *shape == Shape::HalfSpace;
            Some(ToolView {
                mesh: mesh.as_ref()?,
                pose: part.pose,
                color: if is_in_hand { Color::IN_HAND } else { Color::STEEL },
                see_through: if is_table { 0.0 } else { SEE_THROUGH },
                // A table is as large as the map: its edge would show.
                has_shadow: !is_table,
            })
        });
        drawn.collect()
    }
}

/// A table is so much larger than a software picture's: a window looks around.
const TABLE: f64 = 1.6;

/// How strongly tools shine through tissue before them: enough to lead a tip that is behind it.
const SEE_THROUGH: f32 = 0.22;

/// How long arrows of forces are: the largest force so far, rounded up, has a length of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceScale {
    /// [N].
    high: f64,
}

impl Default for ForceScale {
    fn default() -> Self {
        Self { high: Self::LEAST }
    }
}

impl ForceScale {
    /// Smaller forces than this would be drawn as if they were large [N].
    const LEAST: f64 = 0.2;
    /// The length of the largest as a share of the size of things.
    const LONGEST: f64 = 0.3;

    /// Follows the forces of a frame.
    pub fn follow(&mut self, tools: &[ToolSnapshot]) {
        for force in tools.iter().map(ToolSnapshot::force).filter(|force| force.is_finite()) {
            if force > self.high {
                self.high = f64::from(round_up(force as f32));
            }
        }
    }

    /// Length of an arrow per force [m/N], where things are so large [m].
    pub fn metres_per_newton(&self, extent: f64) -> f64 {
        Self::LONGEST * extent / self.high
    }
}

/// How far arrows are moved towards the viewer, as a share of the way, and shrunk alike: they look the same, and no tissue
/// hides them.
const IN_FRONT: f64 = 0.4;

/// The force of each tool on the tissue, from its working end.
pub fn force_arrows(tools: &[ToolSnapshot], orbit: &Orbit, scale: f64, radius: f64) -> Vec<Arrow> {
    let eye = orbit.position();
    let before = |x: Vec3<f64>| x + (eye - x) * IN_FRONT;
    let arrow = |tool: &ToolSnapshot| {
        let from = tool.pose.translation;
        let to = arrow_end(tool, scale);
        let is_seen = (to - from).length() > 3.0 * radius;
        is_seen.then(|| Arrow {
            from: before(from),
            to: before(to),
            radius: (1.0 - IN_FRONT) * radius,
            color: Color::PULLED,
        })
    };
    tools.iter().filter_map(arrow).collect()
}

/// Where the arrow of a tool's force on the tissue ends [m].
pub fn arrow_end(tool: &ToolSnapshot, metres_per_newton: f64) -> Vec3<f64> {
    tool.pose.translation - Vec3::from_f64(tool.met.force) * metres_per_newton
}

/// The tool that a ray meets first, and how far from where it begins [m]. `direction` has length 1. Half-spaces are
/// tables, which nobody takes.
pub fn pick_tool(
    tools: &[ToolSnapshot],
    from: Vec3<f64>,
    direction: Vec3<f64>,
) -> Option<(usize, f64)> {
    let mut nearest: Option<(usize, f64)> = None;
    for (number, tool) in tools.iter().enumerate() {
        for part in tool.parts.iter().filter(|part| part.shape != Shape::HalfSpace) {
            let Some(way) = meet(part, from, direction) else { continue };
            if nearest.is_none_or(|(_, least)| way < least) {
                nearest = Some((number, way));
            }
        }
    }
    nearest
}

/// Steps of the way along a ray; beyond, it grazes.
const MOST_STEPS: usize = 96;

/// Where a ray meets a part: each step is as long as nothing is in the way.
fn meet(part: &Tool, from: Vec3<f64>, direction: Vec3<f64>) -> Option<f64> {
    let near = 1e-3 * part.shape.thinnest().min(1.0);
    let mut way = 0.0;
    for _ in 0..MOST_STEPS {
        let distance = part.distance(from + direction * way).value;
        if !distance.is_finite() || way > FARTHEST {
            return None;
        }
        if distance < near {
            return Some(way);
        }
        way += distance;
    }
    None
}

/// Nothing is farther from the viewer [m].
const FARTHEST: f64 = 1e4;

#[cfg(test)]
mod tests {
    use super::*;
    use viscera::scalar::vec3;

    fn tool(place: Vec3<f64>, force: [f64; 3]) -> ToolSnapshot {
        let pose = RigidTransform::about(Vec3::ZERO, Vec3::ZERO, place);
        let ball = Tool { pose, ..Tool::new(Shape::Sphere { radius: 0.01 }) };
        ToolSnapshot {
            kind: ToolKind::Sphere,
            pose,
            parts: vec![ball],
            met: ToolForce {
                name: "ball".into(),
                force,
                torque: [0.0; 3],
                touches: 3,
                pinned: 0,
                left_out: 0,
                depth: 0.0,
                has_jumped: false,
                crossed: None,
                error: Some(0.02),
                torque_error: None,
            },
            jaw_angle: None,
            number: 0,
            hand: None,
        }
    }

    #[test]
    fn the_first_tool_under_a_pointer_is_found_and_tables_are_not() {
        let mut tools =
            vec![tool(vec3(0.0, 0.0, 0.2), [0.0; 3]), tool(vec3(0.0, 0.0, 0.1), [0.0; 3])];
        tools.push(ToolSnapshot {
            parts: vec![Tool::new(Shape::HalfSpace)],
            ..tool(Vec3::ZERO, [0.0; 3])
        });
        let down = vec3(0.0, 0.0, -1.0);
        let (number, way) = pick_tool(&tools, vec3(0.0, 0.0, 1.0), down).expect("a ball");
        assert_eq!(number, 0);
        assert!((way - 0.79).abs() < 1e-4, "{way} m");
        assert!(pick_tool(&tools, vec3(0.05, 0.0, 1.0), down).is_none());
        assert!(pick_tool(&tools, vec3(f64::NAN, 0.0, 1.0), down).is_none());
    }

    #[test]
    fn arrows_show_forces_on_tissue_and_the_largest_so_far_has_the_full_length() {
        let mut scale = ForceScale::default();
        let tools = [tool(Vec3::ZERO, [0.0, 0.0, 1.7]), tool(Vec3::ZERO, [f64::NAN; 3])];
        scale.follow(&tools);
        let length = scale.metres_per_newton(0.1);
        assert!((length - 0.03 / 2.0).abs() < 1e-9, "{length} m/N");
        assert!((arrow_end(&tools[0], length) - vec3(0.0, 0.0, -1.7 * length)).length() < 1e-12);
        // It does not shrink: a force that fades is seen to fade.
        scale.follow(&[tool(Vec3::ZERO, [0.1, 0.0, 0.0])]);
        assert_eq!(scale.metres_per_newton(0.1), length);
        let arrows = force_arrows(&tools, &Orbit::framing(&[]), length, 1e-4);
        assert_eq!(arrows.len(), 1);
        assert_eq!(tools[0].force_text(), "1.70 ± 0.02 N");
    }
}
