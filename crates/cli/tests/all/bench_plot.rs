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

/// Settings that are no curve: two points, and nothing between them.
#[test]
fn points_that_are_not_joined_have_no_line() {
    let lines = |joined: bool| {
        let bench = Bench::new("");
        let data = json!({
            "title": "Cost and error", "x": "time [ms]", "y": "error [%]", "joined": joined,
            "series": [{ "name": "first", "points": [[1.0, 10.0], [10.0, 0.1]] }],
        });
        bench.write("curves.json", data.to_string().as_bytes());
        let end = bench.end_of(&["bench-plot", "--data", "curves.json", "--out", "curves.svg"]);
        assert_eq!(end.code, Some(0), "{}", end.stderr);
        let svg = String::from_utf8(bench.read("curves.svg")).expect("text");
        svg.matches("<polyline").count()
    };
    // The curve, and its piece in the legend.
    assert_eq!(lines(true) - lines(false), 2);
}

#[test]
fn what_is_no_data_is_named() {
    let bench = Bench::new("");
    bench.write("curves.json", b"{}");
    let end = bench.end_of(&["bench-plot", "--data", "curves.json", "--out", "curves.svg"]);
    assert!(end.error().contains("curves.json is no figure's data"), "{}", end.error());
}
