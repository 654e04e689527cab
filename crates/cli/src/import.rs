//! Files from elsewhere as scenes: `viscera scene new`, and `viscera run` and `viscera view` of a mesh or a scan.

use anyhow::{Result, bail};
use clap::Args;
use std::path::{Path, PathBuf};
use viscera::mesh::quality::summarize_quality;
use viscera::units::Dimension;
use viscera_import::{Fineness, Import, Options, millilitres, name_of, open, parts, stem_of};
use viscera_report::Table;
use viscera_resources::files;

use crate::made::{Replace, write};
use crate::progress;

/// How a file becomes bodies.
#[derive(Args, Clone, Debug, Default)]
pub struct ImportArguments {
    /// The length of edges inside, such as "8 mm"
    #[arg(long, value_name = "LENGTH", conflicts_with = "count")]
    edge: Option<String>,
    /// About how many tetrahedra in all; 20,000 where nothing is said
    #[arg(long, value_name = "NUMBER", value_parser = crate::run::from_one::<usize>)]
    count: Option<usize>,
    /// The length that 1 in a mesh file stands for, such as "1 mm"; guessed and said where it is not given
    #[arg(long, value_name = "LENGTH")]
    unit: Option<String>,
    /// Labels of a scan, by name or number: liver,stomach,5; all soft organs where there are none
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    labels: Vec<String>,
    /// Names of labels by number, in place of those in the file: 1=liver,2=tumor
    #[arg(long, value_name = "NUMBER=NAME", value_delimiter = ',', value_parser = label_name)]
    names: Vec<(u16, String)>,
    /// Leave hollow organs a wall around a cavity, in place of filling them
    #[arg(long)]
    hollow: bool,
}

/// Options of `viscera scene new` that people try elsewhere: they are told where these work.
#[derive(Args, Clone, Debug, Default)]
pub struct OfSceneNew {
    #[arg(long, hide = true, num_args = 0..=1, default_missing_value = "")]
    edge: Option<String>,
    #[arg(long, hide = true, num_args = 0..=1, default_missing_value = "")]
    count: Option<String>,
    #[arg(long, hide = true, num_args = 0..=1, default_missing_value = "")]
    unit: Option<String>,
    #[arg(long, hide = true, num_args = 0..=1, default_missing_value = "")]
    labels: Option<String>,
    #[arg(long, hide = true, num_args = 0..=1, default_missing_value = "")]
    names: Option<String>,
    #[arg(long, hide = true)]
    hollow: bool,
}

impl OfSceneNew {
    /// Refuses them, with the commands that do what was meant.
    pub fn refuse(&self, file: &Path) -> Result<()> {
        let hollow = self.hollow.then(String::new);
        let all = [
            ("edge", &self.edge),
            ("count", &self.count),
            ("unit", &self.unit),
            ("labels", &self.labels),
            ("names", &self.names),
            ("hollow", &hollow),
        ];
        let given: Vec<(&str, &String)> =
            all.iter().filter_map(|(name, value)| Some((*name, value.as_ref()?))).collect();
        let Some((first, _)) = given.first() else { return Ok(()) };
        if !is_foreign(file) {
            bail!(
                "--{first} says how a scene is made of a mesh or a scan (viscera scene new FILE --{first} ...), and {} is no such file",
                file.display()
            );
        }
        let options = given.iter().map(|(name, value)| match value.as_str() {
            "" => format!(" --{name}"),
            value if value.contains(' ') => format!(" --{name} \"{value}\""),
            value => format!(" --{name} {value}"),
        });
        let options: String = options.collect();
        let name = name_of(stem_of(&file.to_string_lossy()));
        let scene = folder_of(file).join("scene").join(name + ".toml");
        bail!(
            "--{first} says how a scene is made; make it by `viscera scene new {}{options}`, then `viscera run {}`",
            file.display(),
            scene.display()
        )
    }
}

/// "5=liver".
pub fn label_name(text: &str) -> Result<(u16, String), String> {
    let pair = text.split_once('=').map(|(label, name)| (label.trim().parse(), name.trim()));
    match pair {
        Some((Ok(label), name)) if label > 0 && !name.is_empty() => Ok((label, name.to_owned())),
        _ => Err("write numbers of labels with their names, such as 1=liver,2=tumor".to_owned()),
    }
}

impl ImportArguments {
    fn options(&self) -> Result<Options> {
        let length = |text: &Option<String>, flag: &str| match text {
            None => Ok(None),
            Some(text) => match Dimension::Length.parse(text) {
                Ok(value) if value > 0.0 => Ok(Some(value)),
                Ok(_) => bail!("{flag}: a length above zero is needed, for example \"8 mm\""),
                Err(error) => bail!("{flag}: {error}"),
            },
        };
        let edge = length(&self.edge, "--edge")?.map(Fineness::Edge);
        let fineness = edge.or(self.count.map(Fineness::Count));
        let unit = length(&self.unit, "--unit")?;
        let (labels, names, hollow) = (self.labels.clone(), self.names.clone(), self.hollow);
        Ok(Options { fineness, unit, labels, names, hollow, shapes_only: false })
    }
}

/// Makes bodies of a file, with a bar that says which.
pub fn import(file: &Path, arguments: &ImportArguments) -> Result<Import> {
    import_with(file, arguments.options()?)
}

/// As [`import`], for shapes only.
pub fn import_shapes(file: &Path, arguments: &ImportArguments) -> Result<Import> {
    import_with(file, Options { shapes_only: true, ..arguments.options()? })
}

fn import_with(file: &Path, options: Options) -> Result<Import> {
    let name = file.display().to_string();
    let bar = progress::spinner(format!("reading {name}"));
    let load = |name: &str| files::read(Path::new(name)).map_err(|error| error.to_string());
    let found = open(&name, load);
    let made = found.and_then(|found| {
        parts(&name, found, &options, &mut |part| bar.set_message(format!("filling {part}")))
    });
    bar.finish_and_clear();
    Ok(made?)
}

/// What was made: bodies with their sizes and shapes, and what was assumed.
pub fn describe(import: &Import) -> String {
    let mut table = Table::new([
        "body",
        "tets",
        "ml in scan",
        "ml in mesh",
        "angles, degrees",
        "below 10",
        "tissue",
        "held at",
    ]);
    for part in &import.parts {
        let quality = summarize_quality(&part.mesh);
        let (low, high) = (quality.min_dihedral.to_degrees(), quality.max_dihedral.to_degrees());
        let held: Vec<&str> =
            part.holds.iter().map(|hold| hold.reason.split(':').next().unwrap_or("")).collect();
        table.row([
            part.name.clone(),
            part.mesh.tets().len().to_string(),
            part.wanted.map_or_else(|| "-".to_owned(), millilitres),
            millilitres(part.mesh.volume()),
            format!("{low:.1} to {high:.1}"),
            format!("{:.3} %", 100.0 * share_below(&part.mesh, 10.0)),
            part.tissue.preset.unwrap_or("unknown").to_owned(),
            held.join(", "),
        ]);
    }
    let mut text = table.to_text();
    for touching in &import.touching {
        let (from, to) = (&import.parts[touching.from].name, &import.parts[touching.to].name);
        text.push_str(&format!(
            "tied: {from} to {to}, {:.0} % of its surface\n",
            100.0 * touching.share
        ));
    }
    for warning in &import.warnings {
        text.push_str(&format!("warning: {warning}\n"));
    }
    for note in &import.notes {
        text.push_str(&format!("note: {}\n", note.trim()));
    }
    for part in &import.parts {
        for note in &part.notes {
            text.push_str(&format!("note: {}: {note}\n", part.name));
        }
    }
    text
}

/// The share of dihedral angles below a bound [degrees].
fn share_below(mesh: &viscera::mesh::TetMesh, bound: f64) -> f64 {
    let angles = (0..mesh.tets().len())
        .flat_map(|tet| viscera::mesh::quality::dihedral_angles(mesh.corners(tet)));
    let count = angles.filter(|angle| angle.to_degrees() < bound).count();
    count as f64 / (6 * mesh.tets().len()).max(1) as f64
}

/// A mesh, a surface or a scan, in place of a scene file.
pub fn is_foreign(path: &Path) -> bool {
    let is_toml = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
    !is_toml && path.is_file() && looks_like_data(path)
}

/// Not text that could be a scene without an ending of its own.
fn looks_like_data(path: &Path) -> bool {
    // Also of images that are not read: the error says what is.
    const ENDINGS: [&str; 21] = [
        "msh", "vtk", "vtu", "vtp", "ele", "node", "mesh", "inp", "obj", "stl", "ply", "nii", "gz",
        "nrrd", "nhdr", "mha", "mhd", "mgz", "mgh", "dcm", "hdr",
    ];
    path.extension().is_some_and(|e| ENDINGS.iter().any(|known| e.eq_ignore_ascii_case(known)))
}

/// The scene of a file from elsewhere, made in a folder beside the results.
pub fn scene_of(path: &Path, folder: &Path) -> Result<PathBuf> {
    let import = import(path, &ImportArguments::default())?;
    let made = write(&import, &title_of(path), &folder.join("scene"), Replace::Never)?;
    files::print(&format!("{}{}", describe(&import), made.text()))?;
    Ok(made.scene)
}

/// What a scene of a file is called: "left kidney" of `data/left_kidney.nii.gz`.
pub fn title_of(path: &Path) -> String {
    stem_of(&path.to_string_lossy()).replace('_', " ")
}

/// The folder for all that is made of a file: `out/left_kidney` of `data/Left_kidney.nii.gz`.
pub fn folder_of(path: &Path) -> PathBuf {
    Path::new("out").join(name_of(stem_of(&path.to_string_lossy())))
}
