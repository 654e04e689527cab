//! Bodies under loads: what meshes give, and what the bodies themselves do.

use std::fmt;

use anyhow::Result;

use super::Context;
use crate::bending::bodies::{Body, Filling, Shape};
use crate::bending::truth::{Truth, truth};
use crate::bending::{Element, Load, response};

/// A mesh under a load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Row {
    pub load: Load,
    pub shape: Shape,
    pub filling: Filling,
    pub across: usize,
}

impl Row {
    pub(super) fn body(&self) -> Result<Body> {
        Body::new(self.shape, self.filling, self.across)
    }

    /// Whether both stand for the same body under the same load.
    pub(super) fn is_of(&self, other: &Self) -> bool {
        Case::of_truth(self, 0.0) == Case::of_truth(other, 0.0)
    }
}

/// Across the meshes of the truth. What is pressed, and small loads on two materials, are known to a few thousandths on
/// the coarser pair; of a corner that points inwards the order is not known.
fn truth_cells(load: Load, shape: Shape, quick: bool) -> &'static [usize] {
    match (load, shape) {
        (_, Shape::Layers | Shape::Halves) => &[2, 4],
        (_, Shape::Angle) if !quick => &[2, 4, 6],
        (Load::Sag(_) | Load::Twist(_), _) if !quick => &[4, 6],
        _ => &[2, 4],
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Case {
    load: Load,
    shape: Shape,
    /// A mesh and what it is made of, or the body itself.
    mesh: Option<(Filling, Element)>,
    across: usize,
    poisson: f64,
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { load, shape, mesh, across, poisson } = self;
        write!(f, "{load} of a {shape}, nu {poisson}, ")?;
        match mesh {
            Some((filling, element)) => write!(f, "{filling}, {across} across, {element:?}"),
            None => f.write_str("the body itself"),
        }
    }
}

impl Case {
    /// Bodies of boxes are the same for any number of boxes.
    fn of_truth(row: &Row, poisson: f64) -> Self {
        let &Row { load, shape, across, .. } = row;
        let is_own = matches!(shape, Shape::Stuffed | Shape::Liver);
        Self { load, shape, mesh: None, across: if is_own { across } else { 0 }, poisson }
    }

    fn of_mesh(row: &Row, element: Element, poisson: f64) -> Self {
        let &Row { load, shape, filling, across } = row;
        Self { load, shape, mesh: Some((filling, element)), across, poisson }
    }
}

/// Of all rows with these elements. Truths first: they take longest.
pub(super) fn cases(rows: &[Row], poissons: &[f64], elements: &[Element]) -> Vec<Case> {
    let mut cases: Vec<Case> = Vec::new();
    let mut add = |case: Case| {
        if !cases.contains(&case) {
            cases.push(case);
        }
    };
    for row in rows {
        poissons.iter().for_each(|&poisson| add(Case::of_truth(row, poisson)));
    }
    for row in rows {
        for &poisson in poissons {
            elements.iter().for_each(|&element| add(Case::of_mesh(row, element, poisson)));
        }
    }
    cases
}

/// Of a mesh the value alone is known.
fn answer(case: &Case, quick: bool) -> Result<Truth> {
    let Case { load, shape, mesh, across, poisson } = *case;
    let Some((filling, element)) = mesh else {
        return truth(shape, across, load, poisson, truth_cells(load, shape, quick));
    };
    let value = response(&Body::new(shape, filling, across)?, element, load, poisson)?;
    Ok(Truth { value, error: 0.0, order: 0.0 })
}

pub(super) struct Answers {
    cases: Vec<Case>,
    values: Vec<Truth>,
}

impl Answers {
    pub(super) fn of(context: &Context, cases: Vec<Case>) -> Result<Self> {
        let quick = context.quick;
        let values = context.run_cases(&cases, |case| answer(case, quick))?;
        Ok(Self { cases, values })
    }

    fn value(&self, case: Case) -> Truth {
        let place = self.cases.iter().position(|known| *known == case);
        let unknown = Truth { value: f64::NAN, error: f64::NAN, order: f64::NAN };
        place.map_or(unknown, |place| self.values[place])
    }

    pub(super) fn truth(&self, row: &Row, poisson: f64) -> Truth {
        self.value(Case::of_truth(row, poisson))
    }

    /// How much more than the body itself the mesh gives, of itself.
    pub(super) fn error(&self, row: &Row, element: Element, poisson: f64) -> f64 {
        self.value(Case::of_mesh(row, element, poisson)).value / self.truth(row, poisson).value
            - 1.0
    }
}
