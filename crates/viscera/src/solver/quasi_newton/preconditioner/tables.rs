//! The preconditioner as tables for a device: everything that does not move.
//!
//! Nodes of all parts are numbered together: those of the finest lattice levels, then those of coarser ones, then those
//! of dense levels. A device restricts to the finest level, and from there to all others at once: composed weights of
//! nested levels are weights of the same kind. Small parts have no lattice; their free vertices are the nodes of a dense
//! level.

use bytemuck::{Pod, Zeroable};

use super::exported::{Exported, composed};
use super::full::FullSums;
use super::sums::{DiagonalSums, Groups};
use super::{Coarseness, OfPart};
use crate::layout::Layout;
use crate::settings::HAS_MEETINGS;
use crate::solver::quasi_newton::choice::Choice;

impl Coarseness {
    /// As many as the processor aims for; a workgroup has a panel of its columns in its memory.
    pub const ON_DEVICE: Self = Self { aim: MOST_DENSE, most: MOST_DENSE };
}

/// Nodes of a dense level at most.
pub const MOST_DENSE: usize = 64;

/// A source of a node is marked so where it is a vertex; others are nodes.
pub const OF_VERTEX: u32 = 1 << 31;

/// Words of a row of shares, of entries of dense blocks, of groups, of their entries, of dense pairs and of parts.
pub const SHARE_WORDS: usize = 8;
pub const ENTRY_WORDS: usize = 10;
pub const GROUP_WORDS: usize = 7;
pub const GROUP_ENTRY_WORDS: usize = 4;
pub const PAIR_WORDS: usize = 8;
pub const LEVEL_PART_WORDS: usize = 5;

/// Numbers of the turn of a group: `R`, `A`, and the factor of viscosity.
pub const TURN_NUMBERS: usize = 20;

/// Numbers of what contact gives to a vertex or a node of the finest level: to itself, and to all around that moves alike.
pub const CONTACT_NUMBERS: usize = 12;

/// Where everything stands: the first words of the table; places of numbers are those of the other buffer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Header {
    /// Counts: vertices; nodes of the finest level, of all levels but dense ones, and of all; groups; pairs of dense nodes.
    pub vertices: u32,
    pub fine: u32,
    pub ordinary: u32,
    pub nodes: u32,
    pub groups: u32,
    pub pairs: u32,
    /// Sources of each node, and their weights.
    pub child_offsets: u32,
    pub children: u32,
    /// Nodes of each vertex, and of each node of the finest level those of coarser ones.
    pub parent_offsets: u32,
    pub parents: u32,
    pub up_offsets: u32,
    pub ups: u32,
    /// What groups have in the blocks of vertices, then of ordinary nodes; the nodes' masses, and stiffnesses of both.
    pub share_offsets: u32,
    pub shares: u32,
    pub masses: u32,
    pub stiffnesses: u32,
    pub pair_rows: u32,
    pub entries: u32,
    pub group_rows: u32,
    pub group_entries: u32,
    pub part_rows: u32,
    /// Places of numbers: inverses of blocks, dense inverses, turns of groups, residuals and corrections of nodes.
    pub inverses: u32,
    pub dense: u32,
    pub turns: u32,
    pub residuals: u32,
    pub corrections: u32,
    /// Of contact, for vertices and then nodes of the finest level; zero where there are no samples of the surface.
    pub contact: u32,
    /// Of each part the share of the step that its solves take.
    pub steps: u32,
    /// The part of each ordinary node, among the words.
    pub node_parts: u32,
}

/// The tables of a model.
pub struct Tables {
    pub header: Header,
    /// Header and tables.
    pub words: Vec<u32>,
    /// Numbers that the device keeps of them.
    pub numbers: u64,
}

/// A sparse matrix, row by row.
#[derive(Default)]
struct Rows {
    offsets: Vec<u32>,
    entries: Vec<(u32, f32)>,
}

impl Rows {
    fn begun() -> Self {
        Self { offsets: vec![0], entries: Vec::new() }
    }

    fn push(&mut self, row: impl IntoIterator<Item = (u32, f32)>) {
        self.entries.extend(row);
        self.offsets.push(self.entries.len() as u32);
    }

    /// The same entries, column by column.
    fn turned_round(&self, columns: usize) -> Vec<Vec<(u32, f32)>> {
        let mut turned = vec![Vec::new(); columns];
        for row in 0..self.offsets.len() - 1 {
            for &(column, weight) in
                &self.entries[self.offsets[row] as usize..self.offsets[row + 1] as usize]
            {
                turned[column as usize].push((row as u32, weight));
            }
        }
        turned
    }
}

/// All tables under way.
struct Builder {
    header: Header,
    /// Of nodes of the finest level, coarser ones, dense ones.
    children: [Vec<Vec<(u32, f32)>>; 3],
    parents: Rows,
    ups: Rows,
    shares: [Vec<Vec<[u32; SHARE_WORDS]>>; 3],
    masses: [Vec<f32>; 2],
    node_parts: [Vec<u32>; 2],
    stiffnesses: [Vec<f32>; 3],
    pairs: Vec<[u32; PAIR_WORDS]>,
    entries: Vec<[u32; ENTRY_WORDS]>,
    groups: Vec<[u32; GROUP_WORDS]>,
    group_entries: Vec<[u32; GROUP_ENTRY_WORDS]>,
    parts: Vec<[u32; LEVEL_PART_WORDS]>,
    dense_numbers: u32,
}

impl Tables {
    /// For a layout, of which these vertices are free. `choices`: passes and pairs of each part.
    pub fn new(layout: &Layout<f32>, free: &[bool], choices: &[Choice]) -> Self {
        let parts: Vec<Exported> =
            (0..layout.part_count()).map(|number| Exported::new(layout, number, free)).collect();
        let sum = |of: &dyn Fn(&Exported) -> usize| parts.iter().map(of).sum::<usize>() as u32;
        let ordinary = |part: &Exported| part.counts[..part.ordinary_levels()].iter().sum();
        let fine = |part: &Exported| part.counts[..part.ordinary_levels().min(1)].iter().sum();
        let header = Header {
            vertices: layout.vertex_count() as u32,
            fine: sum(&fine),
            ordinary: sum(&ordinary),
            nodes: sum(&|part| ordinary(part) + part.dense_count()),
            ..Header::default()
        };
        let mut builder = Builder {
            header,
            children: Default::default(),
            parents: Rows::begun(),
            ups: Rows::begun(),
            shares: Default::default(),
            masses: Default::default(),
            node_parts: Default::default(),
            stiffnesses: Default::default(),
            pairs: Vec::new(),
            entries: Vec::new(),
            groups: Vec::new(),
            group_entries: Vec::new(),
            parts: Vec::new(),
            dense_numbers: 0,
        };
        for (part, choice) in parts.into_iter().zip(choices) {
            builder.add(&part, choice);
        }
        let meets = layout.skin.is_some() && HAS_MEETINGS;
        builder.finish(!layout.samples.is_empty() || meets)
    }
}

impl Builder {
    fn add(&mut self, part: &Exported, choice: &Choice) {
        let first_group = self.groups.len() as u32;
        let first_vertex = part.of_part.vertices.start as u32;
        // Where its levels' nodes begin: the finest, coarser ones, the dense one.
        let fine = self.children[0].len() as u32;
        let coarse = self.header.fine + self.children[1].len() as u32;
        let dense = self.header.ordinary + self.children[2].len() as u32;
        let mut starts: Vec<u32> = Vec::new();
        let mut next = coarse;
        for (level, &count) in part.counts.iter().enumerate() {
            starts.push(match level {
                _ if level == part.ordinary_levels() => dense,
                0 => fine,
                _ => {
                    next += count as u32;
                    next - count as u32
                }
            });
        }
        self.add_sources(part, &starts, first_vertex, dense);
        for (level, sums) in part.of_part.levels.iter().enumerate() {
            self.add_blocks(part, level, sums, first_group);
        }
        if part.of_part.levels.is_empty() {
            // Vertices that are solved as a whole.
            let count = part.free.len();
            self.shares[0].resize(self.shares[0].len() + count, Vec::new());
            self.stiffnesses[0].resize(self.stiffnesses[0].len() + count, 0.0);
        }
        let row = [dense, part.dense_count() as u32, self.dense_numbers];
        self.parts.push([row[0], row[1], row[2], choice.passes, choice.history as u32]);
        let number = self.parts.len() as u32 - 1;
        self.add_dense(part, number, first_group, dense);
        self.add_groups(&part.of_part.groups, &part.of_part.full, first_vertex, part.has_dense);
    }

    /// Where nodes have their residuals from, and who gets their corrections.
    fn add_sources(&mut self, part: &Exported, starts: &[u32], first_vertex: u32, dense: u32) {
        let lattice = &part.of_part.lattice;
        let vertices = 0..part.free.len();
        let Some(finest) = lattice.levels.first() else {
            for v in vertices {
                let is_node = part.has_dense && part.free[v];
                self.parents.push(is_node.then_some((dense + v as u32, 1.0)));
                if part.has_dense {
                    let source = (first_vertex + v as u32) | OF_VERTEX;
                    self.children[2].push(is_node.then_some((source, 1.0)).into_iter().collect());
                }
            }
            return;
        };
        let is_dense = part.ordinary_levels() == 0;
        let mut of_vertices = Rows::begun();
        for v in vertices {
            let row = if part.free[v] { finest.of_vertices.of(v) } else { &[] };
            of_vertices.push(row.iter().copied());
            self.parents.push(row.iter().map(|&(node, weight)| (starts[0] + node, weight)));
        }
        let mark = |vertex: u32| (first_vertex + vertex) | OF_VERTEX;
        let children = of_vertices.turned_round(finest.node_count());
        let marked =
            children.into_iter().map(|row| row.into_iter().map(|(v, w)| (mark(v), w)).collect());
        self.children[if is_dense { 2 } else { 0 }].extend(marked);
        if is_dense {
            return;
        }
        // From each node of the finest level to all coarser ones.
        let levels = composed(lattice);
        for node in 0..finest.node_count() {
            let all = levels.iter().zip(&starts[1..]);
            self.ups.push(all.flat_map(|(level, start)| {
                level.of(node).iter().map(move |&(parent, weight)| (start + parent, weight))
            }));
        }
        for (level, weights) in levels.iter().enumerate() {
            let rows = Rows { offsets: weights.offsets.clone(), entries: weights.entries.clone() };
            let kind = if level + 1 == part.ordinary_levels() { 2 } else { 1 };
            let children = rows.turned_round(part.counts[level + 1]);
            let moved = children
                .into_iter()
                .map(|row| row.into_iter().map(|(node, w)| (starts[0] + node, w)).collect());
            self.children[kind].extend(moved);
        }
    }

    /// Blocks of a level: 0 are the vertices.
    fn add_blocks(
        &mut self,
        part: &Exported,
        level: usize,
        sums: &DiagonalSums<f32>,
        first_group: u32,
    ) {
        let count = sums.offsets.len() - 1;
        let kind = level.min(2);
        for node in 0..count {
            let words = |share: &super::sums::Share<f32>| {
                let mut row = [first_group + share.group, share.trace.to_bits(), 0, 0, 0, 0, 0, 0];
                row[2..].copy_from_slice(&share.b.map(f32::to_bits));
                row
            };
            self.shares[kind].push(sums.of_node(node).iter().map(words).collect());
        }
        if level > 0 {
            let number = self.parts.len() as u32;
            self.node_parts[level.min(2) - 1].extend(vec![number; count]);
            self.masses[level.min(2) - 1].extend(&sums.masses);
        }
        let mut stiffnesses = vec![0.0; count];
        part.stiffness(OfPart::<f32>::on(&part.of_part.lattice, level), |[a, b], stiffness| {
            if a == b {
                stiffnesses[a as usize] += stiffness;
            }
        });
        self.stiffnesses[kind].extend(stiffnesses.into_iter().map(|k| k as f32));
    }

    /// The pairs of a dense level, the first node not below the second.
    fn add_dense(&mut self, part: &Exported, number: u32, first_group: u32, first_node: u32) {
        let count = part.dense_count();
        let OfPart { full, lattice, groups, .. } = &part.of_part;
        let place = |[a, b]: [u32; 2]| (a * (a + 1) / 2 + b) as usize;
        let pair_count = count * (count + 1) / 2;
        let (mut masses, mut stiffnesses) = (vec![0.0; pair_count], vec![0.0; pair_count]);
        let mut entries: Vec<Vec<[u32; ENTRY_WORDS]>> = vec![Vec::new(); pair_count];
        if count > 0 {
            for &(nodes, mass) in &full.masses {
                masses[place(nodes)] += mass;
            }
            part.stiffness(OfPart::<f32>::on(lattice, lattice.levels.len()), |nodes, stiffness| {
                if nodes[1] <= nodes[0] {
                    stiffnesses[place(nodes)] += stiffness;
                }
            });
            for group in 0..groups.len() {
                for (nodes, b) in full.rest_blocks(group) {
                    let mut row = [first_group + group as u32; ENTRY_WORDS];
                    row[1..].copy_from_slice(&b.map(f32::to_bits));
                    entries[place(nodes)].push(row);
                }
            }
        }
        for a in 0..count as u32 {
            for b in 0..=a {
                let own = &entries[place([a, b])];
                let first = self.entries.len() as u32;
                self.entries.extend(own);
                let constants =
                    [&masses, &stiffnesses].map(|of| (of[place([a, b])] as f32).to_bits());
                let end = self.entries.len() as u32;
                let at = self.dense_numbers;
                let pair = a << 16 | b;
                let [mass, stiffness] = constants;
                let row = [at, pair, mass, stiffness, first, end, first_node, number];
                self.pairs.push(row);
            }
        }
        let size = 3 * count as u32;
        self.dense_numbers += size * (size + 1) / 2;
    }

    fn add_groups(
        &mut self,
        groups: &Groups<f32>,
        full: &FullSums<f32>,
        first_vertex: u32,
        has_dense: bool,
    ) {
        for group in 0..groups.len() {
            let range = groups.offsets[group] as usize..groups.offsets[group + 1] as usize;
            let first = self.group_entries.len() as u32;
            self.group_entries.extend(groups.entries[range].iter().map(|&(v, b)| {
                let [x, y, z] = b.to_array().map(f32::to_bits);
                [first_vertex + v, x, y, z]
            }));
            let end = self.group_entries.len() as u32;
            // Only dense blocks need them.
            let lame = if has_dense { full.lame(group) } else { [0.0; 2] };
            let [mu, lambda] = lame.map(f32::to_bits);
            let viscosity = (groups.viscosities[group] as f32).to_bits();
            let part = self.parts.len() as u32 - 1;
            let law = groups.laws[group] as u32;
            self.groups.push([law, viscosity, mu, lambda, first, end, part]);
        }
    }

    fn finish(self, has_contact: bool) -> Tables {
        let Self { mut header, .. } = self;
        let mut words = vec![0; size_of::<Header>() / 4];
        let mut add = |new: &[u32]| {
            let first = words.len() as u32;
            words.extend_from_slice(new);
            first
        };
        let weighted = |entries: &[(u32, f32)]| -> Vec<u32> {
            entries.iter().flat_map(|&(place, weight)| [place, weight.to_bits()]).collect()
        };
        let bits = |numbers: &[f32]| -> Vec<u32> { numbers.iter().map(|x| x.to_bits()).collect() };
        let mut children = Rows::begun();
        self.children.into_iter().flatten().for_each(|row| children.push(row));
        for (rows, offsets, entries) in [
            (&children, &mut header.child_offsets, &mut header.children),
            (&self.parents, &mut header.parent_offsets, &mut header.parents),
            (&self.ups, &mut header.up_offsets, &mut header.ups),
        ] {
            *offsets = add(&rows.offsets);
            *entries = add(&weighted(&rows.entries));
        }
        let mut offsets = vec![0];
        let mut shares = Vec::new();
        for row in self.shares.iter().flatten() {
            shares.extend_from_slice(row.as_flattened());
            offsets.push((shares.len() / SHARE_WORDS) as u32);
        }
        (header.share_offsets, header.shares) = (add(&offsets), add(&shares));
        header.masses = add(&bits(&self.masses.concat()));
        header.stiffnesses = add(&bits(&self.stiffnesses.concat()));
        header.node_parts = add(&self.node_parts.concat());
        header.pairs = self.pairs.len() as u32;
        header.pair_rows = add(self.pairs.as_flattened());
        header.entries = add(self.entries.as_flattened());
        header.groups = self.groups.len() as u32;
        header.group_rows = add(self.groups.as_flattened());
        header.group_entries = add(self.group_entries.as_flattened());
        header.part_rows = add(self.parts.as_flattened());
        let mut numbers = 0;
        let mut room = |count: u32| {
            numbers += count;
            numbers - count
        };
        header.inverses = room(6 * (header.vertices + header.ordinary));
        header.dense = room(self.dense_numbers);
        header.turns = room(TURN_NUMBERS as u32 * header.groups);
        header.residuals = room(4 * header.nodes);
        header.corrections = room(4 * header.nodes);
        header.steps = room(self.parts.len() as u32);
        if has_contact {
            header.contact = room(CONTACT_NUMBERS as u32 * (header.vertices + header.fine));
        }
        words[..size_of::<Header>() / 4].copy_from_slice(bytemuck::cast_slice(&[header]));
        Tables { header, words, numbers: numbers.into() }
    }
}

/// Names and places of words that kernels find in the tables.
pub fn words() -> Vec<(&'static str, u32)> {
    macro_rules! words {
        ($($name:literal $field:ident)*) => {
            vec![$(($name, (std::mem::offset_of!(Header, $field) / 4) as u32)),*]
        };
    }
    let mut all = words!(
        "LEVELS_VERTICES" vertices "LEVELS_FINE" fine "LEVELS_ORDINARY" ordinary "LEVELS_NODES" nodes
        "LEVELS_GROUPS" groups "LEVELS_PAIRS" pairs "LEVELS_CHILD_OFFSETS" child_offsets
        "LEVELS_CHILDREN" children "LEVELS_PARENT_OFFSETS" parent_offsets "LEVELS_PARENTS" parents
        "LEVELS_UP_OFFSETS" up_offsets "LEVELS_UPS" ups "LEVELS_SHARE_OFFSETS" share_offsets
        "LEVELS_SHARES" shares "LEVELS_MASSES" masses "LEVELS_STIFFNESSES" stiffnesses
        "LEVELS_PAIR_ROWS" pair_rows "LEVELS_ENTRIES" entries "LEVELS_GROUP_ROWS" group_rows
        "LEVELS_GROUP_ENTRIES" group_entries "LEVELS_PART_ROWS" part_rows "LEVELS_INVERSES" inverses
        "LEVELS_DENSE" dense "LEVELS_TURNS" turns "LEVELS_RESIDUALS" residuals
        "LEVELS_CORRECTIONS" corrections "LEVELS_CONTACT" contact
        "LEVELS_STEPS" steps "LEVELS_NODE_PARTS" node_parts
    );
    all.extend([
        ("OF_VERTEX", OF_VERTEX),
        ("MOST_DENSE", MOST_DENSE as u32),
        ("SHARE_WORDS", SHARE_WORDS as u32),
        ("ENTRY_WORDS", ENTRY_WORDS as u32),
        ("GROUP_WORDS", GROUP_WORDS as u32),
        ("GROUP_ENTRY_WORDS", GROUP_ENTRY_WORDS as u32),
        ("PAIR_WORDS", PAIR_WORDS as u32),
        ("LEVEL_PART_WORDS", LEVEL_PART_WORDS as u32),
        ("TURN_NUMBERS", TURN_NUMBERS as u32),
        ("CONTACT_NUMBERS", CONTACT_NUMBERS as u32),
    ]);
    all
}
