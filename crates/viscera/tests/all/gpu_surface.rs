//! A fine surface on a graphics processor: where the CPU's embedding puts it, and ready to be drawn.

use crate::common::device;
use crate::common::device::largest;
use crate::common::{Random, SNH, STVK, block, material};
use viscera::mesh::embed::Embedding;
use viscera::mesh::normals::vertex_normals;
use viscera::mesh::shapes::sphere;
use viscera::mesh::{SurfaceMesh, TetMesh};
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::{Real, Vec3, vec3};
use viscera::settings::SolverSettings;
use viscera::solver::gpu::{Device, GpuError, GpuSolver, GpuSurface, Skin};
use viscera::solver::{Inputs, Pin};
use viscera::state::State;

const RADIUS: f64 = 0.05;

/// A bar, and beside it a ball with a fine surface.
struct Bodies {
    tets: [TetMesh; 2],
    surfaces: [SurfaceMesh; 2],
    embeddings: [Embedding; 2],
}

fn bodies() -> Bodies {
    let ball = sphere(RADIUS, 0.025).expect("a ball").tets;
    let fine = sphere(RADIUS, 0.012).expect("a ball").surface;
    let bar = block([0.06, 0.03, 0.03], [3, 2, 2], 0.1);
    let away: Vec<_> = bar.vertices().iter().map(|x| *x + vec3(0.1, 0.0, 0.0)).collect();
    let (bar, _) = TetMesh::new(away, bar.tets().to_vec(), bar.regions().to_vec()).expect("a bar");
    let skin = SurfaceMesh {
        vertices: bar.vertices().to_vec(),
        triangles: bar.tets().iter().map(|t| [t[0], t[1], t[2]]).collect(),
    };
    let surfaces = [skin, fine];
    let tets = [bar, ball];
    let bind = |i: usize| Embedding::new(&tets[i], &surfaces[i]).expect("a bound surface");
    let embeddings = [bind(0), bind(1)];
    Bodies { tets, surfaces, embeddings }
}

impl Bodies {
    fn model<S: Real>(&self) -> Model<S> {
        let mut builder = ModelBuilder::new();
        for (mesh, law) in self.tets.iter().zip([STVK, SNH]) {
            builder.add_body(mesh, &material(law, 5e3, 0.3)).expect("a body");
        }
        builder.build().expect("a model")
    }

    fn skins<'a>(&'a self, model: &Model<f32>) -> [Skin<'a>; 2] {
        [0, 1].map(|i| Skin {
            embedding: &self.embeddings[i],
            triangles: &self.surfaces[i].triangles,
            first_vertex: model.bodies[i].vertices.start,
        })
    }

    /// Positions and normals of all surfaces on the CPU, for the model's vertices at `x`.
    fn surface<S: Real>(&self, model: &Model<f32>, x: &[Vec3<S>]) -> [Vec<Vec3<S>>; 2] {
        let [mut places, mut normals] = [Vec::new(), Vec::new()];
        for i in 0..2 {
            let mut moved = vec![Vec3::ZERO; self.surfaces[i].vertices.len()];
            let x = &x[model.bodies[i].vertices.clone()];
            self.embeddings[i].apply(x, &mut moved).expect("arrays that fit");
            normals.extend(vertex_normals(&moved, &self.surfaces[i].triangles));
            places.extend(moved);
        }
        [places, normals]
    }

    /// Both round, and neither is right: the device may be twice as far from double precision.
    fn assert_agreement(
        &self,
        model: &Model<f32>,
        state: &State<f32>,
        [places, normals]: [&[Vec3<f32>]; 2],
    ) {
        let x: Vec<Vec3<f64>> = state.positions.iter().map(|x| x.cast()).collect();
        let [places64, normals64] = self.surface(model, &x);
        let [places32, normals32] = self.surface(model, &state.positions);
        for (what, cpu, gpu, oracle) in [
            ("positions", &places32, places, &places64),
            ("normals", &normals32, normals, &normals64),
        ] {
            assert_eq!(gpu.len(), oracle.len());
            let [cpu, gpu] = [largest(cpu, oracle), largest(gpu, oracle)];
            println!("{what}: CPU {cpu:.1e}, GPU {gpu:.1e}");
            assert!(gpu <= 2.0 * cpu && gpu > 0.0, "{what}: CPU {cpu:e}, GPU {gpu:e}");
        }
    }
}

fn settings() -> SolverSettings {
    SolverSettings { step_guard: false, ..SolverSettings::xpbd() }
}

/// Falls for some steps, held at a few vertices of both bodies.
fn fall(device: &Device, model: &Model<f32>) -> GpuSolver {
    let mut solver = GpuSolver::new(device, model, &settings()).expect("a model that fits");
    let pins = model.bodies.iter().flat_map(|body| body.vertices.clone().take(3));
    let pin = |v: usize| Pin { vertex: v as u32, target: model.rest_positions[v] };
    let gravity = vec3(0.0, 5.0, -9.81);
    let inputs = Inputs { gravity, pins: pins.map(pin).collect(), ..Inputs::default() };
    for _ in 0..20 {
        solver.step(model, &inputs, 1.0 / 300.0).expect("a legal step");
    }
    solver
}

#[test]
fn surface_is_where_the_embedding_puts_it() {
    let (device, bodies) = (device::device(), bodies());
    let model = bodies.model::<f32>();
    let solver = fall(device, &model);
    let surface = GpuSurface::new(&solver, &model, &bodies.skins(&model)).expect("it fits");
    surface.update();
    let [places, normals] = surface.read().expect("a device");
    let mut state = State::at_rest(&model);
    solver.read(&model, &mut state).expect("a device");
    let moved = largest(
        &state.positions,
        &model.rest_positions.iter().map(|x| x.cast()).collect::<Vec<_>>(),
    );
    assert!(moved > 0.005, "nothing happened: {moved} m");

    bodies.assert_agreement(&model, &state, [&places, &normals]);
    // Follows the next steps as well, with the same bits from run to run.
    let again = fall(device, &model);
    let other = GpuSurface::new(&again, &model, &bodies.skins(&model)).expect("it fits");
    other.update();
    assert_eq!(other.read().expect("a device"), [places, normals]);
}

/// Scrambled vertices and no step, for a second, slower driver.
#[test]
fn portable_surface_is_where_the_embedding_puts_it() {
    let bodies = bodies();
    let model = bodies.model::<f32>();
    let mut state = State::at_rest(&model);
    let mut random = Random(5);
    for x in &mut state.positions {
        *x += random.vector(0.002).cast();
    }
    let mut solver =
        GpuSolver::new(device::device(), &model, &settings()).expect("a model that fits");
    solver.write(&model, &state).expect("a state that fits");
    let surface = GpuSurface::new(&solver, &model, &bodies.skins(&model)).expect("it fits");
    surface.update();
    let [places, normals] = surface.read().expect("a device");
    bodies.assert_agreement(&model, &state, [&places, &normals]);
}

#[test]
fn surfaces_of_other_meshes_are_refused_and_bad_triangles_passed_over() {
    let (device, bodies) = (device::device(), bodies());
    let model = bodies.model::<f32>();
    let solver = GpuSolver::new(device, &model, &settings()).expect("a model that fits");
    let [bar, ball] = bodies.skins(&model);
    let misplaced = Skin { first_vertex: ball.first_vertex + 1, ..ball };
    let error = GpuSurface::new(&solver, &model, &[bar, misplaced]).expect_err("another mesh");
    assert!(matches!(error, GpuError::Embedding(_)), "{error}");
    assert!(error.to_string().contains("tetrahedron vertices"), "{error}");

    // As many vertices, but in tetrahedra of another order.
    let mesh = &bodies.tets[0];
    let turned: Vec<_> = mesh.tets().iter().rev().copied().collect();
    let (other, _) = TetMesh::new(mesh.vertices().to_vec(), turned, mesh.regions().to_vec())
        .expect("the same bar");
    let embedding = Embedding::new(&other, &bodies.surfaces[0]).expect("a bound surface");
    let stale = Skin { embedding: &embedding, ..bar };
    let error = GpuSurface::new(&solver, &model, &[stale, ball]).expect_err("another mesh");
    assert!(matches!(error, GpuError::Embedding(_)), "{error}");
    assert!(error.to_string().contains("follows a tetrahedron"), "{error}");

    let count = bodies.surfaces[0].vertices.len() as u32;
    let mut triangles = bodies.surfaces[0].triangles.clone();
    triangles.push([0, 1, count]);
    let skins = [Skin { triangles: &triangles, ..bar }, ball];
    let surface = GpuSurface::new(&solver, &model, &skins).expect("it fits");
    let all = bodies.surfaces.iter().map(|surface| surface.triangles.len()).sum::<usize>();
    assert_eq!(surface.index_count() as usize, 3 * all);
    let empty = GpuSurface::new(&solver, &model, &[]).expect("nothing fits everywhere");
    empty.update();
    assert_eq!(empty.read().expect("a device"), [vec![], vec![]]);
}

/// Pixels of a picture of the ball alone, seen along z: 0.12 m wide and high.
const PIXELS: u32 = 64;

const PICTURE: &str = "
@vertex
fn place(@location(0) position: vec4f) -> @builtin(position) vec4f {
    return vec4f(position.xy / 0.06, 0.5, 1.0);
}

@fragment
fn color() -> @location(0) vec4f {
    return vec4f(1.0, 1.0, 1.0, 1.0);
}
";

/// A device that the caller opened draws straight from the surface's buffers.
#[test]
fn a_window_s_own_device_draws_the_surface() {
    // As a window would: its own instance, adapter and device.
    let opened = device::own_device();
    let (wgpu, queue) = opened.wgpu();
    let device = Device::from_wgpu(wgpu.clone(), queue.clone(), "the window's".into());
    let bodies = bodies();
    let model = bodies.model::<f32>();
    let solver = GpuSolver::new(&device, &model, &settings()).expect("a model that fits");
    let ball = bodies.skins(&model)[1];
    let surface = GpuSurface::new(&solver, &model, &[ball]).expect("it fits");
    let covered = draw(wgpu, queue, &surface);
    let pixel = 0.12 / f64::from(PIXELS);
    let expected = std::f64::consts::PI * (RADIUS / pixel).powi(2);
    println!("{covered} pixels of {expected:.0}");
    // The rim runs through 2 pi r pixels, half of which may be missed by a quarter of a pixel; the surface's
    // triangles of 12 mm fall short of the sphere by h^2/8 r.
    let rim = 2.0 * std::f64::consts::PI * RADIUS / pixel;
    let short = 0.012f64.powi(2) / (8.0 * RADIUS) / pixel;
    let difference = (f64::from(covered) - expected).abs();
    assert!(difference < rim * (0.125 + 1.5 * short), "{covered} pixels of {expected:.0}");
}

fn draw(wgpu: &wgpu::Device, queue: &wgpu::Queue, surface: &GpuSurface) -> u32 {
    let format = wgpu::TextureFormat::Rgba8Unorm;
    let size = wgpu::Extent3d { width: PIXELS, height: PIXELS, depth_or_array_layers: 1 };
    let texture = wgpu.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let module = wgpu.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(PICTURE.into()),
    });
    let pipeline = wgpu.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: None,
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("place"),
            compilation_options: Default::default(),
            buffers: &[Some(GpuSurface::vertex_layout())],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("color"),
            compilation_options: Default::default(),
            targets: &[Some(format.into())],
        }),
        multiview_mask: None,
        cache: None,
    });
    let mut encoder = wgpu.create_command_encoder(&Default::default());
    surface.record(&mut encoder);
    {
        let view = texture.create_view(&Default::default());
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations::default(),
            })],
            ..Default::default()
        });
        pass.set_pipeline(&pipeline);
        pass.set_vertex_buffer(0, surface.vertices().slice(..));
        pass.set_index_buffer(surface.indices().slice(..), wgpu::IndexFormat::Uint32);
        pass.draw_indexed(0..surface.index_count(), 0, 0..1);
    }
    let bytes_per_row = 4 * PIXELS;
    let read = wgpu.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: u64::from(bytes_per_row * PIXELS),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let layout = wgpu::TexelCopyBufferLayout {
        offset: 0,
        bytes_per_row: Some(bytes_per_row),
        rows_per_image: None,
    };
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo { buffer: &read, layout },
        size,
    );
    queue.submit([encoder.finish()]);
    read.map_async(wgpu::MapMode::Read, .., |result| result.expect("a picture"));
    wgpu.poll(wgpu::PollType::wait_indefinitely()).expect("the device finishes");
    let bytes = read.get_mapped_range(..).expect("a picture");
    bytes.chunks(4).filter(|pixel| pixel[0] > 127).count() as u32
}
