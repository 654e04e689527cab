//! Tetrahedra as the page's second module hands them to the first: as they are in memory, little-endian, so that reading takes no
//! parser and nothing is rounded. Both modules are of one build: there is one version, and no other program has files of it.
//!
//! ```text
//! MARK, then the numbers of vertices, tetrahedra, names of regions and patches, 32 bits each
//! positions of vertices, three of 64 bits each
//! vertices of tetrahedra, four of 32 bits each
//! regions of tetrahedra, 32 bits each
//! for each name of a region: the region, 32 bits, and a text: its number of bytes, 32 bits, and the bytes, UTF-8
//! for each patch: its name, a text; the number of its vertices, and these, 32 bits each
//! ```

use super::cells::Cells;
use super::content::Content;
use super::error::{Fault, Place, ReadProblem, WriteError, check_patch};
use super::lines::bad_word;
use super::parsed::{Format, MeshNames, Patch};
use crate::mesh::{MeshPlace, TetMesh};
use crate::scalar::vec3;

/// How a file begins. No text does, and no STL file's header of 80 letters.
const MARK: &[u8] = b"\x89viscera tetrahedra\n";

const VERTEX: usize = 3 * 8;
const TET: usize = 4 * 4;
/// The least bytes of what has a name: two numbers.
const NAMED: usize = 2 * 4;

/// Whether bytes are such a file.
pub(super) fn is_it(bytes: &[u8]) -> bool {
    bytes.starts_with(MARK)
}

/// A mesh and its names, in the unit that the positions are in. Refuses a patch with vertices that the mesh does not have.
pub fn write(mesh: &TetMesh, names: &MeshNames) -> Result<Vec<u8>, WriteError> {
    let (vertices, tets) = (mesh.vertices(), mesh.tets());
    let MeshNames { patches, regions } = names;
    let mut file = MARK.to_vec();
    for (what, count) in [
        ("number of vertices", vertices.len()),
        ("number of tetrahedra", tets.len()),
        ("number of named regions", regions.len()),
        ("number of patches", patches.len()),
    ] {
        put_count(&mut file, what, count)?;
    }
    file.reserve(vertices.len() * VERTEX + tets.len() * (TET + 4));
    let positions = vertices.iter().flat_map(|x| x.to_array());
    positions.for_each(|value| file.extend_from_slice(&value.to_le_bytes()));
    put_numbers(&mut file, tets.as_flattened());
    put_numbers(&mut file, mesh.regions());
    for (region, name) in regions {
        put_numbers(&mut file, &[*region]);
        put_text(&mut file, name)?;
    }
    for patch in patches {
        check_patch(patch, vertices.len())?;
        put_text(&mut file, &patch.name)?;
        put_count(&mut file, "number of vertices of a patch", patch.vertices.len())?;
        put_numbers(&mut file, &patch.vertices);
    }
    Ok(file)
}

fn put_numbers(file: &mut Vec<u8>, numbers: &[u32]) {
    numbers.iter().for_each(|number| file.extend_from_slice(&number.to_le_bytes()));
}

fn put_count(file: &mut Vec<u8>, what: &'static str, count: usize) -> Result<(), WriteError> {
    let (value, limit) = (count as u64, u64::from(u32::MAX));
    let format = "what one module of the page hands to the other";
    let too_large = |_| WriteError::TooLarge { what, value, limit, format };
    put_numbers(file, &[u32::try_from(count).map_err(too_large)?]);
    Ok(())
}

fn put_text(file: &mut Vec<u8>, text: &str) -> Result<(), WriteError> {
    put_count(file, "length of a name", text.len())?;
    file.extend_from_slice(text.as_bytes());
    Ok(())
}

/// Reads what [`write()`] has written.
pub(super) fn read(bytes: &[u8]) -> Result<Content<'_>, Fault> {
    let mut rest = Rest { all: bytes, at: MARK.len() };
    let vertex_count = rest.number("the number of vertices")?;
    let tet_count = rest.number("the number of tetrahedra")?;
    let region_count = rest.number("the number of named regions")?;
    let patch_count = rest.number("the number of patches")?;

    let first_vertex = rest.at;
    let (positions, _) = rest.list::<VERTEX>("vertices", vertex_count)?.as_chunks::<VERTEX>();
    let vertices: Vec<_> = positions
        .iter()
        .map(|position| {
            let (values, _) = position.as_chunks::<8>();
            let [x, y, z] = [0, 1, 2].map(|axis| f64::from_le_bytes(values[axis]));
            vec3(x, y, z)
        })
        .collect();
    let first_tet = rest.at;
    let corners = numbers_of(rest.list::<TET>("tetrahedra", tet_count)?);
    let regions = numbers_of(rest.list::<4>("regions of tetrahedra", tet_count)?);
    let (tets, _) = corners.as_chunks::<4>();
    let of_tets = (0..tet_count).collect();
    let cells = Cells { tets: tets.to_vec(), regions, of_tets, ..Cells::default() };

    rest.check("named regions", region_count, NAMED)?;
    let mut region_names = Vec::new();
    for _ in 0..region_count {
        region_names.push((rest.number("a region")?, rest.text()?));
    }
    rest.check("patches", patch_count, NAMED)?;
    let mut patches = Vec::new();
    for _ in 0..patch_count {
        patches.push(rest.patch(vertex_count)?);
    }
    rest.check_end()?;
    let places = Box::new(move |place| match place {
        MeshPlace::Whole => None,
        MeshPlace::Vertex(vertex) => Some(Place::Byte(first_vertex + VERTEX * vertex)),
        MeshPlace::Tet(tet) => Some(Place::Byte(first_tet + TET * tet)),
    });
    Ok(Content { format: Format::Handover, vertices, cells, patches, region_names, places })
}

fn numbers_of(bytes: &[u8]) -> Vec<u32> {
    let (numbers, _) = bytes.as_chunks::<4>();
    numbers.iter().map(|number| u32::from_le_bytes(*number)).collect()
}

/// What has not been read yet.
#[derive(Clone, Copy)]
struct Rest<'a> {
    all: &'a [u8],
    /// The byte that comes next.
    at: usize,
}

impl<'a> Rest<'a> {
    fn fault(&self, problem: ReadProblem) -> Fault {
        Fault { place: Some(Place::Byte(self.at)), problem }
    }

    fn left(&self) -> &'a [u8] {
        self.all.get(self.at..).unwrap_or_default()
    }

    fn number(&mut self, what: &str) -> Result<u32, Fault> {
        let Some(bytes) = self.left().first_chunk::<4>() else {
            return Err(self.fault(ReadProblem::UnexpectedEnd { reading: what.into() }));
        };
        self.at += 4;
        Ok(u32::from_le_bytes(*bytes))
    }

    /// Refuses so many of something, each of so many bytes at least, where the rest is shorter.
    fn check(&self, what: &'static str, count: u32, width: usize) -> Result<usize, Fault> {
        let (claimed, bytes_left) = (u64::from(count), self.left().len());
        let length = claimed * width as u64;
        if length > bytes_left as u64 {
            return Err(self.fault(ReadProblem::TooManyClaimed { what, claimed, bytes_left }));
        }
        // No longer than what is left.
        Ok(length as usize)
    }

    /// So many of something, each of so many bytes.
    fn list<const WIDTH: usize>(
        &mut self,
        what: &'static str,
        count: u32,
    ) -> Result<&'a [u8], Fault> {
        let length = self.check(what, count, WIDTH)?;
        let list = &self.left()[..length];
        self.at += length;
        Ok(list)
    }

    fn text(&mut self) -> Result<String, Fault> {
        let length = self.number("the length of a name")?;
        let start = *self;
        let bytes = self.list::<1>("letters of a name", length)?;
        let text = std::str::from_utf8(bytes);
        text.map(str::to_owned).map_err(|_| start.fault(bad_word("a name in UTF-8", bytes)))
    }

    fn patch(&mut self, vertex_count: u32) -> Result<Patch, Fault> {
        let name = self.text()?;
        let count = self.number("the number of vertices of a patch")?;
        let start = *self;
        let vertices = numbers_of(self.list::<4>("vertices of a patch", count)?);
        match vertices.iter().find(|&&vertex| vertex >= vertex_count) {
            None => Ok(Patch { name, vertices }),
            Some(vertex) => Err(start.fault(ReadProblem::UnknownVertex {
                element: format!("`{name}`"),
                vertex: vertex.to_string(),
                vertex_count: vertex_count as usize,
                numbers: Some((0, u64::from(vertex_count.saturating_sub(1)))),
            })),
        }
    }

    fn check_end(&self) -> Result<(), Fault> {
        if self.left().is_empty() {
            return Ok(());
        }
        let (what, claimed, found) = ("bytes".to_owned(), self.at, self.all.len());
        Err(self.fault(ReadProblem::CountMismatch { what, claimed, found }))
    }
}
