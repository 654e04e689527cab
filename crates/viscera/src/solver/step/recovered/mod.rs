//! Recovered-gradient tetrahedra of a whole mesh: energy and gradient, from tetrahedra to domains and back.
//!
//! ```text
//! 1  domains    G_n from the places of their vertices
//! 2  tets       Fh_t from F_t and the G_n of their corners; their volumes to domains and clusters; any det F_t < 1/5?
//! 3  domains    pressures p_n = k_n (Jh_n - 1) + k_c (Jh_c - 1)
//! 4  tets       S_t = V_t dE/dFh_t; to their corners S_t g_a and the volume floor, to the domains what it is by G_n
//! 5  domains    N_n = what came from the tetrahedra + V_n alpha P(G_n)
//! 6  domains    N_n b_nj to the vertices j that they see
//! ```
//!
//! The equations stand in [`crate::elements::recovered`]. One at a time and in the caller's numbering here: the
//! truth that the passes in lanes (`passes.rs`) are tested against.

mod along;
mod energies;
mod kernels;
mod of_step;
#[cfg(feature = "gpu")]
pub(crate) mod on_device;
mod passes;
#[cfg(test)]
mod tests;

pub(crate) use along::{Along, Found, Since};
pub(crate) use kernels::Load;
#[cfg(feature = "gpu")]
pub(crate) use of_step::MeasuredTets;
pub(crate) use of_step::{along_recovered, load_recovered};
pub(crate) use passes::RecoveredTets;

use crate::elements::neo_hookean::{self, volume_change, volume_variation};
use crate::elements::recovered::{
    BulkShares, bulk_energy, bulk_shares, floor_curvature_along, floor_energy, floor_energy_change,
    floor_piola, recovered_gradient, tet_stress, vertex_stresses,
};
use crate::layout::Domains;
use crate::material::MaterialConstants;
use crate::scalar::{Mat3, Real, Vec3};

/// Gradients and volumes of all tetrahedra and domains at some places, and room for the way back.
#[derive(Clone, Debug)]
pub struct Recovered<S> {
    /// `G_n`, shape [domain_count].
    pub vertex_gradients: Vec<Mat3<S>>,
    /// `F_t`, shape [tet_count].
    pub linear_gradients: Vec<Mat3<S>>,
    /// `Fh_t`, shape [tet_count].
    pub gradients: Vec<Mat3<S>>,
    /// `Jh_n - 1`, shape [domain_count].
    pub volume_changes: Vec<S>,
    /// `Jh_c - 1`, shape [cluster_count].
    pub cluster_changes: Vec<S>,
    /// `p_n` [Pa], shape [domain_count].
    pressures: Vec<S>,
    /// `N_n` [J], shape [domain_count].
    stresses: Vec<Mat3<S>>,
}

/// First and second derivative of the energy along a direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Variation {
    /// Change of the energy by the whole of the direction [J].
    pub change: f64,
    /// First derivative [J].
    pub first: f64,
    /// Second derivative [J].
    pub second: f64,
}

impl<S: Real> Recovered<S> {
    /// Takes the memory.
    pub fn new(domains: &Domains<S>) -> Self {
        Self {
            vertex_gradients: vec![Mat3::ZERO; domains.len()],
            linear_gradients: vec![Mat3::ZERO; domains.tets.len()],
            gradients: vec![Mat3::ZERO; domains.tets.len()],
            volume_changes: vec![S::ZERO; domains.len()],
            cluster_changes: vec![S::ZERO; domains.cluster_volumes.len()],
            pressures: vec![S::ZERO; domains.len()],
            stresses: vec![Mat3::ZERO; domains.len()],
        }
    }

    /// Gradients at the places, or of the displacements, `x` [m]: both are linear in them.
    pub fn take_gradients(&mut self, domains: &Domains<S>, x: &[Vec3<S>]) {
        for (n, gradient) in self.vertex_gradients.iter_mut().enumerate() {
            *gradient = domains.gradient(n, x);
        }
        for (t, gradient) in self.gradients.iter_mut().enumerate() {
            let frame = &domains.frames[t];
            let vertices = domains.tet_vertices[t];
            // From edges: the shape functions' gradients add up to zero.
            let mut f = Mat3::ZERO;
            for a in 1..4 {
                let edge = x[vertices[a] as usize] - x[vertices[0] as usize];
                f = f + Mat3::outer(edge, frame.gradients[a]);
            }
            let of_corners = domains.tet_domains[t].map(|n| self.vertex_gradients[n as usize]);
            *gradient = recovered_gradient(&f, &of_corners, frame);
            self.linear_gradients[t] = f;
        }
    }

    /// Gradients, volumes and pressures at the places `x` [m].
    pub fn evaluate(
        &mut self,
        domains: &Domains<S>,
        materials: &[MaterialConstants<S>],
        x: &[Vec3<S>],
    ) {
        self.take_gradients(domains, x);
        let Self { gradients, volume_changes, cluster_changes, .. } = self;
        average(domains, volume_changes, cluster_changes, |t| volume_change(&gradients[t]));
        for n in 0..domains.len() {
            let BulkShares { domain, cluster, .. } = self.shares(domains, materials, n);
            let of_cluster = self.cluster_changes[domains.clusters[n] as usize];
            self.pressures[n] = domain * self.volume_changes[n] + cluster * of_cluster;
        }
    }

    fn shares(
        &self,
        domains: &Domains<S>,
        materials: &[MaterialConstants<S>],
        n: usize,
    ) -> BulkShares<S> {
        let material = &materials[domains.materials[n] as usize];
        let BulkShares { local, domain, cluster } =
            bulk_shares(material.lame_lambda, material.lame_mu);
        match domains.smoothing.clustered {
            true => BulkShares { local, domain, cluster },
            false => BulkShares { local, domain: domain + cluster, cluster: S::ZERO },
        }
    }

    /// Energy [J] at the places of [`Self::evaluate`].
    pub fn energy(&self, domains: &Domains<S>, materials: &[MaterialConstants<S>]) -> f64 {
        let [of_tets, of_domains] = energy_shares(domains);
        let mut sum = 0.0;
        for (t, gradient) in self.gradients.iter().enumerate() {
            let n = domains.tet_domains[t][0] as usize;
            let mu = materials[domains.materials[n] as usize].lame_mu;
            let local = self.shares(domains, materials, n).local;
            let density = neo_hookean::energy_density(gradient, local, mu);
            let density = of_tets * density + floor_energy(&self.linear_gradients[t], mu);
            sum += (domains.tet_volumes[t] * density).to_f64();
        }
        for (n, gradient) in self.vertex_gradients.iter().enumerate() {
            let BulkShares { local, domain, cluster } = self.shares(domains, materials, n);
            let mu = materials[domains.materials[n] as usize].lame_mu;
            let of_cluster = self.cluster_changes[domains.clusters[n] as usize];
            let density = of_domains * neo_hookean::energy_density(gradient, local, mu)
                + bulk_energy(self.volume_changes[n], domain)
                // A cluster's volume is the sum of its domains': each counts its part.
                + bulk_energy(of_cluster, cluster);
            sum += (domains.volumes[n] * density).to_f64();
        }
        sum
    }

    /// Adds the gradient of the energy [N] at the places of [`Self::evaluate`], shape [vertex_count].
    pub fn add_gradient(
        &mut self,
        domains: &Domains<S>,
        materials: &[MaterialConstants<S>],
        gradient: &mut [Vec3<S>],
    ) {
        let [of_tets, of_domains] = energy_shares(domains);
        let quarter = S::from_f64(0.25);
        for (n, of_vertex) in self.vertex_gradients.iter().enumerate() {
            let mu = materials[domains.materials[n] as usize].lame_mu;
            let local = self.shares(domains, materials, n).local;
            let piola = neo_hookean::piola(of_vertex, local, mu);
            self.stresses[n] = piola * (of_domains * domains.volumes[n]);
        }
        for (t, recovered) in self.gradients.iter().enumerate() {
            let (frame, of_tet) = (&domains.frames[t], domains.tet_domains[t]);
            let [a, b, c, d] = of_tet.map(|n| self.pressures[n as usize]);
            let pressure = ((a + b) + (c + d)) * quarter;
            let mu = materials[domains.materials[of_tet[0] as usize] as usize].lame_mu;
            let local = self.shares(domains, materials, of_tet[0] as usize).local;
            let stress =
                tet_stress(recovered, local, mu, of_tets, pressure) * domains.tet_volumes[t];
            let of_corners = vertex_stresses(&stress, frame);
            let floor = floor_piola(&self.linear_gradients[t], mu) * domains.tet_volumes[t];
            for corner in 0..4 {
                gradient[domains.tet_vertices[t][corner] as usize] +=
                    (stress + floor) * frame.gradients[corner];
                let sum = &mut self.stresses[of_tet[corner] as usize];
                *sum = *sum + of_corners[corner];
            }
        }
        for (n, stress) in self.stresses.iter().enumerate() {
            for i in domains.ring(n) {
                gradient[domains.ring_vertices[i] as usize] += *stress * domains.ring_gradients[i];
            }
        }
    }

    /// The energy along displacements, from the places of [`Self::evaluate`]: `along` has their gradients
    /// ([`Self::take_gradients`]) and lends its volumes. The change has the round-off of its terms, which vanish
    /// with the displacements, not that of the energy.
    pub fn variation(
        &self,
        domains: &Domains<S>,
        materials: &[MaterialConstants<S>],
        along: &mut Self,
    ) -> Variation {
        let mut sum = Variation::default();
        let [of_tets, of_domains] = energy_shares(domains);
        let mut add = |volume: S, f: &Mat3<S>, d: &Mat3<S>, local: S, mu: S| {
            let volume = volume.to_f64();
            sum.change += volume * neo_hookean::energy_change(f, d, local, mu).to_f64();
            sum.first += volume * neo_hookean::piola(f, local, mu).dot(*d).to_f64();
            let [second, _] = neo_hookean::curvature_along(f, d, local, mu);
            sum.second += volume * second.to_f64();
        };
        for (t, d) in along.gradients.iter().enumerate() {
            let n = domains.tet_domains[t][0] as usize;
            let mu = materials[domains.materials[n] as usize].lame_mu;
            let local = self.shares(domains, materials, n).local;
            add(of_tets * domains.tet_volumes[t], &self.gradients[t], d, local, mu);
        }
        for (n, d) in along.vertex_gradients.iter().enumerate() {
            let mu = materials[domains.materials[n] as usize].lame_mu;
            let local = self.shares(domains, materials, n).local;
            add(of_domains * domains.volumes[n], &self.vertex_gradients[n], d, local, mu);
        }
        for (t, d) in along.linear_gradients.iter().enumerate() {
            let n = domains.tet_domains[t][0] as usize;
            let mu = materials[domains.materials[n] as usize].lame_mu;
            let (f, volume) = (&self.linear_gradients[t], domains.tet_volumes[t].to_f64());
            sum.change += volume * floor_energy_change(f, d, mu).to_f64();
            sum.first += volume * floor_piola(f, mu).dot(*d).to_f64();
            sum.second += volume * floor_curvature_along(f, d, mu)[0].to_f64();
        }
        // Of the mean volumes' changes by powers of the displacements.
        for power in 0..3 {
            let Self { gradients, volume_changes, cluster_changes, .. } = along;
            average(domains, volume_changes, cluster_changes, |t| {
                volume_variation(&self.gradients[t], &gradients[t])[power]
            });
            for n in 0..domains.len() {
                let BulkShares { domain, cluster, .. } = self.shares(domains, materials, n);
                let c = domains.clusters[n] as usize;
                for (stiffness, change, of_power) in [
                    (domain, self.volume_changes[n], along.volume_changes[n]),
                    (cluster, self.cluster_changes[c], along.cluster_changes[c]),
                ] {
                    let stiffness = (domains.volumes[n] * stiffness).to_f64();
                    let (change, of_power) = (change.to_f64(), of_power.to_f64());
                    sum.change += stiffness * change * of_power;
                    match power {
                        0 => {
                            sum.first += stiffness * change * of_power;
                            sum.second += stiffness * of_power * of_power;
                        }
                        1 => sum.second += 2.0 * stiffness * change * of_power,
                        _ => {}
                    }
                }
            }
        }
        let Self { gradients, volume_changes, cluster_changes, .. } = along;
        average(domains, volume_changes, cluster_changes, |t| {
            let [a, b, c] = volume_variation(&self.gradients[t], &gradients[t]);
            a + b + c
        });
        for n in 0..domains.len() {
            let BulkShares { domain, cluster, .. } = self.shares(domains, materials, n);
            let of_cluster = along.cluster_changes[domains.clusters[n] as usize];
            let density =
                bulk_energy(along.volume_changes[n], domain) + bulk_energy(of_cluster, cluster);
            sum.change += (domains.volumes[n] * density).to_f64();
        }
        sum
    }
}

/// `1 - alpha` and `alpha`.
fn energy_shares<S: Real>(domains: &Domains<S>) -> [S; 2] {
    let share = domains.smoothing.vertex_share;
    [1.0 - share, share].map(S::from_f64)
}

/// Means over the tetrahedra of domains, and of clusters.
fn average<S: Real>(
    domains: &Domains<S>,
    of_domains: &mut [S],
    of_clusters: &mut [S],
    of_tet: impl Fn(usize) -> S,
) {
    of_domains.fill(S::ZERO);
    of_clusters.fill(S::ZERO);
    let quarter = S::from_f64(0.25);
    for (t, corners) in domains.tet_domains.iter().enumerate() {
        let share = of_tet(t) * (quarter * domains.tet_volumes[t]);
        for &n in corners {
            of_domains[n as usize] += share;
        }
    }
    for (n, sum) in of_domains.iter_mut().enumerate() {
        let c = domains.clusters[n] as usize;
        of_clusters[c] += *sum / domains.cluster_volumes[c];
        *sum = *sum / domains.volumes[n];
    }
}
