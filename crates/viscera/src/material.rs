//! stub
#![allow(missing_docs)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MaterialModel { SaintVenantKirchhoff, StableNeoHookean }
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material { model: MaterialModel, young: f64, poisson: f64, density: f64, viscosity: f64 }
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("bad material")]
pub struct MaterialError;
impl Material {
    pub fn new(model: MaterialModel, young: f64, poisson: f64, density: f64) -> Result<Self, MaterialError> { Ok(Self { model, young, poisson, density, viscosity: 0.0 }) }
    pub fn with_viscosity(mut self, v: f64) -> Result<Self, MaterialError> { self.viscosity = v; Ok(self) }
    pub fn model(&self) -> MaterialModel { self.model }
    pub fn young(&self) -> f64 { self.young }
    pub fn poisson(&self) -> f64 { self.poisson }
    pub fn density(&self) -> f64 { self.density }
    pub fn viscosity(&self) -> f64 { self.viscosity }
    pub fn lame_lambda(&self) -> f64 { self.young * self.poisson / ((1.0 + self.poisson) * (1.0 - 2.0 * self.poisson)) }
    pub fn lame_mu(&self) -> f64 { self.young / (2.0 * (1.0 + self.poisson)) }
    pub fn compliance_matrix(&self) -> [[f64; 6]; 6] {
        let mut c = [[0.0; 6]; 6];
        for i in 0..3 { for j in 0..3 { c[i][j] = if i == j { 1.0 } else { -self.poisson } / self.young; } c[i + 3][i + 3] = 1.0 / self.lame_mu(); }
        c
    }
}
