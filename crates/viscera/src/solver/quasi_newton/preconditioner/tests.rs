//! The preconditioner against the curvature that it is made of.

use super::full::FullSums;
use super::prolongation::Prolongation;
use super::rotation::Turn;
use super::sums::{Grouped, LocalTets, On};
use super::{Coarseness, OfPart};
use crate::elements::law::{Law, StableNeoHookean};
use crate::layout::Layout;
use crate::layout::lattice::{Lattice, Weights};
use crate::material::{Material, MaterialModel};
use crate::mesh::shapes::{self, Block, Splitting};
use crate::model::ModelBuilder;
use crate::scalar::lanes::{Instructions, Point};
use crate::scalar::{Mat3, Vec3, vec3};
use crate::settings::SolverSettings;
use crate::solver::cpu::threads::Workers;

/// Without a lattice the coarsest level is the stiffness of the tetrahedra themselves, turned as their groups are: each block
/// against the formula of a single tetrahedron, in lanes and one by one.
#[test]
fn the_whole_matrix_is_the_sum_of_its_tetrahedra() {
    let mut builder = ModelBuilder::new();
    let tissue = Material::new(MaterialModel::StableNeoHookean, 1e4, 0.4, 1000.0).expect("legal");
    let mesh = shapes::beam(0.03, 0.02, 0.02, 2, 0.0).expect("a beam");
    builder.add_body(&mesh, &tissue).expect("a body");
    let model = builder.build::<f64>().expect("a model");
    let layout = Layout::new(&model, &SolverSettings::default());
    let tets = LocalTets::new(&layout, 0);
    let count = model.vertex_count();
    let grouped = Grouped::new(&tets, &model.rest_positions, &Lattice::default());
    assert_eq!(grouped.len(), 1);
    let mut free = vec![true; count];
    free[3] = false;
    let full = FullSums::new(On::Vertices, &tets, &grouped, &vec![1.0; count], &free);
    let f = Mat3::from_columns(vec3(0.2, 1.1, 0.1), vec3(-0.9, 0.3, 0.0), vec3(0.1, -0.2, 1.2));
    let turn = Turn::<f64>::new(MaterialModel::StableNeoHookean, &f, 0.5);
    let (r, a, squared) = (turn.rotation, StableNeoHookean::gradient_map(&f), 1e-4);
    let mut expected = vec![Mat3::default(); count * count];
    for tet in (0..tets.len() as u32).map(|tet| tets.get(tet)) {
        let (mu, lambda) = (tet.mu * tet.volume, tet.lambda * tet.volume);
        for (&v, gv) in tet.vertices.iter().zip(tet.gradients) {
            for (&w, gw) in tet.vertices.iter().zip(tet.gradients).filter(|(w, _)| **w <= v) {
                let shear = Mat3::IDENTITY * gv.dot(gw) + Mat3::outer(r * gw, r * gv);
                let block = shear * mu + Mat3::outer(a * gv, a * gw) * lambda;
                let sum = &mut expected[v as usize * count + w as usize];
                *sum = *sum + block * (1.5 * squared);
            }
        }
    }
    let largest = expected.iter().map(|block| block.norm_squared().sqrt()).fold(0.0, f64::max);
    for instructions in [Instructions::Portable, Instructions::detect()] {
        let mut workers = Workers::one();
        workers.instructions = instructions;
        let mut seen = 0;
        full.each_block(&workers, 0, &turn, squared, |[v, w], block| {
            let difference = *block - expected[v as usize * count + w as usize];
            assert!(difference.norm_squared().sqrt() < 1e-13 * largest, "{v}, {w}: {block:?}");
            assert!(free[v as usize] && free[w as usize]);
            seen += 1;
        });
        let any = |(pair, block): (usize, &Mat3<f64>)| {
            block.norm_squared() > 0.0 && free[pair / count] && free[pair % count]
        };
        assert!(seen >= expected.iter().enumerate().filter(|pair| any(*pair)).count());
    }
}

/// A bar of cells in a row has no coarser level, and too many vertices to be solved as a whole.
#[test]
fn sums_are_those_of_what_is_free_now() {
    let tissue = Material::new(MaterialModel::StableNeoHookean, 1e4, 0.4, 1000.0).expect("legal");
    for (width, cells, levels) in [(0.002, [50, 1, 1], 0), (0.03, [20, 6, 6], 1)] {
        let block = Block::new(vec3(0.1, width, width), cells);
        let mesh = Block { splitting: Splitting::Six, ..block }.mesh().expect("a bar");
        let mut builder = ModelBuilder::new();
        builder.add_body(&mesh, &tissue).expect("a body");
        let model = builder.build::<f32>().expect("a model");
        let layout = Layout::new(&model, &SolverSettings::default());
        let count = model.vertex_count();
        let free: Vec<bool> = (0..count).map(|v| v % 5 != 0).collect();
        let part = || OfPart::new(&layout, &layout.parts[0], Coarseness::ON_CPU);
        let (mut before, mut fresh) = (part(), part());
        assert_eq!(fresh.lattice.levels.len().min(1), levels);
        assert_eq!(fresh.dense.size() == 0, levels == 0);
        for free in [&vec![true; count], &free] {
            before.rebuild(&layout, 0, free);
        }
        fresh.rebuild(&layout, 0, &free);
        assert_eq!(before.levels, fresh.levels);
        assert_eq!(before.inverses.len(), fresh.inverses.len());
        // The levels know what is free: fewer vertices have fewer shares.
        let mut whole = part();
        whole.rebuild(&layout, 0, &vec![true; count]);
        assert!(whole.levels[0].shares.len() > fresh.levels[0].shares.len());
        assert_eq!(fresh.levels[0].shares.len(), fresh.levels[0].offsets[count] as usize);
        assert!(fresh.levels[0].shares.iter().all(|share| share.trace > 0.0));
    }
}

/// On every level a point that hangs on four vertices is what an element with all products of its weights is.
#[test]
fn a_point_is_an_element_of_its_weights() {
    let tissue = Material::new(MaterialModel::StableNeoHookean, 1e4, 0.4, 1000.0).expect("legal");
    let block = Block::new(vec3(0.1, 0.03, 0.03), [20, 6, 6]);
    let mesh = Block { splitting: Splitting::Six, ..block }.mesh().expect("a bar");
    let mut builder = ModelBuilder::new();
    builder.add_body(&mesh, &tissue).expect("a body");
    let layout = Layout::new(&builder.build::<f64>().expect("a model"), &SolverSettings::default());
    let count = layout.vertex_count();
    let free: Vec<bool> = (0..count).map(|v| v % 5 != 0).collect();
    let new = || {
        let mut part = OfPart::new(&layout, &layout.parts[0], Coarseness::ON_CPU);
        part.rebuild(&layout, 0, &free);
        part
    };
    let (mut point, mut element) = (new(), new());
    assert!(point.dense.size() > 0 && point.levels.len() > 1);
    let (y, z) = (vec3(2.0, 5.0, -0.2), vec3(-0.2, -0.2, 3.0));
    let block = Mat3::from_columns(vec3(1.0, 2.0, -0.2), y, z);
    let vertices = [1, 5, 2, count as u32 - 1];
    for weights in [[0.4, 0.3, 0.2, 0.1], [1.5, 0.0, -0.5, 0.0]] {
        point.add_point((&vertices, &weights), &block, &free);
        let blocks = weights.map(|a| weights.map(|b| block * (a * b)));
        element.add_element(&vertices, &blocks, 0, &free);
    }
    let close = |a: f64, b: f64| (a - b).abs() < 1e-14 * (1.0 + a.abs().max(b.abs()));
    let mut seen = 0;
    for (of_point, of_element) in point.inverses.iter().zip(&element.inverses) {
        for (a, b) in of_point.as_flattened().iter().zip(of_element.as_flattened()) {
            assert!(close(*a, *b), "{a} {b}");
            seen += usize::from(*a != 0.0);
        }
    }
    for row in 0..point.dense.size() {
        for column in 0..=row {
            let [a, b] = [&point, &element].map(|part| part.dense.entry(row, column));
            assert!(close(a, b), "{row} {column}: {a} {b}");
            seen += usize::from(a != 0.0);
        }
    }
    assert!(seen > 200, "{seen}");
}

/// `P^T` is the transpose of `P`, and a node that is not free takes no part in either.
#[test]
fn a_restriction_is_the_transpose_of_its_prolongation() {
    let entries = vec![(0, 0.25), (1, 0.75), (1, 1.0), (2, 0.5), (0, 0.5), (2, 1.0)];
    let weights = Weights { offsets: vec![0, 2, 3, 5, 6], entries };
    let is_free = |node: usize| node != 1;
    let way = Prolongation::<f64>::new(&weights, 3, is_free);
    let workers = Workers::one();
    let point = |i: usize| Point::new(vec3(1.0 + i as f64, 0.5 * i as f64, -2.0), 0.0);
    let finer: Vec<Point<f64>> = (0..4).map(point).collect();
    let coarser: Vec<Point<f64>> = (5..8).map(point).collect();
    let (mut down, mut up) = (vec![Point::default(); 3], vec![Vec3::ZERO; 4]);
    way.restrict(&workers, &finer, &mut down);
    way.prolong(&workers, &coarser, &mut up, |_, above, value| *value = above.vec3());
    assert_eq!(down[1].vec3(), finer[0].vec3() * 0.75);
    assert_eq!((up[1], up[3]), (Vec3::ZERO, coarser[2].vec3()));
    let dot =
        |a: &[Vec3<f64>], b: &[Vec3<f64>]| -> f64 { a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum() };
    let places = |points: &[Point<f64>]| points.iter().map(|p| p.vec3()).collect::<Vec<_>>();
    let [of_coarser, of_finer] =
        [dot(&places(&down), &places(&coarser)), dot(&up, &places(&finer))];
    assert!((of_coarser - of_finer).abs() < 1e-14 * of_coarser.abs());
}
