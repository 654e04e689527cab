//! From a file to a scene beside it: what programs do with a mesh, a surface or a scan that is given in place of a scene.

use anyhow::{Context, Result};
use std::path::{Path, PathBuf};
use viscera_resources::files;

use crate::made::{Made, Replace, write};
use crate::{Import, Options, name_of, open, parts, stem_of};

/// Makes bodies of a file; calls `observe` with what is being done.
pub fn load(file: &Path, options: &Options, observe: &mut dyn FnMut(String)) -> Result<Import> {
    let name = file.display().to_string();
    observe(format!("reading {name}"));
    let found =
        open(&name, |name| files::read(Path::new(name)).map_err(|error| error.to_string()))?;
    Ok(parts(&name, found, options, &mut |part| observe(format!("filling {part}")))?)
}

/// The scene of a file, made in `scene` of a folder; calls `observe` with what is being done. A scene that is there already
/// stays: another one, or one that was changed, is an error that names it.
pub fn scene_of(
    file: &Path,
    folder: &Path,
    observe: &mut dyn FnMut(String),
) -> Result<(Import, Made)> {
    let folder = folder.join("scene");
    // Innermost first.
    let new = folder.ancestors().take_while(|folder| !folder.exists()).map(Path::to_owned);
    let new: Vec<PathBuf> = new.filter(|folder| !folder.as_os_str().is_empty()).collect();
    // Before seconds of work, of which nothing would stay.
    files::prepare_folder(&folder, "--out").with_context(|| {
        let file = file.display();
        format!(
            "the scene of {file} is made in a folder below that in which the program was started"
        )
    })?;
    let import = load(file, &Options::default(), observe).inspect_err(|_| {
        for folder in &new {
            // One that is not empty by now is another program's.
            let _ = std::fs::remove_dir(folder);
        }
    })?;
    let made = write(&import, &title_of(file), &folder, Replace::Never)?;
    Ok((import, made))
}

/// Whether a file is a mesh, a surface or a scan, in place of a scene: by its ending.
pub fn is_foreign(path: &Path) -> bool {
    // Also of images that are not read: the error says what is.
    const ENDINGS: [&str; 21] = [
        "msh", "vtk", "vtu", "vtp", "ele", "node", "mesh", "inp", "obj", "stl", "ply", "nii", "gz",
        "nrrd", "nhdr", "mha", "mhd", "mgz", "mgh", "dcm", "hdr",
    ];
    let is_known =
        |ending: &std::ffi::OsStr| ENDINGS.iter().any(|e| ending.eq_ignore_ascii_case(e));
    path.extension().is_some_and(is_known) && path.is_file()
}

/// What a scene of a file is called: "left kidney" of `data/left_kidney.nii.gz`.
pub fn title_of(path: &Path) -> String {
    stem_of(&path.to_string_lossy()).replace('_', " ")
}

/// The folder for all that is made of a file: `out/left_kidney` of `data/Left_kidney.nii.gz`.
pub fn folder_of(path: &Path) -> PathBuf {
    Path::new("out").join(name_of(stem_of(&path.to_string_lossy())))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cube of 60 mm in millimetres, wound outwards.
    const CUBE: &str = "v 0 0 0\nv 60 0 0\nv 60 60 0\nv 0 60 0\nv 0 0 60\nv 60 0 60\nv 60 60 60\nv 0 60 60\n\
        f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

    #[test]
    fn a_file_has_its_scene_in_a_folder_of_its_name() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("Left_kidney.obj");
        assert!(!is_foreign(&file), "it is not there");
        std::fs::write(&file, CUBE).expect("a file");
        assert!(is_foreign(&file) && !is_foreign(folder.path()));
        assert_eq!(title_of(&file), "Left kidney");
        assert_eq!(folder_of(&file), Path::new("out/left_kidney"));
        let mut told = Vec::new();
        let out = folder.path().join("out");
        let made = scene_of(&file, &out, &mut |doing| told.push(doing));
        let (import, made) = made.expect("a scene");
        assert!(made.scene.starts_with(out.join("scene")) && made.scene.exists());
        assert!(import.describe().contains("1 in the file as 1 mm"), "{}", import.describe());
        let first = told.first().map_or("", |text| text);
        assert!(first.starts_with("reading ") && first.ends_with("Left_kidney.obj"), "{told:?}");
        assert!(told.iter().any(|text| text == "filling left_kidney"), "{told:?}");
    }

    #[test]
    fn a_file_that_is_no_mesh_leaves_no_folders() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("cube.obj");
        std::fs::write(&file, CUBE.replace("60 60 0", "60 nan 0")).expect("a file");
        let kept = folder.path().join("kept");
        std::fs::create_dir(&kept).expect("a folder");
        for out in [folder.path().join("a/b"), kept.clone()] {
            assert!(scene_of(&file, &out, &mut |_| {}).is_err());
        }
        assert!(!folder.path().join("a").exists() && kept.exists());
        assert!(!kept.join("scene").exists());
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_told_before_the_work() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("cube.obj");
        std::fs::write(&file, CUBE).expect("a file");
        // A file is no folder.
        let made = scene_of(&file, &file, &mut |doing| panic!("{doing}"));
        let error = format!("{:#}", made.err().expect("no folder"));
        assert!(error.contains("cannot write to") && error.contains("was started"), "{error}");
    }
}
