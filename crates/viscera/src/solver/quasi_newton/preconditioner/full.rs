//! The whole matrix of a coarsest level, as sums over groups; the formulas are in [`super::sums`].

use super::rotation::Turn;
use super::sums::{Gathered, Grouped, LocalTets, On};
use crate::scalar::lanes::{Eight, Kernel, LANES, Lanes, run};
use crate::scalar::{Mat3, Real, Vec3, vec3};
use crate::solver::cpu::threads::Workers;

/// Of eight pairs of nodes, the first not below the second, in the rest shape.
#[derive(Clone, Debug)]
pub struct FullBlocks<S> {
    pub nodes: [[u32; 2]; LANES],
    /// How many of the eight there are.
    pub filled: u8,
    /// `sum V g_c g_d^T` [m], column by column.
    b: [Eight<S>; 9],
}

/// The whole matrix of the coarsest level.
#[derive(Clone, Debug, Default)]
pub struct FullSums<S> {
    /// Pairs of nodes with `sum_v m_v w_vc w_vd` [kg], the first not below the second.
    pub masses: Vec<([u32; 2], f64)>,
    /// Of each group.
    blocks: Vec<FullBlocks<S>>,
    /// Blocks of group `g` are `offsets[g] .. offsets[g + 1]`.
    offsets: Vec<usize>,
    /// Lame's parameters of each group [Pa]: mu and lambda.
    lame: Vec<[S; 2]>,
}

impl<S: Real> FullSums<S> {
    pub fn new(
        on: On<'_>,
        tets: &LocalTets<'_, S>,
        grouped: &Grouped,
        masses: &[f64],
        free: &[bool],
    ) -> Self {
        let node_count = on.node_count(masses.len());
        let mut full = Self { offsets: vec![0], ..Self::default() };
        // By pairs: a coarsest level is small.
        let pair = |a: u32, b: u32| a.max(b) * node_count as u32 + a.min(b);
        let nodes = |pair: u32| [pair / node_count as u32, pair % node_count as u32];
        let mut mass = vec![0.0; node_count * node_count];
        let mut of_vertex = Vec::new();
        for v in (0..masses.len() as u32).filter(|&v| free[v as usize]) {
            of_vertex.clear();
            on.each(v, |node, w| of_vertex.push((node, w)));
            for &(a, wa) in &of_vertex {
                for &(b, wb) in of_vertex.iter().filter(|&&(b, _)| b <= a) {
                    mass[pair(a, b) as usize] += masses[v as usize] * wa * wb;
                }
            }
        }
        let kept = (0..).zip(mass).filter(|&(_, mass)| mass != 0.0);
        full.masses = kept.map(|(pair, mass)| (nodes(pair), mass)).collect();
        let mut sums = Gathered::<Mat3<f64>>::new(node_count * node_count);
        let mut gradients: Vec<(u32, Vec3<f64>)> = Vec::new();
        for group in 0..grouped.len() {
            sums.begin();
            for &tet in grouped.tets(group) {
                let tet = &tets.get(tet);
                on.gradients(tet, free, &mut gradients);
                for &(a, ga) in &gradients {
                    for &(b, gb) in gradients.iter().filter(|&&(b, _)| b <= a) {
                        let sum = sums.of(pair(a, b));
                        *sum = *sum + Mat3::outer(ga * tet.volume, gb);
                    }
                }
            }
            for pairs in sums.list.chunks(LANES) {
                let mut eight = FullBlocks {
                    nodes: [[0; 2]; LANES],
                    filled: pairs.len() as u8,
                    b: [[S::ZERO; LANES]; 9],
                };
                for (lane, &(pair, b)) in pairs.iter().enumerate() {
                    eight.nodes[lane] = nodes(pair);
                    let entries = b.columns.map(Vec3::to_array);
                    for (row, entry) in eight.b.iter_mut().zip(entries.as_flattened()) {
                        row[lane] = S::from_f64(*entry);
                    }
                }
                full.blocks.push(eight);
            }
            full.offsets.push(full.blocks.len());
            let first = tets.get(grouped.tets(group)[0]);
            full.lame.push([first.mu, first.lambda].map(S::from_f64));
        }
        full.blocks.shrink_to_fit();
        full
    }

    /// Calls with each pair of nodes and its block [kg] in a group that has turned, `squared` being `he^2` [s^2].
    pub fn each_block(
        &self,
        workers: &Workers,
        group: usize,
        turn: &Turn<S>,
        squared: f64,
        add: impl FnMut([u32; 2], &Mat3<S>),
    ) {
        let blocks = &self.blocks[self.offsets[group]..self.offsets[group + 1]];
        let squared = S::from_f64(squared) * turn.stiffer;
        let lame = self.lame[group].map(|parameter| parameter * squared);
        let (r, a) = (turn.rotation, turn.map);
        run(workers.instructions, EachBlock { blocks, lame, r, a, add });
    }

    /// Pairs of nodes that a group has a share of, with `sum V g_c g_d^T` [m], column by column.
    #[cfg(feature = "gpu")]
    pub fn rest_blocks(&self, group: usize) -> impl Iterator<Item = ([u32; 2], [S; 9])> {
        let blocks = &self.blocks[self.offsets[group]..self.offsets[group + 1]];
        blocks.iter().flat_map(|eight| {
            let of_lane = |lane: usize| (eight.nodes[lane], eight.b.map(|row| row[lane]));
            (0..usize::from(eight.filled)).map(of_lane)
        })
    }

    /// Lame's parameters of a group [Pa]: mu and lambda.
    #[cfg(feature = "gpu")]
    pub fn lame(&self, group: usize) -> [S; 2] {
        self.lame[group]
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.masses[..])
            + size_of_val(&self.blocks[..])
            + size_of_val(&self.offsets[..])
            + size_of_val(&self.lame[..])
    }
}

struct EachBlock<'a, S, F> {
    blocks: &'a [FullBlocks<S>],
    lame: [S; 2],
    r: Mat3<S>,
    a: Mat3<S>,
    add: F,
}

impl<S: Real, F: FnMut([u32; 2], &Mat3<S>)> Kernel<S> for EachBlock<'_, S, F> {
    #[inline(always)]
    fn run<L: Lanes<Real = S>>(mut self) {
        let [mu, lambda] = [L::splat(self.lame[0]), L::splat(self.lame[1])];
        let (r, a) = (splat::<L>(&self.r), splat::<L>(&self.a));
        for eight in self.blocks {
            let mut found = [[S::ZERO; LANES]; 9];
            let mut lane = 0;
            while lane < usize::from(eight.filled) {
                let e = |row: usize| L::load(&eight.b[row], lane);
                let b = Mat3::from_columns(
                    vec3(e(0), e(1), e(2)),
                    vec3(e(3), e(4), e(5)),
                    vec3(e(6), e(7), e(8)),
                );
                let shear = Mat3::IDENTITY * b.trace() + r * b.transpose() * r.transpose();
                let block = shear * mu + a * b * a.transpose() * lambda;
                for column in 0..3 {
                    let Vec3 { x, y, z } = block.columns[column];
                    x.store(&mut found[3 * column], lane);
                    y.store(&mut found[3 * column + 1], lane);
                    z.store(&mut found[3 * column + 2], lane);
                }
                lane += L::WIDTH;
            }
            for lane in 0..usize::from(eight.filled) {
                let e = |row: usize| found[row][lane];
                let block = Mat3::from_columns(
                    vec3(e(0), e(1), e(2)),
                    vec3(e(3), e(4), e(5)),
                    vec3(e(6), e(7), e(8)),
                );
                (self.add)(eight.nodes[lane], &block);
            }
        }
    }
}

#[inline(always)]
fn splat<L: Lanes>(a: &Mat3<L::Real>) -> Mat3<L> {
    let [x, y, z] = a.columns;
    Mat3::from_columns(
        vec3(L::splat(x.x), L::splat(x.y), L::splat(x.z)),
        vec3(L::splat(y.x), L::splat(y.y), L::splat(y.z)),
        vec3(L::splat(z.x), L::splat(z.y), L::splat(z.z)),
    )
}
