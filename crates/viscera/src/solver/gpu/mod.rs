//! The GPU backend: the stages of a plan as dispatches of one submission.
//!
//! ```text
//! GpuSolver::new      constants, buffers and kernels onto the device; stages written down as dispatches
//! GpuSolver::step     inputs and constants of the step, one compute pass, one submission; no waiting
//! GpuSolver::request  copies what moves into memory that the host can read, behind the last step
//! GpuSolver::newest   the newest copy that has arrived, if any; never waits
//! GpuSolver::restart  a new history: multipliers from positions
//! GpuSolver::time_step  the same, timed stage by stage by the device's clock
//! GpuSurface::update  a fine surface behind the last step, ready to be drawn
//! ```
//!
//! The state lives on the device, vertices in the solver's numbering. What decides during a step (step
//! lengths, weights, rejections) lies in one record there, `Control`; nothing is read back inside a step.

mod buffers;
mod copy;
mod cost;
mod device;
mod error;
mod explicit;
mod frames;
mod history;
mod host;
mod inputs;
pub mod kernels;
mod layout;
mod parts;
mod record;
mod record_guard;
mod report;
mod step;
mod surface;
mod switch;
mod timing;

use super::StepError;
use super::cpu::sizes;
use super::explicit::Stability;
use super::plan::{Plan, Stage};
use super::tethers::Bundle;
use crate::model::Model;
use crate::scalar::Vec3;
use crate::settings::{Acceleration, Method, Precision, SolverSettings, Start};
use crate::state::State;
pub use buffers::Slot;
use buffers::{Buffers, Update};
pub use copy::MemoryCopy;
pub use cost::StepCost;
pub use device::{Adapter, Device, baseline, shortfall};
pub use error::GpuError;
use explicit::Hold;
pub use frames::Frame;
use frames::Frames;
pub use host::{HostLayout, host_layouts};
use layout::Layout;
use parts::{Falls, SmallSteps};
use record::{Dispatch, Job, Recorder};
use step::FrameConstants;
pub use surface::{GpuSurface, Skin};
use timing::StageRange;
pub use timing::{StageTime, StepPart, StepTimes};

/// A dispatch ready to be sent.
#[derive(Debug)]
struct Ready {
    pipeline: wgpu::ComputePipeline,
    storage: wgpu::BindGroup,
    /// Where its job lies among the jobs [bytes].
    job: u32,
    groups: [u32; 2],
    /// Whether it forgets the accelerations' past.
    starts_acceleration: bool,
}

/// Jobs lie this far apart [bytes]: the alignment that devices may ask of an offset.
const JOB_STRIDE: u64 = 256;

/// The most workgroups along one axis in the baseline.
const MOST_GROUPS: u32 = 65_535;

/// Anderson's window, within what kernels have room for.
fn window(settings: &SolverSettings) -> u32 {
    settings.anderson_window.clamp(1, super::acceleration::LARGEST_WINDOW as u32)
}

/// Threads of a workgroup that sums products of long vectors.
const SUM_THREADS: u32 = 128;

/// Whether there is anything to accelerate, and it is asked for.
fn accelerates(settings: &SolverSettings) -> bool {
    settings.method == Method::Xpbd && settings.acceleration != Acceleration::None
}

/// A solver for one model on a graphics processor, in single precision.
#[derive(Debug)]
pub struct GpuSolver {
    device: Device,
    settings: SolverSettings,
    plan: Plan,
    buffers: Buffers,
    uniforms: wgpu::BindGroup,
    frame: wgpu::Buffer,
    jobs: wgpu::Buffer,
    /// What the model's sizes were.
    sizes: [usize; 11],
    ready: [Vec<Ready>; 3],
    /// Which of them belong to which stage.
    stages: [Vec<StageRange>; 3],
    stage_starts: [Vec<usize>; 2],
    restart: Vec<Ready>,
    frames: Frames,
    /// What the device's multipliers belong to [s]; zero before the first step.
    multiplier_dt: f64,
    /// Vertices that the last step pulled or held, the solver's numbers.
    touched: Vec<u32>,
    updates: Vec<Update>,
    /// Where each vertex stands in `updates`; `u32::MAX` for nowhere.
    update_of: Vec<u32>,
    /// Connected parts of the model.
    part_count: usize,
    /// The step [s] that the norm's weights on the device belong to.
    weights_dt: f64,
    /// Whether the device's anchors may be elsewhere than at rest.
    has_moved_anchors: bool,
    /// Of the explicit method: its small steps, and the attachments vertex by vertex.
    stability: Stability,
    /// Springs to places outside in the last step.
    tethers: Vec<Bundle<f32>>,
    holds: Vec<Hold>,
    small_steps: Vec<SmallSteps>,
    /// What nothing holds starts otherwise, where that is asked for.
    falls: Option<Falls>,
}

impl GpuSolver {
    /// Puts a model onto the device, at rest, and plans its steps.
    pub fn new(
        device: &Device,
        model: &Model<f32>,
        settings: &SolverSettings,
    ) -> Result<Self, GpuError> {
        Self::with_memory(device, model, settings, &[])
    }

    /// As [`GpuSolver::new`], with memory that held something before, for a test that nothing of it is
    /// ever read.
    #[doc(hidden)]
    pub fn on_used_memory(
        device: &Device,
        model: &Model<f32>,
        settings: &SolverSettings,
        left_over: f32,
    ) -> Result<Self, GpuError> {
        Self::with_memory(device, model, settings, &left_over.to_ne_bytes())
    }

    fn with_memory(
        device: &Device,
        model: &Model<f32>,
        settings: &SolverSettings,
        left_over: &[u8],
    ) -> Result<Self, GpuError> {
        if settings.precision == Precision::F64 {
            return Err(GpuError::DoublePrecision);
        }
        device.check()?;
        // Sizes are compared array by array, below.
        let wgpu::Limits { max_storage_buffer_binding_size, max_buffer_size, .. } = baseline();
        let own = device.limits();
        let own = wgpu::Limits { max_storage_buffer_binding_size, max_buffer_size, ..own };
        if let Some(lacking) = shortfall(&own) {
            return Err(GpuError::BelowBaseline { name: device.name().to_owned(), lacking });
        }
        let plan = Plan::new(model, settings);
        let layout = Layout::new(model, settings);
        let buffers = Buffers::new(device, model, settings, &layout, left_over)?;
        let vector = [buffers.length, (buffers.multipliers_start / 4) as u32];
        let record = Recorder::new(model, settings, &plan, vector, layout.pieces()).record(&plan);
        let lists = [record.prologue, record.body, record.epilogue, record.restart];
        let wgpu = &device.device;
        let make = |label, size, usage| {
            wgpu.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage: usage | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let job_count = lists.iter().map(Vec::len).sum::<usize>() as u64;
        let uniform = wgpu::BufferUsages::UNIFORM;
        let jobs = make("jobs", JOB_STRIDE * job_count.max(1), uniform);
        let frame = make("frame", size_of::<FrameConstants>() as u64, uniform);
        let uniforms = wgpu.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("job and frame"),
            layout: &kernels::uniform_layout(wgpu),
            entries: &[
                wgpu::BindGroupEntry {
                    binding: 0,
                    resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                        buffer: &jobs,
                        offset: 0,
                        size: std::num::NonZero::new(size_of::<Job>() as u64),
                    }),
                },
                wgpu::BindGroupEntry { binding: 1, resource: frame.as_entire_binding() },
            ],
        });
        let mut next = 0;
        let [prologue, body, epilogue, restart] = lists.map(|list| {
            let prepare = |dispatch: &Dispatch| {
                let offset = next;
                next += JOB_STRIDE;
                device.queue.write_buffer(&jobs, offset, bytemuck::bytes_of(&dispatch.job));
                prepare(device, &buffers, dispatch, offset as u32)
            };
            list.iter().map(prepare).collect()
        });
        let is_explicit = settings.method == Method::Explicit;
        let mut solver = Self {
            frames: Frames::new(&buffers),
            weights_dt: 0.0,
            device: device.clone(),
            settings: settings.clone(),
            falls: plan.prologue.contains(&Stage::Predict(Start::Auto)).then(|| Falls::new(model)),
            plan,
            uniforms,
            frame,
            jobs,
            sizes: sizes(model).map(|(_, size)| size),
            ready: [prologue, body, epilogue],
            stages: record.stages,
            stage_starts: record.stage_starts,
            restart,
            multiplier_dt: 0.0,
            touched: Vec::new(),
            part_count: model.part_count(),
            updates: Vec::new(),
            update_of: vec![u32::MAX; model.vertex_count()],
            has_moved_anchors: true,
            stability: Stability::new(is_explicit.then_some(model), settings),
            tethers: Vec::new(),
            holds: if is_explicit { Hold::all(model) } else { Vec::new() },
            small_steps: vec![
                SmallSteps::default();
                if is_explicit { model.part_count() } else { 0 }
            ],
            buffers,
        };
        solver.upload_constants(model);
        let rest = State::at_rest(model);
        solver.put(model, &rest);
        // Its memory may have been too little.
        solver.device.check()?;
        Ok(solver)
    }

    /// The settings in force.
    pub fn settings(&self) -> &SolverSettings {
        &self.settings
    }

    /// The stages of a step.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The largest small step [s] of the explicit method, its margin included; infinite for others.
    pub fn stable_step(&self) -> f64 {
        self.stability.step
    }

    /// The device it works on.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Dispatches of a step: once before the iterations, in each of them, and once after.
    pub fn dispatches(&self) -> [usize; 3] {
        [0, 1, 2].map(|list| self.ready[list].len())
    }

    /// The same of a solver that is not built, and needs no device: how many passes over the mesh, one after
    /// the other, an iteration is.
    pub fn dispatches_of(model: &Model<f32>, settings: &SolverSettings) -> [usize; 3] {
        let plan = Plan::new(model, settings);
        let layout = Layout::new(model, settings);
        let multipliers = 4 * model.vertex_count() as u32;
        let vector = [multipliers + model.multiplier_count as u32, multipliers];
        let record = Recorder::new(model, settings, &plan, vector, layout.pieces()).record(&plan);
        [record.prologue, record.body, record.epilogue].map(|list| list.len())
    }

    /// Iterations of the steps to come, at least one; neither stages nor memory depend on them.
    pub fn set_iterations(&mut self, count: u32) {
        self.settings.iterations = count.max(1);
        if self.settings.method == Method::Xpbd {
            self.plan.repeat = self.settings.iterations;
        }
    }

    /// About how many tetrahedra of meshes like this one, solved like this, a device with these limits
    /// takes: as many as its largest array fits into a binding.
    pub fn largest_mesh(&self, model: &Model<f32>, limits: &wgpu::Limits) -> u64 {
        let limit = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        (model.tet_count() as f64 * limit as f64 / self.buffers.largest() as f64) as u64
    }

    /// Bytes of device memory.
    pub fn bytes(&self) -> u64 {
        self.buffers.bytes() + self.jobs.size() + self.frames.bytes()
    }

    /// Positions [m] as four floats a vertex, of which the last does not count, in the solver's
    /// numbering ([`GpuSolver::vertex_order`]): to be drawn without a copy. The first
    /// `16 * vertex_count` bytes count.
    pub fn positions(&self) -> &wgpu::Buffer {
        self.buffers.buffer(Slot::Unknowns)
    }

    /// The user's number of each vertex of [`GpuSolver::positions`].
    pub fn vertex_order(model: &Model<f32>) -> &[u32] {
        &model.numbering.order
    }

    /// Puts a state onto the device.
    pub fn write(&mut self, model: &Model<f32>, state: &State<f32>) -> Result<(), StepError> {
        self.check_model(model)?;
        super::check_state(model, state)?;
        self.put(model, state);
        Ok(())
    }

    /// The model is one of the same shape as that which lies on the device.
    pub(super) fn check_model(&self, model: &Model<f32>) -> Result<(), StepError> {
        for (given, (what, expected)) in self.sizes.into_iter().zip(sizes(model)) {
            if given != expected {
                return Err(StepError::Mismatch { what, given, expected });
            }
        }
        Ok(())
    }

    fn put(&mut self, model: &Model<f32>, state: &State<f32>) {
        let places = in_solver_order(model, &state.positions);
        let mut unknowns = vec![0.0f32; self.buffers.length as usize];
        let (positions, multipliers) =
            unknowns.split_at_mut((self.buffers.multipliers_start / 4) as usize);
        positions[..4 * places.len()].copy_from_slice(places.as_flattened());
        multipliers[..state.multipliers.len()].copy_from_slice(&state.multipliers);
        let bytes = bytemuck::cast_slice(&unknowns);
        self.buffers.write(&self.device.queue, Slot::Unknowns, bytes);
        self.write_velocities(model, &state.velocities);
        self.multiplier_dt = state.multiplier_dt;
    }

    /// Puts velocities [m/s], the user's order, in the place of those on the device.
    pub(crate) fn write_velocities(&self, model: &Model<f32>, velocities: &[Vec3<f32>]) {
        let sorted = in_solver_order(model, velocities);
        let bytes = bytemuck::cast_slice(&sorted);
        self.buffers.write(&self.device.queue, Slot::Velocities, bytes);
    }

    /// What each vertex is made of: mass, inverse mass, number of copies, stiffness of its attachments.
    fn upload_constants(&self, model: &Model<f32>) {
        let order = &model.numbering.order;
        let masses: Vec<f32> = order.iter().map(|&v| model.masses[v as usize]).collect();
        let with_w = |w: &dyn Fn(usize) -> f32| -> Vec<[f32; 4]> {
            (0..order.len()).map(|v| [0.0, 0.0, 0.0, w(v)]).collect()
        };
        let copies = |v: usize| (model.copy_offsets[v + 1] - model.copy_offsets[v]) as f32;
        let control = vec![0u8; report::control_size(model.part_count()) as usize];
        self.device.queue.write_buffer(self.buffers.buffer(Slot::Control), 0, &control);
        let mut stiffness = vec![0.0; order.len()];
        for hold in &self.holds {
            stiffness[hold.vertex as usize] = hold.stiffness as f32;
        }
        for (slot, values) in [
            (Slot::Predicted, with_w(&|v| masses[v])),
            (Slot::Acting, with_w(&|v| 1.0 / masses[v])),
            (Slot::Previous, with_w(&copies)),
            (Slot::Targets, with_w(&|v| stiffness[v])),
        ] {
            self.buffers.write(&self.device.queue, slot, bytemuck::cast_slice(&values));
        }
    }
}

fn in_solver_order(model: &Model<f32>, values: &[Vec3<f32>]) -> Vec<[f32; 4]> {
    let order = model.numbering.order.iter();
    order.map(|&v| values[v as usize].to_array()).map(|[x, y, z]| [x, y, z, 0.0]).collect()
}

fn prepare(device: &Device, buffers: &Buffers, dispatch: &Dispatch, job: u32) -> Ready {
    let made = kernels::pipeline(device, dispatch.kernel, dispatch.variant);
    let entries: Vec<_> = (dispatch.kernel.slots.iter().zip(dispatch.places()))
        .map(|(&slot, place)| wgpu::BindGroupEntry {
            binding: slot as u32,
            resource: wgpu::BindingResource::Buffer(buffers.bound(place)),
        })
        .collect();
    let storage = device.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some(dispatch.kernel.entry),
        layout: &made.storage,
        entries: &entries,
    });
    let along = dispatch.groups.min(MOST_GROUPS);
    let groups = [along, dispatch.groups.div_ceil(along.max(1))];
    let starts_acceleration = *dispatch.kernel == kernels::APPLY_UPDATES;
    Ready { pipeline: made.pipeline, storage, job, groups, starts_acceleration }
}
