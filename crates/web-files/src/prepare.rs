//! From files that were opened together to a scene that runs.

use std::collections::{BTreeMap, BTreeSet};

use serde::Deserialize;
use viscera::mesh::io::{Mesh, MeshFile, handover, obj};
use viscera::scene::{BodyShape, Scene};
use viscera::simulation::{Assembly, Balance};
use viscera_import::{Fineness, Found, Import, Options, open, parts, title_of};

/// About so many tetrahedra run in real time in a browser, on one thread.
const TETS: usize = 8_000;

/// Files by their names.
pub type Files = BTreeMap<String, Vec<u8>>;

/// What the page asks for.
#[derive(Clone, Debug, Default, Deserialize)]
pub struct Request {
    /// The file that was named first.
    #[serde(default)]
    pub first: String,
    /// Name and text of a scene that the files belong to, where it is none of them.
    #[serde(default)]
    pub scene: Option<(String, String)>,
    /// Laid over the scene, as `--set` of `viscera run`: keys and values.
    #[serde(default)]
    pub settings: Vec<(String, String)>,
}

/// A scene, and files that the page's first module reads.
#[derive(Clone, Debug, Default)]
pub struct Prepared {
    /// The scene file's name.
    pub name: String,
    /// The scene file.
    pub text: String,
    /// Its files, by the names that it has for them.
    pub files: Files,
    /// See [`Balance::to_bytes`]; nothing where nothing is to rest under gravity as it is.
    pub balance: Option<Vec<u8>>,
    /// What people should know, a line each.
    pub notes: Vec<String>,
}

/// A scene of a file in `files`, or the scene that is one of them. Calls `observe` with what is being done. An error says what is
/// wrong with which file, and what to do.
pub fn prepare(
    request: &Request,
    files: &Files,
    observe: &mut dyn FnMut(String),
) -> Result<Prepared, String> {
    if let Some((name, text)) = &request.scene {
        return runnable(request, (name, text.clone()), files, None, observe);
    }
    let is_scene = |name: &&String| name.to_ascii_lowercase().ends_with(".toml");
    if let Some(name) = files.keys().find(is_scene) {
        observe(format!("reading {name}"));
        let text = String::from_utf8(files[name].clone());
        let text = text.map_err(|_| format!("{name}: it is no text; save it as UTF-8"))?;
        return runnable(request, (name, text), files, None, observe);
    }
    let first = &request.first;
    observe(format!("reading {first}"));
    let import = import(first, files, observe)?;
    let mut made = import.scene(&title_of(first.as_ref())).files;
    // The scene file comes first.
    let (name, text) = made.remove(0);
    let text = String::from_utf8_lossy(&text).into_owned();
    let made: Files = made.into_iter().collect();
    let mut prepared = runnable(request, (&name, text), &made, import.balance.clone(), observe)?;
    prepared.notes.splice(..0, import.warnings);
    prepared.notes.extend(unused(first, files));
    Ok(prepared)
}

fn import(first: &str, files: &Files, observe: &mut dyn FnMut(String)) -> Result<Import, String> {
    let mut load = |name: &str| missing(files, name);
    let found = open(first, &mut load).map_err(|error| error.to_string())?;
    let mut fill = |part: &str| observe(format!("filling {part}"));
    // Tetrahedra stay as they are.
    let fineness = (!matches!(found, Found::Tets(..))).then_some(Fineness::Count(TETS));
    parts(first, found, &Options { fineness, ..Options::default() }, &mut fill)
        .map_err(|error| error.to_string())
}

/// Files that were opened along and are of no use here.
fn unused(first: &str, files: &Files) -> Option<String> {
    let stem = |name: &str| name.rsplit_once('.').map_or(name, |(stem, _)| stem).to_owned();
    // TetGen's come in pairs.
    let others = files.keys().filter(|name| stem(name) != stem(first));
    let others: Vec<&str> = others.map(String::as_str).collect();
    (!others.is_empty()).then(|| {
        format!(
            "only {first} is shown, not {}: several meshes come together by a scene file that names them",
            others.join(", ")
        )
    })
}

fn missing(files: &Files, name: &str) -> Result<Vec<u8>, String> {
    let found = files.get(name).cloned();
    found.ok_or_else(|| format!("{name}: there is no such file; open it together with the scene"))
}

/// The scene with its files as the first module reads them. Settings that it does not take are for that module to name.
fn runnable(
    request: &Request,
    (name, text): (&str, String),
    files: &Files,
    known: Option<Balance>,
    observe: &mut dyn FnMut(String),
) -> Result<Prepared, String> {
    let settings = request.settings.iter().map(|(key, value)| (key.as_str(), value.as_str()));
    let settings: Vec<_> = settings.collect();
    let scene = match Scene::parse(name, &text, &settings) {
        Ok(scene) => scene,
        Err(_) => Scene::parse(name, &text, &[]).map_err(|error| error.to_string())?,
    };
    observe(format!("putting {name} together"));
    let mut asked = BTreeSet::new();
    let mut load = |name: &str| {
        asked.insert(name.to_owned());
        missing(files, name)
    };
    let assembly = Assembly::with_balance(&scene, &mut load, known);
    let assembly = assembly.map_err(|error| error.to_string())?;
    let tissue: BTreeSet<&str> = scene
        .bodies
        .iter()
        .filter_map(|body| match &body.shape {
            BodyShape::File { mesh, .. } => Some(mesh.as_str()),
            _ => None,
        })
        .collect();
    let mut plain = Files::new();
    for name in asked {
        let bytes = match plainer(&name, files, tissue.contains(name.as_str())) {
            Some(bytes) => bytes,
            // A list of numbers for a tool, or the second of two files.
            None => missing(files, &name)?,
        };
        plain.insert(name, bytes);
    }
    let balance = assembly.balance();
    // How far tissue would sag without is no news while it does not.
    let is_news =
        |note: &String| balance.is_none_or(|balance| !balance.notes().any(|other| other == note));
    let notes = assembly.notes.iter().filter(|note| is_news(note)).cloned().collect();
    let balance = balance.map(Balance::to_bytes);
    Ok(Prepared { name: name.to_owned(), text, files: plain, balance, notes })
}

/// A mesh in a format that the first module reads; nothing where it is no mesh.
fn plainer(name: &str, files: &Files, is_tissue: bool) -> Option<Vec<u8>> {
    let file = MeshFile::load(name, |name| missing(files, name)).ok()?;
    if !is_tissue {
        let (surface, _) = file.surface(1.0).ok()?;
        return obj::write(&surface, None).ok().map(String::into_bytes);
    }
    match file.mesh(1.0).ok()? {
        (Mesh::Tets(mesh), report) => handover::write(&mesh, &report.names()).ok(),
        (Mesh::Surface(_), _) => None,
    }
}
