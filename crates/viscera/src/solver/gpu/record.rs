//! From stages to dispatches: what the device is asked to do in every step, written down once.

use bytemuck::{Pod, Zeroable};

use super::buffers::{Place, Slot};
use super::kernels::{self, Kernel, Swept, Variant};
use super::layout::Layout;
use super::timing::StageRange;
use crate::elements::TetForm;
use crate::material::MaterialModel;
use crate::model::{Model, TetSet};
use crate::scalar::lanes::LANES;
use crate::settings::{Acceleration, AndersonGuard, AndersonOn, SolverSettings, Start};
use crate::solver::plan::{Plan, Stage};

/// `Job` of bindings.wgsl.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Job {
    pub first: u32,
    pub count: u32,
    pub set_first: u32,
    pub multiplier_offset: u32,
    pub viscous_offset: u32,
    pub is_viscous: u32,
    pub is_neo_hookean: u32,
    pub mode: u32,
    pub parameter: f32,
    pub tet_count: u32,
    pub spring_count: u32,
}

/// One dispatch.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Dispatch {
    pub kernel: &'static Kernel,
    pub variant: Variant,
    pub job: Job,
    pub groups: u32,
    /// Whether it works on the copies of split vertices.
    pub on_copies: bool,
}

impl Dispatch {
    /// What the kernel finds at each of its bindings. Kernels that know vertices and copies find both;
    /// those of a sweep find copies in the place of vertices.
    pub fn places(&self) -> impl Iterator<Item = Place> {
        let knows_both = self.kernel.slots.contains(&Slot::Copies);
        let place = move |&slot| match slot {
            Slot::Points if knows_both => Place::Whole(slot),
            _ if self.on_copies => Place::CopiesOf(slot),
            _ => Place::Whole(slot),
        };
        self.kernel.slots.iter().map(place)
    }
}

/// The dispatches of a step: once, so many times, once.
#[derive(Clone, Debug, Default)]
pub(super) struct Record {
    pub prologue: Vec<Dispatch>,
    pub body: Vec<Dispatch>,
    pub epilogue: Vec<Dispatch>,
    /// Which of them belong to which stage, in these three lists; stages that need none are left out,
    /// and the colours of a sweep are one.
    pub stages: [Vec<StageRange>; 3],
    /// Where the dispatches of each stage of prologue and body begin, and where those of the last end.
    pub stage_starts: [Vec<usize>; 2],
    /// Of a new history, instead of a step.
    pub restart: Vec<Dispatch>,
}

/// Writes down what the stages of a plan ask for.
pub(super) struct Recorder<'a> {
    pub model: &'a Model<f32>,
    pub settings: &'a SolverSettings,
    /// Numbers of the long vector, and where multipliers begin in it.
    pub length: u32,
    pub multipliers_first: u32,
    swept: Swept,
    /// Whether what a mixture leaves is where the next sweep starts, so that it can be remembered in
    /// the same pass.
    mixes_remember: bool,
    /// Vertices from one range of the ground to the next.
    pub stride: u32,
    pub pieces: Pieces,
}

/// How many pieces sums are taken in, which of them is the first of vertices, and how many workgroups
/// work on the long vector, part by part.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pieces {
    pub count: u32,
    pub first_of_vertices: u32,
    pub groups: u32,
}

impl<'a> Recorder<'a> {
    /// For a model that is solved in this way; `vector` is the length of the long vector and the place
    /// of the first multiplier in it.
    pub fn new(
        model: &'a Model<f32>,
        settings: &'a SolverSettings,
        plan: &Plan,
        vector: [u32; 2],
        pieces: Pieces,
    ) -> Self {
        let [length, multipliers_first] = vector;
        let changes = |stage: &Stage| {
            matches!(stage, Stage::GuardIterate | Stage::Anderson(AndersonOn::Multipliers))
        };
        Self {
            model,
            settings,
            length,
            multipliers_first,
            swept: swept(model),
            mixes_remember: !plan.body.iter().any(changes),
            stride: Layout::stride(model),
            pieces,
        }
    }

    pub fn record(&self, plan: &Plan) -> Record {
        let [mut prologue, body, epilogue] =
            [&plan.prologue, &plan.body, &plan.epilogue].map(|stages| self.list(stages));
        if self.mixes_remember && plan.body.contains(&Stage::RememberIterate) {
            let first = prologue.0.len();
            prologue.0.push(self.long(&kernels::REMEMBER_ITERATE, 0));
            let stage = Stage::RememberIterate;
            prologue.1.push(StageRange { stage, dispatches: first..first + 1 });
        }
        Record {
            prologue: prologue.0,
            body: body.0,
            epilogue: epilogue.0,
            stages: [prologue.1, body.1, epilogue.1],
            stage_starts: [prologue.2, body.2],
            restart: self.restart(),
        }
    }

    fn list(&self, stages: &[Stage]) -> (Vec<Dispatch>, Vec<StageRange>, Vec<usize>) {
        let (mut dispatches, mut ranges) = (Vec::new(), Vec::<StageRange>::new());
        let mut starts = Vec::new();
        for stage in stages {
            starts.push(dispatches.len());
            let first = dispatches.len();
            self.stage(stage, &mut dispatches);
            let added = first..dispatches.len();
            match (stage, ranges.last_mut()) {
                _ if added.is_empty() => {}
                (
                    Stage::SolveColor(_),
                    Some(StageRange { stage: Stage::SolveColor(_), dispatches }),
                ) => dispatches.end = added.end,
                _ => ranges.push(StageRange { stage: *stage, dispatches: added }),
            }
        }
        starts.push(dispatches.len());
        (dispatches, ranges, starts)
    }

    fn stage(&self, stage: &Stage, into: &mut Vec<Dispatch>) {
        let model = self.model;
        match *stage {
            // The state lives on the device.
            Stage::ReadState | Stage::WriteState => {}
            Stage::MeasureStrain => self.each_set(&kernels::MEASURE_STRAIN, into),
            Stage::Predict(start) => {
                let mut begin = self.vertices(&kernels::APPLY_UPDATES, 1);
                begin.job.parameter = self.settings.chebyshev_radius as f32;
                into.push(begin);
                let mode = match start {
                    Start::Previous => 0,
                    Start::Inertial => 1,
                    Start::Predicted => 2,
                    Start::Auto => 3,
                };
                let keeps_starts = if self.settings.guards_steps() { 4 } else { 0 };
                let mut predict = self.vertices(&kernels::PREDICT, mode | keeps_starts);
                predict.job.set_first = self.stride;
                into.push(predict);
            }
            Stage::ResetMultipliers | Stage::RescaleMultipliers => {
                let count = model.multiplier_count as u32;
                let job = Job { count, ..Job::default() };
                into.push(self.threads(&kernels::RESCALE_MULTIPLIERS, job));
            }
            Stage::RememberIterate if self.mixes_remember => {}
            Stage::RememberIterate => into.push(self.long(&kernels::REMEMBER_ITERATE, 0)),
            Stage::LoadCorners => self.load_corners(into),
            Stage::Rebase => into.push(self.vertices(&kernels::REBASE, 0)),
            Stage::RecomputePositions => {
                into.push(self.vertices(&kernels::RECOMPUTE_POSITIONS, 0));
            }
            // A sweep of one colour reads vertices.
            Stage::SplitCopies if self.swept == Swept::Jacobi => {}
            Stage::SplitCopies => {
                into.push(self.on_copies(self.vertices(&kernels::SPLIT_COPIES, 0)));
            }
            Stage::SolveColor(color) => self.solve_color(color as usize, into),
            // Anderson joins them in passing.
            Stage::JoinCopies if self.settings.acceleration == Acceleration::Anderson => {}
            Stage::JoinCopies => {
                into.push(self.on_copies(self.vertices(&kernels::JOIN_COPIES, 0)));
            }
            Stage::Chebyshev => self.chebyshev(into),
            Stage::Anderson(on) => self.anderson(on, into),
            // Guarded steps get theirs from the energy limit.
            Stage::UpdateVelocities if self.settings.guards_steps() => {}
            Stage::UpdateVelocities => into.push(self.vertices(&kernels::UPDATE_VELOCITIES, 0)),
            Stage::RepairMultipliers => self.repair_multipliers(into),
            Stage::BeginExplicit => self.begin_explicit(into),
            Stage::LoadForces => into.push(self.load_forces()),
            Stage::AdvanceExplicit => into.push(self.vertices(&kernels::ADVANCE_EXPLICIT, 0)),
            Stage::EndExplicit => into.push(self.vertices(&kernels::END_EXPLICIT, 0)),
            Stage::ChooseStart => self.choose_start(into),
            Stage::GuardIterate => self.guard_iterate(into),
            Stage::GuardStep => self.guard_step(into),
            Stage::LimitEnergy => self.limit_energy(into),
        }
    }

    pub(super) fn variant(&self, form: TetForm) -> Variant {
        Variant { form, swept: self.swept }
    }

    /// As many threads as the job counts.
    pub(super) fn threads(&self, kernel: &'static Kernel, job: Job) -> Dispatch {
        let variant = self.variant(TetForm::GreenStrain);
        let groups = job.count.div_ceil(kernel.workgroup);
        Dispatch { kernel, variant, job, groups, on_copies: false }
    }

    fn on_copies(&self, dispatch: Dispatch) -> Dispatch {
        Dispatch { on_copies: true, ..dispatch }
    }

    /// A thread for each vertex.
    pub(super) fn vertices(&self, kernel: &'static Kernel, mode: u32) -> Dispatch {
        let count = self.model.vertex_count() as u32;
        self.threads(kernel, Job { count, mode, ..Job::default() })
    }

    /// A thread for each number of the long vector.
    pub(super) fn long(&self, kernel: &'static Kernel, mode: u32) -> Dispatch {
        let set_first = super::window(self.settings);
        let first = self.multipliers_first;
        self.threads(kernel, Job { first, count: self.length, set_first, mode, ..Job::default() })
    }

    /// The long vector part by part: as many workgroups as have enough to do.
    pub(super) fn parts_of_long(&self, kernel: &'static Kernel, mode: u32) -> Dispatch {
        Dispatch { groups: self.pieces.groups, ..self.long(kernel, mode) }
    }

    /// A workgroup for each part.
    fn each_part(&self, kernel: &'static Kernel, job: Job) -> Dispatch {
        let count = self.model.part_count() as u32;
        Dispatch { groups: count, ..self.threads(kernel, Job { count, ..job }) }
    }

    /// Blocks of a set.
    fn blocks(
        &self,
        kernel: &'static Kernel,
        kind: usize,
        blocks: std::ops::Range<usize>,
    ) -> Dispatch {
        let sets = self.model.tet_sets();
        let set: &TetSet<f32> = sets[kind];
        let set_first = if kind == 0 { 0 } else { sets[0].block_count() as u32 };
        let job = Job {
            first: set_first + blocks.start as u32,
            count: (LANES * blocks.len()) as u32,
            set_first,
            multiplier_offset: set.multiplier_offset as u32,
            viscous_offset: set.viscous_offset as u32,
            is_viscous: set.viscous.into(),
            is_neo_hookean: (set.model == MaterialModel::StableNeoHookean).into(),
            ..Job::default()
        };
        Dispatch { variant: self.variant(set.form), ..self.threads(kernel, job) }
    }

    pub(super) fn each_set(&self, kernel: &'static Kernel, into: &mut Vec<Dispatch>) {
        for (kind, set) in self.model.tet_sets().into_iter().enumerate() {
            if !set.is_empty() {
                into.push(self.blocks(kernel, kind, 0..set.block_count()));
            }
        }
    }

    fn load_corners(&self, into: &mut Vec<Dispatch>) {
        self.each_set(&kernels::LOAD_MULTIPLIERS, into);
        let counts = [self.model.springs.vertices.len(), self.model.attachments.vertices.len()];
        for (kernel, count) in
            [&kernels::LOAD_SPRINGS, &kernels::LOAD_ATTACHMENTS].into_iter().zip(counts)
        {
            if count > 0 {
                into.push(self.threads(kernel, Job { count: count as u32, ..Job::default() }));
            }
        }
    }

    fn solve_color(&self, color: usize, into: &mut Vec<Dispatch>) {
        let model = self.model;
        let [tets, springs, attachments] = match self.swept {
            Swept::Vertices => {
                [&kernels::SOLVE, &kernels::SOLVE_SPRINGS, &kernels::SOLVE_ATTACHMENTS]
            }
            Swept::Copies => {
                [&kernels::SOLVE_COPIES, &kernels::SOLVE_SPRINGS, &kernels::SOLVE_ATTACHMENTS]
            }
            Swept::Jacobi => [
                &kernels::SOLVE_JACOBI,
                &kernels::SOLVE_SPRINGS_JACOBI,
                &kernels::SOLVE_ATTACHMENTS_JACOBI,
            ],
        };
        for (kind, set) in model.tet_sets().into_iter().enumerate() {
            let blocks = set.color(color);
            if !blocks.is_empty() {
                into.push(self.on_copies(self.blocks(tets, kind, blocks)));
            }
        }
        let offsets = [&model.springs.color_offsets, &model.attachments.color_offsets];
        for (kernel, offsets) in [springs, attachments].into_iter().zip(offsets) {
            let (first, end) = (offsets[color], offsets[color + 1]);
            if first < end {
                let job = Job { first, count: end - first, ..Job::default() };
                into.push(self.on_copies(self.threads(kernel, job)));
            }
        }
    }

    fn chebyshev(&self, into: &mut Vec<Dispatch>) {
        let job = Job {
            first: self.settings.chebyshev_delay,
            mode: (self.settings.chebyshev_radius == 0.0).into(),
            ..Job::default()
        };
        into.push(self.parts_of_long(&kernels::CHEBYSHEV_CHANGE, 0));
        into.push(self.each_part(&kernels::CHEBYSHEV_WEIGHT, job));
        into.push(self.parts_of_long(&kernels::CHEBYSHEV_MIX, 0));
    }

    fn anderson(&self, on: AndersonOn, into: &mut Vec<Dispatch>) {
        let is_split = self.swept != Swept::Vertices;
        let push = if is_split { &kernels::ANDERSON_JOIN } else { &kernels::ANDERSON_PUSH };
        let guard = self.settings.guard_of_mixtures() == AndersonGuard::Residual;
        let job =
            Job { set_first: super::window(self.settings), mode: guard.into(), ..Job::default() };
        into.push(self.parts_of_long(push, 0));
        into.push(self.each_part(&kernels::ANDERSON_WEIGHTS, job));
        let mixed = match on {
            AndersonOn::Positions => 1,
            AndersonOn::Multipliers => 2,
            AndersonOn::Both => 3,
        };
        let remembered = if self.mixes_remember { 4 } else { 0 };
        into.push(self.parts_of_long(&kernels::ANDERSON_MIX, mixed | remembered));
    }
}

/// What sweeps of a model read and write.
fn swept(model: &Model<f32>) -> Swept {
    let sets = model.tet_sets().map(TetSet::len);
    let [springs, attachments] = [model.springs.vertices.len(), model.attachments.vertices.len()];
    let corners = 4 * (sets[0] + sets[1]) + 2 * springs + attachments;
    match (model.is_split(), model.color_count, model.copy_count() == corners) {
        (false, ..) => Swept::Vertices,
        (true, 1, true) => Swept::Jacobi,
        _ => Swept::Copies,
    }
}
