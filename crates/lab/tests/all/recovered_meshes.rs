//! Recovered-gradient tetrahedra on meshes that are hard on them: thin, torn, of many materials; and the modes of free
//! bodies.

use viscera::layout::{Domains, Smoothing};
use viscera::material::{Material, MaterialModel};
use viscera::mesh::TetMesh;
use viscera::mesh::shapes::{Block, Splitting};
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::{Vec3, vec3};
use viscera::solver::recovered::Recovered;
use viscera::solver::{Inputs, Pin};
use viscera_lab::load_cases::{GRAVITY, Random};
use viscera_lab::unstructured::shuffled;
use viscera_reference::Reference;

const SNH: MaterialModel = MaterialModel::StableNeoHookean;

fn material(young: f64, poisson: f64) -> Material {
    Material::new(SNH, young, poisson, 1000.0).expect("a legal material")
}

fn model(mesh: &TetMesh, material: &Material) -> Model<f64> {
    of_regions(mesh, &[*material])
}

/// Region `i` of material `i`.
fn of_regions(mesh: &TetMesh, materials: &[Material]) -> Model<f64> {
    let mut builder = ModelBuilder::new();
    let body = builder.add_body(mesh, &materials[0]).expect("a body");
    for (region, material) in (1..).zip(&materials[1..]) {
        builder.set_region_material(body, region, material).expect("a region");
    }
    builder.build().expect("a model")
}

fn block(cells: [usize; 3], splitting: Splitting) -> TetMesh {
    let size = Vec3::from_f64(cells.map(|c| 0.01 * c as f64));
    Block { splitting, ..Block::new(size, cells) }.mesh().expect("a block")
}

fn of(mesh: &TetMesh, regions: Vec<u32>) -> TetMesh {
    TetMesh::new(mesh.vertices().to_vec(), mesh.tets().to_vec(), regions).expect("the same mesh").0
}

/// Six modes without energy, and no seventh; all others have some.
fn check_free(name: &str, model: &Model<f64>) -> Vec<f64> {
    let squares = Reference::recovered(model, Smoothing::RECOVERED).spectrum().expect("modes");
    let largest = squares[squares.len() - 1];
    println!(
        "{name}: sixth {:.1e}, seventh {:.1e} of the largest",
        squares[5] / largest,
        squares[6] / largest
    );
    // Round-off of a matrix of this size.
    let noise = f64::EPSILON * squares.len() as f64 * largest;
    assert!(squares[..6].iter().all(|square| square.abs() < noise), "{name}: {:?}", &squares[..6]);
    assert!(squares[6] > 100.0 * noise, "{name}: {:e}", squares[6]);
    squares
}

/// Hangs from its low end along x and comes to rest at a minimum.
fn check_hangs(name: &str, mesh: &TetMesh, model: &Model<f64>) {
    let held = mesh.vertices().iter().enumerate().filter(|(_, x)| x.x < 1e-9);
    let pins = held.map(|(v, x)| Pin { vertex: v as u32, target: *x }).collect();
    let inputs = Inputs { gravity: GRAVITY, pins, ..Inputs::default() };
    let mut reference = Reference::recovered(model, Smoothing::RECOVERED);
    let solution = reference.settle(mesh.vertices(), &inputs).expect("a state of rest");
    println!("{name}: {:?}", solution.convergence);
    assert!(solution.convergence.minimum, "{name}");
}

/// How many elastic modes lie below the continuum's fortieth, of a bar four cells across: too few is too stiff, far
/// too many is a body that trembles.
#[test]
fn few_short_waves_are_too_slow() {
    let [size, cells] = [vec3(0.08, 0.02, 0.02), vec3(16.0, 4.0, 4.0)];
    let cells = cells.to_array().map(|c| c as usize);
    let six = Block { splitting: Splitting::Six, ..Block::new(size, cells) }.mesh().expect("a bar");
    let jittered =
        Block { splitting: Splitting::Six, jitter: 0.6, seed: 1, ..Block::new(size, cells) };
    let unstructured = shuffled(&jittered.mesh().expect("a bar"), 1).expect("a bar");
    let five = Block::new(size, cells).mesh().expect("a bar");
    for poisson in [0.3, 0.49] {
        let tissue = material(5e4, poisson);
        let truth = Reference::quadratic(&five, &tissue).lowest_frequencies(46).expect("modes");
        assert!(truth[5] < 1e-6 * truth[6], "{:?}", &truth[..7]);
        for (name, mesh) in [("five", &five), ("six", &six), ("unstructured", &unstructured)] {
            let model = model(mesh, &tissue);
            let squares = check_free(name, &model);
            let below = |squares: &[f64]| squares[6..].iter().filter(|s| **s < truth[45]).count();
            let fitted = Reference::recovered(&model, Smoothing::FITTED).spectrum().expect("modes");
            let counts = [&squares, &fitted].map(|squares| below(squares));
            println!("{name}, nu {poisson}: {counts:?} below the fortieth, the latter fitted");
            assert!(below(&squares) <= 70 && below(&fitted) <= 70);
        }
    }
}

/// The largest Poisson ratio that a material can have; above, materials are refused.
#[test]
fn nearly_incompressible_tissue_hangs() {
    assert!(Material::new(SNH, 1e4, 0.4999, 1000.0).is_err());
    let mesh = block([4, 2, 2], Splitting::Five);
    let model = model(&mesh, &material(1e5, 0.499));
    check_free("nu 0.499", &model);
    check_hangs("nu 0.499", &mesh, &model);
}

#[test]
fn a_sheet_one_tetrahedron_thick_hangs() {
    for splitting in [Splitting::Five, Splitting::Six] {
        let mesh = block([6, 3, 1], splitting);
        let model = model(&mesh, &material(1e5, 0.45));
        check_free("a sheet", &model);
        check_hangs("a sheet", &mesh, &model);
    }
}

/// A region of one tetrahedron, stiff in soft tissue, inside and at the surface.
#[test]
fn a_region_of_one_tetrahedron_is_a_linear_one() {
    let mesh = block([4, 2, 2], Splitting::Five);
    for tet in [0, mesh.tets().len() / 2] {
        let regions = (0..mesh.tets().len()).map(|t| u32::from(t == tet)).collect();
        let model = of_regions(&of(&mesh, regions), &[material(1e5, 0.45), material(1e6, 0.3)]);
        let domains = Domains::new(&model, Smoothing::RECOVERED);
        assert_eq!(domains.frames[tet].face_weights, [0.0; 4]);
        check_free("a region of one", &model);
        check_hangs("a region of one", &mesh, &model);
    }
}

/// Every tetrahedron of its own material: every face is an interface, and they are linear ones.
#[test]
fn interfaces_on_every_face_leave_linear_tetrahedra() {
    let mesh = block([3, 2, 1], Splitting::Six);
    let regions: Vec<u32> = (0..mesh.tets().len() as u32).collect();
    let materials: Vec<Material> =
        regions.iter().map(|&t| material(1e5 * (1.0 + 0.01 * f64::from(t)), 0.45)).collect();
    let model = of_regions(&of(&mesh, regions), &materials);
    let [linear, recovered] = [
        Reference::new(&model).spectrum().expect("modes"),
        Reference::recovered(&model, Smoothing::RECOVERED).spectrum().expect("modes"),
    ];
    let largest = linear[linear.len() - 1];
    for (a, b) in linear.iter().zip(&recovered) {
        assert!((a - b).abs() < 1e-11 * largest, "{a} {b}");
    }
    check_hangs("interfaces everywhere", &mesh, &model);
}

/// Two blocks that have one edge, or one vertex, in common are hinged there: no domain has tetrahedra of both, and a
/// block turned about the hinge bends neither.
#[test]
fn what_touches_at_an_edge_or_a_vertex_is_hinged() {
    let one = block([2, 2, 2], Splitting::Five);
    for (offset, common) in [(vec3(0.02, 0.02, 0.0), 3), (vec3(0.02, 0.02, 0.02), 1)] {
        let mut vertices = one.vertices().to_vec();
        let number: Vec<u32> = one
            .vertices()
            .iter()
            .map(|x| {
                let place = *x + offset;
                let known = one.vertices().iter().position(|y| (*y - place).length() < 1e-9);
                known.unwrap_or_else(|| {
                    vertices.push(place);
                    vertices.len() - 1
                }) as u32
            })
            .collect();
        let other = one.tets().iter().map(|tet| tet.map(|v| number[v as usize]));
        let tets: Vec<[u32; 4]> = one.tets().iter().copied().chain(other).collect();
        let regions = vec![0; tets.len()];
        let mesh = TetMesh::new(vertices, tets, regions).expect("two blocks").0;
        assert_eq!(mesh.vertices().len(), 2 * one.vertices().len() - common);
        let model = model(&mesh, &material(1e5, 0.45));
        let domains = Domains::new(&model, Smoothing::RECOVERED);
        assert_eq!(domains.len(), 2 * one.vertices().len());
        // About the vertical through the common edge, as far as it goes.
        let hinge = vec3(0.02, 0.02, 0.0);
        let (sin, cos) = (0.6, 0.8);
        let mut x = mesh.vertices().to_vec();
        for x in &mut x[one.vertices().len()..] {
            let r = *x - hinge;
            *x = hinge + vec3(cos * r.x - sin * r.y, sin * r.x + cos * r.y, r.z);
        }
        let mut passes = Recovered::new(&domains);
        passes.evaluate(&domains, &model.materials, &x);
        let energy = passes.energy(&domains, &model.materials);
        assert!(energy < 1e-15, "{energy:e} J");
    }
}

/// A layer of tetrahedra that hangs on a block by one edge of its own, and tetrahedra with a vertex of their own.
#[test]
fn a_flap_of_one_layer_hangs() {
    let whole = block([4, 3, 2], Splitting::Five);
    let is_kept = |tet: &usize| {
        let [a, b, c, d] = whole.corners(*tet);
        let x = (a + b + c + d) * 0.25;
        // The lower layer begins behind the upper: a flap of one box in height.
        x.x < 0.02 || x.z > 0.01
    };
    let kept: Vec<usize> = (0..whole.tets().len()).filter(is_kept).collect();
    let tets: Vec<[u32; 4]> = kept.iter().map(|&tet| whole.tets()[tet]).collect();
    let regions = vec![0; tets.len()];
    let (mesh, repairs) = TetMesh::new(whole.vertices().to_vec(), tets, regions).expect("a flap");
    assert!(!repairs.removed_vertices.is_empty());
    let model = model(&mesh, &material(1e5, 0.49));
    check_free("a flap", &model);
    check_hangs("a flap", &mesh, &model);
}

/// Meshes refuse the same tetrahedron twice; bodies that lie upon each other do not know of each other.
#[test]
fn tetrahedra_that_are_there_twice_share_no_domain() {
    let mesh = block([2, 1, 1], Splitting::Five);
    let twice: Vec<[u32; 4]> = mesh.tets().iter().chain(mesh.tets()).copied().collect();
    let regions = vec![0; twice.len()];
    assert!(TetMesh::new(mesh.vertices().to_vec(), twice, regions).is_err());
    let mut builder = ModelBuilder::new();
    for _ in 0..2 {
        builder.add_body(&mesh, &material(1e4, 0.45)).expect("a body");
    }
    let model = builder.build::<f64>().expect("a model");
    let domains = Domains::new(&model, Smoothing::RECOVERED);
    assert_eq!(domains.len(), model.vertex_count());
}

/// One vertex pushed through the opposite face of a tetrahedron returns.
#[test]
fn a_vertex_pushed_through_a_face_returns() {
    let mesh = block([3, 3, 3], Splitting::Five);
    let model = model(&mesh, &material(1e4, 0.45));
    let mut reference = Reference::recovered(&model, Smoothing::RECOVERED);
    let held = mesh.vertices().iter().enumerate().filter(|(_, x)| x.z < 1e-9);
    let pins = held.map(|(v, x)| Pin { vertex: v as u32, target: *x }).collect();
    let inputs = Inputs { pins, ..Inputs::default() };
    let mut random = Random(1);
    for _ in 0..10 {
        let tet = random.bits() as usize % mesh.tets().len();
        let [a, b, c, d] = mesh.corners(tet);
        let vertex = mesh.tets()[tet][0] as usize;
        if mesh.vertices()[vertex].z < 1e-9 {
            continue;
        }
        let mut x = mesh.vertices().to_vec();
        let through = (b + c + d) * (1.0 / 3.0) - a;
        x[vertex] += through * 1.4;
        let solution = reference.settle(&x, &inputs).expect("a state of rest");
        let away = |(x, rest): (&Vec3<f64>, &Vec3<f64>)| (*x - *rest).length();
        let farthest = solution.positions.iter().zip(mesh.vertices()).map(away).fold(0.0, f64::max);
        assert!(farthest < 1e-9, "tetrahedron {tet}: {farthest:e} m");
    }
}
