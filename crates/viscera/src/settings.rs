//! stub
#![allow(missing_docs)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision { F32, F64 }
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colors { Unlimited, Limited(u32) }
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RelaxationForm { Consistent, Published }
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Acceleration { None, Chebyshev, Anderson }
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AndersonOn { Positions, Multipliers, Both }
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start { Auto, Predicted, Inertial, Previous }
#[derive(Clone, Debug, PartialEq)]
pub struct SolverSettings {
    pub precision: Precision, pub substeps: u32, pub iterations: u32, pub colors: Colors, pub relaxation: f64,
    pub relaxation_form: RelaxationForm, pub acceleration: Acceleration, pub chebyshev_radius: f64, pub chebyshev_delay: u32,
    pub chebyshev_damping: f64, pub anderson_window: u32, pub anderson_on: AndersonOn, pub residual_guard: bool, pub rebase: bool,
    pub rebase_factor: f64, pub keep_multipliers: bool, pub start: Start,
}
impl Default for SolverSettings { fn default() -> Self { Self { precision: Precision::F32, substeps: 20, iterations: 1, colors: Colors::Unlimited, relaxation: 1.0,
  relaxation_form: RelaxationForm::Consistent, acceleration: Acceleration::None, chebyshev_radius: 0.0, chebyshev_delay: 10, chebyshev_damping: 1.0, anderson_window: 5,
  anderson_on: AndersonOn::Both, residual_guard: true, rebase: false, rebase_factor: 1.0, keep_multipliers: false, start: Start::Auto } } }
