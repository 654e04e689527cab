//! The buffer map: what lies in the device's memory.

use wgpu::BufferUsages;

use super::control::control_size;
use super::device::Device;
use super::error::GpuError;
use super::layout::{DeviceLayout, Table, tets};
use super::limits::{accelerates, window};
use super::outgoing::Outgoing;
use super::slots::{Place, Range, Slot, Update, multipliers_start, unknowns_size};
use crate::layout::{Layout, TetBlock};
use crate::scalar::lanes::LANES;
use crate::settings::{Acceleration, Method, SolverSettings};
use crate::solver::quasi_newton::on_device::DeviceLevels;
use crate::solver::quasi_newton::progress::PartProgress;
use crate::solver::step::recovered::on_device::Extent;

/// All buffers of a solver.
pub(super) struct Buffers {
    all: Vec<(Slot, wgpu::Buffer)>,
    ranges: Vec<Range>,
    /// Copies per block and corner, and where those of each vertex begin.
    copies: Option<[wgpu::Buffer; 2]>,
    /// Bytes of all positions, and where multipliers begin [bytes].
    pub points_size: u64,
    pub multipliers_start: u64,
    /// Numbers of the long vector of all unknowns.
    pub length: u32,
}

/// Every array fits into a binding; the error names the one that would need to shrink most.
fn check_sizes(device: &Device, tets: u64, arrays: &[Size]) -> Result<(), GpuError> {
    let limits = device.limits();
    let limit = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    let Some(&Size { what, bytes: needed, .. }) = arrays.iter().max_by_key(|size| size.bytes)
    else {
        return Ok(());
    };
    if needed <= limit {
        return Ok(());
    }
    let largest = (tets as f64 * limit as f64 / needed as f64) as u64;
    Err(GpuError::TooLarge { what, needed, limit, name: device.name().to_owned(), largest })
}

/// What the quasi-Newton method has beside the others, and recovered-gradient tetrahedra.
fn sizes_of_levels(
    layout: &Layout<f32>,
    levels: Option<&DeviceLevels>,
) -> [(Slot, &'static str, u64); 5] {
    let pair = 3 * 16 * u64::from(DeviceLayout::stride(layout));
    let progress = (size_of::<PartProgress>() * layout.part_count()) as u64;
    let recovery = Extent::new(layout).map_or(0, |extent| 16 * extent.vectors(layout));
    let [words, numbers, pairs, progress] = levels.map_or([0; 4], |levels| {
        [4 * levels.words, 4 * levels.numbers, pair * u64::from(levels.history), progress]
    });
    [
        (Slot::Levels, "tables of levels", words),
        (Slot::Multilevel, "levels", numbers),
        (Slot::Pairs, "pairs of steps", pairs),
        (Slot::Progress, "solves", progress),
        (Slot::Recovery, "recovered gradients", recovery),
    ]
}

/// An array, and the buffer that it is.
pub(super) struct Size {
    pub slot: Slot,
    pub what: &'static str,
    pub bytes: u64,
}

/// Copies of corners, and where those of each vertex begin: no slot of their own, see [`Place::CopiesOf`].
const OF_COPIES: [&str; 2] = ["copies of corners", "copies of vertices"];

impl Buffers {
    /// All arrays of a model, whose tables these are: `levels` for the quasi-Newton method.
    pub fn sizes(
        layout: &Layout<f32>,
        settings: &SolverSettings,
        on_device: &DeviceLayout,
        levels: Option<&DeviceLevels>,
        table: &Table,
    ) -> Vec<Size> {
        let vertices = layout.vertex_count() as u64;
        let unknowns = unknowns_size(layout);
        let accelerated = accelerates(settings);
        let anderson = accelerated && settings.acceleration == Acceleration::Anderson;
        let history = if anderson { unknowns * (u64::from(window(settings)) + 1) } else { 0 };
        let all_blocks = layout.block_count() as u64;
        // Solves find the strain where they start as they go.
        let keeps_strain = layout.is_viscous() && settings.method != Method::QuasiNewton;
        let blocks = if keeps_strain { all_blocks } else { 0 };
        let when = |wanted: bool, size: u64| if wanted { size } else { 0 };
        let copies = when(layout.is_split(), 16 * layout.copy_count() as u64);
        let lanes = LANES as u64;
        let contact = on_device.vectors();
        let own = [
            (Slot::Copies, "copies of vertices", copies),
            (Slot::Loads, "loads", 16 * (on_device.slot_count() + contact)),
            (Slot::Updates, "inputs", size_of::<Update>() as u64 * vertices),
            (Slot::StartStrain, "strains", 6 * 4 * lanes * blocks),
            (Slot::Unknowns, "unknowns", unknowns),
            (Slot::Iterate, "unknowns before", when(accelerated, unknowns)),
            (Slot::Older, "older unknowns", when(accelerated && !anderson, unknowns)),
            (Slot::Residuals, "Anderson's residuals", history),
            (Slot::Mapped, "Anderson's iterates", history),
            (Slot::PartialSums, "partial sums", table.sums_size),
            (Slot::Control, "control records", control_size(layout.part_count())),
            (Slot::VertexData, "vertices", table.vertex_data_size),
            (Slot::Tets, "tetrahedra", size_of::<TetBlock<f32>>() as u64 * all_blocks),
            (Slot::Table, "tables", table.bytes.len() as u64),
        ];
        let all = own.into_iter().chain(sizes_of_levels(layout, levels));
        all.map(|(slot, what, bytes)| Size { slot, what, bytes }).collect()
    }

    pub fn new(
        device: &Device,
        layout: &Layout<f32>,
        settings: &SolverSettings,
        on_device: &DeviceLayout,
        levels: Option<&DeviceLevels>,
        left_over: &[u8],
    ) -> Result<Self, GpuError> {
        let points_size = 16 * layout.vertex_count() as u64;
        let multipliers_start = multipliers_start(layout.vertex_count());
        let unknowns = unknowns_size(layout);
        let table = on_device.table(layout, settings);
        let sizes = Self::sizes(layout, settings, on_device, levels, &table);
        check_sizes(device, layout.tet_count() as u64, &sizes)?;

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
        let fill = |buffer: wgpu::Buffer, bytes: &[u8]| {
            device.queue.write_buffer(&buffer, 0, bytes);
            buffer
        };
        let mut all = Vec::new();
        for Size { slot, what, bytes } in sizes {
            let usage = if slot == Slot::Unknowns { usage | BufferUsages::VERTEX } else { usage };
            let buffer = make(what, bytes, usage);
            all.push((
                slot,
                match slot {
                    Slot::Tets => fill(buffer, &tets(layout)),
                    Slot::Table => fill(buffer, &table.bytes),
                    _ => buffer,
                },
            ));
        }
        let copies = layout.is_split().then(|| {
            let of_copies = DeviceLayout::copies(layout);
            std::array::from_fn(|i| {
                let bytes = &of_copies[i];
                fill(make(OF_COPIES[i], bytes.len() as u64, usage), bytes)
            })
        });
        let mut ranges = table.ranges;
        let (start, size) = (multipliers_start, unknowns - multipliers_start);
        let owner = Slot::Unknowns;
        ranges.push(Range { slot: Slot::Points, owner, start: 0, size: points_size });
        ranges.push(Range { slot: Slot::Multipliers, owner, start, size });
        let length = (unknowns / 4) as u32;
        Ok(Self { all, ranges, copies, points_size, multipliers_start, length })
    }

    /// The buffer that a slot lies in, and where.
    fn find(&self, slot: Slot) -> wgpu::BufferBinding<'_> {
        let range = self.ranges.iter().find(|range| range.slot == slot);
        let owner = range.map_or(slot, |range| range.owner);
        let found = self.all.iter().find(|(own, _)| *own == owner);
        wgpu::BufferBinding {
            buffer: &found.expect("every slot has a buffer or a range").1,
            offset: range.map_or(0, |range| range.start),
            size: range.and_then(|range| std::num::NonZero::new(range.size)),
        }
    }

    /// A buffer that belongs to a slot, or that holds its range.
    pub fn buffer(&self, slot: Slot) -> &wgpu::Buffer {
        self.find(slot).buffer
    }

    /// Where a slot begins in its buffer, and its length [bytes].
    pub fn span(&self, slot: Slot) -> [u64; 2] {
        let found = self.find(slot);
        let size = found.size.map_or(found.buffer.size() - found.offset, std::num::NonZero::get);
        [found.offset, size]
    }

    /// Writes the beginning of a slot.
    pub fn write(&self, queue: &wgpu::Queue, slot: Slot, bytes: &[u8]) {
        let found = self.find(slot);
        queue.write_buffer(found.buffer, found.offset, bytes);
    }

    /// As [`Buffers::write`], behind all that is on its way.
    pub fn send(&self, outgoing: &mut Outgoing, slot: Slot, bytes: &[u8]) {
        let found = self.find(slot);
        outgoing.write(found.buffer, found.offset, bytes);
    }

    /// The buffer or range at a kernel's binding.
    pub fn bound(&self, place: Place) -> wgpu::BufferBinding<'_> {
        let whole = |buffer| wgpu::BufferBinding { buffer, offset: 0, size: None };
        match (place, &self.copies) {
            (Place::CopiesOf(Slot::CornerIndices), Some([indices, _])) => whole(indices),
            (Place::CopiesOf(Slot::Offsets), Some([_, offsets])) => whole(offsets),
            (Place::CopiesOf(Slot::Points), Some(_)) => whole(self.buffer(Slot::Copies)),
            (Place::Whole(slot) | Place::CopiesOf(slot), _) => self.find(slot),
        }
    }

    /// Bytes of the largest binding.
    pub fn largest(&self) -> u64 {
        let copies = self.copies.iter().flatten();
        let all = self.all.iter().map(|(_, buffer)| buffer).chain(copies);
        all.map(wgpu::Buffer::size).max().unwrap_or(0)
    }

    /// Bytes of device memory.
    pub fn bytes(&self) -> u64 {
        let copies = self.copies.iter().flatten();
        self.all.iter().map(|(_, buffer)| buffer).chain(copies).map(wgpu::Buffer::size).sum()
    }
}
