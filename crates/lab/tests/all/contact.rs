//! Contact in the reference: its formulas beside the library's, its derivatives beside differences, forces in balance.

use viscera::contact::law::Foundation;
use viscera::contact::{ContactLaw, Felt, Friction, Moved, Shape, Side, Tool, Touch, Touching};
use viscera::material::{Material, MaterialModel};
use viscera::mesh::shapes::Block;
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::rigid::RigidTransform;
use viscera::scalar::{Mat3, Vec3, vec3};
use viscera::solver::Inputs;
use viscera_lab::contact_cases::Pressing;
use viscera_lab::load_cases::{GRAVITY, Random};
use viscera_reference::contact::{Clearance, Contacts, friction, pressure_law};
use viscera_reference::matrix::Pattern;
use viscera_reference::objective::{Load, Objective};
use viscera_reference::problem::Problem;
use viscera_reference::{Reference, ReferenceError, Touched};

const SHAPES: [Shape; 5] = [
    Shape::HalfSpace,
    Shape::Sphere { radius: 0.4 },
    Shape::Capsule { length: 0.6, radius: 0.2 },
    Shape::RoundedBox { half: vec3(0.3, 0.5, 0.7), radius: 0.1 },
    Shape::RoundedBox { half: vec3(0.3, 0.5, 0.2), radius: 0.0 },
];

fn soft(young: f64, poisson: f64) -> Material {
    Material::new(MaterialModel::StableNeoHookean, young, poisson, 1000.0).expect("a material")
}

#[test]
fn two_statements_of_the_law_agree() {
    let foundation = Foundation { area: 1.0, stiffness: 3e6, thickness: 1e-3 };
    for i in -50..150 {
        let d = 1e-5 * f64::from(i);
        let [energy, slope, second] = pressure_law(3e6, 1e-3, d);
        let theirs = foundation.squeeze(d);
        assert!((energy - theirs.energy).abs() <= 1e-14 * foundation.squeeze(-1e-3).energy, "{d}");
        assert!((slope + theirs.force).abs() <= 1e-14 * foundation.squeeze(-1e-3).force, "{d}");
        // At the two distances where it jumps either value is right.
        let jumps = i == 50 || i == 100;
        assert!(jumps || second == theirs.stiffness, "{d}: {second}, {theirs:?}");
    }
    let mut random = Random(5);
    for _ in 0..200 {
        let normal = unit(random.vector(1.0));
        let across = Mat3::IDENTITY - Mat3::outer(normal, normal);
        let slip = across * random.vector(1e-3);
        let law = Friction { anchor: Vec3::ZERO, stiffness: 50.0, limit: 0.03 };
        let (energy, gradient, second) = friction(50.0, 0.03, slip, across);
        let theirs = law.drag(slip);
        assert!((energy - theirs.energy).abs() < 1e-14 * energy.abs().max(1e-6));
        assert!((gradient + theirs.force).length() < 1e-14);
        // Theirs is a bound, ours the derivative itself.
        let along = unit(slip);
        assert!(along.dot(second * along) <= theirs.stiffness * (1.0 + 1e-12));
        assert!(normal.dot(second * normal).abs() < 1e-10);
    }
}

fn unit(x: Vec3<f64>) -> Vec3<f64> {
    x * (1.0 / x.length())
}

#[test]
fn two_statements_of_the_distances_agree_and_their_second_derivative_is_one() {
    let mut random = Random(1);
    let mut smooth = 0;
    for shape in SHAPES {
        for _ in 0..1000 {
            let x = random.vector(1.2);
            let ours = Clearance::of(&shape, x);
            let theirs = shape.distance(x);
            assert!((ours.value - theirs.value).abs() < 1e-14, "{shape:?} at {x:?}");
            assert!((ours.normal - theirs.normal).length() < 1e-12, "{shape:?} at {x:?}");
            let h = 1e-6;
            for axis in 0..3 {
                let mut step = Vec3::ZERO;
                step[axis] = h;
                let [a, b] = [x + step, x - step].map(|x| Clearance::of(&shape, x));
                // Where the nearest point jumps from part to part there is no second derivative.
                if (a.hessian - b.hessian).norm_squared() > 1e-6 {
                    continue;
                }
                smooth += 1;
                let rough = (a.normal - b.normal) * (0.5 / h);
                let error = (rough - ours.hessian.columns[axis]).length();
                assert!(error < 1e-6 * (1.0 + theirs.curvature.powi(3)), "{shape:?} at {x:?}");
            }
        }
    }
    assert!(smooth > 12000, "only {smooth}");
}

fn tools() -> Vec<Tool> {
    let law = ContactLaw { stiffness: 5.0, thickness: 2e-3, friction: 0.4 };
    let at = |x: f64, y: f64, z: f64, turn: Vec3<f64>| {
        RigidTransform::about(Vec3::ZERO, turn, vec3(x, y, z))
    };
    let sphere = Shape::Sphere { radius: 0.012 };
    let capsule = Shape::Capsule { length: 0.02, radius: 0.004 };
    let corner = Shape::RoundedBox { half: Vec3::splat(0.008), radius: 0.002 };
    let pose = |shape, pose| Tool { shape, pose, law, is_locked: false, held: None };
    vec![
        pose(sphere, at(0.015, 0.01, 0.029, Vec3::ZERO)),
        pose(capsule, at(0.02, 0.0, -0.002, vec3(2.2, 0.3, 0.1))),
        pose(corner, at(-0.007, 0.01, 0.012, vec3(0.3, 0.5, 0.2))),
        pose(Shape::HalfSpace, at(0.0, 0.0, 0.001, vec3(0.05, -0.04, 0.0))),
    ]
}

fn sampled_block(cells: [usize; 3], tissue: &Material, cuts: u32) -> Model<f64> {
    let size = Vec3::from_f64(cells.map(|c| 0.01 * c as f64));
    let mesh = Block { jitter: 0.3, seed: 2, ..Block::new(size, cells) }.mesh().expect("a block");
    let mut builder = ModelBuilder::new();
    builder.add_body(&mesh, tissue).expect("a body");
    builder.sample_surface(cuts);
    builder.build().expect("a model")
}

/// Every third sample that a tool presses on has been touched before, and slips by less or more than its limit.
fn some_touched(problem: &Problem, tools: &[Tool], x: &[Vec3<f64>]) -> Vec<Touched> {
    let mut random = Random(9);
    let felt = Contacts::new(&problem.samples, tools, &[]);
    let pressed: Vec<_> = felt.touched_after(x);
    let chosen = pressed.into_iter().enumerate().filter(|(number, _)| number % 3 == 0);
    chosen
        .map(|(number, touched)| Touched {
            anchor: touched.anchor + random.vector(2e-4),
            limit: if number % 2 == 0 { touched.limit } else { 1e-3 * touched.limit },
            ..touched
        })
        .collect()
}

#[test]
fn derivatives_with_tools_match_differences() {
    let model = sampled_block([3, 2, 2], &soft(1e4, 0.4), 1);
    let problem = Problem::linear(&model);
    let tools = tools();
    let mut random = Random(3);
    let x: Vec<_> = model.rest_positions.iter().map(|x| *x + random.vector(1e-3)).collect();
    let d: Vec<_> = x.iter().map(|_| random.vector(1.0)).collect();
    let at = |t: f64| x.iter().zip(&d).map(|(x, d)| *x + *d * t).collect::<Vec<_>>();
    let touched = some_touched(&problem, &tools, &x);
    assert!(touched.len() > 10, "only {}", touched.len());
    for touched in [&[][..], &touched] {
        let contacts = Contacts::new(&problem.samples, &tools, touched);
        let of_each = |tool: u32| contacts.felt(&x).filter(|felt| felt.tool == tool).count();
        assert!((0..4).all(|tool| of_each(tool) > 2), "every tool touches something");
        // Contact alone: tissue has its own test.
        let load = Load::Forces(Vec::new());
        let objective = Objective { problem: &problem, anchors: &[], tethers: &[], contacts, load };
        let [plain, with] = [Contacts::NONE, objective.contacts.clone()]
            .map(|contacts| Objective { contacts, ..objective.clone() });
        let energy = |t: f64| with.value(&at(t)).sum - plain.value(&at(t)).sum;
        let gradient = |t: f64| -> Vec<Vec3<f64>> {
            let (a, b) = (with.gradient(&at(t)), plain.gradient(&at(t)));
            a.into_iter().zip(b).map(|(a, b)| a - b).collect()
        };
        let product = |a: &[Vec3<f64>]| -> f64 { a.iter().zip(&d).map(|(a, d)| a.dot(*d)).sum() };
        // The law is quadratic piece by piece: few samples change the piece within so small a step.
        let t = 1e-8;
        let slope = (energy(t) - energy(-t)) / (2.0 * t);
        let exact = product(&gradient(0.0));
        println!("gradient {exact:.6e}, differences {slope:.6e}");
        assert!((slope / exact - 1.0).abs() < 1e-5);
        let pattern = Pattern::new(&problem, &vec![false; x.len()]);
        let [hessian, positive] = [false, true].map(|positive| {
            let image =
                |of: &Objective<'_>| of.hessian(&x, &pattern, positive).multiply(&pattern, &d);
            product(&image(&with)) - product(&image(&plain))
        });
        let rough = (product(&gradient(t)) - product(&gradient(-t))) / (2.0 * t);
        println!(
            "second derivative {hessian:.6e}, differences {rough:.6e}, positive {positive:.6e}"
        );
        assert!((rough / hessian - 1.0).abs() < 1e-5);
        assert!(positive > hessian, "the tool's own curvature is negative");
    }
}

/// What a step leaves of a sample is what the library keeps of it.
#[test]
fn anchors_move_as_the_librarys() {
    let model = sampled_block([3, 2, 2], &soft(1e4, 0.4), 1);
    let problem = Problem::linear(&model);
    let tools = tools();
    let mut random = Random(4);
    let x: Vec<_> = model.rest_positions.iter().map(|x| *x + random.vector(5e-4)).collect();
    let touched = some_touched(&problem, &tools, &x);
    let moved: Vec<_> = x.iter().map(|x| *x + random.vector(1e-5)).collect();
    let ours = Contacts::new(&problem.samples, &tools, &touched).touched_after(&moved);
    let mut slid = 0;
    for before in &touched {
        let (sample, tool) =
            (&problem.samples[before.sample as usize], &tools[before.tool as usize]);
        let foundation = Foundation {
            area: sample.area,
            stiffness: tool.law.stiffness * sample.stiffness,
            thickness: tool.law.thickness,
        };
        let kept = Touch {
            sample: before.sample,
            tool: before.tool,
            anchor: before.anchor,
            normal: before.normal,
            offset: before.offset,
            pressed: before.limit / tool.law.friction,
            force: Vec3::ZERO,
            place: sample.place(&x),
            is_tied: false,
        };
        let way = Moved { from: sample.place(&x), to: sample.place(&moved) };
        let (pose, numbered) = (&tool.pose, (before.tool, tool));
        let theirs = Touching::find((before.sample, foundation), numbered, pose, &way, Some(&kept))
            .expect("near");
        let Side::Plane { normal, offset } = theirs.side else { panic!("a plane: it is touched") };
        // Deep inside the library keeps the normal, which has been the tangent's.
        assert!((normal - before.normal).length() < 1e-9 && (offset - before.offset).abs() < 1e-9);
        let pressed = foundation.squeeze(normal.dot(pose.undo(way.to)) - offset).force;
        let felt = Felt {
            distance: 0.0,
            energy: 0.0,
            force: Vec3::ZERO,
            pressed,
            normal: pose.turn(normal),
            stiffness: 0.0,
            drag: 0.0,
            tie: 0.0,
            turning: 0.0,
        };
        let is_same = |after: &&Touched| (after.sample, after.tool) == (before.sample, before.tool);
        let after = ours.iter().find(is_same).expect("still touched");
        let theirs = theirs.keep(tool, way.to, &felt).expect("still touched");
        assert!((after.anchor - theirs.anchor).length() < 1e-12, "{after:?} {theirs:?}");
        assert!((after.limit - tool.law.friction * theirs.pressed).abs() < 1e-9 * after.limit);
        // Across the plane: along its normal the anchor goes with the sample.
        let way = after.anchor - before.anchor;
        slid += usize::from((way - normal * normal.dot(way)).length() > 1e-7);
    }
    assert!(slid > 2 && slid < touched.len() - 2, "{slid} of {} slide", touched.len());
}

#[test]
fn the_force_on_a_ball_is_what_the_bottom_bears() {
    for young in [1e4, 1e5] {
        let mut pressing =
            Pressing::on_block([6, 6, 3], 0.01, 0.015, soft(young, 0.45)).expect("a block");
        (pressing.depth, pressing.gravity) = (6e-3, GRAVITY);
        let truth = pressing.truth().expect("a state of rest");
        let model = pressing.model::<f64>().expect("a model");
        let reference = Reference::new(&model);
        let inputs = pressing.inputs(1.0);
        let held = reference.reactions(&truth.positions, &inputs).expect("reactions");
        let held = held.into_iter().fold(Vec3::ZERO, |sum, force| sum + force);
        let weight = GRAVITY * model.masses.iter().sum::<f64>();
        // Tissue: pins and weight act on it, and the ball's counterforce.
        let rest = held + weight - truth.wrench.force;
        let size = truth.wrench.force.length();
        println!("{young:e} Pa: {size:.4} N in {} steps, left {:.1e}", truth.effort, rest.length());
        assert!(size > 0.05 * young / 1e4 && rest.length() < 1e-9 * size);
        // In the middle of a symmetric block nothing turns the ball but the mesh's own lack of symmetry.
        assert!(truth.wrench.torque.length() < 0.02 * size * pressing.radius);
        assert!(truth.wrench.touches > 10 && truth.wrench.pinned == 0 && truth.wrench.depth > 0.0);
    }
}

/// A block that slides down a plane: after the first step friction holds it back by its coefficient.
#[test]
fn a_block_slides_with_the_acceleration_of_coulomb() {
    let (friction, angle) = (0.3, 0.5f64);
    let model = sampled_block([2, 2, 1], &soft(1e4, 0.3), 1);
    let mut reference = Reference::new(&model);
    let law = ContactLaw { friction, stiffness: 2.0, thickness: 1e-3 };
    let tool = Tool { law, ..Tool::new(Shape::HalfSpace) };
    let press = vec3(0.0, 0.0, -9.81 * angle.cos());
    let slope = unit(vec3(0.8, 0.6, 0.0));
    let mut inputs = Inputs { gravity: press, tools: vec![tool], ..Inputs::default() };
    let mut state = viscera::state::State::at_rest(&model);
    let mut touched = Vec::new();
    let mut speeds = Vec::new();
    let dt = 1.0 / 120.0;
    for step in 0..100 {
        if step == 40 {
            inputs.gravity = press + slope * (9.81 * angle.sin());
        }
        reference.step_touching(&mut state, &inputs, &touched, dt).expect("a step");
        touched = reference.touched_after(&state.positions, &inputs, &touched).expect("legal");
        let momentum = state.velocities.iter().zip(&model.masses).map(|(v, m)| v.dot(slope) * m);
        speeds.push(momentum.sum::<f64>() / model.masses.iter().sum::<f64>());
    }
    let measured = (speeds[99] - speeds[59]) / (40.0 * dt);
    let exact = 9.81 * (angle.sin() - friction * angle.cos());
    println!("{measured:.5} m/s^2, exact {exact:.5}");
    assert!(speeds[39].abs() < 1e-4, "it rests: {}", speeds[39]);
    assert!((measured / exact - 1.0).abs() < 0.005);
    // Side by side with it the tool's wrench: the block's weight across, Coulomb's share of it along.
    let wrench = reference.wrenches(&state.positions, &inputs, &[]).expect("legal")[0];
    let weight = model.masses.iter().sum::<f64>() * press.length();
    assert!((-wrench.force.z / weight - 1.0).abs() < 0.02, "{wrench:?}");
}

#[test]
fn bad_tools_are_refused() {
    let model = sampled_block([1, 1, 1], &soft(1e4, 0.3), 0);
    let rest = model.rest_positions.clone();
    let good = Tool::new(Shape::HalfSpace);
    let with = |tool: Tool| Inputs { tools: vec![good.clone(), tool], ..Inputs::default() };
    let refused =
        |inputs: &Inputs<f64>| Reference::new(&model).wrenches(&rest, inputs, &[]).map(|_| ());
    assert_eq!(refused(&with(good.clone())), Ok(()));
    let mut lost = good.clone();
    lost.pose.translation.x = f64::NAN;
    let not_finite = ReferenceError::NotFinite { what: "poses of tools" };
    assert_eq!(refused(&with(lost)), Err(not_finite));
    let mut squeezed = good.clone();
    squeezed.pose.rotation = Mat3::IDENTITY * 0.5;
    let thick = ContactLaw { thickness: 0.0, ..ContactLaw::default() };
    let bad =
        [squeezed, Tool::new(Shape::Sphere { radius: -1.0 }), Tool { law: thick, ..good.clone() }];
    for tool in bad {
        assert!(matches!(refused(&with(tool)), Err(ReferenceError::BadTool { tool: 1, .. })));
    }
    let touched = Touched {
        sample: 0,
        tool: 7,
        normal: vec3(0.0, 0.0, 1.0),
        offset: 0.0,
        anchor: Vec3::ZERO,
        limit: 1.0,
    };
    let wrenches =
        |touched| Reference::new(&model).wrenches(&rest, &with(good.clone()), &[touched]);
    let unknown = wrenches(touched).map(|_| ()).expect_err("no such tool");
    assert!(matches!(unknown, ReferenceError::UnknownTouch { tool: 7, tools: 2, .. }));
    let nan = Touched { tool: 0, limit: f64::NAN, ..touched };
    assert!(matches!(wrenches(nan), Err(ReferenceError::NotFinite { .. })));
    let mut builder = ModelBuilder::new();
    let mesh = Block::new(Vec3::splat(0.01), [1, 1, 1]).mesh().expect("a block");
    builder.add_body(&mesh, &soft(1e4, 0.3)).expect("a body");
    let bare = builder.build().expect("a model");
    let none = Reference::new(&bare).wrenches(&rest, &with(good.clone()), &[]).map(|_| ());
    assert_eq!(none, Err(ReferenceError::NoSamples));
}
