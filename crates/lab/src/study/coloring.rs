//! Figure 1: convergence with and without colours.

use anyhow::Result;
use viscera::material::MaterialModel;
use viscera::settings::Colors;

use super::methods::{COLORED, JACOBI, Method, published};
use super::step::MeasuredStep;
use super::{Context, Section};
use crate::scenes::Size;
use viscera_report::{Axis, Plot, Series, Style};

pub(super) const SECTION: Section = Section {
    name: "coloring",
    title: "1. Convergence with and without colours",
    cases: case_count,
    run,
};

fn methods() -> Vec<Method> {
    let clique =
        |colors| Method::new(format!("{colors} colours"), published(Colors::Limited(colors)));
    vec![
        Method::new("Jacobi", published(JACOBI)),
        clique(2),
        clique(4),
        clique(8),
        Method::new("coloured", published(COLORED)),
    ]
}

fn case_count(_quick: bool) -> usize {
    methods().len()
}

fn run(context: &mut Context) -> Result<()> {
    let (size, iterations) = if context.quick { (Size::Tiny, 200) } else { (Size::Large, 3000) };
    let tissue = context.changes.tissue(MaterialModel::SaintVenantKirchhoff, 1e5, 0.45)?;
    let step = MeasuredStep::new(context.changes.scene("cantilever", size, tissue)?, 0)?;
    let methods: Vec<Method> =
        methods().into_iter().map(|method| method.with_iterations(iterations)).collect();
    let curves = context.run_cases(&methods, |method| step.follow::<f64>(&method.settings))?;
    let mut plot =
        Plot::new("Convergence", Axis::logarithmic("iterations"), Axis::logarithmic("error"));
    for (method, curve) in methods.iter().zip(&curves) {
        let cost = step.cost(&method.settings)?;
        eprintln!(
            "{method}: {:?} {:?} {:?} {:?}",
            curve.first_below(0.1),
            curve.first_below(0.01),
            cost,
            curve.least()
        );
        let points = curve.errors.iter().enumerate().skip(1).map(|(k, e)| [k as f64, *e]);
        plot.series(Series::new(method.name.clone(), points).with_style(Style::Line));
    }
    context.plot("coloring-iterations", &plot, "TODO")
}
