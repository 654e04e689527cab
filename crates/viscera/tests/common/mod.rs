//! Helpers shared by the integration tests.
#![allow(dead_code)]

use viscera::material::{Material, MaterialModel};
use viscera::mesh::TetMesh;
use viscera::model::{Model, ModelBuilder};
use viscera::scalar::{Mat3, Real, Vec3, vec3};
use viscera::settings::Colors;

pub const STVK: MaterialModel = MaterialModel::SaintVenantKirchhoff;
pub const SNH: MaterialModel = MaterialModel::StableNeoHookean;

/// Seeded numbers (splitmix64): the same on every machine.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [low, high).
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn vector(&mut self, size: f64) -> Vec3<f64> {
        vec3(self.uniform(-size, size), self.uniform(-size, size), self.uniform(-size, size))
    }

    /// A rotation by a random angle about a random axis.
    pub fn rotation(&mut self) -> Mat3<f64> {
        loop {
            let [a, b] = [self.vector(1.0), self.vector(1.0)];
            let c = a.cross(b);
            if c.length() > 0.1 {
                let a = a * (1.0 / a.length());
                let c = c * (1.0 / c.length());
                return Mat3::from_columns(a, c.cross(a), c);
            }
        }
    }
}

pub fn material(model: MaterialModel, young: f64, poisson: f64) -> Material {
    Material::new(model, young, poisson, 1000.0).expect("a legal material")
}

/// One body of one material.
pub fn single_body<S: Real>(mesh: &TetMesh, material: &Material, colors: Colors) -> Model<S> {
    let mut builder = ModelBuilder::new();
    builder.add_body(mesh, material).expect("a legal body");
    builder.build(colors).expect("a legal model")
}
