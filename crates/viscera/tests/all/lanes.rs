//! Lanes are numbers side by side: every operation and every element's function gives the bits that
//! one number gives, with any instructions. A number that is none has no bits to speak of.
//!
//! Lanes are only reached through `lanes::run`, which knows what the processor has.
#![allow(unsafe_code)]

use crate::common::Random;
use crate::common::tets::{DEFORMATIONS, deformation};
use viscera::elements::law::{Law, SaintVenantKirchhoff, StableNeoHookean};
use viscera::elements::singular_values::signed_svd;
use viscera::elements::{CornerLoad, TetCorrection, deformation_gradient};
use viscera::elements::{green_strain, neo_hookean, neo_hookean_pair, neo_hookean_stretch};
use viscera::material::Compliance;
use viscera::scalar::lanes::{Eight, Instructions, Kernel, LANES, Lanes, Point, run};
use viscera::scalar::{Mat3, Real, Scalar, Vec3, vec3};

const BOTH: [Instructions; 2] = [Instructions::Portable, Instructions::Avx2];

/// Bits of a number; one pattern for all that are none.
fn bits<R: Real>(value: R) -> u64 {
    let value = value.to_f64();
    if value.is_nan() { u64::MAX } else { value.to_bits() }
}

/// A function from `N` numbers to as many as it likes, of one number or of eight.
trait Function<const N: usize> {
    fn of<T: Scalar>(values: &[T; N]) -> Vec<(&'static str, Vec<T>)>;
}

/// What a function makes of eight inputs at once, lane by lane.
struct InLanes<'a, F, R, const N: usize> {
    function: std::marker::PhantomData<F>,
    inputs: &'a [[R; N]; LANES],
    outputs: &'a mut Vec<(&'static str, Vec<Eight<R>>)>,
}

impl<F: Function<N>, R: Real, const N: usize> Kernel<R> for InLanes<'_, F, R, N> {
    #[inline(always)]
    fn run<L: Lanes<Real = R>>(self) {
        for first in (0..LANES).step_by(L::WIDTH) {
            let mut values = [L::ZERO; N];
            for (i, value) in values.iter_mut().enumerate() {
                *value = L::load(&self.inputs.map(|lane| lane[i]), first);
            }
            for (place, (name, results)) in F::of(&values).into_iter().enumerate() {
                if first == 0 {
                    self.outputs.push((name, vec![[R::ZERO; LANES]; results.len()]));
                }
                for (output, result) in self.outputs[place].1.iter_mut().zip(results) {
                    result.store(output, first);
                }
            }
        }
    }
}

/// Compares all lanes of all instructions with single numbers; returns how many results were numbers.
fn compare<F: Function<N>, R: Real, const N: usize>(inputs: &[[R; N]; LANES]) -> usize {
    let alone = inputs.map(|lane| F::of(&lane));
    let mut finite = 0;
    for instructions in BOTH {
        let mut outputs = Vec::new();
        let function = std::marker::PhantomData::<F>;
        run(instructions, InLanes { function, inputs, outputs: &mut outputs });
        for (lane, expected) in alone.iter().enumerate() {
            assert_eq!(expected.len(), outputs.len());
            for ((name, expected), (_, given)) in expected.iter().zip(&outputs) {
                for (i, (expected, given)) in expected.iter().zip(given).enumerate() {
                    let given = given[lane];
                    finite += usize::from(given.is_finite());
                    assert!(
                        bits(given) == bits(*expected),
                        "{} {instructions:?}: {name}[{i}] in lane {lane}: {given:?}, alone \
                         {expected:?}, of {:?}",
                        R::NAME,
                        inputs[lane]
                    );
                }
            }
        }
    }
    finite
}

struct Operations;

impl Function<2> for Operations {
    #[inline(always)]
    fn of<T: Scalar>(&[a, b]: &[T; 2]) -> Vec<(&'static str, Vec<T>)> {
        let (mut sum, mut difference, mut product) = (a, a, a);
        sum += b;
        difference -= b;
        product *= b;
        vec![
            ("+", vec![a + b, sum]),
            ("-", vec![a - b, difference]),
            ("*", vec![a * b, product]),
            ("/", vec![a / b]),
            ("negated", vec![-a]),
            ("sqrt", vec![a.sqrt()]),
            ("abs", vec![a.abs()]),
            ("min", vec![a.min(b)]),
            ("max", vec![a.max(b)]),
            ("select", vec![T::select(a.less(b), a, b), T::select(a.less(b), T::ONE, T::ZERO)]),
            ("constants", vec![T::ZERO, T::ONE, T::HALF, T::TWO, T::from_f64(0.1), T::default()]),
        ]
    }
}

/// What arithmetic treats in a way of its own, and numbers of all sizes.
fn odd_numbers<R: Real>() -> Vec<R> {
    let (smallest, largest) = match R::NAME {
        "f32" => (f64::from(f32::from_bits(1)), f64::from(f32::MAX)),
        _ => (f64::from_bits(1), f64::MAX),
    };
    let mut numbers = vec![0.0, 1.0, smallest, 1000.0 * smallest, largest, 0.5 * largest];
    numbers.extend([f64::INFINITY, f64::NAN, 1.0 / 3.0, 3.0]);
    let mut random = Random(1);
    let powers = if R::NAME == "f32" { 38.0 } else { 300.0 };
    for _ in 0..30 {
        numbers.push(libm::exp10(random.uniform(-powers, powers)) * random.uniform(0.5, 1.0));
    }
    numbers.into_iter().flat_map(|n| [n, -n]).map(R::from_f64).collect()
}

fn every_operation_gives_the_same_bits<R: Real>() {
    let numbers = odd_numbers::<R>();
    let pairs: Vec<[R; 2]> =
        numbers.iter().flat_map(|&a| numbers.iter().map(move |&b| [a, b])).collect();
    for eight in pairs.as_chunks::<LANES>().0 {
        compare::<Operations, R, 2>(eight);
    }
}

#[test]
fn operations_in_lanes_give_the_bits_of_single_numbers() {
    every_operation_gives_the_same_bits::<f32>();
    every_operation_gives_the_same_bits::<f64>();
}

/// Everything that moves lanes about.
struct Memory<'a, R> {
    points: &'a mut [Point<R>],
    indices: Eight<u32>,
}

impl<R: Real> Kernel<R> for Memory<'_, R> {
    #[inline(always)]
    fn run<L: Lanes<Real = R>>(self) {
        let eight: Eight<R> = std::array::from_fn(|lane| R::from_f64(lane as f64 + 0.5));
        let Self { points, indices } = self;
        assert!(indices.iter().all(|&i| (i as usize) < points.len()));
        let before = points.to_vec();
        for first in (0..LANES).step_by(L::WIDTH) {
            let lanes = first..first + L::WIDTH;
            let mut copy = [-R::ONE; LANES];
            L::load(&eight, first).store(&mut copy, first);
            for lane in 0..LANES {
                let expected = if lanes.contains(&lane) { eight[lane] } else { -R::ONE };
                assert_eq!(copy[lane], expected, "lane {lane} from {first}");
            }
            for low in lanes.clone() {
                // True in every lane but the one that is not above zero.
                let mut values = [R::ONE; LANES];
                values[low] = R::ZERO;
                assert!(!L::all(L::ZERO.less(L::load(&values, first))), "lane {low}");
            }

            // SAFETY: indices are within the points, which nobody else has.
            let gathered = unsafe { L::gather(points.as_ptr(), &indices, first) };
            let mut columns = [[R::ZERO; LANES]; 4];
            let components = [gathered.x, gathered.y, gathered.z, gathered.w];
            for (column, component) in columns.iter_mut().zip(components) {
                component.store(column, first);
            }
            let [x, y, z, w] = columns;
            for lane in lanes {
                let point = Point { x: x[lane], y: y[lane], z: z[lane], w: w[lane] };
                assert_eq!(point, before[indices[lane] as usize], "lane {lane}");
            }
            let scaled = |factor: L| Point {
                x: gathered.x * factor,
                y: gathered.y * factor,
                z: gathered.z * factor,
                w: gathered.w * factor,
            };
            // SAFETY: as above, and every index occurs once.
            unsafe { L::scatter(points.as_mut_ptr(), &indices, first, scaled(L::TWO)) };
            // SAFETY: as above.
            unsafe { L::scatter_add(points.as_mut_ptr(), &indices, first, scaled(L::ONE)) };
        }
        assert!(L::all(L::ZERO.less(L::ONE)));
        for (i, (point, before)) in points.iter().zip(&before).enumerate() {
            let factor = if indices.contains(&(i as u32)) { 3.0 } else { 1.0 };
            let expected = before.vec3() * R::from_f64(factor);
            assert_eq!(point.vec3(), expected, "point {i}");
            assert_eq!(point.w, before.w * R::from_f64(factor), "point {i}");
        }
    }
}

fn lanes_go_where_they_belong<R: Real>() {
    for instructions in BOTH {
        let number = |i: usize| R::from_f64(i as f64);
        let mut points: Vec<Point<R>> = (0..20)
            .map(|i| Point::new(vec3(number(i), number(100 + i), -number(i)), number(7 * i)))
            .collect();
        let indices = [19, 0, 7, 3, 11, 4, 18, 2];
        run(instructions, Memory { points: &mut points, indices });
    }
}

#[test]
fn lanes_come_from_memory_and_go_back_in_order() {
    lanes_go_where_they_belong::<f32>();
    lanes_go_where_they_belong::<f64>();
}

#[test]
fn instructions_that_the_processor_lacks_are_never_chosen() {
    assert_eq!(Instructions::Portable.or_detect(), Instructions::Portable);
    assert_eq!(Instructions::Avx2.or_detect(), Instructions::detect());
}

/// Corners, inverse masses, rest shape, multipliers, viscous target, Lame constants, step volume.
const TET: usize = 12 + 4 + 9 + 6 + 6 + 2 + 1;

#[inline(always)]
fn vector<T: Scalar>(values: &[T]) -> Vec3<T> {
    vec3(values[0], values[1], values[2])
}

#[inline(always)]
fn matrix<T: Scalar>(values: &[T]) -> Mat3<T> {
    Mat3::from_columns(vector(&values[..3]), vector(&values[3..6]), vector(&values[6..9]))
}

fn numbers<T: Scalar>(m: &Mat3<T>) -> Vec<T> {
    m.columns.iter().flat_map(|c| c.to_array()).collect()
}

fn correction<T: Scalar, const N: usize>(change: &TetCorrection<T, N>) -> Vec<T> {
    let positions = change.positions.iter().flat_map(|x| x.to_array());
    change.multipliers.into_iter().chain(positions).collect()
}

fn loads<T: Scalar>(loads: &[CornerLoad<T>; 4]) -> Vec<T> {
    loads.iter().flat_map(|l| [l.impulse.x, l.impulse.y, l.impulse.z, l.mass_bound]).collect()
}

/// One tetrahedron from its numbers.
struct Tet<T> {
    x: [Vec3<T>; 4],
    w: [T; 4],
    shape: Mat3<T>,
    f: Mat3<T>,
    l: [T; 6],
    target: [T; 6],
    lambda: T,
    mu: T,
    step_volume: T,
}

impl<T: Scalar> Tet<T> {
    #[inline(always)]
    fn new(n: &[T; TET]) -> Self {
        let x = [vector(&n[0..]), vector(&n[3..]), vector(&n[6..]), vector(&n[9..])];
        let shape = matrix(&n[16..25]);
        Self {
            f: deformation_gradient(&x, &shape),
            x,
            w: [n[12], n[13], n[14], n[15]],
            shape,
            l: [n[25], n[26], n[27], n[28], n[29], n[30]],
            target: [n[31], n[32], n[33], n[34], n[35], n[36]],
            lambda: n[37],
            mu: n[38],
            step_volume: n[39],
        }
    }

    #[inline(always)]
    fn compliance(&self) -> Compliance<T> {
        let shear = T::ONE / (self.mu * self.step_volume);
        Compliance { normal: shear * T::from_f64(0.4), cross: shear * T::from_f64(-0.1), shear }
    }
}

/// Of a law, along a change of `F` made of the numbers at hand.
#[inline(always)]
fn change_and_curvatures<W: Law, T: Scalar>(t: &Tet<T>) -> Vec<T> {
    let [a, b, c, d, e, f] = t.target;
    let along = Mat3::from_columns(vec3(a, b, c), vec3(d, e, f), vec3(b, d, f));
    let [exact, bound] = W::curvature_along(&t.f, &along, t.lambda, t.mu);
    vec![W::energy_change(&t.f, &along, t.lambda, t.mu), exact, bound]
}

/// Functions of a tetrahedron, each compiled by itself: all in one would take minutes.
macro_rules! of_a_tetrahedron {
    ($($name:ident: $tet:ident => $results:expr;)*) => {
        $(
            struct $name;

            impl Function<TET> for $name {
                #[inline(always)]
                fn of<T: Scalar>(values: &[T; TET]) -> Vec<(&'static str, Vec<T>)> {
                    let $tet = Tet::new(values);
                    vec![(stringify!($name), $results)]
                }
            }
        )*

        /// Compares all of them; returns how many numbers were compared and how many were finite.
        fn compare_all<R: Real>(inputs: &[[R; TET]; LANES]) -> [usize; 2] {
            let (mut all, mut finite) = (0, 0);
            $(
                all += BOTH.len() * LANES * $name::of(&inputs[0])[0].1.len();
                finite += compare::<$name, R, TET>(inputs);
            )*
            [all, finite]
        }
    };
}

of_a_tetrahedron! {
    SignedSvd: t => {
        let svd = signed_svd(&t.f);
        [numbers(&svd.u), svd.sigma.to_vec(), numbers(&svd.v)].concat()
    };
    GreenSolve: t => {
        correction(&green_strain::solve(&t.x, &t.w, &t.shape, &t.l, None, &t.compliance()))
    };
    GreenSolveToTarget: t => {
        let target = Some(&t.target);
        correction(&green_strain::solve(&t.x, &t.w, &t.shape, &t.l, target, &t.compliance()))
    };
    GreenLoads: t => loads(&green_strain::corner_loads(&t.x, &t.shape, &t.l));
    GreenEnergyAndStress: t => {
        let (strain, s) = (green_strain::strain(&t.f), t.step_volume);
        let mut results = vec![green_strain::energy_density(&strain, t.lambda, t.mu)];
        results.extend(numbers(&green_strain::piola(&t.f, &strain, t.lambda, t.mu)));
        results.extend(green_strain::constitutive_multipliers(&strain, t.lambda, t.mu, s));
        results
    };
    NeoHookeanEnergyAndStress: t => {
        let mut results = vec![neo_hookean::energy_density(&t.f, t.lambda, t.mu)];
        results.extend(numbers(&neo_hookean::piola(&t.f, t.lambda, t.mu)));
        results
    };
    GreenChange: t => change_and_curvatures::<SaintVenantKirchhoff, T>(&t);
    NeoHookeanChange: t => change_and_curvatures::<StableNeoHookean, T>(&t);
    PairSolve: t => {
        let (l, s) = ([t.l[0], t.l[1]], t.step_volume);
        correction(&neo_hookean_pair::solve(&t.x, &t.w, &t.shape, &l, t.lambda, t.mu, s))
    };
    PairLoads: t => loads(&neo_hookean_pair::corner_loads(&t.x, &t.shape, &[t.l[0], t.l[1]]));
    PairMultipliers: t => {
        neo_hookean_pair::constitutive_multipliers(&t.f, t.lambda, t.mu, t.step_volume).to_vec()
    };
    StretchSolve: t => {
        let s = t.step_volume;
        correction(&neo_hookean_stretch::solve(&t.x, &t.w, &t.shape, &t.l, t.lambda, t.mu, s))
    };
    StretchLoads: t => loads(&neo_hookean_stretch::corner_loads(&t.x, &t.shape, &t.l));
    StretchMultipliers: t => {
        let s = t.step_volume;
        neo_hookean_stretch::constitutive_multipliers(&t.f, t.lambda, t.mu, s).to_vec()
    };
}

fn tetrahedron<R: Real>(random: &mut Random) -> [R; TET] {
    let rest = loop {
        let edges =
            Mat3::from_columns(random.vector(0.01), random.vector(0.01), random.vector(0.01));
        if edges.determinant() > 1e-7 {
            break edges;
        }
    };
    let kind = random.next() % DEFORMATIONS;
    let edges = deformation(random, kind) * rest;
    let first = random.vector(0.1);
    let mut values: Vec<f64> = first.to_array().to_vec();
    values.extend(edges.columns.iter().flat_map(|edge| (first + *edge).to_array()));
    for _ in 0..4 {
        // Some are pinned.
        let pinned = random.next().is_multiple_of(5);
        values.push(if pinned { 0.0 } else { random.uniform(1e2, 1e4) });
    }
    values.extend(rest.inverse().columns.iter().flat_map(|c| c.to_array()));
    let (step_volume, at_rest) = (rest.determinant() / 6.0 * 1e-6, random.next().is_multiple_of(4));
    let size = if at_rest { 0.0 } else { 1e4 * step_volume };
    values.extend((0..6).map(|_| random.uniform(-size, size)));
    values.extend((0..6).map(|_| random.uniform(-0.3, 0.3)));
    values.extend([random.uniform(1e3, 1e5), random.uniform(1e3, 1e4), step_volume]);
    std::array::from_fn(|i| R::from_f64(values[i]))
}

fn elements_give_the_same_bits<R: Real>() {
    let mut random = Random(11);
    let [mut all, mut finite] = [0; 2];
    for _ in 0..400 {
        let inputs: [[R; TET]; LANES] = std::array::from_fn(|_| tetrahedron(&mut random));
        let [more, more_finite] = compare_all(&inputs);
        (all, finite) = (all + more, finite + more_finite);
    }
    // Comparing what is no number would prove nothing.
    assert!(finite * 100 > all * 99, "{finite} of {all} results are finite");
}

#[test]
fn elements_in_lanes_give_the_bits_of_single_tetrahedra() {
    elements_give_the_same_bits::<f32>();
    elements_give_the_same_bits::<f64>();
}
