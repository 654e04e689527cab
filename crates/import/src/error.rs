//! Why a file becomes no scene.

use viscera::mesh::MeshError;
use viscera::mesh::io::ReadError;
use viscera::mesh::tetrahedralize::TetrahedralizeError;
use viscera::mesh::winding::FillError;
use viscera_volume::{OrganError, VolumeError};

/// Why a file becomes no scene.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The file could not be loaded.
    #[error("{0}")]
    Load(String),
    /// It is no mesh that can be read.
    #[error(transparent)]
    Mesh(#[from] ReadError),
    /// It is no label map that can be read.
    #[error(transparent)]
    Volume(#[from] VolumeError),
    /// A surface cannot be filled.
    #[error("{file}: {error}")]
    Fill {
        /// The file.
        file: String,
        /// Why.
        error: FillError,
    },
    /// A mesh is none in this unit: too small, or too far away.
    #[error("{file}: with 1 in the file as {unit}, {error}; give another --unit")]
    Scale {
        /// The file.
        file: String,
        /// The unit.
        unit: String,
        /// Why.
        error: MeshError,
    },
    /// A label has no shape.
    #[error("{file}: {error}")]
    Organ {
        /// The file.
        file: String,
        /// Why.
        error: OrganError,
    },
    /// An organ cannot be filled.
    #[error("{file}: `{organ}`: {error}")]
    Organs {
        /// The file.
        file: String,
        /// The organ.
        organ: String,
        /// Why.
        error: TetrahedralizeError,
    },
    /// It would take too long, and need too much memory.
    #[error(
        "{file}: {asked} would be {tets:.1e} tetrahedra, more than are made and simulated at all; take {nearest}"
    )]
    TooFine {
        /// The file.
        file: String,
        /// The option with its value.
        asked: String,
        /// About how many it would be.
        tets: f64,
        /// The option with the nearest value that works.
        nearest: String,
    },
    /// A name that is no label.
    #[error("{file}: there is no label `{wanted}`; {hint}")]
    UnknownLabel {
        /// The file.
        file: String,
        /// What was asked for.
        wanted: String,
        /// The nearest names, or all.
        hint: String,
    },
    /// Nothing of the file is soft tissue.
    #[error("{file}: no label is known as soft tissue; choose some by --labels: {labels}")]
    NoTissue {
        /// The file.
        file: String,
        /// Its labels.
        labels: String,
    },
}
