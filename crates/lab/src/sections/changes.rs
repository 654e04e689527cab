//! What a user wants otherwise: stiffness, compressibility or shape of the scenes.

use anyhow::{Context as _, Result, bail, ensure};
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use viscera::material::{Material, MaterialModel};
use viscera::mesh::{TetMesh, io};
use viscera::units::Dimension;

use crate::load_cases::{LoadCase, Size, tissue};

/// Changes to the scenes of a study, from `--set KEY=VALUE`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Changes {
    /// Young's modulus [Pa].
    pub young: Option<f64>,
    /// Poisson's ratio.
    pub poisson: Option<f64>,
    /// A body in the place of the bar.
    pub mesh: Option<UserMesh>,
    /// As they were written.
    written: Vec<String>,
}

/// A mesh of the user's.
#[derive(Clone, Debug)]
pub struct UserMesh {
    /// The file.
    pub path: PathBuf,
    /// What it holds, read once.
    mesh: Arc<TetMesh>,
}

impl PartialEq for UserMesh {
    /// By the files: what they hold is compared nowhere.
    fn eq(&self, other: &Self) -> bool {
        self.path == other.path
    }
}

/// Scenes of a bar, where a mesh of the user's takes its place.
const BARS: [&str; 2] = ["cantilever", "twist"];

/// The keys, for help and errors.
const KEYS: &str = "young, poisson or mesh";

impl Changes {
    /// Reads `KEY=VALUE` texts; of a key that is given twice the last counts.
    pub fn parse(texts: &[String]) -> Result<Self> {
        let mut changes = Self::default();
        for text in texts {
            let Some((key, value)) = text.split_once('=') else {
                bail!("--set {text}: write KEY=VALUE, for example --set young=\"20 kPa\"");
            };
            changes.set(key.trim(), value.trim()).with_context(|| format!("--set {text}"))?;
            changes.written.push(text.clone());
        }
        // A pair that no tissue has is told at once, not in the middle of the work; so is a body that
        // cannot be held.
        let tissue = changes.tissue(MaterialModel::StableNeoHookean, 1e4, 0.45).context("--set")?;
        if changes.mesh.is_some() {
            for name in BARS {
                changes.load_case(name, Size::Tiny, tissue)?;
            }
        }
        Ok(changes)
    }

    fn set(&mut self, key: &str, value: &str) -> Result<()> {
        match key {
            "young" => {
                let young = Dimension::Pressure.parse(value)?;
                ensure!(young > 0.0, "Young's modulus must be above zero, for example 20 kPa");
                self.young = Some(young);
            }
            "poisson" => {
                let poisson: f64 =
                    value.parse().ok().filter(|p: &f64| p.is_finite()).with_context(|| {
                        format!("{value} is no number; write for example --set poisson=0.45")
                    })?;
                self.poisson = Some(poisson);
            }
            "mesh" => {
                let path = Path::new(value);
                ensure!(path.is_file(), "there is no file {}", path.display());
                let mesh = Arc::new(read_mesh(path)?);
                self.mesh = Some(UserMesh { path: path.to_owned(), mesh });
            }
            _ => bail!("there is no key `{key}`; a study's scenes have {KEYS}"),
        }
        Ok(())
    }

    /// Whether everything stays as it is.
    pub fn is_empty(&self) -> bool {
        self.written.is_empty()
    }

    /// Tissue with these numbers where nothing else is wanted.
    pub fn tissue(&self, model: MaterialModel, young: f64, poisson: f64) -> Result<Material> {
        tissue(model, self.young.unwrap_or(young), self.poisson.unwrap_or(poisson))
    }

    /// A scene of [`LoadCase::new`]; a mesh of the user's takes the place of a bar.
    pub fn load_case(&self, name: &'static str, size: Size, tissue: Material) -> Result<LoadCase> {
        let load_case = LoadCase::new(name, size, tissue)?;
        match &self.mesh {
            Some(UserMesh { path, mesh }) if BARS.contains(&name) => load_case
                .with_bar(TetMesh::clone(mesh))
                .with_context(|| format!("--set mesh={}", path.display())),
            _ => Ok(load_case),
        }
    }
}

fn read_mesh(path: &Path) -> Result<TetMesh> {
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    let name = path.display().to_string();
    Ok(io::read_tet_mesh(&name, &bytes, 1.0)?.0)
}

impl fmt::Display for Changes {
    /// As one writes them on the command line, with a blank before each.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.written.iter().try_for_each(|text| match text.contains(' ') {
            true => write!(f, " --set \"{text}\""),
            false => write!(f, " --set {text}"),
        })
    }
}
