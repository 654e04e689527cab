//! The stages of XPBD as dispatches.

use super::stage::{Mix, XpbdStage};
use crate::elements::TetForm;
use crate::settings::{AndersonGuard, AndersonOn};
use crate::solver::gpu::kernels::{self, Swept};
use crate::solver::gpu::limits::window;
use crate::solver::gpu::record::{Dispatch, Recorder};
use crate::solver::gpu::uniforms::Job;

/// Workgroups of a repair: enough for a device to be busy when there is something to repair, few enough to
/// cost little in all other steps.
const REPAIR_GROUPS: u32 = 512;

impl Recorder<'_> {
    /// Writes a stage down.
    pub fn xpbd_stage(&self, stage: XpbdStage, into: &mut Vec<Dispatch>) {
        match stage {
            XpbdStage::ResetMultipliers | XpbdStage::RescaleMultipliers => {
                let count = self.model.multiplier_count as u32;
                let job = Job { count, ..Job::default() };
                into.push(self.threads(&kernels::RESCALE_MULTIPLIERS, job));
            }
            XpbdStage::RepairMultipliers => {
                into.push(self.parts_of_long(&kernels::FIND_BROKEN, 0));
                into.push(self.constitutive_multipliers(0));
            }
            XpbdStage::RememberIterate => into.push(self.long(&kernels::REMEMBER_ITERATE, 0)),
            XpbdStage::LoadCorners => self.load_corners(into),
            XpbdStage::Rebase => into.push(self.vertices(&kernels::REBASE, 0)),
            XpbdStage::RecomputePositions => {
                into.push(self.vertices(&kernels::RECOMPUTE_POSITIONS, 0));
            }
            XpbdStage::SplitCopies => {
                into.push(self.on_copies(self.vertices(&kernels::SPLIT_COPIES, 0)));
            }
            XpbdStage::SolveColor(color) => self.solve_color(color as usize, into),
            XpbdStage::SplitAndSolve => self.solve_color(0, into),
            XpbdStage::JoinCopies => {
                into.push(self.on_copies(self.vertices(&kernels::JOIN_COPIES, 0)));
            }
            XpbdStage::Chebyshev => self.chebyshev(into),
            XpbdStage::Anderson(mix) => self.anderson(mix, into),
            XpbdStage::GuardIterate => self.guard_iterate(into),
        }
    }

    /// A new history, instead of a step.
    pub fn restart_stages(&self) -> Vec<Dispatch> {
        let mut dispatches = vec![self.vertices(&kernels::APPLY_UPDATES, 0)];
        if self.model.tet_sets().iter().any(|set| set.viscous) {
            self.each_set(&kernels::MEASURE_STRAIN, &mut dispatches);
        }
        dispatches.push(self.constitutive_multipliers(1));
        dispatches
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
        let [tets, springs, attachments] = match self.swept() {
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

    fn anderson(&self, mix: Mix, into: &mut Vec<Dispatch>) {
        let push = if mix.joins { &kernels::ANDERSON_JOIN } else { &kernels::ANDERSON_PUSH };
        let guard = self.settings.guard_of_mixtures() == AndersonGuard::Residual;
        let job = Job { set_first: window(self.settings), mode: guard.into(), ..Job::default() };
        into.push(self.parts_of_long(push, 0));
        into.push(self.each_part(&kernels::ANDERSON_WEIGHTS, job));
        let mixed = match mix.on {
            AndersonOn::Positions => 1,
            AndersonOn::Multipliers => 2,
            AndersonOn::Both => 3,
        };
        let remembered = if mix.remembers { 4 } else { 0 };
        into.push(self.parts_of_long(&kernels::ANDERSON_MIX, mixed | remembered));
    }

    /// Of all constraints in one dispatch; `mode` as in history.wgsl.
    fn constitutive_multipliers(&self, mode: u32) -> Dispatch {
        let [green, neo] = self.model.tet_sets();
        let tet_count = self.tet_threads();
        let spring_count = self.model.springs.vertices.len() as u32;
        let job = Job {
            first: self.multipliers_first,
            count: tet_count + spring_count + self.model.attachments.vertices.len() as u32,
            set_first: green.block_count() as u32,
            multiplier_offset: neo.multiplier_offset as u32,
            viscous_offset: neo.viscous_offset as u32,
            is_viscous: u32::from(green.viscous) | u32::from(neo.viscous) << 1,
            mode,
            tet_count,
            spring_count,
            ..Job::default()
        };
        let form = if neo.is_empty() { TetForm::GreenStrain } else { neo.form };
        let threads = self.threads(&kernels::REPAIR_MULTIPLIERS, job);
        let groups = threads.groups.min(REPAIR_GROUPS);
        Dispatch { groups, variant: self.variant(form), ..threads }
    }
}
