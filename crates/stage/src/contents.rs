//! What a picture shows of a simulation: its surfaces on the device, marks and pulls.

use viscera::scalar::Vec3;
use viscera::simulation::Assembly;
use viscera::solver::gpu::{Device, DevicePositions, GpuError, GpuSurface, Skin};
use viscera_picture::{BodyColor, Color};
use viscera_render::{
    Arrow, BodyView, BoundingSphere, GpuDrawing, Markers, Orbit, Paint, ScaledValues, ValueBuffer,
};

use crate::hand::HandId;
use crate::snapshot::RunSnapshot;
use crate::tools::{ToolSnapshot, ToolSurfaces, force_arrows};

/// The surfaces of one simulation, on the device.
pub struct RunSurface {
    surface: GpuSurface,
    values: ValueBuffer,
    /// Whether the newest snapshot has values.
    has_values: bool,
    /// Encloses it, for its shadow.
    enclosing: Option<BoundingSphere>,
    tools: ToolSurfaces,
    device: Device,
    /// Encloses the tissue at rest.
    at_rest: Option<BoundingSphere>,
}

impl RunSurface {
    /// Binds the surfaces of all bodies.
    pub fn new(device: &Device, assembly: &Assembly) -> Result<Self, String> {
        let surface = bound(device, assembly, None)?;
        let values = ValueBuffer::new(device, surface.vertex_count() as usize);
        let rest = assembly.builder.positions().iter().copied();
        Ok(Self {
            surface,
            values,
            has_values: false,
            enclosing: None,
            tools: ToolSurfaces::default(),
            device: device.clone(),
            at_rest: BoundingSphere::around(rest),
        })
    }

    /// Moves it to its place in a snapshot: by positions that are on the device already, where there are any.
    pub fn place(&mut self, run: &RunSnapshot, assembly: &Assembly) -> Result<(), String> {
        let text = |error: GpuError| error.to_string();
        let mut shown = false;
        match run.on_device.as_ref().filter(|there| there.device().is_same(&self.device)) {
            Some(there) => {
                if !self.surface.follows(there) {
                    self.surface = bound(&self.device, assembly, Some(there))?;
                }
                self.surface.place_copy(there).map_err(text)?;
                self.surface.update();
                shown = self.surface.show_values(there, self.values.buffer()).map_err(text)?;
            }
            None => {
                if self.surface.follows_copies() {
                    self.surface = bound(&self.device, assembly, None)?;
                }
                self.surface.place(&run.positions).map_err(text)?;
                self.surface.update();
            }
        }
        self.has_values = shown || !run.values.is_empty();
        if self.has_values && !shown {
            self.values.write(&run.values).map_err(|error| error.to_string())?;
        }
        self.tools.follow(&self.device, &run.tools, self.at_rest);
        self.enclosing = BoundingSphere::around(run.positions.iter().map(|x| x.cast()));
        Ok(())
    }
}

/// The surfaces of all bodies, bound to positions that a solver leaves on the device, or to those that the host brings.
fn bound(
    device: &Device,
    assembly: &Assembly,
    there: Option<&DevicePositions>,
) -> Result<GpuSurface, String> {
    let bodies = assembly.bodies.iter();
    let skins: Vec<Skin<'_>> = bodies
        .map(|body| Skin {
            embedding: &body.embedding,
            triangles: &body.surface.triangles,
            first_vertex: body.vertices.start,
        })
        .collect();
    let count = assembly.builder.positions().len();
    let made = match there {
        Some(positions) => GpuSurface::following_copies(positions, &skins),
        None => GpuSurface::following(device, count, &skins),
    };
    made.map_err(|error| error.to_string())
}

/// What a picture shows.
pub struct PictureContents<'a> {
    /// From where.
    pub orbit: Orbit,
    /// The simulation's surfaces.
    pub surface: &'a RunSurface,
    /// The reference, which shines through.
    pub ghost: Option<&'a RunSurface>,
    /// The values that its colours begin and end at, where they show values.
    pub range: Option<[f32; 2]>,
    /// Bodies in colours of their own; none where all look the same, or colours show values.
    pub bodies: &'a [BodyColor],
    /// Whether the triangles are drawn.
    pub wireframe: bool,
    /// Whether it throws a shadow.
    pub shadow: bool,
    /// Vertices that are held in place [m].
    pub fixed: &'a [Vec3<f64>],
    /// Where tissue is held by hand [m].
    pub picked: &'a [Vec3<f64>],
    /// Where each of them is pulled to [m].
    pub targets: &'a [Vec3<f64>],
    /// The tools of the snapshot that the surfaces were placed by.
    pub tools: &'a [ToolSnapshot],
    /// The hand whose tool is drawn in another shade.
    pub in_hand: Option<HandId>,
    /// Length of arrows of their forces [m/N].
    pub force_scale: f64,
    /// The size of things [m], for markers and arrows.
    pub extent: f64,
}

impl PictureContents<'_> {
    /// Radii as shares of the size of things: large enough to be seen, too small to cover the tissue.
    const FIXED: f64 = 0.005;
    const PICKED: f64 = 0.009;
    const SHAFT: f64 = 0.0045;

    /// As the renderer takes it.
    pub fn drawing(&self) -> GpuDrawing<'_> {
        let surface = self.surface;
        let paint = match self.range.filter(|_| surface.has_values) {
            Some([low, high]) => Paint::Values(ScaledValues { buffer: &surface.values, low, high }),
            None => Paint::Flat(Color::TISSUE),
        };
        let body = BodyView { paint, wireframe: self.wireframe, ..BodyView::of(&surface.surface) };
        let mut bodies: Vec<_> = self.bodies.iter().map(|one| one_of(one, &body)).collect();
        match bodies.last_mut() {
            // Edges are those of all bodies, which are in their places by then.
            Some(last) => last.wireframe = self.wireframe,
            None => bodies.push(body),
        }
        let ghost = self.ghost.map(|ghost| BodyView {
            paint: Paint::Flat(Color::REST),
            opacity: 0.3,
            ..BodyView::of(&ghost.surface)
        });
        let balls = |positions, share, color| Markers {
            positions,
            radius: share * self.extent,
            color,
            see_through: 0.0,
        };
        let radius = Self::SHAFT * self.extent;
        let pulls = self.picked.iter().zip(self.targets);
        let arrows = pulls.map(|(&from, &to)| Arrow { from, to, radius, color: Color::PULLED });
        // Shorter ones are hidden by the point they begin at.
        let is_long = |arrow: &Arrow| (arrow.to - arrow.from).length() > Self::PICKED * self.extent;
        let forces = force_arrows(self.tools, &self.orbit, self.force_scale, radius);
        GpuDrawing {
            bodies: bodies.into_iter().chain(ghost).collect(),
            markers: vec![
                balls(self.fixed, Self::FIXED, Color::FIXED),
                balls(self.picked, Self::PICKED, Color::PULLED),
            ],
            tools: surface.tools.views(self.tools, self.in_hand),
            arrows: arrows.filter(is_long).chain(forces).collect(),
            shadow: surface.enclosing.filter(|_| self.shadow),
            ..GpuDrawing::from(self.orbit)
        }
    }
}

/// One of several bodies, in its own colour.
fn one_of<'a>(body: &BodyColor, all: &BodyView<'a>) -> BodyView<'a> {
    let triangles = [body.triangles.start, body.triangles.end].map(|number| number as u32);
    BodyView { triangles, paint: Paint::Flat(body.color), wireframe: false, ..*all }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::surface_values;
    use crate::run::build;
    use crate::snapshot::Coloring;
    use viscera::measure::measure_tets;
    use viscera::scalar::vec3;
    use viscera::scene::Scene;
    use viscera::solver::FrameReading;
    use viscera::solver::gpu::{Adapter, GpuSolver};
    use viscera::state::State;

    /// Whatever was read last, a picture shows the frame that it is of.
    #[test]
    fn surfaces_are_those_of_the_frame() {
        let text = r#"
            [world]
            gravity = "9.81 m/s^2"
            [solver]
            device = "gpu"
            method = "xpbd"
            [[body]]
            name = "slab"
            shape = "block"
            size = ["30 mm", "30 mm", "20 mm"]
            cells = [2, 2, 2]
            material = { preset = "liver" }
        "#;
        let device = Adapter::find(None).and_then(|adapter| adapter.open()).expect("a device");
        let scene = Scene::parse("slab.toml", text, &[]).expect("a legal scene");
        let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned())).expect("a slab");
        let mut run = build(scene, assembly.clone(), Some(&device)).expect("a simulation");
        assert!(run.is_drawn_unread(&device, Coloring::Plain));
        let mut snapshot = RunSnapshot::default();
        let mut surface = RunSurface::new(&device, &assembly).expect("a surface");
        let places = |surface: &RunSurface| surface.surface.read().expect("a device");
        let mut all = Vec::new();
        for _ in 0..3 {
            run.advance(FrameReading::Forces).expect("a frame");
            run.fill(Coloring::Plain, Some(&device), &mut snapshot);
            surface.place(&snapshot, &assembly).expect("a place");
            all.push(places(&surface));
        }
        assert!(snapshot.unread == 3 && all[1] != all[2], "it falls");
        run.read_state().expect("a device");
        // Pictures elsewhere have positions from the host, and the same surface changes over to them and back.
        run.fill(Coloring::Plain, None, &mut snapshot);
        assert!(snapshot.unread == 0 && snapshot.on_device.is_none());
        surface.place(&snapshot, &assembly).expect("a place");
        assert!(places(&surface) == all[2]);
        run.fill(Coloring::Plain, Some(&device), &mut snapshot);
        surface.place(&snapshot, &assembly).expect("a place");
        assert!(places(&surface) == all[2]);
        // Other devices read them, and where samples are not there pressures come from the host.
        let other = Adapter::find(None).and_then(|adapter| adapter.open()).expect("a device");
        assert!(run.is_drawn_unread(&device, Coloring::Stress));
        assert!(!run.is_drawn_unread(&device, Coloring::Pressure));
        assert!(!run.is_drawn_unread(&other, Coloring::Plain));
        run.fill(Coloring::Plain, Some(&other), &mut snapshot);
        assert!(snapshot.on_device.is_none());
    }
    /// Colours of a frame that stays on the device are those that the host finds in double precision: of both laws, of tissue that
    /// is stretched and sheared at random, and none around a tetrahedron that is inside out.
    #[test]
    fn colours_of_frames_that_stay_are_the_hosts() {
        let text = r#"
            [solver]
            device = "gpu"
            method = "xpbd"
            [[body]]
            name = "slab"
            shape = "block"
            size = ["30 mm", "30 mm", "20 mm"]
            cells = [3, 3, 2]
            material = { young = "10 kPa", poisson = 0.45 }
            [[body]]
            name = "bar"
            shape = "block"
            size = ["30 mm", "10 mm", "10 mm"]
            position = ["1 m", 0, 0]
            cells = [3, 1, 1]
            material = { young = "3 kPa", poisson = 0.3, model = "saint_venant_kirchhoff" }
        "#;
        let device = Adapter::find(None).and_then(|adapter| adapter.open()).expect("a device");
        let scene = Scene::parse("slab.toml", text, &[]).expect("a legal scene");
        let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned())).expect("a slab");
        let model = assembly.builder.build::<f32>().expect("a model");
        let mut state = State::at_rest(&model);
        let mut solver = GpuSolver::new(&device, &model, &scene.solver).expect("a solver");
        // Up to a millimetre of cells of ten, and one vertex through the opposite side of its own.
        let mut seed = 7u32;
        let mut random = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as f32 / 8_388_608.0 - 1.0
        };
        for x in &mut state.positions {
            *x += vec3(random(), random(), random()) * 1e-3;
        }
        state.positions[0] += vec3(0.02, 0.02, 0.02);
        solver.write(&model, &state).expect("a state");
        let mut tets = Vec::new();
        measure_tets(&model, &state.positions, &mut tets);
        assert!(tets.iter().any(|tet| tet.is_inverted()));
        let mut surface = RunSurface::new(&device, &assembly).expect("a surface");
        for coloring in [Coloring::Displacement, Coloring::Strain, Coloring::Stress] {
            let value = coloring.of_tissue();
            let on_device = Some(solver.copy_positions(None, value));
            let snapshot = RunSnapshot { on_device, unread: 1, ..RunSnapshot::default() };
            surface.place(&snapshot, &assembly).expect("a place");
            let mut expected = Vec::new();
            surface_values(&assembly, coloring, &state.positions, &tets, &[], &mut expected);
            let found = surface.values.read().expect("a device");
            assert!(surface.has_values && found.len() == expected.len());
            let known = expected.iter().filter(|value| value.is_finite());
            assert!(known.filter(|value| **value > 0.0).count() > expected.len() / 2);
            let gaps = expected.iter().filter(|value| value.is_nan()).count();
            assert!((gaps > 0) == (coloring != Coloring::Displacement), "{gaps}");
            // Places a metre away are rounded to 6e-8 m, and edges are some millimetres: 2e-5 of strain and of moduli.
            let floor = match coloring {
                Coloring::Displacement => 2e-7,
                Coloring::Strain => 1e-4,
                _ => 1e-4 * 5e4,
            };
            for (found, expected) in found.iter().zip(&expected) {
                let is_it = (found - expected).abs() <= 1e-3 * expected.abs() + floor;
                assert!(is_it || (found.is_nan() && expected.is_nan()), "{found} for {expected}");
            }
        }
        // Plain tissue has none.
        let on_device = Some(solver.copy_positions(None, None));
        let plain = RunSnapshot { on_device, ..RunSnapshot::default() };
        surface.place(&plain, &assembly).expect("a place");
        assert!(!surface.has_values);
    }
}
