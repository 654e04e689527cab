//! Scenes of real anatomy, shortened.

use crate::common::{Bench, last_frame};
use std::path::{Path, PathBuf};

fn scene(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/anatomy").join(name)
}

/// Runs a scene with its pull done by `pull`, for so many frames.
fn pull(name: &str, motion: &str, pull: &str, frames: &str, elements: &str) {
    let Some(folder) = crate::data::data_folder() else { return };
    // The program runs in a folder of its own.
    let folder = std::path::absolute(folder).expect("a path");
    let bench = Bench::new("");
    let (scene, folder) = (scene(name).display().to_string(), folder.display().to_string());
    let time = format!("motion.{motion}.keys.0.time=\"{pull}\"");
    let elements = format!("solver.elements={elements}");
    let end = bench.end_of(&[
        "run",
        &scene,
        "--data",
        &folder,
        "--out",
        "out",
        "--frames",
        frames,
        "--set",
        &time,
        "--set",
        &elements,
        "--set",
        "output.picture_size=[320, 240]",
        "--every",
        "100",
    ]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    println!("{}{}", end.stderr, end.stdout);
    let summary = bench.summary("out");
    assert_eq!(summary["finished"], true);
    // Recovered-gradient tetrahedra may leave one in a thousand inside out: their energy is that of averages.
    let tets = summary["model"]["tets"].as_u64().expect("a count");
    let most = if elements.ends_with("plain") { 0 } else { tets / 1000 };
    for frame in summary["frames"].as_array().expect("frames") {
        let inverted = frame["deformation"]["inverted"].as_u64();
        assert!(inverted.is_some_and(|inverted| inverted <= most), "at {} s", frame["time"]);
    }
    // Pulled by centimetres, so stretched, and not torn apart.
    let stretch = last_frame(&summary)["deformation"]["largest_stretch"].as_f64();
    assert!(stretch.is_some_and(|stretch| stretch > 1.1 && stretch < 4.0), "{stretch:?}");
    assert_eq!(bench.decode_png("out/picture.png").0, [320, 240]);
    bench.assert_gif_keeps_time("out", &summary);
}

#[test]
fn a_liver_from_a_scan_is_lifted_without_inverting() {
    for elements in ["plain", "auto"] {
        pull("liver.toml", "retractor", "0.4 s", "36", elements);
    }
}

#[test]
fn a_tongue_with_poor_tets_is_drawn_out_without_inverting() {
    for elements in ["plain", "auto"] {
        pull("tongue.toml", "forceps", "0.2 s", "14", elements);
    }
}

/// The meshes are not part of the project: where they are not at hand, that is what is said.
#[test]
fn scenes_without_their_meshes_say_where_to_put_them() {
    for (name, mesh) in [("liver.toml", "liver_coarse.msh"), ("tongue.toml", "tongue.vtu")] {
        let bench = Bench::new("");
        let end = bench.end_of(&["run", &scene(name).display().to_string(), "--out", "out"]);
        let message = end.error();
        assert!(message.starts_with(&format!("{mesh}: there is no such file in ")), "{message}");
        assert!(message.ends_with("name its folder with --data"), "{message}");
    }
}
