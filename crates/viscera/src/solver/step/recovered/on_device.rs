//! Recovered-gradient tetrahedra on a device: [`RecoveredTables`] as words, and the room that passes need.
//!
//! Sums over rings are gathered by threads, so that rings need no groups of eight; places keep those of the CPU. Clusters have
//! four places each, some of them empty, and fill workgroups of 64; a workgroup belongs to one connected part.

use bytemuck::{Pod, Zeroable};

use crate::layout::{Frames, Layout, PartRanges, RecoveredTables};
use crate::material::MaterialModel;
use crate::scalar::lanes::LANES;
use crate::solver::step::recovered::passes::set_of;

/// No place.
const NOWHERE: u32 = u32::MAX;

/// A place is marked so in the ring of its own vertex.
const OWN_PLACE: u32 = 1 << 31;

/// Places of a cluster, and clusters of a workgroup.
const CLUSTER: usize = 4;
const CLUSTERS: usize = 64;

/// Words of a place; rows of eight lanes of a block at rest; vectors that a tetrahedron leaves.
const PLACE_WORDS: usize = 8;
const FRAME_ROWS: usize = 17;
const TET_ROWS: usize = 6;

/// Columns of matrices that a place has: three matrices, and one more where tissue is viscous.
const COLUMNS: [u32; 2] = [9, 12];

/// The first words of the tables: where everything stands, counted from there.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
struct Header {
    group_parts: u32,
    places: u32,
    ring_offsets: u32,
    rings: u32,
    tet_offsets: u32,
    corners: u32,
    vertex_offsets: u32,
    vertex_rings: u32,
    cluster_places: u32,
    cluster_volumes: u32,
    average_parts: u32,
    part_averages: u32,
    frames: u32,
    /// Places; the first block of the tetrahedra among all; whether tissue is viscous; `1 - alpha` and `alpha`.
    count: u32,
    first_block: u32,
    is_viscous: u32,
    tet_share: f32,
    place_share: f32,
    /// Where tetrahedra and sums begin.
    tets_at: u32,
    sums_at: u32,
}

/// Whether kernels are there.
pub const IS_THERE: bool = cfg!(feature = "gpu-solves");

/// How much there is to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extent {
    /// Groups of eight places.
    pub groups: u32,
    /// Workgroups of clusters.
    pub averages: u32,
}

impl Extent {
    /// Of a layout that has such tetrahedra.
    pub fn new(layout: &Layout<f32>) -> Option<Self> {
        let tables = layout.recovered.as_ref().filter(|_| IS_THERE)?;
        let averages: usize = tables.parts.iter().map(averages_of).sum();
        let groups = tables.volumes.len() / LANES;
        (groups > 0).then_some(Self { groups: groups as u32, averages: averages as u32 })
    }

    /// Vectors of four numbers that passes leave to each other.
    pub fn vectors(self, layout: &Layout<f32>) -> u64 {
        let [_, sums] = places_of_vectors(layout, LANES as u32 * self.groups);
        u64::from(sums) + u64::from(self.averages)
    }
}

fn averages_of(part: &PartRanges) -> usize {
    part.clusters.len().div_ceil(CLUSTERS)
}

/// Where tetrahedra and where sums begin, behind the places.
fn places_of_vectors(layout: &Layout<f32>, places: u32) -> [u32; 2] {
    let set = set_of(layout);
    let tets = COLUMNS[usize::from(set.viscous)] * places;
    [tets, tets + (TET_ROWS * LANES * set.block_count()) as u32]
}

/// The tables, their header first.
pub fn words(layout: &Layout<f32>) -> Vec<u32> {
    let Some(tables) = &layout.recovered else { return Vec::new() };
    let mut words = vec![0; size_of::<Header>() / 4];
    let mut add = |new: &[u32]| {
        let first = words.len() as u32;
        words.extend_from_slice(new);
        first
    };
    let places = tables.volumes.len();
    let [tet_offsets, corners] = corners(layout, tables);
    let rings = rings(layout, tables);
    let clusters = clusters(tables);
    let frames = tables.frames.iter().flat_map(frame_words).collect::<Vec<_>>();
    let rows = place_rows(tables);
    let [tets_at, sums_at] = places_of_vectors(layout, places as u32);
    let law = MaterialModel::StableNeoHookean as usize;
    let before = layout.tet_sets[..law].iter().map(|set| set.block_count() as u32).sum();
    let group_parts = tables.parts.iter().zip(0..);
    let group_parts: Vec<u32> =
        group_parts.flat_map(|(part, number)| vec![number; part.groups.len()]).collect();
    let header = Header {
        group_parts: add(&group_parts),
        places: add(rows.as_flattened()),
        ring_offsets: add(&rings[0].0),
        rings: add(rings[0].1.as_flattened()),
        tet_offsets: add(&tet_offsets),
        corners: add(&corners),
        vertex_offsets: add(&rings[1].0),
        vertex_rings: add(rings[1].1.as_flattened()),
        cluster_places: add(&clusters.places),
        cluster_volumes: add(&clusters.inverse_volumes),
        average_parts: add(&clusters.parts),
        part_averages: add(&clusters.of_parts),
        frames: add(&frames),
        count: places as u32,
        first_block: before,
        is_viscous: set_of(layout).viscous.into(),
        tet_share: tables.shares[0],
        place_share: tables.shares[1],
        tets_at,
        sums_at,
    };
    words[..size_of::<Header>() / 4].copy_from_slice(bytemuck::cast_slice(&[header]));
    words
}

/// Entries of the rings of places, or of vertices.
pub fn ring_entries(tables: &RecoveredTables<f32>) -> usize {
    own_entries(tables).count()
}

/// Of each place, see `Place` of tables.wgsl.
fn place_rows(tables: &RecoveredTables<f32>) -> Vec<[u32; PLACE_WORDS]> {
    let row = |n: usize| {
        let [local, mu, viscosity] = tables.local[n / LANES].map(|of| of[n % LANES]);
        let [domain, cluster] = tables.bulk[n];
        let numbers =
            [tables.volumes[n], tables.inverse_volumes[n], local, mu, viscosity, domain, cluster];
        let mut row = [tables.vertices[n]; PLACE_WORDS];
        row[1..].copy_from_slice(&numbers.map(f32::to_bits));
        row
    };
    (0..tables.volumes.len()).map(row).collect()
}

/// Offsets, and entries of an index and three numbers.
type Rows = (Vec<u32>, Vec<[u32; 4]>);

/// Entries of all places in a row: the place, the vertex, whether it is the place's own, and the gradient.
fn own_entries(
    tables: &RecoveredTables<f32>,
) -> impl Iterator<Item = (usize, u32, bool, [f32; 3])> {
    (0..tables.volumes.len()).flat_map(move |n| {
        // What only fills a group up is no domain.
        let mut is_due = tables.volumes[n] > 0.0;
        tables.domain_rings.of(n / LANES).iter().filter_map(move |entry| {
            let b = entry.gradient.map(|of_axis| of_axis[n % LANES]);
            let v = entry.index[n % LANES];
            // Once, with whatever gradient.
            let is_own = is_due && v == tables.vertices[n];
            is_due &= !is_own;
            // Rings of a group that are shorter than the longest are filled up with nothing.
            (is_own || b != [0.0; 3]).then_some((n, v, is_own, b))
        })
    })
}

/// Rings of places, and those of vertices: `G_n` from vertices, and forces on vertices from places.
fn rings(layout: &Layout<f32>, tables: &RecoveredTables<f32>) -> [Rows; 2] {
    let mut of_places = vec![Vec::new(); tables.volumes.len()];
    let mut of_vertices = vec![Vec::new(); layout.vertex_count()];
    for (n, v, is_own, b) in own_entries(tables) {
        let [x, y, z] = b.map(f32::to_bits);
        of_places[n].push([v, x, y, z]);
        let own = if is_own { OWN_PLACE } else { 0 };
        of_vertices[v as usize].push([n as u32 | own, x, y, z]);
    }
    [of_places, of_vertices].map(|rows| {
        let mut all: Rows = (vec![0], Vec::new());
        for row in rows {
            all.1.extend(row);
            all.0.push(all.1.len() as u32);
        }
        all
    })
}

/// Corners that belong to each place: four times a tetrahedron's lane and block, and the corner.
fn corners(layout: &Layout<f32>, tables: &RecoveredTables<f32>) -> [Vec<u32>; 2] {
    let mut of_places = vec![Vec::new(); tables.volumes.len()];
    for (block, lane) in set_of(layout).places() {
        for (corner, places) in tables.frames[block].places.iter().enumerate() {
            let entry = (4 * (LANES * block + lane) + corner) as u32;
            of_places[places[lane] as usize / 3].push(entry);
        }
    }
    let mut offsets = vec![0];
    let mut all = Vec::new();
    for row in of_places {
        all.extend(row);
        offsets.push(all.len() as u32);
    }
    [offsets, all]
}

#[derive(Default)]
struct Clusters {
    places: Vec<u32>,
    inverse_volumes: Vec<u32>,
    /// The part of each workgroup.
    parts: Vec<u32>,
    /// Where the workgroups of each part begin, one more at the end.
    of_parts: Vec<u32>,
}

fn clusters(tables: &RecoveredTables<f32>) -> Clusters {
    let mut all = Clusters { of_parts: vec![0], ..Clusters::default() };
    for (part, number) in tables.parts.iter().zip(0..) {
        for c in part.clusters.clone() {
            let own = tables.cluster_offsets[c] as usize..tables.cluster_offsets[c + 1] as usize;
            let end = all.places.len() + CLUSTER;
            all.places.extend(&tables.cluster_places[own]);
            debug_assert!(all.places.len() <= end, "clusters have four places at most");
            all.places.resize(end, NOWHERE);
            all.inverse_volumes.push(tables.inverse_cluster_volumes[c].to_bits());
        }
        all.parts.resize(all.parts.len() + averages_of(part), number);
        all.of_parts.push(all.parts.len() as u32);
        all.inverse_volumes.resize(CLUSTERS * all.parts.len(), 0);
        all.places.resize(CLUSTER * CLUSTERS * all.parts.len(), NOWHERE);
    }
    all
}

/// Arms, weights of faces, and the places of the corners.
fn frame_words(frame: &Frames<f32>) -> Vec<u32> {
    let numbers = frame.arms.iter().chain(&frame.face_weights).flatten().map(|x| x.to_bits());
    numbers.chain(frame.places.iter().flatten().map(|row| row / 3)).collect()
}

/// Names and places of words that kernels find in the tables.
pub fn names() -> Vec<(&'static str, u32)> {
    macro_rules! words {
        ($($name:literal $field:ident)*) => {
            vec![$(($name, (std::mem::offset_of!(Header, $field) / 4) as u32)),*]
        };
    }
    let mut all = words!(
        "RECOVERED_GROUP_PARTS" group_parts "RECOVERED_PLACES" places
        "RECOVERED_RING_OFFSETS" ring_offsets "RECOVERED_RINGS" rings
        "RECOVERED_TET_OFFSETS" tet_offsets "RECOVERED_CORNERS" corners
        "RECOVERED_VERTEX_OFFSETS" vertex_offsets "RECOVERED_VERTEX_RINGS" vertex_rings
        "RECOVERED_CLUSTER_PLACES" cluster_places "RECOVERED_CLUSTER_VOLUMES" cluster_volumes
        "RECOVERED_AVERAGE_PARTS" average_parts "RECOVERED_PART_AVERAGES" part_averages
        "RECOVERED_FRAMES" frames "RECOVERED_COUNT" count "RECOVERED_FIRST_BLOCK" first_block
        "RECOVERED_IS_VISCOUS" is_viscous "RECOVERED_TET_SHARE" tet_share
        "RECOVERED_PLACE_SHARE" place_share "RECOVERED_TETS_AT" tets_at "RECOVERED_SUMS_AT" sums_at
    );
    all.extend([
        ("RECOVERED_LAW", MaterialModel::StableNeoHookean as u32),
        ("PLACE_WORDS", PLACE_WORDS as u32),
        ("FRAME_ROWS", FRAME_ROWS as u32),
        ("TET_ROWS", TET_ROWS as u32),
        ("OWN_PLACE", OWN_PLACE),
    ]);
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::Material;
    use crate::mesh::TetMesh;
    use crate::model::ModelBuilder;
    use crate::scalar::vec3;
    use crate::settings::{Elements, Method, SolverSettings};

    /// Rows that are shorter than others of their group are filled up with their first vertex: of two tetrahedra that share a
    /// face the first tip sees four vertices, itself first, and its group has rows of five.
    #[test]
    fn every_domain_has_its_own_vertex_once() {
        let tissue = Material::new(MaterialModel::StableNeoHookean, 5e3, 0.4, 1000.0);
        let corner = |x: f64, y: f64, z: f64| vec3(x, y, z) * 0.01;
        let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0; 3]];
        let corners = corners.map(|[x, y, z]| corner(x, y, z)).to_vec();
        let mesh = TetMesh::new(corners, vec![[0, 1, 2, 3], [1, 2, 3, 4]], vec![0; 2]);
        let (mesh, _) = mesh.expect("a mesh");
        let mut builder = ModelBuilder::new();
        builder.add_body(&mesh, &tissue.expect("legal")).expect("a body");
        let model = builder.build::<f32>().expect("a model");
        let (method, elements) = (Method::QuasiNewton, Elements::Recovered);
        let settings = SolverSettings { method, elements, ..SolverSettings::default() };
        let layout = Layout::new(&model, &settings);
        let tables = layout.recovered.as_ref().expect("tables");
        let is_filled = |entry: &crate::layout::Entry<f32>| {
            (0..LANES).any(|lane| {
                entry.index[lane] == tables.vertices[lane] && entry.gradient[0][lane] == 0.0
            })
        };
        assert!(tables.domain_rings.of(0).iter().any(is_filled), "no row is filled up so");
        let mut own = vec![0; tables.volumes.len()];
        for (n, v, is_own, _) in own_entries(tables) {
            own[n] += usize::from(is_own);
            assert!(!is_own || v == tables.vertices[n]);
        }
        let expected: Vec<usize> = tables.volumes.iter().map(|&v| usize::from(v > 0.0)).collect();
        assert_eq!(own, expected);
    }
}
