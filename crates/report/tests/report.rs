//! Reports: tables that line up, figures that repeat to the byte, atomic writes.

use std::fs;
use std::path::Path;
use viscera_report::{Axis, Document, Plot, Series, Style, Table};

fn convergence() -> Plot {
    let mut plot = Plot::new(
        "Error & iterations <all>",
        Axis::logarithmic("iterations"),
        Axis::logarithmic("error"),
    );
    let decay = |rate: f64| (1..=8).map(move |k| [f64::from(1 << k), rate.powi(k)]);
    plot.series(Series::new("fast", decay(0.05)));
    plot.series(Series::new("slow", decay(0.6)).with_style(Style::Dashed));
    plot.reference(1e-3, "0.1 %");
    plot
}

#[test]
fn numbers_stand_to_the_right_and_columns_line_up() {
    let mut table = Table::new(["case", "error"]);
    table.row(["a | b", "0.12 %"]).row(["twist", "< 1e-10"]).row(["free"]);
    let expected = "\
| case   |   error |
| ------ | ------: |
| a \\| b |  0.12 % |
| twist  | < 1e-10 |
| free   |         |
";
    assert_eq!(table.to_markdown(), expected);
    assert_eq!(table.to_text(), "case     error\na | b   0.12 %\ntwist  < 1e-10\nfree\n");
}

#[test]
fn a_table_of_words_is_not_aligned_like_numbers() {
    let mut table = Table::new(["what", "n"]);
    table.row(["met", "2"]).row(["5 of them\nmissed", "-"]);
    let text = table.to_markdown();
    assert!(text.contains("| ---------------- | --: |"), "{text}");
    assert!(text.lines().count() == 4, "a line break in a cell ends the table: {text}");
}

#[test]
fn the_same_data_give_the_same_figure() {
    let svg = convergence().to_svg().expect("a figure");
    assert_eq!(svg, convergence().to_svg().expect("a figure"));
    assert!(svg.starts_with("<svg width=\"800\""), "{}", &svg[..80]);
    assert!(svg.trim_end().ends_with("</svg>"));
    assert!(svg.contains("Error &amp; iterations &lt;all&gt;"), "a title must be escaped");
    for label in ["10⁻¹⁰", "10⁻²", "0.1 %", "slow"] {
        assert!(svg.contains(label), "the figure lacks {label}");
    }
}

/// Numbers in all `points="x,y x,y"` and in the centres of circles.
fn coordinates(svg: &str) -> Vec<i64> {
    let values = |key: &'static str| {
        svg.split(key).skip(1).filter_map(|rest| rest.split('"').next()).flat_map(|list| {
            list.split([' ', ',']).filter(|n| !n.is_empty()).map(|n| n.parse().expect("a number"))
        })
    };
    values(" points=\"").chain(values(" cx=\"")).chain(values(" cy=\"")).collect()
}

#[test]
fn what_has_no_place_on_a_logarithmic_axis_is_left_out_and_told() {
    let mut plot = Plot::new("", Axis::linear("frame"), Axis::logarithmic("error"));
    let values = [1.0, 0.1, 0.0, f64::NAN, 1e-3, f64::INFINITY, -1.0];
    plot.series(Series::new("mixed", (0..7).map(|k| [f64::from(k), values[k as usize]])));
    plot.series(Series::new("zeros", [[0.0, 0.0], [1.0, 0.0]]));
    let svg = plot.to_svg().expect("a figure");
    assert!(svg.contains("Not drawn: 4 points of “mixed” that are not finite, or not above zero"));
    assert!(svg.contains("Not drawn: 2 points of “zeros” that are exactly zero"));
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    assert!(coordinates(&svg).iter().all(|n| (0..=1600).contains(n)), "{svg}");
}

#[test]
fn a_plot_of_nothing_says_so() {
    let mut plot = Plot::new("empty", Axis::linear("x"), Axis::logarithmic("y"));
    assert!(plot.to_svg().expect("a figure").contains("There are no points to draw."));
    plot.series(Series::new("a", [[f64::NAN, 1.0]]));
    assert!(plot.to_svg().expect("a figure").contains("There are no points to draw."));
}

#[test]
fn extreme_values_stay_on_the_picture() {
    let extremes =
        [[0.0, 5e-324], [1e-320, f64::MAX], [-1e99, 1.0], [1e99, 2.0], [f64::MIN, 3.0], [1.0, 0.0]];
    let mut plot = Plot::new("", Axis::linear("x"), Axis::logarithmic("y"));
    plot.series(Series::new("extremes", extremes));
    let svg = plot.to_svg().expect("a figure");
    assert!(coordinates(&svg).iter().all(|n| (0..=1600).contains(n)), "{svg}");
    assert!(svg.len() < 100_000, "{} bytes for six points", svg.len());
}

#[test]
fn a_document_is_one_text_and_a_folder_of_figures() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("deep/my report.md");
    let figures = folder.path().join("deep/my report");
    let mut document = Document::prepare(&path, "A report").expect("a writable folder");
    document.heading("One");
    document.figure("convergence", &convergence()).expect("a figure");
    document.figure("other", &convergence()).expect("a figure");
    document.picture("view", "a view", b"pixels".to_vec()).expect("a picture");
    document.data("numbers", "All", &Table::new(["a", "b"])).expect("a table");
    document.open_with_paragraph("First of all.");
    document.write().expect("written");
    let text = fs::read_to_string(&path).expect("the report");
    let opening = "# A report\n\nFirst of all.\n\n## One\n\n![";
    assert!(text.starts_with(opening), "{text}");
    assert!(text.contains("](<my report/convergence.svg>)"), "{text}");
    assert_eq!(
        names_in(&figures),
        [".viscera-report", "convergence.svg", "numbers.csv", "other.svg", "view.png"]
    );
}

#[test]
fn what_the_last_report_left_goes_and_what_others_put_there_stays() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("report.md");
    let figures = folder.path().join("report");
    let mut document = Document::prepare(&path, "A report").expect("a writable folder");
    document.figure("convergence", &convergence()).expect("a figure");
    document.figure("other", &convergence()).expect("a figure");
    document.figure("removed-by-hand", &convergence()).expect("a figure");
    document.picture("view", "a view", b"pixels".to_vec()).expect("a picture");
    document.data("numbers", "All", &Table::new(["a", "b"])).expect("a table");
    document.write().expect("written");

    let strangers = ["photograph.svg", "photograph.png", "measured.csv"];
    for name in strangers {
        fs::write(figures.join(name), "of somebody else").expect("a file");
    }
    fs::remove_file(figures.join("removed-by-hand.svg")).expect("removed");
    // A manifest that somebody spoilt reaches no further than its folder.
    let beside = folder.path().join("beside.csv");
    fs::write(&beside, "of somebody else").expect("a file");
    let manifest = figures.join(".viscera-report");
    let names = fs::read_to_string(&manifest).expect("the manifest");
    fs::write(&manifest, format!("{names}../beside.csv\n{}\n..\n\n", beside.display()))
        .expect("a manifest");

    let mut document = Document::prepare(&path, "A report").expect("a writable folder");
    document.figure("convergence", &convergence()).expect("a figure");
    document.write().expect("written");
    assert_eq!(
        names_in(&figures),
        [".viscera-report", "convergence.svg", "measured.csv", "photograph.png", "photograph.svg"]
    );
    assert_eq!(fs::read_to_string(&manifest).expect("the manifest"), "convergence.svg\n");
    assert!(beside.is_file());
}

/// Sorted.
fn names_in(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("a folder");
    let name =
        |entry: std::io::Result<fs::DirEntry>| entry.expect("an entry").file_name().into_string();
    let mut names: Vec<_> = entries.map(|entry| name(entry).expect("a name")).collect();
    names.sort();
    names
}

#[test]
fn figures_have_names_of_their_own() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut document = Document::prepare(&folder.path().join("r.md"), "").expect("writable");
    document.figure("a", &convergence()).expect("a figure");
    for name in ["a", "", "../b", "a b"] {
        let error = document.figure(name, &convergence()).expect_err(name).to_string();
        assert!(error.contains(&format!("`{name}`")), "{error}");
    }
}

#[test]
fn a_place_that_cannot_be_written_is_refused_when_the_document_is_prepared() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("file");
    fs::write(&file, "").expect("a file");
    for (path, hint) in [
        (file.join("report.md"), "choose another file with --out"),
        (folder.path().to_owned(), "is a folder; name a file in it"),
        (folder.path().join("report.txt"), "ends in .md"),
    ] {
        let error = Document::prepare(&path, "").err().expect("a refusal").to_string();
        assert!(error.contains(hint), "{error}");
        assert!(error.contains(&*folder.path().to_string_lossy()), "{error}");
    }
}
