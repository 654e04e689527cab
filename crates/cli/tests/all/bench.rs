//! `viscera bench`: what it leaves behind, and what it refuses. Times are not judged.

use crate::common::{Bench, End};
use serde_json::Value;

const QUICK: [&str; 6] = ["bench", "--quick", "--seconds", "0", "--out", "out"];

fn bench(bench: &Bench, arguments: &[&str]) -> End {
    bench.end_of(&[&QUICK, arguments].concat())
}

/// The message of a bench that must be refused without leaving anything behind.
fn refusal(arguments: &[&str]) -> String {
    let folder = Bench::new("");
    let end = bench(&folder, arguments);
    assert_eq!(folder.files("out").len(), 0, "results of a refused bench");
    assert!(end.stdout.is_empty(), "{}", end.stdout);
    end.error();
    end.stderr
}

fn cases(folder: &Bench, file: &str) -> Vec<Value> {
    let results: Value = serde_json::from_slice(&folder.read(file)).expect("JSON");
    for bandwidth in results["bandwidths"].as_array().expect("bandwidths") {
        assert!(bandwidth["bytes_per_second"].as_f64().is_some_and(|b| b > 0.0), "{bandwidth}");
    }
    results["cases"].as_array().expect("cases").clone()
}

/// Numbers are there, finite and above zero. JSON has no others than finite ones.
fn assert_is_measured(case: &Value) {
    for key in [
        "tets",
        "vertices",
        "colors",
        "repetitions",
        "step_seconds_median",
        "step_seconds_min",
        "step_ns_per_tet",
        "bytes_per_tet",
        "compulsory_bytes_per_tet",
    ] {
        assert!(case[key].as_f64().is_some_and(|number| number > 0.0), "{key} in {case}");
    }
    // Processors have threads, GPUs have dispatches.
    let [one, other] =
        if case["device"] == "GPU" { ["dispatches", "threads"] } else { ["threads", "dispatches"] };
    assert!(case[one].as_u64().is_some_and(|n| n > 0) && case[other].is_null(), "{case}");
    // A difference of times: missing where noise hides it, and never zero or below.
    for key in ["unit_ns_per_tet", "bandwidth_fraction"] {
        assert!(
            case[key].is_null() || case[key].as_f64().is_some_and(|n| n > 0.0),
            "{key} in {case}"
        );
    }
    assert!(case["step_seconds_min"].as_f64() <= case["step_seconds_median"].as_f64(), "{case}");
}

#[test]
fn every_solver_is_measured_at_every_size_with_every_number_of_threads() {
    let folder = Bench::new("");
    let end = bench(&folder, &["--sizes", "100,1k", "--threads", "2,1"]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    let cases = cases(&folder, "out/bench.json");
    cases.iter().for_each(assert_is_measured);
    let mut solvers: Vec<&str> = cases.iter().filter_map(|case| case["solver"].as_str()).collect();
    solvers.dedup();
    let one_size = [
        "green",
        "pair",
        "green-exact",
        "exact",
        "clusters",
        "cliques",
        "jacobi",
        "jacobi-green",
        "jacobi-anderson",
        "chebyshev",
        "anderson",
        "explicit-green",
        "explicit",
        "explicit-recovered",
        "quasi-newton-green",
        "quasi-newton",
        "quasi-newton-recovered",
    ];
    assert_eq!(solvers, [one_size, one_size].concat());
    let threads: Vec<_> = cases.iter().map(|case| case["threads"].as_u64()).collect();
    assert_eq!(threads, [Some(1), Some(2)].repeat(2 * one_size.len()));
    for case in &cases {
        // Bars are of whole slices of boxes.
        let asked = if case["tets"].as_u64() < Some(300) { 100.0 } else { 1000.0 };
        let tets = case["tets"].as_f64().unwrap_or(0.0);
        assert!((tets / asked - 1.0).abs() < 0.2, "{tets} tetrahedra instead of {asked}");
        // The constants of a tetrahedron, and six multipliers or two at the least.
        assert!(case["compulsory_bytes_per_tet"].as_f64() >= Some(60.0 + 16.0), "{case}");
    }
    let colors = |solver| cases.iter().find(|c| c["solver"] == solver).map(|c| &c["colors"]);
    assert_eq!(colors("cliques"), Some(&Value::from(4)));
    assert_eq!(colors("jacobi"), Some(&Value::from(1)));

    let report = String::from_utf8(folder.read("out/bench.md")).expect("UTF-8");
    for text in ["ns/tet/sweep", "| jacobi", "Compulsory bytes", "(bench/ns-per-tet-threads-2.svg)"]
    {
        assert!(report.contains(text), "{text} is not in {report}");
    }
    assert!(
        end.stdout.contains("ns/tet/sweep") && end.stdout.contains("anderson"),
        "{}",
        end.stdout
    );
    for threads in ["1", "2"] {
        let name = format!("out/bench/ns-per-tet-threads-{threads}.svg");
        let svg = String::from_utf8(folder.read(&name)).expect("UTF-8");
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"), "{svg}");
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        one_size
            .iter()
            .for_each(|solver| assert!(svg.contains(solver), "{solver} is not in {name}"));
    }
}

const THREE: &str = "\
$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
6
1 0 0 0
2 1 0 0
3 0 1 0
4 0 0 1
5 1 1 1
6 2 1 2
$EndNodes
$Elements
3
1 4 2 1 1 1 2 3 4
2 4 2 1 1 2 3 4 5
3 4 2 1 1 2 4 5 6
$EndElements
";

#[test]
fn a_mesh_of_three_tetrahedra_is_measured() {
    let folder = Bench::new("");
    folder.write("three.msh", THREE.as_bytes());
    let end =
        bench(&folder, &["--mesh", "three.msh", "--threads", "1,3", "--json", "deep/three.json"]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    let cases = cases(&folder, "deep/three.json");
    assert_eq!(cases.len(), 2 * 17, "every solver with one and with three threads");
    for case in &cases {
        assert_is_measured(case);
        assert_eq!((&case["tets"], &case["mesh"]), (&3.into(), &"three".into()));
    }
    assert!(!folder.files("out").contains("bench.json"), "the JSON goes to --json alone");
}

#[test]
fn sizes_that_are_none_are_refused_with_an_example() {
    for size in ["0", "100T", "51M", "-5", "", "nan"] {
        let message = refusal(&["--sizes", &format!("1k,{size}")]);
        assert!(message.contains("--sizes") && message.contains("from 1 to 50M"), "{message}");
    }
}

#[test]
fn misspelt_solver_is_told_the_nearest() {
    let message = refusal(&["--solvers", "exact,gren"]);
    assert!(message.contains("'gren'") && message.contains("exists: 'green'"), "{message}");
}

#[test]
fn impossible_numbers_of_threads_are_refused() {
    for threads in ["0", "10000", "-1", "two"] {
        let message = refusal(&[&format!("--threads={threads}")]);
        assert!(message.contains("--threads"), "{message}");
    }
    assert!(refusal(&["--threads", "0"]).contains("1..=1024"));
}

#[test]
fn impossible_times_are_refused() {
    for seconds in ["-1", "nan", "inf", "1 h"] {
        let end = Bench::new("").end_of(&["bench", &format!("--seconds={seconds}")]);
        assert!(end.error().contains("--seconds"), "{}", end.stderr);
        assert!(end.stderr.contains("from 0 to 3600"), "{}", end.stderr);
    }
}

#[test]
fn what_does_not_fit_into_memory_is_refused_before_it_is_built() {
    let message = refusal(&["--sizes", "1k,10M", "--memory", "1 GB", "--solvers", "exact"]);
    assert!(message.contains("`exact` on 99") && message.contains("1 GB are allowed"), "{message}");
    assert!(message.contains("smaller --sizes") && message.contains("--memory \""), "{message}");
}

#[test]
fn mesh_files_that_are_none_are_refused() {
    assert!(refusal(&["--mesh", "nowhere.msh"]).contains("there is no such file"));
    let message = refusal(&["--mesh", "a.msh", "--sizes", "1k"]);
    assert!(message.contains("cannot be used with"), "{message}");
}

#[test]
fn places_that_cannot_be_written_are_refused_before_the_work() {
    let folder = Bench::new("");
    folder.write("file", b"");
    for arguments in [["--out", "file/deep"], ["--json", "file/deep.json"]] {
        let end = folder.end_of(&[&["bench", "--quick"], &arguments[..]].concat());
        assert!(end.error().contains("cannot write to"), "{}", end.stderr);
        assert!(end.error().contains(arguments[0]), "the option to change: {}", end.stderr);
    }
}

/// The CPU and the GPU on the same mesh; a software driver does.
#[cfg(feature = "gpu")]
fn assert_both_are_measured(sizes: &str) {
    let folder = Bench::new("");
    let end = bench(
        &folder,
        &["--device", "gpu", "--sizes", sizes, "--solvers", "green", "--threads", "1"],
    );
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    let cases = cases(&folder, "out/bench.json");
    cases.iter().for_each(assert_is_measured);
    let devices: Vec<_> = cases.iter().map(|case| &case["device"]).collect();
    assert_eq!(devices, ["CPU", "GPU"]);
    assert_eq!(cases[0]["tets"], cases[1]["tets"]);

    let results: Value = serde_json::from_slice(&folder.read("out/bench.json")).expect("JSON");
    assert_eq!(results["bandwidths"].as_array().map(Vec::len), Some(2));
    let has_clock = results["adapter"]["has_clock"].as_bool().expect("an adapter");
    let gpu = &cases[1];
    assert_eq!(gpu["step_device_seconds"].as_f64().is_some_and(|s| s > 0.0), has_clock, "{gpu}");
    if has_clock {
        let stages = gpu["stages"].as_array().expect("stages");
        let dispatches = stages.iter().filter_map(|stage| stage["dispatches"].as_u64());
        assert_eq!(Some(dispatches.sum::<u64>()), gpu["dispatches"].as_u64(), "{gpu}");
        let parts: Vec<_> = stages.iter().map(|stage| &stage["part"]).collect();
        assert_eq!(
            parts,
            ["prologue", "prologue", "iteration", "later iterations", "epilogue"],
            "{gpu}"
        );
    }
    let report = String::from_utf8(folder.read("out/bench.md")).expect("UTF-8");
    for text in ["| dispatches |", "(bench/cpu-and-gpu.svg)", "(bench/ns-per-tet-gpu.svg)"] {
        assert!(report.contains(text), "{text} is not in {report}");
    }
}

#[test]
#[cfg(feature = "gpu")]
fn a_graphics_processor_is_measured_beside_the_processor() {
    assert_both_are_measured("100");
}

#[test]
#[cfg(feature = "gpu")]
#[ignore = "slow: a thousand tetrahedra on a software driver"]
fn a_graphics_processor_is_measured_beside_the_processor_at_length() {
    assert_both_are_measured("1k");
}

/// Those that are alike once, each with its bytes.
#[cfg(feature = "gpu")]
fn assert_is_counted(counted: &[Value]) {
    assert_eq!(counted.len(), 11);
    for step in counted {
        let of = |key: &str| step[key].as_f64().unwrap_or(0.0);
        assert!(
            of("compulsory_bytes") > 0.0 && of("compulsory_bytes") <= of("moved_bytes"),
            "{step}"
        );
        assert!(of("largest_mesh") > 1e5 && of("bytes_per_tet") > 100.0, "{step}");
    }
}

#[test]
#[cfg(feature = "gpu")]
fn questions_are_answered_beside_their_aims() {
    let folder = Bench::new("");
    let line = "bench --device gpu --questions --sizes 100 --seconds 0 --threads 1 --out out";
    let end = folder.end_of(&line.split(' ').collect::<Vec<_>>());
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    let results: Value = serde_json::from_slice(&folder.read("out/bench.json")).expect("JSON");
    let answers = results["answers"].as_array().expect("answers");
    // Each of the processor and of the device, in turn.
    let asked: Vec<_> = answers
        .iter()
        .step_by(2)
        .map(|a| (a["solver"].as_str().unwrap_or(""), a["aims"]["seconds"].as_f64()))
        .collect();
    let expected = [
        ("jacobi-green", Some(0.25e-3)),
        ("green", Some(4e-3)),
        ("jacobi-anderson", Some(1e-3)),
        ("quasi-newton", Some(1e-3)),
        ("quasi-newton-recovered", Some(1e-3)),
        ("exact", None),
        ("clusters", None),
        ("explicit", None),
        ("explicit-recovered", None),
        ("quasi-newton", Some(0.3e-3)),
        ("quasi-newton", Some(0.3e-3)),
        ("quasi-newton", Some(0.3e-3)),
        ("quasi-newton", Some(3e-3)),
        ("exact", None),
        ("explicit", None),
        ("quasi-newton", Some(0.7e-3)),
        ("quasi-newton", None),
    ];
    assert_eq!(asked, expected);
    for answer in answers {
        assert!(answer["seconds"].as_f64().is_some_and(|s| s > 0.0), "{answer}");
        // Nothing is met, nor missed, on another mesh.
        assert!(answer["is_met"].is_null(), "{answer}");
        let is_solved = answer["solver"].as_str().is_some_and(|s| s.starts_with("quasi"))
            && !answer["aims"]["left"].is_null();
        assert_eq!(answer["left"].as_f64().is_some_and(|left| left < 0.1), is_solved, "{answer}");
    }
    let frames: Vec<_> = answers.iter().filter(|a| a["device"] == "GPU").collect();
    // Of soft tissue: eight passes, seven dispatches each. A body this small has no coarser level.
    let [solved, recovered, sweeps, clusters, explicit] = [3, 4, 5, 6, 7].map(|i| frames[i]);
    assert_eq!((&solved["steps"], &solved["passes"]), (&Value::from(1), &Value::from(8)));
    assert!(solved["dispatches"].as_u64() <= Some(120), "{solved}");
    assert!(recovered["dispatches"].as_u64() <= Some(180), "{recovered}");
    assert!(clusters["dispatches"].as_u64() <= Some(280), "{clusters}");
    assert_eq!(frames[8]["pass_dispatches"], 5);
    assert_eq!((&sweeps["steps"], &sweeps["passes"]), (&Value::from(10), &Value::from(2)));
    assert_eq!(explicit["pass_dispatches"], 2);
    let small_steps = explicit["passes"].as_u64().expect("small steps");
    assert!(explicit["dispatches"].as_u64() > Some(2 * small_steps), "{explicit}");
    // A tool adds what finds its contacts, what ends them, and its report.
    let [balance, tool] = [10, 11].map(|i| frames[i]["dispatches"].as_u64());
    assert_eq!((&frames[11]["read_back"], tool), (&Value::from("tool"), balance.map(|d| d + 3)));
    let counted = results["traffic"].as_array().expect("traffic");
    assert_is_counted(counted);
    assert_eq!(counted[7]["passes"], explicit["passes"]);
    assert_eq!(counted[3]["dispatches"], solved["dispatches"]);
    let sweeps: Vec<_> =
        results["cases"].as_array().expect("cases").iter().map(|case| &case["sweeps"]).collect();
    assert_eq!(sweeps[..6], [1, 1, 20, 20, 20, 20]);
    let report = String::from_utf8(folder.read("out/bench.md")).expect("UTF-8");
    for text in ["(bench/answers-and-aims.svg)", "(bench/rooflines.svg)", "evaluate_elements"] {
        assert!(report.contains(text), "{text} is not in {report}");
    }
    // The plot's names are of the mesh that was measured.
    let plot = String::from_utf8(folder.read("out/bench/answers-and-aims.svg")).expect("UTF-8");
    let tets = format!("{} for {}", frames[3]["tets"], frames[3]["asked_tets"]);
    assert!(plot.contains(&tets), "{tets} is not in {plot}");
    assert!(end.stdout.contains("20 Jacobi + Anderson iterations"), "{}", end.stdout);
}

#[test]
#[cfg(feature = "gpu")]
fn an_unknown_adapter_is_refused_before_the_work() {
    let message = refusal(&["--device", "no such thing"]);
    assert!(message.contains("no adapter is called `no such thing`"), "{message}");
}

#[test]
#[cfg(not(feature = "gpu"))]
fn a_build_without_the_gpu_backend_says_so() {
    assert!(refusal(&["--device", "gpu"]).contains("build with `--features gpu`"));
}
