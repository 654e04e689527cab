//! Pictures of a simulation: moments are remembered while it runs and drawn afterwards, when it is known how far everything
//! moves, so that camera and colours are the same in all of them.

use crate::{
    Arrow, BodyColor, Bounds, Camera, Color, ColorScale, Drawing, Facets, Image, ImageSize,
    Markers, Outline, Paint, PictureError, Surface, TracedOutline, ViewDirection,
};
use std::collections::BTreeSet;
use std::ops::Range;
use viscera::contact::Tool;
use viscera::mesh::SurfaceMesh;
use viscera::mesh::topology::boundary_surface;
use viscera::scalar::{Real, Vec3};
use viscera::scene::PictureColors;
use viscera::simulation::{FrameReport, PatchKind, ResolvedPatch, Simulation};

/// Arrow of the largest force, as a fraction of the scene's diagonal.
const LONGEST_ARROW: f64 = 0.18;

/// Radius of a marker, as a fraction of the scene's diagonal.
const MARKER_RADIUS: f64 = 0.006;

/// More markers of fixings than this are smaller, down to a share of the radius.
const FEW_MARKERS: f64 = 30.0;
const SMALLEST_MARKER: f64 = 0.35;

/// Nothing moves where nothing goes further than this share of the scene's diagonal, which nobody sees: colours may show
/// something else than round-off.
const STILL: f64 = 1e-3;

/// What one picture shows, in single precision to save memory.
pub struct Shot {
    /// Simulated time [s].
    pub time: f64,
    surface: Vec<Vec3<f32>>,
    markers: Vec<Vec3<f32>>,
    /// Name, middle of the patch or the tool's origin, and force [N] of each thing that moves, pulls or touches.
    pulls: Vec<(String, Vec3<f64>, Vec3<f64>)>,
    /// Parts of tools, where they are.
    tools: Vec<Tool>,
}

/// What all pictures of a simulation show.
pub struct Subject {
    title: String,
    view: ViewDirection,
    rest: SurfaceMesh,
    colors: PictureColors,
    /// Names and colours of bodies, their colours as tissue, and their triangles.
    legend: Vec<(String, Color)>,
    tissue: Vec<Color>,
    triangles: Vec<Range<usize>>,
    /// Vertices with a marker: the fixed ones first, then those that are moved or pulled.
    marked: Vec<u32>,
    fixed_count: usize,
}

impl Subject {
    /// Of a simulation, seen from where its scene says.
    pub fn of<S: Real>(simulation: &Simulation<S>) -> Self {
        let assembly = simulation.assembly();
        let mut visible = BTreeSet::new();
        for body in &assembly.bodies {
            let first = body.vertices.start as u32;
            visible.extend(boundary_surface(&body.mesh).mesh_vertices.iter().map(|v| v + first));
        }
        let of = |patches: &[ResolvedPatch]| -> BTreeSet<u32> {
            let vertices = patches.iter().flat_map(|patch| patch.vertices.iter().copied());
            vertices.filter(|v| visible.contains(v)).collect()
        };
        let mut moved = of(&assembly.motions);
        moved.extend(of(&assembly.forces));
        let fixed: Vec<u32> = of(&assembly.fixings).difference(&moved).copied().collect();
        let fixed_count = fixed.len();
        let bodies = BodyColor::of(assembly);
        let legend = bodies.iter().map(|body| (body.name.clone(), body.color)).collect();
        Self {
            colors: simulation.scene().output.colors,
            legend,
            tissue: bodies.iter().map(|body| body.tissue).collect(),
            triangles: bodies.into_iter().map(|body| body.triangles).collect(),
            title: simulation.scene().title.clone(),
            view: ViewDirection::from_vector(simulation.scene().output.view_from),
            rest: assembly.rest_surface(),
            marked: fixed.into_iter().chain(moved).collect(),
            fixed_count,
        }
    }

    /// The moment that a simulation is at, with its report of it.
    pub fn shot<S: Real>(&self, simulation: &Simulation<S>, report: &FrameReport) -> Shot {
        let positions = &simulation.state().positions;
        let assembly = simulation.assembly();
        let motions = assembly.motions.iter().chain(&assembly.forces);
        let reports = report.patches.iter().filter(|patch| patch.kind != PatchKind::Fixing);
        let pulls = motions.zip(reports).map(|(patch, report)| {
            let mut middle = Vec3::<f64>::ZERO;
            for &v in &patch.vertices {
                middle += positions[v as usize].cast();
            }
            let middle = middle * (1.0 / patch.vertices.len().max(1) as f64);
            (report.name.clone(), middle, Vec3::from_f64(report.force))
        });
        // As of what pulls: the force on the tissue.
        let states = simulation.tools();
        let tools = report.tools.iter().zip(&states).filter(|(_, tool)| tool.is_there);
        let tools = tools.map(|(report, tool)| {
            let force: Vec3<f64> = -Vec3::from_f64(report.force);
            (report.name.clone(), tool.pose.translation, force)
        });
        let surface = assembly.deformed_surface(positions);
        Shot {
            time: report.time,
            pulls: pulls.chain(tools).collect(),
            surface: surface.iter().map(|x| x.cast()).collect(),
            markers: self.marked.iter().map(|&v| positions[v as usize].cast()).collect(),
            tools: simulation.tool_parts(),
        }
    }

    /// How pictures of these moments look: room and colours for all of them.
    pub fn look(&self, shots: &[Shot], medium: Medium) -> Result<Look<'_>, PictureError> {
        let mut largest = 0.0f64;
        let mut strongest = 0.0f64;
        let mut bounds = Bounds::of(&self.rest.vertices);
        for shot in shots {
            let surface: Vec<Vec3<f64>> = shot.surface.iter().map(|x| x.cast()).collect();
            largest = self.displacements(&surface).iter().fold(largest, |a, b| a.max(*b));
            bounds.include(&surface);
            strongest = shot.pulls.iter().fold(strongest, |a, (_, _, force)| a.max(force.length()));
        }
        let scale = ColorScale::rounded("displacement [mm]", 0.0, largest)?;
        let diagonal = bounds.diagonal();
        include_tools(&mut bounds, shots);
        let is_still = 1e-3 * largest < STILL * diagonal;
        let colors = match self.colors {
            PictureColors::Auto => match (medium, is_still) {
                (Medium::Picture, true) if self.legend.len() > 1 => Colors::Bodies,
                (Medium::Picture, false) => Colors::Values(scale),
                _ => Colors::Tissue,
            },
            PictureColors::Displacement => Colors::Values(scale),
            PictureColors::Bodies => Colors::Bodies,
            PictureColors::Tissue => Colors::Tissue,
        };
        let mut look = Look { subject: self, bounds, diagonal, strongest, colors };
        for shot in shots {
            for arrow in look.arrows(shot) {
                look.bounds.include(&[arrow.to]);
            }
        }
        Ok(look)
    }

    /// Displacement of each surface vertex [mm].
    fn displacements(&self, surface: &[Vec3<f64>]) -> Vec<f64> {
        let pairs = surface.iter().zip(&self.rest.vertices);
        pairs.map(|(x, rest)| 1e3 * (*x - *rest).length()).collect()
    }
}

/// What all pictures of one size have in common.
pub struct Seen {
    camera: Camera,
    /// The shape at rest.
    rest: TracedOutline,
}

impl Seen {
    /// Of the pictures.
    pub fn size(&self) -> ImageSize {
        self.camera.size()
    }
}

/// What is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Medium {
    /// One moment, to look at for long.
    Picture,
    /// One after the other: colours that do not change let the eye follow.
    Film,
}

/// What colours show.
enum Colors {
    /// Displacements.
    Values(ColorScale),
    /// Which body is which.
    Bodies,
    Tissue,
}

/// What all pictures of some moments have in common.
pub struct Look<'a> {
    subject: &'a Subject,
    bounds: Bounds,
    diagonal: f64,
    /// The largest force [N].
    strongest: f64,
    colors: Colors,
}

impl Look<'_> {
    /// The camera, and the shape at rest as it sees it.
    pub fn seen_at(&self, size: ImageSize) -> Result<Seen, PictureError> {
        let camera = Camera::framing(&self.bounds, self.subject.view, size);
        let SurfaceMesh { vertices, triangles } = &self.subject.rest;
        let rest = Outline { positions: vertices, triangles, color: Color::REST };
        Ok(Seen { rest: rest.trace(&camera)?, camera })
    }

    /// A picture of one of the moments.
    pub fn draw(&self, shot: &Shot, Seen { camera, rest }: &Seen) -> Result<Image, PictureError> {
        let subject = self.subject;
        let surface: Vec<Vec3<f64>> = shot.surface.iter().map(|x| x.cast()).collect();
        let values = subject.displacements(&surface);
        let markers: Vec<Vec3<f64>> = shot.markers.iter().map(|x| x.cast()).collect();
        let (fixed, moved) = markers.split_at(subject.fixed_count);
        let radius = MARKER_RADIUS * self.diagonal;
        // Many are small: what they hold is the point of the picture.
        let crowd = (FEW_MARKERS / fixed.len().max(1) as f64).sqrt().clamp(SMALLEST_MARKER, 1.0);
        // What pulls shines through where tissue hides it.
        let marks = |positions, radius, color, see_through| Markers {
            positions,
            radius,
            color,
            see_through,
        };
        let surface_of = |triangles, paint| Surface { positions: &surface, triangles, paint };
        let flat = |color: &dyn Fn(usize) -> Color| -> Vec<_> {
            let bodies = subject.triangles.iter().enumerate();
            let triangles = |range: &Range<usize>| &subject.rest.triangles[range.clone()];
            let flat = |(n, range)| surface_of(triangles(range), Paint::Flat(color(n)));
            bodies.map(flat).collect()
        };
        let surfaces = match &self.colors {
            Colors::Values(_) => {
                vec![surface_of(&subject.rest.triangles[..], Paint::Values(&values[..]))]
            }
            Colors::Bodies => flat(&|body| subject.legend[body].1),
            Colors::Tissue => flat(&|body| subject.tissue[body]),
        };
        let (scale, legend) = match &self.colors {
            Colors::Values(scale) => (Some(scale.clone()), &[][..]),
            Colors::Bodies => (None, &subject.legend[..]),
            Colors::Tissue => (None, &[][..]),
        };
        let drawing = Drawing {
            title: &subject.title,
            caption: &caption(shot),
            surfaces,
            legend,
            tools: &shot.tools,
            traced: vec![rest],
            markers: vec![
                marks(fixed, crowd * radius, Color::FIXED, 0.0),
                marks(moved, radius, Color::PULLED, 0.4),
            ],
            arrows: in_front(self.arrows(shot), camera),
            color_scale: scale,
            length_scale: true,
            ..Drawing::default()
        };
        drawing.draw(camera).map(|drawn| drawn.image)
    }

    fn arrows(&self, shot: &Shot) -> Vec<Arrow> {
        let Self { diagonal, strongest, .. } = *self;
        let visible = |force: &Vec3<f64>| force.length() > 0.02 * strongest;
        let pulls = shot.pulls.iter().filter(|(_, _, force)| visible(force));
        let arrow = |(_, from, force): &(String, Vec3<f64>, Vec3<f64>)| Arrow {
            from: *from,
            to: *from + *force * (LONGEST_ARROW * diagonal / strongest),
            radius: 0.6 * MARKER_RADIUS * diagonal,
            color: Color::PULLED,
        };
        pulls.map(arrow).collect()
    }
}

/// Parts of tools so near to where the tissue ever is are in the picture, as a share of its diagonal: enough to see
/// what a tool is. A long shaft leaves the picture, and the tissue stays large.
const TOOLS_WITHIN: f64 = 0.12;

/// Makes room for tools near the tissue, of which these are the bounds.
fn include_tools(bounds: &mut Bounds, shots: &[Shot]) {
    let Some((low, high)) = bounds.corners() else { return };
    let margin = Vec3::splat(TOOLS_WITHIN * bounds.diagonal());
    let (low, high) = (low - margin, high + margin);
    for tool in shots.iter().flat_map(|shot| &shot.tools) {
        let mut near = Facets::of(&tool.shape).placed(&tool.pose).positions;
        near.retain(|x| x.max(low) == *x && x.min(high) == *x);
        bounds.include(&near);
    }
}

/// How far arrows are moved towards the camera, as a share of the way.
const IN_FRONT: f64 = 0.4;

/// Arrows where one sees them: moved towards the camera along their lines of sight, and shrunk alike,
/// they look the same and no tissue hides them.
fn in_front(mut arrows: Vec<Arrow>, camera: &Camera) -> Vec<Arrow> {
    let eye = camera.position();
    for arrow in &mut arrows {
        arrow.from += (eye - arrow.from) * IN_FRONT;
        arrow.to += (eye - arrow.to) * IN_FRONT;
        arrow.radius *= 1.0 - IN_FRONT;
    }
    arrows
}

fn caption(shot: &Shot) -> String {
    let mut text = format!("t = {:.2} s", shot.time);
    let pulls = shot.pulls.iter().take(2).map(|(name, _, force)| (name, force.length()));
    for (name, force) in pulls.filter(|(_, force)| *force > 0.0) {
        text.push_str(&format!("   {name} {force:.3} N"));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera::scene::Scene;
    use viscera::simulation::Assembly;

    const TWO: &str = r#"
        [[body]]
        name = "liver"
        shape = "block"
        size = ["40 mm", "40 mm", "40 mm"]
        cells = [2, 2, 2]
        material = { preset = "liver" }

        [[body]]
        name = "gallbladder"
        shape = "block"
        size = ["40 mm", "40 mm", "40 mm"]
        cells = [2, 2, 2]
        position = ["50 mm", 0, 0]
        material = { preset = "liver" }
    "#;

    fn green(settings: &[(&str, &str)]) -> usize {
        green_after(settings, 0, Medium::Picture)
    }

    /// Pixels of a picture after so many frames, in which both fall, that are rather green.
    fn green_after(settings: &[(&str, &str)], frames: u32, medium: Medium) -> usize {
        let image = image_after(settings, frames, medium);
        let is_green = |p: &&[u8; 3]| p[1] > p[0].saturating_add(15) && p[1] > p[2];
        image.pixels().iter().filter(is_green).count()
    }

    fn image_after(settings: &[(&str, &str)], frames: u32, medium: Medium) -> Image {
        image_of(TWO, settings, frames, medium)
    }

    fn image_of(text: &str, settings: &[(&str, &str)], frames: u32, medium: Medium) -> Image {
        let scene = Scene::parse("two.toml", text, settings).expect("a legal scene");
        let load = &mut |file: &str| Err(file.to_owned());
        let assembly = Assembly::new(&scene, load).expect("two blocks");
        let mut simulation = Simulation::<f32>::new(scene, assembly).expect("a simulation");
        (0..frames).for_each(|_| simulation.advance_frame().expect("a frame"));
        let subject = Subject::of(&simulation);
        let shots = [subject.shot(&simulation, &simulation.report())];
        let look = subject.look(&shots, medium).expect("a look");
        let seen = look.seen_at(ImageSize::new(480, 360).expect("a size")).expect("a camera");
        look.draw(&shots[0], &seen).expect("a picture")
    }

    #[test]
    fn bodies_that_do_not_move_have_colours_of_their_own() {
        assert!(green(&[]) > 1000, "a gallbladder is green: {}", green(&[]));
        assert_eq!(green(&[("output.colors", "displacement")]), 0);
        // A hundredth of the scene's size is seen.
        assert_eq!(green_after(&[], 3, Medium::Picture), 0);
    }

    #[test]
    fn films_show_tissue_and_pictures_do_where_they_are_told() {
        assert!(green_after(&[], 3, Medium::Film) > 1000);
        let tissue = [("output.colors", "tissue")];
        assert!(green_after(&tissue, 3, Medium::Picture) > 1000);
        assert_eq!(green_after(&[("output.colors", "displacement")], 3, Medium::Film), 0);
        // What has no organ's name is red, where colours that tell bodies apart are others.
        let nameless = TWO.replace("name = \"gallbladder\"", "name = \"block\"");
        let flesh = |colors: &str| {
            let image = image_of(&nameless, &[("output.colors", colors)], 0, Medium::Picture);
            let right = (0..image.pixels().len()).filter(|at| at % 480 > 260);
            let is_flesh = |at: &usize| {
                let [r, g, b] = image.pixels()[*at].map(f64::from);
                r > 60.0 && r > 1.5 * g && r > 1.5 * b
            };
            right.filter(is_flesh).count()
        };
        assert!(
            flesh("tissue") > 4 * flesh("bodies").max(250),
            "{} {}",
            flesh("tissue"),
            flesh("bodies")
        );
    }
}
