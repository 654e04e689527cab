//! The explicit method on the device (solver/explicit.rs): two dispatches for a small step.

use super::kernels;
use super::record::{Dispatch, Job, Recorder};
use crate::model::Model;
use crate::scalar::Vec3;

impl Recorder<'_> {
    /// [`crate::solver::plan::Stage::BeginExplicit`].
    pub(super) fn begin_explicit(&self, into: &mut Vec<Dispatch>) {
        into.push(self.vertices(&kernels::APPLY_UPDATES, 0));
        into.push(self.vertices(&kernels::BEGIN_EXPLICIT, 0));
        if self.model.tet_sets().iter().any(|set| set.viscous) {
            let job = Job { count: self.tet_threads(), ..Job::default() };
            into.push(self.threads(&kernels::BEGIN_STRAIN, job));
        }
    }

    /// [`crate::solver::plan::Stage::LoadForces`], but for attachments: [`Hold`].
    pub(super) fn load_forces(&self) -> Dispatch {
        let tet_count = self.tet_threads();
        let job = Job {
            count: tet_count + self.model.springs.vertices.len() as u32,
            set_first: self.model.tet_sets()[0].block_count() as u32,
            tet_count,
            ..Job::default()
        };
        let threads = self.threads(&kernels::LOAD_FORCES, job);
        // One thread counts the small steps, whatever there is to load.
        Dispatch { groups: threads.groups.max(1), ..threads }
    }
}

/// The attachments of one vertex: together they pull like a single one to the mean of their anchors,
/// weighted by stiffness. A vertex advances by itself, so that a small step needs no third dispatch.
#[derive(Clone, Debug)]
pub(super) struct Hold {
    /// The solver's number.
    pub vertex: u32,
    /// Sum [N/m].
    pub stiffness: f64,
    /// The user's number of each attachment, and its stiffness [N/m].
    attachments: Vec<(usize, f64)>,
}

impl Hold {
    /// One for each vertex that is attached.
    pub fn all(model: &Model<f32>) -> Vec<Self> {
        let mut holds: Vec<Self> = Vec::new();
        let mut hold_of = vec![usize::MAX; model.vertex_count()];
        let held = &model.attachments;
        for (i, &v) in held.vertices.iter().enumerate() {
            let vertex = model.numbering.of(v);
            if hold_of[vertex] == usize::MAX {
                hold_of[vertex] = holds.len();
                let vertex = vertex as u32;
                holds.push(Self { vertex, stiffness: 0.0, attachments: Vec::new() });
            }
            let hold = &mut holds[hold_of[vertex]];
            let stiffness = f64::from(held.stiffness[i]);
            hold.stiffness += stiffness;
            hold.attachments.push((held.order[i] as usize, stiffness));
        }
        holds
    }

    /// Where it pulls to [m]; `anchors` in the user's order. One anchor keeps its bits.
    pub fn place(&self, anchors: &[Vec3<f32>]) -> [f32; 3] {
        let mut sum = Vec3::ZERO;
        for &(i, stiffness) in &self.attachments {
            sum += anchors[i].cast::<f64>() * (stiffness / self.stiffness);
        }
        sum.cast::<f32>().to_array()
    }
}
