//! Why numbers are not a mesh.

/// Why numbers are not a mesh. Indices count from 0.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// There is nothing to simulate.
    #[error("the mesh has no tetrahedra; mesh the volume, not only its surface")]
    Empty,
    /// More vertices or tetrahedra than 32-bit indices can name.
    #[error("the mesh has {count} {what}; at most {limit} can be numbered, use a coarser mesh")]
    TooLarge {
        /// "vertices" or "tetrahedra".
        what: &'static str,
        /// How many were given.
        count: usize,
        /// How many 32-bit indices can number.
        limit: usize,
    },
    /// Not one region label per tetrahedron.
    #[error("{regions} region labels for {tets} tetrahedra; give one label each")]
    RegionCount {
        /// How many labels were given.
        regions: usize,
        /// How many tetrahedra were given.
        tets: usize,
    },
    /// A coordinate is infinite or not a number.
    #[error("vertex {vertex} has a coordinate that is not a finite number; export the mesh again")]
    NonFinite {
        /// The vertex.
        vertex: usize,
    },
    /// A coordinate so large that products of lengths would overflow.
    #[error(
        "vertex {vertex} lies {distance:e} m from the origin; at most {:e} m, check the unit",
        super::MAX_COORDINATE
    )]
    TooFar {
        /// The vertex.
        vertex: usize,
        /// Its largest coordinate `[m]`.
        distance: f64,
    },
    /// A tetrahedron refers to a vertex that does not exist.
    #[error("tetrahedron {tet} refers to vertex {vertex}; the mesh has {vertex_count}")]
    IndexOutOfRange {
        /// The tetrahedron.
        tet: usize,
        /// The index it names.
        vertex: u32,
        /// How many vertices there are.
        vertex_count: usize,
    },
    /// A tetrahedron names the same vertex twice.
    #[error("tetrahedron {tet} names vertex {vertex} twice; `viscera mesh repair` leaves it out")]
    RepeatedVertex {
        /// The tetrahedron.
        tet: usize,
        /// The vertex.
        vertex: u32,
    },
    /// Two tetrahedra have the same four vertices.
    #[error(
        "tetrahedron {tet} repeats tetrahedron {first}; `viscera mesh repair` leaves one of them out"
    )]
    RepeatedTet {
        /// The later of the two.
        tet: usize,
        /// The earlier of the two.
        first: usize,
    },
    /// A tetrahedron so small that its volume would underflow in single precision.
    #[error(
        "tetrahedron {tet} {}; at least {:e} m is needed, check the unit",
        longest_edge_text(*.longest_edge),
        super::MIN_EDGE
    )]
    TooSmall {
        /// The tetrahedron.
        tet: usize,
        /// Its longest edge `[m]`.
        longest_edge: f64,
    },
    /// A tetrahedron without volume, relative to its own size.
    #[error(
        "tetrahedron {tet} is flat: shape quality {quality:.1e}, at least {:e} is needed; \
        `viscera mesh repair` gives it a volume or leaves it out",
        super::MIN_SHAPE_QUALITY
    )]
    FlatTet {
        /// The tetrahedron.
        tet: usize,
        /// Its [`shape_quality`](super::quality::shape_quality), dimensionless.
        quality: f64,
    },
    /// Three or more tetrahedra share a face, so at least two of them overlap.
    #[error("tetrahedron {tet} is the third on the face of vertices {}, {} and {}; \
        a face has two sides, `viscera mesh repair` leaves out one of the three", face[0], face[1], face[2])]
    CrowdedFace {
        /// The third tetrahedron.
        tet: usize,
        /// The vertices of the face, ascending.
        face: [u32; 3],
    },
}

/// The part of a mesh that an error is about, so that a reader can name the line of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshPlace {
    /// The mesh as a whole.
    Whole,
    /// One vertex, by its index.
    Vertex(usize),
    /// One tetrahedron, by its index.
    Tet(usize),
}

impl MeshError {
    /// The vertex or tetrahedron that the error is about.
    pub fn place(&self) -> MeshPlace {
        match *self {
            Self::Empty | Self::TooLarge { .. } | Self::RegionCount { .. } => MeshPlace::Whole,
            Self::NonFinite { vertex } | Self::TooFar { vertex, .. } => MeshPlace::Vertex(vertex),
            Self::IndexOutOfRange { tet, .. }
            | Self::RepeatedVertex { tet, .. }
            | Self::RepeatedTet { tet, .. }
            | Self::TooSmall { tet, .. }
            | Self::FlatTet { tet, .. }
            | Self::CrowdedFace { tet, .. } => MeshPlace::Tet(tet),
        }
    }
}

fn longest_edge_text(longest_edge: f64) -> String {
    if longest_edge > 0.0 {
        format!("has no edge longer than {longest_edge:e} m")
    } else {
        "has all its vertices in one place".to_owned()
    }
}
