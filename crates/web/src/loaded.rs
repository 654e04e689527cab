//! From a scene's text and files to what a session runs.

use serde::Deserialize;
use viscera::scalar::Vec3;
use viscera::scene::{BodyShape, Scene};
use viscera::simulation::{Assembly, Balance};
use viscera_stage::Settings;

use crate::catalog::mesh_settings;
use crate::session::MOST_TETS;

/// A scene to load.
#[derive(Clone, Debug, Deserialize)]
pub struct LoadRequest {
    /// The file's name, for messages.
    pub name: String,
    /// The scene file.
    pub text: String,
    /// Laid over it, as `--set` of `viscera run`.
    #[serde(default)]
    pub settings: Settings,
    /// Factor of the element size of bodies that have a shape: 1 as the scene says, above 1 coarser.
    #[serde(default = "one")]
    pub mesh: f64,
}

fn one() -> f64 {
    1.0
}

/// Factors of the element size that are taken: beyond, shapes are no longer recognised, or take minutes.
const FACTORS: std::ops::RangeInclusive<f64> = 0.25..=4.0;

/// A scene and its meshes.
#[derive(Debug)]
pub struct Loaded {
    /// With everything laid over it that was asked for.
    pub scene: Scene,
    /// Meshes and patches.
    pub assembly: Assembly,
    /// Factor of the element size.
    pub mesh: f64,
    /// Whether a factor changes anything.
    pub can_change_mesh: bool,
    /// Vertices of fixings.
    pub fixed: Vec<u32>,
}

impl Loaded {
    /// Reads the scene, and makes or reads its meshes; `load` gives the bytes of a file, `balance` those of a [`Balance`].
    pub fn new(
        request: &LoadRequest,
        load: &mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
        balance: Option<&[u8]>,
    ) -> Result<Self, String> {
        if !FACTORS.contains(&request.mesh) {
            return Err(format!(
                "mesh {} is no factor of the element size; give one from {} to {}",
                request.mesh,
                FACTORS.start(),
                FACTORS.end()
            ));
        }
        let parse = |settings: &Settings| {
            let overrides: Vec<(&str, &str)> =
                settings.iter().map(|(key, value)| (key.as_str(), value.as_str())).collect();
            Scene::parse(&request.name, &request.text, &overrides).map_err(|e| e.to_string())
        };
        let plain = parse(&request.settings)?;
        let can_change_mesh =
            plain.bodies.iter().any(|body| !matches!(body.shape, BodyShape::File { .. }));
        let scene = match request.mesh == 1.0 {
            true => plain,
            false => {
                let mut settings = request.settings.clone();
                settings.extend(mesh_settings(&plain, request.mesh));
                parse(&settings)?
            }
        };
        let balance = balance.and_then(Balance::from_bytes);
        let assembly = Assembly::with_balance(&scene, load, balance);
        let assembly = assembly.map_err(|error| error.to_string())?;
        let tets: usize = assembly.bodies.iter().map(|body| body.tets.len()).sum();
        if tets > MOST_TETS {
            return Err(format!(
                "{}: {tets} tetrahedra are more than the {MOST_TETS} that a page takes; use a coarser mesh, or the \
                 program `viscera`, which takes as many as there is memory for",
                request.name
            ));
        }
        let fixed = assembly.fixings.iter().flat_map(|patch| patch.vertices.clone()).collect();
        Ok(Self { scene, assembly, mesh: request.mesh, can_change_mesh, fixed })
    }

    /// Tetrahedra and vertices of all bodies.
    pub fn counts(&self) -> [usize; 2] {
        let tets = self.assembly.bodies.iter().map(|body| body.tets.len()).sum();
        [tets, self.assembly.builder.positions().len()]
    }

    /// Triangles of all surfaces; vertices count on from body to body.
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        let mut first = 0;
        let mut triangles = Vec::new();
        for body in &self.assembly.bodies {
            triangles.extend(body.surface.triangles.iter().map(|t| t.map(|v| v + first)));
            first += body.surface.vertices.len() as u32;
        }
        triangles
    }

    /// Where the surfaces are [m] with the tetrahedra's vertices in these places, one body after the other.
    pub fn surfaces(&self, positions: &[Vec3<f32>], into: &mut Vec<Vec3<f32>>) {
        let count = self.assembly.bodies.iter().map(|body| body.surface.vertices.len()).sum();
        into.resize(count, Vec3::ZERO);
        let mut rest = into.as_mut_slice();
        for body in &self.assembly.bodies {
            let (own, after) = rest.split_at_mut(body.surface.vertices.len());
            if let Some(tissue) = positions.get(body.vertices.clone()) {
                // Both were made together: their sizes agree.
                let placed = body.embedding.apply(tissue, own);
                debug_assert!(placed.is_ok(), "{placed:?}");
            }
            rest = after;
        }
    }
}
