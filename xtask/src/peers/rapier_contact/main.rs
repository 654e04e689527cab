//! Rapier's soft bodies in the two scenes of contact: a ball that is pressed into a block, and a block on an incline.
//!
//!     rapier_peer press size=s,depth=4,iterations=4
//!     rapier_peer slide angle=26.9,frames=36
//!
//! Reads the meshes of `viscera-lab contact-scenes` in SOFTBENCH_CACHE; prints a line of JSON, and with positions=FILE writes
//! where the vertices are in the end. Lengths are times 100, times times 10, E over 10 000: gravity, masses and forces
//! stay what they are, and cells are no longer so small that they are dropped.
use rapier3d::prelude::*;
use std::{collections::HashMap, fs, io::Write};

const SCALE: f64 = 100.0;
const FRAME: f64 = 1.0 / 60.0;
const YOUNG: f64 = 1e4;
const POISSON: f64 = 0.3;
const GRAVITY: f64 = 9.81;
const RADIUS: f64 = 0.012;
const FRICTION: f64 = 0.5;
/// Frames: down, held; gravity turns, rest.
const PRESSING: usize = 60;
const HELD: usize = 120;
const TURNING: usize = 30;
const RESTING: usize = 30;
const KEPT_VELOCITY: f64 = 0.9;
/// Frames that count at the end of a pressing, and those left out of costs and of accelerations at the beginning.
const COUNTED: usize = 10;
const UNTIMED: usize = 3;
const SKIPPED: usize = 6;
const DENSITY: f64 = 1000.0;

/// Processor time [ms].
fn cpu() -> f64 {
    let mut t = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    unsafe { libc::clock_gettime(libc::CLOCK_PROCESS_CPUTIME_ID, &mut t) };
    t.tv_sec as f64 * 1e3 + t.tv_nsec as f64 * 1e-6
}

struct Settings(HashMap<String, String>);

impl Settings {
    fn read(text: &str) -> Self {
        let pairs = text.split(',').filter_map(|pair| pair.split_once('='));
        Self(pairs.map(|(key, value)| (key.to_string(), value.to_string())).collect())
    }

    fn number(&self, key: &str, usual: f64) -> f64 {
        self.0.get(key).map_or(usual, |value| value.parse().expect("a number"))
    }

    fn is(&self, key: &str, value: &str) -> bool {
        self.0.get(key).is_some_and(|given| given == value)
    }
}

/// Places [m], whether held, tetrahedra, masses [kg].
struct Mesh {
    places: Vec<[f64; 3]>,
    held: Vec<bool>,
    tets: Vec<[u32; 4]>,
    masses: Vec<f64>,
}

impl Mesh {
    fn read(name: &str) -> Self {
        let folder = std::env::var("SOFTBENCH_CACHE").expect("SOFTBENCH_CACHE");
        let text = fs::read_to_string(format!("{folder}/{name}.txt")).expect("a mesh");
        let mut numbers = text.split_ascii_whitespace().map(|t| t.parse::<f64>().expect("a number"));
        let mut next = || numbers.next().expect("a number");
        let (vertices, count) = (next() as usize, next() as usize);
        let (mut places, mut held) = (vec![], vec![]);
        for _ in 0..vertices {
            places.push([next(), next(), next()]);
            held.push(next() != 0.0);
        }
        let tets: Vec<[u32; 4]> = (0..count).map(|_| std::array::from_fn(|_| next() as u32)).collect();
        let mut masses = vec![0.0; vertices];
        for tet in &tets {
            let [a, b, c, d] = tet.map(|v| places[v as usize]);
            let edge = |p: [f64; 3]| [p[0] - a[0], p[1] - a[1], p[2] - a[2]];
            let (u, v, w) = (edge(b), edge(c), edge(d));
            let cross = [v[1] * w[2] - v[2] * w[1], v[2] * w[0] - v[0] * w[2], v[0] * w[1] - v[1] * w[0]];
            let volume = (u[0] * cross[0] + u[1] * cross[1] + u[2] * cross[2]).abs() / 6.0;
            tet.iter().for_each(|&v| masses[v as usize] += 0.25 * DENSITY * volume);
        }
        Self { places, held, tets, masses }
    }
}

/// A vector of the scaled world from one of the scene.
fn scaled(x: [f64; 3]) -> Vector {
    Vector::new((SCALE * x[0]) as Real, (SCALE * x[1]) as Real, (SCALE * x[2]) as Real)
}

struct Scene {
    world: PhysicsWorld,
    body: SoftBodyHandle,
    held: Vec<bool>,
    masses: Vec<f64>,
    costs: Vec<f64>,
    steps: usize,
    /// Of a step, in the scaled world.
    dt: f64,
}

impl Scene {
    fn new(mesh: &Mesh, settings: &Settings, skin: f64, friction: f64) -> Self {
        let mut world = PhysicsWorld::new();
        world.gravity = Vector::ZERO;
        let steps = settings.number("steps", 1.0) as usize;
        let dt = FRAME * SCALE.sqrt() / steps as f64;
        let p = &mut world.integration_parameters;
        p.dt = dt as Real;
        p.num_solver_iterations = settings.number("iterations", 4.0) as usize;
        p.length_unit = settings.number("unit", 1.0) as Real;
        p.soft_bodies.contact_stiffening = settings.number("stiffening", 4.0) as Real;
        p.soft_bodies.recovery.overlap_constraints = !settings.is("overlap", "off");
        p.soft_bodies.fem.max_linear_iterations = settings.number("linear", 20.0) as usize;
        if let Some(frequency) = settings.0.get("frequency") {
            let frequency: Real = frequency.parse().expect("a number");
            p.contact_softness.natural_frequency = frequency;
            p.static_contact_softness.natural_frequency = frequency;
        }
        let pinned = (0u32..).zip(&mesh.held).filter(|(_, held)| **held).map(|(v, _)| v);
        let soft = SoftBodyBuilder::new(mesh.places.iter().map(|x| scaled(*x)).collect())
            .cells(mesh.tets.clone())
            .masses(mesh.masses.iter().map(|m| *m as Real).collect())
            .cell_model(SoftBodyCellModel::NeoHookean)
            .material(SoftBodyMaterial {
                young_modulus: (YOUNG / (SCALE * SCALE)) as Real,
                poisson_ratio: POISSON as Real,
                elastic_damping_ratio: settings.number("damping", 1.0) as Real,
                ..Default::default()
            })
            .solver(if settings.is("solver", "constraints") {
                SoftBodySolver::Constraints
            } else {
                SoftBodySolver::Fem
            })
            .additional_pgs_iterations(settings.number("pgs", 0.0) as usize)
            .surface_collider(ColliderBuilder::ball(1.0).friction(friction as Real))
            .particle_radius((SCALE * skin) as Real)
            .self_contacts(false)
            .can_sleep(false)
            .pinned_particles(pinned);
        let body = world.insert_soft_body(soft);
        Self { world, body, held: mesh.held.clone(), masses: mesh.masses.clone(), costs: vec![], steps, dt }
    }

    fn frame(&mut self, mut before_step: impl FnMut(&mut PhysicsWorld, f64)) {
        let mut spent = 0.0;
        for step in 0..self.steps {
            before_step(&mut self.world, (step + 1) as f64 / self.steps as f64);
            let begin = cpu();
            self.world.step();
            spent += cpu() - begin;
        }
        self.costs.push(spent);
    }

    fn damp(&mut self) {
        let soft = &mut self.world.soft_bodies[self.body];
        for v in (0..self.held.len()).filter(|&v| !self.held[v]) {
            let velocity = soft.particle_velocity(v);
            soft.set_particle_velocity(v, velocity * KEPT_VELOCITY as Real);
        }
    }

    /// Impulse of a step over its time, of all pairs [N].
    fn force(&self) -> Vector {
        let total: Vector = self.world.contact_pairs().map(|pair| pair.total_impulse()).sum();
        total * (1.0 / self.dt) as Real
    }

    fn mean(&self, of: impl Fn(&SoftBody, usize) -> Vector) -> [f64; 3] {
        let soft = &self.world.soft_bodies[self.body];
        let mut sum = [0.0; 3];
        for (v, mass) in self.masses.iter().enumerate() {
            let x = of(soft, v);
            [x.x, x.y, x.z].iter().zip(&mut sum).for_each(|(x, sum)| *sum += mass * *x as f64);
        }
        sum.map(|sum| sum / self.masses.iter().sum::<f64>())
    }

    fn cost(&self) -> f64 {
        let mut costs = self.costs[UNTIMED..].to_vec();
        costs.sort_by(f64::total_cmp);
        costs[costs.len() / 2]
    }
}

fn press(settings: &Settings) {
    let size = settings.0.get("size").map_or("s", String::as_str);
    let mesh = Mesh::read(&format!("block-{size}"));
    let (depth, skin) = (1e-3 * settings.number("depth", 4.0), settings.number("skin", 1e-4));
    let mut scene = Scene::new(&mesh, settings, skin, 0.0);
    let highest = mesh.places.iter().fold([0f64; 3], |high, x| std::array::from_fn(|i| high[i].max(x[i])));
    let middle = move |share: f64| {
        scaled([0.5 * highest[0], 0.5 * highest[1], highest[2] + RADIUS - depth * share.min(1.0)])
    };
    let ball = scene.world.insert_body(RigidBodyBuilder::kinematic_position_based().translation(middle(0.0)));
    let collider = ColliderBuilder::ball((SCALE * (RADIUS - skin)) as Real).friction(0.0);
    scene.world.insert_collider(collider, Some(ball));
    let mut forces = vec![];
    for frame in 0..PRESSING + HELD {
        scene.frame(|world, part| {
            let to = middle((frame as f64 + part) / PRESSING as f64);
            world.bodies[ball].set_next_kinematic_translation(to);
        });
        forces.push(scene.force().z.abs());
        scene.damp();
    }
    if let Some(file) = settings.0.get("positions") {
        let mut file = fs::File::create(file).expect("a file");
        for x in scene.world.soft_bodies[scene.body].particle_positions() {
            let [x, y, z] = [x.x, x.y, x.z].map(|x| x as f64 / SCALE);
            writeln!(file, "{x:e} {y:e} {z:e}").expect("space");
        }
    }
    let forces = &forces[forces.len() - COUNTED..];
    println!("{{\"forces\": {forces:?}, \"cpu_ms\": {:.5}}}", scene.cost());
}

fn slide(settings: &Settings) {
    let mut mesh = Mesh::read("incline");
    let skin = settings.number("skin", 1e-4);
    mesh.places.iter_mut().for_each(|x| x[2] += skin);
    let mut scene = Scene::new(&mesh, settings, skin, FRICTION);
    let ground = ColliderBuilder::new(SharedShape::halfspace(Vector::Z)).friction(FRICTION as Real);
    scene.world.insert_collider(ground, None);
    let angle = settings.number("angle", 0.0).to_radians();
    let frames = settings.number("frames", 36.0) as usize;
    let slope = [0.6, 0.8];
    let (mut places, mut speeds) = (vec![], vec![]);
    for frame in 0..TURNING + RESTING + frames {
        scene.frame(|world, part| {
            let now = angle * ((frame as f64 + part) / TURNING as f64).min(1.0);
            let down = GRAVITY * now.sin();
            world.gravity = Vector::new(
                (down * slope[0]) as Real,
                (down * slope[1]) as Real,
                (-GRAVITY * now.cos()) as Real,
            );
        });
        if frame < TURNING + RESTING {
            scene.damp();
            continue;
        }
        let along = |x: [f64; 3]| x[0] * slope[0] + x[1] * slope[1];
        places.push(along(scene.mean(|soft, v| soft.particle_position(v))) / SCALE);
        speeds.push(along(scene.mean(|soft, v| soft.particle_velocity(v))) / SCALE.sqrt());
    }
    let counted = &speeds[SKIPPED..];
    let middle = 0.5 * (counted.len() - 1) as f64;
    let (mut moment, mut square) = (0.0, 0.0);
    for (frame, speed) in counted.iter().enumerate() {
        moment += (frame as f64 - middle) * speed;
        square += (frame as f64 - middle).powi(2);
    }
    let acceleration = moment / square / FRAME;
    let way = places[places.len() - 1] - places[SKIPPED];
    println!("{{\"acceleration\": {acceleration:e}, \"way\": {way:e}, \"cpu_ms\": {:.5}}}", scene.cost());
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let settings = Settings::read(arguments.get(2).map_or("", String::as_str));
    match arguments.get(1).map(String::as_str) {
        Some("press") => press(&settings),
        Some("slide") => slide(&settings),
        _ => panic!("press or slide"),
    }
}
