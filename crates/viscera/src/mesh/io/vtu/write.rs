//! Writing grids of tetrahedra or of triangles with data on points and cells.
//!
//! Numbers stand behind the XML as they are in memory, in single precision and little-endian: "appended raw" data, which
//! every program that knows VTK reads, at a third of the bytes of text and without turning numbers into it:
//!
//! ```text
//! <AppendedData encoding="raw">
//! _ then for each array: its number of bytes, 64 bits, and the bytes; an array's `offset` is from behind the `_`
//! </AppendedData>
//! ```

use std::borrow::Cow;
use std::fmt::Write;

use super::{VTK_TETRA, VTK_TRIANGLE};
use crate::mesh::TetMesh;
use crate::mesh::io::error::{WriteError, check_patch};
use crate::mesh::io::parsed::MeshNames;
use crate::mesh::io::pvd::escape_xml;
use crate::mesh::io::text::name_of;
use crate::mesh::io::vtk_cells::{REGION_NAMES, REGION_NUMBERS};
use crate::scalar::{Real, Vec3};

/// A named array with one entry for each point or for each cell, as the bytes of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    name: String,
    vtk_type: &'static str,
    /// Numbers of an entry.
    components: usize,
    /// Number of entries.
    len: usize,
    bytes: Vec<u8>,
    /// The first entry that is not finite.
    not_finite: Option<usize>,
}

impl Array {
    /// One number for each entry.
    pub fn scalars<R: Real>(name: &str, values: &[R]) -> Self {
        Self::floats(name, values.iter().map(|value| [value.to_f64() as f32]))
    }

    /// Three components for each entry.
    pub fn vectors<R: Real>(name: &str, values: &[Vec3<R>]) -> Self {
        Self::floats(name, values.iter().map(|value| value.cast::<f32>().to_array()))
    }

    /// One whole number for each entry, such as a region.
    pub fn integers(name: &str, values: &[u32]) -> Self {
        let mut bytes = Vec::with_capacity(4 * values.len());
        values.iter().for_each(|value| bytes.extend_from_slice(&value.to_le_bytes()));
        let (len, name) = (values.len(), name.to_owned());
        Self { name, vtk_type: "UInt32", components: 1, len, bytes, not_finite: None }
    }

    /// For each of so many entries 1 where it is one of the members, 0 elsewhere.
    fn members(name: &str, len: usize, members: &[u32]) -> Self {
        let mut bytes = vec![0; len];
        for &member in members {
            bytes[member as usize] = 1;
        }
        let (name, vtk_type) = (name_of(name), "UInt8");
        Self { name, vtk_type, components: 1, len, bytes, not_finite: None }
    }

    /// An array of entries of `N` numbers, with room for so many: for values that need not all be known at a time.
    pub fn with_room<const N: usize>(name: &str, entries: usize) -> Self {
        let bytes = Vec::with_capacity(4 * N * entries);
        let (name, vtk_type) = (name.into(), "Float32");
        Self { name, vtk_type, components: N, len: 0, bytes, not_finite: None }
    }

    /// Adds an entry, which has as many numbers as the others: an array of other entries is refused when it is written.
    pub fn push<const N: usize>(&mut self, numbers: [f32; N]) {
        for number in numbers {
            self.bytes.extend_from_slice(&number.to_le_bytes());
            if !number.is_finite() {
                self.not_finite = self.not_finite.or(Some(self.len));
            }
        }
        self.len += 1;
    }

    fn floats<const N: usize>(name: &str, values: impl ExactSizeIterator<Item = [f32; N]>) -> Self {
        let mut array = Self::with_room::<N>(name, values.len());
        values.for_each(|numbers| array.push(numbers));
        array
    }

    /// Refuses what other programs refuse to read.
    fn check(&self, what: &'static str, wanted: usize) -> Result<(), WriteError> {
        let array = || self.name.clone();
        let width = if self.vtk_type == "UInt8" { 1 } else { 4 };
        let found = self.bytes.len() / (width * self.components);
        if self.len != wanted || found != wanted {
            return Err(WriteError::Length { array: array(), what, wanted, found });
        }
        match self.not_finite {
            Some(entry) => Err(WriteError::NonFinite { array: array(), entry }),
            None => Ok(()),
        }
    }
}

/// A grid of tetrahedra as the bytes of a `.vtu` file.
///
/// `points` `[m]`, shape `[point_count]`; `tets`, shape `[tet_count]`; each of `point_data` has an
/// entry for each point, each of `cell_data` for each tetrahedron.
pub fn write<R: Real>(
    points: &[Vec3<R>],
    tets: &[[u32; 4]],
    point_data: &[Array],
    cell_data: &[Array],
) -> Result<Vec<u8>, WriteError> {
    let grid = Grid::of_tets(points.len(), tets, Vec::new())?;
    Ok(grid.frame(points, point_data.to_vec(), cell_data.to_vec())?.concat())
}

/// A mesh as the bytes of a `.vtu` file, in metres: the cell array `region`; for each patch an array at points of its name, 1 at
/// its vertices and 0 at others; names of regions as field data, `region_numbers` and `region_names`.
pub fn write_mesh(mesh: &TetMesh, names: &MeshNames) -> Result<Vec<u8>, WriteError> {
    let vertex_count = mesh.vertices().len();
    let regions = Array::integers("region", mesh.regions());
    let mut grid = Grid::of_tets(vertex_count, mesh.tets(), vec![regions])?;
    grid.field_data = field_data(&names.regions);
    let mut patches = Vec::new();
    for patch in &names.patches {
        check_patch(patch, vertex_count)?;
        patches.push(Array::members(&patch.name, vertex_count, &patch.vertices));
    }
    Ok(grid.frame(mesh.vertices(), patches, Vec::new())?.concat())
}

/// Numbers and names of regions, which belong to the file and not to its points or cells. Letters stand as numbers, and zero ends
/// each name: as VTK writes text.
fn field_data(regions: &[(u32, String)]) -> String {
    if regions.is_empty() {
        return String::new();
    }
    let count = regions.len();
    let numbers: Vec<String> = regions.iter().map(|(number, _)| number.to_string()).collect();
    let letters = |name: &str| -> String {
        name_of(name).bytes().map(|byte| format!("{byte} ")).collect::<String>() + "0"
    };
    let letters: Vec<String> = regions.iter().map(|(_, name)| letters(name)).collect();
    format!(
        "<FieldData>\n\
         <DataArray type=\"UInt32\" Name=\"{REGION_NUMBERS}\" NumberOfTuples=\"{count}\" format=\"ascii\">\n{}\n</DataArray>\n\
         <Array type=\"String\" Name=\"{REGION_NAMES}\" NumberOfTuples=\"{count}\" format=\"ascii\">\n{}\n</Array>\n\
         </FieldData>\n",
        numbers.join(" "),
        letters.join("\n")
    )
}

/// A grid of triangles as the bytes of a `.vtu` file; shapes as for [`write()`].
pub fn write_surface<R: Real>(
    points: &[Vec3<R>],
    triangles: &[[u32; 3]],
    point_data: &[Array],
    cell_data: &[Array],
) -> Result<Vec<u8>, WriteError> {
    let grid = Grid::of_triangles(points.len(), triangles, Vec::new())?;
    Ok(grid.frame(points, point_data.to_vec(), cell_data.to_vec())?.concat())
}

/// What stays the same from frame to frame, made into bytes once: cells, and data of theirs.
#[derive(Clone, Debug)]
pub struct Grid {
    point_count: usize,
    cell_count: usize,
    /// Connectivity, offsets and types.
    cells: [Array; 3],
    cell_data: Vec<Array>,
    /// XML of what belongs to the whole.
    field_data: String,
}

impl Grid {
    /// Tetrahedra between so many points, with data that stay.
    pub fn of_tets(
        point_count: usize,
        tets: &[[u32; 4]],
        cell_data: Vec<Array>,
    ) -> Result<Self, WriteError> {
        Self::new(point_count, tets, VTK_TETRA, cell_data)
    }

    /// Triangles between so many points, with data that stay.
    pub fn of_triangles(
        point_count: usize,
        triangles: &[[u32; 3]],
        cell_data: Vec<Array>,
    ) -> Result<Self, WriteError> {
        Self::new(point_count, triangles, VTK_TRIANGLE, cell_data)
    }

    fn new<const CORNERS: usize>(
        point_count: usize,
        cells: &[[u32; CORNERS]],
        cell_type: u8,
        cell_data: Vec<Array>,
    ) -> Result<Self, WriteError> {
        for (cell, corners) in cells.iter().enumerate() {
            if let Some(&point) = corners.iter().find(|&&point| point as usize >= point_count) {
                return Err(WriteError::IndexOutOfRange { cell, point, point_count });
            }
        }
        let cell_count = cells.len();
        cell_data.iter().try_for_each(|array| array.check("cell", cell_count))?;
        let corners = cells.as_flattened().iter().map(|&corner| u64::from(corner));
        let ends = (0..cell_count).map(|cell| (CORNERS * (cell + 1)) as u64);
        let types = Array {
            name: "types".into(),
            vtk_type: "UInt8",
            components: 1,
            len: cell_count,
            bytes: vec![cell_type; cell_count],
            not_finite: None,
        };
        // No index and no end is larger than this.
        let largest = point_count.max(CORNERS * cell_count) as u64;
        let cells =
            [indices("connectivity", corners, largest), indices("offsets", ends, largest), types];
        let field_data = String::new();
        Ok(Self { point_count, cell_count, cells, cell_data, field_data })
    }

    /// The bytes of a `.vtu` file in parts that follow one another. `points` `[m]`, shape `[point_count]`; each of
    /// `point_data` has an entry for each point, each of `cell_data`, which come before those that stay, for each cell.
    pub fn frame<R: Real>(
        &self,
        points: &[Vec3<R>],
        point_data: Vec<Array>,
        cell_data: Vec<Array>,
    ) -> Result<Vec<Cow<'_, [u8]>>, WriteError> {
        let points = Array::vectors("points", points);
        points.check("point", self.point_count)?;
        point_data.iter().try_for_each(|array| array.check("point", self.point_count))?;
        cell_data.iter().try_for_each(|array| array.check("cell", self.cell_count))?;
        let mut file = File::new(self);
        file.section("Points", [Cow::Owned(points)]);
        file.section("Cells", self.cells.iter().map(Cow::Borrowed));
        file.section("PointData", point_data.into_iter().map(Cow::Owned));
        let cell_data = cell_data.into_iter().map(Cow::Owned);
        file.section("CellData", cell_data.chain(self.cell_data.iter().map(Cow::Borrowed)));
        Ok(file.finish())
    }
}

/// Whole numbers up to `largest`, as short as programs read them.
fn indices(name: &str, values: impl ExactSizeIterator<Item = u64>, largest: u64) -> Array {
    let (len, is_short) = (values.len(), largest <= i32::MAX as u64);
    let (vtk_type, width) = if is_short { ("Int32", 4) } else { ("Int64", 8) };
    let mut bytes = Vec::with_capacity(width * len);
    values.for_each(|value| bytes.extend_from_slice(&value.to_le_bytes()[..width]));
    Array { name: name.into(), vtk_type, components: 1, len, bytes, not_finite: None }
}

/// A file in the making.
struct File<'a> {
    head: String,
    /// Where the next array begins.
    offset: usize,
    /// Lengths and bytes of arrays in turn.
    parts: Vec<Cow<'a, [u8]>>,
}

// Writing to a string cannot fail.
impl<'a> File<'a> {
    fn new(grid: &Grid) -> Self {
        let Grid { point_count, cell_count, field_data, .. } = grid;
        let head = format!(
            "<?xml version=\"1.0\"?>\n\
             <VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
             <UnstructuredGrid>\n{field_data}<Piece NumberOfPoints=\"{point_count}\" NumberOfCells=\"{cell_count}\">\n"
        );
        // The head is put in front at the end.
        Self { head, offset: 0, parts: vec![Cow::Borrowed(&[])] }
    }

    fn section(&mut self, section: &str, arrays: impl IntoIterator<Item = Cow<'a, Array>>) {
        let _ = writeln!(self.head, "<{section}>");
        for array in arrays {
            let Array { vtk_type, components, .. } = *array;
            let (name, offset) = (escape_xml(&array.name), self.offset);
            let _ = writeln!(
                self.head,
                "<DataArray type=\"{vtk_type}\" Name=\"{name}\" NumberOfComponents=\"{components}\" \
                 format=\"appended\" offset=\"{offset}\"/>"
            );
            let length = array.bytes.len() as u64;
            let length = length.to_le_bytes().to_vec();
            self.offset += length.len() + array.bytes.len();
            self.parts.push(Cow::Owned(length));
            self.parts.push(match array {
                Cow::Borrowed(array) => Cow::Borrowed(&array.bytes[..]),
                Cow::Owned(array) => Cow::Owned(array.bytes),
            });
        }
        let _ = writeln!(self.head, "</{section}>");
    }

    fn finish(self) -> Vec<Cow<'a, [u8]>> {
        let Self { mut head, mut parts, .. } = self;
        head.push_str("</Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_");
        parts[0] = Cow::Owned(head.into_bytes());
        parts.push(Cow::Borrowed(b"\n</AppendedData>\n</VTKFile>\n"));
        parts
    }
}
