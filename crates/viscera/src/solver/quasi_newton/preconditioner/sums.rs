//! What a preconditioner knows of a connected part before it moves: sums over groups of tetrahedra in the rest shape.
//!
//! ```text
//! K_ab = V (mu (g_a.g_b) I + mu (R g_b)(R g_a)^T + lambda (A g_a)(A g_b)^T)               tetrahedron
//! K_cc = sum_groups t I + A B A^T,   t = sum V mu |g_c|^2,  B = sum V (mu + lambda) g_c g_c^T
//! K_cd = sum_groups mu (t_cd I + R B_cd^T R^T) + lambda A B_cd A^T,   B_cd = sum V g_c g_d^T,  t_cd = tr B_cd
//! ```
//!
//! `g_c = sum_a w_ac g_a` is the gradient of node `c`'s shape function, in the rest shape; `R` the rotation, `A` the
//! law's gradient map ([`crate::elements::law::Law::gradient_map`]): cofactors of `F`, by which the neo-Hookean volume
//! term grows where tissue is stretched. Viscosity stiffens all terms of a group alike, by `1 + eta/he`. A *group* is a connected set of tetrahedra of one material in one cell of the finest
//! lattice, which turn and stretch together: `R` and `A` are all that changes, so that the blocks of every level,
//! vertices among them, are found without a pass over the tetrahedra. `K_cc` is exact for neo-Hookean tetrahedra but for
//! that: their volume term has `lambda + mu` before it, and no other than these. Between nodes, in the dense level, `mu`
//! goes with `R`: the sum over all nodes is then positive semidefinite.

use crate::elements::shape_gradients;
use crate::layout::lattice::Lattice;
use crate::layout::{Layout, TetBlock};
use crate::material::MaterialModel;
use crate::scalar::lanes::Point;
use crate::scalar::{Mat3, Real, Vec3, vec3};
use crate::solver::step::strain::is_recovered;

/// A symmetric matrix: xx, yy, zz, yz, xz, xy.
pub type Six<S> = [S; 6];

/// Of Lame's first parameter recovered-gradient tetrahedra have this multiple of the shear modulus here at most: their volume
/// counts for groups of vertices, so that most of what a tetrahedron's changes by costs them little.
const RECOVERED_BULK: f64 = 16.0;

/// A tetrahedron, its vertices counted from the first of the part.
pub struct LocalTet {
    pub law: MaterialModel,
    pub vertices: [u32; 4],
    /// Shape gradients [1/m].
    pub gradients: [Vec3<f64>; 4],
    /// [m^3].
    pub volume: f64,
    /// Lame's parameters [Pa].
    pub mu: f64,
    pub lambda: f64,
    /// Retardation time [s].
    pub viscosity: f64,
}

/// The tetrahedra of a part, read where the layout has them: of a large mesh a copy would be the most memory there is.
pub struct LocalTets<'a, S> {
    layout: &'a Layout<S>,
    /// The part's first vertex.
    first: u32,
    places: Vec<LocalPlace>,
    /// The part's own numbers of its materials, by their first tetrahedra: those of a model depend on other parts.
    materials: Vec<u32>,
}

#[derive(Clone, Copy)]
struct LocalPlace {
    block: u32,
    law: u8,
    lane: u8,
}

impl<'a, S: Real> LocalTets<'a, S> {
    pub fn new(layout: &'a Layout<S>, number: usize) -> Self {
        let part = &layout.parts[number];
        let (mut places, mut materials) = (Vec::new(), Vec::new());
        for (law, set) in layout.tet_sets.iter().enumerate() {
            for block in part.blocks(law).flatten() {
                for lane in 0..set.filled[block] {
                    let material = set.blocks[block].material[usize::from(lane)];
                    if !materials.contains(&material) {
                        materials.push(material);
                    }
                    places.push(LocalPlace { block: block as u32, law: law as u8, lane });
                }
            }
        }
        Self { layout, first: part.vertices.start as u32, places, materials }
    }

    pub fn len(&self) -> usize {
        self.places.len()
    }

    fn constants(&self, tet: u32) -> (&'a TetBlock<S>, usize) {
        let LocalPlace { block, law, lane } = self.places[tet as usize];
        (&self.layout.tet_sets[usize::from(law)].blocks[block as usize], usize::from(lane))
    }

    pub fn vertices(&self, tet: u32) -> [u32; 4] {
        let (constants, lane) = self.constants(tet);
        constants.vertices.map(|corner| corner[lane] - self.first)
    }

    /// By the part's own count.
    fn material(&self, tet: u32) -> usize {
        let (constants, lane) = self.constants(tet);
        let known = self.materials.iter().position(|&known| known == constants.material[lane]);
        known.unwrap_or(self.materials.len())
    }

    pub fn get(&self, tet: u32) -> LocalTet {
        let (constants, lane) = self.constants(tet);
        let material = &self.layout.materials[constants.material[lane] as usize];
        let set = &self.layout.tet_sets[usize::from(self.places[tet as usize].law)];
        let (mu, lambda) = (material.lame_mu.to_f64(), material.lame_lambda.to_f64());
        let most = if is_recovered(self.layout, set) { RECOVERED_BULK * mu } else { f64::INFINITY };
        LocalTet {
            law: set.model,
            vertices: self.vertices(tet),
            gradients: shape_gradients(&constants.shape(lane).cast()),
            volume: constants.rest_volume[lane].to_f64(),
            mu,
            lambda: lambda.min(most),
            viscosity: material.viscosity.to_f64(),
        }
    }
}

/// Groups of tetrahedra, and their mean deformation gradients as sums over vertices: `sum_j x_j b_j^T`.
#[derive(Clone, Debug, Default)]
pub struct Groups<S> {
    pub laws: Vec<MaterialModel>,
    /// Retardation times [s].
    pub viscosities: Vec<f64>,
    pub offsets: Vec<u32>,
    /// A vertex of the part, and `b` [1/m].
    pub entries: Vec<(u32, Vec3<S>)>,
}

/// Tetrahedra by group, group after group.
pub struct Grouped {
    pub tets: Vec<u32>,
    pub offsets: Vec<usize>,
}

impl Grouped {
    /// The tetrahedra of one material in one cell of the finest lattice that hang together by vertices.
    pub fn new<S: Real>(tets: &LocalTets<'_, S>, places: &[Vec3<f64>], lattice: &Lattice) -> Self {
        let cell = |tet: u32| {
            let vertices = tets.vertices(tet);
            let sum =
                vertices.iter().fold(Vec3::ZERO, |sum: Vec3<f64>, &v| sum + places[v as usize]);
            let at = lattice.along_axes(sum * 0.25) * (1.0 / lattice.spacing);
            // A part without levels is one cell.
            let cell = |x: f64| if x.is_finite() { x.floor() as i64 } else { 0 };
            ((tets.material(tet), [at.z, at.y, at.x].map(cell)), tet)
        };
        let mut order: Vec<(_, u32)> = (0..tets.len() as u32).map(cell).collect();
        order.sort_unstable();
        let mut grouped = Self { tets: Vec::with_capacity(tets.len()), offsets: vec![0] };
        let mut seen_by = vec![(u32::MAX, 0u32); places.len()];
        for (cell, of_cell) in order.chunk_by(|a, b| a.0 == b.0).enumerate() {
            let mut parent: Vec<u32> = (0..of_cell.len() as u32).collect();
            for (i, &(_, tet)) in of_cell.iter().enumerate() {
                for v in tets.vertices(tet) {
                    let (seen, other) = seen_by[v as usize];
                    if seen == cell as u32 {
                        let (a, b) = (root(&mut parent, other), root(&mut parent, i as u32));
                        parent[a.max(b) as usize] = a.min(b);
                    }
                    seen_by[v as usize] = (cell as u32, i as u32);
                }
            }
            let mut members: Vec<(u32, u32)> =
                (0..of_cell.len()).map(|i| (root(&mut parent, i as u32), of_cell[i].1)).collect();
            members.sort_unstable();
            for group in members.chunk_by(|a, b| a.0 == b.0) {
                grouped.tets.extend(group.iter().map(|&(_, tet)| tet));
                grouped.offsets.push(grouped.tets.len());
            }
        }
        grouped
    }

    /// How many groups.
    pub fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// The tetrahedra of one.
    pub fn tets(&self, group: usize) -> &[u32] {
        &self.tets[self.offsets[group]..self.offsets[group + 1]]
    }
}

fn root(parent: &mut [u32], mut i: u32) -> u32 {
    while parent[i as usize] != i {
        parent[i as usize] = parent[parent[i as usize] as usize];
        i = parent[i as usize];
    }
    i
}

impl<S: Real> Groups<S> {
    pub fn new(tets: &LocalTets<'_, S>, grouped: &Grouped, vertex_count: usize) -> Self {
        let mut groups = Self { offsets: vec![0], ..Self::default() };
        let mut sums = Gathered::<Vec3<f64>>::new(vertex_count);
        for group in 0..grouped.len() {
            sums.begin();
            let mut volume = 0.0;
            for &tet in grouped.tets(group) {
                let tet = &tets.get(tet);
                for (v, g) in tet.vertices.into_iter().zip(tet.gradients) {
                    *sums.of(v) += g * tet.volume;
                }
                volume += tet.volume;
            }
            let mean = |&(v, b): &(u32, Vec3<f64>)| (v, (b * (1.0 / volume)).cast::<S>());
            groups.entries.extend(sums.list.iter().map(mean));
            let first = tets.get(grouped.tets(group)[0]);
            groups.laws.push(first.law);
            groups.viscosities.push(first.viscosity);
            groups.offsets.push(groups.entries.len() as u32);
        }
        groups
    }

    /// How many.
    pub fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// The mean deformation gradient of a group, at positions [m] of the part's vertices.
    pub fn deformation(&self, group: usize, x: &[Point<S>]) -> Mat3<f64> {
        let range = self.offsets[group] as usize..self.offsets[group + 1] as usize;
        let mut f = Mat3::<f64>::from_columns(Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
        for &(v, b) in &self.entries[range] {
            f = f + Mat3::outer(x[v as usize].vec3().cast::<f64>(), b.cast());
        }
        f
    }
}

/// Values by node, in the order in which the nodes came.
pub struct Gathered<T> {
    pub list: Vec<(u32, T)>,
    place: Vec<(u32, u32)>,
    round: u32,
}

impl<T: Default> Gathered<T> {
    pub fn new(nodes: usize) -> Self {
        Self { list: Vec::new(), place: vec![(0, 0); nodes], round: 0 }
    }

    pub fn begin(&mut self) {
        self.list.clear();
        self.round += 1;
    }

    fn at(&mut self, node: u32) -> usize {
        let (round, place) = &mut self.place[node as usize];
        if *round != self.round {
            (*round, *place) = (self.round, self.list.len() as u32);
            self.list.push((node, T::default()));
        }
        *place as usize
    }

    pub fn of(&mut self, node: u32) -> &mut T {
        let place = self.at(node);
        &mut self.list[place].1
    }
}

/// Where vertices stand on a level.
#[derive(Clone, Copy)]
pub enum On<'a> {
    /// Each is a node.
    Vertices,
    /// On the nodes of this level of the lattice.
    Lattice(&'a Lattice, usize),
}

impl On<'_> {
    /// Calls with the nodes of a vertex and their weights.
    pub fn each(self, v: u32, mut with: impl FnMut(u32, f64)) {
        match self {
            Self::Vertices => with(v, 1.0),
            Self::Lattice(lattice, level) => {
                for &(node, weight) in lattice.levels[level].of_vertices.of(v as usize) {
                    with(node, f64::from(weight));
                }
            }
        }
    }

    /// Calls with all pairs of an element's corners that are free, the nodes of each, and the product of their weights.
    pub fn each_pair<const N: usize>(
        self,
        vertices: &[u32; N],
        free: &[bool],
        mut with: impl FnMut([usize; 2], [u32; 2], f64),
    ) {
        let is_free = |corner: &usize| free[vertices[*corner] as usize];
        for a in (0..N).filter(is_free) {
            for b in (0..N).filter(is_free) {
                self.each(vertices[a], |node, wa| {
                    self.each(vertices[b], |other, wb| with([a, b], [node, other], wa * wb));
                });
            }
        }
    }

    pub fn node_count(self, vertices: usize) -> usize {
        match self {
            Self::Vertices => vertices,
            Self::Lattice(lattice, level) => lattice.levels[level].node_count(),
        }
    }

    /// Gradients [1/m] of the shape functions of all nodes that a tetrahedron touches; vertices that are not free
    /// count as nothing.
    pub fn gradients(self, tet: &LocalTet, free: &[bool], found: &mut Vec<(u32, Vec3<f64>)>) {
        found.clear();
        for (v, g) in tet.vertices.into_iter().zip(tet.gradients) {
            if free[v as usize] {
                self.each(v, |node, weight| {
                    match found.iter_mut().find(|(other, _)| *other == node) {
                        Some((_, sum)) => *sum += g * weight,
                        None => found.push((node, g * weight)),
                    }
                });
            }
        }
    }
}

/// The share of a group in a node's block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Share<S> {
    pub group: u32,
    /// `t` [N/m].
    pub trace: S,
    /// `B` [N/m].
    pub b: Six<S>,
}

/// The diagonal blocks of a level.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DiagonalSums<S> {
    /// `sum_v m_v w_v^2` of each node [kg]; empty for vertices.
    pub masses: Vec<S>,
    /// Shares of node `c` are `offsets[c] .. offsets[c + 1]`.
    pub offsets: Vec<u32>,
    pub shares: Vec<Share<S>>,
}

impl<S: Real> DiagonalSums<S> {
    /// What groups have in a node's block.
    pub fn of_node(&self, node: usize) -> &[Share<S>] {
        &self.shares[self.offsets[node] as usize..self.offsets[node + 1] as usize]
    }

    pub fn new(
        on: On<'_>,
        tets: &LocalTets<'_, S>,
        grouped: &Grouped,
        masses: &[f64],
        free: &[bool],
    ) -> Self {
        let nodes = on.node_count(masses.len());
        let mut sums = Gathered::<(f64, Six<f64>)>::new(nodes);
        let offsets = Self::count(on, tets, grouped, free, nodes);
        let mut next = offsets.clone();
        let mut shares = vec![Share::default(); offsets[nodes] as usize];
        let mut gradients = Vec::new();
        for group in 0..grouped.len() {
            sums.begin();
            for &tet in grouped.tets(group) {
                let tet = &tets.get(tet);
                on.gradients(tet, free, &mut gradients);
                for &(node, g) in &gradients {
                    let (trace, b) = sums.of(node);
                    *trace += tet.volume * tet.mu * g.length_squared();
                    let scale = tet.volume * (tet.mu + tet.lambda);
                    let products =
                        [g.x * g.x, g.y * g.y, g.z * g.z, g.y * g.z, g.x * g.z, g.x * g.y];
                    for (b, product) in b.iter_mut().zip(products) {
                        *b += scale * product;
                    }
                }
            }
            for &(node, (trace, b)) in &sums.list {
                let place = &mut next[node as usize];
                shares[*place as usize] =
                    Share { group: group as u32, trace: S::from_f64(trace), b: b.map(S::from_f64) };
                *place += 1;
            }
        }
        let mut node_masses = vec![0.0; if matches!(on, On::Vertices) { 0 } else { nodes }];
        for v in (0..masses.len() as u32).filter(|&v| free[v as usize]) {
            if !node_masses.is_empty() {
                on.each(v, |node, w| node_masses[node as usize] += masses[v as usize] * w * w);
            }
        }
        Self { masses: node_masses.into_iter().map(S::from_f64).collect(), offsets, shares }
    }

    /// Where the shares of each node begin: one of each group that touches it.
    fn count(
        on: On<'_>,
        tets: &LocalTets<'_, S>,
        grouped: &Grouped,
        free: &[bool],
        nodes: usize,
    ) -> Vec<u32> {
        let mut offsets = vec![0; nodes + 1];
        let mut counted = vec![u32::MAX; nodes];
        for group in 0..grouped.len() as u32 {
            for &tet in grouped.tets(group as usize) {
                for v in tets.vertices(tet).into_iter().filter(|&v| free[v as usize]) {
                    on.each(v, |node, _| {
                        if std::mem::replace(&mut counted[node as usize], group) != group {
                            offsets[node as usize + 1] += 1;
                        }
                    });
                }
            }
        }
        for node in 0..nodes {
            offsets[node + 1] += offsets[node];
        }
        offsets
    }
}

/// `A B A^T` of a symmetric matrix.
pub fn mapped<S: Real>(a: &Mat3<S>, b: &Six<S>) -> Six<S> {
    let [xx, yy, zz, yz, xz, xy] = *b;
    let half = *a * Mat3::from_columns(vec3(xx, xy, xz), vec3(xy, yy, yz), vec3(xz, yz, zz));
    let whole = half * a.transpose();
    let [x, y, z] = whole.columns;
    [x.x, y.y, z.z, z.y, z.x, y.x]
}

/// The inverse of a symmetric positive definite matrix; zero of one that is not.
pub fn inverse<S: Real>(a: &Six<S>) -> Six<S> {
    // Scaled, because the determinant of small masses leaves the range of single precision.
    let size = a[0] + a[1] + a[2];
    let [xx, yy, zz, yz, xz, xy] = a.map(|entry| entry / size);
    let (cx, cy, cz) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
    let determinant = xx * cx + xy * cy + xz * cz;
    if !(determinant > S::ZERO && determinant.is_finite()) {
        return [S::ZERO; 6];
    }
    let scale = S::ONE / (determinant * size);
    [
        cx * scale,
        (xx * zz - xz * xz) * scale,
        (xx * yy - xy * xy) * scale,
        (xy * xz - xx * yz) * scale,
        cz * scale,
        cy * scale,
    ]
}

/// A symmetric matrix times a vector.
#[inline(always)]
pub fn times<S: Real>(a: &Six<S>, v: Vec3<S>) -> Vec3<S> {
    let [xx, yy, zz, yz, xz, xy] = *a;
    vec3(
        xx * v.x + xy * v.y + xz * v.z,
        xy * v.x + yy * v.y + yz * v.z,
        xz * v.x + yz * v.y + zz * v.z,
    )
}

/// Adds a multiple of a symmetric block.
pub fn add_six<S: Real>(into: &mut Six<S>, block: &Mat3<f64>, weight: f64) {
    let [x, y, z] = block.columns;
    let entries = [x.x, y.y, z.z, z.y, z.x, y.x];
    into.iter_mut().zip(entries).for_each(|(sum, entry)| *sum += S::from_f64(entry * weight));
}
