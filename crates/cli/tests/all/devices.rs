//! What steps are computed on: the list of devices, and what is said where one cannot be used. Needs a
//! graphics adapter, for which a software driver does.

use crate::common::{Bench, End, TINY};
use serde_json::Value;

/// What to install, where there is no adapter.
const HINT: &str = "no graphics adapter was found; install its Vulkan driver";

fn adapters(bench: &Bench) -> Vec<Value> {
    let end = bench.end_of(&["devices", "--json"]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    let listing: Value = serde_json::from_str(&end.stdout).expect("JSON");
    let speed = &listing["cpu"]["tet_sweeps_per_second"];
    assert!(speed.as_f64().is_some_and(|speed| speed > 1e5), "{speed}");
    let adapters = listing["adapters"].as_array().expect("a list").clone();
    assert!(!adapters.is_empty(), "{}", listing["hint"]);
    adapters
}

/// Runs `viscera` as if no driver were installed.
#[cfg(target_os = "linux")]
fn without_drivers(bench: &Bench, arguments: &[&str]) -> End {
    let mut command = bench.viscera(arguments);
    for variable in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
        command.env(variable, "/nowhere/no_driver.json");
    }
    End::of(&command.output().expect("viscera starts"))
}

#[test]
fn every_adapter_is_listed_with_its_limits_and_speed() {
    let bench = Bench::new(TINY);
    for adapter in adapters(&bench) {
        assert!(adapter["name"].as_str().is_some_and(|name| !name.is_empty()), "{adapter}");
        let kinds = ["discrete", "integrated", "virtual", "software", "other"];
        assert!(kinds.contains(&adapter["kind"].as_str().unwrap_or_default()), "{adapter}");
        let limit = |key: &str| adapter["limits"][key].as_u64().expect("a limit");
        if adapter["baseline"] == true {
            // What WebGPU guarantees.
            assert!(limit("storage_binding_bytes") >= 128 << 20);
            assert!(limit("buffer_bytes") >= 256 << 20);
            assert!(limit("workgroup_threads") >= 256 && limit("workgroup_bytes") >= 16 << 10);
            let speed = &adapter["tet_sweeps_per_second"];
            assert!(speed.as_f64().is_some_and(|speed| speed > 1e4), "{adapter}");
            assert_eq!(adapter["problem"], Value::Null);
        } else {
            assert!(adapter["problem"].as_str().is_some_and(|text| !text.is_empty()), "{adapter}");
        }
    }
}

#[test]
fn a_run_says_what_computed_it() {
    let bench = Bench::new(TINY);
    let end = bench.run(&["--frames", "2", "--set", "solver.method=xpbd"]);
    let printed = end.stdout.lines().find_map(|line| line.strip_prefix("device: "));
    let printed = printed.expect("a line about the device");
    assert!(
        printed.starts_with("CPU: the mesh has 10 tetrahedra; a GPU pays from about"),
        "{printed}"
    );
    let summary = bench.summary("out");
    assert_eq!(
        (&summary["device"], &summary["solver"]["device"]),
        (&printed.into(), &"auto".into())
    );

    let gpu = bench.summary_of(&["--frames", "2", "--set", "solver.device=gpu"]);
    let device = gpu["device"].as_str().expect("text");
    assert!(device.contains(": as asked for") && !device.starts_with("CPU"), "{device}");
    assert_eq!(gpu["frames"].as_array().map(Vec::len), Some(2));
}

#[test]
fn an_unknown_name_is_answered_with_those_there_are() {
    let bench = Bench::new(TINY);
    let end = bench.run(&["--set", "solver.device=\"no such thing\""]);
    let names = adapters(&bench);
    let error = end.error();
    assert!(error.starts_with("no adapter is called `no such thing`; there are: "), "{error}");
    assert!(names.iter().all(|a| error.contains(a["name"].as_str().unwrap_or("?"))), "{error}");
    assert!(!bench.path("out").exists(), "a refused run leaves no folder");
}

#[test]
fn double_precision_is_refused_by_graphics_processors() {
    let bench = Bench::new(TINY);
    let end = bench.run(&["--set", "solver.device=gpu", "--set", "solver.precision=f64"]);
    assert!(end.error().starts_with("graphics processors compute in single precision"));
    let cpu = bench.summary_of(&["--frames", "1", "--set", "solver.precision=f64"]);
    assert_eq!(cpu["device"], "CPU: explicit steps that suit the present shape");
}

#[test]
#[cfg(target_os = "linux")]
fn without_a_driver_everything_but_the_gpu_works() {
    let bench = Bench::new(TINY);
    let end = without_drivers(&bench, &["devices"]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    assert!(end.stdout.contains(HINT) && end.stdout.contains("processor"), "{}", end.stdout);

    let gpu = ["run", "scene.toml", "--out", "out", "--set", "solver.device=gpu"];
    let end = without_drivers(&bench, &gpu);
    assert!(end.error().starts_with(HINT), "{}", end.stderr);
    assert!(!bench.path("out").exists(), "a refused run leaves no folder");

    // Large enough to look for one.
    let cells = "body.bar.cells=[40, 20, 20]";
    let large = ["run", "scene.toml", "--out", "out", "--frames", "1", "--set", cells, "--set"];
    let plain = "output.picture=false";
    let colors = "solver.colors=1";
    let more = [plain, "--set", colors, "--set", "solver.method=xpbd"];
    let end = without_drivers(&bench, &[&large[..], &more].concat());
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    assert_eq!(bench.summary("out")["device"], "CPU: no graphics adapter");
}

/// Whole texts, one for each kernel and, where it depends on them, formulation and order of sweeps.
#[test]
fn kernels_are_written_as_devices_get_them() {
    let bench = Bench::new(TINY);
    let end = bench.end_of(&["devices", "--kernels", "kernels"]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    let read = |name: &str| std::fs::read_to_string(bench.path(name)).expect(name);
    for (name, words) in [
        ("kernels/predict.wgsl", "fn predict("),
        ("kernels/solve-GreenStrain-Vertices.wgsl", "fn green_strain_solve("),
        ("kernels/solve-NeoHookeanStretch-Jacobi.wgsl", "fn neo_hookean_stretch_solve("),
    ] {
        let text = read(name);
        assert!(text.contains(words) && text.contains("@compute"), "{name}");
        assert!(!text.contains('$'), "{name}: something is left to fill in");
    }
    let count = std::fs::read_dir(bench.path("kernels")).expect("a folder").count();
    assert!(end.stdout.starts_with(&format!("{count} kernels are in")), "{}", end.stdout);
    assert!(count > 60, "{count}");
    let end = bench.end_of(&["devices", "--kernels", "scene.toml"]);
    assert!(end.code != Some(0) && end.error().contains("--kernels"), "{}", end.error());
}
