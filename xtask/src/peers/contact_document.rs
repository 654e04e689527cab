//! docs/peers-contact.md from result lines. The same results give the same bytes.

use super::contact::{DEPTHS, HOLDS, SLIDES, SWEPT, Simulator, coulomb, force, force_error, truth};
use super::environment::Environment;
use super::figures::draw;
use super::results::{cost, number};
use super::table::{Table, shown};
use serde_json::{Value, json};
use std::path::Path;

/// The text of the document; the figure goes to the folder `peers` beside it.
pub fn write(
    environment: &Environment,
    about: &Value,
    truths: &[Value],
    rows: &[Value],
    out: &Path,
) -> Result<String, String> {
    let folder = out.parent().unwrap_or(Path::new(".")).join("peers");
    std::fs::create_dir_all(&folder)
        .map_err(|error| format!("cannot make {}: {error}", folder.display()))?;
    let data = curves(truths, rows);
    draw(environment, &data, &folder.join("contact-force.svg"))?;
    let title = data["title"].as_str().unwrap_or_default();
    let blocks = [
        opening(about, rows),
        format!("## In short\n\n{SHORT}\n\n{}", summary(truths, rows)),
        format!("## Ball on a block\n\n{PRESSING}\n\n{}", truth_table(truths)),
        pressing(truths, rows, "s", "4,320"),
        format!("{FIGURE}\n\n![{title}](peers/contact-force.svg)"),
        pressing(truths, rows, "m", "10,240"),
        format!("## Block on an incline\n\n{SLIDING}\n\n{}", sliding(rows)),
        format!("## Settings\n\n{SETTINGS}"),
        format!("## What this does not say\n\n{LIMITS}"),
    ];
    Ok(blocks.join("\n\n") + "\n")
}

fn opening(about: &Value, rows: &[Value]) -> String {
    let text = |key: &str| about[key].as_str().unwrap_or("unknown");
    let missing: Vec<&str> =
        about["missing"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    let missing = match missing.as_slice() {
        [] => String::new(),
        names => {
            format!("\n- not run, for they were not there or not asked for: {}", names.join(", "))
        }
    };
    let version = rows.iter().find_map(|row| row["version"].as_str()).unwrap_or("unknown");
    format!(
        "# Peers in contact\n\n\
         Written by `cargo xtask peers --contact`; the program writes it again, so edit the program. What the comparison \
         is for is said in [Peers](peers.md).\n\n\
         Forces and friction of viscera, MuJoCo's flexes and Rapier's soft bodies, on the same meshes of linear \
         tetrahedra, E = 10 kPa, nu = 0.3, 1000 kg/m^3, in frames of 1/60 s, one program at a time on one thread.\n\n\
         - processor: {}\n- versions: MuJoCo {version}, Rapier 0.36.1\n- command: `{}`{missing}\n\
         - cost: processor time of a frame, without reading results. One round, on a machine on which other programs ran, \
         so that costs are good for factors and not for percents.",
        text("cpu"),
        text("command"),
    )
}

/// An error with which one may be content.
const NEAR: f64 = 0.1;

const SHORT: &str = "\
*first*: settings that one gets without a thought. *best*: those with the least error of the force at 4 mm on the block of \
4,320 tetrahedra; on the incline those with the least creep, of those whose accelerations at 30 and 40 degrees, the \
larger of which is shown, are within 10 %.";

const PRESSING: &str = "\
A ball of 12 mm goes 2, 4 or 8 mm deep into the middle of a block of 60 x 60 x 30 mm, fixed below, without friction and \
gravity: down within one second, then held for two, all velocities times 0.9 after each frame. The force is what the \
simulator reports on the ball, the mean of the last ten frames.

The truth is the independent Newton reference of `viscera-lab`, at rest on the same mesh, with a contact that gives by \
micrometres at 16 points of each triangle of the surface; MuJoCo is judged by that of Saint Venant-Kirchhoff, its law, \
viscera and Rapier by that of stable neo-Hookean tissue. Of each peer the first settings and the best run at all depths, \
and as far as time allows on the finer block, there at 4 mm. Where contact begins (viscera's thickness, the radius of MuJoCo's \
flex, Rapier's skin) counts as part of the ball. *64 points* is what that number of points changes: how well the truth is \
known. *4 points* is what viscera's number changes. *viscera's contact* is the same reference with those 4 points and \
viscera's usual contact, an elastic foundation ten times as stiff as a cell: what of viscera's error is its contact's \
model, and no solver's.";

const FIGURE: &str = "4 mm deep, the block of 4,320 tetrahedra: each point is one setting. Cheaper is to the left, closer is below.";

const SLIDING: &str = "\
A block of 20 x 20 x 10 mm, 540 tetrahedra, on a plane, mu = 0.5: it holds up to 26.57 degrees. Gravity turns from the \
plane's normal to the angle within half a second, and half a second later the block, whose velocities were multiplied by \
0.9 after each frame, is let go; the way down the plane is askew to the mesh. Below that angle its middle is watched for \
ten seconds (*creep*). MuJoCo's pyramidal cone has the whole mu along two axes only, and less than three quarters of it in \
this direction. Above it, its acceleration over half a second is compared with g (sin a - mu cos a); at 26.9 \
degrees that is little, and its error is of the difference of two large forces. A block that should hold and moves by \
millimetres slides.";

const SETTINGS: &str = "\
- **viscera**: in single precision, with substeps and passes that each method chooses for itself (`schedule=4x10`: 4 \
substeps of 10 iterations). Unless said, its contact's usual stiffness, 10 times E/h, and thickness, 1 mm.
- **MuJoCo**: a 3D flex, one slider triple per vertex, integrator `discrete` (implicit in the elasticity), solver Newton, \
100 iterations, tolerance 1e-8; the ball is a motion capture body. Unless said: radius of the flex 0.1 mm, `solref` [0.02 \
1], `solimp` [0.9 0.95 0.001 0.5 2], pyramidal cone, `impratio` 1, which are MuJoCo's own. `solref` is not below two \
time steps, which MuJoCo would refuse. Its `noslip` iterations, made for creep, are refused by this integrator with a flex. \
The first row of each table is what one gets without a thought, one step per frame.
- **Rapier**: soft bodies of its finite element solver (feature `fem`), neo-Hookean, lengths times 100 (its own thresholds \
drop cells of millimetres) with time and E scaled so that gravity and forces stay; `iterations` are its substeps, `steps` \
its steps per frame, skin 0.1 mm unless said.";

const LIMITS: &str = "\
Two scenes with smooth convex tools are not surgery: no edges, no grasping, no fast tools, no contact between bodies. The \
truth has linear tetrahedra and so the mesh's own error; only the solvers' and the contacts' are here. Saint \
Venant-Kirchhoff tissue softens under compression and collapses under the deepest ball: its truth there is one of \
several, and the peer's error at 8 mm says little about its contact. MuJoCo's contact is made for robots, whose bodies are \
heavier than a vertex of tissue, and its stiffness goes with their mass: settings that suit one mesh do not suit another. \
\
Rapier's soft bodies are made for games; their force swings because a few vertices hop, and what they lead to the base is \
closer to the truth than what is reported on the ball. viscera's XPBD holds what should slide at its contact's usual \
stiffness and schedule, which a run warns of. All three have more settings than were tried here.";

fn percent(value: Option<f64>) -> String {
    value.map_or_else(|| "-".into(), |share| format!("{:+.1}", 100.0 * share))
}

/// Forces of the reference.
fn truth_table(truths: &[Value]) -> String {
    let heads = [
        "tetrahedra",
        "law",
        "depth [mm]",
        "force [N]",
        "64 points [%]",
        "4 points [%]",
        "viscera's contact [%]",
    ];
    let mut table = Table::new(&heads);
    for row in truths {
        let rigid = number(row, "rigid");
        let over = |key: &str| Some(number(row, key)? / rigid? - 1.0);
        let is_stvk = row["law"] == "stvk";
        table.row(vec![
            if row["size"] == "s" { "4,320" } else { "10,240" }.to_owned(),
            if is_stvk { "Saint Venant-Kirchhoff" } else { "stable neo-Hookean" }.to_owned(),
            row["depth_mm"].to_string(),
            rigid.map_or_else(|| "-".into(), |force| format!("{force:.4}")),
            percent(over("more_samples")),
            percent(over("four")),
            if is_stvk { "-".into() } else { percent(over("usual")) },
        ]);
    }
    table.to_markdown()
}

/// The row of a setting.
fn find<'a>(
    rows: &'a [Value],
    simulator: Simulator,
    settings: &str,
    size: &str,
    presses: bool,
    amount: f64,
) -> Option<&'a Value> {
    rows.iter().find(|row| {
        row["simulator"] == simulator.name()
            && row["settings"] == settings
            && row["size"] == size
            && row["presses"] == presses
            && row["amount"] == amount
    })
}

/// A cell, or why there is none.
fn or_trouble(
    row: Option<&Value>,
    cell: impl Fn(&Value) -> Option<f64>,
    shown: impl Fn(Option<f64>) -> String,
) -> String {
    let trouble = row.and_then(|row| row["status"].as_str()).filter(|status| *status != "ok");
    trouble.map_or_else(|| shown(row.and_then(cell)), str::to_owned)
}

/// Largest of the last frames less the least, over their mean: whether the force has come to rest.
fn swing(row: &Value) -> Option<f64> {
    let forces = row["forces"].as_array()?.iter().filter_map(Value::as_f64);
    let (low, high) = forces.fold((f64::MAX, f64::MIN), |(a, b), f| (a.min(f), b.max(f)));
    Some((high - low) / force(row)?)
}

/// The reported force over what the block leads to its base, less one: zero where both are at rest.
fn imbalance(row: &Value) -> Option<f64> {
    Some(force(row)? / number(row, "base_force")? - 1.0)
}

/// For people: without quotes.
fn plain(settings: &str) -> String {
    settings.replace('"', "").replace(':', "=").replace(',', ", ").replace("], ", "]; ")
}

fn pressing(truths: &[Value], rows: &[Value], size: &str, tets: &str) -> String {
    let errors = DEPTHS.map(|depth| format!("error {depth} mm [%]"));
    let mut heads = vec!["simulator", "settings"];
    heads.extend(errors.iter().map(String::as_str));
    heads.extend(["solver alone [%]", "swing [%]", "over base [%]", "CPU per frame [ms]"]);
    let mut table = Table::new(&heads);
    for simulator in Simulator::ALL {
        for settings in simulator.settings(true) {
            let at = |depth: f64| find(rows, simulator, settings, size, true, depth);
            if DEPTHS.iter().all(|depth| at(*depth).is_none()) {
                continue;
            }
            let own = |row: &Value| {
                let is_usual = simulator == Simulator::Ours && !settings.contains("stiffness");
                let usual = truth(row, truths, "usual").filter(|_| is_usual)?;
                Some(force(row)? / usual - 1.0)
            };
            let percent_of = |of: &dyn Fn(&Value) -> Option<f64>| percent(at(SWEPT).and_then(of));
            let mut cells = vec![simulator.name().to_owned(), plain(settings)];
            cells.extend(
                DEPTHS.map(|depth| or_trouble(at(depth), |row| force_error(row, truths), percent)),
            );
            cells.push(
                at(SWEPT)
                    .and_then(own)
                    .map_or_else(|| "-".into(), |e| format!("{:+.3}", 100.0 * e)),
            );
            cells.push(
                at(SWEPT).and_then(swing).map_or_else(|| "-".into(), |s| shown(Some(100.0 * s))),
            );
            cells.push(percent_of(&imbalance));
            cells.push(shown(at(SWEPT).and_then(cost)));
            table.row(cells);
        }
    }
    format!(
        "### {tets} tetrahedra\n\nErrors of the force by depth; the other columns are at {SWEPT} mm. *solver alone*: \
         against the reference with viscera's own usual contact. *swing*: largest less least of the last ten frames. *over \
         base*: the reported force over what the deformed block leads to its base by its own law; what is not zero is not \
         at rest.\n\n{}",
        table.to_markdown()
    )
}

/// Of the force at [`SWEPT`], or the larger of the accelerations that are not next to nothing.
fn error_of(
    truths: &[Value],
    rows: &[Value],
    simulator: Simulator,
    presses: bool,
    settings: &str,
) -> Option<f64> {
    let at = |amount| find(rows, simulator, settings, "s", presses, amount);
    if presses {
        return force_error(at(SWEPT)?, truths);
    }
    largest([slide_error(at(SLIDES[1])?)?, slide_error(at(SLIDES[2])?)?])
}

/// The first settings of each simulator and the best: of the force with the least error, of the incline with the least
/// creep; and the cheapest whose force is within [`NEAR`].
fn summary(truths: &[Value], rows: &[Value]) -> String {
    let heads = [
        "scene",
        "simulator",
        "",
        "settings",
        "error [%]",
        "creep at 26.3 deg [um]",
        "CPU per frame [ms]",
    ];
    let mut table = Table::new(&heads);
    for (presses, simulator) in
        [true, false].into_iter().flat_map(|p| Simulator::ALL.map(|s| (p, s)))
    {
        let at = |settings: &str, amount| find(rows, simulator, settings, "s", presses, amount);
        let error = |settings: &str| error_of(truths, rows, simulator, presses, settings);
        let price = |settings: &str| {
            at(settings, if presses { SWEPT } else { SLIDES[1] })
                .and_then(cost)
                .unwrap_or(f64::INFINITY)
        };
        let creep = |settings: &str| Some(number(at(settings, HOLDS[1])?, "way")?.abs());
        let is_near = |settings: &&&str| error(settings).is_some_and(|error| error.abs() <= NEAR);
        let all = simulator.settings(presses);
        let size = |settings: &str| match presses {
            true => error(settings).map_or(f64::INFINITY, f64::abs),
            false => creep(settings).unwrap_or(f64::INFINITY),
        };
        let best =
            all.iter().filter(|s| presses || is_near(s)).min_by(|a, b| size(a).total_cmp(&size(b)));
        let cheap = all.iter().filter(is_near).min_by(|a, b| price(a).total_cmp(&price(b)));
        let lines = [
            ("first", all.first()),
            ("best", best),
            ("cheapest within 10 %", cheap.filter(|_| presses)),
        ];
        for (name, settings) in lines {
            let Some(settings) = settings.filter(|settings| error(settings).is_some()) else {
                continue;
            };
            table.row(vec![
                if presses { "ball on a block" } else { "incline" }.to_owned(),
                simulator.name().to_owned(),
                name.to_owned(),
                plain(settings),
                percent(error(settings)),
                if presses { "-".to_owned() } else { micrometres(creep(settings)) },
                shown(Some(price(settings))),
            ]);
        }
    }
    table.to_markdown()
}

/// The one that is further from zero.
fn largest(errors: [f64; 2]) -> Option<f64> {
    errors.into_iter().max_by(|a, b| a.abs().total_cmp(&b.abs()))
}

/// Of the acceleration, over Coulomb's.
fn slide_error(row: &Value) -> Option<f64> {
    Some(number(row, "acceleration")? / coulomb(number(row, "amount")?) - 1.0)
}

/// Micrometres that a reader can compare.
fn micrometres(value: Option<f64>) -> String {
    value.map_or_else(
        || "-".into(),
        |way| {
            let way = 1e6 * way.abs();
            if way < 0.01 { "below 0.01".into() } else { shown(Some(way)) }
        },
    )
}

fn sliding(rows: &[Value]) -> String {
    let errors = SLIDES.map(|angle| format!("error at {angle} deg [%]"));
    let creeps = HOLDS.map(|angle| format!("creep at {angle} deg [um]"));
    let mut heads = vec!["simulator", "settings"];
    heads.extend(creeps.iter().chain(&errors).map(String::as_str));
    heads.push("CPU per frame [ms]");
    let mut table = Table::new(&heads);
    for simulator in Simulator::ALL {
        for settings in simulator.settings(false) {
            let at = |angle: f64| find(rows, simulator, settings, "s", false, angle);
            if HOLDS.iter().chain(&SLIDES).all(|angle| at(*angle).is_none()) {
                continue;
            }
            let mut cells = vec![simulator.name().to_owned(), plain(settings)];
            cells.extend(
                HOLDS.map(|angle| or_trouble(at(angle), |row| number(row, "way"), micrometres)),
            );
            cells.extend(SLIDES.map(|angle| or_trouble(at(angle), slide_error, percent)));
            cells.push(shown(at(SLIDES[1]).and_then(cost)));
            table.row(cells);
        }
    }
    table.to_markdown()
}

/// Error against cost of all settings.
fn curves(truths: &[Value], rows: &[Value]) -> Value {
    let curve = |simulator: Simulator| {
        let fits = |row: &&Value| {
            row["simulator"] == simulator.name()
                && row["presses"] == true
                && row["size"] == "s"
                && row["amount"] == SWEPT
        };
        let point = |row: &Value| Some([cost(row)?, 100.0 * force_error(row, truths)?.abs()]);
        let mut points: Vec<[f64; 2]> = rows.iter().filter(fits).filter_map(point).collect();
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        json!({ "name": simulator.name(), "points": points })
    };
    json!({
        "title": "Ball on a block, 4 mm deep: cost of a frame and error of the force",
        "x": "CPU time per frame [ms]",
        "y": "error of the force [%]",
        // Settings are no curve.
        "joined": false,
        "series": Simulator::ALL.map(curve),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truths() -> Vec<Value> {
        let of = |law: &str, rigid: f64, usual: f64| {
            json!({ "size": "s", "law": law, "depth_mm": 4, "rigid": rigid, "more_samples": 1.01 * rigid,
                    "four": 0.98 * rigid, "usual": usual })
        };
        vec![of("snh", 0.5, 0.45), of("stvk", 0.4, 0.39)]
    }

    #[test]
    fn forces_are_judged_by_their_law_and_by_their_own_contact() {
        let row = |simulator: Simulator, at: usize, forces: [f64; 2]| {
            json!({ "simulator": simulator.name(), "settings": simulator.settings(true)[at], "size": "s",
                    "presses": true, "amount": 4.0, "forces": forces, "base_force": 0.36, "cpu_ms": 2.0 })
        };
        let rows = [row(Simulator::Ours, 0, [0.45; 2]), row(Simulator::Mujoco, 1, [0.35, 0.37])];
        let text = pressing(&truths(), &rows, "s", "4,320");
        let ours = "| viscera | method=quasi_newton | - | -10.0 | - | +0.000 | 0 | +25.0 | 2.00 |";
        assert!(text.contains(ours), "{text}");
        assert!(text.contains("| - | -10.0 | - | - | 5.56 | +0.0 | 2.00 |"), "{text}");
        let line = "| 4,320 | stable neo-Hookean | 4 | 0.5000 | +1.0 | -2.0 | -10.0 |";
        let short = summary(&truths(), &rows);
        assert!(short.contains("| first | method=quasi_newton | -10.0 | - | 2.00 |"), "{short}");
        assert!(!short.contains("incline"), "what did not run is not told: {short}");
        assert!(truth_table(&truths()).contains(line), "{}", truth_table(&truths()));
    }

    #[test]
    fn slides_are_judged_by_coulomb_and_say_what_failed() {
        let settings = Simulator::Rapier.settings(false)[0];
        let row = |amount: f64, acceleration: f64, status: &str| {
            json!({ "simulator": "Rapier", "settings": settings, "size": "s", "presses": false, "amount": amount,
                    "acceleration": acceleration, "way": 2e-6, "cpu_ms": 1.0, "status": status })
        };
        let rows = [
            row(30.0, 1.1 * coulomb(30.0), "ok"),
            row(20.0, 0.0, "ok"),
            row(40.0, 0.0, "diverged"),
        ];
        let text = sliding(&rows);
        assert!(
            text.contains("| Rapier | iterations=4 | 2.00 | - | - | +10.0 | diverged | 1.00 |"),
            "{text}"
        );
    }
}
