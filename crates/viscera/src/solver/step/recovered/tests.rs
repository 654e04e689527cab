//! Passes in lanes beside the truth, one tetrahedron at a time.

use super::{Along, Found, Load, Recovered, RecoveredTets, Since};
use crate::layout::{Domains, Layout, RecoveredTables, Smoothing};
use crate::material::{Material, MaterialModel};
use crate::mesh::TetMesh;
use crate::mesh::shapes::Block;
use crate::model::{Model, ModelBuilder};
use crate::scalar::lanes::{Instructions, Point};
use crate::scalar::{Real, Vec3, vec3};
use crate::settings::{Elements, Method, SolverSettings, Threads};
use crate::solver::cpu::threads::{Shared, Workers};
use crate::solver::step::data::gather;

const ALL: [Smoothing; 3] = [Smoothing::RECOVERED, Smoothing::FITTED, Smoothing::AVERAGED];

/// Three bodies: one of two materials that touch and of more than one piece, one of another law, one that is small.
fn model<S: Real>() -> Model<S> {
    let mut builder = ModelBuilder::new();
    let soft = |law, poisson| Material::new(law, 5e3, poisson, 1000.0).expect("legal");
    let snh = MaterialModel::StableNeoHookean;
    let large = Block::new(vec3(0.08, 0.04, 0.04), [18, 8, 8]).mesh().expect("a block");
    let label = |tet: &[u32; 4]| {
        let middle = tet.iter().fold(Vec3::ZERO, |sum, &v| sum + large.vertices()[v as usize]);
        u32::from(middle.x > 0.2) + 1
    };
    let regions = large.tets().iter().map(label).collect();
    let large = TetMesh::new(large.vertices().to_vec(), large.tets().to_vec(), regions);
    let large = large.expect("a mesh").0;
    let body = builder.add_body(&large, &soft(snh, 0.45)).expect("a body");
    builder.set_region_material(body, 2, &soft(snh, 0.3)).expect("a region");
    let small = Block::new(vec3(0.02, 0.02, 0.02), [2, 1, 1]).mesh().expect("a block");
    let other = MaterialModel::SaintVenantKirchhoff;
    builder.add_body(&small, &soft(other, 0.3)).expect("a body");
    builder.add_body(&small, &soft(snh, 0.49)).expect("a body");
    builder.build().expect("a model")
}

/// Between -1 and 1. Squares, because three sines in a row lie in a plane: no volume would change by the third power.
fn noise(k: usize) -> f64 {
    libm::sin((k * k % 1009) as f64 * 78.233)
}

/// How far vertices are pushed [m]: less than a cell, and enough to put tetrahedra below the volume floor.
const PUSHED: [f64; 2] = [4e-4, 2.5e-3];

/// Places of the layout, pushed about.
fn moved<S: Real>(model: &Model<S>, layout: &Layout<S>, by: f64) -> (Vec<Vec3<S>>, Vec<Point<S>>) {
    let noise = |k: usize| by * noise(k);
    let place = |(v, x): (usize, &Vec3<S>)| {
        *x + vec3(noise(3 * v), noise(3 * v + 1), noise(3 * v + 2)).cast()
    };
    let places: Vec<Vec3<S>> = model.rest_positions.iter().enumerate().map(place).collect();
    let mut points = vec![Point::default(); places.len()];
    for (v, x) in places.iter().enumerate() {
        points[layout.numbering.of(v as u32)].set_vec3(*x);
    }
    (places, points)
}

/// Forces [N] of all parts by vertices in the caller's numbering, and energies [J].
fn by_passes<S: Real>(
    model: &Model<S>,
    smoothing: Smoothing,
    instructions: Instructions,
    threads: u32,
    by: f64,
) -> (Vec<Vec3<S>>, Vec<f64>) {
    let settings = SolverSettings { method: Method::Explicit, ..SolverSettings::default() };
    let mut layout = Layout::new(model, &settings);
    let mut workers = Workers::new(Threads::Count(threads), model.tet_count());
    workers.instructions = instructions;
    let domains = Domains::new(model, smoothing);
    layout.recovered = Some(RecoveredTables::new(&layout, &domains));
    let mut passes = RecoveredTets::new(&layout, layout.recovered.as_ref().expect("tables"));
    assert!(passes.bytes() > 0);
    let (_, points) = moved(model, &layout, by);
    let mut loads = vec![Point::default(); layout.copy_count()];
    let (mut energies, mut any) = (Vec::new(), false);
    workers.entrance().enter(|| {
        for part in 0..layout.part_count() {
            let inverted = passes.evaluate(&workers, &layout, part, &points);
            any |= inverted;
            energies.push(passes.energy(&workers, &layout, part));
            let load = Load { scale: S::TWO, viscous: None, goes_on: false, at_rest: None };
            passes.add_forces(&workers, &layout, part, &load, &mut loads);
        }
    });
    assert_eq!(any, by > PUSHED[0]);
    let force = |v: u32| {
        let copies = &loads[layout.copies_of(v)];
        copies.iter().fold(Vec3::ZERO, |sum, copy| sum + copy.vec3()) * S::HALF
    };
    ((0..model.vertex_count() as u32).map(force).collect(), energies)
}

fn as_the_truth<S: Real>(tolerance: f64, by: f64) {
    let model = model::<S>();
    let settings = SolverSettings { method: Method::Explicit, ..SolverSettings::default() };
    let (places, _) = moved(&model, &Layout::new(&model, &settings), by);
    for smoothing in ALL {
        let domains = Domains::new(&model, smoothing);
        let mut truth = Recovered::new(&domains);
        truth.evaluate(&domains, &model.materials, &places);
        let mut gradient = vec![Vec3::ZERO; places.len()];
        truth.add_gradient(&domains, &model.materials, &mut gradient);
        let expected = truth.energy(&domains, &model.materials);
        let (forces, energies) = by_passes(&model, smoothing, Instructions::detect(), 1, by);
        let largest = gradient.iter().fold(0.0f64, |most, g| most.max(g.length().to_f64()));
        for (force, gradient) in forces.iter().zip(&gradient) {
            let off = (*force + *gradient).length().to_f64() / largest;
            assert!(off < tolerance, "{smoothing:?}: {off:e}");
        }
        let energy: f64 = energies.iter().sum();
        assert!((energy / expected - 1.0).abs() < tolerance, "{energy:e} of {expected:e} J");
        for (instructions, threads) in [(Instructions::Portable, 1), (Instructions::detect(), 3)] {
            let again = by_passes(&model, smoothing, instructions, threads, by);
            assert!(again == (forces.clone(), energies.clone()), "{instructions:?}, {threads}");
        }
    }
}

#[test]
fn passes_in_lanes_are_the_truth() {
    for by in PUSHED {
        as_the_truth::<f64>(1e-13, by);
        as_the_truth::<f32>(1e-5, by);
    }
}

/// Along displacements that are half as long as the places are off: the change of the energy and its second derivative are
/// the truth's, by any instructions and threads.
fn along_as_the_truth<S: Real>(tolerance: f64, by: f64) {
    let model = model::<S>();
    let (method, elements) = (Method::QuasiNewton, Elements::Recovered);
    let settings = SolverSettings { method, elements, ..SolverSettings::default() };
    let layout = Layout::new(&model, &settings);
    let (places, points) = moved(&model, &layout, by);
    let back: Vec<Vec3<S>> =
        places.iter().zip(&model.rest_positions).map(|(x, rest)| (*rest - *x) * S::HALF).collect();
    let domains = Domains::new(&model, Smoothing::RECOVERED);
    let (mut truth, mut along) = (Recovered::new(&domains), Recovered::new(&domains));
    truth.evaluate(&domains, &model.materials, &places);
    along.take_gradients(&domains, &back);
    let expected = truth.variation(&domains, &model.materials, &mut along);
    let tables = layout.recovered.as_ref().expect("tables");
    let found = |instructions: Instructions, threads: u32| {
        let mut workers = Workers::new(Threads::Count(threads), model.tet_count());
        workers.instructions = instructions;
        let mut passes = RecoveredTets::new(&layout, tables);
        let mut along = Along::new(&layout, tables);
        assert!(along.bytes() > 0);
        for (v, d) in back.iter().enumerate() {
            along.moved[layout.numbering.of(v as u32)].set_vec3(*d);
        }
        let mut sums = [[0.0; 2]; 2];
        workers.entrance().enter(|| {
            for part in 0..layout.part_count() {
                passes.evaluate(&workers, &layout, part, &points);
                for (sum, found) in sums.iter_mut().zip([Found::Change, Found::Curvature]) {
                    let since = Since { strains: &[], dt: 1.0 };
                    let of_part = passes.along(&workers, &layout, part, (&mut along, found), since);
                    sum.iter_mut().zip(of_part).for_each(|(sum, more)| *sum += more);
                }
            }
        });
        sums
    };
    let sums = found(Instructions::detect(), 1);
    let [[change, size], [curvature, bound]] = sums;
    assert!((change / expected.change - 1.0).abs() < tolerance, "{change} of {}", expected.change);
    assert!(
        (curvature / expected.second - 1.0).abs() < tolerance,
        "{curvature} of {}",
        expected.second
    );
    assert!(size >= change.abs() && bound > 0.0, "{size} J, {bound} J");
    for (instructions, threads) in [(Instructions::Portable, 1), (Instructions::detect(), 3)] {
        assert!(found(instructions, threads) == sums, "{instructions:?}, {threads}");
    }
}

#[test]
fn change_and_curvature_in_lanes_are_the_truth() {
    for by in PUSHED {
        along_as_the_truth::<f64>(1e-12, by);
        along_as_the_truth::<f32>(1e-4, by);
    }
}

/// Of viscous tissue: the change along displacements is the integral of the forces on the way, which viscosity is a part of, and
/// the curvature their difference. Three points of Gauss and a central difference err by less than a ten-millionth here.
#[test]
fn change_and_curvature_of_viscous_tissue_are_those_of_its_forces() {
    let tissue = Material::new(MaterialModel::StableNeoHookean, 5e3, 0.45, 1000.0).expect("legal");
    let tissue = tissue.with_viscosity(0.02).expect("legal");
    let mesh = Block::new(vec3(0.04, 0.02, 0.02), [4, 2, 2]).mesh().expect("a block");
    let mut builder = ModelBuilder::new();
    builder.add_body(&mesh, &tissue).expect("a body");
    let model: Model<f64> = builder.build().expect("a model");
    let (method, elements) = (Method::QuasiNewton, Elements::Recovered);
    let settings = SolverSettings { method, elements, ..SolverSettings::default() };
    let layout = Layout::new(&model, &settings);
    let (_, points) = moved(&model, &layout, PUSHED[0]);
    let tables = layout.recovered.as_ref().expect("tables");
    let (mut passes, mut along) =
        (RecoveredTets::new(&layout, tables), Along::new(&layout, tables));
    for (v, d) in along.moved.iter_mut().enumerate() {
        let noise = |k: usize| 1e-4 * noise(9 + 3 * v + k);
        d.set_vec3(vec3(noise(0), noise(1), noise(2)));
    }
    let law = MaterialModel::StableNeoHookean as usize;
    let mut strains = vec![[[0.0; 8]; 6]; layout.tet_sets[law].block_count()];
    let (workers, dt) = (Workers::one(), 0.01);
    let moved = along.moved.clone();
    // Of the energy, after a share of the displacements.
    let mut slope = |passes: &mut RecoveredTets<f64>, share: f64| -> f64 {
        let mut at = points.clone();
        for (x, d) in at.iter_mut().zip(&moved) {
            let place = x.vec3() + d.vec3() * share;
            x.set_vec3(place);
        }
        passes.evaluate(&workers, &layout, 0, &at);
        let viscous = Some((Shared::new(&mut strains), 1.0 / dt));
        let load = Load { scale: 1.0, viscous, goes_on: false, at_rest: None };
        let mut loads = vec![Point::default(); layout.copy_count()];
        passes.add_forces(&workers, &layout, 0, &load, &mut loads);
        let of_vertex = |v: usize| gather(&layout, &loads, v).vec3().dot(moved[v].vec3());
        -(0..layout.vertex_count()).map(of_vertex).sum::<f64>()
    };
    let away = 0.5 * libm::sqrt(0.6);
    let ends = [0.5 - away, 0.5 + away].map(|share| slope(&mut passes, share));
    let integral = (5.0 * (ends[0] + ends[1]) + 8.0 * slope(&mut passes, 0.5)) / 18.0;
    let difference = (slope(&mut passes, 1e-3) - slope(&mut passes, -1e-3)) / 2e-3;
    passes.evaluate(&workers, &layout, 0, &points);
    let starts = vec![[[0.0; 8]; 6]; layout.tet_sets[law].block_count()];
    let mut find = |found| {
        let since = Since { strains: &starts, dt };
        passes.along(&workers, &layout, 0, (&mut along, found), since)[0]
    };
    let [change, curvature] = [Found::Change, Found::Curvature].map(&mut find);
    assert!((change / integral - 1.0).abs() < 1e-7, "{change} of {integral} J");
    assert!((curvature / difference - 1.0).abs() < 1e-7, "{curvature} of {difference} J");
}

/// An inverted tetrahedron is reported, of its own part only.
#[test]
fn an_inverted_tetrahedron_is_reported() {
    let model = model::<f64>();
    let (method, elements) = (Method::Explicit, Elements::Recovered);
    let settings = SolverSettings { method, elements, ..SolverSettings::default() };
    let layout = Layout::new(&model, &settings);
    let mut passes = RecoveredTets::new(&layout, layout.recovered.as_ref().expect("tables"));
    let (_, mut points) = moved(&model, &layout, PUSHED[0]);
    let v = layout.parts[2].vertices.start;
    let away = points[v].vec3() + vec3(0.1, 0.1, 0.1);
    points[v].set_vec3(away);
    let workers = Workers::one();
    let told = [0, 1, 2].map(|part| passes.evaluate(&workers, &layout, part, &points));
    assert_eq!(told, [false, false, true]);
}
