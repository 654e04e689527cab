//! How bulk stiffness is shared out between tetrahedra, domains and clusters, and the derivatives of these shares.

use viscera::elements::recovered::{CLUSTERED_ABOVE, bulk_shares};
use viscera::layout::Smoothing;
use viscera::model::{MaterialConstants, Model};

use super::Recovered;

impl Recovered {
    /// The same tetrahedra with the derivative of every constant in its place: of materials whose Lame parameters [Pa] change
    /// as `changes` says. Constants are piecewise linear in these; at a corner the piece of softer bulk counts.
    pub fn along(&self, model: &Model<f64>, smoothing: Smoothing, changes: &[[f64; 2]]) -> Self {
        let mut along = self.clone();
        let shares: Vec<_> = (model.materials.iter().zip(changes))
            .map(|(material, change)| shares_along(material, smoothing, *change))
            .collect();
        for ((tissue, change), shares) in along.tissues.iter_mut().zip(changes).zip(&shares) {
            (tissue.lame_lambda, tissue.lame_mu) = (shares.0, change[1]);
        }
        for floor in &mut along.floors {
            floor.stiffness = floor.share * changes[floor.tissue as usize][1];
        }
        for volume in &mut along.volumes {
            let (_, domain, cluster) = shares[volume.tissue as usize];
            volume.stiffness = volume.rest * if volume.is_cluster { cluster } else { domain };
        }
        along
    }
}

/// Bulk stiffness [Pa] beside the shear, of domains and of clusters.
pub fn shares(material: &MaterialConstants<f64>, smoothing: Smoothing) -> (f64, f64, f64) {
    let shares = bulk_shares(material.lame_lambda, material.lame_mu);
    match smoothing.clustered {
        true => (shares.local, shares.domain, shares.cluster),
        false => (shares.local, shares.domain + shares.cluster, 0.0),
    }
}

/// The derivatives of [`shares`] where Lame's parameters change as `lambda` and `mu` say.
fn shares_along(
    material: &MaterialConstants<f64>,
    smoothing: Smoothing,
    [lambda, mu]: [f64; 2],
) -> (f64, f64, f64) {
    let least = |times: f64| match material.lame_lambda <= times * material.lame_mu {
        true => lambda,
        false => times * mu,
    };
    let (local, averaged) = (least(1.0), least(CLUSTERED_ABOVE));
    match smoothing.clustered {
        true => (local, averaged - local, lambda - averaged),
        false => (local, lambda - local, 0.0),
    }
}
