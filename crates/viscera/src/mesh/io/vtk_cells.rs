//! Cells and data arrays as VTK has them: `vtkCellType.h`.

use std::collections::BTreeMap;

use super::cells::{Cells, Shape};
use super::parsed::{Patch, REGIONS};
use super::text::name_of;

/// Cells of a grid in one list of corners.
pub(super) struct VtkCells<'a> {
    pub kinds: &'a [u64],
    /// Where the corners of each cell end.
    pub ends: &'a [usize],
    pub corners: &'a [u32],
}

/// What a cell is wrong in.
pub(super) enum CellFault {
    /// Offsets do not ascend, or leave the list.
    Offset(usize),
    /// It has other corners than its type.
    Corners { cell: usize, shape: Shape, wanted: usize, found: usize },
}

/// The shape of a type, and how many nodes a cell has: none where it may be any number above its corners.
fn shape_of(kind: u64) -> Option<(Shape, Option<usize>)> {
    use Shape::{Hexahedron, Line, Point, Pyramid, Quad, Tet, Triangle, Wedge};
    Some(match kind {
        1 => (Point, Some(1)),
        3 => (Line, Some(2)),
        5 => (Triangle, Some(3)),
        8 | 9 => (Quad, Some(4)),
        10 => (Tet, Some(4)),
        11 | 12 => (Hexahedron, Some(8)),
        13 => (Wedge, Some(6)),
        14 => (Pyramid, Some(5)),
        // Second order, then Lagrange and Bezier elements of any order.
        21 | 35 | 68 | 75 => (Line, None),
        22 | 34 | 69 | 76 => (Triangle, None),
        23 | 28 | 30 | 70 | 77 => (Quad, None),
        24 | 71 | 78 => (Tet, None),
        25 | 29 | 33 | 72 | 79 => (Hexahedron, None),
        26 | 31 | 32 | 73 | 80 => (Wedge, None),
        27 | 37 | 74 | 81 => (Pyramid, None),
        _ => return None,
    })
}

const POLY_VERTEX: u64 = 2;
const POLY_LINE: u64 = 4;
const STRIP: u64 = 6;
const POLYGON: u64 = 7;
const PIXEL: u64 = 8;
const VOXEL: u64 = 11;

impl VtkCells<'_> {
    /// Adds all cells. `regions` has one for each, or is empty; `first` is the number of the first point and cell.
    pub fn add_to(
        &self,
        cells: &mut Cells,
        regions: &[u32],
        (first_point, first_cell): (u32, usize),
    ) -> Result<(), CellFault> {
        let (mut start, mut nodes) = (0, Vec::new());
        for (cell, (&end, &kind)) in self.ends.iter().zip(self.kinds).enumerate() {
            let corners = self.corners.get(start..end).ok_or(CellFault::Offset(cell))?;
            nodes.clear();
            // What does not exist stays so.
            nodes.extend(corners.iter().map(|corner| corner.saturating_add(first_point)));
            start = end;
            let (number, region) = (first_cell + cell, regions.get(cell).copied().unwrap_or(0));
            match kind {
                POLYGON => cells.add_polygon(&nodes, number),
                STRIP => {
                    for (at, three) in nodes.windows(3).enumerate() {
                        let turned = if at % 2 == 0 { [0, 1, 2] } else { [1, 0, 2] };
                        cells.add(Shape::Triangle, &turned.map(|k| three[k]), region, number);
                    }
                }
                POLY_VERTEX => cells.skip("point"),
                POLY_LINE => cells.skip("line"),
                _ => {
                    let Some((shape, exact)) = shape_of(kind) else {
                        cells.skip(&format!("cell of type {kind}"));
                        continue;
                    };
                    let (wanted, found) = (shape.corner_count(), nodes.len());
                    if exact.map_or(found < wanted, |exact| found != exact) {
                        return Err(CellFault::Corners { cell, shape, wanted, found });
                    }
                    // These count rows, in place of going around.
                    if kind == VOXEL || kind == PIXEL {
                        nodes.swap(2, 3);
                    }
                    if kind == VOXEL {
                        nodes.swap(6, 7);
                    }
                    cells.add(shape, &nodes, region, number);
                }
            }
        }
        Ok(())
    }
}

/// How good the name of an array is for regions: less is better.
pub(super) fn rank_of_regions(name: &str) -> Option<usize> {
    REGIONS.iter().position(|known| known.eq_ignore_ascii_case(name))
}

/// More names of arrays are not kept: a damaged file may have any number.
pub(super) const MOST_UNUSED: usize = 64;

/// Whether an array at cells that is not taken as regions is worth a word: those by VTK itself number cells.
pub(super) fn is_worth_a_word(name: &str) -> bool {
    !name.starts_with("vtk") && !name.is_empty()
}

/// Regions from numbers, which may be of any type but have to be whole; otherwise the first that is not.
pub(super) fn regions_of(values: &[f64]) -> Result<Vec<u32>, f64> {
    let whole = |&value: &f64| {
        let is_region = value >= 0.0 && value <= f64::from(u32::MAX) && value.fract() == 0.0;
        if is_region { Ok(value as u32) } else { Err(value) }
    };
    values.iter().map(whole).collect()
}

/// Field data with the labels of regions that have names, and with these names in the same order.
pub(super) const REGION_NUMBERS: &str = "region_numbers";
pub(super) const REGION_NAMES: &str = "region_names";

/// Regions with their names; of several names for one the first.
pub(super) fn named_regions(numbers: Vec<u32>, names: Vec<String>) -> Vec<(u32, String)> {
    let mut named: BTreeMap<u32, String> = BTreeMap::new();
    for (number, name) in numbers.into_iter().zip(names) {
        named.entry(number).or_insert(name);
    }
    named.into_iter().collect()
}

pub(super) const A_REGION: &str = "a region, a whole number of 0 or more";

/// No more sets come from one array: others number points, or measure them.
const MOST_SETS: usize = 64;

/// Sets of points from whole numbers at points: those that are not zero by the array's name, and by number where there are
/// several.
pub(super) fn patches_of(name: &str, values: &[i64]) -> Vec<Patch> {
    let mut sets: BTreeMap<i64, Vec<u32>> = BTreeMap::new();
    for (vertex, &value) in (0..).zip(values) {
        if value != 0 {
            sets.entry(value).or_default().push(vertex);
            if sets.len() > MOST_SETS {
                return Vec::new();
            }
        }
    }
    // Which may be longer than all values.
    let name = name_of(name);
    let is_one = sets.len() == 1 && sets.contains_key(&1);
    let own = |value| if is_one { name.clone() } else { format!("{name} {value}") };
    sets.into_iter().map(|(value, vertices)| Patch { name: own(value), vertices }).collect()
}
