//! The reference against closed forms and against differences of its own potential.

use crate::common::{body, build};
use viscera::elements::green_strain;
use viscera::material::{Material, MaterialModel};
use viscera::mesh::TetMesh;
use viscera::mesh::shapes::Block;
use viscera::mesh::topology::boundary_surface;
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::{Mat3, Vec3, vec3};
use viscera::solver::{Inputs, Pin, Tether};
use viscera::state::State;
use viscera_lab::load_cases::Random;
use viscera_reference::contact::Contacts;
use viscera_reference::matrix::Pattern;
use viscera_reference::objective::{Load, Objective, creep_at};
use viscera_reference::problem::Problem;
use viscera_reference::{Reference, ReferenceError};

const STVK: MaterialModel = MaterialModel::SaintVenantKirchhoff;
const SNH: MaterialModel = MaterialModel::StableNeoHookean;

const GRAVITY: Vec3<f64> = vec3(0.0, 0.0, -9.81);

fn block(cells: [usize; 3]) -> TetMesh {
    let size = Vec3::from_f64(cells.map(|c| 0.01 * c as f64));
    let block = Block { jitter: 0.5, seed: 1, ..Block::new(size, cells) };
    block.mesh().expect("a legal block")
}

fn material(model: MaterialModel, young: f64, poisson: f64) -> Material {
    Material::new(model, young, poisson, 1000.0).expect("a legal material")
}

fn norm(values: &[Vec3<f64>]) -> f64 {
    values.iter().map(|v| v.length_squared()).sum::<f64>().sqrt()
}

fn distance(a: &[Vec3<f64>], b: &[Vec3<f64>]) -> f64 {
    norm(&a.iter().zip(b).map(|(a, b)| *a - *b).collect::<Vec<_>>())
}

/// Everything that the potential knows: both materials, viscosity, springs, attachments.
fn everything() -> Model<f64> {
    let mut builder = ModelBuilder::new();
    for model in [STVK, SNH] {
        let tissue = material(model, 1e4, 0.45).with_viscosity(0.02).expect("legal");
        builder.add_body(&block([2, 1, 1]), &tissue).expect("a body");
    }
    builder.add_spring([0, 13], 40.0, Some(0.03)).expect("a spring");
    builder.add_spring([2, 15], 40.0, Some(0.0)).expect("a spring");
    builder.add_attachment(3, vec3(0.0, 0.1, 0.0), 30.0).expect("an attachment");
    build(&builder)
}

#[test]
fn gradient_and_hessian_match_differences() {
    let model = everything();
    let problem = Problem::linear(&model);
    let mut random = Random(3);
    let mut shake = |x: &Vec3<f64>, size: f64| *x + random.vector(size);
    let start: Vec<_> = model.rest_positions.iter().map(|x| shake(x, 1e-3)).collect();
    let x: Vec<_> = start.iter().map(|x| shake(x, 2e-3)).collect();
    let d: Vec<_> = start.iter().map(|_| shake(&Vec3::ZERO, 1e-3)).collect();
    let dt = 0.01;
    let creep = creep_at(&problem, &start, dt);
    assert!(creep.iter().all(Option::is_some), "all tissue here is viscous");
    let start_shapes = problem.recovered.start(&start, dt);
    let step = Load::Inertia { dt, predicted: start, creep, start: start_shapes };
    let statics = Load::Forces(problem.masses.iter().map(|&m| GRAVITY * m).collect());
    for (name, load) in [("step", step), ("statics", statics)] {
        let tethers = &[Tether { vertex: 7, target: vec3(0.01, -0.02, 0.03), stiffness: 40.0 }];
        let anchors = &problem.rest_anchors;
        let objective =
            Objective { problem: &problem, anchors, tethers, contacts: Contacts::NONE, load };
        let at = |t: f64| x.iter().zip(&d).map(|(x, d)| *x + *d * t).collect::<Vec<_>>();
        // Fourth-order differences: with t = 1e-3 the error of the formula is about t^4 = 1e-12 of
        // the fifth derivative, that of round-off eps/t = 2e-13 of the values.
        let t = 1e-3;
        let slope = |f: &dyn Fn(f64) -> f64| {
            (8.0 * (f(t) - f(-t)) - (f(2.0 * t) - f(-2.0 * t))) / (12.0 * t)
        };
        let gradient = objective.gradient(&x);
        let exact: f64 = gradient.iter().zip(&d).map(|(g, d)| g.dot(*d)).sum();
        let error = (slope(&|s| objective.value(&at(s)).sum) / exact - 1.0).abs();
        println!("{name}: gradient off by {error:.1e} of itself");
        assert!(error < 1e-7, "{name}: gradient off by {error:e}");

        let pattern = Pattern::new(&problem, &vec![false; x.len()]);
        let image = objective.hessian(&x, &pattern, false).multiply(&pattern, &d);
        let gradients = [t, -t, 2.0 * t, -2.0 * t].map(|s| objective.gradient(&at(s)));
        let differences: Vec<_> = (0..x.len())
            .map(|v| {
                let [a, b, c, e] = [0, 1, 2, 3].map(|k: usize| gradients[k][v]);
                ((a - b) * 8.0 - (c - e)) * (1.0 / (12.0 * t))
            })
            .collect();
        let error = distance(&image, &differences) / norm(&image);
        println!("{name}: Hessian off by {error:.1e} of itself");
        assert!(error < 1e-6, "{name}: Hessian off by {error:e}");

        // Leaving negative curvature out must not change what has none: along any direction the
        // projected matrix curves at least as much.
        let positive = objective.hessian(&x, &pattern, true).multiply(&pattern, &d);
        let curvature =
            |image: &[Vec3<f64>]| -> f64 { image.iter().zip(&d).map(|(h, d)| h.dot(*d)).sum() };
        assert!(curvature(&positive) >= curvature(&image) * (1.0 - 1e-12));
    }
}

/// Side stretch and first Piola stress of a bar that is stretched by `s` with free sides: the root of
/// the lateral stress, by bisection.
fn uniaxial(tissue: &Material, s: f64) -> (f64, f64) {
    let piola = |side: f64| {
        let f = Mat3::from_columns(vec3(s, 0.0, 0.0), vec3(0.0, side, 0.0), vec3(0.0, 0.0, side));
        let (lambda, mu) = (tissue.lame_lambda(), tissue.lame_mu());
        match tissue.model() {
            MaterialModel::SaintVenantKirchhoff => {
                let e = |q: f64| 0.5 * (q * q - 1.0);
                let trace = e(s) + 2.0 * e(side);
                let second = |q: f64| 2.0 * mu * e(q) + lambda * trace;
                (s * second(s), side * second(side))
            }
            MaterialModel::StableNeoHookean => {
                let pressure = (lambda + mu) * (f.determinant() - 1.0) - mu;
                (mu * s + pressure * side * side, mu * side + pressure * s * side)
            }
        }
    };
    let (mut low, mut high) = (0.3, 2.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if piola(middle).1 < 0.0 { low = middle } else { high = middle }
    }
    (low, piola(low).0)
}

/// A bar under equal and opposite tractions on its ends deforms alike everywhere, on any mesh.
#[test]
fn a_stretched_bar_is_the_closed_form() {
    let mesh = block([4, 2, 2]);
    let length = 0.04;
    let mut worst = 0.0f64;
    for (model, young, poisson, stretch) in [
        (STVK, 1e4, 0.3, 1.3),
        (STVK, 1e4, 0.45, 0.98),
        (SNH, 1e4, 0.3, 1.6),
        (SNH, 1e5, 0.45, 1.3),
        (SNH, 1e3, 0.49, 0.98),
    ] {
        let tissue = material(model, young, poisson);
        let (side, stress) = uniaxial(&tissue, stretch);
        let exact: Vec<_> =
            mesh.vertices().iter().map(|x| vec3(stretch * x.x, side * x.y, side * x.z)).collect();
        let mut inputs = Inputs::default();
        let boundary = boundary_surface(&mesh);
        for triangle in &boundary.surface.triangles {
            let triangle = triangle.map(|v| boundary.mesh_vertices[v as usize]);
            let corners = triangle.map(|v| mesh.vertices()[v as usize]);
            for (end, sign) in [(0.0, -1.0), (length, 1.0)] {
                if corners.iter().all(|x| (x.x - end).abs() < 1e-12) {
                    let area =
                        0.5 * (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
                    let force = vec3(sign * stress * area / 3.0, 0.0, 0.0);
                    inputs.forces.extend(triangle.map(|v| (v, force)));
                }
            }
        }
        // Three vertices of one end, out of line: they hold the place and carry nothing.
        let end: Vec<u32> = (0..mesh.vertices().len() as u32)
            .filter(|&v| mesh.vertices()[v as usize].x.abs() < 1e-12)
            .collect();
        for &vertex in [end[0], end[2], end[6]].iter() {
            inputs.pins.push(Pin { vertex, target: exact[vertex as usize] });
        }
        let mut reference = Reference::new(&body(&mesh, &tissue));
        // A bar twice as long as wide buckles under more than pi^2/48 = 5 % of compression (after
        // Euler, one end free): the two compressed ones stay below.
        let mut random = Random(4);
        let start: Vec<_> = exact.iter().map(|x| *x + random.vector(2e-4)).collect();
        let solution = reference.settle(&start, &inputs).expect("a state of rest");
        let moved = distance(&exact, mesh.vertices());
        let error = distance(&solution.positions, &exact) / moved;
        let reactions = reference.reactions(&solution.positions, &inputs).expect("legal");
        let force = stress.abs() * 0.02 * 0.02;
        println!(
            "{model:?} E {young:e} nu {poisson} stretch {stretch}: off by {error:.1e}, pins carry \
             {:.1e} of the force; {:?}",
            norm(&reactions) / force,
            solution.convergence
        );
        assert!(solution.convergence.minimum);
        assert!(norm(&reactions) < 1e-8 * force);
        worst = worst.max(error);
    }
    assert!(worst < 1e-8, "off by {worst:e} of the displacement");
}

/// Every vertex hangs on a spring or an attachment whose stiffness goes with its mass: the body sinks
/// by m g/k without any strain.
#[test]
fn a_body_on_springs_sinks_by_weight_over_stiffness() {
    let mesh = block([2, 2, 1]);
    let tissue = material(SNH, 1e4, 0.45);
    let count = mesh.vertices().len() as u32;
    let masses = body(&mesh, &tissue).masses;
    // [N/m] per [kg]: sinks by g/600 s^-2 = 16 mm.
    let rate = 600.0;
    let sink = GRAVITY * (1.0 / rate);

    let mut builder = ModelBuilder::new();
    builder.add_body(&mesh, &tissue).expect("a body");
    for (v, x) in mesh.vertices().iter().enumerate() {
        builder.add_attachment(v as u32, *x, rate * masses[v]).expect("an attachment");
    }
    let attached = build(&builder);
    let solution = Reference::new(&attached)
        .settle(&attached.rest_positions, &Inputs { gravity: GRAVITY, ..Inputs::default() })
        .expect("a state of rest");
    let exact: Vec<_> = mesh.vertices().iter().map(|x| *x + sink).collect();
    let error = distance(&solution.positions, &exact) / distance(&exact, mesh.vertices());
    println!("attachments: off by {error:.1e}");
    assert!(error < 1e-8);

    // A pinned twin one body above, with springs of their distance straight down.
    let mut builder = ModelBuilder::new();
    let raised = mesh.vertices().iter().map(|x| *x + vec3(0.0, 0.0, 0.1)).collect();
    let twin = TetMesh::new(raised, mesh.tets().to_vec(), mesh.regions().to_vec());
    builder.add_body(&mesh, &tissue).expect("a body");
    builder.add_body(&twin.expect("the same mesh").0, &tissue).expect("a body");
    for v in 0..count {
        builder.add_spring([v, v + count], rate * masses[v as usize], None).expect("a spring");
    }
    let hung = build(&builder);
    let mut inputs = Inputs { gravity: GRAVITY, ..Inputs::default() };
    for vertex in count..2 * count {
        inputs.pins.push(Pin { vertex, target: hung.rest_positions[vertex as usize] });
    }
    let solution =
        Reference::new(&hung).settle(&hung.rest_positions, &inputs).expect("a state of rest");
    let error =
        distance(&solution.positions[..count as usize], &exact) / distance(&exact, mesh.vertices());
    println!("springs: off by {error:.1e}");
    assert!(error < 1e-8);
}

/// On attachments whose stiffness goes with the mass, a body oscillates as a whole with the square
/// root of their rate; nothing is slower.
#[test]
fn the_slowest_mode_of_a_body_on_springs_has_their_rate() {
    let mesh = block([2, 2, 1]);
    let tissue = material(SNH, 1e4, 0.45);
    let masses = body(&mesh, &tissue).masses;
    let mut builder = ModelBuilder::new();
    builder.add_body(&mesh, &tissue).expect("a body");
    let rate = 600.0f64;
    for (v, x) in mesh.vertices().iter().enumerate() {
        builder.add_attachment(v as u32, *x, rate * masses[v]).expect("an attachment");
    }
    let model = build(&builder);
    let up = vec3(0.0, 0.0, 1.0);
    let mode = Reference::new(&model)
        .lowest_mode(&model.rest_positions, &Inputs::default(), up)
        .expect("a mode");
    assert!((mode.omega / rate.sqrt() - 1.0).abs() < 1e-8, "{} rad/s", mode.omega);
    // Normalised by the masses: one over the root of the body's.
    let size = 1.0 / masses.iter().sum::<f64>().sqrt();
    assert!(mode.shape.iter().all(|u| (*u - up * size).length() < 1e-8 * size));
}

/// A slender bar without lateral contraction has the frequency `1.8751^2 sqrt(E I/(rho A L^4))`;
/// linear tetrahedra come to it from above, because they lock.
#[test]
fn a_finer_bar_bends_slower_but_not_slower_than_the_beam() {
    let omega = |cells: usize| {
        let size = vec3(0.2, 0.02, 0.02);
        let mesh = Block::new(size, [10 * cells, cells, cells]).mesh().expect("a legal block");
        let model = body(&mesh, &material(STVK, 1e5, 0.0));
        let fixed = mesh.vertices().iter().enumerate().filter(|(_, x)| x.x < 1e-9);
        let pins = fixed.map(|(v, x)| Pin { vertex: v as u32, target: *x }).collect();
        let inputs = Inputs { pins, ..Inputs::default() };
        let down = vec3(0.0, 0.0, -1.0);
        let mode = Reference::new(&model).lowest_mode(mesh.vertices(), &inputs, down);
        mode.expect("a mode").omega
    };
    let beam = 1.875_104_f64.powi(2) * (1e5_f64 * 0.02 * 0.02 / (12.0 * 1000.0)).sqrt() / 0.04;
    let [coarse, fine] = [2, 4].map(|cells| omega(cells) / beam);
    println!("{coarse:.4} and {fine:.4} of the beam's frequency");
    // Shear and rotatory inertia take some 1 % from the beam of slenderness 10.
    assert!(coarse > fine && fine > 0.98, "{coarse} and {fine}");
    // Between first order, which would leave half of the error, and second, which leaves a quarter.
    assert!((fine - 1.0) < 0.5 * (coarse - 1.0), "{coarse} and {fine}");
}

#[test]
fn what_does_not_oscillate_has_no_mode() {
    let mesh = block([2, 1, 1]);
    let model = body(&mesh, &material(SNH, 1e4, 0.3));
    let up = vec3(0.0, 0.0, 1.0);
    let free = Reference::new(&model).lowest_mode(mesh.vertices(), &Inputs::default(), up);
    assert!(matches!(free, Err(ReferenceError::Loose { turns: false, .. })), "{free:?}");
    let ends = |x: &Vec3<f64>| x.x < 1e-12 || x.x > 0.02 - 1e-12;
    let held = mesh.vertices().iter().enumerate().filter(|(_, x)| ends(x));
    let squeezed = |x: &Vec3<f64>| vec3(0.3 * x.x, x.y, x.z);
    let pins = held.map(|(v, x)| Pin { vertex: v as u32, target: squeezed(x) }).collect();
    let inputs = Inputs { pins, ..Inputs::default() };
    let positions: Vec<_> = mesh.vertices().iter().map(squeezed).collect();
    // Saint Venant-Kirchhoff gives way below a stretch of 1/sqrt(3).
    let yielding = body(&mesh, &material(STVK, 1e4, 0.3));
    let unstable = Reference::new(&yielding).lowest_mode(&positions, &inputs, up);
    assert!(matches!(unstable, Err(ReferenceError::Unstable)), "{unstable:?}");
    let nowhere = Reference::new(&model).lowest_mode(&positions, &inputs, Vec3::ZERO);
    assert!(matches!(nowhere, Err(ReferenceError::NotFinite { what: "direction" })));
    let mut quadratic = Reference::quadratic(&mesh, &material(SNH, 1e4, 0.3));
    let rest = quadratic.problem().rest_positions.clone();
    let massless = quadratic.lowest_mode(&rest, &inputs, up);
    assert!(matches!(massless, Err(ReferenceError::NoStep)));
}

/// Implicit Euler of a body that oscillates on attachments without strain:
/// x' = (x + dt v + dt^2 (g + w^2 p))/(1 + dt^2 w^2).
#[test]
fn steps_are_implicit_euler() {
    let mesh = block([2, 1, 1]);
    let tissue = material(STVK, 1e4, 0.3).with_viscosity(0.05).expect("legal");
    let masses = body(&mesh, &tissue).masses;
    let mut builder = ModelBuilder::new();
    builder.add_body(&mesh, &tissue).expect("a body");
    let rate = 400.0;
    for (v, x) in mesh.vertices().iter().enumerate() {
        builder.add_attachment(v as u32, *x, rate * masses[v]).expect("an attachment");
    }
    let model = build(&builder);
    let mut state = State::at_rest(&model);
    let mut reference = Reference::new(&model);
    let inputs = Inputs { gravity: GRAVITY, ..Inputs::default() };
    let dt = 1.0 / 60.0;
    let (mut fall, mut speed) = (0.0, 0.0);
    for _ in 0..20 {
        reference.step(&mut state, &inputs, dt).expect("a step");
        let next = (fall + dt * speed - dt * dt * 9.81) / (1.0 + dt * dt * rate);
        (fall, speed) = (next, (next - fall) / dt);
    }
    for (x, rest) in state.positions.iter().zip(mesh.vertices()) {
        let error = (*x - *rest - vec3(0.0, 0.0, fall)).length() / fall.abs();
        assert!(error < 1e-8, "off by {error:e}");
    }
    assert!(state.velocities.iter().all(|v| (v.z - speed).abs() < 1e-8));
}

/// A free tetrahedron stretched and let go at zero speed creeps back; one step of that has a closed
/// form in the limit of vanishing mass: stress + eta/dt D (E - E_n) = 0, so E = E_n eta/(eta + dt).
#[test]
fn viscosity_is_kelvin_voigt() {
    let mesh = block([1, 1, 1]);
    let light = Material::new(STVK, 1e4, 0.3, 1e-6).expect("legal");
    let model = body(&mesh, &light.with_viscosity(0.03).expect("legal"));
    let mut state = State::at_rest(&model);
    let stretch =
        Mat3::from_columns(vec3(1.1, 0.02, 0.0), vec3(0.02, 0.95, 0.0), vec3(0.0, 0.0, 1.05));
    for x in &mut state.positions {
        *x = stretch * *x;
    }
    let start = green_strain::strain(&stretch);
    let dt = 0.01;
    Reference::new(&model).step(&mut state, &Inputs::default(), dt).expect("a step");
    let problem = Problem::linear(&model);
    for point in 0..problem.linear.points.len() {
        let f = problem.linear.deformation_gradient(point, &state.positions);
        let strain = green_strain::strain(&f);
        for (now, before) in strain.iter().zip(start) {
            // Inertia is m/(dt^2 E L) = 1e-6 * 1e-4/(1e-4 * 1e4) = 1e-10 of the stiffness.
            assert!((now - before * 0.75).abs() < 1e-8, "{now} after {before}");
        }
    }
}

/// A quadratic tetrahedron bends exactly under pure bending of small strain; a linear one locks.
#[test]
fn quadratic_tetrahedra_bend_without_locking() {
    // u = c (x z, 0, -x^2/2) with nu = 0: stress E c z along x, none elsewhere; no body force.
    let mesh = block([4, 1, 1]);
    let tissue = material(STVK, 1e4, 0.0);
    let curvature = 1e-4;
    let bend = |x: &Vec3<f64>| *x + vec3(curvature * x.x * x.z, 0.0, -0.5 * curvature * x.x * x.x);
    let solve = |reference: &mut Reference| {
        let rest = reference.problem().rest_positions.clone();
        let ends = rest.iter().enumerate().filter(|(_, x)| x.x < 1e-12 || x.x > 0.04 - 1e-12);
        let pins = ends.map(|(v, x)| Pin { vertex: v as u32, target: bend(x) }).collect();
        let inputs = Inputs { pins, ..Inputs::default() };
        let solution = reference.settle(&rest, &inputs).expect("a state of rest");
        let exact: Vec<_> = rest.iter().map(bend).collect();
        distance(&solution.positions, &exact) / distance(&exact, &rest)
    };
    let quadratic = solve(&mut Reference::quadratic(&mesh, &tissue));
    let linear = solve(&mut Reference::new(&body(&mesh, &tissue)));
    println!("pure bending: quadratic off by {quadratic:.1e}, linear by {linear:.1e}");
    // The field is exact for small strain; Green strain adds terms of the order of the strain,
    // curvature times length = 4e-6.
    assert!(quadratic < 1e-5, "quadratic off by {quadratic:e}");
    assert!(linear > 1e3 * quadratic, "linear off by {linear:e}");
}

#[test]
fn what_nothing_holds_has_no_rest() {
    let mesh = block([2, 1, 1]);
    let model = body(&mesh, &material(SNH, 1e4, 0.3));
    let mut reference = Reference::new(&model);
    let rest = &model.rest_positions;
    let pinned = |vertices: &[u32]| {
        let pins = vertices.iter().map(|&v| Pin { vertex: v, target: rest[v as usize] }).collect();
        Inputs { gravity: GRAVITY, pins, ..Inputs::default() }
    };
    let settled = |reference: &mut Reference, vertices: &[u32]| {
        reference.settle(rest, &pinned(vertices)).map(|_| ())
    };
    let free = settled(&mut reference, &[]);
    assert_eq!(free, Err(ReferenceError::Loose { vertex: 0, turns: false }));
    assert!(free.expect_err("loose").to_string().contains("pin or attach"));
    assert_eq!(
        settled(&mut reference, &[0, 2]),
        Err(ReferenceError::Loose { vertex: 0, turns: true })
    );
    assert_eq!(settled(&mut reference, &[0, 2, 4]), Ok(()));
}

#[test]
fn bad_inputs_are_refused() {
    let model = body(&block([1, 1, 1]), &material(SNH, 1e4, 0.3));
    let rest = model.rest_positions.clone();
    let mut reference = Reference::new(&model);
    let pins: Vec<_> = (0..4).map(|v| Pin { vertex: v, target: rest[v as usize] }).collect();
    let good = Inputs { gravity: GRAVITY, pins, ..Inputs::default() };
    let cost = reference.cost(&good).expect("a cost");
    assert_eq!(cost.unknowns, 12);
    // Four diagonal blocks of six entries, five edges between the free corners of nine.
    assert_eq!(cost.matrix_entries, 69);
    assert!(cost.factor_entries >= 69 && cost.bytes > 0 && cost.solve_seconds > 0.0);

    let refused = |inputs: &Inputs<f64>| Reference::new(&model).settle(&rest, inputs).map(|_| ());
    let nan = Vec3::from_f64([f64::NAN; 3]);
    let cases = [
        Inputs { gravity: nan, ..good.clone() },
        Inputs { forces: vec![(0, nan)], ..good.clone() },
        Inputs { pins: vec![Pin { vertex: 0, target: nan }], ..good.clone() },
    ];
    for inputs in &cases {
        assert!(matches!(refused(inputs), Err(ReferenceError::NotFinite { .. })));
    }
    let far = Inputs { forces: vec![(99, Vec3::ZERO)], ..good.clone() };
    assert!(matches!(refused(&far), Err(ReferenceError::UnknownVertex { vertex: 99, .. })));
    let anchors = Inputs { anchors: vec![Vec3::ZERO], ..good.clone() };
    assert!(matches!(refused(&anchors), Err(ReferenceError::Mismatch { .. })));
    let short = Reference::new(&model).settle(&rest[1..], &good).map(|_| ());
    assert!(matches!(short, Err(ReferenceError::Mismatch { .. })));
    let small = Reference::new(&model).allow_memory(1000).settle(&rest, &good).map(|_| ());
    let Err(ReferenceError::TooLarge { unknowns: 12, limit: 1000, bytes }) = small else {
        panic!("not refused: {small:?}")
    };
    assert_eq!(bytes, cost.bytes);
    let mut state = State::at_rest(&model);
    for dt in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-200] {
        let stepped = Reference::new(&model).step(&mut state, &good, dt);
        assert!(matches!(stepped, Err(ReferenceError::NotFinite { what: "step" })), "{dt}");
    }
}

/// Green strain compressed everywhere below 1/sqrt 3 curves downwards in all directions: what is left
/// after projection is nothing at all, and the search must still end.
#[test]
fn crushed_green_strain_ends_in_an_answer() {
    let mesh = block([1, 1, 1]);
    let model = body(&mesh, &material(STVK, 1e4, 0.3));
    let half: Vec<_> = mesh.vertices().iter().map(|x| *x * 0.5).collect();
    let pins = (0..7).map(|v| Pin { vertex: v, target: half[v as usize] }).collect();
    let inputs = Inputs { pins, ..Inputs::default() };
    match Reference::new(&model).settle(&half, &inputs) {
        Ok(solution) => assert!(solution.convergence.converged),
        Err(error) => println!("{error}"),
    }
}
