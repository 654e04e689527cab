//! What a scene's patches are said to be held with: forces that sum to the weight, torques about the middle of a
//! patch, and who a vertex belongs to where patches overlap.

use viscera::scalar::{Vec3, vec3};
use viscera::scene::Scene;
use viscera::simulation::{Assembly, PatchForce, PatchKind, Simulation};

/// A bar away from the origin, its end held rigidly; `patches` act beside the wall.
fn bar(patches: &str) -> Simulation<f64> {
    let text = format!(
        r#"
[time]
velocity_factor = 0.7
[solver]
method = "quasi_newton"
precision = "f64"
substeps = 2
iterations = 20
[[body]]
name = "bar"
shape = "beam"
length = "60 mm"
width = "20 mm"
height = "20 mm"
cells_across = 2
position = ["0.3 m", "-0.2 m", "0.5 m"]
material = {{ young = "200 kPa", poisson = 0.4 }}
[[fixing]]
name = "wall"
body = "bar"
half_space = {{ point = ["0.3 m", 0, 0], normal = [-1, 0, 0] }}
{patches}"#
    );
    let scene = Scene::parse("bar.toml", &text, &[]).unwrap_or_else(|e| panic!("{e}"));
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned())).expect("an assembly");
    Simulation::new(scene, assembly).unwrap_or_else(|e| panic!("{e}"))
}

/// A second, in which seven tenths of all velocities are kept a frame: nothing swings, and the slowest way to rest
/// has 1e-6 of it left.
fn settle(simulation: &mut Simulation<f64>) -> Vec<PatchForce> {
    for _ in 0..60 {
        simulation.advance().unwrap_or_else(|e| panic!("{e}"));
    }
    simulation.measure().expect("measures");
    simulation.report().patches
}

fn force(patches: &[PatchForce], name: &str) -> Vec3<f64> {
    let patch = patches.iter().find(|patch| patch.name == name);
    Vec3::from_f64(patch.unwrap_or_else(|| panic!("no {name}")).force)
}

/// The middle of the patch of each force, in the order of a report [m].
fn middles(simulation: &Simulation<f64>) -> Vec<Vec3<f64>> {
    let Assembly { fixings, motions, forces, .. } = simulation.assembly();
    let patches = fixings.iter().chain(motions).chain(forces);
    let positions = &simulation.state().positions;
    let middle = |vertices: &[u32]| {
        let sum = vertices.iter().fold(Vec3::ZERO, |sum, &v| sum + positions[v as usize]);
        sum * (1.0 / vertices.len() as f64)
    };
    patches.map(|patch| middle(&patch.vertices)).collect()
}

/// All forces and all moments about the origin cancel those of the weight, and a hold says what its patch does.
fn check_balance(simulation: &Simulation<f64>, patches: &[PatchForce], what: &str) {
    let model = simulation.model();
    let positions = &simulation.state().positions;
    let gravity = simulation.scene().world.gravity;
    let (mut weight, mut moment) = (Vec3::ZERO, Vec3::ZERO);
    for (x, &mass) in positions.iter().zip(&model.masses) {
        weight += gravity * mass;
        moment += x.cross(gravity * mass);
    }
    let (mut sum, mut turning) = (weight, moment);
    for (patch, middle) in patches.iter().zip(middles(simulation)) {
        let [force, torque] = [patch.force, patch.torque].map(Vec3::from_f64);
        sum += force;
        turning += middle.cross(force) + torque;
    }
    let lever = 0.06;
    assert!(sum.length() < 1e-4 * weight.length(), "{what}: {sum:?} N of {weight:?} N left over");
    assert!(turning.length() < 1e-4 * lever * weight.length(), "{what}: {turning:?} N m left over");
    let motions = patches.iter().filter(|patch| patch.kind == PatchKind::Motion);
    for (index, patch) in motions.enumerate() {
        let hold = simulation.hold(index).map_or(Vec3::ZERO, |hold| hold.force);
        let apart = (hold - Vec3::from_f64(patch.force)).length();
        assert!(apart < 1e-12, "{what}: {} is {hold:?} N, not {:?} N", patch.name, patch.force);
    }
}

/// Moves the lower half of the wall by half a millimetre, or does so with springs.
const LOW: &str = r#"
[[motion]]
name = "tool"
body = "bar"
box = { min = ["0.29 m", "-1 m", "0.48 m"], max = ["0.325 m", "1 m", "0.501 m"] }
keys = [{ time = "0.2 s", translation = ["0.5 mm", 0, "-0.5 mm"] }]
"#;

/// Stands still where the whole wall is, and beyond.
const AROUND: &str = r#"
[[motion]]
name = "clamp"
body = "bar"
half_space = { point = ["0.311 m", 0, 0], normal = [-1, 0, 0] }
keys = [{ time = "0 s" }]
"#;

#[test]
fn forces_of_overlapping_patches_sum_to_the_weight() {
    let soft = LOW.replace("keys", "stiffness = \"90 N/m\"\nkeys");
    let pull = "[[force]]\nname = \"pull\"\nbody = \"bar\"\nforce = [\"0.1 N\", 0, \"0.05 N\"]\n\
        half_space = { point = [\"0.311 m\", 0, 0], normal = [-1, 0, 0] }\n";
    for (what, patches) in [
        ("one fixing", String::new()),
        ("a fixing and a motion", LOW.to_owned()),
        ("a fixing and a soft motion", soft.clone()),
        ("a fixing inside a standing motion", AROUND.to_owned()),
        ("two motions", format!("{LOW}{AROUND}")),
        ("a soft motion inside a standing one", format!("{soft}{AROUND}")),
        ("an elastic fixing under a motion", format!("{}{LOW}", elastic())),
        ("a force on a wall", format!("{LOW}{pull}")),
    ] {
        let mut simulation = bar(&patches);
        let patches = settle(&mut simulation);
        check_balance(&simulation, &patches, what);
        match what {
            // Every vertex of the wall is the motion's.
            "a fixing inside a standing motion" => assert_eq!(force(&patches, "wall"), Vec3::ZERO),
            // Springs do nothing at vertices that something rigid holds.
            "a soft motion inside a standing one" => {
                let outside = outside_pull(&simulation, 90.0);
                let apart = (force(&patches, "tool") - outside).length();
                assert!(apart < 1e-12 && outside.length() > 1e-3, "{apart:e} N of {outside:?} N");
            }
            _ => {}
        }
    }
}

fn elastic() -> &'static str {
    "[[fixing]]\nname = \"pad\"\nbody = \"bar\"\nstiffness = \"200 N/m\"\n\
     half_space = { point = [\"0.321 m\", 0, 0], normal = [-1, 0, 0] }\n"
}

/// The pull of the springs of the motion 0 [N] at those of its vertices that lie outside of every rigid patch, from
/// places alone.
fn outside_pull(simulation: &Simulation<f64>, stiffness: f64) -> Vec3<f64> {
    let Assembly { fixings, motions, .. } = simulation.assembly();
    let rest = &simulation.model().rest_positions;
    let positions = &simulation.state().positions;
    let vertices = &motions[0].vertices;
    let share = stiffness / vertices.len() as f64;
    let is_pinned = |v: &&u32| fixings[0].vertices.contains(v) || motions[1].vertices.contains(v);
    let outside = vertices.iter().filter(|v| !is_pinned(v));
    outside.fold(Vec3::ZERO, |sum, &v| {
        let target = rest[v as usize] + vec3(0.5e-3, 0.0, -0.5e-3);
        sum + (target - positions[v as usize]) * share
    })
}

#[test]
fn a_released_motion_gives_its_vertices_back_to_the_fixing() {
    let released = AROUND.replace("keys", "release = \"0.5 s\"\nkeys");
    let mut simulation = bar(&released);
    // At the moment of its release it holds no longer.
    for _ in 0..30 {
        simulation.advance_frame().unwrap_or_else(|e| panic!("{e}"));
    }
    assert!(simulation.time() == 0.5 && simulation.hold(0).is_none());
    let wall = simulation.assembly().fixings[0].vertices.len();
    let pins = |time: f64| simulation.inputs_at(time).pins.len();
    let patch = simulation.assembly().motions[0].vertices.len();
    assert_eq!([pins(0.499), pins(0.5)], [wall + patch, wall]);
    let at_release = simulation.report().patches;
    assert_eq!(force(&at_release, "clamp"), Vec3::ZERO);
    let patches = settle(&mut simulation);
    check_balance(&simulation, &patches, "released");
    assert_eq!(force(&patches, "clamp"), Vec3::ZERO);
    assert!(force(&patches, "wall").z > 0.0);
}

/// `x x F` about the middle of the patch, of a patch far from the origin: a pair of forces turns by itself, a
/// single one by its lever.
#[test]
fn the_torque_of_a_patch_is_about_its_middle() {
    let simulation = bar("");
    let positions = &simulation.state().positions;
    let wall = &simulation.assembly().fixings[0].vertices;
    let middle = middles(&simulation)[0];
    let corner = vec3(0.3, -0.21, 0.49);
    let at = |x: Vec3<f64>| {
        let place = wall.iter().position(|&v| (positions[v as usize] - x).length() < 1e-9);
        wall[place.unwrap_or_else(|| panic!("no vertex at {x:?}"))] as usize
    };
    assert!((middle - vec3(0.3, -0.2, 0.5)).length() < 1e-9, "{middle:?}");
    let [low, high] = [at(corner), at(corner + vec3(0.0, 0.02, 0.02))];
    let turned = |forces: &[(usize, Vec3<f64>)]| {
        let mut holding = vec![Vec3::ZERO; positions.len()];
        forces.iter().for_each(|&(v, force)| holding[v] += force);
        let patches = simulation.patch_forces_at(0.0, positions, &holding);
        (Vec3::from_f64(patches[0].force), Vec3::from_f64(patches[0].torque))
    };
    // One newton up at 10 mm in front of the middle, one down at 10 mm behind it.
    let up = vec3(0.0, 0.0, 1.0);
    let (sum, couple) = turned(&[(low, up), (high, -up)]);
    assert!(
        sum.length() < 1e-15 && (couple - vec3(-0.02, 0.0, 0.0)).length() < 1e-15,
        "{couple:?}"
    );
    // Two newtons along x, 10 mm in front of and below the middle.
    let (sum, lever) = turned(&[(low, vec3(2.0, 0.0, 0.0))]);
    assert!((sum - vec3(2.0, 0.0, 0.0)).length() < 1e-15);
    assert!((lever - vec3(0.0, -0.02, 0.02)).length() < 1e-15, "{lever:?}");
}
