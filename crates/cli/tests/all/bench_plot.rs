//! `viscera bench-plot`: figures of the peers' report.

use crate::common::Bench;
use serde_json::json;

#[test]
fn curves_become_a_figure_that_names_them_and_leaves_out_what_has_no_logarithm() {
    let bench = Bench::new("");
    let data = json!({
        "title": "Cost and error", "x": "time [ms]", "y": "error [%]",
        "series": [
            { "name": "first", "points": [[1.0, 10.0], [10.0, 0.1]] },
            { "name": "second", "points": [[2.0, 0.0]] },
        ],
    });
    bench.write("curves.json", data.to_string().as_bytes());
    let end = bench.end_of(&["bench-plot", "--data", "curves.json", "--out", "curves.svg"]);
    assert_eq!(end.code, Some(0), "{}", end.stderr);
    let svg = String::from_utf8(bench.read("curves.svg")).expect("text");
    for words in ["Cost and error", "time [ms]", "error [%]", "first", "second", "logarithm"] {
        assert!(svg.contains(words), "{words} is missing in {svg}");
    }
}

#[test]
fn what_is_no_data_is_named() {
    let bench = Bench::new("");
    bench.write("curves.json", b"{}");
    let end = bench.end_of(&["bench-plot", "--data", "curves.json", "--out", "curves.svg"]);
    assert!(end.error().contains("curves.json is no figure's data"), "{}", end.error());
}
