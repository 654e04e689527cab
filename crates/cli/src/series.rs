//! The time series of a run: one VTU file per written frame and a PVD file that lists them. A thread of its own
//! measures, packs and writes frames while the next ones are simulated.

use crate::output::OutputFolder;
use anyhow::{Result, bail};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};
use viscera::mesh::SurfaceMesh;
use viscera::mesh::io::{obj, pvd};
use viscera::model::Model;
use viscera::scalar::{Real, Vec3};
use viscera::simulation::{Simulation, SurfaceFiles, TissueFiles};

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
    tissue: TissueFiles<S>,
    writes_tets: bool,
    /// Nothing where none are asked for.
    surface: Option<SurfaceFiles>,
}

impl<S: Real> Written<S> {
    fn new(out: &OutputFolder, simulation: &Simulation<S>) -> Result<Self> {
        let (model, assembly) = (simulation.model(), simulation.assembly());
        let output = &simulation.scene().output;
        let has_surface =
            output.surface && assembly.bodies.iter().any(|body| body.has_fine_surface);
        Ok(Self {
            out: out.clone(),
            tets: Vec::new(),
            surfaces: Vec::new(),
            listed: None,
            tissue: TissueFiles::new(assembly, model)?,
            writes_tets: output.tets,
            surface: has_surface.then(|| SurfaceFiles::new(assembly)).transpose()?,
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
            let file = self.tissue.file(&frame.model, &frame.positions, &frame.velocities)?;
            self.out.write_parts(&name, &file)?;
            self.tets.push((frame.time, name));
        }
        if let Some(surface) = &self.surface {
            let name = format!("{FOLDER}/surface_{:06}.vtu", frame.number);
            self.out.write_parts(&name, &surface.file(&frame.positions)?)?;
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
        let file = self.tissue.file(model, &state.positions, &state.velocities)?;
        self.out.write_parts("final.vtu", &file)?;
        if simulation.scene().output.surface {
            let assembly = simulation.assembly();
            let triangles = assembly.rest_surface().triangles;
            let vertices = assembly.deformed_surface(&state.positions);
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
}

/// What the name of a frame says.
fn is_frame(name: &str) -> bool {
    let number = ["tets_", "surface_"].iter().find_map(|prefix| name.strip_prefix(prefix));
    let number = number.and_then(|rest| rest.strip_suffix(".vtu"));
    number.is_some_and(|n| n.len() >= 6 && n.bytes().all(|digit| digit.is_ascii_digit()))
}

/// Frames in the folder that a run wrote, and others of such names. A run that was killed leaves the file that it was writing.
fn frames_there(out: &OutputFolder) -> (Vec<String>, Vec<String>) {
    // Of every frame, and near its start.
    const MARK: &[u8] = b"Name=\"displacement [m]\"";
    let mut names = out.names(FOLDER);
    names.retain(|name| is_frame(name.trim_end_matches(".part")));
    names.into_iter().map(|name| format!("{FOLDER}/{name}")).partition(|name| {
        let start = out.start_of(name, 4096);
        let is_begun = name.ends_with(".part") && start.is_empty();
        is_begun || start.windows(MARK.len()).any(|window| window == MARK)
    })
}

/// Removes an earlier run's results, so that no file of it is taken for one of this run, and nothing else. The lists
/// go first: they never name a frame that is gone.
fn clear(out: &OutputFolder) -> Result<()> {
    let (frames, others) = frames_there(out);
    if let Some(other) = others.first() {
        bail!(
            "{}: no run of viscera wrote this file, and this one might write over it; choose another folder with --out",
            out.path().join(other).display()
        );
    }
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
    frames.iter().try_for_each(|name| out.remove(name))
}
