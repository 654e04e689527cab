//! Answers beside their aims, and beside what counting says that is possible: tables and plots.

use super::bandwidth::Bandwidth;
use super::questions::Answer;
use super::results::{digits, or_dash, threads};
use super::task::ReadBack;
use super::traffic::{BANDWIDTHS, TrafficReport};
use viscera_report::{Axis, Plot, Series, Style, Table, percent, si};

/// How bytes are counted.
pub const COUNTING: &str = "\
Counted without a device, of an ordinary step of the GPU backend in which nothing is rejected. Compulsory bytes are every array that a dispatch must read or \
write, once; moved bytes are the same where every gather goes to memory and no cache holds anything, sums that \
every workgroup of a body adds up included. The shortest time is the larger one of compulsory bytes over the bandwidth and of the dispatches, \
each of which waits for the one before it. Operations are estimates to within a factor of two.";

/// What was asked, beside what was found.
pub fn answers(answers: &[Answer]) -> Option<Table> {
    let mut table = Table::new([
        "asked",
        "tetrahedra",
        "solver",
        "device",
        "steps x passes",
        "time",
        "aim",
        "time, wall",
        "dispatches",
        "aim",
        "a pass",
        "of bandwidth",
        "aim",
        "error left",
        "aims met",
    ]);
    for answer in answers {
        let on = answer.threads.map_or("GPU".into(), |n| format!("CPU, {}", threads(n as u32)));
        let tets = measured_tets(answer);
        let aims = &answer.aims;
        let unused = answer.unused_passes.filter(|&count| count > 0);
        let unused = unused.map_or(String::new(), |count| format!(", {count} unused"));
        let seconds = |seconds: f64| si(seconds, "s");
        let met = answer.is_met.map(|is_met| if is_met { "yes" } else { "no" });
        table.row([
            answer.question.to_owned(),
            tets,
            answer.solver.to_owned(),
            on,
            format!("{} x {}{unused}", answer.steps, answer.passes),
            seconds(answer.seconds),
            or_dash(aims.seconds.map(seconds)),
            seconds(answer.wall_seconds),
            or_dash(answer.dispatches),
            or_dash(aims.dispatches),
            or_dash(answer.pass_dispatches),
            or_dash(answer.bandwidth_fraction.map(percent)),
            or_dash(aims.bandwidth_fraction.map(percent)),
            or_dash(answer.left.map(percent)),
            or_dash(met),
        ]);
    }
    (!table.is_empty()).then_some(table)
}

/// Sums of steps, and what follows from them.
pub fn steps(traffic: &[TrafficReport]) -> Option<Table> {
    let mut heads: Vec<String> = ["solver", "tetrahedra", "steps x passes", "dispatches"]
        .into_iter()
        .chain(["compulsory", "of moved", "a pass, B/tet", "operations/B", "memory, B/tet"])
        .chain(["largest mesh in WebGPU's baseline", "its largest array"])
        .map(str::to_owned)
        .collect();
    heads.extend(BANDWIDTHS.map(|bandwidth| format!("at {:.0} GB/s", 1e-9 * bandwidth)));
    let mut table = Table::new(heads);
    for of in traffic {
        let mut row = vec![
            of.solver.to_owned(),
            of.tets.to_string(),
            format!("{} x {}", of.steps, of.passes),
            (u64::from(of.steps) * of.dispatches).to_string(),
            si(f64::from(of.steps) * of.compulsory_bytes, "B"),
            percent(of.compulsory_bytes / of.moved_bytes),
            digits(of.pass_compulsory_bytes / of.tets as f64),
            digits(of.operations / of.compulsory_bytes),
            digits(of.bytes_per_tet),
            of.largest_mesh.to_string(),
            of.largest_array.to_owned(),
        ];
        row.extend(of.rooflines.iter().map(|line| si(line.seconds, "s")));
        table.row(row);
    }
    (!table.is_empty()).then_some(table)
}

/// Kernels of the largest mesh of each solver.
pub fn kernels(traffic: &[TrafficReport]) -> Option<Table> {
    let mut table = Table::new([
        "solver",
        "tetrahedra",
        "kernel",
        "dispatches a step",
        "compulsory, each",
        "written",
        "of moved",
        "B/tet",
        "operations/B",
        "moves most of",
    ]);
    for (i, of) in traffic.iter().enumerate() {
        let is_larger = |later: &TrafficReport| later.solver == of.solver && later.tets >= of.tets;
        if traffic[i + 1..].iter().any(is_larger) {
            continue;
        }
        for line in of.kernels.iter().filter(|line| line.compulsory_bytes > 0.0) {
            let each = line.compulsory_bytes / line.dispatches as f64;
            table.row([
                of.solver.to_owned(),
                of.tets.to_string(),
                line.kernel.to_owned(),
                line.dispatches.to_string(),
                si(each, "B"),
                percent(line.written_bytes / line.compulsory_bytes),
                percent(line.compulsory_bytes / line.moved_bytes),
                digits(each / of.tets as f64),
                digits(line.operations / line.compulsory_bytes),
                or_dash(line.most.as_ref()),
            ]);
        }
    }
    (!table.is_empty()).then_some(table)
}

/// Solvers of which it is shown, the first four that were measured.
const SHOWN: [&str; 8] = [
    "quasi-newton",
    "quasi-newton-recovered",
    "clusters",
    "explicit",
    "exact",
    "jacobi-green",
    "green",
    "jacobi-anderson",
];

/// The shortest times over bandwidths, and what was measured on this device.
pub fn roofline_plot(
    traffic: &[TrafficReport],
    answers: &[Answer],
    bandwidth: Option<&Bandwidth>,
) -> Plot {
    let mut plot = Plot::new(
        "Shortest time by counting (lines) and times measured (markers)",
        Axis::logarithmic("memory bandwidth [GB/s]"),
        Axis::logarithmic("time [ms]"),
    );
    let largest = traffic.iter().map(|of| of.tets).max();
    let measured = bandwidth.and_then(|b| b.bytes_per_second);
    let slowest = measured.map_or(20.0, |speed| (1e-9 * speed).min(20.0));
    let mut known: Vec<&str> = Vec::new();
    let shown = SHOWN.iter().filter_map(|solver| {
        traffic.iter().find(|of| of.solver == *solver && Some(of.tets) == largest)
    });
    for of in shown.take(4) {
        known.push(of.solver);
        let points = (0..=40).map(|i| {
            let speed = slowest * (5e3 / slowest).powf(f64::from(i) / 40.0);
            [speed, 1e3 * of.seconds_at(1e9 * speed)]
        });
        let name = format!("{}, {} x {}", of.solver, of.steps, of.passes);
        plot.series(Series::new(name, points).with_style(Style::Line));
    }
    let Some(speed) = measured else { return plot };
    for solver in known {
        let is_own = |answer: &&Answer| {
            let is_large = Some(answer.tets) == largest && answer.read_back == ReadBack::Nothing;
            answer.solver == solver && answer.device == "GPU" && is_large
        };
        let points = answers.iter().filter(is_own).take(1).map(|a| [1e-9 * speed, 1e3 * a.seconds]);
        let series = Series::new(format!("{solver}, measured"), points);
        plot.series(series.with_style(Style::Markers));
    }
    plot
}

/// How many tetrahedra an answer is of, and for how many where it was asked for others.
fn measured_tets(answer: &Answer) -> String {
    match answer.is_asked_size() {
        true => answer.tets.to_string(),
        false => format!("{} for {}", answer.tets, answer.asked_tets),
    }
}

/// Times beside aims: below the line an aim is met.
pub fn aim_plot(answers: &[Answer]) -> Plot {
    let mut plot = Plot::new(
        "Answers beside their aims: below the line an aim is met",
        Axis::logarithmic("aim [ms]"),
        Axis::logarithmic("measured [ms]"),
    );
    let timed = || answers.iter().filter_map(|a| Some((a, 1e3 * a.aims.seconds?)));
    let ends = timed().map(|(_, aim)| aim);
    let [low, high] = ends.fold([f64::MAX, 0.0], |[l, h], aim| [aim.min(l), aim.max(h)]);
    if low <= high {
        let line = [0.5 * low, 2.0 * high].map(|aim| [aim, aim]);
        plot.series(Series::new("measured = aim", line).with_style(Style::Dashed));
    }
    for (answer, aim) in timed() {
        let on = answer.threads.map_or("GPU".into(), |n| threads(n as u32));
        let (Answer { question, solver, .. }, tets) = (answer, measured_tets(answer));
        let name = format!("{question}, {solver}, {tets} tetrahedra, {on}");
        let series = Series::new(name, [[aim, 1e3 * answer.seconds]]);
        plot.series(series.with_style(Style::Markers));
    }
    plot
}
