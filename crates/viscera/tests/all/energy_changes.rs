//! Changes and second derivatives of energies: laws of tissue along a change of `F`, elements by their vertices.
//!
//! Tolerances are round-off: a term passes through some 20 roundings of half an `eps` before it is in the result, so
//! that this is off by at most `ROUNDINGS` times `eps` times the size of all terms ([`Sizes`]).

use crate::common::Random;
use crate::common::tets::{DEFORMATIONS, LAMBDA, MU, deformation};
use viscera::elements::attachment::Attachment;
use viscera::elements::green_strain::{self, Voigt};
use viscera::elements::kinds::Energy;
use viscera::elements::law::{Law, SaintVenantKirchhoff, StableNeoHookean};
use viscera::elements::spring::{self, Spring};
use viscera::material::MaterialModel;
use viscera::scalar::{Mat3, Real, Vec3, vec3};
use viscera::solver::Tissue;

const ROUNDINGS: f64 = 10.0;

/// Retardation time over the step.
const RATE: f64 = 0.3;

/// `F`, its change, and the Green strain at the start of a step, where the tissue is viscous.
struct Sample {
    f: Mat3<f64>,
    d: Mat3<f64>,
    start: Option<Voigt<f64>>,
}

/// Deformations of every kind with changes of sizes from 1e-6 to 2 or of one size; every third is viscous, every
/// fifth nearly at rest. All entries are multiples of 2^-32, so that `F + D` has no round-off in double precision.
fn samples(seed: u64, count: usize, size: Option<f64>) -> Vec<Sample> {
    let mut random = Random(seed);
    let on_grid = |m: Mat3<f64>| {
        let scale = f64::from(1 << 16) * f64::from(1 << 16);
        let round = |x: f64| libm::round(x * scale) / scale;
        Mat3 { columns: m.columns.map(|c| vec3(round(c.x), round(c.y), round(c.z))) }
    };
    let any = |random: &mut Random, size: f64| {
        Mat3::from_columns(random.vector(size), random.vector(size), random.vector(size))
    };
    (0..count)
        .map(|i| {
            let kind = random.next() % DEFORMATIONS;
            let mut f = deformation(&mut random, kind);
            if i.is_multiple_of(5) {
                f = Mat3::IDENTITY + (f - Mat3::IDENTITY) * 1e-5;
            }
            let f = on_grid(f);
            let direction = any(&mut random, 1.0);
            let size = size.unwrap_or(2.0 * libm::pow(5e-7, random.uniform(0.0, 1.0)));
            let d = on_grid(direction * (size / norm(&direction)));
            let start = green_strain::strain(&(f + any(&mut random, 0.2)));
            let start = i.is_multiple_of(3).then_some(start);
            Sample { f, d, start }
        })
        .collect()
}

fn norm(m: &Mat3<f64>) -> f64 {
    m.norm_squared().sqrt()
}

fn norm_of_strain(v: &Voigt<f64>) -> f64 {
    v.iter().map(|c| c * c).sum::<f64>().sqrt()
}

fn tissue<S: Real, L: Law>() -> Tissue<S> {
    let [lame_lambda, lame_mu, viscosity_rate] = [LAMBDA, MU, RATE].map(S::from_f64);
    Tissue { model: L::MODEL, lame_lambda, lame_mu, viscosity_rate }
}

/// Norms of all that is added up, of one sample.
struct Sizes {
    /// Of the change of the energy [Pa].
    change: f64,
    /// Of the second derivative along `D` [Pa].
    curvature: f64,
}

impl Sizes {
    fn new<L: Law>(Sample { f, d, start }: &Sample) -> Self {
        let (f_size, d_size, h) = (norm(f), norm(d), norm(&(*f - Mat3::IDENTITY)));
        // Of a law that is quadratic in strain, a strain of size `e` at `F`.
        let stiffness = 2.0 * MU + 3.0 * LAMBDA;
        let change_of_strain = (f_size + 0.5 * d_size) * d_size;
        let quadratic = |e: f64| Self {
            change: stiffness * change_of_strain * (e + 0.5 * change_of_strain),
            curvature: stiffness * (f_size * f_size + e) * d_size * d_size,
        };
        let strain = 2.0 * h + h * h;
        let mut sizes = if L::MODEL == MaterialModel::SaintVenantKirchhoff {
            quadratic(strain)
        } else {
            let rest = (4.0 * h + h * h) * d_size;
            let along = 1.8 * d_size + rest;
            let second = f_size * d_size * d_size;
            let volume = along + second + d_size.powi(3);
            let j = 1.8 * h + h * h + h.powi(3);
            let shear = h * d_size + rest + 0.5 * d_size * d_size + second + d_size.powi(3);
            let curvature = (LAMBDA + MU) * (along * along + 2.0 * j * second);
            Self {
                change: MU * shear + (LAMBDA + MU) * volume * (j + 0.5 * volume),
                curvature: curvature + MU * (d_size * d_size + 2.0 * second),
            }
        };
        if let Some(start) = start {
            let viscous = quadratic(strain + norm_of_strain(start));
            sizes.change += RATE * viscous.change;
            sizes.curvature += RATE * viscous.curvature;
        }
        sizes
    }
}

fn energy<S: Real, L: Law>(tissue: &Tissue<S>, f: &Mat3<S>, start: Option<&Voigt<S>>) -> S {
    let response = tissue.respond_by::<L>(f, start);
    response.elastic_energy + response.viscous_energy
}

fn change_is_the_difference<L: Law>() {
    let tissue = tissue::<f64, L>();
    let mut worst = 0.0f64;
    for sample in samples(21, 6000, None) {
        let Sample { f, d, start } = &sample;
        let start = start.as_ref();
        let change = tissue.energy_change_of::<L>(f, d, start);
        let after = energy::<_, L>(&tissue, &(*f + *d), start);
        let difference = after - energy::<_, L>(&tissue, f, start);
        // An energy is its change from rest.
        let size_of = |end: Mat3<f64>| {
            let d = end - Mat3::IDENTITY;
            Sizes::new::<L>(&Sample { f: Mat3::IDENTITY, d, start: start.copied() }).change
        };
        // A viscous energy is one from its start.
        let begin = start
            .map_or(0.0, |start| RATE * (2.0 * MU + 3.0 * LAMBDA) * norm_of_strain(start).powi(2));
        let size = Sizes::new::<L>(&sample).change + size_of(*f) + size_of(*f + *d) + begin;
        let error = (change - difference).abs() / (f64::EPSILON * size);
        worst = worst.max(error);
        assert!(error < ROUNDINGS, "{:?}: {change:e} and {difference:e} at {f:?}", L::MODEL);
    }
    println!("{:?}: energies' changes differ by {worst:.1} eps of their terms", L::MODEL);
}

#[test]
fn change_of_energy_is_the_difference_of_energies() {
    change_is_the_difference::<SaintVenantKirchhoff>();
    change_is_the_difference::<StableNeoHookean>();
}

/// In single precision; the oracle is the same source in double precision, which the test above holds to energies.
fn change_keeps_its_digits<L: Law>() {
    let (single, double) = (tissue::<f32, L>(), tissue::<f64, L>());
    let [mut worst, mut of_difference] = [0.0f64; 2];
    for Sample { f, d, start } in samples(22, 4000, Some(1e-5)) {
        let (f, d) = (f.cast::<f32>(), d.cast::<f32>());
        let start = start.map(|start| start.map(|c| c as f32));
        let change = single.energy_change_of::<L>(&f, &d, start.as_ref());
        let after = energy::<_, L>(&single, &(f + d), start.as_ref());
        let difference = after - energy::<_, L>(&single, &f, start.as_ref());
        let exact = Sample { f: f.cast(), d: d.cast(), start: start.map(|s| s.map(f64::from)) };
        let size = Sizes::new::<L>(&exact).change;
        let expected = double.energy_change_of::<L>(&exact.f, &exact.d, exact.start.as_ref());
        let error = (f64::from(change) - expected).abs() / size;
        worst = worst.max(error);
        of_difference = of_difference.max((f64::from(difference) - expected).abs() / size);
        let limit = ROUNDINGS * f64::from(f32::EPSILON);
        assert!(error < limit, "{:?}: {change:e} and {expected:e} at {f:?}", L::MODEL);
    }
    println!("{:?}: {worst:.1e} of its terms, the difference {of_difference:.1e}", L::MODEL);
    assert!(of_difference > 1e-3, "{:?}: a difference would do: {of_difference:e}", L::MODEL);
}

#[test]
fn small_changes_of_energy_keep_their_digits_in_single_precision() {
    change_keeps_its_digits::<SaintVenantKirchhoff>();
    change_keeps_its_digits::<StableNeoHookean>();
}

/// By differences of `P : D` along `D`, of fourth order. Energies are polynomials of sixth degree or less along
/// `D`; only the last degree is missed, by 12 h^4 times its coefficient `lh/2 (det D)^2`.
fn curvature_matches_differences<L: Law>() {
    const H: f64 = 1e-3;
    let tissue = tissue::<f64, L>();
    let mut worst = 0.0f64;
    for sample in samples(23, 3000, Some(1.0)) {
        let Sample { f, d, start } = &sample;
        let slope = |t: f64| {
            let moved = *f + *d * t;
            tissue.respond_by::<L>(&moved, start.as_ref()).piola.dot(*d)
        };
        let differences =
            (8.0 * (slope(H) - slope(-H)) - (slope(2.0 * H) - slope(-2.0 * H))) / (12.0 * H);
        let [exact, _] = tissue.curvature_along_of::<L>(f, d, start.as_ref());
        let missed = 6.0 * H.powi(4) * (LAMBDA + MU) * d.determinant().powi(2);
        // The stress of a change of length one is at most its energy's change.
        let sizes = Sizes::new::<L>(&sample);
        let rounded = ROUNDINGS * f64::EPSILON * (sizes.change / H + sizes.curvature);
        let error = (exact - differences).abs();
        worst = worst.max(error / sizes.curvature);
        assert!(
            error < 2.0 * missed + rounded,
            "{:?}: {exact:e} and {differences:e} at {f:?}",
            L::MODEL
        );
    }
    println!("{:?}: second derivatives off by {worst:.1e} of their terms", L::MODEL);
}

#[test]
fn curvature_along_a_change_matches_differences_of_the_stress() {
    curvature_matches_differences::<SaintVenantKirchhoff>();
    curvature_matches_differences::<StableNeoHookean>();
}

/// The bound has no negative part, and leaves out just the named term: `2 (lh (J - 1) - mu) F : cof D` of the volume,
/// `S : D^T D` of the stress.
fn bound_drops_one_term<L: Law>() {
    let tissue = tissue::<f64, L>();
    let single = self::tissue::<f32, L>();
    let mut negative = 0;
    for sample in samples(24, 3000, Some(1.0)) {
        let Sample { f, d, start } = &sample;
        let [exact, bound] = tissue.curvature_along_of::<L>(f, d, start.as_ref());
        let gram = |m: &Mat3<f64>| m.transpose() * *m;
        let stress_work = |strain: Mat3<f64>| {
            let stress = strain * (2.0 * MU) + Mat3::IDENTITY * (LAMBDA * strain.trace());
            stress.dot(gram(d))
        };
        let strain = (gram(f) - Mat3::IDENTITY) * 0.5;
        let mut dropped = if L::MODEL == MaterialModel::SaintVenantKirchhoff {
            stress_work(strain)
        } else {
            let pressure = (LAMBDA + MU) * (f.determinant() - 1.0) - MU;
            2.0 * pressure * f.dot(d.cofactor())
        };
        if let Some([xx, yy, zz, yz, xz, xy]) = *start {
            let shear = [yz, xz, xy].map(|c| 0.5 * c);
            let start = [xx, yy, zz, shear[0], shear[1], shear[2]];
            dropped += RATE * stress_work(strain - green_strain::symmetric(&start));
        }
        let size = Sizes::new::<L>(&sample).curvature;
        let error = (exact - bound - dropped).abs();
        assert!(error < ROUNDINGS * f64::EPSILON * size, "{exact:e}, {bound:e}, {dropped:e}");
        assert!(bound >= 0.0);
        if dropped < -ROUNDINGS * f64::EPSILON * size {
            assert!(bound > exact, "{:?}: {bound:e} below {exact:e}", L::MODEL);
            negative += 1;
        }
        let start = start.map(|start| start.map(|c| c as f32));
        let [_, bound] = single.curvature_along_of::<L>(&f.cast(), &d.cast(), start.as_ref());
        assert!(bound >= 0.0);
    }
    assert!(negative > 500, "{:?}: {negative} samples with a negative term", L::MODEL);
}

#[test]
fn bound_of_the_curvature_is_never_negative() {
    bound_drops_one_term::<SaintVenantKirchhoff>();
    bound_drops_one_term::<StableNeoHookean>();
}

/// Column of the second derivative by one coordinate: differences of forces, of fourth order, over `h` [m].
fn column<E: Energy<f64, N>, const N: usize>(
    element: &E,
    x: &[Vec3<f64>; N],
    (vertex, axis): (usize, usize),
    h: f64,
) -> [Vec3<f64>; N] {
    let forces = |t: f64| {
        let mut moved = *x;
        moved[vertex][axis] += t * h;
        element.forces(&moved)
    };
    let [a, b, c, d] = [1.0, -1.0, 2.0, -2.0].map(forces);
    std::array::from_fn(|i| ((a[i] - b[i]) * 8.0 - (c[i] - d[i])) * (-1.0 / (12.0 * h)))
}

/// Largest difference [N/m] between the blocks and differences of forces.
fn error_of_blocks<E: Energy<f64, N>, const N: usize>(
    element: &E,
    x: &[Vec3<f64>; N],
    h: f64,
) -> f64 {
    let blocks = element.blocks(x);
    let mut worst = 0.0f64;
    for vertex in 0..N {
        for axis in 0..3 {
            let differences = column(element, x, (vertex, axis), h);
            for row in 0..N {
                let error = blocks[row][vertex].columns[axis] - differences[row];
                worst = worst.max(error.length());
            }
        }
    }
    worst
}

/// `v^T B v` [J].
fn along<const N: usize>(blocks: &[[Mat3<f64>; N]; N], v: &[Vec3<f64>; N]) -> f64 {
    let mut sum = 0.0;
    for i in 0..N {
        for j in 0..N {
            sum += v[i].dot(blocks[i][j] * v[j]);
        }
    }
    sum
}

/// Stretched: the second derivative, to 1e-7 as all differences here. Compressed: positive semidefinite, as stiff along
/// the spring, without stiffness across.
#[test]
fn blocks_of_springs_are_the_second_derivative_without_its_negative_part() {
    let mut random = Random(25);
    let k = 120.0;
    let mut counts = [0; 2];
    for _ in 0..2000 {
        let x: [Vec3<f64>; 2] = std::array::from_fn(|_| random.vector(0.01));
        let length = (x[1] - x[0]).length();
        let spring = Spring { rest_length: length * random.uniform(0.0, 2.0), stiffness: k };
        let blocks = spring.blocks(&x);
        let is_stretched = length > spring.rest_length;
        counts[usize::from(is_stretched)] += 1;
        if is_stretched {
            let error = error_of_blocks(&spring, &x, 2e-3 * length);
            assert!(error < 1e-7 * k, "{error:e}");
        }
        let v: [Vec3<f64>; 2] = std::array::from_fn(|_| random.vector(1.0));
        let size = v[0].length_squared() + v[1].length_squared();
        let slack = ROUNDINGS * f64::EPSILON * k * size;
        let value = along(&blocks, &v);
        assert!(value >= -slack && value <= spring.stiffness() * size + slack, "{value:e}");
        let n = (x[1] - x[0]) * (1.0 / length);
        assert!((along(&blocks, &[n, -n]) - 4.0 * k).abs() < 8.0 * slack / size);
        if !is_stretched {
            let across = n.cross(random.vector(1.0));
            let moved = blocks[0][0] * across;
            assert!(moved.length() <= ROUNDINGS * f64::EPSILON * k, "{moved:?}");
        }
    }
    assert!(counts.iter().all(|&count| count > 500), "{counts:?}");
}

/// A spring without length has no direction: it rests, unless it rests at no length, where it is stiff in all
/// directions.
#[test]
fn blocks_of_a_spring_without_length_are_finite() {
    let x = [vec3(0.1f32, 0.2, 0.3); 2];
    assert_eq!(spring::blocks(&x, 0.004, 80.0), [[Mat3::ZERO; 2]; 2]);
    let stiff = Mat3::IDENTITY * 80.0;
    let other = stiff * -1.0;
    assert_eq!(spring::blocks(&x, 0.0, 80.0), [[stiff, other], [other, stiff]]);
}

/// An element that has only what it must: every vertex on a spring of `k` [N/m] along the first axis.
struct Plain {
    k: f64,
}

impl<const N: usize> Energy<f64, N> for Plain {
    fn energy(&self, x: &[Vec3<f64>; N]) -> f64 {
        x.iter().map(|x| 0.5 * self.k * x.x * x.x).sum()
    }

    fn forces(&self, x: &[Vec3<f64>; N]) -> [Vec3<f64>; N] {
        x.map(|x| vec3(-self.k * x.x, 0.0, 0.0))
    }

    fn curvature(&self) -> f64 {
        self.k
    }

    fn stiffness(&self) -> f64 {
        self.k
    }
}

#[test]
fn attachments_and_plain_elements_have_blocks_and_changes() {
    let mut random = Random(26);
    for _ in 0..200 {
        let (x, d) = ([random.vector(0.01)], [random.vector(0.001)]);
        let attachment = Attachment { anchor: random.vector(0.01), stiffness: 80.0 };
        let error = error_of_blocks(&attachment, &x, 1e-4);
        assert!(error < 1e-7 * attachment.stiffness, "{error:e}");
        // The energy is quadratic: its change is that of its first two derivatives.
        let taylor = -attachment.forces(&x)[0].dot(d[0]) + 0.5 * along(&attachment.blocks(&x), &d);
        let change = attachment.energy_change(&x, &d);
        let size = attachment.stiffness * 0.04f64.powi(2);
        assert!((change - taylor).abs() < ROUNDINGS * f64::EPSILON * size, "{change:e} {taylor:e}");

        let (plain, x, d) = (Plain { k: 50.0 }, [x[0], d[0]], [d[0], x[0]]);
        let stiff = Mat3::IDENTITY * plain.k;
        assert_eq!(plain.blocks(&x), [[stiff, Mat3::ZERO], [Mat3::ZERO, stiff]]);
        let change = plain.energy_change(&x, &d);
        let expected = [0, 1].map(|i| plain.k * d[i].x * (x[i].x + 0.5 * d[i].x));
        assert!((change - expected[0] - expected[1]).abs() < ROUNDINGS * f64::EPSILON * size);
    }
}

/// Against the difference of energies; and of changes so small that a difference has no digit left, in single precision
/// against double.
#[test]
fn changes_of_springs_and_attachments_keep_their_digits() {
    let mut random = Random(27);
    for i in 0..3000 {
        let scale = [1.0, 1e-3, 1e-6][i % 3];
        let x: [Vec3<f32>; 2] = std::array::from_fn(|_| random.vector(0.01).cast());
        let d: [Vec3<f32>; 2] = std::array::from_fn(|_| random.vector(0.01 * scale).cast());
        let (single, double) = (
            Spring { rest_length: 0.006f32, stiffness: 80.0f32 },
            Spring { rest_length: f64::from(0.006f32), stiffness: 80.0 },
        );
        let [wide, along] = [x, d].map(|pair| pair.map(|v| v.cast::<f64>()));
        let change = double.energy_change(&wide, &along);
        let length = (wide[1] - wide[0]).length() + along[0].length() + along[1].length();
        // All lengths, and that of the spring itself.
        let size = 80.0 * (along[0].length() + along[1].length()) * (length + 0.006);
        let moved = [wide[0] + along[0], wide[1] + along[1]];
        let difference = double.energy(&moved) - double.energy(&wide);
        let whole = 80.0 * (length + 0.006) * (length + 0.006);
        assert!((change - difference).abs() < ROUNDINGS * f64::EPSILON * whole, "{change:e}");
        let error = f64::from(single.energy_change(&x, &d)) - change;
        assert!(error.abs() < ROUNDINGS * f64::from(f32::EPSILON) * size, "{change:e}: {error:e}");

        let attachment = Attachment { anchor: x[1], stiffness: 80.0f32 };
        let exact = Attachment { anchor: wide[1], stiffness: 80.0 };
        let error = f64::from(attachment.energy_change(&[x[0]], &[d[0]]))
            - exact.energy_change(&[wide[0]], &[along[0]]);
        let size = 80.0 * along[0].length() * ((wide[0] - wide[1]).length() + along[0].length());
        assert!(error.abs() < ROUNDINGS * f64::from(f32::EPSILON) * size, "{error:e}");
    }
}
