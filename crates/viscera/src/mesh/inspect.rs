//! Measures of a mesh to look at before simulating with it.

use std::fmt;

use serde::Serialize;

use super::io::{CountedElements, Format, ReadReport, unused_text};
use super::quality::{self, QualitySummary};
use super::topology::{self, BoundingBox};
use super::verdict::{self, DEGREES, POOR_ANGLE, Problem};
use super::{SurfaceMesh, TetMesh};

/// One part of a mesh that no tetrahedron ties to the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct ComponentSummary {
    /// How many vertices it has.
    pub vertex_count: usize,
    /// How many tetrahedra it has.
    pub tet_count: usize,
}

/// The tetrahedra of one label.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RegionSummary {
    /// The label.
    pub region: u32,
    /// Its name in the file, if it has one.
    pub name: Option<String>,
    /// How many tetrahedra have it.
    pub tet_count: usize,
    /// Their volume `[m^3]`.
    pub volume: f64,
}

/// A mesh in numbers, see [`inspect`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeshSummary {
    /// The format of the file; none for a mesh that was built.
    pub format: Option<Format>,
    /// Number of vertices.
    pub vertex_count: usize,
    /// Number of tetrahedra.
    pub tet_count: usize,
    /// Number of triangles of the boundary.
    pub boundary_triangle_count: usize,
    /// Lowest corner of the bounding box `[m]`.
    pub box_min: [f64; 3],
    /// Highest corner of the bounding box `[m]`.
    pub box_max: [f64; 3],
    /// Total volume `[m^3]`.
    pub volume: f64,
    /// Shortest edge `[m]`.
    pub min_edge: f64,
    /// Mean length of the edges `[m]`.
    pub mean_edge: f64,
    /// Longest edge `[m]`.
    pub max_edge: f64,
    /// Shapes of the tetrahedra.
    pub quality: QualitySummary,
    /// How many dihedral angles lie in each bin of 5 degrees from 0 to 180, shape `[36]`.
    pub angles: Vec<usize>,
    /// Unconnected parts, by their lowest vertex.
    pub components: Vec<ComponentSummary>,
    /// Regions, by label.
    pub regions: Vec<RegionSummary>,
    /// Faces whose two tetrahedra overlap.
    pub folded_face_count: usize,
    /// Tetrahedra whose winding was repaired.
    pub rewound_tet_count: usize,
    /// Vertices removed because no tetrahedron uses them.
    pub removed_vertex_count: usize,
    /// Elements of the file that were cut into tetrahedra.
    pub split: Vec<CountedElements>,
    /// Second-order elements that were taken by their corners.
    pub curved_count: usize,
    /// How far edges of those were from straight, at most [m].
    pub bulge: f64,
    /// Named sets of vertices, and how many each has.
    pub patches: Vec<(String, usize)>,
    /// Elements of the file that are not part of the mesh.
    pub skipped: Vec<CountedElements>,
    /// Arrays of whole numbers, one for each cell, that were not taken as regions.
    pub unused_arrays: Vec<String>,
}

/// Measures a mesh.
pub fn inspect(mesh: &TetMesh, report: &ReadReport) -> MeshSummary {
    let bounds = BoundingBox::around(mesh.vertices());
    let lengths: Vec<f64> = topology::edges(mesh)
        .iter()
        .map(|edge| {
            let [a, b] = edge.map(|vertex| mesh.vertices()[vertex as usize]);
            (b - a).length()
        })
        .collect();
    MeshSummary {
        format: report.format,
        vertex_count: mesh.vertices().len(),
        tet_count: mesh.tets().len(),
        boundary_triangle_count: topology::boundary_surface(mesh).surface.triangles.len(),
        box_min: bounds.min.to_array(),
        box_max: bounds.max.to_array(),
        volume: mesh.volume(),
        min_edge: lengths.iter().copied().fold(f64::INFINITY, f64::min),
        mean_edge: lengths.iter().sum::<f64>() / lengths.len().max(1) as f64,
        max_edge: lengths.iter().copied().fold(0.0, f64::max),
        quality: quality::summarize_quality(mesh),
        angles: verdict::count_angles(mesh),
        components: summarize_components(mesh),
        regions: summarize_regions(mesh, &report.region_names),
        split: report.split.clone(),
        curved_count: report.curved,
        bulge: report.bulge,
        patches: report.patches.iter().map(|p| (p.name.clone(), p.vertices.len())).collect(),
        folded_face_count: topology::count_folded_faces(mesh),
        rewound_tet_count: report.repairs.rewound_tets,
        removed_vertex_count: report.repairs.removed_vertices.len(),
        skipped: report.skipped.clone(),
        unused_arrays: report.unused_arrays.clone(),
    }
}

fn summarize_components(mesh: &TetMesh) -> Vec<ComponentSummary> {
    let parts = topology::connected_components(mesh);
    let mut summary = vec![ComponentSummary { vertex_count: 0, tet_count: 0 }; parts.count];
    for &label in &parts.labels {
        summary[label as usize].vertex_count += 1;
    }
    for tet in mesh.tets() {
        summary[parts.labels[tet[0] as usize] as usize].tet_count += 1;
    }
    summary
}

fn summarize_regions(mesh: &TetMesh, names: &[(u32, String)]) -> Vec<RegionSummary> {
    let mut regions = std::collections::BTreeMap::new();
    for (tet, &region) in mesh.regions().iter().enumerate() {
        let entry = regions.entry(region).or_insert_with(|| {
            let name = names.iter().find(|(named, _)| *named == region);
            let name = name.map(|(_, name)| name.clone());
            RegionSummary { region, name, tet_count: 0, volume: 0.0 }
        });
        entry.tet_count += 1;
        entry.volume += super::tet_volume(mesh.corners(tet));
    }
    regions.into_values().collect()
}

/// A surface in numbers, see [`inspect_surface`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SurfaceSummary {
    /// The format of the file; none for a surface that was built.
    pub format: Option<Format>,
    /// Number of vertices.
    pub vertex_count: usize,
    /// Number of triangles.
    pub triangle_count: usize,
    /// Edges that do not have exactly two triangles; 0 for a closed surface.
    pub open_edge_count: usize,
    /// Lowest corner of the bounding box `[m]`.
    pub box_min: [f64; 3],
    /// Highest corner of the bounding box `[m]`.
    pub box_max: [f64; 3],
    /// Area `[m^2]`.
    pub area: f64,
    /// Enclosed volume `[m^3]`, negative if wound inwards; has a meaning for closed surfaces only.
    pub volume: f64,
    /// Elements of the file that are not part of the surface.
    pub skipped: Vec<CountedElements>,
}

/// Measures a surface.
pub fn inspect_surface(mesh: &SurfaceMesh, report: &ReadReport) -> SurfaceSummary {
    let bounds = BoundingBox::around(&mesh.vertices);
    SurfaceSummary {
        format: report.format,
        vertex_count: mesh.vertices.len(),
        triangle_count: mesh.triangles.len(),
        open_edge_count: topology::count_open_edges(mesh),
        box_min: bounds.min.to_array(),
        box_max: bounds.max.to_array(),
        area: mesh.area(),
        volume: mesh.enclosed_volume(),
        skipped: report.skipped.clone(),
    }
}

impl MeshSummary {
    /// What is wrong, the worst first; nothing with a mesh that can be simulated as it is.
    pub fn problems(&self) -> Vec<Problem> {
        let mut problems = Vec::new();
        if self.folded_face_count > 0 {
            problems.push(Problem::Folded { faces: self.folded_face_count });
        }
        let bins = POOR_ANGLE / DEGREES;
        let ends = self.angles.iter().take(bins).chain(self.angles.iter().rev().take(bins));
        let angles: usize = ends.sum();
        if angles > 0 {
            let share = angles as f64 / (6 * self.tet_count) as f64;
            problems.push(Problem::Slivers { angles, share });
        }
        if self.components.len() > 1 {
            problems.push(Problem::Parts { count: self.components.len() });
        }
        problems
    }
}

impl SurfaceSummary {
    /// What is wrong; nothing with a closed surface.
    pub fn problems(&self) -> Vec<Problem> {
        let open = Problem::Open { edges: self.open_edge_count };
        if self.open_edge_count > 0 { vec![open] } else { Vec::new() }
    }
}

/// One line of a table: what, and how much.
fn row(f: &mut fmt::Formatter<'_>, what: &str, value: impl fmt::Display) -> fmt::Result {
    writeln!(f, "{what:<18} {value}")
}

impl fmt::Display for MeshSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_format(f, self.format)?;
        row(f, "vertices", self.vertex_count)?;
        row(f, "tetrahedra", self.tet_count)?;
        row(f, "boundary triangles", self.boundary_triangle_count)?;
        write_box(f, self.box_min, self.box_max)?;
        row(f, "volume", Volume(self.volume))?;
        let (min, mean, max) = (self.min_edge, self.mean_edge, self.max_edge);
        row(f, "edges", format!("{} to {}, mean {}", Length(min), Length(max), Length(mean)))?;
        let quality = &self.quality;
        let (worst, mean) = (significant(quality.worst), significant(quality.mean));
        let tet = quality.worst_tet;
        let shape = format!("worst {worst} (tetrahedron {tet}), mean {mean}; 1 is regular");
        row(f, "shape quality", shape)?;
        let (min, max) = (quality.min_dihedral.to_degrees(), quality.max_dihedral.to_degrees());
        row(f, "dihedral angles", format!("{min:.1} to {max:.1} degrees"))?;
        row(f, "components", self.components.len())?;
        if self.components.len() > 1 {
            write_some(f, &self.components, |f, index, part| {
                let (vertices, tets) = (part.vertex_count, part.tet_count);
                let name = format!("  component {index}");
                row(f, &name, format!("{vertices} vertices, {tets} tetrahedra"))
            })?;
        }
        if self.regions.len() > 1 {
            row(f, "regions", self.regions.len())?;
        }
        write_some(f, &self.regions, |f, _, part| {
            let name = format!("  region {}", part.region);
            let called = part.name.as_ref().map_or(String::new(), |name| format!(", `{name}`"));
            let (count, volume) = (part.tet_count, Volume(part.volume));
            row(f, &name, format!("{count} tetrahedra, {volume}{called}"))
        })?;
        if !self.patches.is_empty() {
            row(f, "patches", self.patches.len())?;
        }
        write_some(f, &self.patches, |f, _, (name, count)| {
            row(f, &format!("  `{name}`"), format!("{count} vertices"))
        })?;
        write_findings(f, self)
    }
}

/// Long lists are for the JSON; a table shows the first few.
fn write_some<T>(
    f: &mut fmt::Formatter<'_>,
    list: &[T],
    write: impl Fn(&mut fmt::Formatter<'_>, usize, &T) -> fmt::Result,
) -> fmt::Result {
    const SHOWN: usize = 12;
    for (index, entry) in list.iter().take(SHOWN).enumerate() {
        write(f, index, entry)?;
    }
    if list.len() > SHOWN {
        writeln!(f, "  and {} more", list.len() - SHOWN)?;
    }
    Ok(())
}

fn write_findings(f: &mut fmt::Formatter<'_>, summary: &MeshSummary) -> fmt::Result {
    let mut repairs = Vec::new();
    if summary.rewound_tet_count > 0 {
        repairs.push(format!("{} tetrahedra rewound", summary.rewound_tet_count));
    }
    if summary.removed_vertex_count > 0 {
        repairs.push(format!("{} unused vertices removed", summary.removed_vertex_count));
    }
    let repairs = if repairs.is_empty() { "nothing".into() } else { repairs.join(", ") };
    row(f, "repaired", repairs)?;
    if summary.folded_face_count > 0 {
        let text = format!("{} faces with both tetrahedra on one side", summary.folded_face_count);
        row(f, "overlaps", text)?;
    }
    if !summary.split.is_empty() {
        row(f, "cut into tets", CountedElements::list(&summary.split))?;
    }
    if summary.curved_count > 0 {
        let bulge = Length(summary.bulge);
        let text = format!(
            "{} elements by their corners, up to {bulge} from straight",
            summary.curved_count
        );
        row(f, "second order", text)?;
    }
    write_skipped(f, &summary.skipped)?;
    if summary.skipped.iter().any(|skipped| skipped.kind == "triangle") {
        let kept = if summary.patches.is_empty() { "" } else { "; those with names are patches" };
        row(
            f,
            "",
            format!("triangles are surfaces of the mesh, which tetrahedra do not need{kept}"),
        )?;
    }
    match unused_text(&summary.unused_arrays) {
        Some(text) => row(f, "note", text),
        None => Ok(()),
    }
}

impl fmt::Display for SurfaceSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_format(f, self.format)?;
        row(f, "vertices", self.vertex_count)?;
        row(f, "triangles", self.triangle_count)?;
        write_box(f, self.box_min, self.box_max)?;
        let (size, name) = fitting_unit(self.area, &AREA_UNITS);
        row(f, "area", format!("{} {name}", significant(self.area / size)))?;
        match self.open_edge_count {
            0 if self.volume < 0.0 => {
                row(f, "enclosed volume", format!("{}, wound inwards", Volume(-self.volume)))?;
            }
            0 => row(f, "enclosed volume", Volume(self.volume))?,
            open => row(f, "closed", format!("no, {open} open edges"))?,
        }
        write_skipped(f, &self.skipped)
    }
}

fn write_format(f: &mut fmt::Formatter<'_>, format: Option<Format>) -> fmt::Result {
    match format {
        Some(format) => row(f, "format", format),
        None => Ok(()),
    }
}

fn write_box(f: &mut fmt::Formatter<'_>, min: [f64; 3], max: [f64; 3]) -> fmt::Result {
    let size = [0, 1, 2].map(|axis| max[axis] - min[axis]);
    let all = [size, min, max];
    let largest = all.iter().flatten().fold(0.0f64, |largest, length| largest.max(length.abs()));
    row(f, "size", in_unit_of(largest, size, " x "))?;
    row(f, "from", in_unit_of(largest, min, ", "))?;
    row(f, "to", in_unit_of(largest, max, ", "))
}

/// Three lengths `[m]` in the unit that suits `largest`, with about four digits.
fn in_unit_of(largest: f64, lengths: [f64; 3], separator: &str) -> String {
    let (size, name) = fitting_unit(largest, &LENGTH_UNITS);
    let digits = if largest / size >= 100.0 { 1 } else { 2 };
    // Adding zero turns -0.0 into 0.0.
    let texts = lengths.map(|length| format!("{:.digits$}", length / size + 0.0));
    format!("{} {name}", texts.join(separator))
}

fn write_skipped(f: &mut fmt::Formatter<'_>, skipped: &[CountedElements]) -> fmt::Result {
    if skipped.is_empty() {
        return Ok(());
    }
    row(f, "skipped", CountedElements::list(skipped))
}

const LENGTH_UNITS: [(f64, &str); 4] = [(1.0, "m"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm")];
const AREA_UNITS: [(f64, &str); 4] = [(1.0, "m²"), (1e-4, "cm²"), (1e-6, "mm²"), (1e-12, "µm²")];
const VOLUME_UNITS: [(f64, &str); 4] = [(1.0, "m³"), (1e-3, "l"), (1e-6, "ml"), (1e-9, "mm³")];

/// A length `[m]`, shown with a prefix that suits it.
struct Length(f64);

impl fmt::Display for Length {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (size, name) = fitting_unit(self.0, &LENGTH_UNITS);
        write!(f, "{} {name}", significant(self.0 / size))
    }
}

/// A volume `[m^3]`, shown with a unit that suits it.
struct Volume(f64);

impl fmt::Display for Volume {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (size, name) = fitting_unit(self.0, &VOLUME_UNITS);
        write!(f, "{} {name}", significant(self.0 / size))
    }
}

/// The largest unit that leaves a value of at least 1, or else the smallest.
fn fitting_unit<'a>(value: f64, units: &[(f64, &'a str); 4]) -> (f64, &'a str) {
    units.iter().copied().find(|(size, _)| value.abs() >= *size).unwrap_or(units[3])
}

/// About four significant digits.
fn significant(value: f64) -> String {
    match value.abs() {
        large if large >= 1e6 => format!("{value:.3e}"),
        large if large >= 1000.0 => format!("{value:.0}"),
        large if large >= 100.0 => format!("{value:.1}"),
        large if large >= 10.0 => format!("{value:.2}"),
        0.0 => "0".into(),
        large if large >= 0.01 => format!("{value:.3}"),
        _ => format!("{value:.3e}"),
    }
}
