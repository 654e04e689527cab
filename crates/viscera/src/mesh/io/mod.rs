//! Mesh files, one module for each format: bytes in, bytes out.
//!
//! [`read_tet_mesh`] and [`read_surface`] tell the format by its content; the extension only
//! counts where the content says nothing.

mod error;
pub mod gmsh;
mod lines;
pub mod obj;
mod parsed;
pub mod pvd;
pub mod vtu;

pub use error::{ReadError, ReadProblem, WriteError};
pub use parsed::{Format, ReadReport, SkippedElements};

use super::{SurfaceMesh, TetMesh};
use error::Fault;
use lines::{Lines, holds};
use parsed::Parsed;

/// Reads tetrahedra from the bytes of a Gmsh (1 or 2.x ASCII) or VTU (ASCII or appended raw) file.
///
/// `name` is the file's name, for its extension and for errors; `unit_in_meters` is the length of
/// one unit of the file `[m]`.
pub fn read_tet_mesh(
    name: &str,
    bytes: &[u8],
    unit_in_meters: f64,
) -> Result<(TetMesh, ReadReport), ReadError> {
    front_door(name, bytes, unit_in_meters, |kind, bytes| match kind {
        Kind::Gmsh => gmsh::read(bytes, unit_in_meters),
        Kind::VtkXml => vtu::read(bytes, unit_in_meters),
        Kind::Obj => Err(unsupported(
            "a surface (OBJ)",
            "tissue needs tetrahedra, so mesh the volume inside and save it as Gmsh 2.2 or VTU",
        )),
    })
}

/// Reads a surface from the bytes of an OBJ file; arguments as for [`read_tet_mesh`].
pub fn read_surface(
    name: &str,
    bytes: &[u8],
    unit_in_meters: f64,
) -> Result<(SurfaceMesh, ReadReport), ReadError> {
    front_door(name, bytes, unit_in_meters, |kind, bytes| match kind {
        Kind::Obj => obj::read(bytes, unit_in_meters),
        Kind::Gmsh | Kind::VtkXml => {
            Err(unsupported("a surface in this format", "save the surface as OBJ"))
        }
    })
}

fn front_door<Mesh>(
    name: &str,
    bytes: &[u8],
    unit_in_meters: f64,
    read: impl FnOnce(Kind, &[u8]) -> Result<Parsed<Mesh>, Fault>,
) -> Result<(Mesh, ReadReport), ReadError> {
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    check_unit(unit_in_meters)
        .and_then(|()| find_kind(name, bytes))
        .and_then(|kind| read(kind, bytes))
        .map(|Parsed { mesh, repairs, format, skipped }| {
            (mesh, ReadReport { format: Some(format), repairs, skipped })
        })
        .map_err(|Fault { line, problem }| ReadError { file: name.into(), line, problem })
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
    Gmsh,
    VtkXml,
    Obj,
}

fn find_kind(name: &str, bytes: &[u8]) -> Result<Kind, Fault> {
    const OBJ_KEYWORDS: [&[u8]; 10] =
        [b"v", b"vn", b"vt", b"vp", b"f", b"g", b"o", b"s", b"mtllib", b"usemtl"];
    const VTU_ADVICE: &str = "open it in ParaView and save it as .vtu with data mode \"Ascii\"";
    const OBJ_ADVICE: &str = "save surfaces as OBJ and volumes as Gmsh 2.2 ASCII or VTU";

    if bytes.starts_with(b"\x1f\x8b") || bytes.starts_with(b"PK\x03\x04") {
        return Err(unsupported("a compressed file", "unpack it first"));
    }
    let mut lines = Lines::new(bytes);
    let Some(first) = lines.next() else {
        return Err(Fault::whole_file(ReadProblem::Empty));
    };
    match first.text {
        [b'$', ..] => return Ok(Kind::Gmsh),
        [b'<', ..] if holds(bytes, b"<VTKFile") => return Ok(Kind::VtkXml),
        [b'#', rest @ ..] if rest.trim_ascii_start().starts_with(b"vtk DataFile") => {
            return Err(unsupported("a VTK legacy file", VTU_ADVICE));
        }
        b"ply" => return Err(unsupported("a PLY file", OBJ_ADVICE)),
        _ => {}
    }
    let content = std::iter::once(first).chain(lines).find(|line| !line.text.starts_with(b"#"));
    if let Some(word) = content.and_then(|line| line.words().next())
        && OBJ_KEYWORDS.contains(&word)
    {
        return Ok(Kind::Obj);
    }
    let extension = name.rsplit_once('.').map(|(_, extension)| extension.to_ascii_lowercase());
    match extension.as_deref() {
        Some("msh") => Ok(Kind::Gmsh),
        Some("vtu") => Ok(Kind::VtkXml),
        Some("obj") => Ok(Kind::Obj),
        Some("stl") => Err(unsupported("an STL file", OBJ_ADVICE)),
        _ => Err(Fault::whole_file(ReadProblem::UnknownFormat)),
    }
}

fn unsupported(found: &str, advice: &'static str) -> Fault {
    Fault::whole_file(ReadProblem::Unsupported { found: found.into(), advice })
}
