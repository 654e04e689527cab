//! The stages of XPBD as dispatches.

use std::ops::Range;

use super::stage::{IterateStage, Mix, XpbdStage};
use crate::layout::SetClusters;
use crate::settings::{AndersonGuard, AndersonOn};
use crate::solver::gpu::kernels::{self, Swept};
use crate::solver::gpu::limits::window;
use crate::solver::gpu::record::{Dispatch, Recorder};
use crate::solver::gpu::uniforms::Job;
use crate::solver::step::contacts::on_device::Samples;
use crate::solver::step::modes;

/// Workgroups of a repair: enough for a device to be busy when there is something to repair, few enough to
/// cost little in all other steps.
const REPAIR_GROUPS: u32 = 512;

impl Recorder<'_> {
    /// Writes a stage down.
    pub fn xpbd_stage(&self, stage: XpbdStage, into: &mut Vec<Dispatch>) {
        match stage {
            XpbdStage::ResetMultipliers | XpbdStage::RescaleMultipliers => {
                let count = self.layout.multiplier_count as u32;
                let job = Job { count, ..Job::default() };
                into.push(self.threads(&kernels::RESCALE_MULTIPLIERS, job));
            }
            XpbdStage::RepairMultipliers => {
                into.push(self.parts_of_long(&kernels::FIND_BROKEN, 0));
                self.constitutive_multipliers(0, into);
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
            XpbdStage::GuardIterate(stage) => into.push(self.guard_iterate(stage)),
        }
    }

    fn guard_iterate(&self, stage: IterateStage) -> Dispatch {
        let (evaluate, take) = (&kernels::EVALUATE, &kernels::TAKE);
        match stage {
            IterateStage::Evaluate => self.all_pieces(evaluate, 0),
            IterateStage::Judge => self.parts_of_long(take, modes::JUDGES_MIXTURE),
            IterateStage::EvaluatePlain => self.all_pieces(evaluate, modes::UNLESS_GOOD),
            IterateStage::JudgePlain => {
                self.all_pieces(&kernels::SEARCH, modes::JUDGES_PLAIN | modes::LOADS_FORCES)
            }
            IterateStage::TakeDescent => self.parts_of_long(take, modes::TAKES_DESCENT),
        }
    }

    /// A warm-start reset, instead of a step.
    pub fn restart_stages(&self) -> Vec<Dispatch> {
        let mut dispatches = vec![self.vertices(&kernels::APPLY_UPDATES, 0)];
        if self.layout.is_viscous() {
            self.each_set(&kernels::MEASURE_STRAIN, &mut dispatches);
        }
        self.constitutive_multipliers(1, &mut dispatches);
        dispatches
    }

    fn load_corners(&self, into: &mut Vec<Dispatch>) {
        self.each_set(&kernels::LOAD_MULTIPLIERS, into);
        into.extend(self.elements(&kernels::LOAD_ELEMENTS, None));
        let of_samples = |samples: Samples| {
            let job = Job { count: samples.count, ..Job::default() };
            self.threads(&kernels::LOAD_CONTACTS, job)
        };
        into.extend(Samples::known(self.samples).map(of_samples));
    }

    fn solve_color(&self, color: usize, into: &mut Vec<Dispatch>) {
        let [tets, elements] = match self.swept() {
            Swept::Vertices => [&kernels::SOLVE, &kernels::SOLVE_ELEMENTS],
            Swept::Copies => [&kernels::SOLVE_COPIES, &kernels::SOLVE_ELEMENTS],
            Swept::Jacobi => [&kernels::SOLVE_JACOBI, &kernels::SOLVE_ELEMENTS_JACOBI],
        };
        for (law, set) in self.layout.tet_sets.iter().enumerate() {
            let blocks = set.color(color);
            if blocks.is_empty() {
                continue;
            }
            into.push(match &set.clusters {
                None => self.on_copies(self.blocks(tets, law, blocks)),
                Some(clusters) => self.clusters(law, clusters.color(color)),
            });
        }
        let elements = self.elements(elements, Some(color));
        into.extend(elements.map(|dispatch| self.on_copies(dispatch)));
    }

    /// A workgroup for each cluster of some of a set.
    fn clusters(&self, law: usize, clusters: Range<usize>) -> Dispatch {
        let before = self.layout.tet_sets[..law].iter();
        let before: usize =
            before.filter_map(|set| set.clusters.as_ref()).map(SetClusters::len).sum();
        let all = self.blocks(&kernels::SOLVE_CLUSTERS, law, 0..0);
        let (first, count) = ((before + clusters.start) as u32, clusters.len() as u32);
        Dispatch { job: Job { first, count, ..all.job }, groups: count, ..all }
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

    /// Of all constraints; `mode` as in history.wgsl.
    fn constitutive_multipliers(&self, mode: u32, into: &mut Vec<Dispatch>) {
        let first = into.len();
        self.each_set(&kernels::REPAIR_MULTIPLIERS, into);
        into.extend(self.elements(&kernels::REPAIR_ELEMENTS, None));
        for dispatch in &mut into[first..] {
            dispatch.job = Job { first: self.multipliers_first, mode, ..dispatch.job };
            dispatch.groups = dispatch.groups.min(REPAIR_GROUPS);
        }
    }
}
