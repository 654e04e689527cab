//! Tissue drawn from the solver's own buffers.

mod common;

use common::{Ball, RADIUS, brightness, device, difference, pixel, tissue};
use viscera::material::{Material, MaterialModel};
use viscera::mesh::embed::Embedding;
use viscera::mesh::shapes::sphere;
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::{Vec3, vec3};
use viscera::settings::SolverSettings;
use viscera::solver::gpu::{GpuSolver, GpuSurface, Skin};
use viscera::solver::{Inputs, Pin};
use viscera_picture::{Color, ImageSize, map_color};
use viscera_render::{
    Arrow, BodyView, BoundingSphere, Canvas, GpuDrawing, Markers, Paint, Quality, RenderError,
    ScaledValues, ValueBuffer,
};

#[test]
fn a_ball_is_a_disc_of_its_size_and_two_pictures_are_the_same() {
    let ball = Ball::new(&device());
    for quality in [Quality::plain(), Quality::fine()] {
        let canvas = ball.canvas([200, 150], quality);
        let drawing = ball.drawing();
        let image = ball.picture(&canvas, &drawing);
        // A ball of radius r at distance d covers a disc of radius r / sqrt(d^2 - r^2) as a tangent; the
        // half height of 75 pixels is a tangent of 0.24.
        let d = drawing.orbit.distance;
        let pixels = 75.0 / 0.24 * RADIUS / (d * d - RADIUS * RADIUS).sqrt();
        let share = tissue(&image) as f64 / (std::f64::consts::PI * pixels * pixels);
        assert!((0.9..1.02).contains(&share), "{share} of the disc");
        // The middle is tissue, the corners are not.
        let ([r, _, b], [s, _, c]) = (pixel(&image, [100, 75]), pixel(&image, [0, 0]));
        assert!(r > b && c >= s);
        assert_eq!(ball.picture(&canvas, &drawing), image);
        assert_eq!(tissue(&ball.picture(&canvas, &GpuDrawing::from(ball.orbit))), 0);
    }
}

#[test]
fn another_size_shows_the_same() {
    let ball = Ball::new(&device());
    let mut canvas = ball.canvas([200, 150], Quality::plain());
    let image = ball.picture(&canvas, &ball.drawing());
    canvas.resize(ImageSize::new(100, 80).expect("a size")).expect("a smaller one");
    assert_eq!(ball.picture(&canvas, &ball.drawing()).size().width(), 100);
    canvas.resize(ImageSize::new(200, 150).expect("a size")).expect("the first one");
    assert_eq!(ball.picture(&canvas, &ball.drawing()), image);
}

#[test]
fn smooth_edges_mix_tissue_and_background() {
    let ball = Ball::new(&device());
    let both = [Quality::plain(), Quality { smooth_edges: true, ..Quality::plain() }];
    let [rough, smooth] =
        both.map(|quality| ball.picture(&ball.canvas([200, 150], quality), &ball.drawing()));
    // Only the rim differs: at most a ring two pixels wide around a disc of 75 pixels' radius.
    let changed = difference(&rough, &smooth).len();
    assert!((100..950).contains(&changed), "{changed} pixels");
}

#[test]
fn values_take_the_colours_of_the_scale_and_none_is_grey() {
    let device = device();
    let ball = Ball::new(&device);
    let canvas = ball.canvas([160, 120], Quality::plain());
    let buffer = ValueBuffer::new(&device, ball.count);
    let middle = |value: f32, [low, high]: [f32; 2]| {
        buffer.write(&vec![value; ball.count]).expect("one for each");
        let paint = Paint::Values(ScaledValues { buffer: &buffer, low, high });
        let bodies = vec![BodyView { paint, ..BodyView::of(&ball.surface) }];
        let image = ball.picture(&canvas, &GpuDrawing { bodies, ..ball.drawing() });
        let [r, g, b] = pixel(&image, [80, 60]).map(|c| Color::from_srgb([c; 3]).r);
        Color::new(r, g, b)
    };
    // Light scales all channels alike, to between half and all of the colour; 8 bits leave 0.02.
    let matches = |found: Color, wanted: Color| {
        let light = (found.r + found.g + found.b) / (wanted.r + wanted.g + wanted.b);
        let near = |a: f32, b: f32| (a - light * b).abs() < 0.02;
        assert!((0.5..=1.01).contains(&light), "{found:?} for {wanted:?}");
        let all = near(found.r, wanted.r) && near(found.g, wanted.g) && near(found.b, wanted.b);
        assert!(all, "{found:?} for {wanted:?}");
    };
    let range = [2.0, 6.0];
    for (value, share) in [(2.0, 0.0), (4.0, 0.5), (6.0, 1.0), (-1.0, 0.0), (f32::INFINITY, 1.0)] {
        matches(middle(value, range), map_color(share));
    }
    matches(middle(f32::NAN, range), Color::MISSING);
    // A scale without a span is all first colour.
    matches(middle(3.0, [3.0, 3.0]), map_color(0.0));

    let error = buffer.write(&[1.0]).expect_err("too few");
    assert!(matches!(error, RenderError::ValueCount { found: 1, .. }), "{error}");
    let short = ValueBuffer::new(&device, 3);
    let paint = Paint::Values(ScaledValues { buffer: &short, low: 0.0, high: 1.0 });
    let bodies = vec![BodyView { paint, ..BodyView::of(&ball.surface) }];
    let error = canvas.draw(&GpuDrawing { bodies, ..ball.drawing() }).expect_err("too few");
    assert!(matches!(error, RenderError::ValueCount { found: 3, .. }), "{error}");
}

#[test]
fn parts_of_a_surface_have_colours_of_their_own() {
    let ball = Ball::new(&device());
    let canvas = ball.canvas([160, 120], Quality::plain());
    let all = BodyView::of(&ball.surface);
    let parts = |color| {
        let [first, end] = all.triangles;
        let middle = (first + end) / 2;
        let rest = BodyView { triangles: [middle, end], paint: Paint::Flat(color), ..all };
        let bodies = vec![BodyView { triangles: [first, middle], ..all }, rest];
        ball.picture(&canvas, &GpuDrawing { bodies, ..ball.drawing() })
    };
    // Two halves in one colour are the whole.
    assert_eq!(parts(Color::TISSUE), ball.picture(&canvas, &ball.drawing()));
    let halves = parts(Color::from_srgb([60, 160, 60]));
    let green = halves.pixels().iter().filter(|p| p[1] > p[0].saturating_add(15)).count();
    let red = tissue(&halves);
    assert!(green > 200 && red > 200, "{green} and {red} pixels");
}

#[test]
fn a_marker_is_seen_before_tissue_and_behind_it_where_it_shines_through() {
    let ball = Ball::new(&device());
    let canvas = ball.canvas([160, 120], Quality::plain());
    let without = ball.picture(&canvas, &ball.drawing());
    let [_, _, backward] = ball.orbit.axes();
    let with_see_through = |position: Vec3<f64>, see_through: f32| {
        let (positions, color) = (&[position], Color::FIXED);
        let markers = vec![Markers { positions, radius: 0.003, color, see_through }];
        ball.picture(&canvas, &GpuDrawing { markers, ..ball.drawing() })
    };
    let with = |position| with_see_through(position, 0.0);
    let changed = difference(&without, &with(backward * (1.1 * RADIUS)));
    assert!(changed.contains(&[80, 60]), "{changed:?}");
    // A disc of radius 60 / 0.24 * 0.003 / (d - 1.1 r) pixels.
    let pixels = 60.0 / 0.24 * 0.003 / (ball.orbit.distance - 1.1 * RADIUS);
    let share = changed.len() as f64 / (std::f64::consts::PI * pixels * pixels);
    assert!((0.6..1.3).contains(&share), "{} pixels, {share} of the disc", changed.len());
    let behind = backward * (-1.1 * RADIUS);
    assert_eq!(with(behind), without);
    assert_eq!(with_see_through(behind, f32::NAN), without);
    let weak = difference(&without, &with_see_through(behind, 0.5));
    assert!(weak.contains(&[80, 60]) && weak.len() < changed.len(), "{weak:?}");
    assert_eq!(with(vec3(f64::NAN, 0.0, 0.0)), without);
}

#[test]
fn an_arrow_is_full_before_tissue_and_paler_behind_it() {
    let ball = Ball::new(&device());
    let canvas = ball.canvas([400, 300], Quality::plain());
    let without = ball.picture(&canvas, &ball.drawing());
    let [right, _, backward] = ball.orbit.axes();
    let with = |depth: f64| {
        let (from, to) = (backward * depth - right * 0.02, backward * depth + right * 0.02);
        let arrows = vec![Arrow { from, to, radius: 0.002, color: Color::PULLED }];
        ball.picture(&canvas, &GpuDrawing { arrows, ..ball.drawing() })
    };
    let [before, behind] = [1.1 * RADIUS, -1.1 * RADIUS].map(with);
    let [seen, hidden] = [&before, &behind].map(|image| difference(&without, image).len());
    // Farther away it is smaller; pixels at its rim leave a tenth.
    let d = ball.orbit.distance;
    let shrunk = ((d - 1.1 * RADIUS) / (d + 1.1 * RADIUS)).powi(2);
    let share = hidden as f64 / seen as f64;
    assert!((share / shrunk - 1.0).abs() < 0.1, "{hidden} of {seen} pixels, not {shrunk}");
    let change =
        |image| i32::from(pixel(image, [200, 150])[1]) - i32::from(pixel(&without, [200, 150])[1]);
    // Two fifths of the colour come through, a little whiter.
    let share = f64::from(change(&behind)) / f64::from(change(&before));
    assert!((0.2..0.7).contains(&share), "{share} of the colour");
}

#[test]
fn a_wireframe_darkens_lines_of_the_nearer_side() {
    let ball = Ball::new(&device());
    let canvas = ball.canvas([200, 150], Quality::plain());
    let without = ball.picture(&canvas, &ball.drawing());
    let bodies = vec![BodyView { wireframe: true, ..BodyView::of(&ball.surface) }];
    let with = ball.picture(&canvas, &GpuDrawing { bodies, ..ball.drawing() });
    let changed = difference(&without, &with);
    let share = changed.len() as f64 / tissue(&without) as f64;
    assert!((0.05..0.8).contains(&share), "{share} of the tissue");
    let darker =
        |place: &[usize; 2]| brightness(pixel(&with, *place)) < brightness(pixel(&without, *place));
    assert!(changed.iter().all(darker));
}

#[test]
fn a_ghost_lets_through_what_is_behind_it_and_shows_one_layer() {
    let ball = Ball::new(&device());
    let canvas = ball.canvas([160, 120], Quality::plain());
    let middle = |opacity: f32, bodies: usize| {
        let paint = Paint::Flat(Color::REST);
        let ghost = BodyView { paint, opacity, ..BodyView::of(&ball.surface) };
        let drawing = GpuDrawing { bodies: vec![ghost; bodies], ..ball.drawing() };
        brightness(pixel(&ball.picture(&canvas, &drawing), [80, 60]))
    };
    let empty = middle(1.0, 0);
    let [none, thin, thick, solid] = [0.0, 0.3, 0.8, 1.0].map(|opacity| middle(opacity, 1));
    assert!(empty == none && none > thin && thin > thick && thick > solid);
    // One layer of clear glass: 0.35 of the opacity where one looks straight at it, at most a tenth
    // more for a facet's tilt; front and back together would be twice that.
    let share = f64::from(empty - thin) / f64::from(empty - solid);
    assert!((0.06..0.16).contains(&share), "{share}");
}

#[test]
fn a_ghost_of_tissue_where_that_is_is_not_seen() {
    let ball = Ball::new(&device());
    let canvas = ball.canvas([200, 150], Quality::plain());
    let solid = ball.picture(&canvas, &ball.drawing());
    let ghost =
        BodyView { paint: Paint::Flat(Color::REST), opacity: 0.5, ..BodyView::of(&ball.surface) };
    let bodies = vec![BodyView::of(&ball.surface), ghost];
    let both = ball.picture(&canvas, &GpuDrawing { bodies, ..ball.drawing() });
    // Round-off may move the rim by some pixels.
    let changed = difference(&solid, &both).len();
    assert!(changed < 20, "{changed} pixels");
}

#[test]
fn a_shadow_darkens_and_never_brightens() {
    let ball = Ball::new(&device());
    let [right, up, backward] = ball.orbit.axes();
    // A small ball between the key light and the large one.
    let key = right * -0.45 + up * 0.65 + backward * 0.6;
    let small = ball.copy(0.25, key * (1.8 * RADIUS / key.length()));
    let canvas = ball.canvas([200, 150], Quality { shadow: Some(512), ..Quality::plain() });
    let with = |sphere: Option<BoundingSphere>| {
        let bodies = [&ball.surface, &small].map(BodyView::of).to_vec();
        ball.picture(&canvas, &GpuDrawing { bodies, shadow: sphere, ..ball.drawing() })
    };
    let light = with(None);
    let dark = with(Some(BoundingSphere { center: Vec3::ZERO, radius: 3.0 * RADIUS }));
    let changed = difference(&light, &dark);
    assert!(changed.len() > 200, "{} pixels in the shadow", changed.len());
    let brighter =
        |place: &[usize; 2]| brightness(pixel(&dark, *place)) > brightness(pixel(&light, *place));
    assert!(!changed.iter().any(brighter));
    // Alone, the large ball is as bright where the light falls on it: it throws no spots on itself.
    let alone = |shadow| ball.picture(&canvas, &GpuDrawing { shadow, ..ball.drawing() });
    let sphere = BoundingSphere { center: Vec3::ZERO, radius: 1.5 * RADIUS };
    let spots = difference(&alone(None), &alone(Some(sphere)));
    let towards_light = |&&[x, y]: &&[usize; 2]| x < 100 && y < 75;
    assert_eq!(spots.iter().filter(towards_light).count(), 0);
}

#[test]
fn a_moved_body_is_drawn_where_the_last_step_has_brought_it() {
    let device = device();
    let shape = sphere(RADIUS, 0.02).expect("a ball");
    let tissue_of =
        Material::new(MaterialModel::StableNeoHookean, 5e3, 0.4, 1000.0).expect("a tissue");
    let settings = SolverSettings::xpbd();
    let mut builder = ModelBuilder::new();
    builder.add_body(&shape.tets, &tissue_of).expect("a body");
    let model: Model<f32> = builder.build().expect("a model");
    let mut solver = GpuSolver::new(&device, &model, &settings).expect("a model that fits");
    let embedding = Embedding::new(&shape.tets, &shape.surface).expect("a bound surface");
    let triangles = &shape.surface.triangles;
    let skin = Skin { embedding: &embedding, triangles, first_vertex: 0 };
    let surface = GpuSurface::new(&solver, &model, &[skin]).expect("a surface that fits");
    surface.update();

    let ball = Ball::new(&device);
    let canvas = ball.canvas([160, 120], Quality::plain());
    let drawing = GpuDrawing { bodies: vec![BodyView::of(&surface)], ..ball.drawing() };
    let before = ball.picture(&canvas, &drawing);
    // All vertices far to the side: nothing is left in the picture.
    let away = vec3(10.0f32, 0.0, 0.0);
    let pin = |(vertex, x): (u32, &Vec3<f32>)| Pin { vertex, target: *x + away };
    let pins = (0..).zip(&model.rest_positions).map(pin).collect();
    let inputs = Inputs { pins, ..Inputs::default() };
    solver.step(&model, &inputs, 1.0 / 60.0).expect("a legal step");
    surface.update();
    let after = ball.picture(&canvas, &drawing);
    assert!(tissue(&before) > 1000);
    assert_eq!(tissue(&after), 0);
}

#[test]
fn a_picture_beyond_the_devices_textures_is_refused() {
    let device = common::small_device();
    let most = device.limits().max_texture_dimension_2d;
    let size = ImageSize::new(most + 1, 100).expect("a size");
    let error = Canvas::new(&device, size, Quality::plain()).expect_err("too large");
    assert!(matches!(error, RenderError::TooLarge { .. }), "{error}");
    let small = ImageSize::new(100, 100).expect("a size");
    let mut canvas = Canvas::new(&device, small, Quality::plain()).expect("a target");
    canvas.resize(size).expect_err("too large");
    assert_eq!(canvas.size(), small);
}
