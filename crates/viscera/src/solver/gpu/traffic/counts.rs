//! How much there is of everything that kernels read and write.

use super::dispatch::{DispatchTraffic, NOTHING};
use super::table::{Count, Line};
use super::{explicit, meetings, quasi_newton, step, xpbd};
use crate::layout::Layout;
use crate::scalar::lanes::LANES;
use crate::settings::SolverSettings;
use crate::solver::gpu::clusters::ClusterTables;
use crate::solver::gpu::kernels::Kernel;
use crate::solver::gpu::layout::DeviceLayout;
use crate::solver::gpu::limits::window;
use crate::solver::gpu::members::element_range;
use crate::solver::gpu::record::Dispatch;
use crate::solver::gpu::slots::{Slot, unknowns_size};
use crate::solver::quasi_newton::on_device::DeviceLevels;
use crate::solver::quasi_newton::tables::{ENTRY_WORDS, GROUP_ENTRY_WORDS, Header, OF_VERTEX};
use crate::solver::step::contacts::meetings::Meetings;
use crate::solver::step::contacts::on_device::Samples;
use crate::solver::step::recovered::on_device::{Extent, ring_entries};
use crate::solver::step::strain::is_recovered;

/// Pairs whose products are summed at once; `PAIRS_AT_ONCE` of progress.wgsl.
const PAIRS_AT_ONCE: u32 = 5;

/// Of a model on a device.
pub struct Counts<'a> {
    layout: &'a Layout<f32>,
    window: f64,
    history: f64,
    elements: f64,
    viscous_tets: f64,
    numbers: f64,
    /// Pieces of each part: of elements and of vertices.
    pieces: Vec<[f64; 2]>,
    groups: f64,
    levels: Levels,
    recovered: Recovered,
    meetings: Option<Meetings>,
    /// Vertices of each cluster of tetrahedra.
    cluster_vertices: Vec<u32>,
}

/// Of recovered-gradient tetrahedra.
#[derive(Default)]
struct Recovered {
    tets: f64,
    places: f64,
    ring_entries: f64,
    clusters: f64,
    averages: f64,
    is_viscous: bool,
}

impl Recovered {
    fn new(layout: &Layout<f32>) -> Self {
        let (Some(extent), Some(tables)) = (Extent::new(layout), &layout.recovered) else {
            return Self::default();
        };
        let set = layout.tet_sets.iter().find(|set| is_recovered(layout, set));
        Self {
            tets: set.map_or(0.0, |set| set.len() as f64),
            places: f64::from(extent.groups) * LANES as f64,
            ring_entries: ring_entries(tables) as f64,
            clusters: tables.inverse_cluster_volumes.len() as f64,
            averages: f64::from(extent.averages),
            is_viscous: set.is_some_and(|set| set.viscous),
        }
    }

    fn of(&self, count: Count) -> f64 {
        match count {
            Count::RecoveredTet => self.tets,
            Count::RecoveredCorner => 4.0 * self.tets,
            Count::Place => self.places,
            Count::PlaceGroup => self.places / LANES as f64,
            Count::RingEntry => self.ring_entries,
            Count::PlaceCluster => self.clusters,
            Count::Average => self.averages,
            Count::ViscousPlace if self.is_viscous => self.places,
            Count::ViscousPlaceCorner if self.is_viscous => 4.0 * self.tets,
            Count::ViscousRingEntry if self.is_viscous => self.ring_entries,
            _ => 0.0,
        }
    }
}

/// Of the preconditioner.
#[derive(Default)]
struct Levels {
    header: Header,
    fine_sources: f64,
    coarse_sources: f64,
    /// Of dense levels, where sources are vertices.
    vertex_sources: f64,
    parents: f64,
    ups: f64,
    shares: f64,
    entries: f64,
    group_entries: f64,
    dense_numbers: f64,
    dense_products: f64,
}

impl Levels {
    fn new(header: Header, words: &[u32]) -> Self {
        let h = &header;
        let end = |offsets: u32, count: u32| f64::from(words[(offsets + count) as usize]);
        let [fine, all] = [h.fine, h.nodes].map(|count| end(h.child_offsets, count));
        let source = |i: u32| words[(h.children + 2 * i) as usize];
        let vertex_sources = (fine as u32..all as u32).filter(|&i| source(i) & OF_VERTEX != 0);
        let vertex_sources = vertex_sources.count() as f64;
        let rows = |from: u32, to: u32, words: usize| f64::from(to - from) / words as f64;
        let dense_numbers = f64::from(h.turns - h.dense);
        Self {
            fine_sources: fine,
            coarse_sources: all - fine - vertex_sources,
            vertex_sources,
            parents: end(h.parent_offsets, h.vertices),
            ups: end(h.up_offsets, h.fine),
            shares: end(h.share_offsets, h.vertices + h.ordinary),
            entries: rows(h.entries, h.group_rows, ENTRY_WORDS),
            group_entries: rows(h.group_entries, h.part_rows, GROUP_ENTRY_WORDS),
            dense_numbers,
            // A triangle with its diagonal has n (n + 1)/2 numbers, of which a product reads n^2. Exact for one part.
            dense_products: 2.0 * dense_numbers - 3.0 * f64::from(h.nodes - h.ordinary),
            header,
        }
    }
}

impl<'a> Counts<'a> {
    pub fn new(
        layout: &'a Layout<f32>,
        settings: &SolverSettings,
        on_device: &DeviceLayout,
        levels: Option<(&DeviceLevels, &[u32])>,
    ) -> Self {
        let of_part = |first: u32, end: u32| f64::from(end - first);
        let rows = on_device.parts.rows.iter();
        let viscous = layout.tet_sets.iter().filter(|set| set.viscous);
        Self {
            layout,
            window: f64::from(window(settings)),
            history: levels.map_or(0.0, |(levels, _)| f64::from(levels.history)),
            elements: f64::from(element_range(layout, None)[1]),
            viscous_tets: viscous.map(|set| set.len()).sum::<usize>() as f64,
            numbers: (unknowns_size(layout) / 4) as f64,
            pieces: rows
                .map(|row| {
                    [
                        of_part(row.element_pieces, row.element_pieces_end),
                        of_part(row.vertex_pieces, row.vertex_pieces_end),
                    ]
                })
                .collect(),
            groups: f64::from(on_device.parts.groups()),
            levels: levels.map(|(l, words)| Levels::new(l.header, words)).unwrap_or_default(),
            recovered: Recovered::new(layout),
            meetings: Meetings::new(layout, settings),
            cluster_vertices: ClusterTables::new(layout)
                .map(|tables| tables.rows.iter().map(|row| row.vertex_count).collect())
                .unwrap_or_default(),
        }
    }

    /// What a dispatch moves; nothing of one that does nothing in an ordinary step.
    pub fn traffic(&self, dispatch: &Dispatch) -> DispatchTraffic {
        let mut sum = DispatchTraffic { kernel: dispatch.kernel.entry, ..NOTHING };
        let mut of_slots: Vec<(Slot, f64)> = Vec::new();
        for line in self.lines(dispatch) {
            let [compulsory, moved] = self.bytes(line, dispatch);
            sum.compulsory += compulsory;
            sum.moved += moved;
            sum.written += if line.is_written { compulsory } else { 0.0 };
            match of_slots.iter_mut().find(|(slot, _)| *slot == line.slot) {
                Some((_, bytes)) => *bytes += moved,
                None => of_slots.push((line.slot, moved)),
            }
        }
        let most = of_slots.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
        sum.most = most.filter(|(_, moved)| *moved > 0.0).map(|(slot, _)| slot);
        let found = entry(dispatch.kernel).filter(|entry| dispatch.job.mode & entry.idle == 0);
        if let Some(entry) = found {
            let (operations, count) = entry.operations;
            sum.operations = f64::from(operations) * self.of(count, dispatch);
        }
        sum
    }

    /// The lines of the table that hold for a dispatch.
    pub fn lines(&self, dispatch: &Dispatch) -> impl Iterator<Item = &'static Line> {
        let mode = dispatch.job.mode;
        let entry = entry(dispatch.kernel).filter(|entry| mode & entry.idle == 0);
        let lines = entry.map_or(&[][..], |entry| entry.lines);
        lines.iter().filter(move |line| line.modes == 0 || mode & line.modes != 0)
    }

    /// Compulsory and moved bytes of a line.
    pub fn bytes(&self, line: &Line, dispatch: &Dispatch) -> [f64; 2] {
        let bytes = f64::from(line.bytes);
        let moved = bytes * self.of(line.by, dispatch);
        // Nothing that nobody reads is compulsory.
        [(bytes * self.of(line.each, dispatch)).min(moved), moved]
    }

    fn of(&self, count: Count, dispatch: &Dispatch) -> f64 {
        let of_pieces = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
            self.pieces.iter().map(|&[elements, vertices]| f(elements, vertices)).sum()
        };
        let (layout, levels) = (self.layout, &self.levels);
        let h = &levels.header;
        let vertices = layout.vertex_count() as f64;
        let tets = layout.tet_count() as f64;
        let chunks = f64::from((self.history as u32).div_ceil(PAIRS_AT_ONCE));
        match count {
            Count::Never => 0.0,
            Count::Part => layout.part_count() as f64,
            Count::Vertex => vertices,
            Count::Tet => tets,
            Count::ViscousTet => self.viscous_tets,
            Count::ViscousCorner => 4.0 * self.viscous_tets,
            Count::Element => self.elements,
            Count::Corner => 4.0 * (tets + self.elements),
            Count::Copy => layout.copy_count() as f64,
            Count::JobTet => self.job_tets(dispatch),
            Count::JobCorner => 4.0 * self.job_tets(dispatch),
            Count::JobMultiplier => {
                let viscous = if dispatch.job.is_viscous != 0 { 6 } else { 0 };
                let each = dispatch.variant.form.multiplier_count() + viscous;
                each as f64 * self.job_tets(dispatch)
            }
            Count::JobStrain => f64::from(dispatch.job.is_viscous) * self.job_tets(dispatch),
            Count::JobElement => f64::from(dispatch.job.count),
            Count::Multiplier => layout.multiplier_count as f64,
            Count::Number => self.numbers,
            Count::Difference => self.window * self.numbers,
            Count::Group => self.groups,
            Count::Piece => of_pieces(&|e, v| e + v),
            Count::ElementPiece => of_pieces(&|e, _| e),
            Count::VertexPiece => of_pieces(&|_, v| v),
            Count::PieceByPiece => of_pieces(&|e, v| (e + v) * (e + v)),
            Count::PieceByVertexPiece => of_pieces(&|e, v| (e + v) * v),
            Count::PieceByGroup => of_pieces(&|e, v| e + v) * self.groups,
            Count::VertexPieceByVertexPiece => of_pieces(&|_, v| v * v),
            Count::VertexPair => self.history * vertices,
            Count::OlderPair => (self.history - 1.0).max(0.0) * vertices,
            Count::VertexChunk => chunks * vertices,
            Count::PieceChunk => chunks * of_pieces(&|_, v| v),
            Count::PieceChunkByPiece => chunks * of_pieces(&|_, v| v * v),
            Count::FineNode => f64::from(h.fine),
            Count::CoarseNode => f64::from(h.nodes - h.fine),
            Count::OrdinaryNode => f64::from(h.ordinary),
            Count::CoarseBlock => f64::from(h.ordinary - h.fine),
            Count::Node => f64::from(h.nodes),
            Count::Block => f64::from(h.vertices + h.ordinary),
            Count::FineSource => levels.fine_sources,
            Count::CoarseSource => levels.coarse_sources,
            Count::VertexSource => levels.vertex_sources,
            Count::Parent => levels.parents,
            Count::Up => levels.ups,
            Count::Share => levels.shares,
            Count::Entry => levels.entries,
            Count::TetGroup => f64::from(h.groups),
            Count::GroupEntry => levels.group_entries,
            Count::PairRow => f64::from(h.pairs),
            Count::DenseNumber => levels.dense_numbers,
            Count::DenseProduct => levels.dense_products,
            Count::PlainTet => tets - self.recovered.tets,
            Count::PlainCorner => 4.0 * (tets - self.recovered.tets + self.elements),
            Count::AverageByVertexPiece => self.recovered.averages * of_pieces(&|_, v| v),
            Count::JobPiece | Count::JobCluster => f64::from(dispatch.job.count),
            Count::JobClusterVertex => self.of_clusters(dispatch).map(f64::from).sum(),
            Count::Sample | Count::SampleCorner | Count::SampleVertex | Count::SampleGroup => {
                self.of_samples(count)
            }
            Count::PieceTet
            | Count::PieceRecoveredTet
            | Count::PieceRecoveredCorner
            | Count::PieceCorner
            | Count::PieceElement
            | Count::PieceVertex => self.of_job_pieces(count, dispatch),
            other => self.recovered.of(other) + self.of_meetings(other),
        }
    }

    /// Of the surface that tools touch.
    fn of_samples(&self, count: Count) -> f64 {
        let Some(Samples { count: samples, groups }) = Samples::new(self.layout) else {
            return 0.0;
        };
        match count {
            Count::SampleCorner => 4.0 * f64::from(samples),
            Count::SampleVertex => self.layout.vertex_count() as f64,
            Count::SampleGroup => f64::from(groups),
            _ => f64::from(samples),
        }
    }

    /// Of the skin on which tissue meets tissue.
    fn of_meetings(&self, count: Count) -> f64 {
        let Some(all) = self.meetings else { return 0.0 };
        f64::from(match count {
            Count::SkinPoint => all.points,
            Count::SkinTriangle => all.triangles,
            Count::SkinCorner => 3 * all.triangles,
            Count::SkinNode => all.nodes,
            Count::SkinLeaf => all.leaves,
            Count::MeetingCorner => 4 * all.count(),
            Count::Meeting => all.count(),
            _ => 0,
        })
    }

    /// Of pieces that are of elements or of vertices.
    fn of_job_pieces(&self, count: Count, dispatch: &Dispatch) -> f64 {
        let are_vertices = dispatch.job.first > 0;
        let [tets, recovered] = [self.layout.tet_count() as f64, self.recovered.tets];
        match count {
            Count::PieceVertex if are_vertices => self.layout.vertex_count() as f64,
            _ if are_vertices => 0.0,
            Count::PieceTet => tets,
            Count::PieceRecoveredTet => recovered,
            Count::PieceRecoveredCorner => 4.0 * recovered,
            Count::PieceCorner => 4.0 * (tets + self.elements),
            Count::PieceElement => self.elements,
            _ => 0.0,
        }
    }

    /// Vertices of the clusters of a job.
    fn of_clusters(&self, dispatch: &Dispatch) -> impl Iterator<Item = u32> {
        let [first, count] = [dispatch.job.first, dispatch.job.count].map(|n| n as usize);
        self.cluster_vertices.iter().skip(first).take(count).copied()
    }

    /// Tetrahedra in the blocks of a job, padding left out.
    fn job_tets(&self, dispatch: &Dispatch) -> f64 {
        let job = &dispatch.job;
        let [first, count] = [job.first, job.count].map(|n| n as usize);
        if dispatch.kernel.entry == "solve_clusters" {
            return self.tets_of_clusters(first, count);
        }
        // A repair's job has the place of multipliers instead of its first block, which is that of its set.
        let is_repair = dispatch.kernel.entry == "repair_multipliers";
        let first = if is_repair { job.set_first as usize } else { first };
        let filled = self.layout.tet_sets.iter().flat_map(|set| &set.filled);
        let of_job = filled.skip(first).take(count / LANES);
        of_job.map(|&filled| f64::from(filled)).sum()
    }
}

impl Counts<'_> {
    /// Tetrahedra of some clusters, which are numbered law by law.
    fn tets_of_clusters(&self, mut first: usize, count: usize) -> f64 {
        for set in &self.layout.tet_sets {
            let Some(clusters) = &set.clusters else { continue };
            if first < clusters.len() {
                let blocks = clusters.blocks(first..first + count);
                return set.filled[blocks].iter().map(|&filled| f64::from(filled)).sum();
            }
            first -= clusters.len();
        }
        0.0
    }
}

/// What the tables say of all kernels.
pub fn entries() -> impl Iterator<Item = &'static super::table::Entry> {
    let own = [step::TABLE, xpbd::TABLE, explicit::TABLE, quasi_newton::TABLE, meetings::TABLE];
    own.into_iter().flatten().chain(super::values::TABLE)
}

fn entry(kernel: &Kernel) -> Option<&'static super::table::Entry> {
    entries().find(|entry| entry.kernel == *kernel)
}
