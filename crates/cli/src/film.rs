//! The film of a run: frames are remembered while the scene runs and drawn afterwards, when it is
//! known how far everything moves, so that camera and colours stay the same throughout.

use crate::output::OutputFolder;
use crate::series::{deformed_surface, rest_surface};
use anyhow::Result;
use indicatif::ProgressBar;
use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, Ordering};
use viscera::mesh::SurfaceMesh;
use viscera::mesh::topology::boundary_surface;
use viscera::scalar::{Real, Vec3};
use viscera::simulation::{FrameReport, PatchKind, Simulation};
use viscera_picture::{
    Animation, Arrow, Bounds, Camera, Color, ColorScale, Drawing, ImageSize, Markers, Outline,
    Paint, Surface, ViewDirection, write_png,
};

/// Frames of the animated image. More make the file large, fewer make it jerky.
const MOST_FRAMES: u64 = 75;

/// Width of the animated image [pixels]: a web page's column.
const ANIMATION_WIDTH: u32 = 640;

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
    /// Name, middle of the patch and force [N] of each thing that moves or pulls.
    pulls: Vec<(String, Vec3<f64>, Vec3<f64>)>,
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
            rest: rest_surface(simulation),
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
        self.shots.push(Shot {
            time: report.time,
            pulls: pulls.collect(),
            surface: deformed_surface(simulation).vertices.iter().map(|x| x.cast()).collect(),
            markers: self.marked.iter().map(|&v| positions[v as usize].cast()).collect(),
        });
    }

    /// Number of pictures to draw, the still one included.
    pub fn picture_count(&self) -> u64 {
        self.shots.len() as u64 + 1
    }

    /// Draws `picture.png` and `motion.gif`, which takes as long as the simulated time. Returns false where an interruption left the animation undone.
    pub fn develop(
        &self,
        out: &OutputFolder,
        progress: &ProgressBar,
        interrupted: &AtomicBool,
    ) -> Result<bool> {
        let Some(last) = self.shots.last() else { return Ok(true) };
        let mut largest = 0.0f64;
        let mut strongest = 0.0f64;
        let mut bounds = Bounds::of(&self.rest.vertices);
        for shot in &self.shots {
            let surface: Vec<Vec3<f64>> = shot.surface.iter().map(|x| x.cast()).collect();
            largest = self.displacements(&surface).iter().fold(largest, |a, b| a.max(*b));
            bounds.include(&surface);
            strongest = shot.pulls.iter().fold(strongest, |a, (_, _, force)| a.max(force.length()));
        }
        let diagonal = bounds.diagonal();
        for shot in &self.shots {
            for arrow in self.arrows(shot, diagonal, strongest) {
                bounds.include(&[arrow.to]);
            }
        }
        let scale = ColorScale::rounded("displacement [mm]", 0.0, largest)?;
        let draw = |shot: &Shot, camera: &Camera| {
            let surface: Vec<Vec3<f64>> = shot.surface.iter().map(|x| x.cast()).collect();
            let values = self.displacements(&surface);
            let markers: Vec<Vec3<f64>> = shot.markers.iter().map(|x| x.cast()).collect();
            let (fixed, moved) = markers.split_at(self.fixed_count);
            let radius = MARKER_RADIUS * diagonal;
            // What pulls is the point of the picture: it shines through where tissue hides it.
            let marks =
                |positions, color, see_through| Markers { positions, radius, color, see_through };
            let drawing = Drawing {
                title: &self.title,
                caption: &caption(shot),
                surfaces: vec![Surface {
                    positions: &surface,
                    triangles: &self.rest.triangles,
                    paint: Paint::Values(&values),
                }],
                outlines: vec![Outline {
                    positions: &self.rest.vertices,
                    triangles: &self.rest.triangles,
                    color: Color::REST,
                }],
                markers: vec![marks(fixed, Color::FIXED, 0.0), marks(moved, Color::PULLED, 0.4)],
                arrows: in_front(self.arrows(shot, diagonal, strongest), camera),
                color_scale: Some(scale.clone()),
                length_scale: true,
                ..Drawing::default()
            };
            let drawn = drawing.draw(camera).map(|drawn| drawn.image);
            progress.inc(1);
            drawn
        };

        let distance = |shot: &Shot| self.still.map_or(0.0, |time| (shot.time - time).abs());
        // Without a wish all are equally near, and the last stays.
        let shown = self
            .shots
            .iter()
            .fold(last, |best, shot| if distance(shot) < distance(best) { shot } else { best });
        let still = draw(shown, &Camera::framing(&bounds, self.view, self.size))?;
        out.write("picture.png", &write_png(&still)?)?;
        let small = self.small_size()?;
        let camera = Camera::framing(&bounds, self.view, small);
        let mut animation = Animation::new(small)?;
        for shot in &self.shots {
            if interrupted.load(Ordering::Relaxed) {
                return Ok(false);
            }
            animation.push(&draw(shot, &camera)?, shot.time)?;
        }
        out.write("motion.gif", &animation.finish(LAST_FRAME_HELD)?)?;
        Ok(true)
    }

    /// Displacement of each surface vertex [mm].
    fn displacements(&self, surface: &[Vec3<f64>]) -> Vec<f64> {
        let pairs = surface.iter().zip(&self.rest.vertices);
        pairs.map(|(x, rest)| 1e3 * (*x - *rest).length()).collect()
    }

    fn arrows(&self, shot: &Shot, diagonal: f64, strongest: f64) -> Vec<Arrow> {
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
    for (name, _, force) in shot.pulls.iter().take(2) {
        if force.length() > 0.0 {
            text.push_str(&format!("   {name} {:.3} N", force.length()));
        }
    }
    text
}
