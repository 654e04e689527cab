//! Colours and copies: what makes one code Jacobi, clique separation and Gauss-Seidel.

use crate::common::{Random, SNH, STVK, block, material, plain};
use viscera::coloring::{Coloring, ConstraintGraph};
use viscera::elements::{
    CornerLoad, TetForm, green_strain, neo_hookean_pair, neo_hookean_stretch, spring,
};
use viscera::layout::Layout;
use viscera::material::MaterialModel;
use viscera::mesh::io::read_tet_mesh;
use viscera::mesh::shapes::{self, Block, LIVER_SPACING, Splitting};
use viscera::mesh::{TetMesh, topology};
use viscera::model::{Model, ModelBuilder, ModelError};
use viscera::scalar::{Vec3, vec3};
use viscera::settings::{Colors, SolverSettings, Start};
use viscera::solver::{Inputs, Solver};
use viscera::state::State;

const WANTED: [Colors; 5] = [
    Colors::Limited(1),
    Colors::Limited(2),
    Colors::Limited(4),
    Colors::Limited(8),
    Colors::Unlimited,
];

/// A mesh with a spring along every eighth edge and an attachment at every third vertex.
struct Sample {
    name: String,
    mesh: TetMesh,
    springs: Vec<[u32; 2]>,
    attachments: Vec<u32>,
}

impl Sample {
    fn new(name: &str, mesh: TetMesh) -> Self {
        let springs = topology::edges(&mesh).into_iter().step_by(8).collect();
        let attachments = (0..mesh.vertices().len() as u32).step_by(3).collect();
        Self { name: name.to_owned(), mesh, springs, attachments }
    }

    fn graph(&self) -> ConstraintGraph {
        let mut graph = ConstraintGraph::new();
        self.mesh.tets().iter().for_each(|tet| graph.push(tet));
        self.springs.iter().for_each(|ends| graph.push(ends));
        self.attachments.iter().for_each(|&vertex| graph.push(&[vertex]));
        graph
    }

    fn builder(&self, tissue: MaterialModel) -> ModelBuilder {
        let mut builder = ModelBuilder::new();
        builder.add_body(&self.mesh, &material(tissue, 1e4, 0.4)).expect("a body");
        for &ends in &self.springs {
            builder.add_spring(ends, 50.0, None).expect("a spring");
        }
        for &vertex in &self.attachments {
            let anchor = self.mesh.vertices()[vertex as usize];
            builder.add_attachment(vertex, anchor, 20.0).expect("an attachment");
        }
        builder
    }
}

/// The bytes of a real mesh, or none where the data folder is not at hand.
fn anatomy(name: &str, unit: f64) -> Option<TetMesh> {
    let bytes =
        std::fs::read(crate::common::data::data_folder()?.join(name)).expect("a readable file");
    Some(read_tet_mesh(name, &bytes, unit).expect("a legal mesh").0)
}

fn samples() -> Vec<Sample> {
    let mut samples = Vec::new();
    for (name, splitting) in [("block, five", Splitting::Five), ("block, six", Splitting::Six)] {
        let block = Block { splitting, ..Block::new(vec3(0.1, 0.06, 0.06), [10, 6, 6]) };
        samples.push(Sample::new(name, block.mesh().expect("a block")));
    }
    let sphere = shapes::sphere(0.05, 0.015).expect("a sphere");
    samples.push(Sample::new("sphere", sphere.tets));
    samples.push(Sample::new("liver", shapes::liver(LIVER_SPACING, 1.0).expect("a liver").tets));
    for (name, unit) in [("liver_coarse.msh", 0.032), ("tongue.vtu", 0.03)] {
        samples.extend(anatomy(name, unit).map(|mesh| Sample::new(name, mesh)));
    }
    samples
}

/// The most constraints of one colour at each vertex, counted anew.
fn crowding(graph: &ConstraintGraph, coloring: &Coloring, vertex_count: usize) -> Vec<u32> {
    let mut colors_at: Vec<Vec<u32>> = vec![Vec::new(); vertex_count];
    for constraint in 0..graph.constraint_count() {
        for &v in graph.vertices(constraint) {
            colors_at[v as usize].push(coloring.color_of[constraint]);
        }
    }
    let most = |colors: &Vec<u32>| {
        let count = |&color: &u32| colors.iter().filter(|&&c| c == color).count();
        colors.iter().map(count).max().unwrap_or(1) as u32
    };
    colors_at.iter().map(most).collect()
}

#[test]
fn no_two_constraints_of_a_color_share_a_copy_for_any_number_of_colors() {
    println!("mesh                tets  clique    wanted  colors  copies per vertex");
    for sample in samples() {
        let (graph, vertex_count) = (sample.graph(), sample.mesh.vertices().len());
        for wanted in WANTED {
            let coloring = graph.color(vertex_count, wanted);
            let copies_per_vertex = coloring.copy_count() as f64 / vertex_count as f64;
            println!(
                "{:18} {:5}  {:6}  {:>8}  {:6}  {copies_per_vertex:17.2}",
                sample.name,
                sample.mesh.tets().len(),
                coloring.largest_clique,
                match wanted {
                    Colors::Unlimited => "any".to_owned(),
                    Colors::Limited(count) => count.to_string(),
                },
                coloring.color_count,
            );
            assert_eq!(coloring.validate(&graph), None, "{} {wanted:?}", sample.name);
            assert_eq!(coloring, graph.color(vertex_count, wanted), "two colourings differ");
            assert!(coloring.color_of.iter().all(|&color| color < coloring.color_count));

            let copies: Vec<u32> = coloring.copy_offsets.windows(2).map(|w| w[1] - w[0]).collect();
            assert_eq!(copies, crowding(&graph, &coloring, vertex_count), "{}", sample.name);

            match wanted {
                Colors::Limited(limit) => assert!(coloring.color_count <= limit),
                Colors::Unlimited => {
                    assert!(!coloring.is_split(), "{}", sample.name);
                    // Everything at the most crowded vertex needs a colour of its own.
                    assert!(coloring.color_count >= coloring.largest_clique);
                }
            }
            if wanted == Colors::Limited(1) {
                let mut corners = coloring.copy_of.clone();
                corners.sort_unstable();
                corners.dedup();
                assert_eq!(corners.len(), coloring.copy_of.len(), "a copy has two corners");
                assert_eq!(corners.len(), coloring.copy_count(), "a copy has no corner");
            }
        }
    }
}

#[test]
fn validation_finds_a_planted_conflict() {
    let sample = Sample::new("block", block([0.1, 0.05, 0.05], [4, 2, 2], 0.1));
    let (graph, vertex_count) = (sample.graph(), sample.mesh.vertices().len());
    for wanted in WANTED {
        let sound = graph.color(vertex_count, wanted);

        // A corner that takes a neighbour's copy of the same vertex and colour.
        if let Some((from, to)) = twin_corners(&graph, &sound) {
            let mut broken = sound.clone();
            broken.copy_of[from] = broken.copy_of[to];
            assert!(broken.validate(&graph).is_some(), "{wanted:?}: a shared copy went unseen");
        } else {
            assert!(!sound.is_split());
        }

        // A corner whose copy belongs to another vertex.
        let mut broken = sound.clone();
        let [first, second] = [0, 1].map(|corner| broken.copy_of[corner]);
        broken.copy_of[0] = second;
        assert_eq!(broken.validate(&graph), Some((0, 0)), "{wanted:?}");
        broken.copy_of[0] = broken.copy_count() as u32 + first;
        assert_eq!(broken.validate(&graph), Some((0, 0)), "{wanted:?}");

        // A constraint that changes its colour to that of one with which it shares a copy.
        let clash = (1..graph.constraint_count()).find(|&other| {
            let copies = |c: usize| &sound.copy_of[graph.corner_range(c)];
            copies(0).iter().any(|copy| copies(other).contains(copy))
        });
        let Some(other) = clash else {
            assert_eq!(wanted, Colors::Limited(1), "only Jacobi shares no copies at all");
            continue;
        };
        let mut broken = sound.clone();
        broken.color_of[0] = broken.color_of[other];
        let found = broken.validate(&graph).expect("a conflict");
        assert!(found.0 == 0 || found.1 == 0, "{wanted:?}: {found:?}");
    }
}

/// Two corners at one vertex, of two constraints of one colour.
fn twin_corners(graph: &ConstraintGraph, coloring: &Coloring) -> Option<(usize, usize)> {
    let mut seen = std::collections::BTreeMap::new();
    for constraint in 0..graph.constraint_count() {
        for (corner, &v) in graph.corner_range(constraint).zip(graph.vertices(constraint)) {
            let key = (v, coloring.color_of[constraint]);
            if let Some(other) = seen.insert(key, corner) {
                return Some((corner, other));
            }
        }
    }
    None
}

/// The same invariant in the arrays that the solver reads, and every element once.
#[test]
fn a_model_keeps_colors_copies_and_order() {
    for sample in samples() {
        for (wanted, tissue) in WANTED.into_iter().zip([STVK, SNH, STVK, SNH, STVK]) {
            let built = sample.builder(tissue).build::<f64>().expect("a model");
            let model = Layout::new(&built, &crate::common::colored(wanted));
            let set = model.tets_of(tissue);
            let mut user = vec![None; model.copy_count()];
            let mut take = |color: usize, copies: &[u32], vertices: &[u32]| {
                for (&copy, &v) in copies.iter().zip(vertices) {
                    assert!(model.copies_of(v).contains(&(copy as usize)));
                    // Constraints come colour by colour.
                    let before = user[copy as usize].replace(color);
                    assert_ne!(before, Some(color), "{} {wanted:?}", sample.name);
                }
            };
            for color in 0..model.color_count {
                let range = |offsets: &[u32]| offsets[color] as usize..offsets[color + 1] as usize;
                for tet in model.tets(set).filter(|tet| tet.color == color) {
                    take(color, &tet.copies, &tet.vertices);
                }
                for i in range(&model.elements.springs.color_offsets) {
                    take(
                        color,
                        &model.elements.springs.copies[i],
                        &model.elements.springs.vertices[i],
                    );
                }
                for i in range(&model.elements.attachments.color_offsets) {
                    let set = &model.elements.attachments;
                    take(color, &set.copies[i], &set.vertices[i]);
                }
            }
            let tets: Vec<_> = model.tets(set).collect();
            assert!(tets.iter().all(|tet| sample.mesh.tets()[tet.number] == tet.vertices));
            let order = tets.iter().map(|tet| tet.number as u32).collect();
            for (order, count) in [
                (&order, sample.mesh.tets().len()),
                (&model.elements.springs.order, sample.springs.len()),
                (&model.elements.attachments.order, sample.attachments.len()),
            ] {
                let mut sorted = order.clone();
                sorted.sort_unstable();
                assert!(sorted.into_iter().eq(0..count as u32), "{}", sample.name);
            }
        }
    }
}

/// One plain sweep from a shaken state: where it started, the state after it, and the layout.
fn sweep(model: &Model<f64>, wanted: Colors) -> (Vec<Vec3<f64>>, State<f64>, Layout<f64>) {
    let settings = SolverSettings { colors: wanted, start: Start::Previous, ..plain(1, 1) };
    let mut random = Random(3);
    let mut state = State::at_rest(model);
    for x in &mut state.positions {
        *x += random.vector(1e-3);
    }
    let start = state.positions.clone();
    let mut solver = Solver::new(model, &settings);
    solver.step(model, &mut state, &Inputs::default(), 1.0 / 60.0).expect("a legal step");
    (start, state, solver.layout().clone())
}

/// `J^T l` at given positions, and the sum of the magnitudes added up, per vertex.
fn loads(model: &Layout<f64>, x: &[Vec3<f64>], l: &[f64]) -> Vec<(Vec3<f64>, f64)> {
    let mut sums = vec![(Vec3::ZERO, 0.0); x.len()];
    let mut add = |vertices: &[u32], loads: &[CornerLoad<f64>]| {
        for (&v, load) in vertices.iter().zip(loads) {
            sums[v as usize].0 += load.impulse;
            sums[v as usize].1 += load.impulse.length();
        }
    };
    for set in &model.tet_sets {
        for tet in model.tets(set) {
            let corners = tet.vertices.map(|v| x[v as usize]);
            let shape = &tet.inverse_rest_shape;
            let six = || std::array::from_fn(|i| l[tet.multiplier(i)]);
            let corner_loads = match set.form {
                TetForm::GreenStrain => green_strain::corner_loads(&corners, shape, &six()),
                TetForm::NeoHookeanPair => {
                    let pair = [0, 1].map(|i| l[tet.multiplier(i)]);
                    neo_hookean_pair::corner_loads(&corners, shape, &pair)
                }
                TetForm::NeoHookeanStretch => {
                    neo_hookean_stretch::corner_loads(&corners, shape, &six())
                }
            };
            add(&tet.vertices, &corner_loads);
        }
    }
    for (i, vertices) in model.elements.springs.vertices.iter().enumerate() {
        let ends = vertices.map(|v| x[v as usize]);
        add(
            vertices,
            &spring::corner_loads(&ends, l[model.elements.springs.multiplier_offset + i]),
        );
    }
    for (i, &[v]) in model.elements.attachments.vertices.iter().enumerate() {
        let at = model.elements.attachments.multiplier_offset + 3 * i;
        let impulse = vec3(l[at], l[at + 1], l[at + 2]);
        add(&[v], &[CornerLoad { impulse, mass_bound: 0.0 }]);
    }
    sums
}

/// Copies of inverse mass `k w`, averaged, move a vertex by `w J^T dl` exactly. With one colour
/// every constraint sees the start of the sweep, so that `J` is known.
#[test]
fn the_mean_of_the_copies_answers_to_the_multipliers() {
    let sample = Sample::new("block", block([0.1, 0.05, 0.05], [4, 2, 2], 0.1));
    for tissue in [STVK, SNH] {
        let model = sample.builder(tissue).build::<f64>().expect("a model");
        let (start, state, layout) = sweep(&model, Colors::Limited(1));
        let sums = loads(&layout, &start, &state.multipliers);
        let (mut worst, mut largest) = (0.0f64, 0.0f64);
        for (v, (sum, magnitude)) in sums.into_iter().enumerate() {
            let mass = model.masses[v];
            let moved = (state.positions[v] - start[v]) * mass;
            // A copy is stored as position plus change, rounded like the position; each of up to
            // forty loads and changes rounds its own magnitude a few times.
            let round_off = mass * start[v].length() + 16.0 * magnitude;
            worst = worst.max((moved - sum).length() / (f64::EPSILON * round_off));
            largest = largest.max(moved.length() / mass);
        }
        println!(
            "{tissue:?}: moved up to {largest:.1e} m; error {worst:.2} of the round-off bound"
        );
        assert!(worst < 4.0, "{tissue:?}: {worst} times the round-off");
        assert!(largest > 1e-4, "the sweep moved nothing");
    }
}

/// Inner forces of a tetrahedron cancel, so that a sweep of any colouring keeps the centre of mass,
/// provided that the mean over the copies weighs every constraint fully.
#[test]
fn a_sweep_of_any_coloring_keeps_the_centre_of_mass() {
    let mesh = block([0.1, 0.05, 0.05], [4, 2, 2], 0.1);
    for tissue in [STVK, SNH] {
        for wanted in WANTED {
            let model = crate::common::single_body::<f64>(&mesh, &material(tissue, 1e4, 0.4));
            let (start, state, _) = sweep(&model, wanted);
            let (mut shift, mut moved, mut size) = (Vec3::ZERO, 0.0, 0.0);
            for (v, &mass) in model.masses.iter().enumerate() {
                let change = (state.positions[v] - start[v]) * mass;
                shift += change;
                moved += change.length();
                size += mass * start[v].length();
            }
            // Each vertex is rounded once per constraint that moves it, up to 24 times.
            let limit = 32.0 * f64::EPSILON * size;
            println!("{tissue:?} {wanted:?}: {:.1e} of {moved:.1e} kg m", shift.length());
            assert!(shift.length() < limit, "{tissue:?} {wanted:?}: {shift:?}, limit {limit:e}");
            assert!(moved > 1e6 * limit, "the sweep moved nothing");
        }
    }
}

/// A spring from a vertex to itself has no direction, and would ask for two copies of that vertex.
#[test]
fn a_spring_needs_two_ends() {
    let mut builder = ModelBuilder::new();
    let mesh = block([0.1, 0.05, 0.05], [1, 1, 1], 0.0);
    builder.add_body(&mesh, &material(SNH, 1e4, 0.4)).expect("a body");
    let error = builder.add_spring([3, 3], 10.0, Some(0.01)).expect_err("no spring");
    assert_eq!(error, ModelError::SameVertex { what: "a spring", vertex: 3 });
    assert!(error.to_string().contains("vertex 3"), "{error}");
}
