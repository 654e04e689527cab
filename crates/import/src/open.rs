//! What a file is.

use std::collections::BTreeMap;

use viscera::mesh::io::{Mesh, MeshFile, ReadReport};
use viscera::mesh::{SurfaceMesh, TetMesh};
use viscera_volume::{
    LabelMap, Limits, NamesFrom, Note, VolumeReport, read, summarize, total_segmentator,
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

/// Endings of images; those that are not read get an error that says what is.
const IMAGES: [&str; 11] =
    [".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd", ".mgz", ".mgh", ".img", ".hdr", ".dcm"];

/// Whether bytes are those of an image: NIfTI, NRRD, others that are not read, or packed by gzip, as no mesh is.
pub fn is_image(name: &str, bytes: &[u8]) -> bool {
    let name = name.to_ascii_lowercase();
    bytes.starts_with(b"NRRD")
        || bytes.starts_with(b"\x1f\x8b")
        || bytes.starts_with(b"ObjectType")
        || bytes.get(128..132) == Some(b"DICM")
        || IMAGES.iter().any(|end| name.ends_with(end))
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
        // Others are read as TotalSegmentator's where that is likely, and either is said.
        total_segmentator::name_likely_labels(&mut map, &mut report, &used);
    }
    Ok(Found::Labels(map, report))
}

/// Gives labels of a scan other names than it has, or than were guessed by their numbers.
pub fn rename(
    file: &str,
    map: &mut LabelMap,
    report: &mut VolumeReport,
    names: &[(u16, String)],
) -> Result<(), ImportError> {
    if names.is_empty() {
        return Ok(());
    }
    let used = summarize(map);
    for (label, _) in names {
        if !used.iter().any(|known| known.label == *label) {
            let (file, wanted) = (file.to_owned(), label.to_string());
            let known: Vec<String> = used.iter().map(|known| known.label.to_string()).collect();
            let hint = format!("labels are {}", known.join(", "));
            return Err(ImportError::UnknownLabel { file, wanted, hint });
        }
    }
    // What was guessed is not mixed with what is known.
    let is_guessed = report.names_from == NamesFrom::TotalSegmentator;
    let mut all = if is_guessed { BTreeMap::new() } else { map.names().clone() };
    all.extend(names.iter().cloned());
    map.set_names(all);
    report.notes.retain(|note| !matches!(note, Note::OtherNumbers { .. }));
    report.names_from = NamesFrom::Given;
    Ok(())
}
