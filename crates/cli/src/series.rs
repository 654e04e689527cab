//! The time series of a run: one VTU file per written frame and a PVD file that lists them. A thread of its own
//! measures, packs and writes frames while the next ones are simulated.

use crate::output::OutputFolder;
use anyhow::Result;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};
use viscera::measure::measure_tets_by_pieces;
use viscera::mesh::SurfaceMesh;
use viscera::mesh::io::vtu::{Array, Grid};
use viscera::mesh::io::{obj, pvd};
use viscera::model::Model;
use viscera::scalar::{Real, Vec3};
use viscera::simulation::{AssembledBody, Simulation};

const FOLDER: &str = "frames";

/// Frames that wait to be written, each as large as a state. More would only hide for longer that the disk is too slow.
const WAITING: usize = 2;

/// The lists are rewritten at most so often, so that one can look at a run while it goes on, and it does not spend its
/// time on its tables of contents.
const LIST_EVERY: Duration = Duration::from_millis(250);

/// A frame as it is handed over.
struct Frame<S> {
    number: u64,
    time: f64,
    positions: Vec<Vec3<S>>,
    velocities: Vec<Vec3<S>>,
    /// As it is for this frame: a scene may change its materials.
    model: Arc<Model<S>>,
}

impl<S: Real> Frame<S> {
    fn of(simulation: &Simulation<S>, model: &Arc<Model<S>>) -> Self {
        let state = simulation.state();
        Self {
            number: simulation.frame(),
            time: simulation.time(),
            positions: state.positions.clone(),
            velocities: state.velocities.clone(),
            model: Arc::clone(model),
        }
    }
}

/// A series in the making.
pub struct Series<S: Real> {
    model: Arc<Model<S>>,
    /// Nothing where no frames are asked for, and once no more come.
    sender: Option<SyncSender<Frame<S>>>,
    thread: JoinHandle<(Written<S>, Result<()>)>,
}

impl<S: Real> Series<S> {
    /// An empty series; removes an earlier one.
    pub fn create(out: &OutputFolder, simulation: &Simulation<S>) -> Result<Self> {
        clear(out)?;
        let written = Written::new(out, simulation)?;
        let (sender, frames) = sync_channel(WAITING);
        let sender = written.wants_frames().then_some(sender);
        let thread = thread::spawn(move || written.write(frames));
        Ok(Self { model: Arc::new(simulation.model().clone()), sender, thread })
    }

    /// Hands the present frame over. Returns false where an earlier one could not be written; [`Series::end`] says why.
    pub fn push(&mut self, simulation: &Simulation<S>) -> bool {
        if self.model.revision() != simulation.model().revision() {
            self.model = Arc::new(simulation.model().clone());
        }
        let send = |sender: &SyncSender<_>| sender.send(Frame::of(simulation, &self.model));
        self.sender.as_ref().is_none_or(|sender| send(sender).is_ok())
    }

    /// Waits until all frames are written, or one could not be.
    pub fn end(self) -> (Written<S>, Result<()>) {
        drop(self.sender);
        self.thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    }
}

/// What is written, and what it takes to write more: the part of a frame that stays is packed once.
pub struct Written<S> {
    out: OutputFolder,
    tets: Vec<(f64, String)>,
    surfaces: Vec<(f64, String)>,
    listed: Option<Instant>,
    grid: Grid,
    writes_tets: bool,
    /// Nothing where none are asked for.
    surface: Option<Surfaces>,
    rest_positions: Vec<Vec3<S>>,
}

/// The surfaces of all bodies.
struct Surfaces {
    bodies: Vec<AssembledBody>,
    rest: SurfaceMesh,
    grid: Grid,
}

impl<S: Real> Written<S> {
    fn new(out: &OutputFolder, simulation: &Simulation<S>) -> Result<Self> {
        let (model, bodies) = (simulation.model(), &simulation.assembly().bodies);
        let output = &simulation.scene().output;
        let has_surface = output.surface && bodies.iter().any(|body| body.has_fine_surface);
        Ok(Self {
            out: out.clone(),
            tets: Vec::new(),
            surfaces: Vec::new(),
            listed: None,
            grid: grid_of(bodies, model.vertex_count())?,
            writes_tets: output.tets,
            surface: has_surface.then(|| Surfaces::of(bodies)).transpose()?,
            rest_positions: model.rest_positions.clone(),
        })
    }

    fn wants_frames(&self) -> bool {
        self.writes_tets || self.surface.is_some()
    }

    /// Writes frames until no more come, or one cannot be written.
    fn write(mut self, frames: Receiver<Frame<S>>) -> (Self, Result<()>) {
        let written = frames.into_iter().try_for_each(|frame| self.push(&frame));
        (self, written)
    }

    fn push(&mut self, frame: &Frame<S>) -> Result<()> {
        if self.writes_tets {
            let name = format!("{FOLDER}/tets_{:06}.vtu", frame.number);
            self.write_tets(&name, &frame.model, &frame.positions, &frame.velocities)?;
            self.tets.push((frame.time, name));
        }
        if let Some(surface) = &self.surface {
            let name = format!("{FOLDER}/surface_{:06}.vtu", frame.number);
            surface.write(&self.out, &name, &frame.positions)?;
            self.surfaces.push((frame.time, name));
        }
        if self.listed.is_none_or(|listed| listed.elapsed() >= LIST_EVERY) {
            self.write_lists()?;
            self.listed = Some(Instant::now());
        }
        Ok(())
    }

    /// Writes the lists, and the last frame as meshes of their own.
    pub fn finish(&mut self, simulation: &Simulation<S>) -> Result<()> {
        self.write_lists()?;
        let (model, state) = (simulation.model(), simulation.state());
        self.write_tets("final.vtu", model, &state.positions, &state.velocities)?;
        if simulation.scene().output.surface {
            let bodies = &simulation.assembly().bodies;
            let triangles = rest_surface(bodies).triangles;
            let vertices = deformed_vertices(bodies, &state.positions);
            let text = obj::write(&SurfaceMesh { vertices, triangles }, None)?;
            self.out.write("final_surface.obj", text.as_bytes())?;
        }
        Ok(())
    }

    /// Writes the lists of all frames so far.
    pub fn write_lists(&self) -> Result<()> {
        for (name, frames) in [("tissue.pvd", &self.tets), ("surface.pvd", &self.surfaces)] {
            if !frames.is_empty() {
                let list: Vec<(f64, &str)> = frames.iter().map(|(t, f)| (*t, f.as_str())).collect();
                self.out.write(name, pvd::write(&list).as_bytes())?;
            }
        }
        Ok(())
    }

    /// All bodies' tetrahedra with what is known of them.
    fn write_tets(
        &mut self,
        name: &str,
        model: &Model<S>,
        positions: &[Vec3<S>],
        velocities: &[Vec3<S>],
    ) -> Result<()> {
        let count = model.tet_count();
        let scalars = |name| Array::with_room::<1>(name, count);
        let mut ratios = scalars("J");
        let mut stretches = Array::with_room::<3>("principal stretches", count);
        let mut stresses = scalars("von Mises Cauchy stress [Pa]");
        let mut energies = scalars("energy density [J/m^3]");
        measure_tets_by_pieces(model, positions, |tets| {
            for tet in tets {
                ratios.push([tet.volume_ratio as f32]);
                stretches.push(tet.stretches.map(|stretch| stretch as f32));
                stresses.push([tet.von_mises as f32]);
                energies.push([tet.energy_density as f32]);
            }
        });
        let cell_data = [ratios, stretches, stresses, energies];
        let displacements = displacements(positions, &self.rest_positions);
        let point_data = [
            Array::vectors("displacement [m]", &displacements),
            Array::vectors("velocity [m/s]", velocities),
        ];
        self.out.write_parts(name, &self.grid.frame(positions, &point_data, &cell_data)?)
    }
}

/// All bodies' tetrahedra, their regions and numbers.
fn grid_of(bodies: &[AssembledBody], vertex_count: usize) -> Result<Grid> {
    let (mut tets, mut regions, mut numbers) = (Vec::new(), Vec::new(), Vec::new());
    for (number, body) in (0..).zip(bodies) {
        let first = body.vertices.start as u32;
        tets.extend(body.mesh.tets().iter().map(|tet| tet.map(|v| v + first)));
        regions.extend_from_slice(body.mesh.regions());
        numbers.resize(tets.len(), number);
    }
    let stays = vec![Array::integers("region", &regions), Array::integers("body", &numbers)];
    Ok(Grid::of_tets(vertex_count, &tets, stays)?)
}

impl Surfaces {
    fn of(bodies: &[AssembledBody]) -> Result<Self> {
        let rest = rest_surface(bodies);
        let grid = Grid::of_triangles(rest.vertices.len(), &rest.triangles, Vec::new())?;
        Ok(Self { bodies: bodies.to_vec(), rest, grid })
    }

    fn write<S: Real>(&self, out: &OutputFolder, name: &str, positions: &[Vec3<S>]) -> Result<()> {
        let moved = deformed_vertices(&self.bodies, positions);
        let displacements = displacements(&moved, &self.rest.vertices);
        let point_data = [Array::vectors("displacement [m]", &displacements)];
        out.write_parts(name, &self.grid.frame(&moved, &point_data, &[])?)
    }
}

fn displacements<S: Real>(positions: &[Vec3<S>], rest: &[Vec3<S>]) -> Vec<Vec3<f64>> {
    let pairs = positions.iter().zip(rest);
    pairs.map(|(x, rest)| x.cast::<f64>() - rest.cast()).collect()
}

/// Removes an earlier run's results, so that no file of it is taken for one of this run. The lists
/// go first: they never name a frame that is gone.
fn clear(out: &OutputFolder) -> Result<()> {
    for name in [
        "tissue.pvd",
        "surface.pvd",
        "summary.json",
        "final.vtu",
        "final_surface.obj",
        "picture.png",
        "motion.gif",
    ] {
        out.remove(name)?;
    }
    out.clear(FOLDER, &["tets_", "surface_"], ".vtu")
}

/// Vertices [m] of all bodies' surfaces, where those of the tetrahedra are at these positions [m].
pub fn deformed_vertices<S: Real>(
    bodies: &[AssembledBody],
    positions: &[Vec3<S>],
) -> Vec<Vec3<f64>> {
    let mut all = Vec::new();
    for body in bodies {
        let mut moved = vec![Vec3::ZERO; body.surface.vertices.len()];
        let bound = body.embedding.apply(&positions[body.vertices.clone()], &mut moved);
        // The embedding was made for these very arrays.
        debug_assert!(bound.is_ok(), "{bound:?}");
        all.extend(moved.iter().map(|x| x.cast::<f64>()));
    }
    all
}

/// All bodies' surfaces at rest.
pub fn rest_surface(bodies: &[AssembledBody]) -> SurfaceMesh {
    let mut all = SurfaceMesh::default();
    for body in bodies {
        let first = all.vertices.len() as u32;
        all.vertices.extend_from_slice(&body.surface.vertices);
        all.triangles.extend(body.surface.triangles.iter().map(|t| t.map(|v| v + first)));
    }
    all
}
