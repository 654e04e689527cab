//! Helpers shared by the integration tests: the program, and the fixtures of `tests/fixtures`, see its README.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use viscera::material::{Material, MaterialModel};
use viscera::mesh::TetMesh;
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::{Real, Vec3};
use viscera::solver::{Inputs, Pin};

/// Numbers computed by independent finite elements. A file that does not fit is a mistake of ours,
/// so reading it panics and says where.
pub struct Fixture {
    name: String,
    material: String,
    values: BTreeMap<String, Vec<f64>>,
    tables: BTreeMap<String, Vec<Vec<f64>>>,
}

impl Fixture {
    /// Reads `tests/fixtures/<name>.txt`: lines of `key numbers...`, and
    /// `table key row_count column_count` followed by its rows; `#` starts a comment.
    pub fn read(name: &str) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/fixtures/{name}.txt"));
        let text = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let mut lines = text.lines().enumerate().filter(|(_, line)| !line.starts_with('#'));
        let numbers = |line: usize, words: &str| -> Vec<f64> {
            let number = |word: &str| word.parse().map_err(|e| format!("`{word}`: {e}"));
            let row: Result<_, String> = words.split_whitespace().map(number).collect();
            row.unwrap_or_else(|e| panic!("{name}.txt, line {}: {e}", line + 1))
        };
        let mut material = String::new();
        let (mut values, mut tables) = (BTreeMap::new(), BTreeMap::new());
        while let Some((line, text)) = lines.next() {
            let (key, rest) = text.split_once(' ').unwrap_or((text, ""));
            if key == "material" {
                rest.clone_into(&mut material);
            } else if key == "table" {
                let (key, sizes) = rest.split_once(' ').unwrap_or((rest, ""));
                let [rows, columns] = numbers(line, sizes)[..] else {
                    panic!("{name}.txt, line {}: a table needs rows and columns", line + 1);
                };
                let table: Vec<_> = lines
                    .by_ref()
                    .take(rows as usize)
                    .map(|(line, text)| numbers(line, text))
                    .collect();
                let fits = |row: &Vec<f64>| row.len() == columns as usize;
                assert!(table.len() == rows as usize && table.iter().all(fits), "{name}: {key}");
                tables.insert(key.to_owned(), table);
            } else {
                values.insert(key.to_owned(), numbers(line, rest));
            }
        }
        Self { name: name.to_owned(), material, values, tables }
    }

    /// A number by its key.
    pub fn value(&self, key: &str) -> f64 {
        match self.values.get(key).map(Vec::as_slice) {
            Some(&[value]) => value,
            _ => panic!("{}: no number `{key}`", self.name),
        }
    }

    fn rows(&self, key: &str) -> &[Vec<f64>] {
        self.tables.get(key).unwrap_or_else(|| panic!("{}: no table `{key}`", self.name))
    }

    /// A table of vectors by its key.
    pub fn vectors(&self, key: &str) -> Vec<Vec3<f64>> {
        self.rows(key).iter().map(|row| Vec3::from_f64([row[0], row[1], row[2]])).collect()
    }

    /// Acceleration of gravity [m/s^2].
    pub fn gravity(&self) -> Vec3<f64> {
        let gravity = self.values.get("gravity");
        gravity.map_or(Vec3::ZERO, |g| Vec3::from_f64([g[0], g[1], g[2]]))
    }

    /// Pinned vertices and where they are held.
    pub fn pins(&self) -> Vec<Pin<f64>> {
        let pin = |row: &Vec<f64>| Pin {
            vertex: row[0] as u32,
            target: Vec3::from_f64([row[1], row[2], row[3]]),
        };
        self.rows("pins").iter().map(pin).collect()
    }

    /// True where a vertex is not pinned, shape [vertex_count].
    pub fn free(&self) -> Vec<bool> {
        let mut free = vec![true; self.rows("vertices").len()];
        for pin in self.pins() {
            free[pin.vertex as usize] = false;
        }
        free
    }

    /// The mesh at rest.
    pub fn mesh(&self) -> TetMesh {
        let tet = |row: &Vec<f64>| [row[0], row[1], row[2], row[3]].map(|v| v as u32);
        let tets: Vec<_> = self.rows("tets").iter().map(tet).collect();
        let regions = vec![0; tets.len()];
        let (mesh, repairs) =
            TetMesh::new(self.vectors("vertices"), tets, regions).expect("a legal mesh");
        assert_eq!(repairs, Default::default(), "{}: vertices keep their numbers", self.name);
        mesh
    }

    /// The tissue, viscous where the fixture says so.
    pub fn material(&self) -> Material {
        let model = match self.material.as_str() {
            "saint_venant_kirchhoff" => MaterialModel::SaintVenantKirchhoff,
            "stable_neo_hookean" => MaterialModel::StableNeoHookean,
            other => panic!("{}: no material `{other}`", self.name),
        };
        let [young, poisson, density] = ["young", "poisson", "density"].map(|key| self.value(key));
        let viscosity = self.values.get("viscosity").map_or(0.0, |viscosity| viscosity[0]);
        let material = Material::new(model, young, poisson, density).expect("a legal material");
        material.with_viscosity(viscosity).expect("a legal viscosity")
    }

    /// The body alone.
    pub fn model<S: Real>(&self) -> Model<S> {
        let mut builder = ModelBuilder::new();
        builder.add_body(&self.mesh(), &self.material()).expect("a legal body");
        builder.build().expect("a legal model")
    }

    /// Gravity and pins.
    pub fn inputs(&self) -> Inputs<f64> {
        Inputs { gravity: self.gravity(), pins: self.pins(), ..Inputs::default() }
    }
}

/// Fixtures by the beginnings and endings of their names.
fn read_all(
    beginnings: &'static [&'static str],
    endings: &'static [&'static str],
) -> impl Iterator<Item = (String, Fixture)> {
    let with_ending =
        |&beginning: &&'static str| endings.iter().map(move |e| format!("{beginning}_{e}"));
    beginnings.iter().flat_map(with_ending).map(|name| {
        let fixture = Fixture::read(&name);
        (name, fixture)
    })
}

/// Bodies deformed at random.
pub fn configurations() -> impl Iterator<Item = (String, Fixture)> {
    read_all(&["configuration_xs", "inverted_xs"], &["stvk", "snh"])
}

/// Bodies at rest under load.
pub fn equilibria() -> impl Iterator<Item = (String, Fixture)> {
    read_all(&["cantilever_xs", "cantilever_s", "stretch_xs"], &["stvk", "snh"])
        .chain(read_all(&["cantilever_soft_xs"], &["snh"]))
}

/// Steps of implicit Euler.
pub fn motions() -> impl Iterator<Item = (String, Fixture)> {
    read_all(&["steps_xs"], &["stvk", "stvk_viscous", "snh", "snh_viscous"])
}

/// Length of the longest vector.
pub fn largest(vectors: &[Vec3<f64>]) -> f64 {
    vectors.iter().fold(0.0, |largest, v| v.length().max(largest))
}

/// Element by element.
pub fn difference(a: &[Vec3<f64>], b: &[Vec3<f64>]) -> Vec<Vec3<f64>> {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(&a, &b)| a - b).collect()
}

/// Largest difference of positions over the largest displacement from rest.
pub fn position_error(x: &[Vec3<f64>], expected: &[Vec3<f64>], rest: &[Vec3<f64>]) -> f64 {
    largest(&difference(x, expected)) / largest(&difference(expected, rest))
}

/// Runs the program.
pub fn lab(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_viscera-lab"))
        .args(arguments)
        .output()
        .expect("the program starts")
}

/// What a program has written.
pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// What a builder has, as a model.
pub fn build(builder: &ModelBuilder) -> Model<f64> {
    builder.build().expect("a legal model")
}

/// One body of one material.
pub fn body(mesh: &TetMesh, material: &Material) -> Model<f64> {
    let mut builder = ModelBuilder::new();
    builder.add_body(mesh, material).expect("a legal body");
    build(&builder)
}
