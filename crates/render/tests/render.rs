//! Tissue drawn from the solver's own buffers.

use viscera::material::{Material, MaterialModel};
use viscera::mesh::embed::Embedding;
use viscera::mesh::shapes::sphere;
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::{Vec3, vec3};
use viscera::settings::SolverSettings;
use viscera::solver::gpu::{Adapter, Device, GpuSolver, GpuSurface, Skin};
use viscera::solver::{Inputs, Pin};
use viscera_picture::{Color, Image, ImageSize};
use viscera_render::{Look, Offscreen, Orbit, RenderError};

/// The first device there is; without any the test fails and says what to install.
fn device() -> Device {
    let adapter = Adapter::find(None).unwrap_or_else(|error| panic!("{error}"));
    adapter.open().unwrap_or_else(|error| panic!("{error}"))
}

struct Ball {
    model: Model<f32>,
    solver: GpuSolver,
    surface: GpuSurface,
    positions: Vec<Vec3<f64>>,
}

fn ball(device: &Device) -> Ball {
    let shape = sphere(0.05, 0.02).expect("a ball");
    let tissue =
        Material::new(MaterialModel::StableNeoHookean, 5e3, 0.4, 1000.0).expect("a tissue");
    let settings = SolverSettings::default();
    let mut builder = ModelBuilder::new();
    builder.add_body(&shape.tets, &tissue).expect("a body");
    let model: Model<f32> = builder.build(&settings).expect("a model");
    let solver = GpuSolver::new(device, &model, &settings).expect("a model that fits");
    let embedding = Embedding::new(&shape.tets, &shape.surface).expect("a bound surface");
    let triangles = &shape.surface.triangles;
    let skin = Skin { embedding: &embedding, triangles, first_vertex: 0 };
    let surface = GpuSurface::new(&solver, &model, &[skin]).expect("a surface that fits");
    surface.update();
    Ball { model, solver, surface, positions: shape.surface.vertices }
}

fn look(ball: &Ball) -> Look {
    Look { orbit: Orbit::framing(&ball.positions), aspect: 1.0, color: Color::TISSUE }
}

/// How many pixels are redder than blue: tissue, not background.
fn tissue(image: &Image) -> usize {
    image.pixels().iter().filter(|[r, _, b]| *r > b.saturating_add(20)).count()
}

#[test]
fn a_ball_is_a_disc_of_its_size_and_two_pictures_are_the_same() {
    let device = device();
    let ball = ball(&device);
    let size = ImageSize::new(200, 150).expect("a size");
    let offscreen = Offscreen::new(&device, size).expect("a target");
    let look = look(&ball);
    let image = offscreen.draw(&look, &[&ball.surface]).expect("a picture");
    // A ball of radius r at distance d covers a disc of radius r / sqrt(d^2 - r^2) as a tangent; the
    // half height of 75 pixels is a tangent of 0.24.
    let radius = ball.positions.iter().map(|x| x.length()).fold(0.0, f64::max);
    let d = look.orbit.distance;
    let pixels = 75.0 / 0.24 * radius / (d * d - radius * radius).sqrt();
    let disc = std::f64::consts::PI * pixels * pixels;
    let share = tissue(&image) as f64 / disc;
    assert!((0.9..1.02).contains(&share), "{share} of the disc");
    // The middle is tissue, the corners are not.
    let at = |x: usize, y: usize| image.pixels()[y * 200 + x];
    assert!(at(100, 75)[0] > at(100, 75)[2] && at(0, 0)[2] >= at(0, 0)[0]);
    assert_eq!(offscreen.draw(&look, &[&ball.surface]).expect("a picture"), image);
    let empty = offscreen.draw(&look, &[]).expect("a picture");
    assert_eq!(tissue(&empty), 0);
}

#[test]
fn a_moved_body_is_drawn_where_the_last_step_has_brought_it() {
    let device = device();
    let mut ball = ball(&device);
    let size = ImageSize::new(160, 120).expect("a size");
    let offscreen = Offscreen::new(&device, size).expect("a target");
    let look = look(&ball);
    let before = offscreen.draw(&look, &[&ball.surface]).expect("a picture");
    // All vertices far to the side: nothing is left in the picture.
    let away = vec3(10.0f32, 0.0, 0.0);
    let rest = &ball.model.rest_positions;
    let pin = |(vertex, x): (u32, &Vec3<f32>)| Pin { vertex, target: *x + away };
    let pins = (0..).zip(rest).map(pin).collect();
    let inputs = Inputs { pins, ..Inputs::default() };
    ball.solver.step(&ball.model, &inputs, 1.0 / 60.0).expect("a legal step");
    ball.surface.update();
    let after = offscreen.draw(&look, &[&ball.surface]).expect("a picture");
    assert!(tissue(&before) > 1000);
    assert_eq!(tissue(&after), 0);
}

#[test]
fn a_picture_beyond_the_devices_textures_is_refused() {
    let device = device();
    let most = device.limits().max_texture_dimension_2d;
    let Ok(size) = ImageSize::new(most + 1, 100) else { return };
    let error = Offscreen::new(&device, size).expect_err("too large");
    assert!(matches!(error, RenderError::TooLarge { .. }), "{error}");
}
