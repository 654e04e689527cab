//! Facts about pictures that must hold whatever the style.

use viscera::mesh::SurfaceMesh;
use viscera::scalar::{Vec3, vec3};
use viscera_picture::{
    Animation, Arrow, Bounds, Camera, Color, ColorScale, Drawing, Image, ImageSize, Line, Markers,
    Outline, Paint, PictureError, Surface, ViewDirection, write_png,
};

const RADIUS: f64 = 0.05;

/// A sphere of latitude rings and longitude sides, wound outwards.
fn sphere(center: Vec3<f64>, rings: u32) -> SurfaceMesh {
    let sides = 2 * rings;
    let mut mesh = SurfaceMesh::default();
    for ring in 0..=rings {
        for side in 0..sides {
            let (polar, azimuth) = (
                std::f64::consts::PI * f64::from(ring) / f64::from(rings),
                std::f64::consts::TAU * f64::from(side) / f64::from(sides),
            );
            let n = vec3(polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos());
            mesh.vertices.push(center + n * RADIUS);
        }
    }
    for ring in 0..rings {
        for side in 0..sides {
            let at = |r: u32, s: u32| r * sides + s % sides;
            let (a, b) = (at(ring, side), at(ring, side + 1));
            let (c, d) = (at(ring + 1, side), at(ring + 1, side + 1));
            mesh.triangles.extend([[a, c, b], [b, c, d]]);
        }
    }
    mesh
}

fn size(width: u32, height: u32) -> ImageSize {
    ImageSize::new(width, height).unwrap()
}

fn flat(mesh: &SurfaceMesh, color: Color) -> Surface<'_> {
    Surface { positions: &mesh.vertices, triangles: &mesh.triangles, paint: Paint::Flat(color) }
}

/// Pixels that differ from the picture of nothing.
fn covered(image: &Image, camera: &Camera) -> usize {
    let empty = Drawing::default().draw(camera).unwrap().image;
    image.pixels().iter().zip(empty.pixels()).filter(|p| p.0 != p.1).count()
}

#[test]
fn sphere_covers_the_disc_that_perspective_gives_it() {
    let mesh = sphere(vec3(0.3, -0.2, 0.1), 60);
    let camera =
        Camera::framing(&Bounds::of(&mesh.vertices), ViewDirection::default(), size(400, 300));
    let drawing = Drawing { surfaces: vec![flat(&mesh, Color::TISSUE)], ..Drawing::default() };
    let image = drawing.draw(&camera).unwrap().image;
    let away = (camera.position() - vec3(0.3, -0.2, 0.1)).length();
    let (_, focal) = camera.center_and_focal_length();
    // A sphere at distance d fills a cone of sine r / d.
    let radius = focal * RADIUS / (away * away - RADIUS * RADIUS).sqrt();
    let expected = std::f64::consts::PI * radius * radius;
    // Pixels that are touched count whole: at most one pixel all around; the mesh is inscribed, so
    // at most its sagitta is missing.
    let band = std::f64::consts::TAU * radius;
    let error = covered(&image, &camera) as f64 - expected;
    assert!(error > -0.1 * band && error < 1.0 * band, "{error} of {expected}, band {band}");
}

#[test]
fn nearer_shape_hides_the_farther_in_any_order() {
    let near = sphere(vec3(0.0, -0.15, 0.0), 24);
    let far = sphere(vec3(0.0, 0.15, 0.0), 24);
    let mut bounds = Bounds::of(&near.vertices);
    bounds.include(&far.vertices);
    let front = ViewDirection { azimuth: -90.0, elevation: 0.0 };
    let camera = Camera::framing(&bounds, front, size(200, 200));
    let (green, red) = (Color::new(0.0, 0.5, 0.0), Color::new(0.5, 0.0, 0.0));
    let middle = |surfaces| {
        let image = Drawing { surfaces, ..Drawing::default() }.draw(&camera).unwrap().image;
        let ([x, y], _) = camera.center_and_focal_length();
        image.pixels()[y as usize * 200 + x as usize]
    };
    let one = middle(vec![flat(&near, green), flat(&far, red)]);
    let other = middle(vec![flat(&far, red), flat(&near, green)]);
    assert_eq!(one, other);
    assert!(one[1] > 100 && one[0] < 60, "{one:?} is not green");
}

#[test]
fn everything_framed_is_inside_the_picture() {
    let mesh = sphere(vec3(5.0, 5.0, 5.0), 30);
    for azimuth in [-170.0, -65.0, 0.0, 30.0, 100.0] {
        for elevation in [-95.0, -30.0, 0.0, 22.0, 90.0] {
            let direction = ViewDirection { azimuth, elevation };
            let camera = Camera::framing(&Bounds::of(&mesh.vertices), direction, size(320, 200));
            let drawing =
                Drawing { surfaces: vec![flat(&mesh, Color::TISSUE)], ..Drawing::default() };
            let image = drawing.draw(&camera).unwrap().image;
            let empty = Drawing::default().draw(&camera).unwrap().image;
            for (i, (pixel, behind)) in image.pixels().iter().zip(empty.pixels()).enumerate() {
                let (x, y) = (i % 320, i / 320);
                if x == 0 || y == 0 || x == 319 || y == 199 {
                    assert_eq!(pixel, behind, "{direction:?}");
                }
            }
            assert!(covered(&image, &camera) > 5_000, "{direction:?}");
        }
    }
}

#[test]
fn larger_values_are_darker() {
    let near = sphere(vec3(0.0, 0.0, 0.0), 30);
    let camera =
        Camera::framing(&Bounds::of(&near.vertices), ViewDirection::default(), size(128, 128));
    let brightness = |value: f64| {
        let values = vec![value; near.vertices.len()];
        let surface = Surface { paint: Paint::Values(&values), ..flat(&near, Color::TISSUE) };
        let color_scale = Some(ColorScale::new("", 0.0, 1.0).unwrap());
        let drawing = Drawing { surfaces: vec![surface], color_scale, ..Drawing::default() };
        let image = drawing.draw(&camera).unwrap().image;
        image.pixels().as_flattened().iter().map(|&c| u64::from(c)).sum::<u64>()
    };
    let steps: Vec<u64> = (0..=8).map(|k| brightness(f64::from(k) / 8.0)).collect();
    assert!(steps.windows(2).all(|pair| pair[1] < pair[0]), "{steps:?}");
}

/// A picture with one of everything.
fn full(camera: &Camera, shift: f64) -> Image {
    let rest = sphere(Vec3::ZERO, 20);
    let moved: Vec<_> = rest.vertices.iter().map(|&p| p + vec3(shift * p.z, 0.0, 0.0)).collect();
    let values: Vec<_> = moved.iter().zip(&rest.vertices).map(|p| (*p.0 - *p.1).length()).collect();
    let drawing = Drawing {
        title: "Everything",
        caption: "t = 0.50 s",
        surfaces: vec![Surface {
            positions: &moved,
            triangles: &rest.triangles,
            paint: Paint::Values(&values),
        }],
        outlines: vec![Outline {
            positions: &rest.vertices,
            triangles: &rest.triangles,
            color: Color::REST,
        }],
        markers: vec![Markers {
            positions: &rest.vertices[..9],
            radius: 0.002,
            color: Color::FIXED,
            see_through: 0.2,
        }],
        arrows: vec![Arrow {
            from: Vec3::ZERO,
            to: vec3(0.0, 0.0, 0.08),
            radius: 0.002,
            color: Color::PULLED,
        }],
        lines: vec![Line {
            from: Vec3::ZERO,
            to: vec3(0.08, 0.0, 0.0),
            width: 2.0,
            color: Color::PULLED,
        }],
        color_scale: Some(ColorScale::rounded("displacement [m]", 0.0, 0.03).unwrap()),
        length_scale: true,
        ..Drawing::default()
    };
    let drawn = drawing.draw(camera).unwrap();
    assert_eq!(drawn.skipped, 0);
    drawn.image
}

fn camera_for_everything() -> Camera {
    let bounds = Bounds::of(&[Vec3::splat(-0.08), Vec3::splat(0.08)]);
    Camera::framing(&bounds, ViewDirection::default(), size(320, 200))
}

#[test]
fn same_drawing_gives_the_same_bytes() {
    let camera = camera_for_everything();
    assert_eq!(full(&camera, 0.5), full(&camera, 0.5));
    assert_ne!(full(&camera, 0.5), full(&camera, 0.4));
}

#[test]
fn an_outline_traced_before_is_drawn_alike() {
    let camera = camera_for_everything();
    let rest = sphere(Vec3::ZERO, 20);
    let mut open = rest.clone();
    open.triangles.truncate(rest.triangles.len() / 2);
    let positions: Vec<_> = rest.vertices.iter().map(|&p| p + vec3(0.02, 0.0, 0.01)).collect();
    let surfaces = vec![Surface { positions: &positions, ..flat(&rest, Color::TISSUE) }];
    let outline =
        Outline { positions: &open.vertices, triangles: &open.triangles, color: Color::REST };
    let drawing = Drawing { surfaces, ..Drawing::default() };
    let plain = drawing.draw(&camera).unwrap();
    let at_once = Drawing { outlines: vec![outline], ..drawing.clone() }.draw(&camera).unwrap();
    let traced = outline.trace(&camera).unwrap();
    let drawing = Drawing { traced: vec![&traced], ..drawing };
    assert!(drawing.draw(&camera).unwrap() == at_once && at_once != plain);
    // By another camera it is another outline.
    let bounds = Bounds::of(&[Vec3::splat(-0.08), Vec3::splat(0.08)]);
    let other = Camera::framing(&bounds, ViewDirection::default(), size(160, 100));
    assert_eq!(drawing.draw(&other).unwrap().skipped, 1);
}

#[test]
fn png_holds_every_pixel() {
    let image = full(&camera_for_everything(), 0.5);
    let bytes = write_png(&image).unwrap();
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!((info.width, info.height), (320, 200));
    assert_eq!(pixels, image.pixels().as_flattened());
}

#[test]
fn gif_shows_every_frame_nearly_as_drawn() {
    let camera = camera_for_everything();
    let frames: Vec<_> = (0..4).map(|k| full(&camera, 0.2 * f64::from(k))).collect();
    assert_shown_nearly_as_drawn(&frames, Animation::new(camera.size()).unwrap());
    // One palette for all, from two of them.
    let samples = [frames[1].clone(), frames[3].clone()];
    let animation = Animation::in_colors_of(&samples, camera.size()).unwrap();
    assert_shown_nearly_as_drawn(&frames, animation);
}

fn assert_shown_nearly_as_drawn(frames: &[Image], mut animation: Animation) {
    for (k, frame) in frames.iter().enumerate() {
        animation.push(frame, k as f64 / 30.0).unwrap();
    }
    let bytes = animation.finish(1.0).unwrap();

    let mut options = gif::DecodeOptions::new();
    options.set_color_output(gif::ColorOutput::RGBA);
    let mut decoder = options.read_info(std::io::Cursor::new(bytes)).unwrap();
    let mut canvas = vec![[0u8; 3]; 320 * 200];
    let mut delays = Vec::new();
    while let Some(part) = decoder.read_next_frame().unwrap() {
        for (i, pixel) in part.buffer.chunks_exact(4).enumerate() {
            let (x, y) = (i % usize::from(part.width), i / usize::from(part.width));
            if pixel[3] > 0 {
                let place = (y + usize::from(part.top)) * 320 + x + usize::from(part.left);
                canvas[place] = [pixel[0], pixel[1], pixel[2]];
            }
        }
        let frame = &frames[delays.len()];
        let pairs = frame.pixels().as_flattened().iter().zip(canvas.as_flattened());
        let error =
            pairs.map(|p| f64::from(p.0.abs_diff(*p.1))).sum::<f64>() / (3.0 * 320.0 * 200.0);
        // On average below the three levels that count as unchanged.
        assert!(error < 3.0, "frame {}: {error}", delays.len());
        delays.push(part.delay);
    }
    // Thirty frames a second do not divide into hundredths: the rest is carried on.
    assert_eq!(delays, [3, 4, 3, 100]);
}

/// Two hundred reds fill the pictures, and blues are few: both are shown as what they are. A colour that is rare over
/// the film is not given up for steps that nobody sees between the frequent ones.
#[test]
fn a_film_of_two_colors_far_apart_keeps_both() {
    let size = size(160, 100);
    let picture = |frame: usize| {
        let pixel = |i: usize| match i % 50 {
            // Another blue for every pixel, in one of fifty of them.
            7 => [(i / 50 % 16) as u8, 40 + (i / 800) as u8, 200 + (frame + i / 50 % 50) as u8],
            _ => [150 + (i % 100) as u8, 20 + (i / 100 % 4) as u8, 30],
        };
        Image::from_pixels(size, (0..16_000).map(pixel).collect()).unwrap()
    };
    let film = [0, 1, 2, 3].map(picture);
    let mut animation = Animation::in_colors_of(&film, size).unwrap();
    for (frame, picture) in film.iter().enumerate() {
        animation.push(picture, 0.1 * frame as f64).unwrap();
    }
    let bytes = animation.finish(1.0).unwrap();
    let mut options = gif::DecodeOptions::new();
    options.set_color_output(gif::ColorOutput::RGBA);
    let mut decoder = options.read_info(std::io::Cursor::new(bytes)).unwrap();
    let first = decoder.read_next_frame().unwrap().unwrap();
    let mut worst = [0.0_f64; 2];
    for (i, (shown, drawn)) in first.buffer.chunks_exact(4).zip(film[0].pixels()).enumerate() {
        let error = drawn.iter().zip(shown).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        let kind = usize::from(i % 50 == 7);
        worst[kind] = worst[kind].max(f64::from(error));
    }
    println!("largest error of a channel: reds {}, blues {}", worst[0], worst[1]);
    assert!(worst[0] <= 12.0 && worst[1] <= 12.0, "{worst:?}");
}

/// Frames at these times [s], the last one held for a while [s]: their delays [1/100 s].
fn delays(times: &[f64], held: f64) -> Vec<u16> {
    let mut animation = Animation::new(size(16, 16)).unwrap();
    for (k, time) in times.iter().enumerate() {
        animation.push(&Image::filled(size(16, 16), [k as u8; 3]), *time).unwrap();
    }
    let bytes = animation.finish(held).unwrap();
    let mut decoder = gif::DecodeOptions::new().read_info(std::io::Cursor::new(bytes)).unwrap();
    let mut delays = Vec::new();
    while let Some(frame) = decoder.read_next_frame().unwrap() {
        delays.push(frame.delay);
    }
    delays
}

#[test]
fn an_animation_takes_as_long_as_its_frames_say() {
    // Pictures per second that do not divide into hundredths, more than players can show, and few.
    for (rate, count) in [(30.0, 61), (60.0, 61), (24.0, 25), (240.0, 121), (7.0, 8), (0.7, 3)] {
        let times: Vec<f64> = (0..count).map(|k| 5.0 + f64::from(k) / rate).collect();
        let delays = delays(&times, 0.25);
        let sum = delays.iter().map(|delay| f64::from(*delay) / 100.0).sum::<f64>();
        let wanted = f64::from(count - 1) / rate + 0.25;
        assert!((sum - wanted).abs() <= 0.005 + 1e-9, "{rate}: {sum} s for {wanted} s");
        assert!(delays.iter().all(|delay| *delay >= 2), "{rate}: {delays:?}");
    }
}

#[test]
fn a_motion_that_begins_again_or_has_no_time_goes_on() {
    assert_eq!(delays(&[0.0, 0.1, 0.0, 0.1], 0.3), [10, 4, 10, 30]);
    assert_eq!(delays(&[0.0, f64::NAN, 1.0, -f64::INFINITY], f64::NAN), [4, 4, 4, 2]);
    // A minute of standing still, and more minutes than the format can write.
    assert_eq!(delays(&[0.0, 60.0, 1260.0], 0.0), [6000, 60000, 2]);
    assert!(delays(&[], 1.0).is_empty());
}

#[test]
fn damaged_positions_are_left_out_and_counted() {
    let mut mesh = sphere(Vec3::ZERO, 12);
    let camera =
        Camera::framing(&Bounds::of(&mesh.vertices), ViewDirection::default(), size(64, 64));
    for damage in [f64::NAN, f64::INFINITY, 1e300] {
        mesh.vertices[40].y = damage;
        let expected = mesh.triangles.iter().filter(|t| t.contains(&40)).count();
        let drawing = Drawing { surfaces: vec![flat(&mesh, Color::TISSUE)], ..Drawing::default() };
        let drawn = drawing.draw(&camera).unwrap();
        assert_eq!(drawn.skipped, expected);
        assert!(covered(&drawn.image, &camera) > 500);
        assert_eq!(Bounds::of(&mesh.vertices).corners().map(|c| c.1.y < 0.06), Some(true));
    }
}

#[test]
fn nothing_and_a_single_point_are_drawn_as_such() {
    for positions in [vec![], vec![vec3(1.0, 2.0, 3.0)], vec![Vec3::splat(f64::NAN)]] {
        let camera =
            Camera::framing(&Bounds::of(&positions), ViewDirection::default(), size(320, 200));
        let markers =
            Markers { positions: &positions, radius: 1e-4, color: Color::FIXED, see_through: 0.5 };
        let surface = Surface { positions: &[], triangles: &[], paint: Paint::Flat(Color::TISSUE) };
        let drawing =
            Drawing { surfaces: vec![surface], markers: vec![markers], ..Drawing::default() };
        let drawn = drawing.draw(&camera).unwrap();
        let visible = positions.iter().filter(|p| p.is_finite()).count();
        assert_eq!(drawn.skipped, positions.len() - visible);
        assert_eq!(covered(&drawn.image, &camera) > 0, visible > 0);
    }
}

#[test]
fn impossible_requests_are_errors() {
    for (width, height) in [(0, 0), (0, 100), (100, 15), (5000, 100), (u32::MAX, u32::MAX)] {
        assert!(matches!(ImageSize::new(width, height), Err(PictureError::Size { .. })));
    }
    let camera = camera_for_everything();
    let draw = |surface| Drawing { surfaces: vec![surface], ..Drawing::default() }.draw(&camera);
    let positions = [Vec3::ZERO; 3];
    let error = draw(Surface {
        positions: &positions,
        triangles: &[[0, 1, 3]],
        paint: Paint::Flat(Color::TISSUE),
    });
    assert_eq!(
        error.unwrap_err().to_string(),
        "surface 0: triangle 0 refers to vertex 3; there are 3"
    );
    let values =
        |values| Surface { positions: &positions, triangles: &[], paint: Paint::Values(values) };
    assert!(matches!(draw(values(&[0.0; 2])), Err(PictureError::ValueCount { .. })));
    assert!(matches!(draw(values(&[0.0; 3])), Err(PictureError::NoColorScale { .. })));
    let mut animation = Animation::new(size(64, 64)).unwrap();
    let wrong = Image::filled(size(64, 32), [0; 3]);
    assert!(matches!(animation.push(&wrong, 0.0), Err(PictureError::FrameSize { .. })));
}

#[test]
fn tiny_pictures_and_wild_shapes_do_not_panic() {
    let mesh = sphere(Vec3::ZERO, 6);
    for side in [16, 17, 33, 161] {
        let camera = Camera::framing(
            &Bounds::of(&mesh.vertices),
            ViewDirection::default(),
            size(side, side),
        );
        let huge: Vec<_> = mesh.vertices.iter().map(|&p| p * 1e9).collect();
        let values = vec![f64::NAN; huge.len()];
        for positions in [&mesh.vertices, &huge] {
            let drawing = Drawing {
                title: "A title that is much longer than any of these pictures is wide, by far",
                caption: "ℵ",
                surfaces: vec![Surface {
                    positions,
                    triangles: &mesh.triangles,
                    paint: Paint::Values(&values),
                }],
                color_scale: Some(ColorScale::rounded("also quite long [mm]", -1e9, 1e-9).unwrap()),
                length_scale: true,
                ..Drawing::default()
            };
            drawing.draw(&camera).unwrap();
        }
    }
}
