//! Why a file becomes no scene.

use viscera::mesh::MeshError;
use viscera::mesh::io::ReadError;
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
    /// A surface is too thin for its edges.
    #[error(
        "{file} is too thin for edges of {long}; `viscera scene new {file} --edge \"{short}\"` fills it"
    )]
    Thin {
        /// The file.
        file: String,
        /// The edges that were tried.
        long: String,
        /// Edges that were seen to find it.
        short: String,
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
    #[error("{file}: `{organ}`: {reason}")]
    Organs {
        /// The file.
        file: String,
        /// The organ.
        organ: String,
        /// Why.
        reason: String,
    },
    /// Bone or air is asked for as soft tissue.
    #[error("{file}: `{name}` {what}; {advice}")]
    NoSoftTissue {
        /// The file.
        file: String,
        /// The label's name.
        name: String,
        /// What it is.
        what: &'static str,
        /// What to do.
        advice: String,
    },
    /// An option that this kind of file does not have.
    #[error("{file} {is}: {option} {why}")]
    Option {
        /// The file.
        file: String,
        /// What the file is.
        is: &'static str,
        /// The option.
        option: &'static str,
        /// Why not, and what to do.
        why: String,
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
