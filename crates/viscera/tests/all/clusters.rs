//! Colours of two levels: clusters of tetrahedra, and tetrahedra in clusters.

use std::collections::BTreeMap;

use crate::common::{Random, Run, SNH, STVK, block, everything, exact, material, single_body};
use viscera::layout::{LaidTet, Layout};
use viscera::mesh::TetMesh;
use viscera::mesh::shapes::{self, Block, LIVER_SPACING, Splitting};
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::lanes::Instructions;
use viscera::scalar::{Real, Vec3, vec3};
use viscera::settings::{Clusters, Colors, SolverSettings, Threads};
use viscera::solver::{Inputs, Pin, Solver, StepError};
use viscera::state::State;

/// The defaults with clusters of up to so many tetrahedra.
pub fn clustered(size: u32) -> SolverSettings {
    SolverSettings { clusters: Clusters::OfTets(size), ..SolverSettings::xpbd() }
}

/// The first so many tetrahedra of a block.
fn first_tets(count: usize) -> TetMesh {
    let mesh = block([0.06, 0.04, 0.04], [7, 3, 3], 0.2);
    let tets = &mesh.tets()[..count];
    let mut numbers = BTreeMap::new();
    for &v in tets.as_flattened() {
        let next = numbers.len() as u32;
        numbers.entry(v).or_insert(next);
    }
    let mut vertices = vec![Vec3::ZERO; numbers.len()];
    numbers.iter().for_each(|(&v, &to)| vertices[to as usize] = mesh.vertices()[v as usize]);
    let tets = tets.iter().map(|tet| tet.map(|v| numbers[&v])).collect();
    TetMesh::new(vertices, tets, vec![0; count]).expect("a mesh").0
}

/// A bar of about so many tetrahedra, four times as long as wide.
pub fn bar(cells: usize, splitting: Splitting) -> TetMesh {
    let shape = Block::new(vec3(0.2, 0.05, 0.05), [4 * cells, cells, cells]);
    Block { splitting, ..shape }.mesh().expect("a bar")
}

/// Single tetrahedra, each a body, some of them tied by a spring.
fn loose_bodies(count: usize) -> Model<f64> {
    let mut random = Random(3);
    let mut builder = ModelBuilder::new();
    for i in 0..count {
        let law = if i % 3 == 0 { STVK } else { SNH };
        let mesh = first_tets(1 + i % 5);
        let away = random.vector(0.5);
        let vertices = mesh.vertices().iter().map(|x| *x + away).collect();
        let mesh = TetMesh::new(vertices, mesh.tets().to_vec(), mesh.regions().to_vec());
        let body = builder.add_body(&mesh.expect("a mesh").0, &material(law, 1e4, 0.4));
        let first = builder.body(body.expect("a body")).expect("a body").vertices.start as u32;
        if i % 4 == 1 {
            builder.add_spring([first - 1, first], 10.0, None).expect("a spring");
        }
    }
    builder.build().expect("a model")
}

/// A bar whose far end is of another law.
fn two_laws() -> Model<f64> {
    let mesh = bar(6, Splitting::Five);
    let is_far = |tet: &[u32; 4]| mesh.vertices()[tet[0] as usize].x > 0.09;
    let regions = mesh.tets().iter().map(|tet| u32::from(is_far(tet))).collect();
    let mesh = TetMesh::new(mesh.vertices().to_vec(), mesh.tets().to_vec(), regions);
    let mut builder = ModelBuilder::new();
    let body = builder.add_body(&mesh.expect("a mesh").0, &material(STVK, 1e4, 0.3));
    let body = body.expect("a body");
    builder.set_region_material(body, 1, &material(SNH, 2e4, 0.45)).expect("a region");
    builder.build().expect("a model")
}

/// Cells that grow along the bar to eight times their size.
fn graded() -> TetMesh {
    let mesh = bar(8, Splitting::Six);
    let grown = |x: &Vec3<f64>| vec3(x.x * (1.0 + 60.0 * x.x * x.x), x.y, x.z);
    let vertices = mesh.vertices().iter().map(grown).collect();
    TetMesh::new(vertices, mesh.tets().to_vec(), mesh.regions().to_vec()).expect("a mesh").0
}

/// Tetrahedra of a cluster by their colour there.
type Colored = BTreeMap<usize, Vec<LaidTet<f64>>>;

/// What a layout's clusters are like.
#[derive(Debug, Default)]
struct Seen {
    clusters: usize,
    colors: usize,
    inner: usize,
    tets: usize,
    largest: usize,
    vertices: usize,
    /// Lanes of blocks for each tetrahedron.
    lanes: f64,
}

/// Every tetrahedron once; none that shares a vertex in a colour of a cluster, no clusters that share one in a colour.
fn examine(name: &str, model: &Model<f64>, size: u32) -> Seen {
    let layout = Layout::new(model, &clustered(size));
    assert!(!layout.is_split());
    let mut seen = Seen { colors: layout.color_count, ..Seen::default() };
    let mut counted = vec![0; model.tet_count()];
    let mut multipliers = std::collections::BTreeSet::new();
    // By law, cluster, colour in the cluster.
    let mut clusters: BTreeMap<(usize, usize), Colored> = BTreeMap::new();
    for law in [STVK, SNH] {
        let set = layout.tets_of(law);
        for tet in layout.tets(set) {
            counted[tet.number] += 1;
            assert!(multipliers.insert(tet.multiplier(0)), "{name}: two share a multiplier");
            let [cluster, inner] = tet.cluster.expect("a cluster");
            let of_cluster = clusters.entry((law as usize, cluster)).or_default();
            of_cluster.entry(inner).or_default().push(tet);
        }
        seen.lanes += (8 * set.block_count()) as f64 / model.tet_count() as f64;
    }
    assert!(counted.iter().all(|&count| count == 1), "{name}: not every tetrahedron once");
    let mut owners: BTreeMap<(usize, u32), (usize, usize)> = BTreeMap::new();
    for (&id, colors) in &clusters {
        let mut vertices = std::collections::BTreeSet::new();
        let (mut tets, mut parts) = (0, std::collections::BTreeSet::new());
        let color = colors.values().next().expect("a colour")[0].color;
        for of_color in colors.values() {
            let mut own = std::collections::BTreeSet::new();
            for tet in of_color {
                assert_eq!(tet.color, color, "{name}: a cluster of two colours");
                tets += 1;
                for v in tet.vertices {
                    assert!(
                        own.insert(v),
                        "{name}, {size}: vertex {v} twice in a colour of {id:?}"
                    );
                    let owner = *owners.entry((color, v)).or_insert(id);
                    assert_eq!(owner, id, "{name}, {size}: vertex {v} twice in colour {color}");
                    vertices.insert(v);
                    parts.insert(model.part_of(v));
                }
            }
        }
        assert!(tets <= size as usize && vertices.len() <= 960 && parts.len() == 1, "{name}");
        seen.inner = seen.inner.max(colors.len());
        seen.largest = seen.largest.max(tets);
        seen.vertices = seen.vertices.max(vertices.len());
        seen.tets += tets;
    }
    seen.clusters = clusters.len();
    // Elements that are no tetrahedra: no cluster and no other element of their colour has their vertices.
    let mut taken: BTreeMap<(usize, u32), usize> = BTreeMap::new();
    for color in 0..layout.color_count {
        let springs = &layout.elements.springs;
        for i in springs.color_offsets[color]..springs.color_offsets[color + 1] {
            for &v in &springs.vertices[i as usize] {
                assert!(!owners.contains_key(&(color, v)), "{name}: a spring at a cluster");
                assert!(taken.insert((color, v), i as usize).is_none(), "{name}: two springs");
            }
        }
    }
    println!("{name:10} {size:5} {seen:?}");
    seen
}

/// Of every kind of mesh.
fn models() -> Vec<(&'static str, Model<f64>)> {
    let tissue = material(SNH, 1e4, 0.4);
    let of = |mesh: &TetMesh| single_body::<f64>(mesh, &tissue);
    let mut all: Vec<_> =
        [1, 63, 65, 257].map(|count| ("first", of(&first_tets(count)))).into_iter().collect();
    let liver = shapes::liver(LIVER_SPACING, 1.0).expect("a liver").tets;
    all.extend([
        ("loose", loose_bodies(300)),
        ("two laws", two_laws()),
        ("everything", everything()),
        ("five", of(&bar(5, Splitting::Five))),
        ("six", of(&bar(7, Splitting::Six))),
        ("graded", of(&graded())),
        ("liver", of(&liver)),
        ("sheet", of(&block([0.2, 0.2, 0.01], [30, 30, 2], 0.2))),
    ]);
    all
}

#[test]
fn nothing_that_is_swept_at_once_shares_a_vertex() {
    for (name, model) in models() {
        for size in [16, 100, 512, 4096] {
            let seen = examine(name, &model, size);
            assert_eq!(seen.tets, model.tet_count());
            if size == 512 && ["graded", "five", "six", "liver", "sheet"].contains(&name) {
                assert_eq!(seen.colors, 4, "{name}");
            }
            if size == 4096 && name == "first" {
                assert_eq!(seen.clusters, model.part_count(), "a small part is one cluster");
            }
        }
    }
}

/// The aim: ten default substeps of a hundred thousand tetrahedra in 280 dispatches, and few lanes that stay empty.
#[test]
fn a_hundred_thousand_tetrahedra_have_four_colors_of_clusters() {
    for splitting in [Splitting::Five, Splitting::Six] {
        let cells = if splitting == Splitting::Five { 17 } else { 16 };
        let model = single_body::<f64>(&bar(cells, splitting), &material(SNH, 1e4, 0.4));
        for (size, lanes) in [(512, 1.2), (1024, 1.07)] {
            let seen = examine("100k", &model, size);
            assert!(seen.colors == 4 && seen.lanes < lanes, "{splitting:?}, {size}: {seen:?}");
        }
    }
}

/// Held at one end, under gravity.
pub fn hanging<S: Real>(model: &Model<S>) -> Inputs<S> {
    let ends = (0..).zip(&model.rest_positions).filter(|(_, x)| x.x.to_f64() < 1e-9);
    let pins = ends.map(|(vertex, x)| Pin { vertex, target: *x }).collect();
    Inputs { gravity: vec3(0.0, 0.0, -9.81).cast(), pins, ..Inputs::default() }
}

/// Where a bar comes to rest, and by how much its end sags [m].
pub fn rest<S: Real>(model: &Model<S>, settings: &SolverSettings) -> (Vec<Vec3<f64>>, f64) {
    let inputs = hanging(model);
    let mut run = Run::new(model, settings);
    for frame in 0..400 {
        run.frame(&inputs, if frame < 300 { 0.9 } else { 0.5 });
    }
    let places: Vec<_> = run.state.positions.iter().map(|x| x.cast::<f64>()).collect();
    let moved = places.iter().zip(&model.rest_positions).map(|(a, b)| (*a - b.cast()).length());
    let sag = moved.fold(0.0, f64::max);
    (places, sag)
}

/// The largest distance of two lists of places [m].
pub fn apart(a: &[Vec3<f64>], b: &[Vec3<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max)
}

#[test]
fn a_bar_comes_to_the_rest_of_one_level_of_colors() {
    let mesh = block([0.1, 0.04, 0.04], [6, 2, 2], 0.1);
    for law in [STVK, SNH] {
        let tissue = material(law, 2e4, 0.4);
        let global = exact(5);
        let (known, sag) = rest(&single_body::<f64>(&mesh, &tissue), &global);
        for size in [16, 50, 4096] {
            let settings = SolverSettings { clusters: Clusters::OfTets(size), ..global.clone() };
            let (double, _) = rest(&single_body::<f64>(&mesh, &tissue), &settings);
            let (single, _) = rest(&single_body::<f32>(&mesh, &tissue), &settings);
            let errors = [apart(&double, &known) / sag, apart(&single, &known) / sag];
            println!("{law:?}, {size}: sag {sag:.4} m, of it apart {errors:?}");
            assert!(
                sag > 1e-3 && errors[0] < 1e-6 && errors[1] < 1e-4,
                "{law:?}, {size}: {errors:?}"
            );
        }
    }
}

/// Clusters of a colour go to different threads; in each are elastic and viscous constraints by turns.
#[test]
fn threads_and_instructions_leave_every_bit() {
    let tissue = material(SNH, 1e4, 0.45).with_viscosity(0.01).expect("legal");
    let model = single_body::<f32>(&bar(5, Splitting::Five), &tissue);
    let inputs = hanging(&model);
    let run = |threads, instructions, size| {
        let threads = Threads::Count(threads);
        let settings = SolverSettings { threads, ..clustered(size) };
        let mut solver = Solver::new(&model, &settings);
        solver.use_instructions(instructions);
        let mut state = State::at_rest(&model);
        for _ in 0..10 {
            solver.step(&model, &mut state, &inputs, 1.0 / 600.0).expect("a legal step");
        }
        let vectors = state.positions.iter().chain(&state.velocities).flat_map(|v| v.to_array());
        vectors.chain(state.multipliers).map(f32::to_bits).collect::<Vec<_>>()
    };
    for size in [64, 512] {
        let known = run(1, Instructions::Avx2, size);
        for threads in [2, 3] {
            assert_eq!(run(threads, Instructions::Avx2, size), known, "{threads} threads");
        }
        assert_eq!(run(2, Instructions::Portable, size), known);
    }
    assert_ne!(run(1, Instructions::Avx2, 64), run(1, Instructions::Avx2, 512));
}

#[test]
fn clusters_and_a_limited_number_of_colors_do_not_go_together() {
    let model = single_body::<f64>(&first_tets(65), &material(SNH, 1e4, 0.4));
    let settings = SolverSettings { colors: Colors::Limited(4), ..clustered(64) };
    let mut state = State::at_rest(&model);
    let step = Solver::new(&model, &settings).step(&model, &mut state, &Inputs::default(), 1e-3);
    assert_eq!(step, Err(StepError::ClustersAndColors { colors: 4 }));
    let text = StepError::ClustersAndColors { colors: 4 }.to_string();
    assert!(
        text.contains("colors = \"unlimited\"") && text.contains("clusters = \"none\""),
        "{text}"
    );
}
