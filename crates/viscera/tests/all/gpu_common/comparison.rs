//! Errors of single precision on the processor and on the device, against the oracle.

use super::Gpu;
use super::functions::Twin;
use super::inputs::Records;
use crate::common::Random;

/// Distance from 1 to the next larger number in single precision.
const EPSILON: f64 = f32::EPSILON as f64;

/// Errors below this are not compared: where the processor is exact, a device may still round, and
/// its divisions and square roots may be off by some units in the last place.
const FLOOR: f64 = 2.0 * EPSILON;

/// The square of a smaller number is denormal in single precision, and devices may take such
/// numbers for zero.
const NO_SQUARE: f64 = 1e-19;

/// One function's results for one record, by unit.
pub struct Comparison {
    pub twin: &'static str,
    pub result: &'static str,
    pub record: usize,
    pub oracle: Vec<f64>,
    pub cpu: Vec<f64>,
    pub gpu: Vec<f64>,
}

fn norm(values: impl Iterator<Item = f64>) -> f64 {
    values.map(|value| value * value).sum::<f64>().sqrt()
}

/// Normwise relative; zero where both are the same, infinite where one is not a number.
fn error(value: &[f64], oracle: &[f64]) -> f64 {
    let difference = norm(value.iter().zip(oracle).map(|(a, b)| a - b));
    if difference == 0.0 {
        return 0.0;
    }
    let relative = difference / norm(oracle.iter().copied());
    if relative.is_nan() { f64::INFINITY } else { relative }
}

fn wide(values: &[f32]) -> Vec<f64> {
    values.iter().map(|&value| f64::from(value)).collect()
}

fn finite(values: &[f64]) -> bool {
    values.iter().all(|value| value.is_finite())
}

impl Comparison {
    pub fn cpu_error(&self) -> f64 {
        error(&self.cpu, &self.oracle)
    }

    pub fn gpu_error(&self) -> f64 {
        error(&self.gpu, &self.oracle)
    }
}

/// Runs a twin everywhere; comparisons in the order of results, then of records.
pub fn compare(gpu: &Gpu, library: &str, twin: &Twin, records: &Records) -> Vec<Vec<Comparison>> {
    let layout = (twin.double)(&wide(&records.numbers[..records.size]));
    let outputs = layout.iter().map(|(_, values)| values.len()).sum();
    let device = gpu.map(library, &twin.wgsl, records, outputs);
    let mut all: Vec<_> = layout.iter().map(|_| Vec::new()).collect();
    for (record, numbers) in records.each().enumerate() {
        let oracle = (twin.double)(&wide(numbers));
        let single = (twin.single)(numbers);
        let mut device = &device[outputs * record..];
        for (place, ((result, oracle), (_, cpu))) in oracle.into_iter().zip(single).enumerate() {
            let (gpu, rest) = device.split_at(oracle.len());
            device = rest;
            let (cpu, gpu) = (wide(&cpu), wide(gpu));
            all[place].push(Comparison { twin: twin.name, result, record, oracle, cpu, gpu });
        }
    }
    all
}

fn percentile(errors: &mut [f64], share: f64) -> f64 {
    errors.sort_by(f64::total_cmp);
    errors[(share * (errors.len() - 1) as f64) as usize]
}

/// Holds the device's errors against twice the processor's, at the median and at the 99th
/// percentile; prints a line and returns what is wrong.
pub fn check_percentiles(kind: &str, comparisons: &[Comparison]) -> Option<String> {
    let mut cpu: Vec<_> = comparisons.iter().map(Comparison::cpu_error).collect();
    let mut gpu: Vec<_> = comparisons.iter().map(Comparison::gpu_error).collect();
    let [half, most] =
        [0.5, 0.99].map(|share| [percentile(&mut cpu, share), percentile(&mut gpu, share)]);
    let Comparison { twin, result, .. } = comparisons[0];
    let line = format!(
        "{:60} median {:.1e} {:.1e}, 99 % {:.1e} {:.1e}",
        format!("{kind}, {twin}, {result}"),
        half[0],
        half[1],
        most[0],
        most[1]
    );
    println!("{line}");
    let within = |[cpu, gpu]: [f64; 2]| cpu.is_finite() && gpu <= 2.0 * cpu.max(FLOOR);
    (!within(half) || !within(most)).then_some(line)
}

/// How far the oracle's results move, relative, when its inputs move by one unit in the last place,
/// and coordinates at least by what has no square.
fn sensitivity(twin: &Twin, numbers: &[f32], coordinates: usize, random: &mut Random) -> Vec<f64> {
    let exact = wide(numbers);
    let oracle = (twin.double)(&exact);
    let mut largest = vec![0.0f64; oracle.len()];
    for _ in 0..8 {
        let mut nudged = exact.clone();
        for (place, value) in nudged.iter_mut().enumerate().filter(|(_, value)| **value != 0.0) {
            let least = if place < coordinates { NO_SQUARE } else { 0.0 };
            let step = least + EPSILON * value.abs();
            *value += if random.next().is_multiple_of(2) { step } else { -step };
        }
        for (place, (_, values)) in (twin.double)(&nudged).iter().enumerate() {
            largest[place] = largest[place].max(error(values, &oracle[place].1));
        }
    }
    largest
}

/// Where the processor's results are finite the device's must be; where the oracle's hardly depend
/// on the inputs' last digits, they must be close. Returns what is wrong, and the share of results
/// that were held close.
pub fn check_nasty(
    twin: &Twin,
    comparisons: &[Vec<Comparison>],
    records: &Records,
) -> (Vec<String>, f64) {
    let mut random = Random(5);
    let (mut wrong, mut close, mut count) = (Vec::new(), 0, 0);
    for (record, numbers) in records.each().enumerate() {
        let sensitivity = sensitivity(twin, numbers, records.coordinates, &mut random);
        for (comparisons, sensitivity) in comparisons.iter().zip(sensitivity) {
            let one = &comparisons[record];
            count += 1;
            let [cpu, gpu] = [one.cpu_error(), one.gpu_error()];
            let blurred = sensitivity + cpu + FLOOR;
            let well_conditioned = blurred < 1e-3;
            close += usize::from(well_conditioned);
            let lost = finite(&one.cpu) && !finite(&one.gpu);
            if lost || (well_conditioned && gpu > 16.0 * blurred) {
                wrong.push(format!(
                    "{}, {} of record {}: error {gpu:.1e}, processor {cpu:.1e}, sensitivity \
                     {sensitivity:.1e}\n  oracle {:?}\n  device {:?}\n  of {numbers:?}",
                    one.twin, one.result, one.record, one.oracle, one.gpu
                ));
            }
        }
    }
    (wrong, f64::from(close as u32) / f64::from(count))
}
