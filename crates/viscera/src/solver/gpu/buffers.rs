//! The buffer map: what lies in the device's memory.

use bytemuck::{Pod, Zeroable};
use wgpu::BufferUsages;

use super::GpuError;
use super::device::Device;
use super::layout::Layout;
use crate::model::Model;
use crate::scalar::lanes::LANES;
use crate::settings::{Acceleration, Method, SolverSettings};

/// Numbers of the storage buffers in all kernels; bindings.wgsl has the same ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u32)]
#[allow(missing_docs)]
pub enum Slot {
    Tets = 0,
    Materials,
    CornerIndices,
    Offsets,
    Points,
    Copies,
    Multipliers,
    Loads,
    Velocities,
    Previous,
    Predicted,
    Acting,
    Targets,
    Updates,
    StartStrain,
    Unknowns,
    Iterate,
    Older,
    Weights,
    Residuals,
    Mapped,
    PartialSums,
    Control,
    Springs,
    Attachments,
    Anchors,
    Best,
    Trial,
    Energies,
    Members,
    Pieces,
    Parts,
}

impl Slot {
    /// Whether kernels only read it.
    pub fn is_read_only(self) -> bool {
        use Slot::{
            Anchors, Attachments, CornerIndices, Materials, Members, Offsets, Pieces, Springs,
            Tets, Updates, Weights,
        };
        matches!(
            self,
            Tets | Materials
                | CornerIndices
                | Offsets
                | Updates
                | Weights
                | Springs
                | Attachments
                | Anchors
                | Members
                | Pieces
        )
    }
}

/// A range of one of the buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Place {
    /// The buffer of that number.
    Whole(Slot),
    /// Copies where [`Slot::CornerIndices`] or [`Slot::Offsets`] is asked for in a sweep.
    CopiesOf(Slot),
}

/// What acts on one vertex; `Update` of bindings.wgsl.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Update {
    pub vertex: u32,
    pub is_pinned: u32,
    pub force: [f32; 3],
    pub place: [f32; 3],
}

/// `Spring` of bindings.wgsl.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Spring {
    pub vertices: [u32; 2],
    pub copies: [u32; 2],
    pub slots: [u32; 2],
    pub multiplier: u32,
    pub rest_length: f32,
    pub stiffness: f32,
    pub part: u32,
}

/// `Attachment` of bindings.wgsl.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Attachment {
    pub vertex: u32,
    pub copy_index: u32,
    pub slot: u32,
    pub multiplier: u32,
    pub stiffness: f32,
    pub part: u32,
}

/// Multipliers begin at a multiple of this: the alignment [bytes] that devices may ask of a binding.
const ALIGNMENT: u64 = 256;

/// All buffers of a solver.
#[derive(Debug)]
pub(super) struct Buffers {
    pub all: Vec<(Slot, wgpu::Buffer)>,
    /// Copies per block and corner, and where those of each vertex begin.
    copies: Option<[wgpu::Buffer; 2]>,
    /// Bytes of all positions, and where multipliers begin [bytes].
    pub points_size: u64,
    pub multipliers_start: u64,
    /// Numbers of the long vector of all unknowns.
    pub length: u32,
}

impl Buffers {
    pub fn new(
        device: &Device,
        model: &Model<f32>,
        settings: &SolverSettings,
        layout: &Layout,
        left_over: &[u8],
    ) -> Result<Self, GpuError> {
        let vertices = model.vertex_count() as u64;
        let points_size = 16 * vertices;
        let multipliers_start = points_size.next_multiple_of(ALIGNMENT);
        let unknowns = multipliers_start + 4 * (model.multiplier_count as u64).max(1);
        let xpbd = settings.method == Method::Xpbd;
        let accelerated = xpbd && settings.acceleration != Acceleration::None;
        let anderson = accelerated && settings.acceleration == Acceleration::Anderson;
        let history =
            if anderson { unknowns * (u64::from(settings.anderson_window) + 1) } else { 0 };
        let viscous = model.tet_sets().iter().any(|set| set.viscous);
        let blocks = model.tet_sets().iter().map(|set| set.block_count() as u64).sum::<u64>();
        let guarded = settings.guards_steps();
        let when = |wanted: bool, size: u64| if wanted { size } else { 0 };
        let element_count = LANES as u64 * blocks
            + (model.springs.stiffness.len() + model.attachments.stiffness.len()) as u64;
        let split = model.is_split();
        use Slot::*;
        let sizes = [
            (Points, "positions", 0),
            (Copies, "copies of vertices", when(split, 16 * model.copy_count() as u64)),
            (Multipliers, "multipliers", 0),
            (Loads, "loads", 16 * layout.slot_count()),
            (Velocities, "velocities", points_size),
            (Previous, "positions", points_size),
            (Predicted, "positions", points_size),
            (Acting, "forces", points_size),
            (Targets, "positions", points_size),
            (Updates, "inputs", size_of::<Update>() as u64 * vertices),
            (StartStrain, "strains", when(viscous, 6 * 4 * LANES as u64 * blocks)),
            (Unknowns, "unknowns", unknowns),
            (Iterate, "unknowns", when(accelerated, unknowns)),
            (Older, "unknowns", when(accelerated && !anderson, unknowns)),
            (Residuals, "Anderson's residuals", history),
            (Mapped, "Anderson's iterates", history),
            (PartialSums, "partial sums", layout.partial_sums_size()),
            (Control, "control record", super::layout::CONTROL_SIZE),
            (Anchors, "anchors", 16 * model.attachments.stiffness.len() as u64),
            (Best, "positions", when(guarded, points_size)),
            (Trial, "positions", when(guarded, points_size)),
            (Energies, "energies", when(guarded, 4 * element_count)),
            (Parts, "parts", super::layout::PART_SIZE * model.component_count as u64),
        ];
        let limits = device.limits();
        let limit = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let tets = model.tet_count() as u64;
        let fits = |what: &'static str, needed: u64| {
            if needed <= limit {
                return Ok(());
            }
            let largest = (tets as f64 * limit as f64 / needed as f64) as u64;
            Err(GpuError::TooLarge { what, needed, limit, name: device.name().to_owned(), largest })
        };
        for (_, what, size) in sizes {
            fits(what, size)?;
        }
        let constants = layout.constants(model);
        for (_, what, bytes) in &constants {
            fits(what, bytes.len() as u64)?;
        }

        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
        let make = |label: &str, size: u64, usage: BufferUsages| {
            let buffer = device.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                // A binding is never empty.
                size: size.max(512).next_multiple_of(16),
                usage,
                mapped_at_creation: false,
            });
            if !left_over.is_empty() {
                let memory = left_over.repeat(buffer.size() as usize / left_over.len());
                device.queue.write_buffer(&buffer, 0, &memory);
            }
            buffer
        };
        let filled = |label: &str, bytes: &[u8]| {
            let buffer = make(label, bytes.len() as u64, usage);
            device.queue.write_buffer(&buffer, 0, bytes);
            buffer
        };
        let mut all = Vec::new();
        for (slot, label, size) in sizes {
            if !matches!(slot, Points | Multipliers) {
                let usage = if slot == Unknowns { usage | BufferUsages::VERTEX } else { usage };
                all.push((slot, make(label, size, usage)));
            }
        }
        for (slot, label, bytes) in &constants {
            all.push((*slot, filled(label, bytes)));
        }
        let weights = make("weights", when(accelerated, unknowns), usage);
        all.push((Weights, weights));
        let copies = split.then(|| {
            let [indices, offsets] = Layout::copies(model);
            [filled("copies of corners", &indices), filled("copies of vertices", &offsets)]
        });
        Ok(Self { all, copies, points_size, multipliers_start, length: (unknowns / 4) as u32 })
    }

    /// A buffer of its own.
    pub fn buffer(&self, slot: Slot) -> &wgpu::Buffer {
        let found = self.all.iter().find(|(own, _)| *own == slot);
        &found.expect("positions and multipliers, which have none, lie in `Unknowns`").1
    }

    /// What a kernel finds at a binding.
    pub fn bound(&self, place: Place) -> wgpu::BufferBinding<'_> {
        let whole = |buffer| wgpu::BufferBinding { buffer, offset: 0, size: None };
        match (place, &self.copies) {
            (Place::CopiesOf(Slot::CornerIndices), Some([indices, _])) => whole(indices),
            (Place::CopiesOf(Slot::Offsets), Some([_, offsets])) => whole(offsets),
            (Place::CopiesOf(Slot::Points), Some(_)) => whole(self.buffer(Slot::Copies)),
            (Place::Whole(Slot::Points) | Place::CopiesOf(Slot::Points), _) => {
                let size = std::num::NonZero::new(self.points_size);
                wgpu::BufferBinding { buffer: self.buffer(Slot::Unknowns), offset: 0, size }
            }
            (Place::Whole(Slot::Multipliers) | Place::CopiesOf(Slot::Multipliers), _) => {
                let offset = self.multipliers_start;
                wgpu::BufferBinding { buffer: self.buffer(Slot::Unknowns), offset, size: None }
            }
            (Place::Whole(slot) | Place::CopiesOf(slot), _) => whole(self.buffer(slot)),
        }
    }

    /// Bytes of device memory.
    pub fn bytes(&self) -> u64 {
        let copies = self.copies.iter().flatten();
        self.all.iter().map(|(_, buffer)| buffer).chain(copies).map(wgpu::Buffer::size).sum()
    }
}
