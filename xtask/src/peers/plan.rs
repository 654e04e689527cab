//! What is compared: simulators and ours, with the settings that make a curve of each.

use serde_json::{Map, Value, json};

/// A simulator, or a method of ours: one curve of a plot.
pub struct Method {
    /// Its name in tables and plots.
    pub label: &'static str,
    /// In words.
    pub words: &'static str,
    /// What computes it.
    pub program: Program,
    /// From cheap to dear.
    pub points: &'static [Point],
}

/// What computes a method.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Program {
    /// A Python module, which tells whether it is installed; a file below `peers/` and its class.
    Module { module: &'static str, file: &'static str, class: &'static str },
    /// Rapier's peer, a program of its own.
    Rapier,
    /// `viscera bench-scene`.
    Ours,
}

impl Program {
    /// What `--peers` calls it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Module { module, .. } => module,
            Self::Rapier => "rapier",
            Self::Ours => "viscera",
        }
    }
}

/// Settings of a method.
pub struct Point {
    /// `key=value,...` over the defaults. `substeps=fewest` stands for the fewest stable ones, `substeps=twice` for
    /// twice as many.
    pub settings: &'static str,
    /// The finest size, of s, m, l, at which it is affordable.
    pub up_to: &'static str,
    /// Whether it stands in the tables and runs in every round; others run once and stand in plots only.
    pub is_main: bool,
}

const fn main(settings: &'static str, up_to: &'static str) -> Point {
    Point { settings, up_to, is_main: true }
}

const fn more(settings: &'static str, up_to: &'static str) -> Point {
    Point { settings, up_to, is_main: false }
}

const MUJOCO: Program =
    Program::Module { module: "mujoco", file: "mujoco_peer.py", class: "MujocoFlex" };

const fn pbat(class: &'static str) -> Program {
    Program::Module { module: "pbatoolkit", file: "pbat_peer.py", class }
}

const fn newton(class: &'static str) -> Program {
    Program::Module { module: "newton", file: "newton_peer.py", class }
}

/// The method that ratios are taken to, at its first point.
pub const AUTOMATIC: &str = "viscera, automatic";

/// Ours whose largest bar in real time is looked for.
pub const STANDARD: &str = "material=snh,accuracy=standard";

/// The scene's tissue, stable neo-Hookean, unless a row says otherwise.
pub const METHODS: [Method; 15] = [
    Method {
        label: AUTOMATIC,
        words: "the default: the method chosen by the accuracy asked for; stable neo-Hookean tissue",
        program: Program::Ours,
        points: &[
            main("material=snh,accuracy=draft", "l"),
            main(STANDARD, "l"),
            more("material=snh,accuracy=0.02", "m"),
            more("material=snh,accuracy=0.01", "m"),
            main("material=snh,accuracy=fine", "l"),
            more("material=snh,accuracy=0.002", "m"),
        ],
    },
    Method {
        label: "viscera, quasi-Newton",
        words: "large steps in a dozen passes; stable neo-Hookean tissue",
        program: Program::Ours,
        points: &[
            main("material=snh,method=quasi_newton,substeps=1", "l"),
            main("material=snh,method=quasi_newton,substeps=2", "l"),
            more("material=snh,method=quasi_newton,substeps=4", "m"),
            more("material=snh,method=quasi_newton,substeps=8", "m"),
        ],
    },
    Method {
        label: "viscera, explicit",
        words: "small steps at a share of the stable one; stable neo-Hookean tissue",
        program: Program::Ours,
        points: &[
            main("material=snh,method=explicit,explicit_safety=0.8,substeps=1", "l"),
            more("material=snh,method=explicit,explicit_safety=0.4,substeps=1", "m"),
            more("material=snh,method=explicit,explicit_safety=0.2,substeps=1", "m"),
        ],
    },
    Method {
        label: "viscera, XPBD",
        words: "XPBD's defaults: coloured, rebase and guards; stretch form of stable neo-Hookean tissue",
        program: Program::Ours,
        points: &[
            main("material=snh,method=xpbd", "l"),
            more("material=snh,method=xpbd,substeps=20,iterations=5", "m"),
            more("material=snh,method=xpbd,substeps=40,iterations=5", "m"),
        ],
    },
    Method {
        label: "viscera, XPBD as published",
        words: "coloured, the pair of neo-Hookean constraints; no rebase, no kept multipliers, no guards",
        program: Program::Ours,
        points: &[
            more(
                "material=snh,method=xpbd,rebase=false,keep_multipliers=false,step_guard=false,substeps=20,iterations=1",
                "m",
            ),
            main(
                "material=snh,method=xpbd,rebase=false,keep_multipliers=false,step_guard=false,substeps=50,iterations=1",
                "l",
            ),
            more(
                "material=snh,method=xpbd,rebase=false,keep_multipliers=false,step_guard=false,substeps=100,iterations=1",
                "m",
            ),
        ],
    },
    Method {
        label: "viscera, automatic, Green strain",
        words: "the default with the energy that most peers have",
        program: Program::Ours,
        points: &[main("material=stvk", "l"), more("material=stvk,accuracy=fine", "m")],
    },
    Method {
        label: "MuJoCo, implicit",
        words: "MuJoCo flex: implicit finite elements beside rigid bodies, its default integrator",
        program: MUJOCO,
        points: &[
            main("", "l"),
            more("substeps=2", "l"),
            main("substeps=4", "m"),
            more("substeps=8", "m"),
            more("substeps=16", "s"),
        ],
    },
    Method {
        label: "MuJoCo, explicit",
        words: "the same with its explicit integrator, at the fewest substeps that are stable",
        program: MUJOCO,
        points: &[
            main("integrator=Euler,substeps=fewest", "m"),
            more("integrator=Euler,substeps=twice", "m"),
        ],
    },
    Method {
        label: "Pbat, VBD",
        words: "Physics-Based Animation Toolkit: vertex block descent",
        program: pbat("PbatVBD"),
        points: &[
            more("iterations=5", "s"),
            main("iterations=20", "m"),
            main("iterations=20,accel=anderson", "m"),
            more("substeps=4,iterations=10", "s"),
            more("iterations=80", "s"),
        ],
    },
    Method {
        label: "Pbat, XPBD",
        words: "Physics-Based Animation Toolkit: XPBD, coloured",
        program: pbat("PbatXPBD"),
        points: &[more("substeps=20", "m"), main("substeps=50", "m"), more("substeps=100", "s")],
    },
    Method {
        label: "Newton, VBD",
        words: "Newton (Warp): vertex block descent, coloured",
        program: newton("NewtonVBD"),
        points: &[
            main("substeps=1,iterations=20", "m"),
            more("substeps=5,iterations=5", "m"),
            main("", "s"),
            more("substeps=40,iterations=4", "s"),
        ],
    },
    Method {
        label: "Newton, XPBD",
        words: "Newton (Warp): XPBD, Jacobi",
        program: newton("NewtonXPBD"),
        points: &[main("", "m"), more("substeps=40,iterations=4", "s")],
    },
    Method {
        label: "PositionBasedDynamics",
        words: "PositionBasedDynamics: XPBD, coloured",
        program: Program::Module { module: "pypbd", file: "pypbd_peer.py", class: "PyPBD_XPBD" },
        points: &[
            more("substeps=20", "m"),
            more("substeps=50", "m"),
            main("substeps=100", "m"),
            more("substeps=200", "s"),
        ],
    },
    Method {
        label: "Rapier, finite elements",
        words: "Rapier: finite elements",
        program: Program::Rapier,
        points: &[
            main("solver=fem,iterations=4", "m"),
            main("solver=fem,iterations=10", "m"),
            more("solver=fem,iterations=20", "s"),
        ],
    },
    Method {
        label: "Rapier, constraints",
        words: "Rapier: soft constraints",
        program: Program::Rapier,
        points: &[
            main("solver=constraints,iterations=4", "s"),
            more("solver=constraints,iterations=40", "s"),
        ],
    },
];

/// The method of a name.
pub fn method(label: &str) -> Option<&'static Method> {
    METHODS.iter().find(|method| method.label == label)
}

/// Settings as the benchmark takes them, with the fewest stable substeps in their places.
pub fn settings(text: &str, fewest: u64) -> Value {
    let mut settings = Map::new();
    for setting in text.split(',').filter(|setting| !setting.is_empty()) {
        let (key, value) = setting.split_once('=').unwrap_or((setting, ""));
        let number = value.parse::<i64>().map(Value::from);
        let number = number.or_else(|_| value.parse::<f64>().map(Value::from));
        let value = match value {
            "fewest" => json!(fewest),
            "twice" => json!(2 * fewest),
            other => number.unwrap_or_else(|_| json!(other)),
        };
        settings.insert(key.to_owned(), value);
    }
    Value::Object(settings)
}

/// Sizes of the benchmark from coarse to fine; organs and other bars count as s: they are of its order.
pub fn is_affordable(point: &Point, size: &str) -> bool {
    let rank = |size: &str| ["xs", "s", "m", "l"].iter().position(|known| *known == size);
    rank(size).unwrap_or(1) <= rank(point.up_to).unwrap_or(1)
}

/// Cells across the bar of a size.
pub fn cells(size: &str) -> Option<u32> {
    match size {
        "xs" => Some(2),
        "s" => Some(4),
        "m" => Some(8),
        "l" => Some(17),
        _ => size.strip_prefix('n')?.parse().ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_numbers_where_they_can_be() {
        let read = settings("integrator=Euler,substeps=twice,damping=0.5,iterations=4", 50);
        let expected =
            json!({ "integrator": "Euler", "substeps": 100, "damping": 0.5, "iterations": 4 });
        assert_eq!(read, expected);
        assert_eq!(settings("", 1), json!({}));
    }

    #[test]
    fn every_method_stands_in_a_table_and_is_found_by_its_name() {
        for one in &METHODS {
            assert!(one.points.iter().any(|point| point.is_main), "{}", one.label);
            assert!(method(one.label).is_some_and(|found| found.words == one.words));
        }
        let standard = METHODS[0].points.iter().find(|point| point.settings == STANDARD);
        assert!(METHODS[0].label == AUTOMATIC && standard.is_some_and(|point| point.is_main));
    }

    #[test]
    fn dear_settings_are_left_out_of_fine_sizes() {
        let point = more("", "m");
        let affordable = ["xs", "s", "m", "l", "liver"].map(|size| is_affordable(&point, size));
        assert_eq!(affordable, [true, true, true, false, true]);
        assert_eq!(["s", "n12", "liver"].map(cells), [Some(4), Some(12), None]);
    }
}
