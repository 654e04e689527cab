//! Helpers shared by the integration tests.

pub mod counting;
pub mod damage;
pub mod data;
pub mod device;
pub mod potential;
pub mod tets;
pub mod tied;

use viscera::material::{Material, MaterialModel};
use viscera::mesh::TetMesh;
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::{Mat3, Real, Vec3, vec3};
use viscera::settings::{Colors, Count, SolverSettings};
use viscera::solver::{Inputs, Solver};
use viscera::state::State;

pub const STVK: MaterialModel = MaterialModel::SaintVenantKirchhoff;
pub const SNH: MaterialModel = MaterialModel::StableNeoHookean;

/// Seeded numbers (splitmix64): the same on every machine.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [low, high).
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn vector(&mut self, size: f64) -> Vec3<f64> {
        vec3(self.uniform(-size, size), self.uniform(-size, size), self.uniform(-size, size))
    }

    /// A rotation by a random angle about a random axis.
    pub fn rotation(&mut self) -> Mat3<f64> {
        loop {
            let [a, b] = [self.vector(1.0), self.vector(1.0)];
            let c = a.cross(b);
            if c.length() > 0.1 {
                let a = a * (1.0 / a.length());
                let c = c * (1.0 / c.length());
                return Mat3::from_columns(a, c.cross(a), c);
            }
        }
    }
}

pub fn material(model: MaterialModel, young: f64, poisson: f64) -> Material {
    Material::new(model, young, poisson, 1000.0).expect("a legal material")
}

/// One body of one material.
pub fn single_body<S: Real>(mesh: &TetMesh, material: &Material) -> Model<S> {
    let mut builder = ModelBuilder::new();
    builder.add_body(mesh, material).expect("a legal body");
    builder.build().expect("a legal model")
}

/// Structured block [m] of six tetrahedra per cell, its interior vertices jittered by up to
/// `jitter` of a cell.
pub fn block(size: [f64; 3], cells: [usize; 3], jitter: f64) -> TetMesh {
    let mut random = Random(5);
    let n = cells.map(|c| c + 1);
    let index = |i: usize, j: usize, k: usize| (i + n[0] * (j + n[1] * k)) as u32;
    let mut vertices = Vec::new();
    for k in 0..n[2] {
        for j in 0..n[1] {
            for i in 0..n[0] {
                let grid = [i, j, k];
                let inner = (0..3).all(|a| grid[a] > 0 && grid[a] < cells[a]);
                let x: [f64; 3] = std::array::from_fn(|a| {
                    let shift = random.uniform(-jitter, jitter);
                    size[a] * (grid[a] as f64 + if inner { shift } else { 0.0 }) / cells[a] as f64
                });
                vertices.push(Vec3::from_f64(x));
            }
        }
    }
    let mut tets = Vec::new();
    for k in 0..cells[2] {
        for j in 0..cells[1] {
            for i in 0..cells[0] {
                let corner = |c: usize| index(i + (c & 1), j + ((c >> 1) & 1), k + (c >> 2));
                for (a, b) in [(1, 2), (2, 4), (4, 1), (2, 1), (4, 2), (1, 4)] {
                    tets.push([corner(0), corner(a), corner(a | b), corner(7)]);
                }
            }
        }
    }
    let regions = vec![0; tets.len()];
    TetMesh::new(vertices, tets, regions).expect("a legal block").0
}

/// Runs frames of `substeps` steps, multiplying all velocities by `keep` after each frame.
pub struct Run<'a, S> {
    pub model: &'a Model<S>,
    pub state: State<S>,
    pub solver: Solver<S>,
    pub dt: f64,
}

impl<'a, S: Real> Run<'a, S> {
    pub fn new(model: &'a Model<S>, settings: &SolverSettings) -> Self {
        let state = State::at_rest(model);
        let solver = Solver::new(model, settings);
        Self { model, state, solver, dt: 1.0 / 60.0 / f64::from(settings.substeps()) }
    }

    pub fn step(&mut self, inputs: &Inputs<S>) {
        self.solver.step(self.model, &mut self.state, inputs, self.dt).expect("a legal step");
    }

    pub fn frame(&mut self, inputs: &Inputs<S>, keep: f64) {
        for _ in 0..self.solver.settings().substeps() {
            self.step(inputs);
        }
        for v in &mut self.state.velocities {
            *v = *v * S::from_f64(keep);
        }
    }
}

/// The rebase with kept multipliers, one substep per frame: exact at rest.
pub fn exact(iterations: u32) -> SolverSettings {
    SolverSettings {
        substeps: Count::Of(1),
        iterations: Count::Of(iterations),
        ..SolverSettings::xpbd()
    }
}

/// The defaults with other colours.
pub fn colored(colors: Colors) -> SolverSettings {
    SolverSettings { colors, ..SolverSettings::xpbd() }
}

/// XPBD as published: multipliers from zero, no rebase.
pub fn plain(substeps: u32, iterations: u32) -> SolverSettings {
    SolverSettings {
        substeps: Count::Of(substeps),
        iterations: Count::Of(iterations),
        rebase: false,
        keep_multipliers: false,
        ..SolverSettings::xpbd()
    }
}

/// Both materials, one of them viscous, springs and attachments.
pub fn everything<S: Real>() -> Model<S> {
    let mesh = block([0.06, 0.03, 0.03], [3, 2, 2], 0.1);
    let mut builder = ModelBuilder::new();
    let viscous = material(SNH, 1e4, 0.4).with_viscosity(0.05).expect("legal");
    builder.add_body(&mesh, &material(STVK, 2e4, 0.3)).expect("a body");
    builder.add_body(&mesh, &viscous).expect("a body");
    let half = mesh.vertices().len() as u32;
    for v in (0..half).step_by(3) {
        builder.add_spring([v, half + v], 40.0, Some(0.01)).expect("a spring");
        let anchor = mesh.vertices()[v as usize];
        builder.add_attachment(half + v, anchor, 30.0).expect("an attachment");
    }
    builder.build().expect("a model")
}

/// Whether a test has its process to itself. Where it has not, the test of this name is run in another one,
/// and its failure is this one's.
pub fn alone(name: &str) -> bool {
    const ALONE: &str = "VISCERA_TEST_ALONE";
    if std::env::var_os(ALONE).is_some() {
        return true;
    }
    let program = std::env::current_exe().expect("the program of this test");
    let arguments = ["--exact", name, "--nocapture", "--include-ignored"];
    let run = std::process::Command::new(program).args(arguments).env(ALONE, "1").output();
    let output = run.expect("the program of this test starts once more");
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    println!("{said}{}", String::from_utf8_lossy(&output.stderr));
    assert!(said.contains("1 passed"), "{name} fails alone, or there is no test of that name");
    false
}
