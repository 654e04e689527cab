//! `viscera bench-plot`: a figure of the peers' report, see docs/peers.md.

use anyhow::{Context, Result};
use clap::Args;
use serde::Deserialize;
use std::path::PathBuf;
use viscera_report::{Axis, Plot, Series, Style};
use viscera_resources::files;

/// Draw curves over two logarithmic axes as SVG, for `cargo xtask peers`
///
/// The data are JSON: {"title": "..", "x": "label [unit]", "y": "label [unit]", "series":
/// [{"name": "..", "points": [[x, y], ..]}]}. Points that are not above zero are left out, and the
/// figure says so. With "joined": false no line joins the points of any series.
#[derive(Args)]
pub struct BenchPlotArguments {
    /// The data
    #[arg(long, value_name = "FILE")]
    data: PathBuf,
    /// The figure
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// What the file of data says.
#[derive(Deserialize)]
struct Curves {
    title: String,
    x: String,
    y: String,
    #[serde(default = "joined")]
    joined: bool,
    series: Vec<Curve>,
}

#[derive(Deserialize)]
struct Curve {
    name: String,
    points: Vec<[f64; 2]>,
}

const fn joined() -> bool {
    true
}

/// Carries out `viscera bench-plot`.
pub fn execute(arguments: &BenchPlotArguments) -> Result<()> {
    let curves: Curves = serde_json::from_slice(&files::read(&arguments.data)?)
        .with_context(|| format!("{} is no figure's data", arguments.data.display()))?;
    let (x, y) = (Axis::logarithmic(curves.x), Axis::logarithmic(curves.y));
    let mut plot = Plot::new(curves.title, x, y);
    let style = if curves.joined { Style::MarkedLine } else { Style::Markers };
    for curve in curves.series {
        plot.series(Series::new(curve.name, curve.points).with_style(style));
    }
    files::write_atomic(&arguments.out, plot.to_svg()?.as_bytes())
}
