//! Mesh files, one module for each format: bytes in, bytes out.
//!
//! The content tells the format; the extension counts only where the content says nothing. Every reader makes a
//! `content::Content` of a file: vertices, cells, names. Tissue and surfaces are made of it in one place.

mod abaqus;
mod cells;
mod content;
mod error;
pub mod gltf;
pub mod gmsh;
pub mod handover;
mod lines;
mod medit;
mod numbered;
pub mod obj;
mod parsed;
pub mod ply;
pub mod pvd;
pub mod stl;
mod tetgen;
mod text;
pub mod vtk;
mod vtk_cells;
pub mod vtu;

pub use error::{Place, ReadError, ReadProblem, WriteError};
pub(super) use parsed::unused_text;
pub use parsed::{CountedElements, Format, MendedFile, MeshNames, Patch, ReadReport};

use super::{SurfaceMesh, TetMesh};
use content::Content;
use error::Fault;
use lines::{Lines, holds};

/// A file, or the two of a mesh of TetGen.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshFile {
    /// For its extension and for errors.
    pub name: String,
    /// What is in it.
    pub bytes: Vec<u8>,
    /// What is in the file beside it, see [`beside`].
    pub beside: Option<Vec<u8>>,
}

/// What a file is.
#[derive(Clone, Debug, PartialEq)]
pub enum Mesh {
    /// Tetrahedra.
    Tets(TetMesh),
    /// Triangles alone.
    Surface(SurfaceMesh),
}

/// The name of the other file of a mesh that is in two: `liver.node` for `liver.ele`, and the other way round.
pub fn beside(name: &str) -> Option<String> {
    let extension = tetgen::looks_like(name)?;
    let (stem, _) = name.rsplit_once('.')?;
    Some(format!("{stem}.{extension}"))
}

impl MeshFile {
    /// A file, and the one beside it if there has to be one, by a function that gets bytes by name.
    pub fn load<E>(
        name: &str,
        mut load: impl FnMut(&str) -> Result<Vec<u8>, E>,
    ) -> Result<Self, E> {
        let bytes = load(name)?;
        let beside = beside(name).map(|other| load(&other)).transpose()?;
        Ok(Self { name: name.into(), bytes, beside })
    }

    /// Its tetrahedra. `unit_in_meters` is the length of one unit of the file [m].
    pub fn tets(&self, unit_in_meters: f64) -> Result<(TetMesh, ReadReport), ReadError> {
        self.read(unit_in_meters, |content| content.into_tets(unit_in_meters))
    }

    /// Its triangles; the boundary of its tetrahedra where it has no others.
    pub fn surface(&self, unit_in_meters: f64) -> Result<(SurfaceMesh, ReadReport), ReadError> {
        self.read(unit_in_meters, |content| content.into_surface(unit_in_meters))
    }

    /// Its tetrahedra, or its triangles where it has none.
    pub fn mesh(&self, unit_in_meters: f64) -> Result<(Mesh, ReadReport), ReadError> {
        self.read(unit_in_meters, |content| {
            if content.cells.tets.is_empty() && !content.cells.triangles.is_empty() {
                let (surface, report) = content.into_surface(unit_in_meters)?;
                return Ok((Mesh::Surface(surface), report));
            }
            let (tets, report) = content.into_tets(unit_in_meters)?;
            Ok((Mesh::Tets(tets), report))
        })
    }

    /// What it holds, with what is wrong left out or mended, see [`mend`](super::mend). Vertices no farther apart than `weld` [m]
    /// become one; those that a file in single precision could not tell apart where nothing is said.
    pub fn mended(&self, unit_in_meters: f64, weld: Option<f64>) -> Result<MendedFile, ReadError> {
        self.read(unit_in_meters, |content| content.into_mended(unit_in_meters, weld))
    }

    fn read<T>(
        &self,
        unit_in_meters: f64,
        make: impl FnOnce(Content) -> Result<T, Fault>,
    ) -> Result<T, ReadError> {
        read(&self.name, (&self.bytes, self.beside.as_deref()), unit_in_meters, make)
    }
}

/// Reads tetrahedra from the bytes of a file that stands alone, see [`MeshFile::tets`].
pub fn read_tet_mesh(
    name: &str,
    bytes: &[u8],
    unit_in_meters: f64,
) -> Result<(TetMesh, ReadReport), ReadError> {
    read(name, (bytes, None), unit_in_meters, |content| content.into_tets(unit_in_meters))
}

/// Reads a surface from the bytes of a file that stands alone, see [`MeshFile::surface`].
pub fn read_surface(
    name: &str,
    bytes: &[u8],
    unit_in_meters: f64,
) -> Result<(SurfaceMesh, ReadReport), ReadError> {
    read(name, (bytes, None), unit_in_meters, |content| content.into_surface(unit_in_meters))
}

fn read<T>(
    name: &str,
    (bytes, other): (&[u8], Option<&[u8]>),
    unit_in_meters: f64,
    make: impl FnOnce(Content) -> Result<T, Fault>,
) -> Result<T, ReadError> {
    let bytes = without_mark(bytes);
    let mut file = name.to_owned();
    check_unit(unit_in_meters)
        .and_then(|()| find_kind(name, bytes))
        .and_then(|kind| match kind {
            Kind::Handover => handover::read(bytes),
            Kind::Obj => obj::read(bytes),
            _ if !cfg!(feature = "formats") => Err(Fault::not_built()),
            Kind::VtkXml => vtu::read(bytes),
            Kind::Gmsh => gmsh::read(bytes),
            Kind::Vtk => vtk::read(bytes),
            Kind::Medit => medit::read(bytes),
            Kind::Abaqus => abaqus::read(bytes),
            Kind::Stl => stl::read(bytes),
            Kind::Ply => ply::read(bytes),
            Kind::TetGen { is_nodes } => {
                let name_of_other = beside(name).unwrap_or_default();
                let other = other.ok_or_else(|| {
                    let what = format!("mesh without {name_of_other}");
                    Fault::whole_file(ReadProblem::Missing { what })
                })?;
                let mut both = [(name.to_owned(), bytes), (name_of_other, without_mark(other))];
                if !is_nodes {
                    both.reverse();
                }
                let [(name_of_nodes, nodes), (name_of_elements, elements)] = both;
                file = name_of_nodes;
                let nodes = tetgen::read_nodes(nodes)?;
                file = name_of_elements;
                tetgen::read(nodes, elements)
            }
        })
        .and_then(make)
        .map_err(|Fault { place, problem }| ReadError { file, place, problem })
}

/// Some programs begin text with a mark of its encoding.
fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes)
}

fn check_unit(meters: f64) -> Result<(), Fault> {
    if meters.is_finite() && meters > 0.0 {
        return Ok(());
    }
    Err(Fault::whole_file(ReadProblem::Unit { meters }))
}

/// Which reader a file belongs to.
#[derive(Clone, Copy)]
enum Kind {
    Handover,
    Gmsh,
    VtkXml,
    Vtk,
    TetGen { is_nodes: bool },
    Medit,
    Abaqus,
    Obj,
    Stl,
    Ply,
}

fn find_kind(name: &str, bytes: &[u8]) -> Result<Kind, Fault> {
    const OBJ_KEYWORDS: [&[u8]; 10] =
        [b"v", b"vn", b"vt", b"vp", b"f", b"g", b"o", b"s", b"mtllib", b"usemtl"];

    if handover::is_it(bytes) {
        return Ok(Kind::Handover);
    }
    if bytes.starts_with(b"\x1f\x8b") || bytes.starts_with(b"PK\x03\x04") {
        return Err(unsupported("a compressed file", "unpack it first"));
    }
    if stl::is_binary(bytes) {
        return Ok(Kind::Stl);
    }
    let mut lines = Lines::new(bytes);
    let Some(first) = lines.next() else {
        return Err(Fault::whole_file(ReadProblem::Empty));
    };
    match first.text {
        [b'$', ..] => return Ok(Kind::Gmsh),
        [b'<', ..] if holds(bytes, b"<VTKFile") => return Ok(Kind::VtkXml),
        [b'#', rest @ ..] if rest.trim_ascii_start().starts_with(b"vtk DataFile") => {
            return Ok(Kind::Vtk);
        }
        b"ply" => return Ok(Kind::Ply),
        text if abaqus::looks_like(text) => return Ok(Kind::Abaqus),
        _ => {}
    }
    let content = std::iter::once(first).chain(lines).find(|line| !line.text.starts_with(b"#"));
    let word = content.and_then(|line| line.words().next()).unwrap_or_default();
    let extension = name.rsplit_once('.').map(|(_, extension)| extension.to_ascii_lowercase());
    match (word, extension.as_deref()) {
        (b"MeshVersionFormatted", _) => Ok(Kind::Medit),
        (b"solid", _) => Ok(Kind::Stl),
        (word, _) if OBJ_KEYWORDS.contains(&word) => Ok(Kind::Obj),
        (_, Some("msh")) => Ok(Kind::Gmsh),
        (_, Some("vtu" | "vtp")) => Ok(Kind::VtkXml),
        (_, Some("vtk")) => Ok(Kind::Vtk),
        (_, Some("obj")) => Ok(Kind::Obj),
        (_, Some("mesh")) => Ok(Kind::Medit),
        (_, Some("meshb")) => Err(unsupported("a binary Medit file", "convert it to text (.mesh)")),
        (_, Some("inp")) => Ok(Kind::Abaqus),
        (_, Some("ele")) => Ok(Kind::TetGen { is_nodes: false }),
        (_, Some("node")) => Ok(Kind::TetGen { is_nodes: true }),
        (_, Some("stl")) => Err(Fault::whole_file(ReadProblem::UnexpectedEnd {
            reading: "its triangles (it is not as long as its header says, and no text)".into(),
        })),
        (_, Some("ply")) => Ok(Kind::Ply),
        _ => Err(Fault::whole_file(ReadProblem::UnknownFormat)),
    }
}

fn unsupported(found: &str, advice: &'static str) -> Fault {
    Fault::whole_file(ReadProblem::Unsupported { found: found.into(), advice })
}
