//! Connected parts as kernels see them: the pieces of their sums, and the numbers of the long vector that are
//! theirs, in the order that they have in a model of the part alone.

use bytemuck::{Pod, Zeroable};

use super::limits::SUM_THREADS;
use super::slots::{Update, multipliers_start};
use crate::layout::{Layout, Part};
use crate::scalar::{Vec3, vec3};
use crate::settings::SolverSettings;
use crate::solver::xpbd::rebase::{bound_share, rebase_factor};

/// Workgroups of a part that sum products of long vectors: enough to keep a large device busy, few enough for one
/// workgroup to add up what they leave.
pub(super) const SUM_GROUPS: u32 = 512;

/// A piece: elements among the members, or vertices, of one part.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Piece {
    pub part: u32,
    pub first: u32,
    pub end: u32,
    pub are_vertices: u32,
}

/// The table's row of a part.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct PartRow {
    /// Its pieces of elements, and of vertices.
    pub element_pieces: u32,
    pub element_pieces_end: u32,
    pub vertex_pieces: u32,
    pub vertex_pieces_end: u32,
    /// Where its vertices end; the next part's begin there.
    pub vertices_end: u32,
    /// The same of workgroups that work on the long vector.
    pub groups_end: u32,
    /// Its runs of the long vector, and numbers of its own one.
    pub runs: u32,
    pub runs_end: u32,
    pub length: u32,
    /// Numbers of the rebase before a sweep.
    pub rebase_factor: f32,
    pub bound_share: f32,
}

/// The small steps of a part in a step of an explicit method: how many, of what length [s], one over it, and how far ahead
/// of its place [s] forces are taken.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct SmallSteps {
    pub count: u32,
    pub dt: f32,
    pub inverse_dt: f32,
    pub ahead: f32,
}

impl SmallSteps {
    /// So many in a step of `dt` [s], with forces so many of them ahead.
    pub fn new(count: u32, dt: f64, ahead: f64) -> Self {
        let small = dt / f64::from(count);
        let [dt, inverse_dt, ahead] = [small, 1.0 / small, ahead * small].map(|x| x as f32);
        Self { count, dt, inverse_dt, ahead }
    }
}

/// All bodies of a part are free, or some of several are that are one part on devices.
pub(super) const WHOLLY_FREE: u32 = 1;
const PARTLY_FREE: u32 = 2;

/// Whether nothing holds a part in a step, zero where something does, and its mean acceleration [m/s^2] then.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Fall {
    pub is_free: u32,
    pub acceleration: [f32; 3],
}

/// How parts fall that nothing holds.
#[derive(Debug)]
pub(super) struct Falls {
    /// Of each part [kg], and whether anchors hold it.
    bodies: Vec<(f64, bool)>,
    /// Which parts of the model nothing holds, where several are one part.
    free: Vec<bool>,
    /// Forces on each part [N].
    forces: Vec<Vec3<f64>>,
    /// In this step.
    pub all: Vec<Fall>,
    /// In the step before it; empty before the first.
    before: Vec<Fall>,
}

impl Falls {
    pub fn new(layout: &Layout<f32>) -> Self {
        let mass = |v: usize| f64::from(layout.masses[layout.numbering.order[v] as usize]);
        let body = |part: &Part| (part.vertices.clone().map(mass).sum(), part.is_anchored());
        let bodies: Vec<_> = layout.parts.iter().map(body).collect();
        let count = bodies.len();
        let all = vec![Fall::default(); count];
        let free = Vec::new();
        Self { bodies, free, forces: vec![Vec3::ZERO; count], all, before: Vec::new() }
    }

    /// Finds what nothing holds among what acts on vertices; whether that is news to the device.
    pub fn find(&mut self, layout: &Layout<f32>, gravity: Vec3<f32>, updates: &[Update]) -> bool {
        self.forces.fill(Vec3::ZERO);
        for (fall, (_, is_attached)) in self.all.iter_mut().zip(&self.bodies) {
            fall.is_free = u32::from(!is_attached);
        }
        for update in updates {
            let part = layout.part_at(update.vertex as usize);
            let [x, y, z] = update.force;
            // A pin or a tether at one vertex holds the whole part. That its force is added as well does no harm: the
            // acceleration of a part that is held is not read.
            if update.is_pinned != 0 || update.stiffness != 0.0 {
                self.all[part].is_free = 0;
            }
            self.forces[part] += vec3(x, y, z).cast::<f64>();
        }
        self.mark_partly_free(layout, updates);
        for ((fall, (mass, _)), force) in self.all.iter_mut().zip(&self.bodies).zip(&self.forces) {
            let acceleration = gravity + (*force * (1.0 / mass)).cast();
            fall.acceleration = acceleration.to_array();
        }
        let is_news =
            bytemuck::cast_slice::<Fall, u8>(&self.before) != bytemuck::cast_slice(&self.all);
        self.before.clone_from(&self.all);
        is_news
    }
}

impl Falls {
    /// Parts of several bodies of which something holds some.
    fn mark_partly_free(&mut self, layout: &Layout<f32>, updates: &[Update]) {
        let Some(joined) = layout.joined() else { return };
        self.free.clear();
        self.free.extend(joined.anchored.iter().map(|is_anchored| !is_anchored));
        for update in updates.iter().filter(|at| at.is_pinned != 0 || at.stiffness != 0.0) {
            self.free[joined.of_vertices[update.vertex as usize] as usize] = false;
        }
        for (&part, _) in joined.of_parts.iter().zip(&self.free).filter(|(_, is_free)| **is_free) {
            let is_free = &mut self.all[part as usize].is_free;
            *is_free = if *is_free == 0 { PARTLY_FREE } else { *is_free };
        }
    }
}

/// A run of the long vector: where it begins in that of the part, and in that of the model.
type Run = [u32; 2];

/// Padding: numbers of a part's vector that stand for nothing.
const NOWHERE: u32 = u32::MAX;

/// Of all parts, and their runs.
#[derive(Clone, Debug, Default)]
pub(super) struct Parts {
    pub rows: Vec<PartRow>,
    pub runs: Vec<Run>,
}

impl Parts {
    pub fn new(layout: &Layout<f32>, settings: &SolverSettings, pieces: &[Piece]) -> Self {
        let mut parts = Self::default();
        let mut groups_end = 0;
        let first = (multipliers_start(layout.vertex_count()) / 4) as u32;
        for (number, part) in layout.parts.iter().enumerate() {
            let runs = parts.runs.len() as u32;
            let length = parts.add_runs(part, first);
            // From the part's own length only, never from how many parts there are: which numbers one workgroup adds
            // up decides the bits of a sum. Ends ascend: kernels find a workgroup's part by bisection (`part_with`).
            groups_end += length.div_ceil(SUM_THREADS).min(SUM_GROUPS);
            // Pieces are sorted by kind, then part. A part may have none of elements; its range is then empty.
            let [elements, vertices] = [0, 1].map(|kind| {
                let is_own = |p: &Piece| (p.are_vertices, p.part) < (kind, number as u32);
                let first = pieces.partition_point(is_own);
                let own = pieces[first..].iter();
                let count =
                    own.take_while(|p| (p.are_vertices, p.part) == (kind, number as u32)).count();
                [first as u32, (first + count) as u32]
            });
            parts.rows.push(PartRow {
                element_pieces: elements[0],
                element_pieces_end: elements[1],
                vertex_pieces: vertices[0],
                vertex_pieces_end: vertices[1],
                vertices_end: part.vertices.end as u32,
                groups_end,
                runs,
                runs_end: parts.runs.len() as u32,
                length,
                rebase_factor: rebase_factor(part.is_split(), part.colors.len(), settings) as f32,
                bound_share: bound_share(part.is_split()) as f32,
            });
        }
        parts
    }

    /// Workgroups that work on the long vector.
    pub fn groups(&self) -> u32 {
        self.rows.last().map_or(0, |row| row.groups_end)
    }

    /// Returns how many numbers the part's own vector has. `first`: where the model's multipliers begin.
    fn add_runs(&mut self, part: &Part, first: u32) -> u32 {
        let vertices = &part.vertices;
        // The own vector is laid out as `slots.rs` lays out the vector of a model of this part: four numbers a vertex,
        // padding up to where multipliers may begin, multipliers set by set. Threads stride over own numbers, so each
        // adds up the same ones as if the part were alone; padding is stepped over.
        self.runs.push([0, 4 * vertices.start as u32]);
        self.runs.push([4 * vertices.len() as u32, NOWHERE]);
        let mut length = (multipliers_start(vertices.len()) / 4) as u32;
        for range in &part.multipliers {
            self.runs.push([length, first + range.start as u32]);
            length += range.len() as u32;
        }
        if part.multipliers.is_empty() {
            // A model without multipliers has room for one all the same: bindings are never empty.
            length += 1;
        }
        length
    }
}
