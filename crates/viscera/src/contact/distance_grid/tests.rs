use super::*;
use crate::contact::Shape;
use crate::mesh::shapes::{lofted, turned};

/// Of contact [m], twice the cells of grids here.
const THICKNESS: f64 = 1e-3;

/// A ball around the origin [m], as a surface of revolution.
fn ball(radius: f64, sides: u32) -> SurfaceMesh {
    let rings = sides / 2;
    let at = |ring: u32| {
        let (sin, cos) = libm::sincos(std::f64::consts::PI * f64::from(ring) / f64::from(rings));
        [if ring == 0 || ring == rings { 0.0 } else { radius * sin }, -radius * cos]
    };
    turned(&(0..=rings).map(at).collect::<Vec<_>>(), sides)
}

/// A fork of two prongs of 4 x 4 mm along -z, 20 mm long and 8 mm apart, which are one above: a U.
pub fn fork() -> SurfaceMesh {
    let turns = 12;
    let section = |middle: Vec3<f64>, out: Vec3<f64>| {
        let side = vec3(0.0, 1.0, 0.0);
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(a, b)| middle + out * (2e-3 * a) + side * (2e-3 * b))
            .to_vec()
    };
    let mut sections = vec![section(vec3(6e-3, 0.0, -0.02), vec3(1.0, 0.0, 0.0))];
    for turn in 0..=turns {
        let (sin, cos) = libm::sincos(std::f64::consts::PI * f64::from(turn) / f64::from(turns));
        let out = vec3(cos, 0.0, sin);
        sections.push(section(out * 6e-3, out));
    }
    sections.push(section(vec3(-6e-3, 0.0, -0.02), vec3(-1.0, 0.0, 0.0)));
    lofted(&sections)
}

fn grid(surface: &SurfaceMesh) -> DistanceGrid {
    DistanceGrid::new(surface, THICKNESS).expect("a grid")
}

/// Points of a fixed sequence in a cube of edge 2.
fn points(count: usize) -> impl Iterator<Item = Vec3<f64>> {
    let number = |i: usize, step: f64| 2.0 * ((i as f64 * step) % 1.0) - 1.0;
    (1..count).map(move |i| vec3(number(i, 0.618034), number(i, 0.754878), number(i, 0.569840)))
}

#[test]
fn a_balls_distances_are_those_of_the_sphere() {
    let radius = 5e-3;
    let grid = grid(&ball(radius, 96));
    // Between points of the grid the distance bends by h^2/8 (2/r), and the ball's own triangles are within the sphere.
    let bend = grid.cell() * grid.cell() / (4.0 * radius);
    let sag = radius * (1.0 - libm::cos(std::f64::consts::PI / 48.0));
    for x in points(3000) {
        let x = x * 8e-3;
        let exact = x.length() - radius;
        let found = grid.distance(x);
        if exact.abs() < 2e-3 {
            assert!(
                found.value > exact - 1e-8 && found.value < exact + bend + sag,
                "{exact} {found:?}"
            );
            let out = x * (1.0 / x.length());
            assert!((grid.normal(x) - out).length() < 0.01, "{x:?}");
            assert!(
                (found.normal - out).length() < 0.2 && (found.slope - 1.0).abs() < 0.1,
                "{x:?} {found:?}"
            );
        }
        assert!(exact.abs() < 0.1e-3 || (found.value < 0.0) == (exact < 0.0), "{exact} {found:?}");
    }
    assert!((grid.thinnest() - radius).abs() < 2.0 * sag, "{}", grid.thinnest());
    assert!((grid.reach() - radius).abs() < 1e-9);
    assert!(grid.bytes() < 2 << 20, "{}", grid.bytes());
}

/// Force is the gradient of the energy: of the same function, not of a smoother one.
#[test]
fn the_gradient_is_that_of_the_value() {
    let grid = grid(&fork());
    let mut bent = 0;
    for x in points(4000) {
        let x = vec3(x.x * 0.012, x.y * 5e-3, x.z * 0.016 - 8e-3);
        let here = grid.distance(x);
        let h = 1e-8;
        let mut rough = Vec3::ZERO;
        let mut crossed = 0.0_f64;
        for axis in 0..3 {
            let mut step = Vec3::ZERO;
            step[axis] = h;
            let [ahead, back] = [x + step, x - step].map(|x| grid.distance(x));
            rough[axis] = (ahead.value - back.value) / (2.0 * h);
            for there in [ahead, back] {
                let turned = there.normal * there.slope - here.normal * here.slope;
                crossed = crossed.max(turned.length());
                // Within a cell the curvature covers how it turns.
                assert!(crossed > 1e-3 || turned.length() <= h * here.curvature + 1e-7);
            }
        }
        let gradient = here.normal * here.slope;
        assert!((here.normal.length() - 1.0).abs() < 1e-12);
        assert!(crossed > 1e-3 || (rough - gradient).length() < 1e-5, "{x:?}: {rough:?} {here:?}");
        bent += usize::from((here.slope - 1.0).abs() > 1e-3);
    }
    // It is no unit vector, or nothing of this would matter.
    assert!(bent > 100, "{bent}");
}

#[test]
fn the_value_has_no_step_and_no_slope_above_the_grids_own() {
    let grid = grid(&fork());
    assert!((1.0..2.5).contains(&grid.steepest()), "{}", grid.steepest());
    let high = grid.origin
        + vec3(grid.bricks[0] as f64, grid.bricks[1] as f64, grid.bricks[2] as f64)
            * (BRICK as f64 * grid.cell);
    let mut all: Vec<_> = points(400).collect();
    all.push(Vec3::ZERO);
    for two in all.windows(2) {
        // Through the whole grid, in steps smaller than a cell.
        let [a, b] = [two[0], two[1]].map(|x| {
            let share = (x + Vec3::splat(1.0)) * 0.5;
            grid.origin + (high - grid.origin).scale(share)
        });
        let way = (b - a).length() / 500.0;
        let at = |i: u32| grid.distance(a + (b - a) * (f64::from(i) / 500.0)).value;
        for i in 0..500 {
            let step = (at(i + 1) - at(i)).abs();
            assert!(step <= way * grid.steepest() + 1e-9, "{step} over {way}");
        }
    }
}

/// Where contact can be, values are distances to the surface, and divided bricks only.
#[test]
fn a_forks_distances_are_those_of_its_prongs() {
    let grid = grid(&fork());
    // Beside a prong, in the middle between both, and far out: as from boxes.
    for (x, wanted) in [
        (vec3(3.5e-3, 0.0, -0.01), 0.5e-3),
        (vec3(0.0, 0.3e-3, -0.012), 4e-3),
        (vec3(6e-3, 0.0, -0.01), -2e-3),
        (vec3(8.5e-3, 1e-3, -0.005), 0.5e-3),
        (vec3(-6e-3, 0.0, -0.021), 1e-3),
    ] {
        let found = grid.distance(x).value;
        assert!((found - wanted).abs() < 0.03e-3, "{x:?}: {found} {wanted}");
    }
    assert!((grid.thinnest() - 2e-3).abs() < 0.1e-3, "{}", grid.thinnest());
    for x in points(500) {
        let x = x * 0.1;
        let found = grid.distance(x).value;
        let near = grid.surface.vertices.iter().map(|v| (*v - x).length()).fold(f64::MAX, f64::min);
        // From far away no more than the distance to any of its vertices, bent by a brick at most.
        assert!(found <= near + 1e-3, "{x:?}: {found} {near}");
    }
    assert!(grid.distance(vec3(f64::NAN, 0.0, 0.0)).value.is_nan());
}

#[test]
fn a_hollow_is_outside() {
    let profile = [[0.0, 0.01], [3e-3, 0.01], [3e-3, 0.0], [5e-3, 0.0], [5e-3, 0.02], [0.0, 0.02]];
    let grid = grid(&turned(&profile, 64));
    let in_bore = grid.distance(vec3(0.0, 0.0, 5e-3));
    assert!((in_bore.value - 3e-3).abs() < 0.2e-3, "{in_bore:?}");
    assert!(grid.distance(vec3(4e-3, 0.0, 5e-3)).value < -0.8e-3);
    assert!((grid.thinnest() - 1e-3).abs() < 0.05e-3, "{}", grid.thinnest());
}

#[test]
fn what_no_grid_holds_is_refused_with_numbers() {
    let refused = |surface: &SurfaceMesh, thickness: f64| {
        DistanceGrid::new(surface, thickness).expect_err("a refusal").to_string()
    };
    assert_eq!(
        refused(&ball(1.0, 12), 1e-4),
        "its distances would take 1367134 MiB at cells of 0.050 mm, half of the contact's `thickness`, and 256 are allowed; \
         take a `thickness` of 7.680 mm or more, or cut off what tissue never meets"
    );
    let foil = |half: f64| {
        let section = |z: f64| {
            [(-0.01, -half), (0.01, -half), (0.01, half), (-0.01, half)]
                .map(|(x, y)| vec3(x, y, z))
                .to_vec()
        };
        lofted(&[section(0.0), section(0.02)])
    };
    assert_eq!(
        refused(&foil(1e-4), THICKNESS),
        "its walls are 0.200 mm thick at its thinnest and its distances have cells of 0.500 mm, half of the contact's \
         `thickness`; take a `thickness` of 0.400 mm at most, or thicker walls"
    );
    assert!(DistanceGrid::new(&foil(1e-4), 4e-4).is_ok());
    for thickness in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(refused(&ball(1.0, 12), thickness).contains("above zero"));
    }
    let nested = {
        let (mut one, other) = (ball(5e-3, 24), ball(3e-3, 24));
        let first = one.vertices.len() as u32;
        one.vertices.extend(&other.vertices);
        one.triangles.extend(other.triangles.iter().map(|corners| corners.map(|v| v + first)));
        one
    };
    assert!(refused(&nested, THICKNESS).contains("it is inside itself 2 times"));
    // The thickness that is named fits.
    let text = refused(&ball(0.2, 24), 1e-4);
    let named = text.split("a `thickness` of ").nth(1).and_then(|rest| rest.split(' ').next());
    let named: f64 = named.expect(&text).parse().expect("a number");
    assert!(named > 0.1 && named < 2.0, "{text}");
}

/// What a sample meets on its way is found, and nothing where there is nothing.
#[test]
fn shapes_with_a_grid_are_shapes() {
    let shape = Shape::Mesh(std::sync::Arc::new(grid(&fork())));
    assert_eq!(shape.complaint(), None);
    assert_eq!(shape.clone(), shape);
    let x = vec3(8.4e-3, 0.2e-3, -0.01);
    let distance = shape.distance(x);
    let (normal, offset) = shape.tangent(x, &distance);
    assert!((normal - vec3(1.0, 0.0, 0.0)).length() < 1e-3 && (offset - 8e-3).abs() < 1e-5);
    assert!((normal.dot(x) - offset - distance.value).abs() < 1e-12);
}

/// Numbers of docs/algorithm.md, for the machine that this runs on.
#[test]
#[ignore = "slow: measures time"]
fn samples_and_grids_take_little_time_at_length() {
    // Of this thread [s], where the system tells it: others may be at work.
    let now = || {
        let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
        let first = text.split_whitespace().next().and_then(|word| word.parse::<f64>().ok());
        first.map_or(f64::NAN, |nanoseconds| 1e-9 * nanoseconds)
    };
    let start = now();
    let grid = grid(&fork());
    let made = now() - start;
    // Where contact is: points within a millimetre of the surface.
    let near: Vec<_> = points(400_000)
        .map(|x| vec3(x.x * 9e-3, x.y * 3e-3, x.z * 0.015 - 8e-3))
        .filter(|x| grid.distance(*x).value.abs() < 1e-3)
        .collect();
    let rate = |sum: &dyn Fn(Vec3<f64>) -> f64| {
        let start = now();
        let all: f64 = near.iter().map(|x| sum(*x)).sum();
        assert!(all.is_finite());
        near.len() as f64 / (1e3 * (now() - start))
    };
    let best = |sum: &dyn Fn(Vec3<f64>) -> f64| (0..9).map(|_| rate(sum)).fold(0.0, f64::max);
    let distances = best(&|x| {
        let distance = grid.distance(x);
        distance.value + distance.normal.x * distance.slope
    });
    let planes = best(&|x| grid.normal(x).z);
    println!(
        "fork of {} triangles: {:.0} ms, {} KiB, steepest {:.2}; {distances:.0} distances with gradient a millisecond, \
         {planes:.0} normals of planes, at {} points",
        grid.surface.triangles.len(),
        1e3 * made,
        grid.bytes() >> 10,
        grid.steepest(),
        near.len()
    );
    // A tenth of what a processor of 2023 does.
    assert!(distances.is_nan() || distances > 1000.0 && planes > 200.0);
    for sides in [200, 1400] {
        let large = ball(0.02, sides);
        let start = now();
        let grid = DistanceGrid::new(&large, THICKNESS).expect("a grid");
        let made = now() - start;
        println!(
            "ball of {} triangles: {made:.1} s, {} MiB",
            large.triangles.len(),
            grid.bytes() >> 20
        );
        assert!((grid.distance(vec3(0.0, 0.0, 0.021)).value - 1e-3).abs() < 1e-5);
        assert!(made.is_nan() || made < 60.0);
    }
}
