//! The nodes of one level: lattice points, a copy for each component of their supports.

use crate::model::z_order;
use crate::scalar::Vec3;

/// A sparse matrix, row by row: vertices by nodes, or nodes by coarser nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Weights {
    /// Row `i` is `offsets[i] .. offsets[i + 1]` of `entries`, shape `[row_count + 1]`; empty where there are no rows.
    pub offsets: Vec<u32>,
    /// Nodes, ascending in each row, with their weights `[1]`, none of them zero. In single precision: any weights are those
    /// of some coarse space, and there are eight of each vertex on each level.
    pub entries: Vec<(u32, f32)>,
}

impl Weights {
    /// Nodes and weights of one row.
    pub fn of(&self, row: usize) -> &[(u32, f32)] {
        &self.entries[self.offsets[row] as usize..self.offsets[row + 1] as usize]
    }
}

/// The vertices that elements tie to each vertex.
pub(super) struct Neighbors {
    /// Those of vertex `v` are `offsets[v] .. offsets[v + 1]` of `vertices`, shape `[vertex_count + 1]`.
    offsets: Vec<u32>,
    /// Each neighbour once, in no order.
    vertices: Vec<u32>,
}

impl Neighbors {
    /// Neighbours by tetrahedra and by pairs, for vertices below `vertex_count`.
    pub fn new(vertex_count: usize, tets: &[[u32; 4]], links: &[[u32; 2]]) -> Self {
        let element = |e: usize| match e.checked_sub(tets.len()) {
            None => &tets[e][..],
            Some(link) => &links[link][..],
        };
        let element_count = tets.len() + links.len();
        // Elements around each vertex first: a list of all pairs would be three times as long.
        let mut first = vec![0_u32; vertex_count + 1];
        for &v in (0..element_count).flat_map(element) {
            first[v as usize + 1] += 1;
        }
        accumulate(&mut first);
        let mut next = first.clone();
        let mut around = vec![0_u32; first[vertex_count] as usize];
        for e in 0..element_count {
            for &v in element(e) {
                around[next[v as usize] as usize] = e as u32;
                next[v as usize] += 1;
            }
        }
        let mut offsets = vec![0; vertex_count + 1];
        let mut vertices = Vec::new();
        // The vertex that has been noted as a neighbour last.
        let mut noted_by = vec![u32::MAX; vertex_count];
        for v in 0..vertex_count {
            noted_by[v] = v as u32;
            for &e in &around[first[v] as usize..first[v + 1] as usize] {
                for &other in element(e as usize) {
                    if noted_by[other as usize] != v as u32 {
                        noted_by[other as usize] = v as u32;
                        vertices.push(other);
                    }
                }
            }
            offsets[v + 1] = vertices.len() as u32;
        }
        Self { offsets, vertices }
    }

    /// The neighbours of one vertex.
    fn of(&self, vertex: u32) -> &[u32] {
        let v = vertex as usize;
        &self.vertices[self.offsets[v] as usize..self.offsets[v + 1] as usize]
    }
}

/// Copies of the lattice points of one level.
pub(super) struct Nodes {
    /// The lattice point of each node, in spacings of the level from the origin, shape `[node_count]`.
    pub points: Vec<[u32; 3]>,
    /// The smallest of the vertices that each node moves, shape `[node_count]`.
    pub first_vertices: Vec<u32>,
    /// Nodes and weights of each vertex, shape `[vertex_count]`.
    pub of_vertices: Weights,
}

/// A vertex in the reach of a lattice point.
struct Reached {
    /// Where the point lies along the Z-order curve.
    order: u64,
    vertex: u32,
    /// Which corner of the vertex's cell the point is, see [`point_at`].
    corner: u8,
}

impl Nodes {
    /// The nodes of a level. `coordinates` are those of the vertices, in spacings of the level from the origin: from
    /// 0 to less than 2 to the power of `Z_ORDER_BITS`, less one for the points above.
    ///
    /// Nodes ascend by their lattice points along a Z-order curve, then by their first vertices.
    pub fn new(coordinates: &[Vec3<f64>], neighbors: &Neighbors) -> Self {
        let (mut reached, offsets) = reach(coordinates);
        reached.sort_unstable_by_key(|r| (r.order, r.vertex));
        let mut next = offsets.clone();
        let mut entries = vec![(0, 0.0); reached.len()];
        let (mut points, mut first_vertices) = (Vec::new(), Vec::new());
        let mut search = Search::new(neighbors, coordinates.len());
        for support in reached.chunk_by(|a, b| a.order == b.order) {
            let point = point_at(coordinates[support[0].vertex as usize], support[0].corner);
            search.begin(support);
            for first in support.iter().map(|r| r.vertex) {
                if !search.is_left[first as usize] {
                    continue;
                }
                let node = points.len() as u32;
                for &v in search.component(first) {
                    let entry = &mut next[v as usize];
                    entries[*entry as usize] =
                        (node, weight(coordinates[v as usize], point) as f32);
                    *entry += 1;
                }
                points.push(point);
                first_vertices.push(first);
            }
        }
        Self { points, first_vertices, of_vertices: Weights { offsets, entries } }
    }
}

/// Finds the components of one support after the other.
struct Search<'a> {
    neighbors: &'a Neighbors,
    /// Whether each vertex is in the present support and in no component yet, shape `[vertex_count]`.
    is_left: Vec<bool>,
    /// How many vertices that is.
    left: usize,
    /// Vertices of the last component that was found.
    component: Vec<u32>,
}

impl<'a> Search<'a> {
    fn new(neighbors: &'a Neighbors, vertex_count: usize) -> Self {
        Self { neighbors, is_left: vec![false; vertex_count], left: 0, component: Vec::new() }
    }

    /// Takes up the next support; nothing is left of the one before.
    fn begin(&mut self, support: &[Reached]) {
        support.iter().for_each(|r| self.is_left[r.vertex as usize] = true);
        self.left = support.len();
    }

    /// What hangs together with `first`, which is left.
    fn component(&mut self, first: u32) -> &[u32] {
        self.component.clear();
        self.take(first);
        let neighbors = self.neighbors;
        let mut asked = 0;
        // Nothing is left of most supports long before all have been asked for their neighbours.
        while self.left > 0 && asked < self.component.len() {
            let v = self.component[asked];
            asked += 1;
            neighbors.of(v).iter().for_each(|&other| self.take(other));
        }
        &self.component
    }

    /// Adds a vertex to the component if it is left.
    fn take(&mut self, vertex: u32) {
        if std::mem::take(&mut self.is_left[vertex as usize]) {
            self.component.push(vertex);
            self.left -= 1;
        }
    }
}

/// All pairs of a vertex and a lattice point with a weight there, vertex by vertex, and where those of each begin.
fn reach(coordinates: &[Vec3<f64>]) -> (Vec<Reached>, Vec<u32>) {
    let mut reached = Vec::with_capacity(8 * coordinates.len());
    let mut offsets = Vec::with_capacity(coordinates.len() + 1);
    offsets.push(0);
    for (v, &x) in coordinates.iter().enumerate() {
        for corner in 0..8 {
            // In a plane of the lattice the points above have no weight.
            if (0..3).all(|axis| corner >> axis & 1 == 0 || x[axis].fract() > 0.0) {
                let order = z_order(point_at(x, corner).map(u64::from));
                reached.push(Reached { order, vertex: v as u32, corner });
            }
        }
        offsets.push(reached.len() as u32);
    }
    (reached, offsets)
}

/// A corner of the cell with this coordinate: bit 0 is the upper one along x, 1 along y, 2 along z.
fn point_at(x: Vec3<f64>, corner: u8) -> [u32; 3] {
    [0, 1, 2].map(|axis| x[axis] as u32 + u32::from(corner >> axis & 1))
}

/// Trilinear weight at this coordinate of a corner of its cell: the product of `1 - |x - k|` over the axes.
fn weight(x: Vec3<f64>, point: [u32; 3]) -> f64 {
    let along = |axis: usize| {
        // The fraction is exact, and `x - k` would not be: no weight vanishes by round-off.
        let fraction = x[axis].fract();
        if x[axis] as u32 == point[axis] { 1.0 - fraction } else { fraction }
    };
    along(0) * along(1) * along(2)
}

/// Counts, each at the place behind its own, become offsets.
fn accumulate(counts: &mut [u32]) {
    for i in 1..counts.len() {
        counts[i] += counts[i - 1];
    }
}
