//! One scene in motion, or two beside each other, with the hands on it.

use viscera::material::PRESETS;
use viscera::scalar::Vec3;
use viscera::scene::{BodyShape, Instrument, Scene};
use viscera::solver::FrameReading;
use viscera::solver::gpu::Device;
use viscera_render::Orbit;
use viscera_stage::{
    Coloring, ForceScale, GripTarget, HandId, HoldId, Instruments, Legend, Run, RunSnapshot,
    Settings, ToolAct, build,
};

use crate::catalog::law_name;
use crate::holds::Hand;
use crate::loaded::{LoadRequest, Loaded};
use crate::report::{BodyReport, LoadedReport, Report, RunReport};

/// The largest mesh that a page takes [tetrahedra].
pub const MOST_TETS: usize = 100_000;

/// The largest file that a page takes [bytes]: text of a mesh of some hundred thousand tetrahedra.
pub const MOST_FILE_BYTES: u64 = 64 << 20;

/// How hands take hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grip {
    /// How many vertices.
    pub count: u32,
    /// Total stiffness [N/m] of the springs between hand and tissue; rigidly where there is none.
    pub stiffness: Option<f64>,
}

impl Default for Grip {
    /// So stiff that the tissue stays within 2 mm of the finger up to 10 N.
    fn default() -> Self {
        Self { count: 8, stiffness: Some(5000.0) }
    }
}

/// Something that a hand does.
#[derive(Clone, Debug)]
pub(crate) enum Act {
    Take(HoldId, GripTarget),
    Lead(HoldId, Vec3<f64>),
    LetGo(HoldId),
    Tool(ToolAct),
}

/// A simulation, what it looks like, and what waits for its frame under way.
pub(crate) struct RunState {
    pub(crate) run: Box<dyn Run>,
    pub snapshot: RunSnapshot,
    /// Of the snapshot: each has another number.
    pub moved: u64,
    frame: u64,
    pub(crate) waiting: Vec<Act>,
    /// Hands that could not take an instrument, and why.
    pub(crate) refused: Vec<(HandId, String)>,
    /// Whether the next frame is to be measured, the one under way is, and any was.
    measures: [bool; 3],
}

/// See the module.
pub struct Session {
    device: Option<Device>,
    pub(crate) loaded: Option<Loaded>,
    pub(crate) runs: Vec<RunState>,
    pub(crate) hands: Vec<Hand>,
    pub(crate) grip: Grip,
    pub(crate) coloring: Coloring,
    pub(crate) legend: Legend,
    pub(crate) force_scale: ForceScale,
    pub(crate) wireframe: bool,
    pub(crate) dark: bool,
    pub(crate) orbit: Orbit,
    pub(crate) extent: f64,
    /// The middle of things at rest [m].
    pub(crate) middle: Vec3<f64>,
    /// Instruments that can be taken, and those that are in hands.
    pub(crate) tray: Vec<Instrument>,
    pub(crate) instruments: Instruments,
    pub(crate) told: Option<String>,
    /// Width and height [pixels].
    pub(crate) size: [u32; 2],
    count: u64,
    /// Scenes loaded so far.
    pub(crate) generation: u64,
}

impl Session {
    /// Without a scene; on a device, where there is one, for pictures and for settings that ask for it.
    pub fn new(device: Option<Device>) -> Self {
        Self {
            device,
            loaded: None,
            runs: Vec::new(),
            hands: Vec::new(),
            grip: Grip::default(),
            coloring: Coloring::Plain,
            legend: Legend::default(),
            force_scale: ForceScale::default(),
            wireframe: false,
            dark: false,
            orbit: Orbit::framing(&[]),
            extent: 0.1,
            middle: Vec3::ZERO,
            // The tray is part of the program, which tests read.
            tray: viscera_stage::tray().unwrap_or_default(),
            instruments: Instruments::default(),
            told: None,
            size: [640, 480],
            count: 0,
            generation: 0,
        }
    }

    /// The device, where there is one.
    pub fn device(&self) -> Option<&Device> {
        self.device.as_ref()
    }

    /// Another device, or none, in the place of one that was lost: every simulation goes on from its last frame.
    pub fn put_device(&mut self, device: Option<Device>) -> Result<(), String> {
        self.device = device;
        for state in &mut self.runs {
            state.run.offer(self.device.as_ref())?;
            state.act_out()?;
        }
        self.look()
    }

    /// Loads a scene and begins from rest; `load` gives the bytes of its files, `balance` is what the module for files has found
    /// for it. On an error what ran before goes on.
    pub fn load(
        &mut self,
        request: &LoadRequest,
        load: &mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
        balance: Option<&[u8]>,
    ) -> Result<(), String> {
        let loaded = Loaded::new(request, load, balance)?;
        let run = self.build(&loaded.scene, &loaded)?;
        let known = self.loaded.as_ref().is_some_and(|old| same_place(old, &loaded));
        self.runs = vec![RunState::new(run)];
        self.hands.clear();
        self.instruments.clear();
        self.force_scale = ForceScale::default();
        self.generation += 1;
        if loaded.assembly.sags() {
            let why = "Tissue that rests under gravity as it is sags at first: its shape without gravity is known for other settings.";
            self.told = Some(why.into());
        }
        self.loaded = Some(loaded);
        if !known {
            self.home();
        }
        self.look()
    }

    fn build(&self, scene: &Scene, loaded: &Loaded) -> Result<Box<dyn Run>, String> {
        build(scene.clone(), loaded.assembly.clone(), self.device.as_ref())
    }

    /// What was loaded; nothing before that.
    pub fn loaded(&self) -> Option<LoadedReport> {
        let (loaded, run) = (self.loaded.as_ref()?, self.runs.first()?);
        let [tets, vertices] = loaded.counts();
        let scene = run.run.scene();
        let body = |body: &viscera::scene::Body| {
            let material = &body.material;
            let (young, poisson, density) =
                (material.young(), material.poisson(), material.density());
            let is_it = |preset: &&viscera::material::Preset| {
                (preset.young, preset.poisson, preset.density) == (young, poisson, density)
            };
            let preset = PRESETS.iter().find(is_it).map(|preset| preset.name);
            BodyReport { name: body.name.clone(), young, poisson, density, preset }
        };
        Some(LoadedReport {
            name: scene.name.clone(),
            title: scene.title.clone(),
            tets,
            vertices,
            frame: scene.time.frame,
            bodies: scene.bodies.iter().map(body).collect(),
            mesh: loaded.mesh,
            can_change_mesh: loaded.can_change_mesh,
        })
    }

    fn state(&mut self, run: usize) -> Result<&mut RunState, String> {
        let count = self.runs.len();
        self.runs.get_mut(run).ok_or_else(|| match count {
            0 => "no scene is loaded; call load first".to_owned(),
            _ => format!("there is no run {run}; there are {count}, numbered from 0"),
        })
    }

    /// Changes settings of a simulation, as `--set` of `viscera run`; where one is wrong, none.
    pub fn set(&mut self, run: usize, settings: &Settings) -> Result<(), String> {
        let state = self.state(run)?;
        state.run.change(settings)?;
        state.act_out()?;
        self.look()
    }

    /// A setting as it stands: of the solver, or a material's.
    pub fn setting(&mut self, run: usize, key: &str) -> Result<String, String> {
        let state = self.state(run)?;
        if let Some(value) = state.run.setting(key) {
            return Ok(value.trim_matches('"').to_owned());
        }
        if key == "world.gravity" {
            let [x, y, z] = state.run.scene().world.gravity.to_array();
            return Ok(format!("[\"{x} m/s^2\", \"{y} m/s^2\", \"{z} m/s^2\"]"));
        }
        let unknown = || {
            format!(
                "{key} is no setting that can be asked for; solver.KEY, body.NAME.material.KEY and world.gravity can"
            )
        };
        let steps: Vec<&str> = key.split('.').collect();
        let ["body", name, "material", key] = steps.as_slice() else { return Err(unknown()) };
        let bodies = &state.run.scene().bodies;
        let body = bodies.iter().find(|body| body.name == *name).ok_or_else(unknown)?;
        let material = &body.material;
        Ok(match *key {
            "young" => format!("{} Pa", material.young()),
            "poisson" => material.poisson().to_string(),
            "density" => format!("{} kg/m^3", material.density()),
            "viscosity" => format!("{} s", material.viscosity()),
            "model" => law_name(material.model()).to_owned(),
            _ => return Err(unknown()),
        })
    }

    /// Begins from rest again, with the settings as they are now.
    pub fn reset(&mut self) -> Result<(), String> {
        self.hands.clear();
        self.instruments.clear();
        self.force_scale = ForceScale::default();
        for state in &mut self.runs {
            state.run.reset()?;
            state.waiting.clear();
            state.frame = 0;
            state.measures = [false; 3];
        }
        // What was set since is how it begins now.
        if let (Some(loaded), Some(state)) = (&mut self.loaded, self.runs.first()) {
            loaded.scene = state.run.scene().clone();
        }
        self.look()
    }

    /// Puts a second simulation beside the first, which begins where that is, with settings of its own; nothing leaves the
    /// first alone.
    pub fn beside(&mut self, settings: Option<&Settings>) -> Result<(), String> {
        self.runs.truncate(1);
        self.hands.retain(|hand| hand.run == 0);
        if let Some(settings) = settings {
            let first = self.state(0)?;
            let mut scene = first.run.scene().clone();
            scene.change(settings).map_err(|error| error.to_string())?;
            let fork = first.run.fork(&scene)?;
            let frame = first.frame;
            self.runs.push(RunState { frame, ..RunState::new(fork) });
        }
        self.look()
    }

    /// How many simulations there are.
    pub fn run_count(&self) -> usize {
        self.runs.len()
    }

    /// Takes over frames that have arrived; false while any is under way.
    pub fn ready(&mut self) -> Result<bool, String> {
        // Until there is another device nothing arrives.
        if self.lost().is_some() {
            return Ok(!self.runs.iter().any(|state| state.run.is_under_way()));
        }
        let mut ready = true;
        for number in 0..self.runs.len() {
            ready &= self.take_over(number)?;
        }
        Ok(ready)
    }

    /// Why the device is lost; nothing while it is there.
    pub fn lost(&self) -> Option<String> {
        self.device.as_ref().and_then(|device| device.check().err()).map(|lost| lost.to_string())
    }

    /// Begins a frame of one simulation. The CPU has computed it then; a device is asked by [`Session::ready`]. Nothing
    /// happens while one is under way.
    pub fn advance(&mut self, run: usize) -> Result<(), String> {
        // What tools touch comes with the balance.
        let shows_touches = self.coloring == Coloring::Pressure;
        let state = self.state(run)?;
        if state.run.is_under_way() {
            return Ok(());
        }
        let [wanted, ..] = state.measures;
        state.measures = [false, wanted, state.measures[2]];
        let reading = match wanted || shows_touches {
            true => FrameReading::Balance,
            false => FrameReading::State,
        };
        let sent = state.run.send(reading);
        self.unless_lost(sent)?;
        self.take_over(run).map(|_| ())
    }

    /// What came of a frame; nothing where the device is lost, which [`Session::lost`] says: it is computed again on the next.
    fn unless_lost<T>(&self, result: Result<T, String>) -> Result<Option<T>, String> {
        match result {
            Err(_) if self.lost().is_some() => Ok(None),
            other => other.map(Some),
        }
    }

    /// Takes over the frame of one simulation; false while it is under way.
    fn take_over(&mut self, run: usize) -> Result<bool, String> {
        let state = self.state(run)?;
        if !state.run.is_under_way() {
            return Ok(true);
        }
        let received = state.run.receive();
        if self.unless_lost(received)? != Some(true) {
            return Ok(false);
        }
        let state = self.state(run)?;
        state.frame += 1;
        if std::mem::take(&mut state.measures[1]) {
            state.run.measure()?;
            state.measures[2] = true;
        }
        state.act_out()?;
        self.drop_refused();
        self.look_at(run);
        Ok(true)
    }

    /// Brings measures up to date: those of the next frame.
    pub fn measure(&mut self) {
        for state in &mut self.runs {
            state.measures[0] = true;
        }
    }

    /// Numbers of now.
    pub fn report(&self) -> Report {
        let frame = self.runs.first().map_or(0, |state| state.frame);
        let duration = self.loaded.as_ref().map_or(0.0, |loaded| loaded.scene.time.frame);
        let of = |state: &RunState| RunReport::new(&*state.run, &state.snapshot, state.measures[2]);
        Report { time: frame as f64 * duration, frame, runs: self.runs.iter().map(of).collect() }
    }

    /// The first simulation as a scene file that repeats everything done by hand since it began.
    pub fn replay(&self) -> Result<String, String> {
        let (Some(loaded), Some(state)) = (&self.loaded, self.runs.first()) else {
            return Err("no scene is loaded; call load first".to_owned());
        };
        Ok(loaded.scene.text() + &state.run.done_by_hand().0)
    }

    /// Sweeps, dispatches and multipliers of a frame of the first simulation by XPBD, were it on a graphics processor; nothing
    /// where it has another method.
    pub fn frame_cost(&self) -> Option<[u64; 3]> {
        let (state, loaded) = (self.runs.first()?, self.loaded.as_ref()?);
        let settings = state.run.solver();
        if settings.method != viscera::settings::Method::Xpbd {
            return None;
        }
        let model = loaded.assembly.builder.build::<f32>().ok()?;
        let [before, each, after] =
            viscera::solver::gpu::GpuSolver::dispatches_of(&model, settings);
        let (steps, sweeps) = (u64::from(settings.substeps()), u64::from(settings.iterations()));
        let dispatches = before as u64 + sweeps * each as u64 + after as u64;
        let layout = viscera::layout::Layout::new(&model, settings);
        Some([steps * sweeps, steps * dispatches, layout.multiplier_count as u64])
    }

    /// The surface's vertices [m] of one simulation.
    pub fn surface(&self, run: usize) -> Result<Vec<Vec3<f32>>, String> {
        let mut surface = Vec::new();
        if let Some(loaded) = &self.loaded {
            loaded.surfaces(self.vertices(run)?, &mut surface);
        }
        Ok(surface)
    }

    /// The tetrahedra's vertices [m] of one simulation, the mesh's order.
    pub fn vertices(&self, run: usize) -> Result<&[Vec3<f32>], String> {
        let state = self.runs.get(run).ok_or_else(|| format!("there is no run {run}"))?;
        Ok(&state.snapshot.positions)
    }

    /// Triangles of the surface.
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        self.loaded.as_ref().map_or_else(Vec::new, Loaded::triangles)
    }

    /// Looks at all simulations as they are now.
    pub(crate) fn look(&mut self) -> Result<(), String> {
        (0..self.runs.len()).for_each(|number| self.look_at(number));
        Ok(())
    }

    fn look_at(&mut self, number: usize) {
        self.count += 1;
        if let Some(state) = self.runs.get_mut(number) {
            state.run.fill(self.coloring, self.device.as_ref(), &mut state.snapshot);
            state.moved = self.count;
            self.force_scale.follow(&state.snapshot.tools);
        }
        let values = self.runs.iter().flat_map(|state| state.snapshot.values.iter().copied());
        self.legend.follow(self.coloring, values);
    }
}

impl RunState {
    fn new(run: Box<dyn Run>) -> Self {
        let snapshot = RunSnapshot::default();
        let (waiting, refused) = (Vec::new(), Vec::new());
        Self { run, snapshot, moved: 0, frame: 0, waiting, refused, measures: [false; 3] }
    }

    /// Does what hands wanted while a frame was under way: between frames, as a replay will.
    pub(crate) fn act_out(&mut self) -> Result<(), String> {
        if self.run.is_under_way() {
            return Ok(());
        }
        for act in self.waiting.drain(..) {
            match act {
                Act::Take(id, target) => self.run.take(id, &target)?,
                Act::Lead(id, way) => self.run.lead(id, way)?,
                Act::LetGo(id) => self.run.let_go(id)?,
                Act::Tool(act) => {
                    let done = self.run.act(&act);
                    if let Err(message) = done {
                        if !act.is_taking() {
                            return Err(message);
                        }
                        self.refused.push((act.hand(), message));
                    }
                }
            }
        }
        Ok(())
    }
}

/// Whether both fill the same place: the camera stays where it is then.
fn same_place(old: &Loaded, new: &Loaded) -> bool {
    let shapes = |scene: &Scene| -> Vec<(String, Option<BodyShape>)> {
        let of_file = |shape: &BodyShape| matches!(shape, BodyShape::File { .. });
        let shape = |body: &viscera::scene::Body| {
            (body.name.clone(), Some(body.shape.clone()).filter(of_file))
        };
        scene.bodies.iter().map(shape).collect()
    };
    old.scene.name == new.scene.name && shapes(&old.scene) == shapes(&new.scene)
}
