//! What tools need of an assembly: their paths, samples of the bodies' surfaces, and room between the two.

use super::assemble::{AssembledBody, Assembly};
use super::assemble_error::AssembleError;
use super::holding::tolerance;
use super::solids::Solids;
use crate::contact::{Sample, Tool, sample_boundary, sample_embedded};
use crate::mesh::topology::boundary_faces;
use crate::scalar::Vec3;
use crate::scene::{Course, Instrument, Interpolation, Scene, read_path};

/// Tools thinner than so many edges of the surface meet several samples of a triangle.
const SEVERAL_EDGES: f64 = 3.0;

/// Samples up to this share of a body's size inside a tool are on it, as far as rounding knows.
const ROUNDING: f64 = 1e-9;

impl Assembly {
    /// Takes over a scene's tools, and reads their paths and surfaces.
    pub(super) fn add_tools(
        &mut self,
        scene: &Scene,
        load: &mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
    ) -> Result<(), AssembleError> {
        let mut solids = Solids::default();
        for tool in &scene.tools {
            let mut tool = tool.clone();
            solids.make(&mut tool, load)?;
            if let Course::File { path } = &tool.course {
                let bytes = load(path).map_err(|message| AssembleError::Load { message })?;
                let keys = read_path(path, &bytes).map_err(|error| AssembleError::Path {
                    place: tool.place.clone(),
                    tool: tool.name.clone(),
                    error: Box::new(error),
                })?;
                tool.course = Course::Keys { keys, interpolation: Interpolation::Linear };
            }
            self.tools.push(tool);
        }
        Ok(())
    }

    /// Takes samples of the surfaces of all bodies, where there are tools from the beginning: the vertices of a fine surface,
    /// else points of each outer triangle. A tool that would slip between them, then or later, is refused.
    pub(super) fn take_samples(&mut self, scene: &Scene) -> Result<(), AssembleError> {
        let samples = match thinnest_until(&self.tools, 0.0, tolerance(scene)) {
            Some(thinnest) => self.samples_for(thinnest),
            None => Vec::new(),
        };
        for tool in &self.tools {
            match tool.is_there(0.0, tolerance(scene)) {
                true => self.check_thick(tool, &samples)?,
                false => self.check_thick(tool, &self.samples_for(tool.thinnest()))?,
            }
        }
        Ok(self.builder.set_samples(samples)?)
    }

    /// Samples of the surfaces of all bodies for tools of which the thinnest has this radius [m].
    pub(super) fn samples_for(&self, thinnest: f64) -> Vec<Sample> {
        self.bodies.iter().flat_map(|body| self.samples_of(body, thinnest)).collect()
    }

    /// A tool does not slip between samples.
    fn check_thick(&self, tool: &Instrument, samples: &[Sample]) -> Result<(), AssembleError> {
        for body in &self.bodies {
            let of_body = samples.iter().filter(|s| body.tets.contains(&(s.tet as usize)));
            let (area, count) = of_body
                .fold((0.0, 0_usize), |(area, count), sample| (area + sample.area, count + 1));
            let spacing = (area / count.max(1) as f64).sqrt();
            if tool.breadth() < spacing {
                return Err(AssembleError::ThinTool {
                    place: tool.place.clone(),
                    tool: tool.name.clone(),
                    body: body.name.clone(),
                    radius: tool.breadth(),
                    spacing,
                });
            }
        }
        Ok(())
    }

    /// Samples of one body, for tools of which the thinnest has this radius [m].
    fn samples_of(&self, body: &AssembledBody, thinnest: f64) -> Vec<Sample> {
        let (first_vertex, first_tet) = (body.vertices.start as u32, body.tets.start as u32);
        if body.has_fine_surface {
            let AssembledBody { surface, embedding, .. } = body;
            let positions = self.builder.positions();
            let samples = sample_embedded(surface, embedding, positions, first_vertex, first_tet);
            return samples.into_iter().map(|(_, sample)| sample).collect();
        }
        let (tets, positions) = (body.mesh.tets(), body.mesh.vertices());
        let edge = mean_edge(tets, positions);
        // Thinner than an edge a tool would slip between the samples of a triangle that is stretched.
        let cuts = u32::from(thinnest < SEVERAL_EDGES * edge) + u32::from(thinnest < edge);
        let mut samples = sample_boundary(tets, positions, cuts);
        for sample in &mut samples {
            sample.vertices = sample.vertices.map(|v| v + first_vertex);
            sample.tet += first_tet;
        }
        samples
    }

    /// No tool that is there from the beginning is inside tissue then.
    pub(super) fn check_tools_outside(&self, scene: &Scene) -> Result<(), AssembleError> {
        let positions = self.builder.positions();
        let entry = Entry { samples: self.builder.samples(), time: 0.0, may_meet_fixed: true };
        let mut first = self.tools.iter().filter(|tool| tool.is_there(0.0, tolerance(scene)));
        first.try_for_each(|tool| self.check_outside(tool, &entry, |v| positions[v]))
    }

    /// A tool can come into the scene: it is thick enough, and not inside tissue whose vertices are at `place` [m].
    pub(super) fn check_entry(
        &self,
        tool: &Instrument,
        entry: &Entry<'_>,
        place: impl Fn(usize) -> Vec3<f64>,
    ) -> Result<(), AssembleError> {
        self.check_thick(tool, entry.samples)?;
        self.check_outside(tool, entry, place)
    }

    /// Where a tool that stands still meets what is fixed nothing can give way, and nothing has to.
    fn check_outside(
        &self,
        tool: &Instrument,
        entry: &Entry<'_>,
        place: impl Fn(usize) -> Vec3<f64>,
    ) -> Result<(), AssembleError> {
        let &Entry { samples, time, may_meet_fixed } = entry;
        let mut is_fixed = vec![false; self.builder.positions().len()];
        let fixed = self.fixings.iter().filter(|patch| patch.attachments.is_empty());
        fixed.flat_map(|patch| &patch.vertices).for_each(|&v| is_fixed[v as usize] = true);
        let corners = |sample: &Sample| {
            let all = sample.vertices.into_iter().zip(sample.weights);
            all.filter(|(_, weight)| *weight != 0.0)
        };
        let mut parts = Vec::new();
        let angle = tool.jaws.as_ref().map_or(0.0, |jaws| jaws.open);
        tool.parts_at(time, tool.jaw_angle(time, angle), &mut parts);
        for body in &self.bodies {
            let size = size(body.mesh.vertices());
            let mut depth = ROUNDING * size;
            for sample in samples.iter().filter(|s| body.tets.contains(&(s.tet as usize))) {
                let at = corners(sample)
                    .fold(Vec3::ZERO, |sum, (v, weight)| sum + place(v as usize) * weight);
                let is_pinned = corners(sample).all(|(v, _)| is_fixed[v as usize]);
                if !(is_pinned && may_meet_fixed && tool.stands_still()) {
                    depth = depth.max(-distance(&parts, at));
                }
            }
            if depth > ROUNDING * size {
                return Err(AssembleError::ToolInside {
                    place: tool.place.clone(),
                    tool: tool.name.clone(),
                    body: body.name.clone(),
                    depth,
                });
            }
        }
        Ok(())
    }
}

/// A tool's coming into the scene.
pub(super) struct Entry<'a> {
    /// Of the surfaces that it may meet.
    pub samples: &'a [Sample],
    /// When it comes [s].
    pub time: f64,
    /// Whether it may be inside tissue that is fixed, where it stands still.
    pub may_meet_fixed: bool,
}

/// The smallest radius [m] of the tools that have come into the scene by a time [s], which may be so much too early;
/// nothing where there was none.
pub(super) fn thinnest_until<'a>(
    tools: impl IntoIterator<Item = &'a Instrument>,
    time: f64,
    tolerance: f64,
) -> Option<f64> {
    let come = tools.into_iter().filter(|tool| tool.begin <= time + tolerance);
    come.map(Instrument::thinnest).reduce(f64::min)
}

/// From the nearest part to a point [m].
fn distance(parts: &[Tool], point: Vec3<f64>) -> f64 {
    parts.iter().map(|part| part.distance(point).value).fold(f64::INFINITY, f64::min)
}

/// The mean length of edges of outer triangles [m].
fn mean_edge(tets: &[[u32; 4]], positions: &[Vec3<f64>]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (_, [a, b, c]) in boundary_faces(tets) {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            sum += (positions[to as usize] - positions[from as usize]).length();
            count += 1.0;
        }
    }
    if count > 0.0 { sum / count } else { 0.0 }
}

/// The diagonal of the box around points [m].
fn size(points: &[Vec3<f64>]) -> f64 {
    let Some(&first) = points.first() else { return 0.0 };
    let (min, max) = points.iter().fold((first, first), |(min, max), &x| (min.min(x), max.max(x)));
    (max - min).length()
}
