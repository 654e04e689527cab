//! What the method chooses by itself where the settings do not.

use crate::material::MaterialConstants;
use crate::scalar::Real;
use crate::settings::{Count, MOST_HISTORY, SolverSettings};

/// Passes and pairs up to a Poisson's ratio: the fewest that follow a swinging bar of 1,280 and of 10,240 tetrahedra to
/// within about 4 %, with one step per frame (5 % at 0.49). What is nearly incompressible converges more slowly.
const BY_POISSON: [(f64, u32, u32); 3] = [(0.41, 8, 3), (0.46, 10, 10), (0.5, 16, 10)];

/// Passes per solve, for these materials.
pub fn passes<S: Real>(settings: &SolverSettings, materials: &[MaterialConstants<S>]) -> u32 {
    match settings.iterations {
        Count::Of(count) => count,
        Count::Auto => by_poisson(materials).0,
    }
}

/// Pairs that are kept, for these materials.
pub fn history<S: Real>(settings: &SolverSettings, materials: &[MaterialConstants<S>]) -> usize {
    let count = match settings.history {
        0 => by_poisson(materials).1,
        chosen => chosen,
    };
    (count as usize).min(MOST_HISTORY)
}

/// Of the least compressible material.
fn by_poisson<S: Real>(materials: &[MaterialConstants<S>]) -> (u32, u32) {
    let ratio = |material: &MaterialConstants<S>| {
        let [lambda, mu] = [material.lame_lambda, material.lame_mu].map(S::to_f64);
        0.5 * lambda / (lambda + mu)
    };
    let largest = materials.iter().map(ratio).fold(0.0, f64::max);
    let fits = |&&(limit, ..): &&(f64, u32, u32)| largest <= limit;
    let last = BY_POISSON[BY_POISSON.len() - 1];
    let (_, passes, pairs) = *BY_POISSON.iter().find(fits).unwrap_or(&last);
    (passes, pairs)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Material, MaterialModel};
    use crate::mesh::shapes;
    use crate::model::ModelBuilder;

    /// The least compressible of several materials decides; what is set is taken as it is.
    #[test]
    fn the_least_compressible_material_decides() {
        let mut builder = ModelBuilder::new();
        for poisson in [0.3, 0.45, 0.2] {
            let law = MaterialModel::StableNeoHookean;
            let tissue = Material::new(law, 1e4, poisson, 1000.0).expect("legal");
            let mesh = shapes::beam(0.04, 0.02, 0.02, 1, 0.0).expect("a beam");
            builder.add_body(&mesh, &tissue).expect("a body");
        }
        let materials = builder.build::<f32>().expect("a model").materials;
        let automatic = SolverSettings::default();
        assert_eq!((passes(&automatic, &materials), history(&automatic, &materials)), (10, 10));
        let soft = &materials[..1];
        assert_eq!((passes(&automatic, soft), history(&automatic, soft)), (8, 3));
        let set =
            SolverSettings { iterations: Count::Of(5), history: 2, ..SolverSettings::default() };
        assert_eq!((passes(&set, &materials), history(&set, &materials)), (5, 2));
    }
}
