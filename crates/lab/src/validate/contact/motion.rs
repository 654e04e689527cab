//! Tools in motion: the library's forces beside those of many small steps, and what the library says that they are off by.

use std::fmt;

use anyhow::Result;
use viscera::settings::Method;
use viscera_report::{Table, percent};

use super::super::methods::worse;
use super::Context;
use crate::contact_cases::{Course, DEEDS, Deed, Moving, Way};

const WAYS: [Way; 4] = [
    Way::of(Method::QuasiNewton),
    Way::of(Method::QuasiNewton).in_single(),
    Way::of(Method::Xpbd),
    Way::of(Method::Explicit),
];

/// Parts of a frame in which tools move steadily in what counts as true; with half as many it shows its own error.
const TRUE_PARTS: u32 = 16;
const QUICK_PARTS: u32 = 8;
/// Substeps of a frame of implicit steps that must come to the same.
const IMPLICIT_SUBSTEPS: u32 = 64;

/// Asked of a probe that is pressed in, as a share of its largest force.
const IN_MOTION: f64 = 0.05;
/// Asked: the share of frames in which a force is not further off than it is said to be.
const COVERED: f64 = 0.95;
/// Asked: the median of what a force is said to be off by over what it is off by.
const WIDE: f64 = 4.0;

#[derive(Clone, Copy, Debug)]
struct Case {
    quick: bool,
    deed: Deed,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "tools in motion, {}", self.deed.name())
    }
}

fn cases(quick: bool) -> Vec<Case> {
    let deeds = if quick { &DEEDS[..2] } else { &DEEDS[..] };
    let deeds = deeds.iter().copied().chain((!quick).then_some(Deed::Drop));
    deeds.map(|deed| Case { quick, deed }).collect()
}

pub(super) fn case_count(quick: bool) -> usize {
    cases(quick).len()
}

/// What the forces of one way in one case are off by, frame by frame and tool by tool.
struct Off {
    /// As a share of the largest true force.
    largest: f64,
    /// Of forces that are off by no more than they are said to be, as far as the truth itself is known.
    covered: Vec<bool>,
    /// What they are said to be off by over what they are off by, where the latter is known.
    ratios: Vec<f64>,
    rejected: f64,
}

struct Answer {
    peak: f64,
    /// Of the truth itself, as a share of the largest force.
    own: f64,
    /// Of small implicit steps, likewise.
    implicit: f64,
    ways: Vec<Off>,
}

fn answer(case: &Case) -> Result<Answer> {
    let moving = Moving::new(case.deed)?;
    let parts = if case.quick { QUICK_PARTS } else { TRUE_PARTS };
    let (truth, rough) = (moving.truth(parts)?, moving.truth(parts / 2)?);
    let own = distances(&truth, &rough);
    let implicit = distances(&truth, &moving.implicit(IMPLICIT_SUBSTEPS)?);
    let ways: Result<Vec<Off>> = WAYS
        .iter()
        .map(|way| {
            let course = moving.run(way)?;
            Ok(compare(&course, &truth, &own))
        })
        .collect();
    let peak = truth.peak();
    let share = |off: &[f64]| off.iter().copied().fold(0.0, f64::max) / peak;
    Ok(Answer { peak, own: share(&own), implicit: share(&implicit), ways: ways? })
}

/// How far apart forces are [N], one after the other.
fn distances(a: &Course, b: &Course) -> Vec<f64> {
    let all = a.forces.iter().flatten().zip(b.forces.iter().flatten());
    all.map(|(a, b)| (*a - *b).length()).collect()
}

fn compare(course: &Course, truth: &Course, own: &[f64]) -> Off {
    let off = distances(course, truth);
    let said: Vec<f64> = course.errors.iter().flatten().copied().collect();
    let all = || off.iter().zip(&said).zip(own);
    Off {
        largest: off.iter().copied().fold(0.0, worse) / truth.peak(),
        covered: all().map(|((off, said), own)| *off <= said + own).collect(),
        ratios: all()
            .filter(|((off, _), own)| off > own)
            .map(|((off, said), _)| said / off)
            .collect(),
        rejected: course.rejected,
    }
}

fn share(covered: &[bool]) -> f64 {
    let count = covered.iter().filter(|is_covered| **is_covered).count();
    count as f64 / covered.len().max(1) as f64
}

/// Infinite where there is none.
fn median(mut ratios: Vec<f64>) -> f64 {
    ratios.sort_by(f64::total_cmp);
    ratios.get(ratios.len() / 2).copied().unwrap_or(f64::INFINITY)
}

pub(super) fn add(context: &mut Context) -> Result<()> {
    let cases = cases(context.quick);
    let answers = context.run_cases(&cases, answer)?;
    let parts = if context.quick { QUICK_PARTS } else { TRUE_PARTS };
    context.document.subheading("Tools in motion");
    context.document.paragraph(format!(
        "Tissue of 5 kPa, nu 0.45, viscosity 10 ms, for one second. The truth are explicit steps in double \
         precision, with tools that move steadily in {parts} parts of every frame; what it is off by itself is its \
         distance from half as many, and `implicit` its distance from {IMPLICIT_SUBSTEPS} implicit steps in every \
         frame. Every method at its own choice of steps and iterations. `largest error` is that of the vector of \
         force in any frame, as a share of the largest true force. Beside every run goes another in half as many \
         steps, and twice the distance of both and a thousandth of the force is what it is said to be off by: \
         `within` is the share of frames in which it is off by no more (than that and the truth's own error), \
         `said/true` the median of what is said over what is true where that is more than the truth's own error."
    ));
    let heads = ["what is done", "method", "largest force", "largest error", "within", "said/true"];
    let mut table = Table::new(heads.into_iter().chain(["rejected", "truth's own", "implicit"]));
    for (case, answer) in cases.iter().zip(&answers) {
        for (way, off) in WAYS.iter().zip(&answer.ways) {
            table.row([
                case.deed.name().to_owned(),
                way.to_string(),
                format!("{:.4} N", answer.peak),
                percent(off.largest),
                percent(share(&off.covered)),
                format!("{:.2}", median(off.ratios.clone())),
                percent(off.rejected),
                percent(answer.own),
                percent(answer.implicit),
            ]);
        }
    }
    context.document.table(&table);
    context.document.paragraph(
        "A beam that falls on a blade is no part of the verdicts: friction in the first instants of the fall \
         decides for good where the beam comes to lie. Two runs with neighbouring numbers of long steps may come to \
         lie near to each other and far from the truth, and no estimate from two runs sees that.",
    );
    let led: Vec<_> =
        cases.iter().zip(&answers).filter(|(case, _)| case.deed != Deed::Drop).collect();
    for (number, way) in WAYS.iter().enumerate() {
        let press = led.iter().find(|(case, _)| case.deed == Deed::Press);
        let largest = press.map_or(f64::NAN, |(_, answer)| answer.ways[number].largest);
        context.verdict(
            format!("probe pressed in at 50 mm/s, largest error of its force, {way}"),
            format!("< {}", percent(IN_MOTION)),
            percent(largest),
            largest < IN_MOTION,
        );
        let of_way = || led.iter().map(|(_, answer)| &answer.ways[number]);
        let covered: Vec<bool> = of_way().flat_map(|off| off.covered.clone()).collect();
        let covered = share(&covered);
        context.verdict(
            format!("tools in motion, forces within what they are said to be off by, {way}"),
            format!("> {}", percent(COVERED)),
            percent(covered),
            covered > COVERED,
        );
        let wide = median(of_way().flat_map(|off| off.ratios.clone()).collect());
        context.verdict(
            format!("tools in motion, what forces are said to be off by over the truth, {way}"),
            format!("< {WIDE}"),
            format!("{wide:.2}"),
            wide < WIDE,
        );
    }
    Ok(())
}
