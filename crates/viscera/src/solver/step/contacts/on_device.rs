//! Contact with tools on a device: what kernels know of samples and tools, and what they keep of them.
//!
//! Every sample of the surface has so many slots, one for each tool that it may meet in a step: no list of pairs, nothing that
//! could overflow in silence. A sample that may meet more leaves out those that are farthest, and says so.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use super::{Contacts, Gift};
use crate::contact::distance_grid::{BRICK, DistanceGrid, WHOLE};
use crate::contact::{Friction, MOST_TOOLS_ON_DEVICES, Shape, Side, Tool, Touch, Touching, Wrench};
use crate::layout::{LaidSample, Layout};
use crate::scalar::rigid::{RigidTransform, axis_times_sine, rotation_vector};
use crate::scalar::{Vec3, vec3};
use crate::sorting;
use crate::state::ContactState;

/// Whether kernels are there.
pub const IS_THERE: bool = cfg!(feature = "gpu-solves");

/// Tools, and their parts, at most: a power of two.
pub const MOST_TOOLS: usize = MOST_TOOLS_ON_DEVICES;

/// Tools that a sample may meet in a step.
pub const SLOTS: usize = 3;

/// Vectors of a slot, those before the first and all of a sample, words of a sample in the table, numbers that are summed for a tool.
const SLOT_VECTORS: usize = 4;
const FIRST_SLOT: usize = 3;
pub const SAMPLE_VECTORS: usize = FIRST_SLOT + SLOTS * SLOT_VECTORS;
const SAMPLE_WORDS: usize = 10;
const TOOL_SUMS: usize = 16;

/// Sums of all tools.
pub const ALL_SUMS: usize = TOOL_SUMS * MOST_TOOLS;

/// Words of a row of distances.
pub const GRID_ROW: u32 = 4096;

/// Samples whose forces one workgroup sums.
const SUMMED: usize = 256;

/// Marks of a slot, beside the tool's number: it has met a plane, it is tied, or will be in the next step, it was kept.
const HAS_PLANE: u32 = 16;
const IS_TIED: u32 = 32;
const WILL_BE_TIED: u32 = 64;
const IS_KEPT: u32 = 128;

/// The limit of friction of what is tied.
const LOCKED: f32 = 1e30;

/// Names and values that kernels share.
pub fn names() -> [(&'static str, u32); 17] {
    [
        ("MOST_TOOLS", MOST_TOOLS as u32),
        ("SLOTS", SLOTS as u32),
        ("SLOT_VECTORS", SLOT_VECTORS as u32),
        ("FIRST_SLOT", FIRST_SLOT as u32),
        ("SAMPLE_VECTORS", SAMPLE_VECTORS as u32),
        ("SAMPLE_WORDS", SAMPLE_WORDS as u32),
        ("SAMPLE_WEIGHTS", 4),
        ("SAMPLE_STIFFNESS", 8),
        ("SAMPLE_PART", 9),
        ("TOOL_SUMS", TOOL_SUMS as u32),
        ("GRID_ROW", GRID_ROW),
        ("BRICK", BRICK as u32),
        ("WHOLE_BRICK", WHOLE),
        ("HAS_PLANE", HAS_PLANE),
        ("IS_TIED", IS_TIED),
        ("WILL_BE_TIED", WILL_BE_TIED),
        ("IS_KEPT", IS_KEPT),
    ]
}

/// How much there is to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Samples {
    pub count: u32,
    /// Workgroups that sum their forces.
    pub groups: u32,
}

impl Samples {
    /// Of a layout whose surface has any.
    pub fn new(layout: &Layout<f32>) -> Option<Self> {
        let count = layout.samples.len();
        let groups = count.div_ceil(SUMMED) as u32;
        (IS_THERE && count > 0).then_some(Self { count: count as u32, groups })
    }

    /// The same, known to be none where no kernels are: such builds leave out what asks.
    #[inline]
    pub fn known(samples: Option<Self>) -> Option<Self> {
        samples.filter(|_| IS_THERE)
    }

    /// Vectors behind the loads.
    pub fn vectors(self) -> u64 {
        SAMPLE_VECTORS as u64 * u64::from(self.count)
    }

    /// Numbers of sums: of all tools, and of each workgroup.
    pub fn sums(self) -> u64 {
        ALL_SUMS as u64 * (1 + u64::from(self.groups))
    }
}

/// Samples in words; where those of each vertex begin, one more at the end; and their numbers with their weights.
pub fn tables(layout: &Layout<f32>) -> [Vec<u32>; 3] {
    let bits = |value: f64| (value as f32).to_bits();
    let row = |sample: &LaidSample| {
        let mut row = [0; SAMPLE_WORDS];
        row[..4].copy_from_slice(&sample.vertices);
        row[4..8].copy_from_slice(&sample.weights.map(bits));
        row[8] = bits(sample.area * sample.stiffness);
        row[9] = sample.part;
        row
    };
    let mut of_vertices = vec![Vec::new(); layout.vertex_count()];
    for (number, sample) in (0u32..).zip(&layout.samples) {
        for (&v, &weight) in sample.vertices.iter().zip(&sample.weights) {
            if weight != 0.0 {
                of_vertices[v as usize].push([number, bits(weight)]);
            }
        }
    }
    let mut offsets = vec![0];
    for entries in &of_vertices {
        offsets.push(offsets[offsets.len() - 1] + entries.len() as u32);
    }
    [layout.samples.iter().flat_map(row).collect(), offsets, of_vertices.concat().concat()]
}

/// `ToolMotion` of tools.wgsl: of a tool in a step.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct ToolMotion {
    pub poses: [[[f32; 4]; 3]; 3],
    pub way: [f32; 4],
    pub turn: [f32; 4],
}

/// `ToolKind` of tools.wgsl: of a tool in many steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ToolKind {
    pub lengths: [f32; 4],
    pub law: [f32; 4],
    pub grid: [f32; 4],
    pub bricks: [u32; 4],
    pub bounds: [f32; 4],
}

/// `Tools` of tools.wgsl.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct ToolRecords {
    pub count: [u32; 4],
    pub all: [ToolMotion; MOST_TOOLS],
    pub kinds: [ToolKind; MOST_TOOLS],
}

fn kind_and_lengths(shape: &Shape) -> (f64, [f64; 4]) {
    match *shape {
        Shape::HalfSpace => (0.0, [0.0; 4]),
        Shape::Mesh(_) => (4.0, [0.0; 4]),
        Shape::Sphere { radius } => (1.0, [0.0, 0.0, 0.0, radius]),
        Shape::Capsule { length, radius } => (2.0, [length, 0.0, 0.0, radius]),
        Shape::RoundedBox { half, radius } => (3.0, [half.x, half.y, half.z, radius]),
    }
}

impl ToolMotion {
    /// In a step that begins at a pose; its first solve takes a share of it. Where there are no solves the turn, as axis times
    /// angle, is in that one's place.
    fn new(tool: &Tool, start: &RigidTransform, share: Option<f64>, has_jumped: bool) -> Self {
        let pose = |pose: RigidTransform| {
            let [x, y, z] = pose.rotation.columns;
            let t = pose.translation;
            [(x, t.x), (y, t.y), (z, t.z)].map(|(column, t)| with(column, t as f32))
        };
        let way = tool.pose.translation - start.translation;
        let turned = tool.pose.rotation * start.rotation.transpose();
        let turn = axis_times_sine(&turned);
        let between = match share {
            Some(share) => pose(start.towards(&tool.pose, share)),
            None => [with(rotation_vector(&turned), 0.0), [0.0; 4], [0.0; 4]],
        };
        Self {
            poses: [pose(*start), between, pose(tool.pose)],
            way: with(way, f32::from(u8::from(tool.is_locked))),
            turn: with(turn, f32::from(u8::from(has_jumped))),
        }
    }
}

impl ToolKind {
    /// `first`: where the distances of a closed surface begin.
    fn new(tool: &Tool, first: u32) -> Self {
        let single = |row: [f64; 4]| row.map(|x| x as f32);
        let (kind, lengths) = kind_and_lengths(&tool.shape);
        let law = tool.law;
        let mut record = Self {
            lengths: single(lengths),
            law: single([kind, law.stiffness, law.thickness, law.friction]),
            ..Self::default()
        };
        if let Shape::Mesh(grid) = &tool.shape {
            let [x, y, z] = grid.bricks();
            record.grid = with(grid.origin(), grid.cell() as f32);
            record.bricks = [x as u32, y as u32, z as u32, first];
            record.bounds = single([grid.margin(), grid.steepest(), grid.thinnest(), 0.0]);
        }
        let reach = tool.shape.reach();
        record.bounds[3] = if reach.is_finite() { reach as f32 } else { 0.0 };
        record
    }
}

fn with(v: Vec3<f64>, w: f32) -> [f32; 4] {
    [v.x as f32, v.y as f32, v.z as f32, w]
}

fn place(row: [f32; 4]) -> Vec3<f64> {
    vec3(row[0], row[1], row[2]).cast()
}

/// Tools of the last step, and where they went on from.
#[derive(Clone, Default)]
pub struct DeviceTools {
    /// As they were at its end.
    tools: Vec<Tool>,
    /// Where they are when the next one begins.
    poses: Vec<RigidTransform>,
    jumped: Vec<bool>,
    starts: Vec<RigidTransform>,
    /// Closed surfaces that the device knows, and where the distances of each begin.
    grids: Vec<(Arc<DistanceGrid>, u32)>,
    /// What the device knows of tools from earlier steps.
    kinds: Vec<ToolKind>,
}

/// What the device is sent of the tools in a step.
pub struct SentTools {
    pub count: [u32; 4],
    pub motions: Vec<ToolMotion>,
    /// Nothing where it knows them.
    pub kinds: Option<Vec<ToolKind>>,
}

impl DeviceTools {
    /// Poses that a state has.
    pub fn put(&mut self, contact: &ContactState) {
        self.poses.clone_from(&contact.poses);
    }

    /// Poses at the end of the last step.
    pub fn poses(&self) -> &[RigidTransform] {
        &self.poses
    }

    /// Distances of closed surfaces, where the device does not know all of them.
    pub fn new_distances(&mut self, tools: &[Tool]) -> Option<Vec<u32>> {
        let solids = || {
            tools.iter().filter_map(|tool| match &tool.shape {
                Shape::Mesh(grid) => Some(grid),
                _ => None,
            })
        };
        let known = |grid| self.grids.iter().any(|(known, _)| Arc::ptr_eq(known, grid));
        if solids().all(known) {
            return None;
        }
        // Those that are gone make room.
        self.grids.clear();
        let mut words = Vec::new();
        for grid in solids() {
            if !self.grids.iter().any(|(known, _)| Arc::ptr_eq(known, grid)) {
                self.grids.push((Arc::clone(grid), words.len() as u32));
                grid.put_words(&mut words);
            }
        }
        words.resize(words.len().next_multiple_of(GRID_ROW as usize), 0);
        Some(words)
    }

    /// The device has none of them.
    pub fn forget_distances(&mut self) {
        self.grids.clear();
    }

    /// Where the distances of a shape begin.
    fn first_word(&self, shape: &Shape) -> u32 {
        let Shape::Mesh(grid) = shape else { return 0 };
        let found = self.grids.iter().find(|(known, _)| Arc::ptr_eq(known, grid));
        found.map_or(0, |(_, first)| *first)
    }

    /// Tools in a step of `dt` [s], of which the first solve takes a share where there is one.
    pub fn begin(&mut self, tools: &[Tool], dt: f64, share: Option<f64>) -> SentTools {
        self.tools.clear();
        self.tools.extend_from_slice(tools);
        (self.starts, self.jumped) = super::found::starts(tools, &self.poses, dt).unzip();
        self.poses.clear();
        self.poses.extend(tools.iter().map(|tool| tool.pose));
        let kind = |tool: &Tool| ToolKind::new(tool, self.first_word(&tool.shape));
        let kinds: Vec<ToolKind> = tools.iter().map(kind).collect();
        let are_new = kinds != self.kinds;
        if are_new {
            self.kinds.clone_from(&kinds);
        }
        let all = tools.iter().zip(&self.starts).zip(&self.jumped);
        let motions =
            all.map(|((tool, start), &jumped)| ToolMotion::new(tool, start, share, jumped));
        SentTools {
            count: [tools.len() as u32; 4],
            motions: motions.collect(),
            kinds: are_new.then_some(kinds),
        }
    }

    /// Bytes of the sums that forces on the tools of the last step are made of.
    pub fn bytes_of_sums(&self) -> u64 {
        (size_of::<[f32; TOOL_SUMS]>() * self.tools.len()) as u64
    }

    /// Forces on the tools at the end of the step, of the sums that kernels have left.
    pub fn wrenches(&self, sums: &[f32]) -> Vec<Wrench> {
        let all = sums.chunks_exact(TOOL_SUMS).zip(&self.jumped);
        let wrench = |(sums, &has_jumped): (&[f32], &bool)| Wrench {
            force: vec3(sums[0], sums[1], sums[2]).cast(),
            torque: vec3(sums[3], sums[4], sums[5]).cast(),
            touches: sums[6] as u32,
            pinned: sums[7] as u32,
            left_out: sums[8] as u32,
            depth: sums[9].into(),
            has_jumped,
        };
        all.map(wrench).collect()
    }

    /// What samples and tools were to each other in the last step, of the vectors that it has left.
    pub fn contacts(&self, layout: &Layout<f32>, rows: &[[f32; 4]]) -> Contacts {
        let mut contacts = Contacts { poses: self.poses.clone(), ..Contacts::default() };
        contacts.gifts = vec![Gift::default(); layout.part_count()];
        let mut all = layout.samples.iter().zip(rows.chunks_exact(SAMPLE_VECTORS)).enumerate();
        for part in 0..layout.part_count() {
            contacts.first.push(contacts.touching.len());
            for (number, (sample, rows)) in all.by_ref().take(layout.samples_of(part).len()) {
                for slot in slots(rows) {
                    let Some(tool) = self.tools.get(slot.tool as usize) else { continue };
                    let foundation = sample.foundation(&tool.law);
                    contacts.touching.push(Touching {
                        sample: number as u32,
                        tool: slot.tool,
                        foundation,
                        side: slot.side(),
                        friction: slot.friction(foundation.area * foundation.stiffness),
                        is_tied: slot.marks & IS_TIED != 0,
                    });
                }
            }
        }
        contacts.first.push(contacts.touching.len());
        contacts
    }

    /// What is kept of the last step, of the vectors that it has left, in the order of the model's parts, of which several may be one
    /// here; `x`: places [m] in the solver's numbering.
    pub fn touches(
        layout: &Layout<f32>,
        rows: &[[f32; 4]],
        x: impl Fn(usize) -> Vec3<f32>,
    ) -> Vec<Touch> {
        let joined = layout.joined();
        let part = |sample: &LaidSample| {
            joined.map_or(sample.part, |all| all.of_vertices[sample.vertices[0] as usize])
        };
        let mut touches = Vec::new();
        for (sample, rows) in layout.samples.iter().zip(rows.chunks_exact(SAMPLE_VECTORS)) {
            let at = sample.mean(&x);
            let kept = slots(rows).filter(|slot| slot.marks & IS_KEPT != 0);
            let key = |slot: &Slot| key(part(sample), sample.number, slot.tool);
            touches.extend(kept.map(|slot| (key(&slot), slot.touch(sample.number, at))));
        }
        let order = sorting::by_key(0..touches.len() as u32, |i| touches[i as usize].0);
        order.into_iter().map(|i| touches[i as usize].1).collect()
    }

    /// Vectors of samples of which this was kept.
    pub fn rows(layout: &Layout<f32>, touches: &[Touch]) -> Vec<[f32; 4]> {
        let mut rows = vec![[0.0; 4]; SAMPLE_VECTORS * layout.samples.len()];
        let of = |touch: &Touch| {
            key(layout.part_of_sample(touch.sample) as u32, touch.sample, touch.tool)
        };
        let order = sorting::by_key(0..touches.len() as u32, |i| of(&touches[i as usize]));
        let touches: Vec<&Touch> = order.into_iter().map(|i| &touches[i as usize]).collect();
        for (sample, rows) in layout.samples.iter().zip(rows.chunks_exact_mut(SAMPLE_VECTORS)) {
            let [own, _] = key(sample.part, sample.number, 0);
            let first = touches.partition_point(|touch| of(touch)[0] < own);
            let of_sample = touches[first..].iter().take_while(|touch| of(touch)[0] == own);
            let mut used = 0;
            for (touch, slot) in of_sample.zip(rows[FIRST_SLOT..].chunks_exact_mut(SLOT_VECTORS)) {
                let tied = if touch.is_tied { WILL_BE_TIED } else { 0 };
                let marks = touch.tool | HAS_PLANE | IS_KEPT | tied;
                slot[0] = with(touch.normal, touch.offset as f32);
                slot[2] = with(touch.anchor, touch.pressed as f32);
                slot[3] = with(touch.force, marks as f32);
                used += 1;
            }
            rows[0][3] = used as f32;
        }
        rows
    }
}

/// By part, sample and tool.
fn key(part: u32, sample: u32, tool: u32) -> [u64; 2] {
    [u64::from(part) << 32 | u64::from(sample), tool.into()]
}

/// A slot of a sample.
struct Slot {
    plane: [f32; 4],
    friction: [f32; 4],
    kept: [f32; 4],
    force: [f32; 4],
    marks: u32,
    tool: u32,
}

/// The slots that a sample uses.
fn slots(rows: &[[f32; 4]]) -> impl Iterator<Item = Slot> {
    let used = (rows[0][3] as usize & 7).min(SLOTS);
    rows[FIRST_SLOT..].chunks_exact(SLOT_VECTORS).take(used).map(|rows| {
        let marks = rows[3][3] as u32;
        let tool = marks & (MOST_TOOLS as u32 - 1);
        Slot { plane: rows[0], friction: rows[1], kept: rows[2], force: rows[3], marks, tool }
    })
}

impl Slot {
    fn side(&self) -> Side {
        if self.marks & HAS_PLANE == 0 {
            return Side::Live;
        }
        Side::Plane { normal: place(self.plane), offset: self.plane[3].into() }
    }

    fn friction(&self, stiffness: f64) -> Option<Friction> {
        let [.., limit] = self.friction;
        let whole = if limit >= LOCKED { f64::INFINITY } else { limit.into() };
        let anchor = place(self.friction);
        (limit > 0.0).then_some(Friction { anchor, stiffness, limit: whole })
    }

    fn touch(&self, sample: u32, place_of_sample: Vec3<f64>) -> Touch {
        Touch {
            sample,
            tool: self.tool,
            anchor: place(self.kept),
            normal: place(self.plane),
            offset: self.plane[3].into(),
            pressed: self.kept[3].into(),
            force: place(self.force),
            place: place_of_sample,
            is_tied: self.marks & WILL_BE_TIED != 0,
        }
    }
}
