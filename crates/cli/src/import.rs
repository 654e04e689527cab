//! Files from elsewhere as scenes: `viscera scene new`, and `viscera run` of a mesh or a scan.

use anyhow::{Result, bail};
use clap::Args;
use std::path::{Path, PathBuf};
use viscera::simulation::Balance;
use viscera::units::Dimension;
use viscera_import::{Fineness, Import, Options, folder_of, is_foreign, load, name_of, stem_of};
use viscera_resources::files;

use crate::progress;

/// How a file becomes bodies.
#[derive(Args, Clone, Debug, Default)]
pub struct ImportArguments {
    /// The length of edges, such as "8 mm"; with --graded of those at the surface
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
    /// Let tetrahedra grow inwards, away from the surface, which stays as fine: 10 to 40 % fewer of them
    #[arg(long)]
    graded: bool,
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
    graded: bool,
    #[arg(long, hide = true)]
    hollow: bool,
}

impl OfSceneNew {
    /// Refuses them, with the commands that do what was meant.
    pub fn refuse(&self, file: &Path) -> Result<()> {
        let [graded, hollow] =
            [self.graded, self.hollow].map(|is_given| is_given.then(String::new));
        let all = [
            ("edge", &self.edge),
            ("count", &self.count),
            ("unit", &self.unit),
            ("labels", &self.labels),
            ("names", &self.names),
            ("graded", &graded),
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
        let (labels, names) = (self.labels.clone(), self.names.clone());
        let (graded, hollow) = (self.graded, self.hollow);
        Ok(Options { fineness, unit, labels, names, graded, hollow, shapes_only: false })
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
    let bar = progress::spinner(String::new());
    let made = load(file, &options, &mut |doing| bar.set_message(doing));
    bar.finish_and_clear();
    made
}

/// The scene of a file from elsewhere, made in a folder beside the results, with a bar that says what goes on; and how its bodies
/// carry gravity. What was made is printed, or `is_quiet` a message.
pub fn scene_of(path: &Path, folder: &Path, is_quiet: bool) -> Result<(PathBuf, Option<Balance>)> {
    let bar = progress::spinner(String::new());
    let made = viscera_import::scene_of(path, folder, &mut |doing| bar.set_message(doing));
    bar.finish_and_clear();
    let (import, made) = made?;
    let text = format!("{}{}", import.describe(), made.text());
    match is_quiet {
        true => eprint!("{text}"),
        false => files::print(&text)?,
    }
    Ok((made.scene, import.balance))
}
