//! How a model lies in the device's memory: its constants, where each constraint's loads go, and the
//! pieces in which sums are taken.

use bytemuck::{Pod, Zeroable};

use super::clusters::ClusterTables;
use super::limits::accelerates;
use super::members::{block_parts, elements, kind_by_kind, pieces};
use super::parts::{Fall, Parts, Piece, SmallSteps};
use super::slots::{ALIGNMENT, Element, Range, Slot, unknowns_size};
use crate::elements::law::LAWS;
use crate::elements::list::KIND_SIZES;
use crate::layout::Layout;
use crate::material::MaterialConstants;
use crate::scalar::lanes::LANES;
use crate::settings::{Method, SolverSettings};
use crate::solver::step::contacts::meetings::Meetings;
use crate::solver::step::contacts::on_device as on_device_contact;
use crate::solver::step::contacts::on_device::Samples;
use crate::solver::step::recovered::on_device;
use crate::solver::step::strain::is_recovered;

/// The material of a padding lane.
pub(super) const FILLING: u32 = u32::MAX;

/// Sums that a workgroup of Anderson's leaves.
pub(super) const PRODUCTS: u64 = 21;

/// Numbers that a workgroup leaves of a piece.
pub(super) const PIECE_SUMS: u64 = 24;

/// Numbers that it leaves of the shares of a step that are tried, and as many of the lengths of a descent.
pub(super) const LINE_SUMS: u64 = 16;

/// `Material` of elements/mod.wgsl.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Material {
    pub lame_lambda: f32,
    pub lame_mu: f32,
    pub compliance: [f32; 3],
    pub viscosity: f32,
}

/// Where everything stands in the table, the vertex data and the partial sums; the first words of the table.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Header {
    /// Words of the table.
    pub materials: u32,
    pub corners: u32,
    pub offsets: u32,
    pub elements: u32,
    pub pieces: u32,
    pub members: u32,
    pub parts: u32,
    pub runs: u32,
    pub block_parts: u32,
    pub recovered: u32,
    pub weights: u32,
    pub small_steps: u32,
    pub falls: u32,
    /// Vertices from one range of the vertex data to the next, and where anchors begin.
    pub stride: u32,
    pub anchors: u32,
    /// Places among the partial sums.
    pub lines: u32,
    pub energies: u32,
    /// Lanes of all tetrahedra, and the blocks where those of each law end.
    pub tet_lanes: u32,
    pub law_ends: [u32; LAWS],
    pub part_count: u32,
    /// Of clusters: rows, blocks where their colours begin, vertices, corners by the numbers of these.
    pub clusters: u32,
    pub cluster_starts: u32,
    pub cluster_vertices: u32,
    pub cluster_corners: u32,
    /// Of contact: samples, the number of the first among elements, where those of each vertex begin, and these; where their
    /// vectors begin among the loads, and sums of tools among the partial ones.
    pub samples: u32,
    pub first_sample: u32,
    pub sample_offsets: u32,
    pub sample_entries: u32,
    pub contact: u32,
    pub tool_sums: u32,
    /// Of tissue that meets tissue: where its row stands, and the number of the first sample or tie among elements.
    pub skin: u32,
    pub first_meeting: u32,
}

/// The ranges of the vertex data, in order, with the slot that kernels know them by; `None` for one that only the
/// guard knows. From the reference on there are the start of the step, the inertial prediction and the start of
/// the iteration, pins moved in all: `Starts` are these three. Behind them a line along which places are tried.
pub(super) const VERTEX_DATA: [(&str, Option<Slot>); 10] = [
    ("PREVIOUS", Some(Slot::Previous)),
    ("PREDICTED", Some(Slot::Predicted)),
    ("EXTERNAL_FORCES", Some(Slot::ExternalForces)),
    ("TARGETS", Some(Slot::Targets)),
    ("VELOCITIES", Some(Slot::Velocities)),
    ("REFERENCE", Some(Slot::Starts)),
    ("AHEAD", None),
    ("START", None),
    ("TRIAL", None),
    ("DIRECTION", None),
];
/// Of these, how many there are where steps are not guarded.
const UNGUARDED: usize = 6;

/// What the quasi-Newton method has from the reference on, in the place of all others: iterate, gradients there and at the
/// trial, `M` times the former, the direction, the start of the solve, velocities at the start of the step, places at the end
/// of the first solve.
const OF_QUASI_NEWTON: [&str; 8] = [
    "QN_BASE",
    "QN_GRADIENT",
    "QN_TRIAL_GRADIENT",
    "QN_Z",
    "QN_DIRECTION",
    "QN_STAGE_START",
    "QN_START_VELOCITIES",
    "QN_FIRST",
];

/// The place of the start of the solve among these.
const STAGE_START: u64 = 5;

/// Names and places of the ranges of the vertex data.
pub(super) fn vertex_ranges() -> impl Iterator<Item = (&'static str, u32)> {
    let common = VERTEX_DATA.map(|(name, _)| name).into_iter();
    (0..)
        .zip(common)
        .chain((UNGUARDED as u32 - 1..).zip(OF_QUASI_NEWTON).filter(|_| on_device::IS_THERE))
        .map(|(i, name)| (name, i))
}

/// Constants in one buffer, and the ranges of that and others.
pub(super) struct Table {
    pub bytes: Vec<u8>,
    pub ranges: Vec<Range>,
    /// Bytes of the vertex data and of all sums.
    pub vertex_data_size: u64,
    pub sums_size: u64,
}

/// How many pieces sums are taken in, which of them is the first of vertices, and how many workgroups
/// work on the long vector, part by part.
#[derive(Clone, Copy, Debug)]
pub struct Pieces {
    pub count: u32,
    pub first_of_vertices: u32,
    pub groups: u32,
}

/// Where loads go and what is summed together.
#[derive(Clone, Debug)]
pub(super) struct DeviceLayout {
    /// Where each vertex's loads begin, one more at the end.
    offsets: Vec<u32>,
    /// Place of the load of each corner, per block and corner.
    corners: Vec<[[u32; LANES]; 4]>,
    /// Sorted by colour.
    pub elements: Vec<Element>,
    /// Numbers of elements, tetrahedra first, part by part.
    members: Vec<u32>,
    /// First those of elements.
    pub pieces: Vec<Piece>,
    /// The part of each block.
    block_parts: Vec<u32>,
    pub parts: Parts,
    /// Of the surface, for the methods that compute contact.
    pub samples: Option<Samples>,
    /// Of tissue that meets tissue.
    pub meetings: Option<Meetings>,
}

impl DeviceLayout {
    pub fn new(layout: &Layout<f32>, settings: &SolverSettings) -> Self {
        // Every corner of every element writes its load to a slot of its own, and each vertex adds up its slots in
        // order: no atomics, and one order of sums whatever the device does. Slots are a counting sort by vertex.
        let mut counts = vec![0u32; layout.vertex_count() + 1];
        let mut count = |vertex: u32| {
            let place = &mut counts[vertex as usize];
            *place += 1;
            *place - 1
        };
        // Blocks stand part by part in each colour, so a part's loads have the order that they have in a model of the
        // part alone. Padding lanes keep slot 0, which is another's: kernels leave them out by their material FILLING.
        let mut corners = Vec::new();
        for set in &layout.tet_sets {
            let has_loads = !is_recovered(layout, set);
            for (block, &filled) in set.blocks.iter().zip(&set.filled) {
                let filled = if has_loads { filled } else { 0 };
                let mut ranks = [[0; LANES]; 4];
                for lane in 0..filled as usize {
                    for corner in 0..4 {
                        ranks[corner][lane] = count(block.vertices[corner][lane]);
                    }
                }
                corners.push(ranks);
            }
        }
        let mut elements = elements(layout);
        // Behind the tetrahedra, kind by kind: `load_forces` on the CPU adds them in that order.
        let by_kind = kind_by_kind(&elements);
        for &i in &by_kind {
            let element = &mut elements[i];
            for corner in 0..KIND_SIZES[element.kind as usize][0] {
                element.slots[corner] = count(element.vertices[corner]);
            }
        }
        // The entry behind the last vertex has counted nothing, so that it becomes the end of the last one's loads.
        let mut offsets = Vec::with_capacity(counts.len());
        let mut total = 0;
        for count in counts {
            offsets.push(total);
            total += count;
        }
        // Only now are the offsets known, so the ranks get them in a second pass, in the same order of blocks.
        let mut ranks = corners.iter_mut();
        for set in &layout.tet_sets {
            let has_loads = !is_recovered(layout, set);
            for (block, &filled) in set.blocks.iter().zip(&set.filled) {
                let Some(ranks) = ranks.next().filter(|_| has_loads) else { continue };
                for corner in 0..4 {
                    for lane in 0..filled as usize {
                        ranks[corner][lane] += offsets[block.vertices[corner][lane] as usize];
                    }
                }
            }
        }
        for element in &mut elements {
            // Entries beyond a kind's vertices repeat its first vertex; kernels stop before them.
            for (slot, vertex) in element.slots.iter_mut().zip(element.vertices) {
                *slot += offsets[vertex as usize];
            }
        }
        let samples = Samples::new(layout);
        let meetings = Meetings::new(layout, settings);
        let with = [Samples::known(samples).is_some(), Meetings::known(meetings).is_some()];
        let (members, pieces) = pieces(layout, &elements, &by_kind, with);
        let parts = Parts::new(layout, settings, &pieces);
        let block_parts = block_parts(layout);
        Self { offsets, corners, elements, members, pieces, block_parts, parts, samples, meetings }
    }

    /// Where a vertex's loads begin.
    pub fn first_load(&self, v: usize) -> usize {
        self.offsets[v] as usize
    }

    /// Places for loads.
    pub fn slot_count(&self) -> u64 {
        self.offsets.last().copied().unwrap_or(0).into()
    }

    /// The constants beside the tetrahedra, and where everything stands.
    pub fn table(&self, layout: &Layout<f32>, settings: &SolverSettings) -> Table {
        let (mut bytes, mut ranges) = (vec![0; ALIGNMENT as usize], Vec::new());
        // Appends a piece and returns its first word. A piece with a slot can be bound alone as well: hence it begins
        // where devices allow a binding to, and is padded. Without one, kernels find it by the header only.
        let mut add = |slot: Option<Slot>, new: &[u8]| {
            let start = bytes.len();
            bytes.extend(new);
            // A binding is never empty.
            let end = bytes.len().next_multiple_of(ALIGNMENT as usize).max(start + 256);
            bytes.resize(end, 0);
            let (start, size) = (start as u64, (end - start) as u64);
            ranges.extend(slot.map(|slot| Range { slot, owner: Slot::Table, start, size }));
            (start / 4) as u32
        };
        let words = |words: &[u32]| bytemuck::cast_slice(words).to_vec();
        // Places are known once everything before has been added, so the header is written last, into the 256 bytes
        // that were left free at the start; it must not outgrow them. The order of the pieces means nothing.
        let mut header = Header {
            materials: add(Some(Slot::Materials), &materials(layout)),
            corners: add(
                Some(Slot::CornerIndices),
                &words(self.corners.as_flattened().as_flattened()),
            ),
            offsets: add(Some(Slot::Offsets), &words(&self.offsets)),
            elements: add(None, bytemuck::cast_slice(&self.elements)),
            pieces: add(None, bytemuck::cast_slice(&self.pieces)),
            members: add(None, &words(&self.members)),
            parts: add(None, bytemuck::cast_slice(&self.parts.rows)),
            runs: add(None, &words(self.parts.runs.as_flattened())),
            block_parts: add(None, &words(&self.block_parts)),
            tet_lanes: (LANES * self.corners.len()) as u32,
            law_ends: law_ends(layout),
            part_count: layout.part_count() as u32,
            first_sample: u32::MAX,
            first_meeting: u32::MAX,
            ..Header::default()
        };
        // Room only: the host writes these at the start of a step, weights when its length changes. Offsets of
        // pieces that a method lacks stay zero, and none of its kernels reads them.
        let falls = vec![Fall::default(); layout.part_count()];
        header.falls = add(Some(Slot::Falls), bytemuck::cast_slice(&falls));
        if settings.method == Method::Explicit {
            let small = vec![SmallSteps::default(); layout.part_count()];
            header.small_steps = add(Some(Slot::SmallSteps), bytemuck::cast_slice(&small));
        }
        if on_device::Extent::new(layout).is_some() {
            header.recovered = add(None, &words(&on_device::words(layout)));
        }
        if let Some(tables) = ClusterTables::new(layout) {
            header.clusters = add(None, bytemuck::cast_slice(&tables.rows));
            header.cluster_starts = add(None, &words(&tables.starts));
            header.cluster_vertices = add(None, &words(&tables.vertices));
            header.cluster_corners = add(None, &words(tables.corners.as_flattened()));
        }
        if accelerates(settings) {
            let weights = vec![0; unknowns_size(layout) as usize];
            header.weights = add(Some(Slot::Weights), &weights);
        }

        if Samples::known(self.samples).is_some() {
            let tables = on_device_contact::tables(layout).map(|table| add(None, &words(&table)));
            [header.samples, header.sample_offsets, header.sample_entries] = tables;
        }
        if let Some(skin) = layout.skin.as_ref().zip(Meetings::known(self.meetings)) {
            header.skin = self.place_meetings(skin, &mut add);
        }
        self.place_ranges(&mut header, &mut ranges);
        let [start, size] = vertex_data(layout, settings, &mut ranges);
        (header.stride, header.anchors) = (Self::stride(layout), (start / 16) as u32);

        let [lines, energies, mut sums] = self.sums(settings);
        (header.lines, header.energies) = (lines as u32, energies as u32);
        if let Some(samples) = Samples::known(self.samples) {
            self.place_contact(samples, sums, &mut header, &mut ranges);
            sums += samples.sums();
        }
        bytes[..size_of::<Header>()].copy_from_slice(bytemuck::bytes_of(&header));
        Table { bytes, ranges, vertex_data_size: start + size, sums_size: 4 * sums }
    }

    /// Where contact stands among the loads, and forces of tools among the sums, from one of these on.
    fn place_contact(
        &self,
        samples: Samples,
        first_sum: u64,
        header: &mut Header,
        ranges: &mut Vec<Range>,
    ) {
        header.first_sample = header.tet_lanes + self.elements.len() as u32;
        header.contact = self.slot_count() as u32;
        header.tool_sums = first_sum as u32;
        let [start, size] = [16 * self.slot_count(), 16 * samples.vectors()];
        ranges.push(Range { slot: Slot::Contact, owner: Slot::Loads, start, size });
        let [start, size] = [4 * first_sum, 4 * samples.sums()];
        ranges.push(Range { slot: Slot::ToolSums, owner: Slot::PartialSums, start, size });
    }

    /// Where lines of the search and energies begin among the partial sums, and how many there are without those of tools.
    fn sums(&self, settings: &SolverSettings) -> [u64; 3] {
        let guarded = settings.guards_steps();
        let solves = settings.method == Method::QuasiNewton;
        // Sums of the accelerations are read before pieces leave theirs.
        let touches = Samples::known(self.samples).is_some();
        let pieces = if guarded || touches || solves { self.pieces.len() as u64 } else { 0 };
        // Lines of the search have places of their own, because workgroups write them while others still read the
        // pieces' sums; two a piece, because one dispatch reads shares and writes lengths. Energies at the
        // reference, one an element, stay for the whole step.
        let lines = (PRODUCTS * u64::from(self.parts.groups())).max(PIECE_SUMS * pieces);
        if solves {
            // In the place of both: products of pairs, and sums at the end of a step.
            let each = 2 * PIECE_SUMS * pieces;
            return [lines, lines + each, lines + 2 * each];
        }
        if !guarded {
            return [lines; 3];
        }
        let energies = lines + 2 * LINE_SUMS * pieces;
        let samples = Samples::known(self.samples).map_or(0, |samples| samples.count as usize);
        let elements = (LANES * self.corners.len() + self.elements.len() + samples) as u64;
        [lines, energies, energies + elements]
    }

    /// Vertices from one range of the vertex data to the next.
    pub fn stride(layout: &Layout<f32>) -> u32 {
        layout.vertex_count().next_multiple_of((ALIGNMENT / 16) as usize) as u32
    }

    /// How the work is divided.
    pub fn pieces(&self) -> Pieces {
        Pieces {
            count: self.pieces.len() as u32,
            first_of_vertices: self.pieces.partition_point(|piece| piece.are_vertices == 0) as u32,
            groups: self.parts.groups(),
        }
    }

    /// Copies of each corner, and where those of each vertex begin.
    pub fn copies(layout: &Layout<f32>) -> [Vec<u8>; 2] {
        let sets = layout.tet_sets.iter();
        let indices: Vec<u32> = sets
            .flat_map(|set| (0..set.block_count()).map(move |block| set.copies_of(block)))
            .flat_map(|corners| corners.as_flattened().iter().copied())
            .collect();
        [indices, copy_offsets(layout)].map(|words| bytemuck::cast_slice(&words).to_vec())
    }
}

/// The ranges of the vertex data; where anchors begin behind them, and their length [bytes].
fn vertex_data(
    layout: &Layout<f32>,
    settings: &SolverSettings,
    ranges: &mut Vec<Range>,
) -> [u64; 2] {
    // Data of vertices lie in one buffer, range by range, because the baseline allows a kernel eight
    // storage buffers. A guarded step's three starts are one binding: `predict` writes all of them.
    let each = 16 * u64::from(DeviceLayout::stride(layout));
    let guarded = settings.guards_steps();
    let solves = settings.method == Method::QuasiNewton;
    let common = if guarded { VERTEX_DATA.len() } else { UNGUARDED };
    let count = if solves { UNGUARDED - 1 + OF_QUASI_NEWTON.len() } else { common };
    for (place, (_, slot)) in VERTEX_DATA[..count.min(common)].iter().enumerate() {
        let size = if guarded && *slot == Some(Slot::Starts) { 3 * each } else { each };
        let start = each * place as u64;
        ranges.extend(slot.map(|slot| Range { slot, owner: Slot::VertexData, start, size }));
    }
    // Where the last solve started: viscous recovered-gradient tetrahedra are measured against it.
    let start = each * (UNGUARDED as u64 - 1 + STAGE_START);
    let stage = Range { slot: Slot::StageStart, owner: Slot::VertexData, start, size: each };
    ranges.extend(solves.then_some(stage));
    let start = each * count as u64;
    let size = (16 * layout.rest_anchors.len() as u64).next_multiple_of(ALIGNMENT).max(ALIGNMENT);
    ranges.push(Range { slot: Slot::Anchors, owner: Slot::VertexData, start, size });
    [start, size]
}

/// Where a vertex's copies begin is marked so in parts where no vertex has several: there copies are vertices,
/// and nothing is averaged.
pub(super) const WHOLE: u32 = 1 << 31;

/// Where the copies of each vertex begin, one more at the end.
pub(super) fn copy_offsets(layout: &Layout<f32>) -> Vec<u32> {
    let mut offsets = layout.copy_offsets.clone();
    for part in layout.parts.iter().filter(|part| !part.is_split()) {
        offsets[part.vertices.clone()].iter_mut().for_each(|first| *first |= WHOLE);
    }
    offsets
}

/// The blocks where the tetrahedra of each law end.
fn law_ends(layout: &Layout<f32>) -> [u32; LAWS] {
    let mut end = 0;
    layout.tet_sets.each_ref().map(|set| {
        end += set.block_count() as u32;
        end
    })
}

/// Tetrahedra as `TetBlock` of bindings.wgsl.
pub(super) fn tets(layout: &Layout<f32>) -> Vec<u8> {
    let mut words = Vec::new();
    for set in &layout.tet_sets {
        for (block, &filled) in set.blocks.iter().zip(&set.filled) {
            words.extend(block.vertices.as_flattened());
            words.extend(block.inverse_rest_shape.as_flattened().iter().map(|x| x.to_bits()));
            words.extend(block.rest_volume.iter().map(|x| x.to_bits()));
            let kind = |lane: usize| {
                if lane < filled as usize { block.material[lane] } else { FILLING }
            };
            words.extend((0..LANES).map(kind));
        }
    }
    bytemuck::cast_slice(&words).to_vec()
}

fn materials(layout: &Layout<f32>) -> Vec<u8> {
    let of = |m: &MaterialConstants<f32>| Material {
        lame_lambda: m.lame_lambda,
        lame_mu: m.lame_mu,
        compliance: [m.compliance.normal, m.compliance.cross, m.compliance.shear],
        viscosity: m.viscosity,
    };
    let constants: Vec<Material> = layout.materials.iter().map(of).collect();
    bytemuck::cast_slice(&constants).to_vec()
}
