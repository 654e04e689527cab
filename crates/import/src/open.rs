//! What a file is.

use viscera::mesh::io::{Mesh, MeshFile, ReadReport};
use viscera::mesh::{SurfaceMesh, TetMesh};
use viscera_volume::{
    LabelMap, Limits, NamesFrom, VolumeReport, read, summarize, total_segmentator,
};

use crate::ImportError;
use crate::name::stem_of;

/// What a file is. Meshes are in units of the file.
pub enum Found {
    /// Tetrahedra.
    Tets(TetMesh, ReadReport),
    /// A surface.
    Surface(SurfaceMesh, ReadReport),
    /// A segmented scan.
    Labels(LabelMap, VolumeReport),
}

/// Whether bytes are those of an image: NIfTI, NRRD, or packed by gzip, as no mesh is.
fn is_image(name: &str, bytes: &[u8]) -> bool {
    let name = name.to_ascii_lowercase();
    bytes.starts_with(b"NRRD")
        || bytes.starts_with(b"\x1f\x8b")
        || [".nii", ".nii.gz", ".nrrd", ".nhdr"].iter().any(|end| name.ends_with(end))
        || matches!(bytes.get(344..347), Some(b"n+1" | b"ni1"))
        || matches!(bytes.get(4..7), Some(b"n+2" | b"ni2"))
}

/// Reads a file, and the one beside it where it is one of two, by a function that loads files by name.
pub fn open(
    name: &str,
    load: impl FnMut(&str) -> Result<Vec<u8>, String>,
) -> Result<Found, ImportError> {
    let file = MeshFile::load(name, load).map_err(ImportError::Load)?;
    if !is_image(name, &file.bytes) {
        return Ok(match file.mesh(1.0)? {
            (Mesh::Tets(mesh), report) => Found::Tets(mesh, report),
            (Mesh::Surface(surface), report) => Found::Surface(surface, report),
        });
    }
    let (mut map, mut report) = read(name, &file.bytes, Limits::default())?;
    let used = summarize(&map);
    if let (NamesFrom::None, [only]) = (report.names_from, &used[..]) {
        // A mask of one organ is what its file is named after.
        map.set_names([(only.label, stem_of(name).to_owned())].into());
    } else if report.names_from == NamesFrom::None {
        // Others are read as TotalSegmentator's, and that is said.
        // Labels above 117 are of another program, and stay without names.
        let _ = total_segmentator::name_labels(&mut map, &mut report);
    }
    Ok(Found::Labels(map, report))
}
