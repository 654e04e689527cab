//! Shapes of tetrahedra as a picture.

use anyhow::Result;
use viscera::mesh::verdict::DEGREES;
use viscera_report::{Axis, Plot, Series, Style};

/// Draws how often dihedral angles occur in each body, as SVG: its name, and how many there are in each bin, as
/// [`count_angles`](viscera::mesh::verdict::count_angles) counts them.
pub fn angles_plot(bodies: &[(String, Vec<usize>)]) -> Result<String> {
    let x = Axis::linear("dihedral angle [degrees]");
    let title = "Dihedral angles; 70.5 degrees in a regular tetrahedron";
    let mut plot = Plot::new(title, x, Axis::linear("share of angles [%]"));
    for (name, counts) in bodies {
        let all = counts.iter().sum::<usize>().max(1) as f64;
        let step = |(bin, count): (usize, &usize)| {
            let share = 100.0 * *count as f64 / all;
            [[(bin * DEGREES) as f64, share], [((bin + 1) * DEGREES) as f64, share]]
        };
        let points: Vec<[f64; 2]> = counts.iter().enumerate().flat_map(step).collect();
        plot.series(Series::new(name.clone(), points).with_style(Style::Line));
    }
    plot.to_svg()
}
