//! How a model lies in the device's memory: its constants, where each constraint's loads go, and the
//! pieces in which sums are taken.

use bytemuck::{Pod, Zeroable};

use super::buffers::{ALIGNMENT, Attachment, Range, Slot, Spring};
use crate::model::Model;
use crate::scalar::lanes::LANES;

/// Bytes of `Control` in control.wgsl.
pub(super) const CONTROL_SIZE: u64 = 524;

/// The material of a lane that only fills a block up.
pub(super) const FILLING: u32 = u32::MAX;

/// Workgroups that sum products of long vectors: enough to keep a large device busy, few enough for one
/// workgroup to add up what they leave.
pub(super) const SUM_GROUPS: u32 = 512;

/// Sums that a workgroup of Anderson's leaves.
pub(super) const PRODUCTS: u64 = 21;

/// Elements or vertices whose energies one workgroup sums, and the numbers that it leaves.
pub(super) const PIECE: usize = 512;
const PIECE_SUMS: u64 = 24;

/// Numbers that the energy limit leaves for each part of the model.
pub(super) const PART_NUMBERS: usize = 4;

/// Where everything stands in the table, the ground and the partial sums; the first words of the table.
/// potential.wgsl has the same order.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
struct Header {
    /// Words of the table.
    materials: u32,
    corners: u32,
    offsets: u32,
    springs: u32,
    attachments: u32,
    pieces: u32,
    members: u32,
    /// Vertices from one range of the ground to the next, and where anchors begin.
    stride: u32,
    anchors: u32,
    /// Places among the partial sums.
    parts: u32,
    energies: u32,
    vertex_count: u32,
    /// Lanes of all tetrahedra, and of those before the first neo-Hookean one.
    tet_lanes: u32,
    neo_hookean_from: u32,
    spring_count: u32,
    attachment_count: u32,
    piece_count: u32,
}

/// The ranges of the ground that kernels know by a slot, in order; `None` for one that only the guard
/// knows. Starts are three.
const GROUND: [Option<Slot>; 10] = [
    Some(Slot::Previous),
    Some(Slot::Predicted),
    Some(Slot::Acting),
    Some(Slot::Targets),
    Some(Slot::Velocities),
    Some(Slot::Starts),
    None,
    None,
    None,
    None,
];
/// Of these, how many there are where steps are not guarded.
const UNGUARDED: usize = 6;

/// Constants in one buffer, and the ranges of that and others.
pub(super) struct Table {
    pub bytes: Vec<u8>,
    pub ranges: Vec<Range>,
    /// Bytes of what belongs to vertices, and of all sums.
    pub ground_size: u64,
    pub sums_size: u64,
    /// Where the parts' numbers begin among the sums [bytes].
    pub parts_start: u64,
}

/// Where loads go and what is summed together.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    /// Where each vertex's loads begin, one more at the end.
    offsets: Vec<u32>,
    /// Place of the load of each corner, per block and corner.
    corners: Vec<[[u32; LANES]; 4]>,
    springs: Vec<Spring>,
    attachments: Vec<Attachment>,
    /// Elements and vertices, part by part.
    members: Vec<u32>,
    /// `(part, first, end, 1 for vertices)` among the members; then for each part the range of its
    /// pieces of elements and that of its pieces of vertices.
    pieces: Vec<[u32; 4]>,
    /// Pieces without the ranges behind them.
    pub piece_count: u32,
}

impl Layout {
    pub fn new(model: &Model<f32>) -> Self {
        let of = |vertex: u32| model.numbering.of(vertex) as u32;
        let mut counts = vec![0u32; model.vertex_count() + 1];
        let mut count = |vertex: u32| {
            let place = &mut counts[vertex as usize];
            *place += 1;
            *place - 1
        };
        // First the rank of each load at its vertex, then places.
        let mut corners = Vec::new();
        for set in model.tet_sets() {
            for (block, &filled) in set.blocks.iter().zip(&set.filled) {
                let mut ranks = [[0; LANES]; 4];
                for lane in 0..filled as usize {
                    for corner in 0..4 {
                        ranks[corner][lane] = count(block.vertices[corner][lane]);
                    }
                }
                corners.push(ranks);
            }
        }
        let model_springs = &model.springs;
        let mut springs: Vec<Spring> = Vec::new();
        for (i, ends) in model_springs.vertices.iter().enumerate() {
            let vertices = ends.map(of);
            springs.push(Spring {
                vertices,
                copies: model_springs.copies[i],
                slots: vertices.map(&mut count),
                multiplier: (model_springs.multiplier_offset + i) as u32,
                rest_length: model_springs.rest_length[i],
                stiffness: model_springs.stiffness[i],
                part: model.part_at(vertices[0] as usize) as u32,
            });
        }
        let held = &model.attachments;
        let mut attachments: Vec<Attachment> = Vec::new();
        for (i, &vertex) in held.vertices.iter().enumerate() {
            let vertex = of(vertex);
            attachments.push(Attachment {
                vertex,
                copy_index: held.copies[i],
                slot: count(vertex),
                multiplier: (held.multiplier_offset + 3 * i) as u32,
                stiffness: held.stiffness[i],
                part: model.part_at(vertex as usize) as u32,
            });
        }
        let mut offsets = Vec::with_capacity(counts.len());
        let mut total = 0;
        for count in counts {
            offsets.push(total);
            total += count;
        }
        let mut blocks =
            model.tet_sets().into_iter().flat_map(|set| set.blocks.iter().zip(&set.filled));
        for ranks in &mut corners {
            let Some((block, &filled)) = blocks.next() else { break };
            for corner in 0..4 {
                for lane in 0..filled as usize {
                    ranks[corner][lane] += offsets[block.vertices[corner][lane] as usize];
                }
            }
        }
        for spring in &mut springs {
            for (slot, vertex) in spring.slots.iter_mut().zip(spring.vertices) {
                *slot += offsets[vertex as usize];
            }
        }
        for attachment in &mut attachments {
            attachment.slot += offsets[attachment.vertex as usize];
        }
        let (members, pieces) = pieces(model, &springs, &attachments);
        let piece_count = (pieces.len() - model.part_count()) as u32;
        Self { offsets, corners, springs, attachments, members, pieces, piece_count }
    }

    /// Where a vertex's loads begin.
    pub fn first_load(&self, v: usize) -> usize {
        self.offsets[v] as usize
    }

    /// Places for loads.
    pub fn slot_count(&self) -> u64 {
        self.offsets.last().copied().unwrap_or(0).into()
    }

    /// What never changes beside the tetrahedra, and where everything stands.
    pub fn table(&self, model: &Model<f32>, guarded: bool) -> Table {
        let (mut bytes, mut ranges) = (vec![0; ALIGNMENT as usize], Vec::new());
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
        let mut header = Header {
            materials: add(Some(Slot::Materials), &materials(model)),
            corners: add(
                Some(Slot::CornerIndices),
                &words(self.corners.as_flattened().as_flattened()),
            ),
            offsets: add(Some(Slot::Offsets), &words(&self.offsets)),
            springs: add(Some(Slot::Springs), bytemuck::cast_slice(&self.springs)),
            attachments: add(Some(Slot::Attachments), bytemuck::cast_slice(&self.attachments)),
            pieces: add(None, &words(self.pieces.as_flattened())),
            members: add(None, &words(&self.members)),
            vertex_count: model.vertex_count() as u32,
            tet_lanes: (LANES * self.corners.len()) as u32,
            neo_hookean_from: (LANES * model.green_strain.block_count()) as u32,
            spring_count: self.springs.len() as u32,
            attachment_count: self.attachments.len() as u32,
            piece_count: self.piece_count,
            ..Header::default()
        };

        let each = 16 * u64::from(Self::stride(model));
        let count = if guarded { GROUND.len() } else { UNGUARDED };
        for (place, slot) in GROUND[..count].iter().enumerate() {
            let size = if guarded && *slot == Some(Slot::Starts) { 3 * each } else { each };
            let start = each * place as u64;
            ranges.extend(slot.map(|slot| Range { slot, owner: Slot::Ground, start, size }));
        }
        let start = each * count as u64;
        let size = (16 * self.attachments.len() as u64).next_multiple_of(ALIGNMENT).max(ALIGNMENT);
        ranges.push(Range { slot: Slot::Anchors, owner: Slot::Ground, start, size });
        (header.stride, header.anchors) = (Self::stride(model), (start / 16) as u32);

        let pieces = PIECE_SUMS * u64::from(self.piece_count);
        let parts = (PRODUCTS * u64::from(SUM_GROUPS)).max(if guarded { pieces } else { 0 });
        let energies = parts + (PART_NUMBERS * model.part_count()) as u64;
        let elements = header.tet_lanes + header.spring_count + header.attachment_count;
        let sums = energies + if guarded { elements.into() } else { 0 };
        (header.parts, header.energies) = (parts as u32, energies as u32);
        bytes[..size_of::<Header>()].copy_from_slice(bytemuck::bytes_of(&header));
        let ground_size = start + size;
        Table { bytes, ranges, ground_size, sums_size: 4 * sums, parts_start: 4 * parts }
    }

    /// Vertices from one range of the ground to the next.
    pub fn stride(model: &Model<f32>) -> u32 {
        model.vertex_count().next_multiple_of((ALIGNMENT / 16) as usize) as u32
    }

    /// The first piece of vertices.
    pub fn first_of_vertices(&self) -> u32 {
        let pieces = &self.pieces[..self.piece_count as usize];
        pieces.partition_point(|piece| piece[3] == 0) as u32
    }

    /// Copies of each corner, and where those of each vertex begin.
    pub fn copies(model: &Model<f32>) -> [Vec<u8>; 2] {
        let sets = model.tet_sets().into_iter();
        let indices: Vec<u32> = sets
            .flat_map(|set| (0..set.block_count()).map(move |block| set.copies_of(block)))
            .flat_map(|corners| corners.as_flattened().iter().copied())
            .collect();
        [indices, model.copy_offsets.clone()].map(|words| bytemuck::cast_slice(&words).to_vec())
    }
}

/// Members of each part, in pieces.
fn pieces(
    model: &Model<f32>,
    springs: &[Spring],
    attachments: &[Attachment],
) -> (Vec<u32>, Vec<[u32; 4]>) {
    let mut elements = Vec::new();
    let mut first = 0;
    for set in model.tet_sets() {
        for (block, lane) in set.places() {
            let part = model.part_at(set.blocks[block].vertices[0][lane] as usize) as u32;
            elements.push((part, (LANES * (first + block) + lane) as u32));
        }
        first += set.block_count();
    }
    let first = (LANES * first) as u32;
    let after = |i: usize, before: usize| first + (before + i) as u32;
    elements.extend(springs.iter().enumerate().map(|(i, s)| (s.part, after(i, 0))));
    let before = springs.len();
    elements.extend(attachments.iter().enumerate().map(|(i, a)| (a.part, after(i, before))));
    elements.sort_by_key(|&(part, _)| part);
    let mut vertices: Vec<(u32, u32)> =
        (0..model.vertex_count()).map(|v| (model.part_at(v) as u32, v as u32)).collect();
    vertices.sort_by_key(|&(part, _)| part);

    let mut ranges = vec![[0u32; 4]; model.part_count()];
    let (mut members, mut pieces) = (Vec::new(), Vec::new());
    for (kind, list) in [elements, vertices].into_iter().enumerate() {
        for of_part in list.chunk_by(|a, b| a.0 == b.0) {
            let part = of_part[0].0;
            ranges[part as usize][2 * kind] = pieces.len() as u32;
            for piece in of_part.chunks(PIECE) {
                let first = members.len() as u32;
                members.extend(piece.iter().map(|&(_, member)| member));
                pieces.push([part, first, members.len() as u32, kind as u32]);
            }
            ranges[part as usize][2 * kind + 1] = pieces.len() as u32;
        }
    }
    pieces.extend(ranges);
    (members, pieces)
}

/// Tetrahedra as `TetBlock` of bindings.wgsl.
pub(super) fn tets(model: &Model<f32>) -> Vec<u8> {
    let mut words = Vec::new();
    for set in model.tet_sets() {
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

fn materials(model: &Model<f32>) -> Vec<u8> {
    let constants: Vec<f32> = model
        .materials
        .iter()
        .flat_map(|m| {
            let c = &m.compliance;
            [m.lame_lambda, m.lame_mu, c.normal, c.cross, c.shear, m.viscosity]
        })
        .collect();
    bytemuck::cast_slice(&constants).to_vec()
}
