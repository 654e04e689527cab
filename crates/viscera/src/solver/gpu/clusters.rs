//! Clusters of tetrahedra as the kernel that sweeps over them sees them.

use bytemuck::{Pod, Zeroable};

use crate::layout::{HAS_CLUSTERS, Layout};
use crate::scalar::lanes::LANES;

/// The table's row of a cluster.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct ClusterRow {
    /// The place of its first colour among those of all, and how many it has.
    pub first_start: u32,
    pub colors: u32,
    /// Its vertices among those of all.
    pub first_vertex: u32,
    pub vertex_count: u32,
}

/// Of all clusters, law by law, in each sorted by colour.
#[derive(Clone, Debug, Default)]
pub(super) struct ClusterTables {
    pub rows: Vec<ClusterRow>,
    /// The first block of each colour of a cluster, and where the last one's end.
    pub starts: Vec<u32>,
    /// The solver's numbers; in a cluster in the order in which its corners name them.
    pub vertices: Vec<u32>,
    /// Of each block: its corners by their places among the cluster's vertices, the first two in a word, the others in another.
    pub corners: Vec<[u32; 2 * LANES]>,
}

impl ClusterTables {
    /// Nothing where colours have one level.
    pub fn new(layout: &Layout<f32>) -> Option<Self> {
        let is_clustered = layout.tet_sets.iter().any(|set| set.clusters.is_some());
        if !HAS_CLUSTERS || !is_clustered {
            return None;
        }
        let mut tables = Self::default();
        let mut place_of = vec![0; layout.vertex_count()];
        let mut before = 0;
        for set in &layout.tet_sets {
            let Some(clusters) = &set.clusters else { continue };
            for cluster in 0..clusters.len() {
                let blocks = clusters.blocks(cluster..cluster + 1);
                // Ascending: neighbouring threads load neighbouring vertices.
                let corners = set.blocks[blocks.clone()].iter().map(|block| &block.vertices);
                let mut vertices: Vec<u32> =
                    corners.flat_map(|all| all.as_flattened()).copied().collect();
                vertices.sort_unstable();
                vertices.dedup();
                vertices.iter().zip(0..).for_each(|(&v, place)| place_of[v as usize] = place);
                let (first_start, first_vertex) = (tables.starts.len(), tables.vertices.len());
                for block in blocks.clone() {
                    let inner = |block: usize| clusters.inner[block];
                    if block == blocks.start || inner(block) != inner(block - 1) {
                        tables.starts.push((before + block) as u32);
                    }
                    let place = |corner: usize, lane: usize| -> u32 {
                        place_of[set.blocks[block].vertices[corner][lane] as usize]
                    };
                    tables.corners.push(std::array::from_fn(|i| {
                        let (pair, lane) = (i / LANES, i % LANES);
                        place(2 * pair, lane) | (place(2 * pair + 1, lane) << 16)
                    }));
                }
                tables.rows.push(ClusterRow {
                    first_start: first_start as u32,
                    colors: (tables.starts.len() - first_start) as u32,
                    first_vertex: first_vertex as u32,
                    vertex_count: vertices.len() as u32,
                });
                tables.starts.push((before + blocks.end) as u32);
                tables.vertices.extend(vertices);
            }
            before += set.block_count();
        }
        Some(tables)
    }
}
