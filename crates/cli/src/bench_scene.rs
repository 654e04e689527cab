//! `viscera bench-scene`: a scene of the peers' benchmark, see docs/peers.md.

use crate::output::OutputFolder;
use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::time::Instant;
use viscera::material::{Material, MaterialModel};
use viscera::mesh::{TetMesh, io};
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::{Real, Vec3};
use viscera::scene::Scene;
use viscera::settings::{Method, Precision, SolverSettings};
use viscera::simulation::automatic_settings;
use viscera::solver::{Inputs, Pin, Solver};
use viscera::state::State;
use viscera_resources::files;

/// Run a scene of the benchmark that compares simulators, for its harness
///
/// Reads scene.json and the Gmsh mesh that it names. A frame is `substeps` steps, in which pinned
/// vertices move linearly; after a frame the velocities of free vertices are multiplied by the
/// scene's factor, outside the timed part.
///
/// Writes positions.txt (x y z per vertex [m]) and timing.json (wall time of each frame [ms],
/// threads, precision, material, method, substeps); with --transient also frames.f64 (positions of every frame [m],
/// little-endian).
#[derive(Args)]
#[command(after_help = EXAMPLE)]
pub struct BenchSceneArguments {
    /// Folder of the scene: scene.json and its mesh
    #[arg(long, value_name = "DIR")]
    scene: PathBuf,
    /// Folder for the results
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Compute so many frames instead of the scene's
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// Settings, KEY=VALUE separated by commas: material=stvk (default) or snh; every other key is
    /// one of `solver` in `viscera scene describe`, elements=plain unless given; method=auto (default) is what a scene would choose
    /// at that accuracy, with what is pinned as its fixings. May be repeated; the last value of a key counts
    #[arg(long, value_name = "KEY=VALUE,...")]
    cfg: Vec<String>,
    /// Leave velocities as they are, and write the positions of every frame
    #[arg(long)]
    transient: bool,
}

const EXAMPLE: &str = "\
Example:
  viscera bench-scene --scene A_s --out out --cfg substeps=20,iterations=5,material=snh";

/// What scene.json says; other keys are for other readers.
#[derive(Deserialize)]
struct BenchScene {
    /// A file beside it.
    mesh: String,
    /// [Pa].
    youngs_modulus: f64,
    poisson_ratio: f64,
    /// [kg/m^3].
    density: f64,
    /// [m/s^2].
    gravity: [f64; 3],
    /// Of a frame [s].
    dt: f64,
    frames: u32,
    /// All pinned vertices.
    fixed: Vec<u32>,
    /// Those of them that move.
    moving: Vec<u32>,
    /// Where they go, from rest [m].
    displacement: [f64; 3],
    /// How long that takes [s].
    ramp_seconds: f64,
    velocity_factor_per_frame: f64,
}

/// Carries out `viscera bench-scene`.
pub fn execute(arguments: &BenchSceneArguments) -> Result<()> {
    let (material, settings) = read_settings(&arguments.cfg)?;
    match settings.precision {
        Precision::F32 => simulate::<f32>(arguments, material, &settings),
        Precision::F64 => simulate::<f64>(arguments, material, &settings),
    }
}

/// Settings are read where those of a scene file are; this is the least that is a scene.
const CARRIER: &str = "\
[[body]]
name = \"bar\"
shape = \"block\"
size = [\"1 m\", \"1 m\", \"1 m\"]
cells = [1, 1, 1]
material = { young = \"1 kPa\" }";

fn read_settings(lists: &[String]) -> Result<(MaterialModel, SolverSettings)> {
    let mut material = MaterialModel::SaintVenantKirchhoff;
    // The benchmark's references are of linear tetrahedra.
    let mut overrides = vec![("solver.elements".to_owned(), "plain")];
    for setting in lists.iter().flat_map(|list| list.split(',')).map(str::trim) {
        match setting.split_once('=') {
            _ if setting.is_empty() => {}
            Some(("material", "stvk")) => material = MaterialModel::SaintVenantKirchhoff,
            Some(("material", "snh")) => material = MaterialModel::StableNeoHookean,
            Some(("material", other)) => {
                bail!("--cfg material={other}: the materials are stvk and snh")
            }
            Some((key, value)) => overrides.push((format!("solver.{key}"), value)),
            None => bail!("--cfg {setting}: write KEY=VALUE, for example --cfg iterations=20"),
        }
    }
    let overrides: Vec<_> = overrides.iter().map(|(key, value)| (key.as_str(), *value)).collect();
    let scene = Scene::parse("--cfg", CARRIER, &overrides).context("--cfg")?;
    Ok((material, scene.solver))
}

impl BenchScene {
    fn read(arguments: &BenchSceneArguments) -> Result<(Self, TetMesh)> {
        let path = arguments.scene.join("scene.json");
        let mut scene: Self = serde_json::from_slice(&files::read(&path)?)
            .with_context(|| format!("{} is no scene of the benchmark", path.display()))?;
        scene.frames = arguments.frames.unwrap_or(scene.frames);
        ensure!(scene.frames > 0, "{}: it has no frames; give --frames", path.display());
        let path = arguments.scene.join(&scene.mesh);
        let name = path.display().to_string();
        let (mesh, report) = io::read_tet_mesh(&name, &files::read(&path)?, 1.0)?;
        if let Some(vertex) = report.repairs.removed_vertices.first() {
            bail!("{name}: vertex {vertex} (from 0) is in no tetrahedron; remove it");
        }
        Ok((scene, mesh))
    }

    /// The share of the way that is made when a frame ends, frames counted from 1.
    fn share(&self, frame: u32) -> f64 {
        if self.ramp_seconds <= 0.0 {
            return 1.0;
        }
        let s = (f64::from(frame) * self.dt / self.ramp_seconds).min(1.0);
        s * s * (3.0 - 2.0 * s)
    }
}

/// What happens in a run, and what is measured.
struct Run<'a, S> {
    scene: &'a BenchScene,
    model: &'a Model<S>,
    solver: Solver<S>,
    state: State<S>,
    inputs: Inputs<S>,
    rest: &'a [Vec3<f64>],
    /// Of each pinned vertex, how far it goes [m].
    travels: Vec<Vec3<f64>>,
    is_free: Vec<bool>,
    /// Per frame.
    substeps: u32,
    /// What "auto" stands for, where that is asked for.
    method: Method,
}

impl<'a, S: Real> Run<'a, S> {
    fn new(
        scene: &'a BenchScene,
        mesh: &'a TetMesh,
        model: &'a Model<S>,
        settings: &SolverSettings,
    ) -> Result<Self> {
        let rest = mesh.vertices();
        let mut is_free = vec![true; rest.len()];
        for &vertex in scene.fixed.iter().chain(&scene.moving) {
            let Some(entry) = is_free.get_mut(vertex as usize) else {
                bail!("scene.json pins vertex {vertex}; the mesh has {} (from 0)", rest.len());
            };
            *entry = false;
        }
        let mut moves = vec![false; rest.len()];
        scene.moving.iter().for_each(|&vertex| moves[vertex as usize] = true);
        let pinned: Vec<u32> = (0..rest.len() as u32).filter(|&v| !is_free[v as usize]).collect();
        let displacement = Vec3::from_f64(scene.displacement);
        let travel = |&v: &u32| if moves[v as usize] { displacement } else { Vec3::ZERO };
        let pin = |&vertex: &u32| Pin { vertex, target: rest[vertex as usize].cast() };
        let inputs = Inputs {
            gravity: Vec3::from_f64(scene.gravity),
            pins: pinned.iter().map(pin).collect(),
            ..Inputs::default()
        };
        // What a scene moves is not among the fixings that its simulation chooses by.
        let mut fixings = inputs.clone();
        fixings.pins.retain(|pin| !moves[pin.vertex as usize]);
        let settings = automatic_settings(settings, model, scene.dt, || fixings.clone());
        let mut solver = Solver::new(model, &settings);
        Ok(Self {
            method: settings.method,
            scene,
            model,
            substeps: solver.substeps(&fixings, scene.dt),
            solver,
            state: State::at_rest(model),
            inputs,
            rest,
            travels: pinned.iter().map(travel).collect(),
            is_free,
        })
    }

    /// One frame, counted from 1; without what slows it down afterwards.
    fn advance(&mut self, frame: u32) -> Result<()> {
        let substeps = self.substeps;
        let dt = self.scene.dt / f64::from(substeps);
        let ends = [frame - 1, frame].map(|end| self.scene.share(end));
        for substep in 1..=substeps {
            let part = f64::from(substep) / f64::from(substeps);
            let share = ends[0] + (ends[1] - ends[0]) * part;
            for (pin, travel) in self.inputs.pins.iter_mut().zip(&self.travels) {
                pin.target = (self.rest[pin.vertex as usize] + *travel * share).cast();
            }
            self.solver.step(self.model, &mut self.state, &self.inputs, dt)?;
        }
        ensure!(
            self.state.is_finite(),
            "frame {frame} diverged: raise substeps, lower relaxation, or turn acceleration off"
        );
        Ok(())
    }

    fn slow_down(&mut self) {
        let factor = S::from_f64(self.scene.velocity_factor_per_frame);
        for (velocity, _) in
            self.state.velocities.iter_mut().zip(&self.is_free).filter(|(_, f)| **f)
        {
            *velocity = *velocity * factor;
        }
    }
}

/// timing.json.
#[derive(Serialize)]
struct Timing {
    /// Of each frame [ms].
    wall_ms: Vec<f64>,
    threads: String,
    precision: &'static str,
    material: &'static str,
    /// In force: the one that "auto" chose where that is asked for.
    method: String,
    /// Per frame.
    substeps: u32,
    /// [s].
    setup_s: f64,
}

fn simulate<S: Real>(
    arguments: &BenchSceneArguments,
    material: MaterialModel,
    settings: &SolverSettings,
) -> Result<()> {
    let (scene, mesh) = BenchScene::read(arguments)?;
    let out = OutputFolder::create(&arguments.out)?;
    let start = Instant::now();
    let tissue = Material::new(material, scene.youngs_modulus, scene.poisson_ratio, scene.density)?;
    let mut builder = ModelBuilder::new();
    builder.add_body(&mesh, &tissue)?;
    let model = builder.build::<S>()?;
    let mut run = Run::new(&scene, &mesh, &model, settings)?;
    let mut timing = Timing {
        wall_ms: Vec::new(),
        threads: run.solver.thread_count().to_string(),
        precision: S::NAME,
        material: match material {
            MaterialModel::SaintVenantKirchhoff => "stvk",
            MaterialModel::StableNeoHookean => "snh",
        },
        method: run.method.to_string(),
        substeps: run.substeps,
        setup_s: start.elapsed().as_secs_f64(),
    };
    let mut motion = Vec::new();
    for frame in 1..=scene.frames {
        let start = Instant::now();
        run.advance(frame)?;
        timing.wall_ms.push(1e3 * start.elapsed().as_secs_f64());
        if arguments.transient {
            let coordinates = run.state.positions.iter().flat_map(|x| x.cast::<f64>().to_array());
            motion.extend(coordinates.flat_map(f64::to_le_bytes));
        } else {
            run.slow_down();
        }
    }
    if arguments.transient {
        out.write("frames.f64", &motion)?;
    }
    let line = |x: &Vec3<S>| {
        let [x, y, z] = x.cast::<f64>().to_array();
        format!("{x:e} {y:e} {z:e}\n")
    };
    out.write(
        "positions.txt",
        run.state.positions.iter().map(line).collect::<String>().as_bytes(),
    )?;
    let text = serde_json::to_string(&timing).context("cannot write timing.json")?;
    out.write("timing.json", text.as_bytes())
}
