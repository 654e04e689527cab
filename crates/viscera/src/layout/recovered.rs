//! What passes in lanes over recovered-gradient tetrahedra read: [`Domains`] in the order of a [`Layout`].
//!
//! Domains have *places*: those of a connected part stand together, in the order of the layout's vertices, and fill groups
//! of eight; a group that is not full has places without volume, which change nothing. As vertices have copies where pieces of
//! tetrahedra meet, so have places: every piece adds to copies of its own.

use std::ops::Range;

use super::{Domains, Layout, PIECE_BLOCKS, TetSet};
use crate::elements::recovered::bulk_shares;
use crate::material::MaterialModel;
use crate::scalar::Real;
use crate::scalar::lanes::{Eight, LANES};
use crate::sorting;

/// Groups of rings of similar length are formed among so many domains, or vertices, in a row: what stands together in
/// space stays together.
const WINDOW: usize = 64;

/// Eight tetrahedra at rest, beside those of the layout.
#[derive(Clone, Debug, PartialEq)]
pub struct Frames<S> {
    /// `r_1`, `r_2` and `r_3` [m]; the four arms add up to nothing.
    pub arms: [Eight<S>; 9],
    /// `c_o`.
    pub face_weights: [Eight<S>; 4],
    /// Three times the places of the corners: where matrices stand by columns.
    pub places: [Eight<u32>; 4],
    /// The copies of these that the block adds to, three times: where rows of three points stand.
    pub rows: [Eight<u32>; 4],
}

/// An entry of eight sums: of which each takes the last factor times what stands at an index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry<S> {
    /// Of a vertex, or three times that of a place.
    pub index: Eight<u32>,
    /// `b_nj` [1/m].
    pub gradient: [Eight<S>; 3],
}

/// Sums over rings, eight at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct Rings<S> {
    /// Entries of group `i` are `offsets[i] .. offsets[i + 1]`.
    offsets: Vec<u32>,
    entries: Vec<Entry<S>>,
}

/// Indices and gradients of one sum.
type Row<S> = Vec<(u32, [S; 3])>;

/// What belongs to one connected part.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PartRanges {
    /// Groups of places.
    pub groups: Range<usize>,
    /// Copies of its places.
    pub copies: Range<usize>,
    /// Its clusters.
    pub clusters: Range<usize>,
    /// Groups of the vertices that its domains see.
    pub vertex_groups: Range<usize>,
    /// Blocks of its tetrahedra, in the pieces of the layout.
    pub pieces: Vec<Range<usize>>,
}

impl PartRanges {
    /// Places of its domains.
    pub fn places(&self) -> Range<usize> {
        LANES * self.groups.start..LANES * self.groups.end
    }
}

/// See the head of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct RecoveredTables<S> {
    /// `1 - alpha` and `alpha`.
    pub shares: [S; 2],
    /// Of every block of the law's tetrahedra.
    pub frames: Vec<Frames<S>>,
    /// Of every connected part.
    pub parts: Vec<PartRanges>,
    /// `G_n` of groups of places: vertices that they see.
    pub domain_rings: Rings<S>,
    /// The vertex of each place.
    pub vertices: Vec<u32>,
    /// `V_n` [m^3] of each place.
    pub volumes: Vec<S>,
    /// `1/V_n`, zero where there is no domain.
    pub inverse_volumes: Vec<S>,
    /// `l` and `mu` [Pa] and the retardation time [s] of each group of places.
    pub local: Vec<[Eight<S>; 3]>,
    /// `k_n` and `k_c` [Pa] of each place.
    pub bulk: Vec<[S; 2]>,
    /// The cluster of each place.
    pub clusters: Vec<u32>,
    /// Copies of place `n` are `copy_offsets[n] .. copy_offsets[n + 1]`.
    pub copy_offsets: Vec<u32>,
    /// Places of cluster `c` are `cluster_offsets[c] .. cluster_offsets[c + 1]` of the next.
    pub cluster_offsets: Vec<u32>,
    pub cluster_places: Vec<u32>,
    /// `1/V_c` [1/m^3].
    pub inverse_cluster_volumes: Vec<S>,
    /// The forces of groups of vertices: places that see them.
    pub vertex_rings: Rings<S>,
    /// The vertices of these groups, eight each; the last ones of a part stand more than once, the first time with what
    /// acts on them.
    pub ring_vertices: Vec<u32>,
    /// Whether a lane of these groups counts.
    pub counts: Vec<bool>,
}

impl<S: Real> Rings<S> {
    /// Of rows of entries, eight rows a group; those that are too short take nothing of what they have taken before.
    fn new(rows: &[Row<S>]) -> Self {
        let mut rings = Self { offsets: vec![0], entries: Vec::new() };
        for rows in rows.chunks(LANES) {
            let longest = rows.iter().map(Vec::len).max().unwrap_or(0);
            let first = |row: &Row<S>| row.first().map(|entry| entry.0);
            let any = rows.iter().find_map(first).unwrap_or(0);
            for i in 0..longest {
                let mut entry = Entry { index: [0; LANES], gradient: [[S::ZERO; LANES]; 3] };
                for lane in 0..LANES {
                    entry.index[lane] = first(&rows[lane]).unwrap_or(any);
                    if let Some(&(index, gradient)) = rows[lane].get(i) {
                        entry.index[lane] = index;
                        for axis in 0..3 {
                            entry.gradient[axis][lane] = gradient[axis];
                        }
                    }
                }
                rings.entries.push(entry);
            }
            rings.offsets.push(rings.entries.len() as u32);
        }
        rings
    }

    /// Of a group.
    #[inline(always)]
    pub fn of(&self, group: usize) -> &[Entry<S>] {
        &self.entries[self.offsets[group] as usize..self.offsets[group + 1] as usize]
    }

    fn bytes(&self) -> usize {
        size_of_val(&self.offsets[..]) + size_of_val(&self.entries[..])
    }
}

/// Which domain stands at which place.
struct Places {
    /// The domain of each place.
    domains: Vec<Option<u32>>,
    /// The place of each domain.
    of: Vec<u32>,
    /// Groups of each part.
    groups: Vec<Range<usize>>,
}

impl Places {
    fn new<S: Real>(layout: &Layout<S>, domains: &Domains<S>) -> Self {
        let at = |n: &u32| layout.numbering.of(domains.vertices[*n as usize]);
        let order = sorting::by_key(0..domains.len() as u32, |n| [at(&n) as u64, 0]);
        let mut places =
            Self { domains: Vec::new(), of: vec![0; domains.len()], groups: Vec::new() };
        let mut rest = &order[..];
        for part in layout.parts.iter() {
            let count = rest.partition_point(|n| at(n) < part.vertices.end);
            let (own, others) = rest.split_at(count);
            rest = others;
            let first = places.domains.len() / LANES;
            let length = |n: &u32| domains.ring(*n as usize).len();
            for n in in_windows(own, length) {
                places.of[n as usize] = places.domains.len() as u32;
                places.domains.push(Some(n));
            }
            places.domains.resize(places.domains.len().next_multiple_of(LANES), None);
            places.groups.push(first..places.domains.len() / LANES);
        }
        places
    }
}

/// Sorted by length in windows: groups of eight have rows of similar length.
fn in_windows(all: &[u32], length: impl Fn(&u32) -> usize) -> Vec<u32> {
    let key = |n: u32| [length(&n) as u64, 0];
    all.chunks(WINDOW).flat_map(|window| sorting::by_key(window.iter().copied(), key)).collect()
}

impl<S: Real> RecoveredTables<S> {
    /// Of a layout in pieces and the domains of the same model.
    pub fn new(layout: &Layout<S>, domains: &Domains<S>) -> Self {
        let law = MaterialModel::StableNeoHookean as usize;
        let set = &layout.tet_sets[law];
        let places = Places::new(layout, domains);
        let pieces = pieces(layout, law);
        let (frames, copy_offsets) = frames(set, domains, &places, &pieces);
        let volume = |n: &Option<u32>| n.map_or(S::ZERO, |n| domains.volumes[n as usize]);
        let vertices: Vec<u32> = place_vertices(layout, domains, &places);
        let own = |n: u32| domains.ring(n as usize);
        let row = |n: &Option<u32>| {
            let entry = |i: usize| {
                let vertex = layout.numbering.of(domains.ring_vertices[i]) as u32;
                (vertex, domains.ring_gradients[i].to_array())
            };
            n.map_or(Vec::new(), |n| own(n).map(entry).collect())
        };
        let rows: Vec<_> = places.domains.iter().map(row).collect();
        let shares = |n: &Option<u32>| {
            let Some(n) = n else { return ([S::ZERO; 3], [S::ZERO; 2]) };
            let material = &layout.materials[domains.materials[*n as usize] as usize];
            let shares = bulk_shares(material.lame_lambda, material.lame_mu);
            let clustered = domains.smoothing.clustered;
            let (domain, cluster) = (shares.domain, shares.cluster);
            let bulk = if clustered { [domain, cluster] } else { [domain + cluster, S::ZERO] };
            ([shares.local, material.lame_mu, material.viscosity], bulk)
        };
        let (of_places, bulk): (Vec<[S; 3]>, Vec<[S; 2]>) =
            places.domains.iter().map(shares).unzip();
        let local = of_places.as_chunks::<LANES>().0.iter();
        let local = local.map(|of| [0, 1, 2].map(|i| of.map(|of| of[i]))).collect();
        let share = domains.smoothing.vertex_share;
        let mut tables = Self {
            shares: [1.0 - share, share].map(S::from_f64),
            frames,
            parts: Vec::new(),
            domain_rings: Rings::new(&rows),
            volumes: places.domains.iter().map(volume).collect(),
            inverse_volumes: places
                .domains
                .iter()
                .map(|n| n.map_or(S::ZERO, |n| S::ONE / domains.volumes[n as usize]))
                .collect(),
            local,
            bulk,
            clusters: vec![0; places.domains.len()],
            cluster_offsets: vec![0],
            cluster_places: Vec::new(),
            inverse_cluster_volumes: Vec::new(),
            vertex_rings: Rings { offsets: vec![0], entries: Vec::new() },
            ring_vertices: Vec::new(),
            counts: Vec::new(),
            vertices,
            copy_offsets,
        };
        let clusters = tables.add_clusters(domains, &places);
        let vertex_groups = tables.add_vertex_rings(layout, &rows);
        for (number, groups) in places.groups.iter().enumerate() {
            let [first, end] =
                [groups.start, groups.end].map(|g| tables.copy_offsets[LANES * g] as usize);
            tables.parts.push(PartRanges {
                groups: groups.clone(),
                copies: first..end,
                clusters: clusters[number].clone(),
                vertex_groups: vertex_groups[number].clone(),
                pieces: pieces[number].clone(),
            });
        }
        tables
    }

    /// Clusters in the order of the parts and of their first places; those of each part.
    fn add_clusters(&mut self, domains: &Domains<S>, places: &Places) -> Vec<Range<usize>> {
        const NONE: u32 = u32::MAX;
        let mut number = vec![NONE; domains.cluster_volumes.len()];
        let mut members: Vec<Vec<u32>> = Vec::new();
        let mut of_parts = Vec::new();
        for groups in &places.groups {
            let first = members.len();
            for place in LANES * groups.start..LANES * groups.end {
                let Some(n) = places.domains[place] else { continue };
                let cluster = domains.clusters[n as usize] as usize;
                if number[cluster] == NONE {
                    number[cluster] = members.len() as u32;
                    members.push(Vec::new());
                    let volume = domains.cluster_volumes[cluster];
                    self.inverse_cluster_volumes.push(S::ONE / volume);
                }
                self.clusters[place] = number[cluster];
                members[number[cluster] as usize].push(place as u32);
            }
            // A place without a domain has no stiffness: any cluster of its part will do.
            let last = members.len().saturating_sub(1) as u32;
            for place in LANES * groups.start..LANES * groups.end {
                if places.domains[place].is_none() {
                    self.clusters[place] = last;
                }
            }
            of_parts.push(first..members.len());
        }
        for all in members {
            self.cluster_places.extend(all);
            self.cluster_offsets.push(self.cluster_places.len() as u32);
        }
        of_parts
    }

    /// The rows of `G_n`, turned round: for each vertex the places that see it. Groups of each part.
    fn add_vertex_rings(&mut self, layout: &Layout<S>, rows: &[Row<S>]) -> Vec<Range<usize>> {
        let mut turned: Vec<Row<S>> = vec![Vec::new(); layout.vertex_count()];
        for (place, row) in (0..).zip(rows) {
            row.iter().for_each(|&(v, gradient)| turned[v as usize].push((3 * place, gradient)));
        }
        let mut of_parts = Vec::new();
        let mut grouped = Vec::new();
        for part in layout.parts.iter() {
            let first = grouped.len() / LANES;
            let seen: Vec<u32> = (part.vertices.start as u32..part.vertices.end as u32)
                .filter(|&v| !turned[v as usize].is_empty())
                .collect();
            let sorted = in_windows(&seen, |&v| turned[v as usize].len());
            for &v in &sorted {
                grouped.push(std::mem::take(&mut turned[v as usize]));
                self.ring_vertices.push(v);
                self.counts.push(true);
            }
            let last = sorted.last().copied().unwrap_or(0);
            while grouped.len() % LANES > 0 {
                grouped.push(Vec::new());
                self.ring_vertices.push(last);
                self.counts.push(false);
            }
            of_parts.push(first..grouped.len() / LANES);
        }
        self.vertex_rings = Rings::new(&grouped);
        of_parts
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.frames[..])
            + self.domain_rings.bytes()
            + self.vertex_rings.bytes()
            + size_of_val(&self.vertices[..])
            + size_of_val(&self.volumes[..])
            + size_of_val(&self.inverse_volumes[..])
            + size_of_val(&self.local[..])
            + size_of_val(&self.bulk[..])
            + size_of_val(&self.clusters[..])
            + size_of_val(&self.copy_offsets[..])
            + size_of_val(&self.cluster_offsets[..])
            + size_of_val(&self.cluster_places[..])
            + size_of_val(&self.inverse_cluster_volumes[..])
            + size_of_val(&self.ring_vertices[..])
            + size_of_val(&self.counts[..])
    }
}

/// Blocks of a law in pieces, of each part.
fn pieces<S: Real>(layout: &Layout<S>, law: usize) -> Vec<Vec<Range<usize>>> {
    let cut = |blocks: Range<usize>| {
        let end = blocks.end;
        let starts = blocks.step_by(PIECE_BLOCKS);
        starts.map(move |start| start..(start + PIECE_BLOCKS).min(end))
    };
    layout.parts.iter().map(|part| part.blocks(law).flat_map(cut).collect()).collect()
}

/// The vertex of each place; of one without a domain that of the place before.
fn place_vertices<S: Real>(layout: &Layout<S>, domains: &Domains<S>, places: &Places) -> Vec<u32> {
    let mut last = 0;
    let mut vertex = |n: &Option<u32>| {
        if let Some(n) = n {
            last = layout.numbering.of(domains.vertices[*n as usize]) as u32;
        }
        last
    };
    places.domains.iter().map(&mut vertex).collect()
}

/// Frames of all blocks, and the copies of places that pieces add to: those of a place stand together, one of each piece
/// that has it, pieces in order.
fn frames<S: Real>(
    set: &TetSet<S>,
    domains: &Domains<S>,
    places: &Places,
    pieces: &[Vec<Range<usize>>],
) -> (Vec<Frames<S>>, Vec<u32>) {
    let zero = [S::ZERO; LANES];
    let none = Frames {
        arms: [zero; 9],
        face_weights: [zero; 4],
        places: [[0; LANES]; 4],
        rows: [[0; LANES]; 4],
    };
    let mut frames = vec![none; set.block_count()];
    for (&number, (block, lane)) in set.order.iter().zip(set.places()) {
        // The model's numbers of a law's tetrahedra ascend; without one that is not there frames would stay empty.
        let Ok(t) = domains.tets.binary_search(&number) else { continue };
        // The last tetrahedron fills the block up.
        let filled = usize::from(set.filled[block]);
        let lanes = if lane + 1 == filled { lane..LANES } else { lane..lane + 1 };
        let (frame, rest) = (&mut frames[block], &domains.frames[t]);
        for lane in lanes {
            for corner in 0..4 {
                let n = domains.tet_domains[t][corner] as usize;
                frame.places[corner][lane] = 3 * places.of[n];
                frame.face_weights[corner][lane] = rest.face_weights[corner];
            }
            for (i, component) in rest.arms[1..].iter().flat_map(|arm| arm.to_array()).enumerate() {
                frame.arms[i][lane] = component;
            }
        }
    }
    let mut counts = vec![0u32; places.domains.len()];
    let mut last = vec![usize::MAX; places.domains.len()];
    for (number, piece) in pieces.iter().flatten().enumerate() {
        for frame in &mut frames[piece.clone()] {
            for (corner, row) in frame.places.iter().zip(&mut frame.rows) {
                for (&place, row) in corner.iter().zip(row) {
                    let place = place as usize / 3;
                    if last[place] != number {
                        last[place] = number;
                        counts[place] += 1;
                    }
                    *row = counts[place] - 1;
                }
            }
        }
    }
    let mut copy_offsets = Vec::with_capacity(counts.len() + 1);
    let mut next = 0;
    copy_offsets.push(next);
    for count in counts {
        next += count;
        copy_offsets.push(next);
    }
    for frame in &mut frames {
        for (corner, row) in frame.places.iter().zip(&mut frame.rows) {
            for (&place, row) in corner.iter().zip(row) {
                *row = 3 * (copy_offsets[place as usize / 3] + *row);
            }
        }
    }
    (frames, copy_offsets)
}
