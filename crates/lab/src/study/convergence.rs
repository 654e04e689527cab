//! How methods come near the end of one step: figures over iterations and over passes, tables, data.

use anyhow::Result;
use std::fmt;
use viscera::settings::{Acceleration, AndersonOn, RelaxationForm, SolverSettings};

use super::Context;
use super::device::{self, DeviceSample};
use super::methods::NamedSettings;
use super::step::{Cost, Curve, MeasuredStep};
use viscera_report::{Axis, Plot, Series, Style, Table, percent, scientific};

/// Cases that [`follow`] counts besides one per method: the measurement of milliseconds.
pub(super) const COST_CASES: usize = 1;

/// Cases that [`follow_on_both`] counts besides one per method.
pub(super) const COST_AND_DEVICE_CASES: usize = COST_CASES + 1;

/// Points of a curve per factor of ten, in plots and data: more are not told apart.
const POINTS_PER_DECADE: f64 = 20.0;

/// Curves leave the plots above this error, so that one which diverges does not flatten the others.
pub(super) const CEILING: f64 = 10.0;

/// And end below this one, where round-off begins.
pub(super) const FLOOR: f64 = 1e-9;

/// Who computes in single precision, as legends and data call them.
const SINGLE: [&str; 2] = ["GPU, single precision", "CPU, single precision"];

/// What a table and a figure need of a method.
pub(super) struct Followed {
    pub method: NamedSettings,
    pub curve: Curve,
    pub cost: Cost,
    /// By the GPU backend, where it was asked and there is an adapter.
    pub samples: Vec<DeviceSample>,
}

/// Follows every method through its iterations, in double precision.
pub(super) fn follow(
    context: &Context,
    step: &MeasuredStep,
    methods: Vec<NamedSettings>,
) -> Result<Vec<Followed>> {
    let curves = context.run_cases(&methods, |method| step.follow::<f64>(&method.settings))?;
    // One after the other: methods side by side would take the processor's time from each other.
    let costs = context.run_cases(&["milliseconds per iteration"], |_| {
        methods.iter().map(|method| step.cost(&method.settings)).collect::<Result<Vec<_>>>()
    })?;
    let all = methods.into_iter().zip(curves).zip(costs.into_iter().flatten());
    let followed =
        all.map(|((method, curve), cost)| Followed { method, curve, cost, samples: Vec::new() });
    Ok(followed.collect())
}

/// The same, and by the GPU backend.
pub(super) fn follow_on_both(
    context: &Context,
    step: &MeasuredStep,
    methods: Vec<NamedSettings>,
) -> Result<Vec<Followed>> {
    let mut followed = follow(context, step, methods)?;
    let samples = context.run_cases(&["the GPU backend"], |_| {
        let Some(device) = device::device() else { return Ok(Vec::new()) };
        let sample = |followed: &Followed| {
            device::follow(device, step, &followed.method.settings, followed.cost.passes)
        };
        followed.iter().map(sample).collect::<Result<Vec<_>>>()
    })?;
    for (followed, samples) in followed.iter_mut().zip(samples.into_iter().flatten()) {
        followed.samples = samples;
    }
    Ok(followed)
}

/// Whether the GPU backend draws the same curves: both backends work in single precision, each with
/// round-off of its own, so that of all samples of a method half should be no farther from double precision
/// than twice what the CPU is.
pub(super) fn judge_device(context: &mut Context, what: &str, followed: &[Followed]) {
    let (mut worst, mut count) = (0.0f64, 0);
    for Followed { samples, .. } in followed {
        let ratios: Vec<f64> = samples.iter().filter_map(rounding_ratio).collect();
        count += ratios.len();
        worst = worst.max(median(ratios).unwrap_or(0.0));
    }
    if count > 0 {
        context.verdict(
            format!(
                "{what}: GPU's distance from double precision over the CPU's, median of each curve"
            ),
            "at most 2",
            format!("{worst:.2} ({count} samples)"),
            worst <= 2.0,
        );
    }
}

/// How much farther from double precision the device is than the CPU, where the CPU is in the scene; a
/// device that is not counts as infinitely far.
fn rounding_ratio(sample: &DeviceSample) -> Option<f64> {
    let in_scene = sample.errors[1] < CEILING;
    let ratio = sample.rounding[0] / sample.rounding[1];
    in_scene.then_some(if ratio.is_finite() { ratio } else { f64::INFINITY })
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Whether and when a curve came down to a level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Reach {
    /// After so many iterations.
    After(usize),
    /// Not yet after so many.
    Above(usize),
    /// Never: it stands at this error.
    Stops(f64),
    /// Never: it left for good.
    Diverges,
}

impl Reach {
    /// Of a curve.
    pub fn of(curve: &Curve, level: f64) -> Self {
        let last = curve.last();
        match (curve.first_below(level), curve.plateau()) {
            (Some(iterations), _) => Self::After(iterations),
            (None, _) if last >= CEILING => Self::Diverges,
            (None, Some(error)) => Self::Stops(error),
            (None, None) => Self::Above(curve.errors.len() - 1),
        }
    }

    /// In another unit, so much of which an iteration takes.
    fn times(self, unit: f64, decimals: usize) -> String {
        match self {
            Self::After(count) => format!("{:.decimals$}", count as f64 * unit),
            Self::Above(count) => format!("above {:.decimals$}", count as f64 * unit),
            Self::Stops(_) | Self::Diverges => "-".to_owned(),
        }
    }

    /// How much of another method's work this is, in percent; nothing where it cannot be told.
    fn share(self, other: Self, unit: f64) -> String {
        match (self, other) {
            (Self::After(ours), Self::After(theirs)) => {
                format!(" ({})", percent(ours as f64 * unit / theirs as f64))
            }
            // The other one took more than that.
            (Self::After(ours), Self::Above(theirs)) if (ours as f64) * unit < theirs as f64 => {
                format!(" (< {})", percent(ours as f64 * unit / theirs as f64))
            }
            _ => String::new(),
        }
    }
}

impl fmt::Display for Reach {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::After(count) => write!(f, "{count}"),
            Self::Above(count) => write!(f, "above {count}"),
            Self::Stops(error) => write!(f, "stops at {}", scientific(*error)),
            Self::Diverges => f.write_str("diverges"),
        }
    }
}

/// Iterations, passes and milliseconds to each level, with the share of the first method's.
pub(super) fn table(followed: &[Followed], levels: &[f64]) -> Table {
    let mut heads = vec!["method".to_owned(), "passes per iteration".into(), "ms".into()];
    for level in levels {
        let level = level_name(*level);
        heads.extend([format!("to {level}: iterations"), "passes".into(), "ms".into()]);
    }
    heads.extend(["error at the end".to_owned(), "strain / true".into()]);
    let mut table = Table::new(heads);
    let Some(first) = followed.first() else { return table };
    for Followed { method, curve, cost, .. } in followed {
        let ms = 1e3 * cost.seconds;
        let mut row = vec![method.name.clone(), cost.passes.to_string(), format!("{ms:.2}")];
        for level in levels {
            let (reach, base) = (Reach::of(curve, *level), Reach::of(&first.curve, *level));
            let dearer = cost.passes as f64 / first.cost.passes as f64;
            row.push(format!("{reach}{}", reach.share(base, 1.0)));
            row.push(format!(
                "{}{}",
                reach.times(cost.passes as f64, 0),
                reach.share(base, dearer)
            ));
            row.push(reach.times(ms, 1));
        }
        row.push(in_words(curve.last()));
        row.push(if curve.last() < CEILING {
            format!("{:.2}", curve.strain_ratio)
        } else {
            "-".into()
        });
        table.row(row);
    }
    table
}

/// `1e-2`.
pub(super) fn level_name(level: f64) -> String {
    format!("{level:e}")
}

/// An error in a table.
pub(super) fn in_words(error: f64) -> String {
    match error {
        _ if error < FLOOR => format!("< {}", level_name(FLOOR)),
        _ if error < CEILING => scientific(error),
        _ => "diverges".to_owned(),
    }
}

/// An error as data: without round-off's digits.
pub(super) fn in_data(error: f64) -> String {
    if error.is_finite() { format!("{:.6e}", error.max(FLOOR)) } else { "lost".to_owned() }
}

/// The same curves over iterations and over dependent passes, and their points as data.
pub(super) struct Figure {
    plots: [Plot; 2],
    /// What device and CPU found in single precision, of all methods, for either plot.
    single: [[Vec<[f64; 2]>; 2]; 2],
    data: Table,
}

impl Figure {
    /// Without curves.
    pub fn new(title: &str) -> Self {
        let plot = |over: &str| {
            let error = Axis::logarithmic("error, 1 = inertial prediction");
            let mut plot =
                Plot::new(format!("{title}, over {over}"), Axis::logarithmic(over), error);
            plot.reference(0.1, "1e-1");
            plot
        };
        Self {
            plots: [plot("iterations"), plot("dependent passes")],
            single: Default::default(),
            data: Table::new(["curve", "iterations", "passes", "error"]),
        }
    }

    /// Adds a method; dashed where it does not scale and mix positions and multipliers alike.
    pub fn add(&mut self, followed: &Followed) {
        let Followed { method, curve, cost, samples } = followed;
        let style = if treats_alike(&method.settings) { Style::Line } else { Style::Dashed };
        self.add_curve(&method.name, &curve.errors, cost.passes, style);
        for DeviceSample { iterations, errors, .. } in samples {
            let passes = *iterations as usize * cost.passes;
            for (backend, error) in errors.iter().enumerate() {
                let name = format!("{}, {}", method.name, SINGLE[backend]);
                let counts = [iterations.to_string(), passes.to_string()];
                self.data.row([&name, &counts[0], &counts[1], &in_data(*error)]);
                if (FLOOR..CEILING).contains(error) {
                    self.single[backend][0].push([f64::from(*iterations), *error]);
                    self.single[backend][1].push([passes as f64, *error]);
                }
            }
        }
    }

    /// Adds errors after 0, 1, 2, ... iterations of so many passes each.
    pub fn add_curve(&mut self, name: &str, errors: &[f64], passes: usize, style: Style) {
        let points: Vec<(usize, f64)> =
            thinned(errors.len()).into_iter().map(|k| (k, errors[k])).collect();
        for (k, error) in &points {
            let error = in_data(*error);
            self.data.row([name, &k.to_string(), &(k * passes).to_string(), &error]);
        }
        let is_shown = |(_, error): &&(usize, f64)| (FLOOR..CEILING).contains(error);
        let shown = points.iter().skip(1).take_while(is_shown);
        let shown: Vec<(usize, f64)> = shown.copied().collect();
        for (plot, unit) in self.plots.iter_mut().zip([1, passes]) {
            let points = shown.iter().map(|(k, error)| [(k * unit) as f64, *error]);
            plot.series(Series::new(name, points).with_style(style));
        }
    }

    /// Both plots with what to see in them, and the data.
    pub fn show(mut self, context: &mut Context, name: &str, see: [&str; 2]) -> Result<()> {
        for (name, points) in SINGLE.into_iter().zip(self.single) {
            for (plot, points) in self.plots.iter_mut().zip(points) {
                if !points.is_empty() {
                    plot.series(Series::new(name, points).with_style(Style::Markers));
                }
            }
        }
        let [iterations, passes] = &self.plots;
        context.plot(&format!("{name}-iterations"), iterations, see[0])?;
        context.plot(&format!("{name}-passes"), passes, see[1])?;
        context.document.data(name, "All points of both plots", &self.data)
    }
}

/// Whether positions and multipliers are scaled and mixed alike.
fn treats_alike(settings: &SolverSettings) -> bool {
    let scales_one =
        settings.relaxation != 1.0 && settings.relaxation_form == RelaxationForm::Published;
    let mixes_one =
        settings.acceleration == Acceleration::Anderson && settings.anderson_on != AndersonOn::Both;
    !(scales_one || mixes_one)
}

/// Which of so many points are shown: equally far apart on a logarithmic axis, the last in any case.
pub(super) fn thinned(count: usize) -> Vec<usize> {
    let step = 1.0 / POINTS_PER_DECADE;
    let mut kept = vec![0];
    let mut exponent = 0.0;
    while let (k, Some(last)) = (libm::exp10(exponent).round() as usize, kept.last())
        && k < count
    {
        if k > *last {
            kept.push(k);
        }
        exponent += step;
    }
    if kept.last().is_some_and(|last| last + 1 < count) {
        kept.push(count - 1);
    }
    kept.truncate(count);
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinned_points_are_in_order_and_end_with_the_last() {
        assert_eq!(thinned(0), [0usize; 0]);
        assert_eq!(thinned(1), [0]);
        assert_eq!(thinned(4), [0, 1, 2, 3]);
        let kept = thinned(3001);
        assert!(kept.is_sorted_by(|a, b| a < b) && kept.last() == Some(&3000), "{kept:?}");
        assert!((50..90).contains(&kept.len()), "{} points", kept.len());
    }

    #[test]
    fn a_device_that_leaves_the_scene_is_no_device_that_agrees() {
        let sample = |error, rounding| DeviceSample {
            iterations: 1,
            errors: [error, 0.5],
            rounding: [rounding, 1e-6],
        };
        assert_eq!(rounding_ratio(&sample(0.5, 2e-6)), Some(2.0));
        assert_eq!(rounding_ratio(&sample(f64::NAN, f64::NAN)), Some(f64::INFINITY));
        assert!(rounding_ratio(&sample(1e3, 1e3)).is_some_and(|ratio| ratio > 2.0));
        let both_lost = DeviceSample { iterations: 1, errors: [1e3; 2], rounding: [1e3; 2] };
        assert_eq!(rounding_ratio(&both_lost), None);
        assert_eq!(median(vec![3.0, f64::INFINITY, 1.0]), Some(3.0));
    }

    #[test]
    fn a_curve_arrives_stops_diverges_or_is_on_its_way() {
        let curve = |errors: Vec<f64>| Curve { errors, strain_ratio: 1.0 };
        let falling = curve((0..100).map(|k| libm::exp10(-0.01 * f64::from(k))).collect());
        assert_eq!(Reach::of(&falling, 0.5), Reach::After(31));
        assert_eq!(Reach::of(&falling, 0.01), Reach::Above(99));
        let slow = curve((0..100).map(|k| 1.0 - 3e-4 * f64::from(k)).collect());
        assert_eq!(Reach::of(&slow, 0.5), Reach::Above(99));
        // A power law that began with a drop gains ever less, and still comes down.
        let power = |k: u32| if k == 0 { 1.0 } else { 0.3 / f64::from(k).sqrt() };
        assert_eq!(Reach::of(&curve((0..6000).map(power).collect()), 1e-3), Reach::Above(5999));
        let standing = curve(vec![0.5; 100]);
        assert_eq!(Reach::of(&standing, 0.1), Reach::Stops(0.5));
        let lost = curve(vec![1.0, 3.0, 1e3, f64::INFINITY]);
        assert_eq!(Reach::of(&lost, 0.1), Reach::Diverges);
    }
}
