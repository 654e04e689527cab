//! The film of a run: frames are remembered while the scene runs and drawn afterwards, when it is
//! known how far everything moves, so that camera and colours stay the same throughout.

use crate::in_order::make_in_order;
use crate::output::OutputFolder;
use crate::series::{deformed_vertices, rest_surface};
use anyhow::Result;
use indicatif::ProgressBar;
use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, Ordering};
use viscera::contact::Tool;
use viscera::mesh::SurfaceMesh;
use viscera::mesh::topology::boundary_surface;
use viscera::scalar::{Real, Vec3};
use viscera::simulation::{FrameReport, PatchKind, Simulation};
use viscera_picture::{
    Animation, Arrow, Bounds, Camera, Color, ColorScale, Drawing, Facets, Image, ImageSize,
    Markers, Outline, Paint, PictureError, Surface, TracedOutline, ViewDirection, write_png,
};

/// Frames of the animated image. More make the file large, fewer make it jerky.
const MOST_FRAMES: u64 = 75;

/// Width of the animated image [pixels]: a web page's column.
const ANIMATION_WIDTH: u32 = 640;

/// Pictures from which the animation takes its colours, evenly through its time: a motion shows new colours slowly.
const SAMPLES: usize = 4;

/// How long the last frame stays before the animation begins again [s].
const LAST_FRAME_HELD: f64 = 1.5;

/// Arrow of the largest force, as a fraction of the scene's diagonal.
const LONGEST_ARROW: f64 = 0.18;

/// Radius of a marker, as a fraction of the scene's diagonal.
const MARKER_RADIUS: f64 = 0.006;

/// What one picture shows, in single precision to save memory.
struct Shot {
    time: f64,
    surface: Vec<Vec3<f32>>,
    markers: Vec<Vec3<f32>>,
    /// Name, middle of the patch or the tool's origin, and force [N] of each thing that moves, pulls or touches.
    pulls: Vec<(String, Vec3<f64>, Vec3<f64>)>,
    /// Parts of tools, where they are.
    tools: Vec<Tool>,
}

/// Remembered frames.
pub struct Film {
    title: String,
    view: ViewDirection,
    size: ImageSize,
    rest: SurfaceMesh,
    /// Vertices with a marker: the fixed ones first, then those that are moved or pulled.
    marked: Vec<u32>,
    fixed_count: usize,
    every: u64,
    /// The moment of the still picture [s]; the last one where unset.
    still: Option<f64>,
    shots: Vec<Shot>,
}

impl Film {
    /// For a simulation of so many frames.
    pub fn new<S: Real>(simulation: &Simulation<S>, frames: u64) -> Result<Self> {
        let output = &simulation.scene().output;
        let [width, height] = output.picture_size;
        let assembly = simulation.assembly();
        let mut visible = BTreeSet::new();
        for body in &assembly.bodies {
            let first = body.vertices.start as u32;
            visible.extend(boundary_surface(&body.mesh).mesh_vertices.iter().map(|v| v + first));
        }
        let of = |patches: &[viscera::simulation::ResolvedPatch]| -> BTreeSet<u32> {
            let vertices = patches.iter().flat_map(|patch| patch.vertices.iter().copied());
            vertices.filter(|v| visible.contains(v)).collect()
        };
        let mut moved = of(&assembly.motions);
        moved.extend(of(&assembly.forces));
        let fixed: Vec<u32> = of(&assembly.fixings).difference(&moved).copied().collect();
        let fixed_count = fixed.len();
        Ok(Self {
            title: simulation.scene().title.clone(),
            view: ViewDirection::from_vector(output.view_from),
            size: ImageSize::new(width, height)?,
            rest: rest_surface(&assembly.bodies),
            marked: fixed.into_iter().chain(moved).collect(),
            fixed_count,
            every: frames.div_ceil(MOST_FRAMES).max(1),
            still: output.picture_time,
            shots: Vec::new(),
        })
    }

    /// Remembers a frame where the film needs it; `last` is needed always.
    pub fn push<S: Real>(&mut self, simulation: &Simulation<S>, report: &FrameReport, last: bool) {
        if !last && !simulation.frame().is_multiple_of(self.every) {
            return;
        }
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
        let surface = deformed_vertices(&assembly.bodies, positions);
        self.shots.push(Shot {
            time: report.time,
            pulls: pulls.chain(tools).collect(),
            surface: surface.iter().map(|x| x.cast()).collect(),
            markers: self.marked.iter().map(|&v| positions[v as usize].cast()).collect(),
            tools: simulation.tool_parts(),
        });
    }

    /// Number of pictures to draw, the still one included.
    pub fn picture_count(&self) -> u64 {
        self.shots.len() as u64 + 1
    }

    /// Draws `picture.png` and `motion.gif` on all processors. Returns false where an interruption left the animation
    /// undone.
    pub fn develop(
        &self,
        out: &OutputFolder,
        progress: &ProgressBar,
        interrupted: &AtomicBool,
    ) -> Result<bool> {
        let Some(last) = self.shots.last() else { return Ok(true) };
        let distance = |shot: &Shot| self.still.map_or(0.0, |time| (shot.time - time).abs());
        // Without a wish all are equally near, and the last stays.
        let shown = self
            .shots
            .iter()
            .fold(last, |best, shot| if distance(shot) < distance(best) { shot } else { best });
        let look = Look::of(self, progress)?;
        let (large, small) = (look.seen_at(self.size)?, look.seen_at(self.small_size()?)?);
        let goes_on = || !interrupted.load(Ordering::Relaxed);
        // The still picture, and those from which the animation takes its colours.
        let samples = self.samples();
        let mut drawn = Vec::new();
        let first = |number: usize| match number.checked_sub(1) {
            Some(sample) => Ok((look.draw(&self.shots[samples[sample]], &small)?, None)),
            None => {
                let still = look.draw(shown, &large)?;
                let png = write_png(&still)?;
                Ok((still, Some(png)))
            }
        };
        let is_whole = make_in_order(1 + samples.len(), first, |made: Result<_, PictureError>| {
            match made? {
                (_, Some(png)) => out.write("picture.png", &png)?,
                (sample, None) => drawn.push(sample),
            }
            Ok(goes_on())
        })?;
        if !is_whole {
            return Ok(false);
        }
        let mut animation = Animation::in_colors_of(&drawn, small.camera.size())?;
        let picture = |number: usize| match samples.binary_search(&number) {
            Ok(sample) => Ok(drawn[sample].clone()),
            Err(_) => look.draw(&self.shots[number], &small),
        };
        let mut times = self.shots.iter().map(|shot| shot.time);
        let pictures = self.shots.len();
        let is_whole = make_in_order(pictures, picture, |image: Result<_, PictureError>| {
            animation.push(&image?, times.next().unwrap_or_default())?;
            Ok(goes_on())
        })?;
        if is_whole {
            out.write("motion.gif", &animation.finish(LAST_FRAME_HELD)?)?;
        }
        Ok(is_whole)
    }

    /// The shots from which the animation takes its colours, ascending; the last is one.
    fn samples(&self) -> Vec<usize> {
        let (shots, count) = (self.shots.len(), SAMPLES.min(self.shots.len()));
        (1..=count).map(|k| k * shots / count - 1).collect()
    }

    /// Displacement of each surface vertex [mm].
    fn displacements(&self, surface: &[Vec3<f64>]) -> Vec<f64> {
        let pairs = surface.iter().zip(&self.rest.vertices);
        pairs.map(|(x, rest)| 1e3 * (*x - *rest).length()).collect()
    }

    fn small_size(&self) -> Result<ImageSize> {
        let (width, height) = (self.size.width(), self.size.height());
        if width <= ANIMATION_WIDTH {
            return Ok(self.size);
        }
        // Both sizes are a few thousand pixels at most.
        let height = (height * ANIMATION_WIDTH).div_ceil(width).max(16);
        Ok(ImageSize::new(ANIMATION_WIDTH, height)?)
    }
}

/// What all pictures of one size have in common.
struct Seen {
    camera: Camera,
    /// The shape at rest.
    rest: TracedOutline,
}

/// What all pictures of a film have in common.
struct Look<'a> {
    film: &'a Film,
    bounds: Bounds,
    diagonal: f64,
    /// The largest force [N].
    strongest: f64,
    scale: ColorScale,
    progress: &'a ProgressBar,
}

impl<'a> Look<'a> {
    fn of(film: &'a Film, progress: &'a ProgressBar) -> Result<Self> {
        let mut largest = 0.0f64;
        let mut strongest = 0.0f64;
        let mut bounds = Bounds::of(&film.rest.vertices);
        for shot in &film.shots {
            let surface: Vec<Vec3<f64>> = shot.surface.iter().map(|x| x.cast()).collect();
            largest = film.displacements(&surface).iter().fold(largest, |a, b| a.max(*b));
            bounds.include(&surface);
            strongest = shot.pulls.iter().fold(strongest, |a, (_, _, force)| a.max(force.length()));
        }
        let scale = ColorScale::rounded("displacement [mm]", 0.0, largest)?;
        let diagonal = bounds.diagonal();
        include_tools(&mut bounds, &film.shots);
        let mut look = Self { film, bounds, diagonal, strongest, scale, progress };
        for shot in &film.shots {
            for arrow in look.arrows(shot) {
                look.bounds.include(&[arrow.to]);
            }
        }
        Ok(look)
    }

    fn seen_at(&self, size: ImageSize) -> Result<Seen> {
        let camera = Camera::framing(&self.bounds, self.film.view, size);
        let SurfaceMesh { vertices, triangles } = &self.film.rest;
        let rest = Outline { positions: vertices, triangles, color: Color::REST };
        Ok(Seen { rest: rest.trace(&camera)?, camera })
    }

    fn draw(&self, shot: &Shot, Seen { camera, rest }: &Seen) -> Result<Image, PictureError> {
        let film = self.film;
        let surface: Vec<Vec3<f64>> = shot.surface.iter().map(|x| x.cast()).collect();
        let values = film.displacements(&surface);
        let markers: Vec<Vec3<f64>> = shot.markers.iter().map(|x| x.cast()).collect();
        let (fixed, moved) = markers.split_at(film.fixed_count);
        let radius = MARKER_RADIUS * self.diagonal;
        // What pulls is the point of the picture: it shines through where tissue hides it.
        let marks =
            |positions, color, see_through| Markers { positions, radius, color, see_through };
        let drawing = Drawing {
            title: &film.title,
            caption: &caption(shot),
            surfaces: vec![Surface {
                positions: &surface,
                triangles: &film.rest.triangles,
                paint: Paint::Values(&values),
            }],
            tools: &shot.tools,
            traced: vec![rest],
            markers: vec![marks(fixed, Color::FIXED, 0.0), marks(moved, Color::PULLED, 0.4)],
            arrows: in_front(self.arrows(shot), camera),
            color_scale: Some(self.scale.clone()),
            length_scale: true,
            ..Drawing::default()
        };
        let drawn = drawing.draw(camera).map(|drawn| drawn.image);
        self.progress.inc(1);
        drawn
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
