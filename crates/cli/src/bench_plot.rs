//! `viscera bench-plot`: a figure of the peers' report, see docs/peers.md.

use anyhow::{Context, Result};
use clap::Args;
use serde::Deserialize;
use std::path::PathBuf;
use viscera_report::{Axis, Plot, Series};
use viscera_resources::files;

/// Draw curves over two logarithmic axes as SVG, for `cargo xtask peers`
///
/// The data are JSON: {"title": "..", "x": "label [unit]", "y": "label [unit]", "series":
/// [{"name": "..", "points": [[x, y], ..]}]}. Points that are not above zero are left out, and the
/// figure says so.
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
    series: Vec<Curve>,
}

#[derive(Deserialize)]
struct Curve {
    name: String,
    points: Vec<[f64; 2]>,
}

/// Carries out `viscera bench-plot`.
pub fn execute(arguments: &BenchPlotArguments) -> Result<()> {
    let curves: Curves = serde_json::from_slice(&files::read(&arguments.data)?)
        .with_context(|| format!("{} is no figure's data", arguments.data.display()))?;
    let (x, y) = (Axis::logarithmic(curves.x), Axis::logarithmic(curves.y));
    let mut plot = Plot::new(curves.title, x, y);
    for curve in curves.series {
        plot.series(Series::new(curve.name, curve.points));
    }
    files::write_atomic(&arguments.out, plot.to_svg()?.as_bytes())
}
