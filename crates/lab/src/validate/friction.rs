//! Friction: a block on an inclined plane holds below `atan(mu)` and slides above it with `g (sin - mu cos)` (Coulomb).
//!
//! What rests must not creep: anchors hold it, and no smoothed velocity is needed for them.

use std::fmt;

use anyhow::Result;
use viscera::contact::ContactLaw;
use viscera::material::MaterialModel;
use viscera::scalar::vec3;
use viscera::settings::Method;
use viscera_report::{Table, percent, scientific};

use super::methods::worse;
use super::{Context, Section};
use crate::contact_cases::{Slide, Sliding, Way};
use crate::load_cases::{FRAME_RATE, tissue};

pub(super) const SECTION: Section =
    Section { name: "friction", title: "Friction", cases: |quick, _| case_count(quick), run };

const YOUNG: f64 = 1e4;
const POISSON: f64 = 0.45;
/// [s]. An elastic body without any flutters on a plane that rubs: its normal force swings with its shear, which feeds both.
const VISCOSITY: f64 = 5e-3;
/// Coefficients of friction: slippery, usual, ridged jaws.
const FRICTIONS: [f64; 3] = [0.13, 0.5, 0.8];
/// How near to `atan(mu)` a block holds and slides [degrees].
const NEAR: f64 = 0.3;
/// Above `atan(mu)`, where accelerations are compared [degrees].
const STEEPER: [f64; 2] = [2.0, 10.0];
/// Asked of what a block moves that holds [m].
const CREEP: f64 = 1e-6;
/// Frames over which acceleration is measured: half a second and what is left out of it.
const FRAMES: u32 = 36;
/// Creep below this is round-off, whose digits differ from machine to machine [m].
const FLOOR: f64 = 1e-10;

/// A method with the stiffness of contact that suits it, and what is asked of its accelerations.
#[derive(Clone, Copy, Debug)]
struct Contender {
    way: Way,
    stiffness: f64,
    limit: f64,
}

const XPBD: Way = Way { schedule: Some((4, 10)), ..Way::of(Method::Xpbd) };
const CONTENDERS: [Contender; 4] = [
    Contender { way: Way::of(Method::QuasiNewton), stiffness: 10.0, limit: 0.01 },
    Contender { way: Way::of(Method::QuasiNewton).in_single(), stiffness: 10.0, limit: 0.01 },
    Contender { way: Way::of(Method::Explicit), stiffness: 10.0, limit: 0.01 },
    Contender { way: XPBD, stiffness: 2.0, limit: 0.02 },
];

impl fmt::Display for Contender {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, stiffness {}", self.way, self.stiffness)
    }
}

/// What a case is about.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Claim {
    /// It holds just below the angle, for so many frames.
    Holds(u32),
    /// It slides just above.
    Slides,
    /// Its acceleration, so many degrees above.
    Accelerates(f64),
}

#[derive(Clone, Copy, Debug)]
struct Case {
    quick: bool,
    contender: Contender,
    friction: f64,
    claim: Claim,
}

impl Case {
    /// Above `atan(mu)` [degrees].
    fn above(&self) -> f64 {
        match self.claim {
            Claim::Holds(_) => -NEAR,
            Claim::Slides => NEAR,
            Claim::Accelerates(above) => above,
        }
    }
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "incline, {}, mu {}, {:+} deg", self.contender, self.friction, self.above())
    }
}

/// Of the holding case [s]: in the full run one coefficient is watched for a minute.
fn seconds(quick: bool, friction: f64) -> u32 {
    match (quick, friction == FRICTIONS[1]) {
        (true, true) => 5,
        (true, false) => 1,
        (false, true) => 60,
        (false, false) => 5,
    }
}

fn cases(quick: bool) -> Vec<Case> {
    let mut cases = Vec::new();
    for contender in CONTENDERS {
        for friction in FRICTIONS {
            let frames = seconds(quick, friction) * FRAME_RATE as u32;
            let claims = [Claim::Holds(frames), Claim::Slides].into_iter();
            let claims = claims.chain(STEEPER.map(Claim::Accelerates));
            cases.extend(claims.map(|claim| Case { quick, contender, friction, claim }));
        }
    }
    cases
}

fn case_count(quick: bool) -> usize {
    cases(quick).len()
}

struct Answer {
    exact: f64,
    slide: Slide,
}

fn answer(case: &Case) -> Result<Answer> {
    let Case { contender, friction, claim, .. } = *case;
    let law = ContactLaw { stiffness: contender.stiffness, friction, ..ContactLaw::default() };
    let frames = if let Claim::Holds(frames) = claim { frames } else { FRAMES };
    let sliding = Sliding {
        size: vec3(0.02, 0.02, 0.01),
        cells: match (case.quick, claim) {
            (true, _) => [4, 4, 2],
            // A minute is long, and so are explicit steps of viscous tissue.
            (false, Claim::Holds(_)) => [6, 6, 3],
            (false, _) if contender.way.method == Method::Explicit => [6, 6, 3],
            (false, _) => [10, 10, 5],
        },
        tissue: tissue(MaterialModel::StableNeoHookean, YOUNG, POISSON)?
            .with_viscosity(VISCOSITY)?,
        law,
        angle: libm::atan(friction) + case.above().to_radians(),
        frames,
    };
    Ok(Answer { exact: sliding.exact(), slide: sliding.slide(&contender.way)? })
}

fn run(context: &mut Context) -> Result<()> {
    context.document.paragraph(format!(
        "A block of 20 x 20 x 10 mm, E {} kPa, nu {POISSON}, viscosity {} ms, lies on a plane that is tilted about two axes. \
         Gravity turns from the plane's normal to straight down in half a second; half a second later the block is \
         let go. Below `atan(mu)` it holds, above it slides with `g (sin - mu cos)`. `moved` is the way of its \
         middle from a tenth of a second on; `ratio` the plane's tangential over its normal force at the end, \
         which is mu where it slides; `rejected` the share of steps that the guard has rejected since it was let \
         go. The stiffness of contact is 10 E/h, and 2 E/h for XPBD, which cannot slide a light block at more. \
         Without any viscosity an elastic block flutters where mu is large: it is no fault of a method, since ever \
         smaller steps of every one of them do it, but then the mean acceleration is not Coulomb's.",
        YOUNG / 1e3,
        VISCOSITY * 1e3
    ));
    let cases = cases(context.quick);
    let answers = context.run_cases(&cases, answer)?;
    let heads = ["method", "mu", "angle above atan(mu)", "time", "moved", "acceleration"];
    let mut table = Table::new(heads.into_iter().chain(["exact", "error", "ratio", "rejected"]));
    for (case, Answer { exact, slide }) in cases.iter().zip(&answers) {
        let holds = matches!(case.claim, Claim::Holds(_));
        let frames = if let Claim::Holds(frames) = case.claim { frames } else { FRAMES };
        let number = |text: String| if holds { String::new() } else { text };
        table.row([
            case.contender.to_string(),
            case.friction.to_string(),
            format!("{:+} deg", case.above()),
            format!("{} s", f64::from(frames) / FRAME_RATE),
            moved(slide.way),
            number(format!("{:.4} m/s^2", slide.acceleration)),
            number(format!("{exact:.4} m/s^2")),
            number(percent(slide.acceleration / exact - 1.0)),
            format!("{:.4}", slide.ratio),
            percent(slide.rejected),
        ]);
    }
    context.document.table(&table);
    for contender in CONTENDERS {
        let of = |case: &Case| case.contender.to_string() == contender.to_string();
        let chosen: Vec<_> = cases.iter().zip(&answers).filter(|(case, _)| of(case)).collect();
        verdicts(context, &contender, &chosen);
    }
    Ok(())
}

/// A way [m] in figures.
fn moved(way: f64) -> String {
    let way = way.abs();
    if way < FLOOR {
        format!("< {} m", scientific(FLOOR))
    } else {
        format!("{} m", scientific(way))
    }
}

fn verdicts(context: &mut Context, contender: &Contender, answers: &[(&Case, &Answer)]) {
    let (mut creep, mut slowest, mut error) = (0.0, f64::INFINITY, 0.0);
    let mut longest = 0;
    for (case, Answer { exact, slide }) in answers {
        match case.claim {
            Claim::Holds(frames) => {
                creep = worse(creep, slide.way.abs());
                longest = longest.max(frames);
            }
            Claim::Slides => slowest = -worse(-slowest, -slide.acceleration / exact),
            Claim::Accelerates(_) => {
                error = worse(error, (slide.acceleration / exact - 1.0).abs());
            }
        }
    }
    let seconds = longest / FRAME_RATE as u32;
    context.verdict(
        format!("incline {NEAR} degrees below atan(mu), moved in up to {seconds} s, {contender}"),
        format!("< {} m", scientific(CREEP)),
        moved(creep),
        creep < CREEP,
    );
    context.verdict(
        format!(
            "incline {NEAR} degrees above atan(mu), acceleration over the exact one, {contender}"
        ),
        "> 0.50",
        format!("{slowest:.2}"),
        slowest > 0.5,
    );
    context.verdict(
        format!("incline, largest error of the acceleration, {contender}"),
        format!("< {}", percent(contender.limit)),
        percent(error),
        error < contender.limit,
    );
}
