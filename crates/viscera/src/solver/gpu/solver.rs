//! The solver of one model on a graphics processor: its memory and kernels.

use super::bindings::Uniforms;
use super::buffers::Buffers;
use super::control;
use super::device::{Device, baseline, shortfall};
use super::error::GpuError;
use super::kernels;
use super::layout::DeviceLayout;
use super::limits::{JOB_STRIDE, MOST_GROUPS};
use super::outgoing::{Outgoing, Ready};
use super::parts::{Falls, SmallSteps};
use super::pipelines::pipeline;
use super::reading::Sent;
use super::record::{Dispatch, Recorder};
use super::ring::Frames;
use super::shown::{self, OfValues};
use super::slots::{Slot, Update};
use super::stages::StageRange;
use super::tools::OfTools;
use super::traffic::Recorded;
use bytemuck::Zeroable;
use std::sync::Arc;

use crate::layout::Layout;
use crate::model::Model;
use crate::scalar::Vec3;
use crate::settings::{Count, Elements, Method, Precision, SolverSettings, Start};
use crate::solver::error::StepError;
use crate::solver::explicit::Stability;
use crate::solver::inputs::{check_model, check_settings};
use crate::solver::plan::{Plan, Stage, StepStage};
use crate::solver::quasi_newton::on_device::{self, DeviceLevels};
use crate::solver::quasi_newton::progress::PartProgress;
use crate::solver::step::contacts::meetings::Meetings;
use crate::solver::step::contacts::on_device::{ALL_SUMS, Samples};
use crate::solver::step::recovered;
use crate::solver::step::tethers::Bundle;
use crate::state::State;

/// A solver for one model on a graphics processor, in single precision.
pub struct GpuSolver {
    pub(super) device: Device,
    pub(super) settings: SolverSettings,
    pub(super) plan: Plan,
    pub(super) buffers: Buffers,
    pub(super) uniforms: Uniforms,
    pub(super) tools: OfTools,
    /// Of the surface, where contact is computed.
    pub(super) samples: Option<Samples>,
    /// Of tissue that meets tissue, where that is computed.
    pub(super) meetings: Option<Meetings>,
    /// The model as it lies on the device.
    pub(super) layout: Arc<Layout<f32>>,
    pub(super) ready: [Vec<Ready>; 3],
    /// Which of them belong to which stage.
    pub(super) stages: [Vec<StageRange>; 3],
    pub(super) stage_starts: [Vec<usize>; 2],
    pub(super) restart: Vec<Ready>,
    pub(super) outgoing: Outgoing,
    pub(super) frames: Frames,
    pub(super) forces: Frames,
    pub(super) sent: Sent,
    /// What the device's multipliers belong to [s]; zero before the first step.
    pub(super) multiplier_dt: f64,
    /// Vertices that the last step pulled or held, the solver's numbers.
    pub(super) touched: Vec<u32>,
    /// What acts on vertices in a step, in the step before it, and what of it the device is sent.
    pub(super) updates: Vec<Update>,
    pub(super) updates_before: Vec<Update>,
    pub(super) updates_sent: Vec<Update>,
    /// Where each vertex stands in `updates`; `u32::MAX` for nowhere.
    pub(super) update_of: Vec<u32>,
    /// Connected parts of the layout.
    pub(super) part_count: usize,
    /// The step [s] that the norm's weights on the device belong to.
    pub(super) weights_dt: f64,
    /// Whether the device's anchors may be elsewhere than at rest.
    pub(super) has_moved_anchors: bool,
    /// Of the explicit method: its small steps.
    pub(super) stability: Option<Stability>,
    /// Soft position constraints of the last step.
    pub(super) tethers: Vec<Bundle<f32>>,
    pub(super) small_steps: Vec<SmallSteps>,
    /// What nothing holds starts otherwise, where that is asked for.
    pub(super) falls: Option<Falls>,
    /// Of the quasi-Newton method.
    pub(super) levels: Option<DeviceLevels>,
    /// Of the last step.
    pub(super) passes: u32,
    /// What pictures show.
    pub(super) values: OfValues,
}

/// Short: it holds a whole model.
impl std::fmt::Debug for GpuSolver {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GpuSolver").field("device", &self.device.name()).finish_non_exhaustive()
    }
}

impl GpuSolver {
    /// Puts a model onto the device, at rest, and plans its steps; `method = "auto"` is the quasi-Newton method there.
    pub fn new(
        device: &Device,
        model: &Model<f32>,
        settings: &SolverSettings,
    ) -> Result<Self, GpuError> {
        Self::with_memory(device, model, &settings.chosen_on_device(), &[])
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
        let settings = &settings.chosen_on_device();
        Self::with_memory(device, model, settings, &left_over.to_ne_bytes())
    }

    fn with_memory(
        device: &Device,
        model: &Model<f32>,
        settings: &SolverSettings,
        left_over: &[u8],
    ) -> Result<Self, GpuError> {
        check(device, settings)?;
        device.making(|| Self::made(device, model, settings, left_over))
    }

    fn made(
        device: &Device,
        model: &Model<f32>,
        settings: &SolverSettings,
        left_over: &[u8],
    ) -> Result<Self, GpuError> {
        let laid = Arc::new(Layout::on_device(model, settings));
        let plan = Plan::on_device(&laid, settings);
        let layout = DeviceLayout::new(&laid, settings);
        let (levels, table) = DeviceLevels::new(&laid, settings).unzip();
        let of_levels = levels.as_ref();
        let buffers = Buffers::new(device, &laid, settings, &layout, of_levels, left_over)?;
        let vector = [buffers.length, (buffers.multipliers_start / 4) as u32];
        let (samples, meetings) = (layout.samples, layout.meetings);
        let recorder = Recorder::new(&laid, settings, vector, layout.pieces(), of_levels, samples);
        let record = recorder.record(&plan);
        let lists = [record.prologue, record.body, record.epilogue, record.restart];
        let job_count = lists.iter().map(Vec::len).sum::<usize>() as u64;
        let uniforms = Uniforms::new(device, job_count + shown::JOBS as u64);
        let mut next = 0;
        let [prologue, body, epilogue, restart] = lists.map(|list| {
            let prepare = |dispatch: &Dispatch| {
                let offset = next;
                next += JOB_STRIDE;
                uniforms.put_jobs(device, offset, &[dispatch.job]);
                prepare(device, &buffers, dispatch, offset as u32)
            };
            list.iter().map(prepare).collect()
        });
        uniforms.put_jobs(device, next, &shown::jobs(&laid));
        let is_explicit = settings.method == Method::Explicit;
        let small_steps = if is_explicit { laid.part_count() } else { 0 };
        let mut solver = Self {
            outgoing: Outgoing::new(device),
            frames: Frames::new(buffers.points_size),
            forces: Frames::new(4 * ALL_SUMS as u64),
            sent: Sent::default(),
            weights_dt: 0.0,
            device: device.clone(),
            settings: settings.clone(),
            falls: starts_falling(&plan).then(|| Falls::new(&laid)),
            plan,
            uniforms,
            tools: OfTools::default(),
            samples,
            meetings,
            layout: Arc::clone(&laid),
            ready: [prologue, body, epilogue],
            stages: record.stages,
            stage_starts: record.stage_starts,
            restart,
            multiplier_dt: 0.0,
            touched: Vec::new(),
            part_count: laid.part_count(),
            updates: Vec::new(),
            updates_before: Vec::new(),
            updates_sent: Vec::new(),
            update_of: vec![u32::MAX; model.vertex_count()],
            has_moved_anchors: true,
            stability: is_explicit.then(|| Stability::for_a_device(&laid, settings)),
            tethers: Vec::new(),
            small_steps: vec![SmallSteps::default(); small_steps],
            buffers,
            levels,
            passes: 0,
            values: OfValues::default(),
        };
        if let Some(table) = table {
            solver.put_levels(&table);
        }
        solver.upload_constants(&laid);
        solver.put(&laid, &State::at_rest(model));
        // Its memory may have been too little.
        solver.device.check()?;
        Ok(solver)
    }

    /// The settings in force.
    pub fn settings(&self) -> &SolverSettings {
        &self.settings
    }

    /// The model as it lies on the device.
    pub fn layout(&self) -> &Layout<f32> {
        &self.layout
    }

    /// The stages of a step.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The largest small step [s] of the explicit method, its margin included; infinite for others.
    pub fn stable_step(&self) -> f64 {
        self.stability.as_ref().map_or(f64::INFINITY, |stability| stability.step)
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
        let settings = &settings.chosen_on_device();
        let record = Recorded::new(&Layout::on_device(model, settings), settings).record;
        [record.prologue, record.body, record.epilogue].map(|list| list.len())
    }

    /// Iterations of the last step, or its small steps; none before the first.
    pub fn passes(&self) -> u32 {
        self.passes
    }

    /// Iterations of the steps to come, at least one, of XPBD, whose stages and memory do not depend on them. Other methods
    /// keep what they were built with.
    pub fn set_iterations(&mut self, count: u32) {
        if self.settings.method != Method::Xpbd {
            return;
        }
        self.settings.iterations = Count::Of(count.max(1));
        self.plan.set_iterations(&self.layout, &self.settings);
    }

    /// About how many tetrahedra of meshes like this one, solved like this, a device with these limits
    /// takes: as many as its largest array fits into a binding.
    pub fn largest_mesh(&self, model: &Model<f32>, limits: &wgpu::Limits) -> u64 {
        let limit = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        (model.tet_count() as f64 * limit as f64 / self.buffers.largest() as f64) as u64
    }

    /// Bytes of device memory.
    pub fn bytes(&self) -> u64 {
        let frames = self.frames.bytes() + self.forces.bytes();
        self.buffers.bytes() + self.uniforms.jobs.size() + frames + self.values.bytes()
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
        let layout = self.layout_of(model)?;
        let model = &*layout;
        crate::solver::inputs::check_state(model, state)?;
        self.put(model, state);
        Ok(())
    }

    /// The layout of the model that lies on the device.
    pub(super) fn layout_of(&self, model: &Model<f32>) -> Result<Arc<Layout<f32>>, StepError> {
        check_model(&self.layout, model)?;
        Ok(Arc::clone(&self.layout))
    }

    fn put(&mut self, layout: &Layout<f32>, state: &State<f32>) {
        self.sent = Sent::default();
        let places = in_solver_order(layout, &state.positions);
        let mut unknowns = vec![0.0f32; self.buffers.length as usize];
        let (positions, multipliers) =
            unknowns.split_at_mut((self.buffers.multipliers_start / 4) as usize);
        positions[..4 * places.len()].copy_from_slice(places.as_flattened());
        multipliers[..state.multipliers.len()].copy_from_slice(&state.multipliers);
        let bytes = bytemuck::cast_slice(&unknowns);
        self.buffers.write(&self.device.queue, Slot::Unknowns, bytes);
        self.write_velocities(&state.velocities);
        self.multiplier_dt = state.multiplier_dt;
        self.forget_pairs();
        let into = self.samples().map(|_| (&self.buffers, &self.device.queue));
        self.tools.put(into, layout, &state.contact);
        self.put_meetings(layout, &state.contact);
    }

    /// Solves begin without what they have learned.
    pub(super) fn forget_pairs(&mut self) {
        if self.levels.is_some() {
            let none = vec![PartProgress::zeroed(); self.part_count];
            self.buffers.write(&self.device.queue, Slot::Progress, bytemuck::cast_slice(&none));
        }
    }

    /// The table of the preconditioner.
    pub(super) fn put_levels(&mut self, table: &[u32]) {
        self.buffers.send(&mut self.outgoing, Slot::Levels, bytemuck::cast_slice(table));
    }

    /// Puts velocities [m/s], the user's order, in the place of those on the device.
    pub(crate) fn write_velocities(&self, velocities: &[Vec3<f32>]) {
        let sorted = in_solver_order(&self.layout, velocities);
        let bytes = bytemuck::cast_slice(&sorted);
        self.buffers.write(&self.device.queue, Slot::Velocities, bytes);
    }

    /// What each vertex is made of: mass, inverse mass, number of copies.
    fn upload_constants(&self, layout: &Layout<f32>) {
        let order = &layout.numbering.order;
        let masses: Vec<f32> = order.iter().map(|&v| layout.masses[v as usize]).collect();
        let with_w = |w: &dyn Fn(usize) -> f32| -> Vec<[f32; 4]> {
            (0..order.len()).map(|v| [0.0, 0.0, 0.0, w(v)]).collect()
        };
        let copies = |v: usize| (layout.copy_offsets[v + 1] - layout.copy_offsets[v]) as f32;
        let control = vec![0u8; control::control_size(layout.part_count()) as usize];
        self.device.queue.write_buffer(self.buffers.buffer(Slot::Control), 0, &control);
        for (slot, values) in [
            (Slot::Predicted, with_w(&|v| masses[v])),
            (Slot::ExternalForces, with_w(&|v| 1.0 / masses[v])),
            (Slot::Previous, with_w(&copies)),
            (Slot::Targets, with_w(&|_| 0.0)),
        ] {
            self.buffers.write(&self.device.queue, slot, bytemuck::cast_slice(&values));
        }
    }
}

/// Whether a device computes with these settings.
fn check(device: &Device, settings: &SolverSettings) -> Result<(), GpuError> {
    if settings.precision == Precision::F64 {
        return Err(GpuError::DoublePrecision);
    }
    if settings.method == Method::QuasiNewton && !on_device::IS_THERE {
        return Err(GpuError::OnlyOnCpu);
    }
    let has_recovered = recovered::on_device::IS_THERE && settings.method != Method::Xpbd;
    if settings.elements == Elements::Recovered && !has_recovered {
        return Err(GpuError::PlainElements);
    }
    check_settings(settings)?;
    device.check()?;
    // Sizes are compared array by array, where buffers are made.
    let wgpu::Limits { max_storage_buffer_binding_size, max_buffer_size, .. } = baseline();
    let own = device.limits();
    let own = wgpu::Limits { max_storage_buffer_binding_size, max_buffer_size, ..own };
    match shortfall(&own) {
        Some(lacking) => Err(GpuError::BelowBaseline { name: device.name().to_owned(), lacking }),
        None => Ok(()),
    }
}

/// Whether parts that nothing holds start where their centre of mass will be.
fn starts_falling(plan: &Plan) -> bool {
    let falls = |stage: &Stage| match stage {
        Stage::Step(StepStage::Predict { start, .. }) => *start == Start::Auto,
        Stage::QuasiNewton(_) => true,
        _ => false,
    };
    plan.split().prologue.iter().any(falls)
}

fn in_solver_order(layout: &Layout<f32>, values: &[Vec3<f32>]) -> Vec<[f32; 4]> {
    let order = layout.numbering.order.iter();
    order.map(|&v| values[v as usize].to_array()).map(|[x, y, z]| [x, y, z, 0.0]).collect()
}

fn prepare(device: &Device, buffers: &Buffers, dispatch: &Dispatch, job: u32) -> Ready {
    let made = pipeline(device, dispatch.kernel, dispatch.variant);
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
