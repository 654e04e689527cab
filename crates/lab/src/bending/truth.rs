//! The response of a body itself, from those of quadratic tetrahedra on two or three meshes, extrapolated to none.
//!
//! ```text
//! r(h) = r + c h^p        two meshes: p = 2, as clamped edges have stress without bounds; three: p fitted
//! ```
//!
//! Ten-node tetrahedra would gain the fourth order where all is smooth. At a clamped edge and at a corner that points
//! inwards stress grows without bounds, and energy errs with twice the exponent of the displacement there (Babuska and
//! Szabo, "Finite Element Analysis", 1991, chapter 10).

use anyhow::Result;
use viscera::mesh::topology::edges;
use viscera::scalar::Vec3;

use super::bodies::{Body, Filling, Shape};
use super::{Element, Load, Loaded, response};

/// Orders that a fit may have: beyond them three meshes say nothing of it.
const ORDERS: [f64; 2] = [0.7, 4.0];

/// What a body gives, and how well that is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// As of [`response`].
    pub value: f64,
    /// Of the value: what extrapolation has added to the finest mesh, or by how much two orders differ.
    pub error: f64,
    /// The order of the error by the cells' size.
    pub order: f64,
}

/// Of a body of boxes, from as many boxes across as are given, or of a stuffed one from its own mesh and that split.
pub fn truth(
    shape: Shape,
    across: usize,
    load: Load,
    poisson: f64,
    cells: &[usize],
) -> Result<Truth> {
    let of = |&across: &usize| {
        response(&Body::new(shape, Filling::Five, across)?, Element::Quadratic, load, poisson)
    };
    if matches!(shape, Shape::Stuffed | Shape::Liver) {
        let body = Body::new(shape, Filling::Lattice, across)?;
        return of_own_mesh(&body, load, poisson);
    }
    let responses = cells.iter().map(of).collect::<Result<Vec<f64>>>()?;
    Ok(extrapolated(cells, &responses))
}

/// Of a body whose mesh is its shape: on the mesh and on that split into eight, which has the same shape.
pub fn of_own_mesh(body: &Body, load: Load, poisson: f64) -> Result<Truth> {
    let mut coarse = Loaded::new(body, Element::Quadratic, poisson)?;
    let x = coarse.settle(load, None)?;
    let fine_body = body.split()?;
    let mut fine = Loaded::new(&fine_body, Element::Quadratic, poisson)?;
    // The coarse body's nodes are the fine one's vertices.
    let middle = |[a, b]: [u32; 2]| -> Vec3<f64> { (x[a as usize] + x[b as usize]) * 0.5 };
    let near = x.iter().copied().chain(edges(&fine_body.mesh).into_iter().map(middle)).collect();
    let y = fine.settle(load, Some(near))?;
    Ok(extrapolated(&[1, 2], &[coarse.response(load, &x)?, fine.response(load, &y)?]))
}

/// From responses with so many cells across, fewer first, two or three of them.
pub fn extrapolated(cells: &[usize], responses: &[f64]) -> Truth {
    let (Some((&last, before)), Some((&fine, finer))) =
        (responses.split_last(), cells.split_last())
    else {
        return Truth { value: f64::NAN, error: f64::NAN, order: f64::NAN };
    };
    let (Some(&middle), Some(&coarse)) = (before.last(), finer.last()) else {
        return Truth { value: last, error: f64::NAN, order: f64::NAN };
    };
    let at_order = |order: f64| {
        let growth = (fine as f64 / coarse as f64).powf(order);
        last + (last - middle) / (growth - 1.0)
    };
    let second = at_order(2.0);
    let &[first, ..] = before else { return Truth { value: last, error: 0.0, order: 0.0 } };
    if before.len() == 1 {
        return Truth { value: second, error: (second / last - 1.0).abs(), order: 2.0 };
    }
    // With `h = 1/cells` the ratio of differences falls as the order grows.
    let size = |cells: usize, order: f64| (cells as f64).powf(-order);
    let ratio = (last - middle) / (middle - first);
    let of = |order: f64| {
        (size(coarse, order) - size(fine, order)) / (size(cells[0], order) - size(coarse, order))
    };
    let [mut low, mut high] = ORDERS;
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if of(middle) > ratio { low = middle } else { high = middle }
    }
    let order = 0.5 * (low + high);
    let value = at_order(order);
    Truth { value, error: (second / value - 1.0).abs().max((value / last - 1.0).abs()), order }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_errs_by_a_power_is_extrapolated_exactly() {
        let at = |order: f64, cells: usize| 3.0 - 0.4 * (cells as f64).powf(-order);
        let two = extrapolated(&[4, 6], &[4, 6].map(|n| at(2.0, n)));
        assert!((two.value - 3.0).abs() < 1e-14, "{two:?}");
        for order in [0.9, 1.3, 2.0, 3.1] {
            let three = extrapolated(&[2, 4, 6], &[2, 4, 6].map(|n| at(order, n)));
            assert!((three.value - 3.0).abs() < 1e-12, "{three:?}");
            assert!((three.order - order).abs() < 1e-9, "{three:?}");
            // The finest mesh's error is known of.
            assert!(three.error >= (3.0 / at(order, 6) - 1.0) * 0.999, "{three:?}");
        }
    }
}
